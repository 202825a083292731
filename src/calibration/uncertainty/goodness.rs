//! Whether a model describes a curve: the J-test
//! ([Guerrier](crate::bibliography::Guerrier13)).

use crate::fit::Fit;
use crate::model::ModelSpec;
use crate::noise::ParameterRef;
use crate::outcome::Goodness;

/// The test of a fit, given the fits of the draws.
pub(crate) fn goodness(fit: &Fit, spec: &ModelSpec, draws: &[Fit]) -> Goodness {
    let objectives: Vec<f64> = draws.iter().map(|d| d.objective).collect();
    let larger = objectives.iter().filter(|o| **o >= fit.objective).count();
    let free = |of: &ParameterRef| !fit.zero.contains(&of.process) && !spec.is_fixed(*of);
    let parameters = fit.composite.parameters().filter(|(of, _)| free(of)).count();
    Goodness {
        statistic: fit.objective,
        dof: fit.residuals.len().saturating_sub(parameters),
        expected: crate::curve::robust_scale::median(&objectives),
        p_value: (1 + larger) as f64 / (1 + draws.len()) as f64,
    }
}
