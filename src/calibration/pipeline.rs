//! The whole of a calibration: groups of replicates × estimators → fits.

use super::average::{AverageError, Estimator, Trim, average};
use super::fit::{Fit, FitError, fit};
use super::inference::Inference;
use super::notes::notes;
use super::objective::Weighting;
use super::replicates::Group;
use super::spec::ModelSpec;
use crate::wavelet::{Curve, Tuning};
use rayon::prelude::*;

/// How to calibrate.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Which curves to fit.
    pub estimators: Vec<Estimator>,
    /// What the model is made of.
    pub spec: ModelSpec,
    /// What DR-AWV drops.
    pub trim: Trim,
    /// The tuning the robust wavelet variances were made with.
    pub tuning: Tuning,
    /// What a scale counts.
    pub weighting: Weighting,
    /// Sample rate (Hz).
    pub rate_hz: f64,
}

/// One fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Position of its group among those given.
    pub group: usize,
    /// The estimator.
    pub estimator: Estimator,
    /// The curve that was fitted.
    pub curve: Curve,
    /// The model.
    pub fit: Fit,
    /// Remarks, in words.
    pub notes: Vec<String>,
    /// Intervals of its parameters and goodness of fit, once [`infer`](super::infer) was asked for them.
    pub inference: Option<Inference>,
}

/// Why a group has no model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{group}, {estimator}: {source}")]
pub struct CalibrationError {
    /// Name of the group.
    pub group: String,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Why.
    pub source: Cause,
}

impl CalibrationError {
    fn new(group: &Group, estimator: Estimator, source: impl Into<Cause>) -> Self {
        Self { group: group.name(), estimator: estimator.name(), source: source.into() }
    }
}

/// Why a curve or a fit does not exist.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Cause {
    /// No curve.
    #[error(transparent)]
    Average(#[from] AverageError),
    /// No fit.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Fits every group with every estimator, in that order.
///
/// # Errors
/// When a trim leaves no replicate, or a curve is too short for the model.
pub fn calibrate(groups: &[Group], settings: &Settings) -> Result<Vec<Outcome>, CalibrationError> {
    let jobs: Vec<_> =
        (0..groups.len()).flat_map(|g| settings.estimators.iter().map(move |e| (g, *e))).collect();
    let run = |&(index, estimator): &(usize, Estimator)| {
        let replicates = &groups[index].replicates;
        let curve = average(replicates, estimator, settings.trim, settings.tuning.efficiency())
            .map_err(|source| CalibrationError::new(&groups[index], estimator, source))?;
        fit_curve(groups, index, estimator, curve, settings)
    };
    jobs.par_iter().map(run).collect()
}

/// Fits the curve of one group.
///
/// # Errors
/// When the curve is too short for the model.
pub fn fit_curve(
    groups: &[Group],
    index: usize,
    estimator: Estimator,
    curve: Curve,
    settings: &Settings,
) -> Result<Outcome, CalibrationError> {
    let group = &groups[index];
    let fit = fit(&curve, &settings.spec, settings.rate_hz, settings.weighting)
        .map_err(|source| CalibrationError::new(group, estimator, source))?;
    let notes = notes(&fit, &curve, estimator, &group.replicates, settings.rate_hz);
    Ok(Outcome { group: index, estimator, curve, fit, notes, inference: None })
}
