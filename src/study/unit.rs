//! One unit of work: some runs of one cell, through all its columns.

use super::description::{Metric, Study};
use super::plan::Unit;
use crate::monte_carlo;
use crate::simulation::{Plan, RunResult};
use serde::{Deserialize, Serialize};

/// What is kept of the sums at epochs; records of runs are always kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kept {
    /// None.
    Runs,
    /// Those of epochs inside outages.
    OutageEpochs,
    /// All.
    AllEpochs,
}

impl Kept {
    /// What the metrics of a study need.
    #[must_use]
    pub fn of(study: &Study) -> Self {
        if study.keeps(Metric::Epochs) {
            Self::AllEpochs
        } else if study.keeps(Metric::Ratios) {
            Self::OutageEpochs
        } else {
            Self::Runs
        }
    }

    fn reduce(self, result: &mut RunResult) {
        let outages = result.outages.clone();
        let inside = |t_s: f64| outages.iter().any(|(start, end)| *start <= t_s && t_s < *end);
        match self {
            Self::AllEpochs => {}
            Self::OutageEpochs => result.epochs.retain(|e| inside(e.t_s)),
            Self::Runs => result.epochs.clear(),
        }
    }
}

/// What a unit found: a result for each column, its epochs reduced to what is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitResult {
    /// Name of the unit.
    pub id: String,
    /// First run.
    pub first: u64,
    /// Number of runs.
    pub runs: u64,
    /// One result a column.
    pub columns: Vec<RunResult>,
}

impl UnitResult {
    /// Whether it holds the runs of this unit of a plan, all of them, in so many columns with these outages (start and
    /// end, s).
    #[must_use]
    pub fn fits(&self, unit: Unit, columns: usize, outages: &[(f64, f64)]) -> bool {
        let numbers = || unit.first..unit.first + unit.runs;
        let column_fits = |c: &RunResult| c.outages == outages && c.runs.iter().map(|r| r.run).eq(numbers());
        (self.first, self.runs, self.columns.len()) == (unit.first, unit.runs, columns)
            && self.columns.iter().all(column_fits)
    }
}

/// Computes runs `first..first + runs`; `None` if `go_on` said no on the way. `progress` is told of runs
/// completed.
#[must_use]
pub fn run_unit(
    plan: &Plan<'_>,
    (first, runs): (u64, u64),
    kept: Kept,
    go_on: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn(u64) + Sync),
) -> Option<Vec<RunResult>> {
    let mut results = monte_carlo::run_range(plan, first, runs, go_on, progress)?;
    results.iter_mut().for_each(|r| kept.reduce(r));
    Some(results)
}
