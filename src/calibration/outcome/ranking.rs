//! Choice of a model: the results.

use super::inference::LEVEL;
use crate::model::ModelSpec;

/// A model that was tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The model.
    pub spec: ModelSpec,
    /// Σ Omega_j (nu_j − nu_j(theta))².
    pub objective: f64,
    /// 2 Σ Omega_j cov(nu_j, nu_j(theta)).
    pub optimism: f64,
    /// For a simpler one than the best that was tested against it: the probability of so large a difference of
    /// their objectives if it is true.
    pub p_value: Option<f64>,
    /// Probability of so large an objective if it is true, where that was asked: the J-test.
    pub j_p_value: Option<f64>,
}

impl Candidate {
    /// Whether it was tested and does not describe the curve.
    #[must_use]
    pub fn is_rejected(&self) -> bool {
        self.j_p_value.is_some_and(|p| p < LEVEL)
    }

    /// The criterion.
    #[must_use]
    pub fn wvic(&self) -> f64 {
        self.objective + self.optimism
    }
}

/// The candidates and the choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranking {
    /// The candidates all of whose processes can be identified, by WVIC; those whose distance alone exceeds the
    /// WVIC of the nearest are left out.
    pub candidates: Vec<Candidate>,
    /// Position of the chosen candidate.
    pub chosen: usize,
    /// Number of candidates left out because a process of theirs is zero or at the end of its range: the same
    /// without it is among the others.
    pub not_identifiable: usize,
    /// Number of candidates left out because their distance alone is too large.
    pub far: usize,
    /// The last simpler candidate that was given up, if any was.
    pub too_simple: Option<TooSimple>,
}

/// A simpler model that does not do as well as the chosen one.
#[derive(Debug, Clone, PartialEq)]
pub struct TooSimple {
    /// The model.
    pub spec: ModelSpec,
    /// Probability of so large a difference of their objectives if it is true, at most.
    pub p_value: f64,
    /// The level that speaks loudest against it.
    pub level: u32,
    /// Share of that level in all that speaks against it.
    pub share: f64,
}
