//! The cells of a plan, set up from its files and computed. A file must be what it was when the study was planned.

use super::failure::StudyError;
use super::file::beside;
use super::grid::{Cell, Column};
use super::plan::{CALIBRATED, Unit};
use super::planned::Planned;
use super::reader::{Reader, TruthSource, unchanged};
use super::unit::{Finding, UnitResult};
use crate::app::Context;
use crate::app::Input;
use crate::formats::{hash, model_file};
use nav_sim_navigation::ekf::{Belief, BeliefError};
use nav_sim_navigation::metrics::Expected;
use nav_sim_navigation::monte_carlo;
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

/// A cell, set up.
pub(super) enum Work<'a> {
    /// For runs.
    Sampling(&'a simulation::Plan<'a>),
    /// For covariance analysis.
    Analysis {
        track: &'a Track,
        experiment: &'a Experiment<'a>,
        truth: &'a Model,
    },
}

impl Work<'_> {
    /// The result of a unit; `None` if the context stopped on the way.
    pub(super) fn unit(
        &self,
        planned: &Planned,
        (unit, id): (Unit, &str),
        context: &Context<'_>,
    ) -> Result<Option<UnitResult>, StudyError> {
        let progress = |runs| context.advance(runs);
        let mut columns: Vec<Finding> = match self {
            Self::Sampling(plan) => {
                let go_on = || context.go_on();
                match monte_carlo::run_range(plan, unit.first, unit.runs, &go_on, &progress) {
                    Some(results) => results.into_iter().map(Finding::Sampled).collect(),
                    None => return Ok(None),
                }
            }
            Self::Analysis {
                track,
                experiment,
                truth,
            } => {
                let grid = &planned.grid;
                let of_column = |(belief, column): (&Belief, &Column)| {
                    let expected =
                        Expected::along(track, experiment, belief, truth).map(Finding::Expected);
                    let cell = || grid.names(grid.cell(unit.cell)).join(", ");
                    expected.ok_or_else(|| StudyError::NotFinite {
                        cell: cell(),
                        column: column.name.clone(),
                    })
                };
                let columns = experiment
                    .beliefs
                    .par_iter()
                    .zip(&grid.columns)
                    .map(of_column);
                let columns = columns.collect::<Result<_, _>>()?;
                progress(unit.runs);
                columns
            }
        };
        columns
            .iter_mut()
            .for_each(|finding| finding.reduce(planned.plan.kept()));
        Ok(Some(UnitResult {
            id: id.to_owned(),
            first: unit.first,
            runs: unit.runs,
            columns,
        }))
    }
}

/// Files of a plan; the last trajectory and truth are kept, since neighbouring cells share them.
pub(super) struct Inputs<'a> {
    planned: &'a Planned,
    reader: Reader<'a>,
    /// Calibrated models that are not in the directory yet.
    made: &'a [(String, String)],
    trajectory: Option<(usize, Arc<Trajectory>)>,
    truth: Option<(usize, Arc<TruthSource>)>,
    /// By path: a candidate that leaves out the truth's recordings has one a truth.
    models: HashMap<&'a str, Model>,
}

impl<'a> Inputs<'a> {
    pub(super) fn new(
        planned: &'a Planned,
        made: &'a [(String, String)],
        context: &'a Context<'a>,
    ) -> Self {
        let reader = Reader {
            study: &planned.study,
            context,
        };
        Self {
            planned,
            reader,
            made,
            trajectory: None,
            truth: None,
            models: HashMap::new(),
        }
    }

    /// Calls `f` with a cell, set up.
    pub(super) fn with_cell<T>(
        &mut self,
        cell: Cell,
        f: impl FnOnce(&Work<'_>) -> Result<T, StudyError>,
    ) -> Result<T, StudyError> {
        self.set_up(
            cell,
            &self.planned.grid.scenario(cell, self.planned.plan.seed),
            f,
        )
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
        let Planned { plan, grid, .. } = self.planned;
        let trajectory = self.trajectory(cell.trajectory)?;
        let truth = self.truth(cell.truth)?;
        let outages = self.outages(cell)?.windows;
        let name = grid.names(cell).join(", ");
        let truth_model;
        let truth = match &*truth {
            TruthSource::Recordings(recordings) => Truth::Static(recordings),
            TruthSource::Model(model) => {
                let model = continuous::at_rate(model, scenario.imu.rate_hz);
                truth_model = model.map_err(|e| StudyError::unfit(&name, e))?;
                Truth::Model(&truth_model)
            }
        };
        let bare = scenario.experiment(&trajectory, truth, &[], &outages, plan.seed);
        let track = Track::along(&bare).map_err(|e| StudyError::unfit(&name, e))?;
        let beliefs = self.beliefs(cell, scenario, &track, &outages)?;
        let experiment = Experiment {
            beliefs: &beliefs,
            ..bare
        };
        let sampling;
        f(&match (plan.study.method, truth) {
            (Method::Lincov, Truth::Model(truth)) => Work::Analysis {
                track: &track,
                experiment: &experiment,
                truth,
            },
            _ => {
                sampling =
                    simulation::Plan::new(&experiment).map_err(|e| StudyError::unfit(&name, e))?;
                Work::Sampling(&sampling)
            }
        })
    }

    /// The outages of a cell; refuses those that do not lie on its trajectory.
    pub(super) fn outages(&mut self, cell: Cell) -> Result<PlacedOutages, StudyError> {
        let trajectory = self.trajectory(cell.trajectory)?;
        let span_s = (trajectory.start_s(), trajectory.end_s());
        let Planned {
            plan, grid, study, ..
        } = self.planned;
        grid.scenario(cell, plan.seed)
            .outages_on(span_s, plan.seed)
            .map_err(|e| StudyError::Unfit {
                part: format!("{}: {}", study.display(), grid.names(cell).join(", ")),
                reason: e.to_string(),
                hint: e.hint().map(str::to_owned),
            })
    }

    /// Duration of a trajectory (s).
    pub(super) fn duration_s(&mut self, trajectory: usize) -> Result<f64, StudyError> {
        let trajectory = self.trajectory(trajectory)?;
        Ok(trajectory.end_s() - trajectory.start_s())
    }

    fn trajectory(&mut self, index: usize) -> Result<Arc<Trajectory>, StudyError> {
        let Planned { plan, study, .. } = self.planned;
        kept(&mut self.trajectory, index, || {
            let path = beside(study, &plan.study.trajectory[index].file);
            unchanged(&path, &plan.trajectories[index])?;
            Ok(self.reader.trajectory(&path)?)
        })
    }

    fn truth(&mut self, index: usize) -> Result<Arc<TruthSource>, StudyError> {
        let plan = &self.planned.plan;
        kept(&mut self.truth, index, || {
            let entry = &plan.study.truth[index];
            if self.reader.truth_hash(entry, plan.seed)? != plan.truths[index] {
                return Err(StudyError::Changed {
                    what: format!("the truth \"{}\"", entry.name),
                });
            }
            self.reader.truth(entry, plan.seed)
        })
    }

    fn beliefs(
        &mut self,
        cell: Cell,
        scenario: &Scenario,
        track: &Track,
        outages: &[Outage],
    ) -> Result<Vec<Belief>, StudyError> {
        let Planned { plan, grid, .. } = self.planned;
        for column in &grid.columns {
            let file = plan.model(column.candidate, cell.truth);
            if !self.models.contains_key(file.path.as_str()) {
                let model = self.model(file)?;
                self.models.insert(&file.path, model);
            }
        }
        let models = &self.models;
        let belief = |column: &Column| {
            let mut variant = scenario.clone();
            variant.filter.states = grid.filter(cell, column);
            let part = format!("candidate {}", column.name);
            let model = &models[plan.model(column.candidate, cell.truth).path.as_str()];
            let model = continuous::at_rate(model, scenario.imu.rate_hz);
            let model = model.map_err(|e| StudyError::unfit(&part, e))?;
            variant.belief(&model, outages, track).map_err(|e| StudyError::Unfit {
                part,
                reason: e.to_string(),
                // fixes are too rare to reduce a model
                hint: matches!(e, BeliefError::Setting(_)).then(|| {
                    "raise it, or take the full filter alone (filters = [\"full\"]), which reduces nothing".to_owned()
                }),
            })
        };
        grid.columns.par_iter().map(belief).collect()
    }

    fn model(&self, model: &Input) -> Result<Model, StudyError> {
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
        if hash::of_file(&path).is_ok_and(|found| found == model.blake3) {
            return Ok(self.reader.model(&path)?.model);
        }
        Err(StudyError::LostModel { path })
    }
}

/// What was loaded last, if it is of this index; else it is loaded.
fn kept<T>(
    last: &mut Option<(usize, Arc<T>)>,
    index: usize,
    load: impl FnOnce() -> Result<T, StudyError>,
) -> Result<Arc<T>, StudyError> {
    match last {
        Some((kept, value)) if *kept == index => Ok(Arc::clone(value)),
        _ => {
            let value = Arc::new(load()?);
            *last = Some((index, Arc::clone(&value)));
            Ok(value)
        }
    }
}
