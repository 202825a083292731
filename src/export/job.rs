//! A model file as the parameters of another program.

use super::{Export, ExportError, Target};

use super::Settings;
use crate::formats::model_file::ModelFile;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::practical::{Horizon, Policy};

/// Longest averaging time at which a minimum is believed of a model that no calibration made (s).
const LONGEST_S: f64 = 10_000.0;

/// The parameters of a model in the terms of a target: the pair of that policy, over averages of that horizon.
///
/// # Errors
/// When a sensor is missing or has no noise over the horizon, or the target has not what a strict pair needs.
pub fn exported(
    file: &ModelFile,
    target: Target,
    policy: Policy,
    horizon: Horizon,
) -> Result<Export, ExportError> {
    let turn_on = file.turn_on.unwrap_or_default();
    let settings = Settings {
        policy,
        horizon,
        range_s: file.observed_s().unwrap_or(LONGEST_S).max(horizon.to_s),
        turn_on: Sensor::ALL.map(|sensor| turn_on.sigma(sensor)),
        misfit: file.misfit().map(|misfit| misfit.to_string()),
    };
    Export::new(target, &file.model, &file.missing, settings)
}

/// A model as the file of a target, matched over averages of 1 s to 100 s; `name` is that of the model in its head.
///
/// ```
/// use nav_sim::prelude::*;
///
/// let model = read_model("calib_data/tactical.toml".as_ref())?;
/// let yaml = nav_sim::export(&model, "tactical", Target::Kalibr)?;
/// assert!(yaml.contains("\ngyroscope_noise_density: 1.234"), "{yaml}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`exported`].
pub fn export(file: &ModelFile, name: &str, target: Target) -> Result<String, ExportError> {
    Ok(exported(file, target, Policy::Matched, Horizon::default())?.text(name))
}
