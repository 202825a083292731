//! Whether a model describes a curve: the J-test
//! ([Guerrier](crate::bibliography::Guerrier13)).

use crate::fit::Fit;
use crate::model::ModelSpec;
use crate::noise::Process;
use crate::outcome::Goodness;

/// The test of a fit, given the fits of the draws.
pub(crate) fn goodness(fit: &Fit, spec: &ModelSpec, draws: &[Fit]) -> Goodness {
    let objectives: Vec<f64> = draws.iter().map(|d| d.objective).collect();
    let larger = objectives.iter().filter(|o| **o >= fit.objective).count();
    let there = fit.composite.processes.iter().zip(fit.composite.labels()).enumerate();
    let free = |(i, (process, _)): (usize, (&Process, String))| {
        process.parameters().iter().filter(|(name, _)| !spec.is_fixed(i, name)).count()
    };
    let parameters: usize = there.filter(|(_, (_, label))| !fit.zero.contains(label)).map(free).sum();
    Goodness {
        statistic: fit.objective,
        dof: fit.residuals.len().saturating_sub(parameters),
        expected: crate::curve::robust_scale::median(&objectives),
        p_value: (1 + larger) as f64 / (1 + draws.len()) as f64,
    }
}
