//! Inputs read; what is doubtful about them is remarked.

use super::error::RunError;
use super::turn_on;
use crate::app::Context;
use crate::formats::model_file::{self, ModelFile};
use crate::formats::recordings::{self, ReadOptions};
use crate::formats::trajectory_file;
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

/// A trajectory; where no vehicle moves so.
pub(crate) fn trajectory(path: &Path, context: &Context<'_>) -> Result<Trajectory, RunError> {
    let (trajectory, warnings) = trajectory_file::load(path, &trajectory_file::Options::default())?;
    warnings.iter().for_each(|doubt| context.warn(doubt));
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
        context.warn(format!(
            "{shown}: {worst}{more} (nav-sim trajectory check {shown} lists them)"
        ));
    }
    Ok(trajectory)
}

/// A model; the axes that it does not name.
pub(crate) fn model(path: &Path, context: &Context<'_>) -> Result<ModelFile, RunError> {
    let file = model_file::read(path)?;
    file.doubts(path)
        .iter()
        .for_each(|doubt| context.warn(doubt));
    Ok(file)
}

/// A noise model at the rate of the IMU.
pub(crate) fn at_rate(
    path: &Path,
    model: &Model,
    imu_hz: f64,
    context: &Context<'_>,
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
        context.remark(text);
    }
    Ok(converted)
}

/// Static recordings, every channel of them; files without a time column at a rate that is given.
pub(crate) fn recordings(
    paths: &[PathBuf],
    rate_hz: Option<f64>,
    context: &Context<'_>,
) -> Result<Vec<Recording>, RunError> {
    let options = ReadOptions {
        rate_hz,
        ..ReadOptions::default()
    };
    let (recordings, report) = recordings::read(paths, &options)?;
    report
        .all_warnings()
        .iter()
        .for_each(|doubt| context.warn(doubt));
    report
        .files
        .iter()
        .for_each(|file| context.detail(file.to_string()));
    Ok(recordings)
}

/// The outages on a trajectory; what is doubtful about them.
pub(crate) fn placed(
    scenario: &Scenario,
    trajectory: &Trajectory,
    seed: u64,
    context: &Context<'_>,
) -> Result<Vec<Outage>, OutageError> {
    let placed = scenario.outages_on((trajectory.start_s(), trajectory.end_s()), seed)?;
    placed
        .remarks
        .into_iter()
        .for_each(|remark| context.warn(remark));
    Ok(placed.windows)
}

/// Lets the filter expect the turn-on bias that its model states, where settings are silent.
pub(crate) fn expect_turn_on(
    initial: &mut InitialSettings,
    file: &ModelFile,
    path: &Path,
    context: &Context<'_>,
) {
    let set = turn_on::expect(initial, &file.turn_on.unwrap_or_default());
    tell_turn_on("the filter expects", &set, path, context);
}

/// Gives the true IMU the turn-on bias that the model of its errors states, where settings are silent; a 0 is a setting.
pub(crate) fn make_turn_on(
    imu: &mut ImuSettings,
    file: &ModelFile,
    path: &Path,
    context: &Context<'_>,
) {
    let set = turn_on::make(imu, &file.turn_on.unwrap_or_default());
    tell_turn_on("the true IMU has", &set, path, context);
}

fn tell_turn_on(who: &str, set: &[(Sensor, f64)], path: &Path, context: &Context<'_>) {
    for (sensor, sigma) in set {
        let (shown, sigma, unit) = (path.display(), readable(*sigma), sensor.unit());
        let text = format!(
            "{shown}: {who} a turn-on bias of {sigma} {unit} ({sensor}, standard deviation)"
        );
        context.remark(text);
    }
}
