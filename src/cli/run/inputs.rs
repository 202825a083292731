//! The files of a run.

use super::Args;
use crate::cli::{Failure, Session, read, turn_on};
use crate::formats::draws_file::{self, Draws};
use crate::formats::model_file::ModelFile;
use crate::imu::{Recording, Sensor};
use crate::jobs::{NavigateInputs, TrueImu};
use crate::noise::Model;
use crate::report::{Input, ModelNote};
use crate::scenario::{Method, Scenario};
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
        recordings.iter().filter_map(motion).for_each(|doubt| session.printer.warn(&doubt));
        let (truth, truth_file) = match truth {
            _ if !recordings.is_empty() => (TrueImu::Recordings(recordings), None),
            Some((model, file)) => (TrueImu::Model(model), Some(file)),
            None => (TrueImu::AsBelieved, None),
        };
        let analysed = scenario.run.method == Method::Lincov;
        let draws = |path: &Path, file: &ModelFile| {
            if analysed { self::draws(path, file, imu_hz, session) } else { None }
        };
        let model_draws = draws(&args.model, &file);
        let truth_draws = args.truth.as_deref().zip(truth_file.as_ref());
        let truth_draws = truth_draws.and_then(|(path, file)| draws(path, file));
        let note = ModelNote { estimator: estimator(&file) };
        let job = NavigateInputs { trajectory, model, truth, model_draws, truth_draws };
        Ok(Self { job, note, files })
    }
}

/// Means over a second that differ so much are motion, not noise: m/s², rad/s.
const MOTION: (f64, f64) = (0.5, 0.05);

/// Says where a recording is not static.
fn motion(recording: &Recording) -> Option<String> {
    let second = (recording.rate_hz.round() as usize).max(1);
    recording.signals.iter().find_map(|signal| {
        let limit = if signal.channel.sensor == Sensor::Accel { MOTION.0 } else { MOTION.1 };
        let means = signal.samples.chunks_exact(second).map(|c| c.iter().sum::<f64>() / second as f64);
        let (low, high) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), m| (l.min(m), h.max(m)));
        let message = format!(
            "{}: not static? The mean over a second of {} goes from {:.3} to {:.3} {}: motion becomes errors of the \
             IMU",
            recording.name,
            signal.channel,
            low + signal.mean,
            high + signal.mean,
            signal.channel.sensor.unit()
        );
        (high - low > limit).then_some(message)
    })
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

/// The draws beside a calibrated model, at the rate of the IMU. The analysis does without those it cannot use.
fn draws(path: &Path, file: &ModelFile, imu_hz: f64, session: &Session) -> Option<Draws> {
    let beside = draws_file::beside(path).display().to_string();
    let draws = match draws_file::read(path) {
        Ok(draws) => draws?,
        Err(e) => {
            session.printer.warn(&format!("{e}: no intervals from the calibration"));
            return None;
        }
    };
    let found = draws.draws(&file.model).and_then(|draws| draws.at_rate(imu_hz).ok());
    if found.is_none() {
        session
            .printer
            .warn(&format!("{beside} is not of {}: no intervals from the calibration", path.display()));
    }
    found
}

/// The estimator that made a model, if known.
fn estimator(file: &ModelFile) -> Option<String> {
    let estimator = file.provenance.as_ref()?.get("estimator")?;
    estimator.as_str().map(str::to_owned)
}
