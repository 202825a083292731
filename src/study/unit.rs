//! One unit of work: some runs of one cell, or its covariance analysis, through all its columns.

use super::plan::Kept;
use nav_sim_navigation::metrics::{self, EpochMetrics, Expected, Measured, OutageMetrics};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::RunResult;
use serde::{Deserialize, Serialize};

/// What is found of one column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Finding {
    /// By runs: their sums.
    Sampled(RunResult),
    /// By covariance analysis: what runs are expected to give.
    Expected(Expected),
}

/// What a unit found: a result for each column, its epochs reduced to what is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitResult {
    /// Name of the unit.
    pub id: String,
    /// First run.
    pub first: u64,
    /// Number of runs.
    pub runs: u64,
    /// One finding a column.
    pub columns: Vec<Finding>,
}

impl Finding {
    /// Outages (start, end) (s).
    #[must_use]
    pub fn windows(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Sampled(result) => result.outages.clone(),
            Self::Expected(expected) => expected
                .outages
                .iter()
                .map(|o| (o.start_s, o.end_s))
                .collect(),
        }
    }

    /// Statistics of the outages.
    pub(crate) fn outages(&self) -> Vec<OutageMetrics> {
        match self {
            Self::Sampled(result) => metrics::outages(result),
            Self::Expected(expected) => expected.outages.clone(),
        }
    }

    /// Statistics of the epochs that were kept.
    pub(crate) fn epochs(&self) -> Vec<EpochMetrics> {
        match self {
            Self::Sampled(result) => metrics::epochs(result),
            Self::Expected(expected) => expected.epochs.clone(),
        }
    }

    /// What ratios and the verdict are made of.
    pub(crate) fn measured(&self) -> Measured {
        match self {
            Self::Sampled(result) => result.into(),
            Self::Expected(expected) => expected.into(),
        }
    }

    /// Adds later runs; what is expected of all runs has no second part.
    pub(super) fn append(&mut self, later: Self) {
        if let (Self::Sampled(sum), Self::Sampled(later)) = (self, later) {
            sum.append(later);
        }
    }

    /// Drops the sums at epochs that are not kept.
    pub(super) fn reduce(&mut self, kept: Kept) {
        let windows = self.windows();
        let inside = |t_s: f64| {
            windows
                .iter()
                .any(|&(start_s, end_s)| Outage { start_s, end_s }.withholds(t_s))
        };
        let keeps =
            |t_s: f64| kept == Kept::AllEpochs || (kept == Kept::OutageEpochs && inside(t_s));
        match self {
            Self::Sampled(result) => result.epochs.retain(|e| keeps(e.t_s)),
            Self::Expected(expected) => expected.epochs.retain(|e| keeps(e.t_s)),
        }
    }
}
