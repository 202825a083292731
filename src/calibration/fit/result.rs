//! A model fitted to a curve.

use super::optimise::Termination;
use crate::noise::{Composite, ParameterError};

/// A fitted model. That the iterations did not converge is told, not an error.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The model: processes in the order of [`Kind::ALL`](crate::noise::Kind::ALL), alike ones by ascending correlation time.
    pub composite: Composite,
    /// Σ Omega_j (nu_j − nu_j(theta))² at theta.
    pub objective: f64,
    /// End of the iterations of the best start.
    pub termination: Termination,
    /// Combinations of shapes (correlation times) that were tried, each with its best amplitudes.
    pub combinations: usize,
    /// Local minima among them, all descended from.
    pub starts: usize,
    /// Starts that end within 1e-6 of the best objective.
    pub agreeing: usize,
    /// The next best local minimum's objective, if there is one.
    pub runner_up: Option<f64>,
    /// The processes whose amplitude is zero: not identifiable from this curve.
    pub zero: Vec<usize>,
    /// The processes whose shape lies at the end of its range: not identifiable either.
    pub at_end: Vec<usize>,
    /// √Omega_j (nu_j − nu_j(theta)) of each scale; in standard deviations when weighted by edof.
    pub residuals: Vec<f64>,
    /// Coordinates of the minima found, best first: where the search of a similar curve begins.
    pub(crate) minima: Vec<Vec<f64>>,
    /// The variances that the weights were made for.
    pub(crate) weighted_for: Vec<f64>,
}

/// Why a curve has no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Fewer scales than parameters.
    #[error("{spec} has {parameters} parameters, the curve {scales} scales")]
    TooFewScales {
        /// The model.
        spec: String,
        /// Its free parameters.
        parameters: usize,
        /// Scales of the curve.
        scales: usize,
    },
    /// A wavelet variance that is not positive has no logarithm, no weight, no meaning.
    #[error(
        "the wavelet variance at scale 2^{level} is {value}: it must be a number from 1e-100 to 1e100"
    )]
    NotPositive {
        /// Level.
        level: u32,
        /// The value.
        value: f64,
    },
    /// Degrees of freedom that weigh nothing.
    #[error(
        "the degrees of freedom at scale 2^{level} are {value}: they must be a number from 1e-15 to 1e15"
    )]
    NoWeight {
        /// Level.
        level: u32,
        /// The value.
        value: f64,
    },
    /// Nothing to be read off.
    #[error("{process} has no slope of its own in the Allan deviation: avlr cannot estimate it")]
    NoSlope {
        /// Code of the process.
        process: &'static str,
    },
    /// A result outside its domain: the numbers of the curve are out of range.
    #[error("the fit left the domain of its parameters: {0}")]
    Domain(#[from] ParameterError),
}
