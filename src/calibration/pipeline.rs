//! The whole of a calibration: groups of replicates × estimators → fits, and how sure they are.

use crate::curve::{AverageError, Estimator, Group, average};
use crate::fit::{FitError, Weighting, estimate, expected, fit_with_covariance};
use crate::model::LimitError;
use crate::outcome::{Bootstrap, ModelChoice, Outcome, Settings};
use crate::selection::choose;
use crate::uncertainty::bootstrap::CurveSampler;
use crate::uncertainty::inference::inference;
use crate::wavelet::Curve;
use crate::words::{notes, notes_of_inference};
use rayon::prelude::*;

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
    /// Of a group without a curve.
    pub(crate) fn of(group: &Group, estimator: Estimator, source: AverageError) -> Self {
        Self::new(group, estimator, source)
    }

    fn new(group: &Group, estimator: Estimator, source: impl Into<Cause>) -> Self {
        Self { group: group.scope.name(), estimator: estimator.name(), source: source.into() }
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
    let jobs: Vec<_> = groups.iter().flat_map(|g| settings.estimators.iter().map(move |e| (g, *e))).collect();
    let run = |&(group, estimator): &(&Group, Estimator)| {
        let curve = average(&group.replicates, estimator, settings.trim, &settings.tuning)
            .map_err(|source| CalibrationError::new(group, estimator, source))?;
        fit_curve(group, estimator, curve, settings)
    };
    jobs.par_iter().map(run).collect()
}

/// Fits the curve of a group.
///
/// # Errors
/// When the curve is too short for the model.
pub fn fit_curve(
    group: &Group,
    estimator: Estimator,
    curve: Curve,
    settings: &Settings,
) -> Result<Outcome, CalibrationError> {
    let error = |source: Cause| CalibrationError::new(group, estimator, source);
    let (spec, ranking) = match &settings.model {
        ModelChoice::Given(spec) => (settings.limited(spec, group.scope).map_err(|e| error(e.into()))?, None),
        ModelChoice::Auto => {
            let (spec, ranking) = choose(group, estimator, &curve, settings).map_err(|e| error(e.into()))?;
            (spec, Some(ranking))
        }
    };
    let fit = estimate(estimator, &curve, &spec, settings.rate_hz, settings.weighting)
        .map_err(|e| error(e.into()))?;
    let (scope, replicates) = (group.scope, group.replicates.len());
    let (notes_later, inference) = (Vec::new(), None);
    let mut outcome =
        Outcome { scope, replicates, estimator, spec, ranking, curve, fit, notes: notes_later, inference };
    if settings.weighting == Weighting::Full && estimator != Estimator::Avlr {
        weigh_fully(group, &mut outcome, settings).map_err(|e| error(e.into()))?;
    }
    outcome.notes = notes(&outcome, &group.replicates, settings.rate_hz);
    Ok(outcome)
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
    let sampler = CurveSampler::of_outcome(group, outcome, settings);
    let covariance = sampler.covariance(DRAWS, &group.scope.name(), settings);
    outcome.fit = fit_with_covariance(
        &outcome.curve,
        &outcome.spec,
        settings.rate_hz,
        &covariance,
        expected(&outcome.curve, &outcome.fit),
    )?;
    Ok(())
}

/// Fills in the inference of every outcome from its group. The same seed gives the same numbers on any number of
/// threads.
pub fn infer(groups: &[Group], outcomes: &mut [Outcome], settings: &Settings, bootstrap: Bootstrap) {
    outcomes.par_iter_mut().for_each(|outcome| {
        let Some(group) = groups.iter().find(|g| g.scope == outcome.scope) else { return };
        outcome.inference = Some(inference(group, outcome, settings, bootstrap));
        outcome.notes.extend(notes_of_inference(outcome));
    });
}
