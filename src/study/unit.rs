//! One unit of work: some runs of one cell, through all its columns.

use super::plan::{Kept, Plan, Unit};
use crate::monte_carlo;
use crate::simulation::{self, RunResult};

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
    plan: &simulation::Plan<'_>,
    (first, runs): (u64, u64),
    kept: Kept,
    go_on: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn(u64) + Sync),
) -> Option<Vec<RunResult>> {
    let mut results = monte_carlo::run_range(plan, first, runs, go_on, progress)?;
    results.iter_mut().for_each(|r| reduce(kept, r));
    Some(results)
}

/// The result of a unit; `None` if `go_on` said no on the way.
pub(super) fn compute(
    plan: &Plan,
    simulation: &simulation::Plan<'_>,
    (unit, id): (Unit, &str),
    go_on: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn(u64) + Sync),
) -> Option<UnitResult> {
    let columns = run_unit(simulation, (unit.first, unit.runs), plan.kept(), go_on, progress)?;
    Some(UnitResult { id: id.to_owned(), first: unit.first, runs: unit.runs, columns })
}

fn reduce(kept: Kept, result: &mut RunResult) {
    let outages = result.outages.clone();
    let inside = |t_s: f64| outages.iter().any(|(start, end)| *start <= t_s && t_s < *end);
    match kept {
        Kept::AllEpochs => {}
        Kept::OutageEpochs => result.epochs.retain(|e| inside(e.t_s)),
        Kept::Runs => result.epochs.clear(),
    }
}
