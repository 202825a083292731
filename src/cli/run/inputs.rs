//! The files of a run.

use super::Args;
use crate::cli::{Failure, Session, read, turn_on};
use crate::formats::draws_file;
use crate::formats::model_file::ModelFile;
use crate::jobs::{NavigateInputs, TrueImu};
use crate::report::{Input, ModelNote};
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_signal::noise::Model;
use std::path::{Path, PathBuf};

/// What was read, ready to use.
pub(super) struct Inputs {
    pub(super) job: NavigateInputs,
    pub(super) note: ModelNote,
    /// Every file with its hash.
    pub(super) files: Vec<Input>,
}

impl Inputs {
    /// Reads them; the turn-on biases that the models state go into the scenario where it is silent.
    pub(super) fn read(args: &Args, scenario: &mut Scenario, session: &Session) -> Result<Self, Failure> {
        let imu_hz = scenario.imu.rate_hz;
        let files = files(args)?;
        let trajectory = read::trajectory(&args.trajectory, session)?;
        let (model, file) = model(&args.model, imu_hz, session)?;
        turn_on::expect(&mut scenario.initial, &file, &args.model, session);
        let truth = args.truth.as_deref().map(|path| self::model(path, imu_hz, session)).transpose()?;
        // recordings are their own truth: what they had of a constant bias is taken from them
        if args.recordings.is_empty() {
            let made_by = truth.as_ref().map_or(&file, |(_, file)| file);
            turn_on::make(&mut scenario.imu, made_by, args.truth.as_ref().unwrap_or(&args.model), session);
        }
        let recordings = match args.recordings.as_slice() {
            [] => Vec::new(),
            paths => read::recordings_at(paths, args.static_rate_hz, session)?,
        };
        let (truth, truth_file) = match truth {
            _ if !recordings.is_empty() => (TrueImu::Recordings(recordings), None),
            Some((model, file)) => (TrueImu::Model(model), Some(file)),
            None => (TrueImu::AsBelieved, None),
        };
        let analysed = scenario.run.method == Method::Lincov;
        let draws = |path: &Path, file: &ModelFile| {
            let found = analysed.then(|| draws_file::usable(path, &file.model, imu_hz))?;
            found.unwrap_or_else(|doubt| {
                session.warn(format!("{doubt}: no intervals from the calibration"));
                None
            })
        };
        let model_draws = draws(&args.model, &file);
        let truth_draws = args.truth.as_deref().zip(truth_file.as_ref());
        let truth_draws = truth_draws.and_then(|(path, file)| draws(path, file));
        let note = ModelNote { estimator: file.estimator() };
        let job = NavigateInputs { trajectory, model, truth, model_draws, truth_draws };
        Ok(Self { job, note, files })
    }
}

fn files(args: &Args) -> Result<Vec<Input>, Failure> {
    let mut named: Vec<(&str, PathBuf)> =
        vec![("trajectory", args.trajectory.clone()), ("model", args.model.clone())];
    named.extend(args.truth.iter().map(|p| ("truth", p.clone())));
    named.extend(read::listed(&args.recordings)?.into_iter().map(|p| ("static", p)));
    named.extend(args.scenario.iter().map(|p| ("scenario", p.clone())));
    named.extend(args.gnss.iter().map(|p| ("gnss", p.clone())));
    named.iter().map(|(role, path)| read::input(role, path)).collect()
}

/// A model at the rate of the IMU, and its file.
fn model(path: &Path, imu_hz: f64, session: &Session) -> Result<(Model, ModelFile), Failure> {
    let file = read::model(path, session)?;
    Ok((read::at_rate(path, &file.model, imu_hz, session)?, file))
}
