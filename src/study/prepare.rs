//! Calibration steps and virtual recordings of a study.

use super::description::{CalibrateStep, Synthesis};
use super::error::PrepareError;
use crate::calibration::{
    Estimator, Outcome, Pool, Settings, Trim, Weighting, calibrate, grouped, replicates,
};
use crate::imu::{Channel, Recording};
use crate::noise::contamination::Contamination;
use crate::noise::{Model, Spread, VirtualImu};
use crate::wavelet::{Convention, Tuning};
use rayon::prelude::*;

/// What virtual recordings are made of.
#[derive(Debug, Clone, Copy)]
pub struct Material<'a> {
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
    pub fn recordings(&self) -> Result<Vec<Recording>, PrepareError> {
        let channels = channels(&self.step.axes)?;
        let imu = VirtualImu {
            model: self.model,
            spread: self.spread.filter(|_| self.step.spread),
            contamination: self.contamination,
            seed: self.step.seed.unwrap_or(self.seed),
        };
        let one = |replicate: u64| Ok(imu.recording(replicate, &channels, self.step.samples)?);
        (1..=self.step.replicates).into_par_iter().map(one).collect()
    }
}

/// The channels a word stands for: all, accel, gyro, x, y, z, accel.x, …
///
/// # Errors
/// When it stands for none.
pub fn channels(word: &str) -> Result<Vec<Channel>, PrepareError> {
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
    let word = |key, value: &str, reason: String| PrepareError::Word { key, value: value.to_owned(), reason };
    let estimator = |name: &String| {
        let takes_many = |e: &Estimator| *e != Estimator::Given && e.name() == name;
        let found = Estimator::ALL.into_iter().find(takes_many);
        found.ok_or_else(|| word("estimators", name, "is not awv, sr-awv, dr-awv, gmwm or rgmwm".to_owned()))
    };
    let model = step.fit.parse().map_err(|e| word("fit", &step.fit, format!("is no model: {e}")))?;
    let convention = match step.efficiency_convention.as_deref() {
        None | Some("exact") => Convention::Exact,
        Some("wv") => Convention::Wv,
        Some(other) => return Err(word("efficiency_convention", other, "is not exact or wv".to_owned())),
    };
    let unknown = |key, value: &str, expected: String| word(key, value, format!("is not {expected}"));
    let weighting = step.weighting.as_deref().map_or(Ok(Weighting::default()), |text| {
        let found = Weighting::ALL.into_iter().find(|w| w.name() == text);
        found.ok_or_else(|| unknown("weighting", text, Weighting::ALL.map(Weighting::name).join(", ")))
    })?;
    let tuning = Tuning::new(step.efficiency, convention).map_err(|_| {
        word("efficiency", &step.efficiency.to_string(), "is not between 0.3 and 0.99".to_owned())
    })?;
    Ok(Settings {
        estimators: step.estimators.iter().map(estimator).collect::<Result<_, _>>()?,
        model,
        trim: step.trim.map_or(Trim::default(), Trim::Count),
        tuning,
        weighting,
        rate_hz,
        ..Settings::default()
    })
}

/// Models for all estimators of a step from recordings, as `nav-sim calibrate` makes them.
///
/// # Errors
/// A word that means nothing, recordings too short or too few.
pub fn calibrated(
    recordings: &[Recording],
    step: &CalibrateStep,
) -> Result<(Vec<Outcome>, Settings), PrepareError> {
    let settings = settings(step, recordings.first().map_or(1.0, |r| r.rate_hz))?;
    let single = settings.estimators.iter().any(|e| e.is_single());
    if single && recordings.len() > 1 {
        let value = step.estimators.join(", ");
        let reason = format!("gmwm and rgmwm take a single recording; there are {}", recordings.len());
        return Err(PrepareError::Word { key: "estimators", value, reason });
    }
    let pool = step.pool.as_deref().map_or(Ok(settings.pool()), |text| {
        let found = Pool::ALL.into_iter().find(|pool| pool.name() == text);
        found.filter(|pool| !single || *pool == Pool::Axes).ok_or_else(|| PrepareError::Word {
            key: "pool",
            value: text.to_owned(),
            reason: "is not axes, or sensor (for estimators of several recordings)".to_owned(),
        })
    })?;
    let of = |recording| replicates(recording, step.scales, &settings.tuning);
    let measured: Vec<_> = recordings.par_iter().map(of).collect::<Result<_, _>>()?;
    let groups = grouped(measured.concat(), pool);
    let outcomes = calibrate(&groups, &settings)?;
    Ok((outcomes, settings))
}
