//! The directory of a study: `plan.json`, `models/` calibrated by the plan, `units/`, and `results/`.

use super::description::Study;
use super::error::DescriptionError;
use super::failure::StudyError;
use super::file::{self, beside};
use super::fingerprint::fingerprint;
use super::grid::Grid;
use super::plan::{NamedUnit, Plan, Shard, Unit};
use super::reader::unchanged;
use super::rules::MAX_UNITS;
use super::unit_file::{self, UnitFileError};
use crate::app::Context;
use crate::app::Input;
use crate::formats::difference::{self, Difference};
use crate::formats::{FileError, atomic, source};
use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A plan with its grid and its places.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The plan.
    pub plan: Plan,
    /// Its grid.
    pub grid: Grid,
    /// The study's file.
    pub study: PathBuf,
    /// The study's directory.
    pub directory: PathBuf,
}

/// The state of a unit's file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum UnitState {
    Whole,
    Missing,
    /// With the reason.
    Damaged(String),
}

/// What is there of a plan.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Status {
    /// Units of the plan.
    pub units: usize,
    /// Those that are there and whole.
    pub done: usize,
    /// Those that are there and damaged.
    pub damaged: usize,
    /// Cells all of whose units are done.
    pub cells_done: usize,
    /// Processor time of the units that are not done (s).
    pub left_s: f64,
    /// Names of units of another plan.
    pub foreign: Vec<String>,
}

/// The plan in a directory, if there is one.
pub(crate) fn plan_in(directory: &Path) -> Result<Option<Plan>, FileError> {
    let path = directory.join("plan.json");
    let text = match source::text(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(FileError::io(&path, e)),
    };
    let damaged = |line: usize, message: &str| {
        FileError::contents(path.display().to_string(), line, message)
            .advice("remove the directory and plan again")
    };
    let plan: Plan = serde_json::from_str(&text).map_err(|e| {
        damaged(
            e.line(),
            e.to_string().split(" at line ").next().unwrap_or_default(),
        )
    })?;
    let study = &plan.study;
    let sizes = [
        plan.unit_runs.len(),
        plan.trajectories.len(),
        plan.truths.len(),
        plan.models.len(),
    ];
    let wanted = [
        study.trajectory.len(),
        study.trajectory.len(),
        study.truth.len(),
        study.candidates().len(),
    ];
    // a scenario or receiver that no file gives is the default
    let given = [plan.scenarios.len(), plan.gnss.len()];
    let fits = |files: &Vec<Input>| files.len() == 1 || files.len() == study.truth.len();
    if sizes != wanted
        || given != [study.scenario.len(), study.gnss.len()]
        || !plan.models.iter().all(fits)
    {
        return Err(damaged(
            1,
            "its lists are not as long as those of its study",
        ));
    }
    Ok(Some(plan))
}

impl Planned {
    /// The plan in a directory, which must be that of the study, and have the seed if one is asked for.
    ///
    /// # Errors
    /// When there is no plan, or that of another study.
    pub fn open(study: &Path, directory: &Path, seed: Option<u64>) -> Result<Self, StudyError> {
        let file = file::read(study)?;
        let plan = plan_in(directory)?.ok_or_else(|| StudyError::NoPlan {
            directory: directory.to_owned(),
        })?;
        let planned = Self::new(study, directory, plan)?;
        planned.must_be_of(&file.study, seed)?;
        Ok(planned)
    }

    pub(crate) fn new(study: &Path, directory: &Path, plan: Plan) -> Result<Self, StudyError> {
        let refused = |e| StudyError::unfit(study.display(), e);
        let grid = Grid::new(&plan.study, &plan.scenarios, &plan.gnss).map_err(refused)?;
        let planned = Self {
            plan,
            grid,
            study: study.to_owned(),
            directory: directory.to_owned(),
        };
        planned.check_units()?;
        Ok(planned)
    }

    /// Refuses more units than a directory should hold.
    pub(super) fn check_units(&self) -> Result<(), StudyError> {
        let Self { plan, grid, .. } = self;
        let units = plan.unit_count(grid);
        if units <= MAX_UNITS {
            return Ok(());
        }
        let (key, value) = plan
            .study
            .unit_runs
            .map_or(("runs", plan.runs()), |runs| ("unit_runs", runs));
        let reason = format!("makes {units} units, more than {MAX_UNITS}");
        Err(StudyError::unfit(
            self.study.display(),
            DescriptionError::refused(key, value, reason),
        ))
    }

    /// Refuses another study than the one that was planned, and another seed. A study without a seed takes the plan's.
    pub(super) fn must_be_of(&self, study: &Study, seed: Option<u64>) -> Result<(), StudyError> {
        let other = |Difference { key, found, wanted }| {
            let plan = self.directory.join("plan.json");
            Err(StudyError::OtherStudy {
                plan,
                key,
                found,
                wanted,
            })
        };
        let planned = &self.plan;
        if let Some(seed) = seed.filter(|seed| *seed != planned.seed) {
            let [found, wanted] = [planned.seed, seed].map(|seed| seed.to_string());
            return other(Difference {
                key: "seed".to_owned(),
                found,
                wanted,
            });
        }
        let study = Study {
            seed: study.seed.or(planned.study.seed),
            ..study.clone()
        };
        let keys = |study: &Study| match serde_json::to_value(study) {
            Ok(serde_json::Value::Object(keys)) => keys,
            _ => serde_json::Map::new(),
        };
        difference::first(&keys(&planned.study), &keys(&study)).map_or(Ok(()), other)
    }

    /// Writes the plan.
    pub(super) fn write_plan(&self) -> Result<(), FileError> {
        let json =
            serde_json::to_string_pretty(&self.plan).expect("plain structs are always JSON") + "\n";
        atomic::write(&self.directory.join("plan.json"), json)
    }

    /// Refuses to compute with a build or on a machine that makes other numbers than the one that planned.
    pub(super) fn same_numbers(&self) -> Result<(), StudyError> {
        let planned = (self.plan.version.clone(), self.plan.numerics.clone());
        let here = (env!("CARGO_PKG_VERSION").to_owned(), fingerprint());
        if planned == here {
            Ok(())
        } else {
            Err(StudyError::OtherNumbers { planned, here })
        }
    }

    /// Refuses a study one of whose files is not what it was when the study was planned.
    /// A file that is not here (on another machine, say) has not changed.
    ///
    /// # Errors
    /// The file.
    pub(crate) fn inputs_unchanged(&self) -> Result<(), StudyError> {
        let files = self
            .plan
            .inputs
            .iter()
            .map(|i| (beside(&self.study, Path::new(&i.path)), &i.blake3));
        files
            .filter(|(path, _)| path.exists())
            .try_for_each(|(path, blake3)| unchanged(&path, blake3))
    }

    /// Processor time of all units by the plan's probe (s).
    pub(crate) fn processor_s(&self) -> f64 {
        self.plan
            .units(&self.grid)
            .map(|unit| self.plan.unit_s(&self.grid, unit))
            .sum()
    }

    /// The units of the plan and what is there of them: all of them are read.
    ///
    /// # Errors
    /// When the directory cannot be read.
    pub fn status(&self) -> Result<Status, StudyError> {
        let units = self.survey(Shard::ALL)?;
        let is_done = |(_, _, state): &&(Unit, String, UnitState)| *state == UnitState::Whole;
        let is_damaged =
            |(_, _, state): &&(Unit, String, UnitState)| matches!(state, UnitState::Damaged(_));
        let cells = units.chunk_by(|(a, ..), (b, ..)| a.cell == b.cell);
        let left = units.iter().filter(|unit| !is_done(unit));
        Ok(Status {
            units: units.len(),
            done: units.iter().filter(is_done).count(),
            damaged: units.iter().filter(is_damaged).count(),
            cells_done: cells
                .filter(|cell| cell.iter().all(|unit| is_done(&unit)))
                .count(),
            left_s: left
                .map(|(unit, ..)| self.plan.unit_s(&self.grid, *unit))
                .sum(),
            foreign: self.foreign()?,
        })
    }

    /// The units of a shard and what is there of each.
    pub(super) fn survey(
        &self,
        shard: Shard,
    ) -> Result<Vec<(Unit, String, UnitState)>, StudyError> {
        let present = self.unit_names()?;
        let state = |(unit, id): NamedUnit| {
            let state = match present
                .contains(&id)
                .then(|| unit_file::read(&self.directory, &id))
            {
                None | Some(Err(UnitFileError::Missing { .. })) => UnitState::Missing,
                Some(Ok(_)) => UnitState::Whole,
                Some(Err(e @ UnitFileError::Damaged { .. })) => UnitState::Damaged(e.to_string()),
                Some(Err(e)) => return Err(e.into()),
            };
            Ok((unit, id, state))
        };
        let units = self.plan.named_units(&self.grid).into_iter();
        units
            .filter(|(unit, _)| shard.has(unit.index))
            .map(state)
            .collect()
    }

    /// The units of which there is no file.
    pub(super) fn missing(&self) -> Result<Vec<NamedUnit>, StudyError> {
        let present = self.unit_names()?;
        let mut units = self.plan.named_units(&self.grid);
        units.retain(|(_, id)| !present.contains(id));
        Ok(units)
    }

    /// Names of the unit files that are not of this plan.
    fn foreign(&self) -> Result<Vec<String>, StudyError> {
        let mut present = self.unit_names()?;
        for (_, id) in self.plan.named_units(&self.grid) {
            present.remove(&id);
        }
        Ok(present.into_iter().collect())
    }

    /// Remarks unit files that another plan left in the directory.
    ///
    /// # Errors
    /// When the directory cannot be read.
    pub(crate) fn remark_foreign(&self, context: &Context<'_>) -> Result<(), StudyError> {
        let foreign = self.foreign()?;
        if let Some(first) = foreign.first() {
            let example = unit_file::path(&self.directory, first);
            let (units, example) = (foreign.len(), example.display());
            let text =
                format!("unit files of another plan are left out: {units}, such as {example}");
            context.warn(text);
        }
        Ok(())
    }

    /// The names of the units in the directory.
    fn unit_names(&self) -> Result<BTreeSet<String>, FileError> {
        let mut names = BTreeSet::new();
        for inner in entries(&self.directory.join("units"))? {
            for path in entries(&inner)? {
                let stem = path
                    .file_name()
                    .and_then(|n| n.to_str())
                    .and_then(|n| n.strip_suffix(".unit"));
                names.extend(stem.filter(|n| !n.starts_with('.')).map(str::to_owned));
            }
        }
        Ok(names)
    }
}

fn entries(path: &Path) -> Result<Vec<PathBuf>, FileError> {
    let io = |e| FileError::io(path, e);
    match fs::read_dir(path) {
        Ok(entries) => entries.map(|e| e.map(|e| e.path()).map_err(io)).collect(),
        Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            Ok(Vec::new())
        }
        Err(e) => Err(io(e)),
    }
}
