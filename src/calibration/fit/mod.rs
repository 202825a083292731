//! A model fitted to a curve: theta = argmin Σ Omega_j (nu_j − nu_j(theta))².

mod avlr;
mod least_squares;
mod search;

pub(crate) use avlr::avlr;
pub use least_squares::{Fit, Weighting, fit};
pub(crate) use least_squares::{correlated, refit, score, too_few_scales};
pub(crate) use search::Range;
pub use search::Termination;

use crate::curve::{CalibrationError, Estimator};
use crate::model::ModelSpec;
use crate::wavelet::Curve;

/// The model an estimator makes of a curve.
///
/// # Errors
/// As [`fit()`]; for [`Estimator::Avlr`] when a process has no slope of its own.
pub fn estimate(
    estimator: Estimator,
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
) -> Result<Fit, CalibrationError> {
    match estimator {
        Estimator::Avlr => avlr(curve, spec),
        _ => fit(curve, spec, rate_hz, weighting),
    }
}
