//! A study that has been planned, opened again.

use super::directory;
use super::failure::StudyError;
use super::file::{self, beside};
use super::fingerprint::fingerprint;
use super::grid::Grid;
use super::inputs::unchanged;
use super::plan::{Plan, Unit};
use super::remark::Remark;
use super::unit_file;
use crate::observer::Observer;
use std::collections::BTreeSet;
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

impl Planned {
    /// The plan in a directory, which must be that of the study, and have the seed if one is asked for.
    ///
    /// # Errors
    /// When there is no plan, or that of another study.
    pub fn open(study: &Path, directory: &Path, seed: Option<u64>) -> Result<Self, StudyError> {
        let file = file::read(study)?;
        Self::new(study, directory, directory::plan_of(directory, &file.study, seed)?)
    }

    pub(super) fn new(study: &Path, directory: &Path, plan: Plan) -> Result<Self, StudyError> {
        let refused = |source| StudyError::Description { study: study.to_owned(), source };
        let grid = plan.grid().map_err(refused)?;
        Ok(Self { plan, grid, study: study.to_owned(), directory: directory.to_owned() })
    }

    /// Refuses to compute with a build or on a machine that makes other numbers than the one that planned.
    pub(super) fn same_numbers(&self) -> Result<(), StudyError> {
        let planned = (self.plan.version.clone(), self.plan.numerics.clone());
        let here = (env!("CARGO_PKG_VERSION").to_owned(), fingerprint());
        if planned == here { Ok(()) } else { Err(StudyError::OtherNumbers { planned, here }) }
    }

    /// Refuses a study one of whose files is not what it was when the study was planned: what is done is no result of it.
    /// A file that is not here (on another machine, say) has not changed.
    ///
    /// # Errors
    /// The file.
    pub(crate) fn inputs_unchanged(&self) -> Result<(), StudyError> {
        let files = self.plan.inputs.iter().map(|i| (beside(&self.study, Path::new(&i.path)), &i.blake3));
        files.filter(|(path, _)| path.exists()).try_for_each(|(path, blake3)| unchanged(&path, blake3))
    }

    /// Processor time of all units by the plan's probe (s).
    pub(crate) fn processor_s(&self) -> f64 {
        self.plan.units(&self.grid).map(|unit| self.plan.unit_s(&self.grid, unit)).sum()
    }

    /// What the longest unit takes by the plan's probe (s) on so many threads.
    pub(crate) fn longest_unit_s(&self, threads: u64) -> f64 {
        let wall_s = |unit: Unit| {
            let batches = unit.runs.div_ceil(self.plan.lanes());
            self.plan.unit_s(&self.grid, unit) / threads.clamp(1, batches.max(1)) as f64
        };
        self.plan.units(&self.grid).map(wall_s).fold(0.0, f64::max)
    }

    /// What is there of the units; whether they are whole is not looked at.
    ///
    /// # Errors
    /// When the directory cannot be read.
    pub fn status(&self) -> Result<Status, StudyError> {
        self.status_by(&|_| true)
    }

    /// What is there of the units and whole: all of them are read.
    ///
    /// # Errors
    /// When the directory cannot be read.
    pub(crate) fn status_of_whole(&self) -> Result<Status, StudyError> {
        self.status_by(&|id| unit_file::read(&self.directory, id).is_ok())
    }

    fn status_by(&self, is_whole: &dyn Fn(&str) -> bool) -> Result<Status, StudyError> {
        let mut present = directory::units(&self.directory)?;
        let (plan, grid) = (&self.plan, &self.grid);
        let mut status = Status::default();
        let mut cell_whole = true;
        for (unit, id) in plan.named_units(grid) {
            let is_there = present.remove(&id);
            let done = is_there && is_whole(&id);
            status.units += 1;
            status.damaged += usize::from(is_there && !done);
            status.done += usize::from(done);
            cell_whole &= done;
            if !done {
                status.left_s += plan.unit_s(grid, unit);
                status.missing.push((unit, id));
            }
            if unit.first + unit.runs == plan.runs() {
                status.cells_done += usize::from(cell_whole);
                cell_whole = true;
            }
        }
        status.foreign = present;
        Ok(status)
    }

    /// How many unit files are not of this plan, and where.
    pub(crate) fn foreign_units(&self, status: &Status) -> Option<Remark> {
        let first = status.foreign.first()?;
        let example = unit_file::path(&self.directory, first);
        Some(Remark::ForeignUnits { units: status.foreign.len(), example })
    }

    /// The results that another plan left here, if there are any.
    pub(super) fn stale_results(&self) -> Option<PathBuf> {
        let path = self.directory.join("results");
        let text = std::fs::read_to_string(path.join("study.json")).ok()?;
        let summary: serde_json::Value = serde_json::from_str(&text).ok()?;
        (summary["plan"] != self.plan.id().as_str()).then_some(path)
    }

    /// Remarks what other plans left in the directory.
    pub(super) fn remark_leftovers(&self, observer: &dyn Observer<Remark>) -> Result<(), StudyError> {
        if let Some(remark) = self.foreign_units(&self.status()?) {
            observer.remark(&remark);
        }
        if let Some(path) = self.stale_results() {
            observer.remark(&Remark::StaleResults { path });
        }
        Ok(())
    }
}

/// What is there of a plan.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Status {
    /// Units of the plan.
    pub units: usize,
    /// Those that are there.
    pub done: usize,
    /// Those that are there and not whole, where that was looked at.
    pub damaged: usize,
    /// Cells all of whose units are there.
    pub cells_done: usize,
    /// Processor time of the units that are not there (s).
    pub left_s: f64,
    /// These units, with their names.
    pub missing: Vec<(Unit, String)>,
    /// Names of units of another plan.
    pub foreign: BTreeSet<String>,
}
