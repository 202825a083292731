//! Reading inputs for commands: doubts are said, refusals become failures.

use super::exit::option_for;
use super::run::Words;
use super::{Failure, Session};
use crate::formats::input;
use crate::formats::model_file::ModelFile;
use crate::formats::{FileError, Setting};
use crate::report::Input;
use crate::run::{RunError, read};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::outage::{Outage, PlacedOutages};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::Recording;
use nav_sim_signal::noise::Model;
use std::path::{Path, PathBuf};

/// For commands without the option `--origin`: `trajectory convert` has it.
pub(super) fn without_options(e: FileError) -> Failure {
    Failure::of_file(&e, |setting| Some(elsewhere(setting)))
}

/// What helps where the setting is no option of the command.
const fn elsewhere(setting: Setting) -> &'static str {
    match setting {
        Setting::Origin => {
            "write it with latitude and longitude: nav-sim trajectory convert FILE --origin LAT_DEG,LON_DEG,H_M"
        }
        other => option_for(other),
    }
}

/// For files that a study names: its keys have the place of options.
pub(super) fn of_study(e: &FileError) -> Failure {
    Failure::of_file(e, |setting| {
        Some(match setting {
            Setting::Rate => "set rate_hz beside the recordings in the study file",
            Setting::WrongRate => "leave rate_hz out of the study file, or correct it",
            other => elsewhere(other),
        })
    })
}

/// A recording to be fused: all six channels are needed, as the file names them: without the options of the commands for static recordings.
pub(super) fn refused_for_fusion(e: FileError) -> Failure {
    Failure::of_file(&e, |setting| match setting {
        Setting::ColumnNames => Some("correct the header"),
        Setting::Channels | Setting::FewerChannels | Setting::Gaps => None,
        Setting::RemoveLine => Some("remove the line: gaps of up to 5 s are bridged"),
        other => Some(elsewhere(other)),
    })
}

/// An input with its fingerprint, of the bytes that were read.
pub(super) fn input(role: &str, path: &Path) -> Result<Input, Failure> {
    Ok(input::input(role, path)?)
}

/// The files themselves and those of directories, in name order.
pub(super) fn listed(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    Ok(input::listed(paths)?)
}

/// A trajectory.
pub(super) fn trajectory(path: &Path, session: &Session) -> Result<Trajectory, Failure> {
    read::trajectory(path, &Words::new(session)).map_err(without_options)
}

/// The outages on a trajectory; what is doubtful about them is said.
pub(super) fn placed(
    scenario: &Scenario,
    span_s: (f64, f64),
    seed: u64,
    session: &Session,
) -> Result<Vec<Outage>, Failure> {
    let PlacedOutages { windows, remarks } = scenario.outages_on(span_s, seed)?;
    session.warn_all(&remarks);
    Ok(windows)
}

/// A model; axes that it does not name are said.
pub(super) fn model(path: &Path, session: &Session) -> Result<ModelFile, Failure> {
    Ok(read::model(path, &Words::new(session))?)
}

/// A noise model at the rate of the IMU; that it is converted is said.
pub(super) fn at_rate(path: &Path, model: &Model, imu_hz: f64, session: &Session) -> Result<Model, Failure> {
    Ok(read::at_rate(path, model, imu_hz, &Words::new(session))?)
}

/// Static recordings, every channel of them; files without a time column at a rate that is given.
pub(super) fn recordings_at(
    paths: &[PathBuf],
    rate_hz: Option<f64>,
    session: &Session,
) -> Result<Vec<Recording>, Failure> {
    Ok(read::recordings(paths, rate_hz, &Words::new(session)).map_err(RunError::File)?)
}
