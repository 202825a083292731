//! Whether a model describes a curve: the J-test
//! ([Guerrier](crate::bibliography::Guerrier13)).

use crate::fit::Fit;
use crate::noise::ParameterRef;
use crate::outcome::{Goodness, Outcome};

/// The test of a fit, given the fits of the draws.
pub(crate) fn goodness(outcome: &Outcome, draws: &[Fit]) -> Goodness {
    let Outcome { fit, .. } = outcome;
    let objectives: Vec<f64> = draws.iter().map(|d| d.objective).collect();
    // A parameter of a process without amplitude took nothing from the curve.
    let free = |of: &ParameterRef| !fit.zero.contains(&of.process);
    let parameters = fit
        .composite
        .parameters()
        .filter(|(of, _)| free(of))
        .count();
    Goodness {
        statistic: fit.objective,
        dof: outcome.counted_levels().len().saturating_sub(parameters),
        expected: crate::curve::robust_scale::median(&objectives),
        p_value: p_value(fit.objective, &objectives),
    }
}

/// Share of the statistics that are as large, the observed one among them: exchangeable with B draws it has any of B + 1 ranks
/// with the same probability, so that P(p ≤ a) ≤ a ([Davison and Hinkley](crate::bibliography::DavisonHinkley97), eq. 4.11).
fn p_value(observed: f64, draws: &[f64]) -> f64 {
    let as_large = draws.iter().filter(|draw| **draw >= observed).count();
    (1 + as_large) as f64 / (1 + draws.len()) as f64
}

#[cfg(test)]
mod tests;
