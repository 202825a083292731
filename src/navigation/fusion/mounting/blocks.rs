//! Weighted means of what is correlated in time, and their standard deviations.

/// Length of a block (s): slopes, banks and slips of a road are mostly over by then.
pub(super) const BLOCK_S: f64 = 20.0;
/// Fewest blocks of which a scatter is known.
pub(super) const FEWEST: usize = 6;

/// Sums over blocks of time.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    /// Number of the block, and the sum in it.
    sums: Vec<(i64, f64)>,
    weight: f64,
}

impl Blocks {
    /// Adds `value` of weight `weight` at a time, times in order.
    pub(super) fn add(&mut self, t_s: f64, value: f64, weight: f64) {
        let block = (t_s / BLOCK_S).floor() as i64;
        self.weight += weight;
        match self.sums.last_mut() {
            Some((last, sum)) if *last == block => *sum += weight * value,
            _ => self.sums.push((block, weight * value)),
        }
    }

    pub(super) fn count(&self) -> usize {
        self.sums.len()
    }

    pub(super) fn mean(&self) -> f64 {
        self.sums.iter().map(|(_, sum)| sum).sum::<f64>() / self.weight
    }

    /// Standard deviation of a mean whose values have been reduced by it: from the scatter of the blocks, with the
    /// correlation of neighbours where that is positive (Newey and West's estimator of lag one), and wider where they
    /// are few, as Student's t is.
    pub(super) fn sigma(&self) -> f64 {
        let count = self.count() as f64;
        let own: f64 = self.sums.iter().map(|(_, sum)| sum * sum).sum();
        let neighbours = self.sums.windows(2).filter(|w| w[1].0 == w[0].0 + 1);
        let shared: f64 = neighbours.map(|w| w[0].1 * w[1].1).sum();
        // Newey and West's weight at lag one is 1/2, and each pair counts twice: factor 1. A negative
        // correlation is not used: it would narrow the interval on the evidence of few blocks.
        let variance = (own + shared.max(0.0)) * count / (count - 1.0);
        // 1 + 1/(4ν) of the normal quantile is t's near one sigma; 2.5/ν covers three
        variance.sqrt() / self.weight * (1.0 + 2.5 / (count - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 400 values of ±1, neighbours as often alike as not, the mean has the standard deviation 1/√400.
    #[test]
    fn the_scatter_of_blocks_is_that_of_their_mean() {
        let mut blocks = Blocks::default();
        for k in 0..400 {
            let value = if k % 4 < 2 { 1.0 } else { -1.0 };
            (0..10).for_each(|i| {
                blocks.add(BLOCK_S * (f64::from(k) + 0.1 * f64::from(i)), value, 2.0)
            });
        }
        assert!(blocks.mean().abs() < 1e-12 && blocks.count() == 400);
        // 1 % for the few
        assert!(
            (blocks.sigma() * 20.0 - 1.0).abs() < 0.01,
            "{}",
            blocks.sigma()
        );
        // neighbours that are all alike in pairs: half as many values
        let mut pairs = Blocks::default();
        (0..400).for_each(|k| {
            pairs.add(
                BLOCK_S * f64::from(k),
                if (k / 2) % 2 == 0 { 1.0 } else { -1.0 },
                1.0,
            )
        });
        assert!(pairs.sigma() >= blocks.sigma());
    }
}
