//! What the cells of a plan are made of, loaded when first needed and checked against the plan's hashes.

use super::directory;
use super::failure::StudyError;
use super::file::beside;
use super::grid::{Cell, Column};
use super::plan::Unit;
use super::planned::Planned;
use super::reader::{Reader, TruthSource};
use super::remark::Remark;
use crate::formats::{input, model_file};
use crate::observer::Observer;
use crate::report::Input;
use nav_sim_navigation::ekf::Belief;
use nav_sim_navigation::metrics::Expected;
use nav_sim_navigation::scenario::{Method, Reduction, Scenario};
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::{Outage, PlacedOutages};
use nav_sim_navigation::simulation::lincov::Track;
use nav_sim_navigation::simulation::{self, Experiment};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::noise::{Model, continuous};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Role of models that the plan calibrated.
pub(super) const CALIBRATED: &str = "calibrated";

/// Model files that are made and not written yet: path in the study's directory, contents.
pub(super) type ModelTexts = Vec<(String, String)>;

/// A cell, set up.
pub(super) enum Work<'a> {
    /// For runs.
    Sampling(simulation::Plan<'a>),
    /// For covariance analysis.
    Analysis(Analysis<'a>),
}

/// A covariance analysis of a cell.
pub(super) struct Analysis<'a> {
    track: &'a Track,
    experiment: &'a Experiment<'a>,
    truth: &'a Model,
    /// Names of the cell, and of its columns.
    names: (String, Vec<String>),
}

impl Analysis<'_> {
    /// What is expected of each column.
    pub(super) fn expected(&self) -> Result<Vec<Expected>, StudyError> {
        let of_column = |(belief, column): (&Belief, &String)| {
            let expected = Expected::along(self.track, self.experiment, belief, self.truth);
            expected
                .ok_or_else(|| StudyError::NotFinite { cell: self.names.0.clone(), column: column.clone() })
        };
        self.experiment.beliefs.par_iter().zip(&self.names.1).map(of_column).collect()
    }
}

/// Files of a plan; the last trajectory and truth are kept, since neighbouring cells share them.
pub(super) struct Inputs<'a> {
    planned: &'a Planned,
    reader: Reader<'a>,
    made: &'a [(String, String)],
    trajectory: Option<(usize, Arc<Trajectory>)>,
    truth: Option<(usize, Arc<TruthSource>)>,
    /// By path: a candidate that leaves out the truth's recordings has one a truth.
    models: HashMap<&'a str, Model>,
}

impl<'a> Inputs<'a> {
    pub(super) fn new(planned: &'a Planned, observer: &'a dyn Observer<Remark>) -> Self {
        let reader = Reader { study: &planned.study, observer };
        Self { planned, reader, made: &[], trajectory: None, truth: None, models: HashMap::new() }
    }

    /// With calibrated models that are not in the directory yet.
    pub(super) fn with_models(self, made: &'a ModelTexts) -> Self {
        Self { made, ..self }
    }

    /// Calls `f` with a cell, set up.
    pub(super) fn with_cell<T>(
        &mut self,
        cell: Cell,
        f: impl FnOnce(&Work<'_>) -> Result<T, StudyError>,
    ) -> Result<T, StudyError> {
        let scenario = self.planned.grid.scenario(cell, self.planned.plan.seed);
        self.set_up(cell, &scenario, f)
    }

    /// Refuses a cell whose parts do not fit together. Filters are reduced the quick way: what is refused is the same.
    pub(super) fn check_cell(&mut self, cell: Cell) -> Result<(), StudyError> {
        let mut scenario = self.planned.grid.scenario(cell, self.planned.plan.seed);
        scenario.filter.reduction = Reduction::Wavelet;
        self.set_up(cell, &scenario, |_| Ok(()))
    }

    fn set_up<T>(
        &mut self,
        cell: Cell,
        scenario: &Scenario,
        f: impl FnOnce(&Work<'_>) -> Result<T, StudyError>,
    ) -> Result<T, StudyError> {
        let (plan, grid) = (&self.planned.plan, &self.planned.grid);
        let trajectory = self.trajectory(cell.trajectory)?;
        let truth = self.truth(cell.truth)?;
        let outages = self.outages(cell)?.windows;
        let part = || grid.names(cell).join(", ");
        let truth_model;
        let truth = match &*truth {
            TruthSource::Recordings(recordings) => Truth::Static(recordings),
            TruthSource::Model(model) => {
                truth_model =
                    continuous::at_rate(model, scenario.imu.rate_hz).map_err(|e| unfit(part(), e))?;
                Truth::Model(&truth_model)
            }
        };
        let bare = scenario.experiment(&trajectory, truth, &[], &outages, plan.seed);
        let track = Track::along(&bare).map_err(|e| unfit(part(), e))?;
        let beliefs = self.beliefs(cell, scenario, &track, &outages)?;
        let experiment = Experiment { beliefs: &beliefs, ..bare };
        let work = match (plan.study.method, truth) {
            (Method::Lincov, Truth::Model(truth)) => {
                let columns = grid.columns.iter().map(|c| c.name.clone()).collect();
                Work::Analysis(Analysis {
                    track: &track,
                    experiment: &experiment,
                    truth,
                    names: (part(), columns),
                })
            }
            _ => Work::Sampling(simulation::Plan::new(&experiment).map_err(|e| unfit(part(), e))?),
        };
        f(&work)
    }

    /// The outages of a cell; refuses those that do not lie on its trajectory.
    pub(super) fn outages(&mut self, cell: Cell) -> Result<PlacedOutages, StudyError> {
        let trajectory = self.trajectory(cell.trajectory)?;
        let span_s = (trajectory.start_s(), trajectory.end_s());
        let Planned { plan, grid, study, .. } = self.planned;
        grid.scenario(cell, plan.seed).outages_on(span_s, plan.seed).map_err(|source| StudyError::Outage {
            place: format!("{}: {}", study.display(), grid.names(cell).join(", ")),
            source,
        })
    }

    /// Duration of a trajectory (s).
    pub(super) fn duration_s(&mut self, trajectory: usize) -> Result<f64, StudyError> {
        let trajectory = self.trajectory(trajectory)?;
        Ok(trajectory.end_s() - trajectory.start_s())
    }

    /// Whether a unit is there and what the plan says; what is wrong with it, if it is damaged.
    pub(super) fn finished(&mut self, (unit, id): (Unit, &str)) -> Result<Result<bool, String>, StudyError> {
        let outages = self.outages(self.planned.grid.cell(unit.cell))?.windows;
        let outages: Vec<(f64, f64)> = outages.iter().map(|o| (o.start_s, o.end_s)).collect();
        let columns = self.planned.grid.columns.len();
        Ok(directory::finished(&self.planned.directory, (unit, id), columns, &outages)?)
    }

    fn trajectory(&mut self, index: usize) -> Result<Arc<Trajectory>, StudyError> {
        if let Some((kept, trajectory)) = &self.trajectory
            && *kept == index
        {
            return Ok(Arc::clone(trajectory));
        }
        let plan = &self.planned.plan;
        let path = beside(&self.planned.study, &plan.study.trajectory[index].file);
        unchanged(&path, &plan.trajectories[index])?;
        let trajectory = Arc::new(self.reader.trajectory(&path)?);
        self.trajectory = Some((index, Arc::clone(&trajectory)));
        Ok(trajectory)
    }

    fn truth(&mut self, index: usize) -> Result<Arc<TruthSource>, StudyError> {
        if let Some((kept, truth)) = &self.truth
            && *kept == index
        {
            return Ok(Arc::clone(truth));
        }
        let plan = &self.planned.plan;
        let entry = &plan.study.truth[index];
        if self.reader.truth_hash(entry, plan.seed)? != plan.truths[index] {
            return Err(StudyError::Changed { what: format!("the truth \"{}\"", entry.name) });
        }
        let truth = Arc::new(self.reader.truth(entry, plan.seed)?);
        self.truth = Some((index, Arc::clone(&truth)));
        Ok(truth)
    }

    fn beliefs(
        &mut self,
        cell: Cell,
        scenario: &Scenario,
        track: &Track,
        outages: &[Outage],
    ) -> Result<Vec<Belief>, StudyError> {
        let grid = &self.planned.grid;
        let plan = &self.planned.plan;
        for column in &grid.columns {
            self.load_model(plan.model(column.candidate, cell.truth))?;
        }
        let models = &self.models;
        let belief = |column: &Column| {
            let mut variant = scenario.clone();
            variant.filter.states = grid.filter(cell, column);
            let part = || format!("candidate {}", column.name);
            let model = &models[plan.model(column.candidate, cell.truth).path.as_str()];
            let model = continuous::at_rate(model, scenario.imu.rate_hz).map_err(|e| unfit(part(), e))?;
            let belief = variant.belief(&model, outages, track);
            belief.map_err(|source| StudyError::NoFilter { part: part(), source })
        };
        grid.columns.par_iter().map(belief).collect()
    }

    fn load_model(&mut self, prepared: &'a Input) -> Result<(), StudyError> {
        if !self.models.contains_key(prepared.path.as_str()) {
            let model = self.read_model(prepared)?;
            self.models.insert(&prepared.path, model);
        }
        Ok(())
    }

    fn read_model(&self, model: &Input) -> Result<Model, StudyError> {
        if model.role != CALIBRATED {
            let path = beside(&self.planned.study, Path::new(&model.path));
            unchanged(&path, &model.blake3)?;
            return Ok(self.reader.model(&path)?.model);
        }
        let path = self.planned.directory.join(&model.path);
        if let Some((_, text)) = self.made.iter().find(|(made, _)| *made == model.path) {
            let file = model_file::from_text(&path, text)?;
            self.reader.doubt(file.doubts(&path));
            return Ok(file.model);
        }
        unchanged(&path, &model.blake3).map_err(|e| StudyError::CalibratedModel(Box::new(e)))?;
        Ok(self.reader.model(&path)?.model)
    }
}

fn unfit(part: String, e: impl std::error::Error + Send + Sync + 'static) -> StudyError {
    StudyError::Unfit { part, source: Box::new(e) }
}

/// Refuses a file that is not what it was when the study was planned.
pub(super) fn unchanged(path: &Path, blake3: &str) -> Result<(), StudyError> {
    if input::fingerprint(path)? == blake3 {
        return Ok(());
    }
    Err(StudyError::Changed { what: path.display().to_string() })
}
