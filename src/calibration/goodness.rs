//! Whether a model describes a curve: the J-test
//! ([Guerrier](crate::bibliography::Guerrier13)).

use super::fit::Fit;
use super::spec::ModelSpec;
use crate::noise::Process;

/// The test of over-identifying restrictions. Its statistic is the least Σ Omega_j (nu_j − nu_j(theta))²; what it
/// is when the model holds is known from the bootstrap, which repeats the whole estimation, so no weighting and
/// no trim makes the probability wrong, and the replicates' differences are allowed for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goodness {
    /// J, the objective.
    pub statistic: f64,
    /// Scales less free parameters of processes that are there.
    pub dof: usize,
    /// Median of J when the model holds.
    pub expected: f64,
    /// Probability of a J at least this large when the model holds: (1 + draws that have one) / (1 + draws).
    pub p_value: f64,
}

/// Probability below which the model is said not to describe the curve.
const LEVEL: f64 = 0.05;

impl Goodness {
    /// Whether so large a J has a probability below 5 % when the model holds.
    #[must_use]
    pub fn is_rejected(&self) -> bool {
        self.p_value < LEVEL
    }
}

/// The test of a fit, given the fits of the draws.
pub(super) fn goodness(fit: &Fit, spec: &ModelSpec, draws: &[Fit]) -> Goodness {
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
        expected: super::robust_scale::median(&objectives),
        p_value: (1 + larger) as f64 / (1 + draws.len()) as f64,
    }
}
