//! Units added up to cells.

use super::unit::UnitResult;
use crate::simulation::RunResult;

/// The sums of a cell as its units come in, in run order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CellSums {
    /// One result a column.
    pub columns: Vec<RunResult>,
    /// Runs so far.
    pub runs: u64,
}

impl CellSums {
    /// Adds the next unit; `false` (and nothing done) if it is not the next one or has another form.
    #[must_use]
    pub fn add(&mut self, unit: UnitResult) -> bool {
        if unit.first != self.runs {
            return false;
        }
        if self.columns.is_empty() {
            self.columns = unit.columns;
        } else {
            let alike = self.columns.len() == unit.columns.len()
                && self.columns.iter().zip(&unit.columns).all(|(a, b)| alike(a, b));
            if !alike {
                return false;
            }
            self.columns.iter_mut().zip(unit.columns).for_each(|(sum, part)| sum.append(part));
        }
        self.runs += unit.runs;
        true
    }
}

fn alike(a: &RunResult, b: &RunResult) -> bool {
    let times = |r: &RunResult| r.epochs.iter().map(|e| e.t_s.to_bits()).collect::<Vec<_>>();
    a.outages == b.outages && a.filter_states == b.filter_states && times(a) == times(b)
}
