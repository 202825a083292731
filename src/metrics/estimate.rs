//! Estimates from a finite number of runs, with their uncertainty.

use crate::simulation::{REPORTED, REPORTED_NAMES};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use statrs::distribution::{Binomial, DiscreteCDF};

/// A value estimated from runs and its Monte-Carlo standard error (NaN when one run cannot tell).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Its standard error.
    pub std_error: f64,
}

impl Estimate {
    /// The mean of `n` values from their sum and their sum of squares.
    #[must_use]
    pub fn mean(n: u64, sum: f64, sum_sq: f64) -> Self {
        let n = n as f64;
        let value = sum / n;
        let variance = (sum_sq / n - value * value).max(0.0) * n / (n - 1.0);
        Self { value, std_error: (variance / n).sqrt() }
    }

    /// The root mean square of `n` values from their sums of squares and of fourth powers, the standard
    /// error by linearisation: sd(x²)/(2 rms √n).
    #[must_use]
    pub fn root_mean_square(n: u64, sum_sq: f64, sum_4: f64) -> Self {
        let square = Self::mean(n, sum_sq, sum_4);
        let value = square.value.sqrt();
        let std_error = if value > 0.0 { square.std_error / (2.0 * value) } else { square.std_error };
        Self { value, std_error }
    }

    /// The mean of a sample.
    #[must_use]
    pub fn mean_of(sample: impl Iterator<Item = f64> + Clone) -> Self {
        let n = sample.clone().count() as u64;
        Self::mean(n, sample.clone().sum(), sample.map(|x| x * x).sum())
    }

    /// The root mean square of a sample.
    #[must_use]
    pub fn root_mean_square_of(sample: impl Iterator<Item = f64> + Clone) -> Self {
        let n = sample.clone().count() as u64;
        let squares = sample.map(|x| x * x);
        Self::root_mean_square(n, squares.clone().sum(), squares.map(|x| x * x).sum())
    }
}

/// One value for each reported state; in files an object with their names as keys.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerState<T>(pub [T; REPORTED]);

impl<T: Serialize> Serialize for PerState<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(REPORTED))?;
        for (name, value) in REPORTED_NAMES.iter().zip(&self.0) {
            map.serialize_entry(name, value)?;
        }
        map.end()
    }
}

/// A quantile and its distribution-free 95 % interval (`None` where the sample is too small for a bound).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantile {
    /// The sample quantile (linear between order statistics).
    pub value: f64,
    /// Lower and upper bound of the interval.
    pub ci95: (Option<f64>, Option<f64>),
}

/// The quantile at `p` of a sorted sample. The interval runs between order statistics: the number of
/// values below the true quantile is binomial (n, p), whatever the distribution.
#[must_use]
pub fn quantile(sorted: &[f64], p: f64) -> Quantile {
    let Some(last) = sorted.len().checked_sub(1) else {
        return Quantile { value: f64::NAN, ci95: (None, None) };
    };
    let position = p * last as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(last);
    let value = sorted[below] + (position - below as f64) * (sorted[above] - sorted[below]);
    Quantile { value, ci95: order_statistic_interval(sorted, p) }
}

/// x_(l) and x_(u), counted from 1, with P(B < l) ≤ 2.5 % and P(B ≥ u) ≤ 2.5 %, B binomial.
fn order_statistic_interval(sorted: &[f64], p: f64) -> (Option<f64>, Option<f64>) {
    let n = sorted.len() as u64;
    let Ok(binomial) = Binomial::new(p, n) else { return (None, None) };
    let l = (0..n).take_while(|l| binomial.cdf(*l) <= 0.025).count(); // B ≤ l − 1 has at most 2.5 %
    let u = (0..=n).find(|u| *u > 0 && 1.0 - binomial.cdf(u - 1) <= 0.025);
    let lower = l.checked_sub(1).and_then(|i| sorted.get(i)).copied();
    (lower, u.and_then(|u| sorted.get(u as usize - 1)).copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_root_mean_square_of_a_known_sample() {
        // 1, 2, 3, 6: mean 3, sample variance 14/3
        let mean = Estimate::mean_of([1.0, 2.0, 3.0, 6.0].into_iter());
        assert_eq!(mean.value, 3.0);
        assert!((mean.std_error - (14.0_f64 / 12.0).sqrt()).abs() < 1e-15);
        // squares 1, 4, 9, 36: mean 12.5, sample variance 769/3
        let rms = Estimate::root_mean_square_of([1.0, -2.0, 3.0, -6.0].into_iter());
        assert!((rms.value - 12.5_f64.sqrt()).abs() < 1e-15);
        let expected = (769.0_f64 / 12.0).sqrt() / (2.0 * 12.5_f64.sqrt());
        assert!((rms.std_error - expected).abs() < 1e-14, "{} {expected}", rms.std_error);
    }

    #[test]
    fn one_run_has_no_standard_error() {
        assert!(Estimate::mean_of([2.0].into_iter()).std_error.is_nan());
    }

    /// The interval's bounds for n = 100: for the median the 40th and 61st values (96.5 % together), for
    /// p = 0.95 the 90th and 100th: P(B ≤ 89) = 1.1 %, P(B ≤ 90) = 2.8 %, P(B ≥ 99) = 3.7 %.
    #[test]
    fn quantiles_lie_between_order_statistics() {
        let sorted: Vec<f64> = (1..=100).map(f64::from).collect();
        let median = quantile(&sorted, 0.5);
        assert_eq!((median.value, median.ci95), (50.5, (Some(40.0), Some(61.0))));
        let high = quantile(&sorted, 0.95);
        assert!((high.value - 95.05).abs() < 1e-12);
        assert_eq!(high.ci95, (Some(90.0), Some(100.0)));
    }

    #[test]
    fn small_samples_have_open_intervals() {
        // P(B ≤ 1) = 0.7 %, P(B ≤ 2) = 14 %, P(B = 3) = 86 %
        assert_eq!(quantile(&[1.0, 2.0, 3.0], 0.95).ci95, (Some(2.0), None));
        assert_eq!(quantile(&[1.0, 2.0, 3.0], 0.5).ci95, (None, None));
        assert!(quantile(&[], 0.5).value.is_nan());
    }

    #[test]
    fn states_are_named_in_files() {
        let text = serde_json::to_string(&PerState(std::array::from_fn::<_, REPORTED, _>(|i| i))).unwrap();
        assert!(text.starts_with(r#"{"pos_n_m":0,"pos_e_m":1,"#), "{text}");
    }
}
