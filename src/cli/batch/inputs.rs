//! What the cells of a plan are made of, loaded when first needed and checked against the plan's hashes.

use super::Planned;
use crate::cli::{Failure, Session, read};
use nav_sim::ekf::Belief;
use nav_sim::formats::{contamination_file, hash, model_file, study_directory, study_file};
use nav_sim::imu::Recording;
use nav_sim::noise::{Model, continuous};
use nav_sim::scenario::Scenario;
use nav_sim::sensors::imu::Truth;
use nav_sim::sensors::outage::{Outage, PlacedOutages};
use nav_sim::simulation;
use nav_sim::study::{Cell, Material, Synthesis, TruthEntry, Unit};
use nav_sim::trajectory::Trajectory;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What makes the errors.
pub(super) enum Source {
    Model(Model),
    Recordings(Vec<Recording>),
}

/// Files of a plan; the last trajectory and truth are kept, since neighbouring cells share them.
pub(super) struct Inputs<'a> {
    planned: &'a Planned,
    study: &'a Path,
    session: &'a Session,
    trajectory: Option<(usize, Arc<Trajectory>)>,
    truth: Option<(usize, Arc<Source>)>,
    models: HashMap<usize, Model>,
}

impl<'a> Inputs<'a> {
    pub(super) fn new(planned: &'a Planned, study: &'a Path, session: &'a Session) -> Self {
        Self { planned, study, session, trajectory: None, truth: None, models: HashMap::new() }
    }

    /// Calls `f` with the simulation of a cell.
    pub(super) fn with_cell<T>(
        &mut self,
        cell: Cell,
        f: impl FnOnce(&simulation::Plan<'_>) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let (plan, grid) = (&self.planned.plan, &self.planned.grid);
        let scenario = grid.scenario(cell, plan.seed);
        let trajectory = self.trajectory(cell.trajectory)?;
        let truth = self.truth(cell.truth)?;
        let at = |e: &dyn std::fmt::Display| Failure::input(format!("{}: {e}", grid.names(cell).join(", ")));
        let span = (trajectory.start_s(), trajectory.end_s());
        let outages = self.placed(cell, span)?.windows;
        let beliefs = self.beliefs(cell, &scenario, &trajectory, &outages)?;
        let truth_model;
        let truth = match &*truth {
            Source::Recordings(recordings) => Truth::Static(recordings),
            Source::Model(model) => {
                truth_model = continuous::at_rate(model, scenario.imu.rate_hz).map_err(|e| at(&e))?;
                Truth::Model(&truth_model)
            }
        };
        let experiment = scenario.experiment(&trajectory, truth, &beliefs, &outages, plan.seed);
        let simulation = simulation::Plan::new(&experiment).map_err(|e| at(&e))?;
        f(&simulation)
    }

    /// The outages of a cell; refuses those that do not lie on its trajectory.
    pub(super) fn outages(&mut self, cell: Cell) -> Result<PlacedOutages, Failure> {
        let trajectory = self.trajectory(cell.trajectory)?;
        self.placed(cell, (trajectory.start_s(), trajectory.end_s()))
    }

    fn placed(&self, cell: Cell, span: (f64, f64)) -> Result<PlacedOutages, Failure> {
        let (plan, grid) = (&self.planned.plan, &self.planned.grid);
        grid.scenario(cell, plan.seed).outages_on(span, plan.seed).map_err(|e| {
            let place = format!("{}: {}", self.study.display(), grid.names(cell).join(", "));
            Failure::from(e).within(&place)
        })
    }

    /// Duration of a trajectory (s).
    pub(super) fn duration_s(&mut self, trajectory: usize) -> Result<f64, Failure> {
        let trajectory = self.trajectory(trajectory)?;
        Ok(trajectory.end_s() - trajectory.start_s())
    }

    fn trajectory(&mut self, index: usize) -> Result<Arc<Trajectory>, Failure> {
        if let Some((kept, trajectory)) = &self.trajectory
            && *kept == index
        {
            return Ok(Arc::clone(trajectory));
        }
        let plan = &self.planned.plan;
        let path = study_file::beside(self.study, &plan.study.trajectory[index].file);
        unchanged(&path, &plan.trajectories[index])?;
        let trajectory = Arc::new(read::trajectory(&path, self.session)?);
        self.trajectory = Some((index, Arc::clone(&trajectory)));
        Ok(trajectory)
    }

    fn truth(&mut self, index: usize) -> Result<Arc<Source>, Failure> {
        if let Some((kept, truth)) = &self.truth
            && *kept == index
        {
            return Ok(Arc::clone(truth));
        }
        let plan = &self.planned.plan;
        let entry = &plan.study.truth[index];
        let found = truth_hash(self.study, entry, plan.seed)?;
        if found != plan.truths[index] {
            return Err(changed(&format!("the truth \"{}\"", entry.name)));
        }
        let truth = Arc::new(source(self.study, entry, plan.seed, self.session)?);
        self.truth = Some((index, Arc::clone(&truth)));
        Ok(truth)
    }

    fn beliefs(
        &mut self,
        cell: Cell,
        scenario: &Scenario,
        trajectory: &Trajectory,
        outages: &[Outage],
    ) -> Result<Vec<Belief>, Failure> {
        let grid = &self.planned.grid;
        let mut beliefs = Vec::new();
        for column in &grid.columns {
            let mut own = scenario.clone();
            own.filter.states = grid.filter(cell, column);
            let model = self.model(column.candidate)?;
            let at = |e: &dyn std::fmt::Display| Failure::input(format!("candidate {}: {e}", column.name));
            let model = continuous::at_rate(model, scenario.imu.rate_hz).map_err(|e| at(&e))?;
            let track = own.track(trajectory, &model, outages).map_err(|e| at(&e))?;
            beliefs.push(own.belief(&model, outages, &track).map_err(|e| at(&e))?);
        }
        Ok(beliefs)
    }

    fn model(&mut self, candidate: usize) -> Result<&Model, Failure> {
        if !self.models.contains_key(&candidate) {
            let model = &self.planned.plan.models[candidate];
            let path = model_path(self.study, &self.planned.directory, &model.role, &model.path);
            let whole = unchanged(&path, &model.blake3);
            if model.role == CALIBRATED {
                whole.map_err(|e| e.hint("`nav-sim batch plan` makes it anew"))?;
            } else {
                whole?;
            }
            self.models.insert(candidate, read::model(&path, self.session)?.model);
        }
        Ok(&self.models[&candidate])
    }
}

/// Whether a unit is there and what the plan says; what is wrong with it, if it is damaged.
pub(super) fn finished(
    planned: &Planned,
    (unit, id): (Unit, &str),
    inputs: &mut Inputs<'_>,
) -> Result<Result<bool, String>, Failure> {
    let outages = inputs.outages(planned.grid.cell(unit.cell))?.windows;
    let outages: Vec<(f64, f64)> = outages.iter().map(|o| (o.start_s, o.end_s)).collect();
    let columns = planned.grid.columns.len();
    study_directory::finished(&planned.directory, (unit, id), columns, &outages).map_err(Failure::could_not)
}

/// Role of models that the plan calibrated.
pub(super) const CALIBRATED: &str = "calibrated";

/// Where the model of a candidate is.
pub(super) fn model_path(study: &Path, directory: &Path, role: &str, path: &str) -> PathBuf {
    if role == CALIBRATED { directory.join(path) } else { study_file::beside(study, Path::new(path)) }
}

/// Refuses a file that is not what it was when the study was planned.
fn unchanged(path: &Path, blake3: &str) -> Result<(), Failure> {
    let shown = path.display().to_string();
    let found = hash::of_file(path).map_err(|e| Failure::could_not(format!("{shown}: {e}")))?;
    if found == blake3 { Ok(()) } else { Err(changed(&shown)) }
}

fn changed(what: &str) -> Failure {
    let failure = Failure::input(format!("{what} has changed since the study was planned"));
    failure.hint("put it back, or plan into another directory with --out")
}

/// The files behind a list of recordings, directories in name order.
pub(super) fn listed(study: &Path, recordings: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let paths: Vec<PathBuf> = recordings.iter().map(|p| study_file::beside(study, p)).collect();
    read::listed(&paths)
}

fn file_hash(path: &Path) -> Result<String, Failure> {
    hash::of_file(path).map_err(|e| Failure::could_not(format!("{}: {e}", path.display())))
}

/// Hash of what makes a truth: files, and how virtual recordings are made.
pub(super) fn truth_hash(study: &Path, entry: &TruthEntry, seed: u64) -> Result<String, Failure> {
    if let Some(model) = &entry.model {
        return file_hash(&study_file::beside(study, model));
    }
    let mut hasher = blake3::Hasher::new();
    for file in listed(study, &entry.recordings)? {
        hasher.update(file_hash(&file)?.as_bytes());
    }
    if let Some(step) = &entry.synthesize {
        hasher.update(synthesis_hash(study, step, seed.wrapping_add(TRUTH_SEED))?.as_bytes());
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// What is added to the study's seed for virtual recordings of truths, and of candidates.
const TRUTH_SEED: u64 = 2;
pub(super) const CANDIDATE_SEED: u64 = 1;

fn synthesis_hash(study: &Path, step: &Synthesis, seed: u64) -> Result<String, Failure> {
    let mut step = step.clone();
    step.seed = Some(step.seed.unwrap_or(seed));
    let model = study_file::beside(study, &step.model);
    let rate_hz = model_file::read(&model)?.model.rate_hz;
    let contamination = contamination(study, &step, rate_hz)?.map(|c| format!("{:?}", c.rules));
    let text = format!("{step:?} {} {contamination:?}", file_hash(&model)?);
    Ok(blake3::hash(text.as_bytes()).to_hex().to_string())
}

fn contamination(
    study: &Path,
    step: &Synthesis,
    rate_hz: f64,
) -> Result<Option<nav_sim::noise::contamination::Contamination>, Failure> {
    let Some(name) = &step.contaminate else { return Ok(None) };
    let preset = contamination_file::names().contains(&name.as_str());
    let place = study_file::beside(study, Path::new(name));
    let found = if preset {
        contamination_file::find(name, rate_hz)
    } else {
        contamination_file::find(&place.to_string_lossy(), rate_hz)
    };
    let meant = contamination_file::meant(name).filter(|_| !place.exists());
    found.map(Some).map_err(|e| Failure::from(e).maybe_hint(meant.map(|m| format!("did you mean \"{m}\"?"))))
}

/// Virtual recordings of a study.
pub(super) fn synthesised(
    study: &Path,
    step: &Synthesis,
    seed: u64,
    session: &Session,
) -> Result<Vec<Recording>, Failure> {
    let file = read::model(&study_file::beside(study, &step.model), session)?;
    let contamination = contamination(study, step, file.model.rate_hz)?;
    let material = Material {
        step,
        model: &file.model,
        spread: file.spread.as_ref(),
        contamination: contamination.as_ref(),
        seed,
    };
    if step.spread && file.spread.is_none() {
        let message =
            format!("{}: has no [spread], which \"spread = true\" draws from", step.model.display());
        return Err(Failure::input(message));
    }
    Ok(material.recordings()?)
}

fn source(study: &Path, entry: &TruthEntry, seed: u64, session: &Session) -> Result<Source, Failure> {
    if let Some(model) = &entry.model {
        return Ok(Source::Model(read::model(&study_file::beside(study, model), session)?.model));
    }
    if let Some(step) = &entry.synthesize {
        let seed = seed.wrapping_add(TRUTH_SEED);
        return Ok(Source::Recordings(synthesised(study, step, seed, session)?));
    }
    let paths: Vec<PathBuf> = entry.recordings.iter().map(|p| study_file::beside(study, p)).collect();
    Ok(Source::Recordings(read::recordings_at(&paths, None, session)?))
}
