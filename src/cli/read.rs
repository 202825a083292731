//! Reading inputs for commands: doubts are said, refusals become failures.

use super::exit::option_for;
use super::{Failure, Session};
use crate::formats::input;
use crate::formats::model_file::{self, ModelFile};
use crate::formats::recordings::{self, ReadOptions};
use crate::formats::trajectory_file;
use crate::formats::{FileError, Setting};
use crate::report::Input;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::{Excess, Limits, examine};
use nav_sim_signal::imu::Recording;
use nav_sim_signal::noise::{Model, continuous};
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
    let (trajectory, warnings) =
        trajectory_file::load(path, &trajectory_file::Options::default()).map_err(without_options)?;
    session.warn_all(warnings);
    implausible(path, &trajectory, session);
    Ok(trajectory)
}

/// Says where no vehicle moves so.
fn implausible(path: &Path, trajectory: &Trajectory, session: &Session) {
    let (_, beyond) = examine(trajectory, &Limits::default());
    let farthest = |e: &&Excess| e.worst / e.limit;
    if let Some(worst) = beyond.iter().max_by(|a, b| farthest(a).total_cmp(&farthest(b))) {
        let shown = path.display();
        let more = match beyond.len() - 1 {
            0 => String::new(),
            n => format!(", and {n} more such stretches"),
        };
        session.warn(format!("{shown}: {worst}{more} (nav-sim trajectory check {shown} lists them)"));
    }
}

/// A model; axes that it does not name are said.
pub(super) fn model(path: &Path, session: &Session) -> Result<ModelFile, Failure> {
    let file = model_file::read(path)?;
    session.warn_all(file.doubts(path));
    Ok(file)
}

/// A noise model at the rate of the IMU; that it is converted is said.
pub(super) fn at_rate(path: &Path, model: &Model, imu_hz: f64, session: &Session) -> Result<Model, Failure> {
    let (shown, from_hz) = (path.display(), model.rate_hz);
    let converted = continuous::at_rate(model, imu_hz).map_err(|e| {
        let hint = format!("set rate_hz = {from_hz} in the [imu] section of a --scenario file");
        Failure::input(format!("{shown}: {e}")).hint(hint)
    })?;
    if !continuous::same_rate(from_hz, imu_hz) {
        session.say(format!("{shown}: converted from {from_hz} Hz to {imu_hz} Hz"));
    }
    Ok(converted)
}

/// Static recordings, every channel of them; files without a time column at a rate that is given.
pub(super) fn recordings_at(
    paths: &[PathBuf],
    rate_hz: Option<f64>,
    session: &Session,
) -> Result<Vec<Recording>, Failure> {
    let hint = |setting| {
        Some(match setting {
            Setting::Gaps => {
                "wv and calibrate read it with --gaps split or --gaps ignore; fuse bridges gaps of up to 5 s"
            }
            other => option_for(other),
        })
    };
    let (recordings, report) = recordings::read(paths, &ReadOptions { rate_hz, ..ReadOptions::default() })
        .map_err(|e| Failure::of_file(&e, hint))?;
    session.warn_all(report.all_warnings());
    for file in &report.files {
        session.detail(file);
    }
    Ok(recordings)
}
