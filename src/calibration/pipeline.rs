//! The whole of a calibration: groups of replicates × estimators → fits.

use super::auto::{Ranking, choose};
use super::average::{AverageError, Estimator, Trim, average};
use super::avlr::avlr;
use super::bootstrap::CurveSampler;
use super::fit::{Fit, FitError, expected, fit, fit_with_covariance, refit};
use super::inference::Inference;
use super::limits::LimitError;
use super::notes::notes;
use super::objective::Weighting;
use super::replicates::Group;
use super::spec::ModelSpec;
use crate::imu::{Axis, Sensor};
use crate::wavelet::{Curve, Tuning};
use rayon::prelude::*;

/// How to calibrate.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Which curves to fit.
    pub estimators: Vec<Estimator>,
    /// What the model is made of.
    pub model: ModelChoice,
    /// Where its parameters may be, the more special after the more general.
    pub limits: Vec<ParameterLimit>,
    /// What DR-AWV drops.
    pub trim: Trim,
    /// The tuning the robust wavelet variances were made with.
    pub tuning: Tuning,
    /// What a scale counts.
    pub weighting: Weighting,
    /// Sample rate (Hz).
    pub rate_hz: f64,
}

/// Who says what the model is made of.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelChoice {
    /// The user.
    Given(ModelSpec),
    /// The curves.
    Auto,
}

impl std::fmt::Display for ModelChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given(spec) => spec.fmt(f),
            Self::Auto => f.write_str("auto"),
        }
    }
}

/// Where one parameter may be.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterLimit {
    /// The sensor, or both.
    pub sensor: Option<Sensor>,
    /// The axis, or all.
    pub axis: Option<Axis>,
    /// Label of the process.
    pub process: String,
    /// Name of the parameter.
    pub parameter: String,
    /// Lower bound (units of the parameter).
    pub low: Option<f64>,
    /// Upper bound (units of the parameter).
    pub high: Option<f64>,
}

impl Settings {
    /// The model of a group, with its limits.
    fn limited(&self, spec: &ModelSpec, group: &Group) -> Result<ModelSpec, LimitError> {
        let mut spec = spec.clone();
        for l in &self.limits {
            let meant = l.sensor.is_none_or(|s| s == group.sensor)
                && l.axis.is_none_or(|axis| group.axis == Some(axis));
            if meant {
                spec.limit(&l.process, &l.parameter, l.low, l.high)?;
            }
        }
        Ok(spec)
    }
}

/// One fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Position of its group among those given.
    pub group: usize,
    /// The estimator.
    pub estimator: Estimator,
    /// What the model is made of.
    pub spec: ModelSpec,
    /// How that was chosen, if it was.
    pub ranking: Option<Ranking>,
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
    /// Limits that mean nothing.
    #[error(transparent)]
    Limit(#[from] LimitError),
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
        let curve = average(replicates, estimator, settings.trim, &settings.tuning)
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
    let error = |source: Cause| CalibrationError::new(group, estimator, source);
    let (spec, ranking) = match &settings.model {
        ModelChoice::Given(spec) => (settings.limited(spec, group).map_err(|e| error(e.into()))?, None),
        ModelChoice::Auto => {
            let (spec, ranking) =
                choose(group, index, estimator, &curve, settings).map_err(|e| error(e.into()))?;
            (spec, Some(ranking))
        }
    };
    let fit = estimate(estimator, &curve, &spec, settings.rate_hz, settings.weighting)
        .map_err(|e| error(e.into()))?;
    let mut outcome = Outcome { ranking, ..Outcome::bare(index, estimator, curve, spec, fit) };
    if settings.weighting == Weighting::Full && estimator != Estimator::Avlr {
        weigh_fully(group, &mut outcome, settings).map_err(|e| error(e.into()))?;
    }
    outcome.notes = notes(&outcome, &group.replicates, settings.rate_hz);
    Ok(outcome)
}

impl Outcome {
    /// A fit and nothing about it.
    pub(super) fn bare(group: usize, estimator: Estimator, curve: Curve, spec: ModelSpec, fit: Fit) -> Self {
        Self { group, estimator, spec, ranking: None, curve, fit, notes: Vec::new(), inference: None }
    }
}

/// Draws behind the covariance of a curve.
const DRAWS: usize = 2000;

/// The fit again, weighted by the covariance of curves drawn from it: the scatter within recordings and the
/// differences between them.
fn weigh_fully(group: &Group, outcome: &mut Outcome, settings: &Settings) -> Result<(), FitError> {
    // Of a curve from elsewhere nothing more is known; a model that is fixed is not fitted.
    if group.replicates.is_empty() || outcome.spec.parameters() == 0 {
        return Ok(());
    }
    let sampler = CurveSampler::new(&group.replicates, outcome, settings);
    let covariance = sampler.covariance(DRAWS, &group.name(), settings);
    outcome.fit = fit_with_covariance(
        &outcome.curve,
        &outcome.spec,
        settings.rate_hz,
        &covariance,
        expected(&outcome.curve, &outcome.fit),
    )?;
    Ok(())
}

/// The model an estimator makes of a curve.
///
/// # Errors
/// As [`fit`]; for [`Estimator::Avlr`] when a process has no slope of its own.
pub fn estimate(
    estimator: Estimator,
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
) -> Result<Fit, FitError> {
    match estimator {
        Estimator::Avlr => avlr(curve, spec),
        _ => fit(curve, spec, rate_hz, weighting),
    }
}

/// The same for a curve that resembles that of an outcome.
pub(super) fn estimate_again(curve: &Curve, outcome: &Outcome, settings: &Settings) -> Result<Fit, FitError> {
    match outcome.estimator {
        Estimator::Avlr => avlr(curve, &outcome.spec),
        _ => refit(curve, &outcome.spec, settings.rate_hz, settings.weighting, &outcome.fit),
    }
}
