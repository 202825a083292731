//! Units added up to cells.

use super::unit::{Finding, UnitResult};
use nav_sim_navigation::simulation::RunResult;

/// The sums of a cell as its units come in, in run order.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct CellSums {
    /// One finding a column.
    pub columns: Vec<Finding>,
    /// Runs so far.
    pub runs: u64,
}

impl CellSums {
    /// Adds the next unit; `false` (and nothing done) if it is not the next one or has another form.
    pub(crate) fn add(&mut self, unit: UnitResult) -> bool {
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
            for (sum, part) in self.columns.iter_mut().zip(unit.columns) {
                if let (Finding::Sampled(sum), Finding::Sampled(part)) = (sum, part) {
                    sum.append(part);
                }
            }
        }
        self.runs += unit.runs;
        true
    }
}

/// Whether there is a sum: what is expected of all runs has no second part.
fn alike(a: &Finding, b: &Finding) -> bool {
    let (Finding::Sampled(a), Finding::Sampled(b)) = (a, b) else { return false };
    let times = |r: &RunResult| r.epochs.iter().map(|e| e.t_s.to_bits()).collect::<Vec<_>>();
    a.outages == b.outages && a.filter_states == b.filter_states && times(a) == times(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_navigation::simulation::{EpochSums, RunRecord};

    /// Two runs of one column, from `first`.
    fn unit(first: u64) -> UnitResult {
        let run = |run| RunRecord { run, ..RunRecord::default() };
        let column = RunResult {
            epochs: vec![EpochSums { t_s: 1.0, count: 2, error_4: [1.5; 9], ..EpochSums::default() }],
            runs: (first..first + 2).map(run).collect(),
            outages: vec![(300.0, 390.0)],
            filter_states: 15,
            ..RunResult::default()
        };
        UnitResult { id: String::new(), first, runs: 2, columns: vec![Finding::Sampled(column)] }
    }

    #[test]
    fn units_are_added_in_the_order_of_their_runs() {
        let mut sums = CellSums::default();
        assert!(sums.add(unit(0)) && sums.add(unit(2)));
        let before = sums.clone();
        for wrong in [0, 2, 6] {
            assert!(!sums.add(unit(wrong)) && sums == before, "runs from {wrong} after 4");
        }
        let Finding::Sampled(column) = &sums.columns[0] else { unreachable!("runs make sums") };
        assert_eq!((sums.runs, column.epochs[0].count), (4, 4));
        assert_eq!(column.epochs[0].error_4, [3.0; 9]);
        assert!(!CellSums::default().add(unit(2)), "the first unit is missing");
    }

    #[test]
    fn units_of_another_form_are_refused() {
        let changes: [fn(&mut RunResult); 4] = [
            |c| c.outages[0].1 = 391.0,
            |c| c.outages.clear(),
            |c| c.filter_states = 27,
            |c| c.epochs[0].t_s = 2.0,
        ];
        let changed = |change: &fn(&mut RunResult)| {
            let mut other = unit(2);
            if let Finding::Sampled(column) = &mut other.columns[0] {
                change(column);
            }
            other
        };
        let without_columns = UnitResult { columns: Vec::new(), ..unit(2) };
        for (k, other) in changes.iter().map(changed).chain([without_columns]).enumerate() {
            let mut sums = CellSums::default();
            assert!(sums.add(unit(0)));
            let before = sums.clone();
            assert!(!sums.add(other) && sums == before, "change {k}");
        }
    }
}
