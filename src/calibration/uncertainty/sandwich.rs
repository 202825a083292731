//! Standard errors without a bootstrap: what a fit passes on, to first order, of the scatter of its curve.
//!
//! cov(theta) = A Sigma Aᵀ with A = (Jᵀ Omega J)⁻¹ Jᵀ Omega, J the derivatives of the model's wavelet variance, Sigma
//! the covariance of curves (the asymptotic covariance of [Guerrier](crate::bibliography::Guerrier13)). A parameter that stands at a
//! bound, or whose process has no amplitude, is taken as known. Slopes (AVLR) are no least squares: they have none.

use crate::curve::Estimator;
use crate::curve::implied::{implied, implied_gradients};
use crate::outcome::{Outcome, Settings};
use nalgebra::DMatrix;

/// Standard errors of the parameters, in the order of the model and in their units; NaN where a
/// parameter stands at a bound. `covariance` is that of curves, relative to the model.
pub(crate) fn standard_errors(
    outcome: &Outcome,
    settings: &Settings,
    covariance: &DMatrix<f64>,
) -> Vec<f64> {
    let (fit, curve) = (&outcome.fit, &outcome.curve);
    let least_squares = outcome.estimator != Estimator::Avlr;
    // Of each parameter: whether it moves, and its value.
    let all: Vec<(bool, f64)> = fit
        .composite
        .parameters()
        .map(|(of, value)| (least_squares && outcome.moves(of), value))
        .collect();
    let moving: Vec<usize> = (0..all.len()).filter(|p| all[*p].0).collect();
    if moving.is_empty() {
        return vec![f64::NAN; all.len()];
    }
    let levels = curve.levels.len();
    let gradients = implied_gradients(&fit.composite, curve);
    let centre = implied(&fit.composite, curve);
    let roots = settings.weighting.roots(curve, &fit.weighted_for);
    let weights = DMatrix::from_fn(levels, levels, |i, j| if i == j { roots[i] } else { 0.0 });
    // Relative to the parameters, which are of very different sizes.
    let jacobian = DMatrix::from_fn(levels, moving.len(), |j, m| {
        gradients[j][moving[m]] * all[moving[m]].1
    });
    let scatter = DMatrix::from_fn(levels, levels, |i, j| {
        covariance[(i, j)] * centre[i] * centre[j]
    });
    // (W J)⁺ W with WᵀW = Omega is (Jᵀ Omega J)⁻¹ Jᵀ Omega, without squaring the condition of J.
    let relative = (&weights * jacobian)
        .pseudo_inverse(f64::EPSILON)
        .map(|inverse| inverse * weights)
        .map(|passed_on| (&passed_on * scatter * passed_on.transpose()).diagonal());
    let error = |p: usize| match (&relative, moving.iter().position(|m| *m == p)) {
        (Ok(variances), Some(m)) => all[p].1.abs() * variances[m].max(0.0).sqrt(),
        _ => f64::NAN,
    };
    (0..all.len()).map(error).collect()
}
