//! Error budgets: which share of the mean square of the errors each of their sources has.

use super::estimate::{PerState, serialize_named};
use crate::simulation::REPORTED;
use crate::simulation::lincov::{FilterPass, Judged, NamedSource};
use rayon::prelude::*;
use serde::{Serialize, Serializer};

/// Shares of independent sources in the mean square of each reported state; of a state they sum to 1. In files an
/// object with the names of the sources as keys.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget {
    /// Every source with its shares.
    pub shares: Vec<(String, PerState<f64>)>,
    /// Mean squares, all sources together (m², (m/s)², degrees²).
    pub total: [f64; REPORTED],
}

impl Budget {
    /// Just before the first fix after each outage: every source goes alone through the gains of one filter.
    #[must_use]
    pub fn at_outage_ends(filter: &FilterPass<'_>, sources: &[NamedSource]) -> Vec<Self> {
        let squares = |source: &NamedSource| -> Vec<[f64; REPORTED]> {
            // Mean squares, not variances: a deterministic source (drift) has a mean and no variance.
            let squares = |end: &Judged| end.errors.variances(&end.errors.moments());
            filter
                .errors_at_ends(&source.side)
                .iter()
                .map(squares)
                .collect()
        };
        let of_source: Vec<Vec<[f64; REPORTED]>> = sources.par_iter().map(squares).collect();
        let is_there =
            |ends: &[[f64; REPORTED]]| ends.iter().flatten().any(|square| *square != 0.0);
        let (sources, of_source): (Vec<&NamedSource>, Vec<_>) = sources
            .iter()
            .zip(of_source)
            .filter(|(_, ends)| is_there(ends))
            .unzip();
        let outages = of_source.first().map_or(0, Vec::len);
        let budget = |k: usize| {
            let mut total = [0.0; REPORTED];
            for ends in &of_source {
                total
                    .iter_mut()
                    .zip(&ends[k])
                    .for_each(|(sum, square)| *sum += square);
            }
            let share = |ends: &Vec<[f64; REPORTED]>| {
                PerState(std::array::from_fn(|i| ends[k][i] / total[i]))
            };
            let shares = sources
                .iter()
                .zip(&of_source)
                .map(|(source, ends)| (source.name.clone(), share(ends)));
            Self {
                shares: shares.collect(),
                total,
            }
        };
        (0..outages).map(budget).collect()
    }

    /// Shares in the sum of the mean squares of some states (horizontal position: 0 and 1), the largest first.
    #[must_use]
    pub fn ranked(&self, states: &[usize]) -> Vec<(&str, f64)> {
        let whole: f64 = states.iter().map(|i| self.total[*i]).sum();
        let share = |of: &PerState<f64>| {
            states
                .iter()
                .map(|i| of.0[*i] * self.total[*i])
                .sum::<f64>()
                / whole
        };
        let mut all: Vec<(&str, f64)> = self
            .shares
            .iter()
            .map(|(name, of)| (name.as_str(), share(of)))
            .collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all
    }
}

impl Serialize for Budget {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize_named(&self.shares, serializer)
    }
}
