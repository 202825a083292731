//! Reading inputs for commands: doubts are said, refusals become failures.

use super::exit::option_for;
use super::{Failure, Session};
use nav_sim::formats::model_file::{self, ModelFile};
use nav_sim::formats::recordings::{self, ReadOptions};
use nav_sim::formats::trajectory_file;
use nav_sim::formats::{FileError, Setting, hash};
use nav_sim::imu::Recording;
use nav_sim::noise::{Model, continuous};
use nav_sim::report::Input;
use nav_sim::trajectory::Trajectory;
use nav_sim::trajectory::reference::Reference;
use std::fs;
use std::path::{Path, PathBuf};

/// For commands without the option `--origin`: `trajectory convert` has it.
fn without_options(e: FileError) -> Failure {
    Failure::of_file(&e, |setting| {
        Some(match setting {
            Setting::Origin => {
                "write it with latitude and longitude: nav-sim trajectory convert FILE --origin LAT_DEG,LON_DEG,H_M"
            }
            other => option_for(other),
        })
    })
}

/// A recording to be fused: all six channels are needed, as the file names them: without the options of the commands for static recordings.
pub(super) fn refused_for_fusion(e: FileError) -> Failure {
    Failure::of_file(&e, |setting| match setting {
        Setting::ColumnNames => Some("correct the header"),
        Setting::Channels | Setting::FewerChannels | Setting::Gaps => None,
        other => Some(option_for(other)),
    })
}

/// An input with its fingerprint, of the bytes that were read.
pub(super) fn input(role: &str, path: &Path) -> Result<Input, Failure> {
    let shown = path.display().to_string();
    let blake3 = hash::as_read(path).map_err(|e| Failure::could_not(format!("{shown}: {e}")))?;
    Ok(Input { role: role.to_owned(), path: shown, blake3 })
}

/// A trajectory.
pub(super) fn trajectory(path: &Path, session: &Session) -> Result<Trajectory, Failure> {
    let (trajectory, warnings) =
        trajectory_file::load(path, &trajectory_file::Options::default()).map_err(without_options)?;
    for warning in warnings {
        session.printer.warn(&warning.to_string());
    }
    Ok(trajectory)
}

/// A trajectory to compare with; what is left out of it is said.
pub(super) fn reference(path: &Path, session: &Session) -> Result<Reference, Failure> {
    let (reference, warnings) = trajectory_file::load_reference(path, &trajectory_file::Options::default())
        .map_err(without_options)?;
    for warning in warnings {
        session.printer.warn(&warning.to_string());
    }
    Ok(reference)
}

/// A model; axes that it does not name are said.
pub(super) fn model(path: &Path, session: &Session) -> Result<ModelFile, Failure> {
    let file = model_file::read(path)?;
    for channel in &file.missing {
        let shown = path.display();
        session.printer.warn(&format!("{shown}: says nothing of {channel}, taken as free of noise"));
    }
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
        session.printer.say(&format!("{shown}: converted from {from_hz} Hz to {imu_hz} Hz"));
    }
    Ok(converted)
}

/// Static recordings, every channel of them; files without a time column at a rate that is given.
pub(super) fn recordings_at(
    paths: &[PathBuf],
    rate_hz: Option<f64>,
    session: &Session,
) -> Result<Vec<Recording>, Failure> {
    let (recordings, report) = recordings::read(paths, &ReadOptions { rate_hz, ..ReadOptions::default() })?;
    for warning in report.all_warnings() {
        session.printer.warn(&warning);
    }
    if let Some((one, other, _)) = report.overlap() {
        session.printer.warn(&format!("{other} and {one} have samples in common"));
    }
    for file in &report.files {
        session.printer.detail(&file.to_string());
    }
    Ok(recordings)
}

/// The files themselves and those of directories, in name order.
pub(super) fn listed(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let error = |e| Failure::could_not(format!("{}: {e}", path.display()));
        let entries = fs::read_dir(path).map_err(error)?.collect::<Result<Vec<_>, _>>().map_err(error)?;
        let mut within: Vec<PathBuf> =
            entries.iter().map(fs::DirEntry::path).filter(|p| p.is_file()).collect();
        within.sort();
        files.extend(within);
    }
    Ok(files)
}
