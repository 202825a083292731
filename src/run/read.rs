//! Inputs read; what is doubtful about them is remarked.

use super::error::RunError;
use super::{Note, turn_on};
use crate::formats::model_file::{self, ModelFile};
use crate::formats::recordings::{self, ReadOptions};
use crate::formats::trajectory_file;
use crate::observer::Observer;
use crate::report::readable;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::outage::{Outage, OutageError};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::{Excess, Limits, examine};
use nav_sim_signal::imu::{Recording, Sensor};
use nav_sim_signal::noise::{Model, continuous};
use std::path::{Path, PathBuf};

pub(crate) type Notes<'a> = &'a dyn Observer<Note>;

fn warn(notes: Notes<'_>, texts: impl IntoIterator<Item = impl ToString>) {
    texts
        .into_iter()
        .for_each(|text| notes.remark(&Note::Warning(text.to_string())));
}

/// A trajectory; where no vehicle moves so.
pub(crate) fn trajectory(path: &Path, notes: Notes<'_>) -> Result<Trajectory, RunError> {
    let (trajectory, warnings) = trajectory_file::load(path, &trajectory_file::Options::default())?;
    warn(notes, warnings);
    let (_, beyond) = examine(&trajectory, &Limits::default());
    let farthest = |e: &&Excess| e.worst / e.limit;
    if let Some(worst) = beyond
        .iter()
        .max_by(|a, b| farthest(a).total_cmp(&farthest(b)))
    {
        let shown = path.display();
        let more = match beyond.len() - 1 {
            0 => String::new(),
            n => format!(", and {n} more such stretches"),
        };
        warn(
            notes,
            [format!(
                "{shown}: {worst}{more} (nav-sim trajectory check {shown} lists them)"
            )],
        );
    }
    Ok(trajectory)
}

/// A model; the axes that it does not name.
pub(crate) fn model(path: &Path, notes: Notes<'_>) -> Result<ModelFile, RunError> {
    let file = model_file::read(path)?;
    warn(notes, file.doubts(path));
    Ok(file)
}

/// A noise model at the rate of the IMU.
pub(crate) fn at_rate(
    path: &Path,
    model: &Model,
    imu_hz: f64,
    notes: Notes<'_>,
) -> Result<Model, RunError> {
    let from_hz = model.rate_hz;
    let converted = continuous::at_rate(model, imu_hz);
    let converted = converted.map_err(|source| RunError::Rate {
        path: path.to_owned(),
        from_hz,
        source,
    })?;
    if !continuous::same_rate(from_hz, imu_hz) {
        let text = format!(
            "{}: converted from {from_hz} Hz to {imu_hz} Hz",
            path.display()
        );
        notes.remark(&Note::Remark(text));
    }
    Ok(converted)
}

/// Static recordings, every channel of them; files without a time column at a rate that is given.
pub(crate) fn recordings(
    paths: &[PathBuf],
    rate_hz: Option<f64>,
    notes: Notes<'_>,
) -> Result<Vec<Recording>, RunError> {
    let options = ReadOptions {
        rate_hz,
        ..ReadOptions::default()
    };
    let (recordings, report) = recordings::read(paths, &options)?;
    warn(notes, report.all_warnings());
    report
        .files
        .iter()
        .for_each(|file| notes.remark(&Note::Detail(file.to_string())));
    Ok(recordings)
}

/// The outages on a trajectory; what is doubtful about them.
pub(crate) fn placed(
    scenario: &Scenario,
    trajectory: &Trajectory,
    seed: u64,
    notes: Notes<'_>,
) -> Result<Vec<Outage>, OutageError> {
    let placed = scenario.outages_on((trajectory.start_s(), trajectory.end_s()), seed)?;
    placed
        .remarks
        .into_iter()
        .for_each(|remark| notes.remark(&Note::Outage(remark)));
    Ok(placed.windows)
}

/// Lets the filter expect the turn-on bias that its model states, where settings are silent.
pub(crate) fn expect_turn_on(
    initial: &mut InitialSettings,
    file: &ModelFile,
    path: &Path,
    notes: Notes<'_>,
) {
    let set = turn_on::expect(initial, &file.turn_on.unwrap_or_default());
    tell_turn_on("the filter expects", &set, path, notes);
}

/// Gives the true IMU the turn-on bias that the model of its errors states, where settings are silent; a 0 is a setting.
pub(crate) fn make_turn_on(imu: &mut ImuSettings, file: &ModelFile, path: &Path, notes: Notes<'_>) {
    let set = turn_on::make(imu, &file.turn_on.unwrap_or_default());
    tell_turn_on("the true IMU has", &set, path, notes);
}

fn tell_turn_on(who: &str, set: &[(Sensor, f64)], path: &Path, notes: Notes<'_>) {
    for (sensor, sigma) in set {
        let (shown, sigma, unit) = (path.display(), readable(*sigma), sensor.unit());
        let text = format!(
            "{shown}: {who} a turn-on bias of {sigma} {unit} ({sensor}, standard deviation)"
        );
        notes.remark(&Note::Remark(text));
    }
}
