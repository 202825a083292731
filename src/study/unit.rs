//! One unit of work: some runs of one cell, or its covariance analysis, through all its columns.

use super::failure::StudyError;
use super::inputs::Work;
use super::plan::{Kept, Plan, Unit};
use nav_sim_navigation::metrics::{self, EpochMetrics, Expected, Measured, OutageMetrics};
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::{self, RunRecord, RunResult};

/// What is found of one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Finding {
    /// By runs: their sums.
    Sampled(RunResult),
    /// By covariance analysis: what runs are expected to give.
    Expected(Expected),
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
    /// One finding a column.
    pub columns: Vec<Finding>,
}

impl UnitResult {
    /// Whether it holds the runs of this unit of a plan, all of them, in so many columns with these outages (start and
    /// end, s).
    pub(crate) fn fits(&self, unit: Unit, columns: usize, outages: &[(f64, f64)]) -> bool {
        let numbers = || unit.first..unit.first + unit.runs;
        let column_fits =
            |c: &Finding| c.windows() == outages && c.records().iter().map(|r| r.run).eq(numbers());
        (self.first, self.runs, self.columns.len()) == (unit.first, unit.runs, columns)
            && self.columns.iter().all(column_fits)
    }
}

impl Finding {
    /// Outages (start, end) (s).
    #[must_use]
    pub fn windows(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Sampled(result) => result.outages.clone(),
            Self::Expected(expected) => expected.outages.iter().map(|o| (o.start_s, o.end_s)).collect(),
        }
    }

    /// One record a run; that which stands for all runs in a covariance analysis.
    pub(crate) fn records(&self) -> &[RunRecord] {
        match self {
            Self::Sampled(result) => &result.runs,
            Self::Expected(expected) => std::slice::from_ref(&expected.record),
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

    fn reduce(&mut self, kept: Kept) {
        let windows = self.windows();
        let inside =
            |t_s: f64| windows.iter().any(|&(start_s, end_s)| Outage { start_s, end_s }.withholds(t_s));
        let keeps = |t_s: f64| kept == Kept::AllEpochs || (kept == Kept::OutageEpochs && inside(t_s));
        match self {
            Self::Sampled(result) => result.epochs.retain(|e| keeps(e.t_s)),
            Self::Expected(expected) => expected.epochs.retain(|e| keeps(e.t_s)),
        }
    }
}

/// Computes runs `first..first + runs`; `None` if `go_on` said no on the way. `progress` is told of runs
/// completed.
pub(crate) fn run_unit(
    plan: &simulation::Plan<'_>,
    (first, runs): (u64, u64),
    kept: Kept,
    go_on: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn(u64) + Sync),
) -> Option<Vec<Finding>> {
    let results = monte_carlo::run_range(plan, first, runs, go_on, progress)?;
    Some(reduced(kept, results.into_iter().map(Finding::Sampled)))
}

fn reduced(kept: Kept, findings: impl Iterator<Item = Finding>) -> Vec<Finding> {
    let mut findings: Vec<Finding> = findings.collect();
    findings.iter_mut().for_each(|finding| finding.reduce(kept));
    findings
}

/// The result of a unit; `None` if `go_on` said no on the way.
pub(super) fn compute(
    plan: &Plan,
    work: &Work<'_>,
    (unit, id): (Unit, &str),
    go_on: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Option<UnitResult>, StudyError> {
    let columns = match work {
        Work::Sampling(simulation) => {
            run_unit(simulation, (unit.first, unit.runs), plan.kept(), go_on, progress)
        }
        Work::Analysis(analysis) => {
            let expected = analysis.expected()?;
            progress(unit.runs);
            Some(reduced(plan.kept(), expected.into_iter().map(Finding::Expected)))
        }
    };
    let named = |columns| UnitResult { id: id.to_owned(), first: unit.first, runs: unit.runs, columns };
    Ok(columns.map(named))
}
