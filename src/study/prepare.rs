//! Calibration steps and virtual recordings of a study.

use super::description::{CalibrateStep, Synthesis};
use super::error::PrepareError;
use nav_sim_calibration::{Outcome, Pool, Settings, Trim, calibrate, grouped, replicates};
use nav_sim_signal::imu::{Channel, Recording};
use nav_sim_signal::noise::contamination::Contamination;
use nav_sim_signal::noise::{Model, Spread, VirtualImu};
use nav_sim_signal::wavelet::Tuning;
use rayon::prelude::*;

/// What virtual recordings are made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Material<'a> {
    /// How many, how long, of what.
    pub step: &'a Synthesis,
    /// The model.
    pub model: &'a Model,
    /// How it varies, if it can.
    pub spread: Option<&'a Spread>,
    /// What goes wrong.
    pub contamination: Option<&'a Contamination>,
    /// Seed, where the step names none.
    pub seed: u64,
}

impl Material<'_> {
    /// The recordings, means removed: those of `nav-sim synthesize` with the same model and seed.
    ///
    /// # Errors
    /// When spread or contamination do not belong to the model.
    pub(crate) fn recordings(&self) -> Result<Vec<Recording>, PrepareError> {
        let channels = channels(&self.step.axes)?;
        let imu = VirtualImu {
            model: self.model,
            spread: self.spread.filter(|_| self.step.spread),
            contamination: self.contamination,
            seed: self.step.seed.unwrap_or(self.seed),
        };
        let recording = |replicate: u64| Ok(imu.recording(replicate, &channels, self.step.samples)?);
        (1..=self.step.replicates).into_par_iter().map(recording).collect()
    }
}

/// The channels a word stands for: all, accel, gyro, x, y, z, accel.x, …
///
/// # Errors
/// When it stands for none.
pub(crate) fn channels(word: &str) -> Result<Vec<Channel>, PrepareError> {
    let found = Channel::named(word);
    if found.is_empty() {
        let reason = "is not all, accel, gyro, x, y, z, or one channel such as accel.x";
        return Err(PrepareError::Word { key: "axes", value: word.to_owned(), reason: reason.to_owned() });
    }
    Ok(found)
}

/// The settings of a calibration step.
///
/// # Errors
/// A word that means nothing.
pub(super) fn settings(step: &CalibrateStep, rate_hz: f64) -> Result<Settings, PrepareError> {
    let word = |key, value: String, reason: String| PrepareError::Word { key, value, reason };
    let model =
        step.fit.parse().map_err(|e| word("fit", step.fit.clone(), format!("is not a model: {e}")))?;
    let tuning =
        Tuning::new(step.efficiency, step.efficiency_convention.unwrap_or_default()).map_err(|_| {
            word("efficiency", step.efficiency.to_string(), "is not between 0.3 and 0.99".to_owned())
        })?;
    Ok(Settings {
        estimators: step.estimators.clone(),
        model,
        trim: step.trim.map_or(Trim::default(), Trim::Count),
        tuning,
        weighting: step.weighting.unwrap_or_default(),
        rate_hz,
        ..Settings::default()
    })
}

/// Models for all estimators of a step from recordings, as `nav-sim calibrate` makes them.
///
/// # Errors
/// A word that means nothing, recordings too short or too few.
pub(crate) fn calibrated(
    recordings: &[Recording],
    step: &CalibrateStep,
) -> Result<(Vec<Outcome>, Settings), PrepareError> {
    let settings = settings(step, recordings.first().map_or(1.0, |r| r.rate_hz))?;
    let single = settings.estimators.iter().find(|e| e.is_single());
    let refused = |key, value: String, reason: String| Err(PrepareError::Word { key, value, reason });
    if let Some(estimator) = single.filter(|_| recordings.len() > 1) {
        let reason = format!("takes a single recording; there are {}", recordings.len());
        return refused("estimators", estimator.to_string(), reason);
    }
    let pool = step.pool.unwrap_or_else(|| settings.pool());
    if let Some(estimator) = single.filter(|_| pool != Pool::Axes) {
        return refused("pool", pool.to_string(), format!("is not axes, as {estimator} needs"));
    }
    let curves_of = |recording| replicates(recording, step.scales, &settings.tuning);
    let measured: Vec<_> = recordings.par_iter().map(curves_of).collect::<Result<_, _>>()?;
    let groups = grouped(measured.concat(), pool);
    let outcomes = calibrate(&groups, &settings)?;
    Ok((outcomes, settings))
}
