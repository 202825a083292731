//! Estimates from a finite number of runs, with their uncertainty.

use crate::simulation::{REPORTED, REPORTED_NAMES};
use serde::de::Error as _;
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use statrs::distribution::{Binomial, DiscreteCDF};
use std::collections::HashMap;

/// A value estimated from runs and its Monte-Carlo standard error (NaN when one run cannot tell).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Its standard error.
    pub std_error: f64,
}

impl Estimate {
    /// The mean of a sample from its sum and its sum of squares. Values that hang together scatter less about
    /// their own mean: by 1 − 1/`independent` in the variance, which the division by `independent` − 1 makes
    /// good as it does for independent ones.
    #[must_use]
    pub fn mean(size: SampleSize, sum: f64, sum_sq: f64) -> Self {
        let n = size.values as f64;
        let value = sum / n;
        // Cancellation may leave a scatter of −1e-16; the root of it would be NaN.
        Self::scattered(size, value, (sum_sq / n - value * value).max(0.0))
    }

    /// A mean and the mean square of the values about it.
    fn scattered(size: SampleSize, value: f64, scatter: f64) -> Self {
        // scatter is the sum of squares over n; over m independent values its expectation is σ²(1 − 1/m), and
        // the variance of the mean σ²/m: hence scatter/(m − 1).
        let freedom = size.independent - 1.0;
        Self {
            value,
            std_error: if freedom > 0.0 {
                (scatter / freedom).sqrt()
            } else {
                f64::NAN
            },
        }
    }

    /// The root mean square of a sample from its sums of squares and of fourth powers.
    #[must_use]
    pub fn root_mean_square(size: SampleSize, sum_sq: f64, sum_4: f64) -> Self {
        Self::mean(size, sum_sq, sum_4).root()
    }

    /// The square root, its standard error by linearisation: that of the square over twice the root.
    #[must_use]
    pub fn root(self) -> Self {
        let value = self.value.sqrt();
        let std_error = if value > 0.0 {
            self.std_error / (2.0 * value)
        } else {
            self.std_error
        };
        Self { value, std_error }
    }

    /// The mean of a sample, of which no more than `windows` values are independent ([`SampleSize::of`]).
    #[must_use]
    pub fn mean_of(sample: impl Iterator<Item = f64> + Clone, windows: Option<f64>) -> Self {
        let size = SampleSize::of(sample.clone().count() as u64, windows);
        let n = size.values as f64;
        let value = sample.clone().sum::<f64>() / n;
        // about the mean in a second pass: values of little scatter would lose it in their squares
        Self::scattered(
            size,
            value,
            sample.map(|x| (x - value).powi(2)).sum::<f64>() / n,
        )
    }
}

/// How many values a statistic is made of, and how many independent ones they are worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleSize {
    /// Values.
    pub values: u64,
    /// Independent values that would tell as much.
    pub independent: f64,
}

impl SampleSize {
    /// The size of a sample of `values` runs, no more than `windows` of which have noise of their own (none: all
    /// have).
    #[must_use]
    pub fn of(values: u64, windows: Option<f64>) -> Self {
        Self {
            values,
            independent: windows.unwrap_or(f64::INFINITY).min(values as f64),
        }
    }
}

/// One value for each reported state; in files that people read an object with their names as keys.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerState<T>(pub [T; REPORTED]);

impl<T: Serialize> Serialize for PerState<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if !serializer.is_human_readable() {
            return self.0.serialize(serializer);
        }
        let mut map = serializer.serialize_map(Some(REPORTED))?;
        for (name, value) in REPORTED_NAMES.iter().zip(&self.0) {
            map.serialize_entry(name, value)?;
        }
        map.end()
    }
}

/// An object with these names as keys, in their order.
pub(super) fn serialize_named<T: Serialize, S: Serializer>(
    named: &[(String, T)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(named.len()))?;
    for (name, value) in named {
        map.serialize_entry(name, value)?;
    }
    map.end()
}

impl<'de, T: Deserialize<'de> + Copy> Deserialize<'de> for PerState<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if !deserializer.is_human_readable() {
            return Deserialize::deserialize(deserializer).map(Self);
        }
        let by_name = HashMap::<String, T>::deserialize(deserializer)?;
        let value = |name: &&'static str| {
            by_name
                .get(*name)
                .copied()
                .ok_or_else(|| D::Error::missing_field(name))
        };
        let values = REPORTED_NAMES
            .iter()
            .map(value)
            .collect::<Result<Vec<T>, _>>()?;
        Ok(Self(std::array::from_fn(|i| values[i])))
    }
}

/// A quantile and its distribution-free 95 % interval (`None` where the sample is too small for a bound).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quantile {
    /// The sample quantile (linear between order statistics).
    pub value: f64,
    /// Lower and upper bound of the interval.
    pub ci95: (Option<f64>, Option<f64>),
}

/// The quantile at `p` of a sorted sample. The interval runs between order statistics: the number of
/// values below the true quantile is binomial (n, p), whatever the distribution. Where no more than `windows`
/// values are independent, it runs between the order statistics at the same shares of the sample.
#[must_use]
pub fn quantile(sorted: &[f64], p: f64, windows: Option<f64>) -> Quantile {
    Quantile {
        value: sample_quantile(sorted, p),
        ci95: order_statistic_interval(sorted, p, windows),
    }
}

/// The quantile alone; NaN of no value.
pub(super) fn sample_quantile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    // From the first value (p = 0) to the last (p = 1): Hyndman and Fan's type 7, the default of R and NumPy.
    let position = p * last as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

/// x_(l) and x_(u), counted from 1, with P(B < l) ≤ 2.5 % and P(B ≥ u) ≤ 2.5 %, B binomial.
fn order_statistic_interval(
    sorted: &[f64],
    p: f64,
    windows: Option<f64>,
) -> (Option<f64>, Option<f64>) {
    // Rounded down: fewer independent values make a wider interval.
    let n = SampleSize::of(sorted.len() as u64, windows)
        .independent
        .floor() as u64;
    let Ok(binomial) = Binomial::new(p, n) else {
        return (None, None);
    };
    let l = (0..n).take_while(|l| binomial.cdf(*l) <= 0.025).count(); // B ≤ l − 1 has at most 2.5 %
    let u = (0..=n).find(|u| *u > 0 && 1.0 - binomial.cdf(u - 1) <= 0.025);
    // one independent value stands for so many; the bounds are the outermost of theirs
    let each = sorted.len() as f64 / n as f64;
    let lower = l
        .checked_sub(1)
        .map(|before| (before as f64 * each).floor() as usize);
    let upper = u.map(|u| (u as f64 * each).ceil() as usize - 1);
    (
        lower.and_then(|i| sorted.get(i)).copied(),
        upper.and_then(|i| sorted.get(i)).copied(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_root_mean_square_of_a_known_sample() {
        // 1, 2, 3, 6: mean 3, sample variance 14/3
        let mean = Estimate::mean_of([1.0, 2.0, 3.0, 6.0].into_iter(), None);
        assert_eq!(mean.value, 3.0);
        assert!((mean.std_error - (14.0_f64 / 12.0).sqrt()).abs() < 1e-15);
        // squares 1, 4, 9, 36: mean 12.5, sample variance 769/3
        let rms =
            Estimate::mean_of([1.0_f64, -2.0, 3.0, -6.0].into_iter().map(|x| x * x), None).root();
        assert!((rms.value - 12.5_f64.sqrt()).abs() < 1e-15);
        let expected = (769.0_f64 / 12.0).sqrt() / (2.0 * 12.5_f64.sqrt());
        assert!(
            (rms.std_error - expected).abs() < 1e-14,
            "{} {expected}",
            rms.std_error
        );
    }

    #[test]
    fn one_run_has_no_standard_error() {
        assert!(
            Estimate::mean_of([2.0].into_iter(), None)
                .std_error
                .is_nan()
        );
    }

    /// Every value twice: the mean of half as many independent ones, its standard error theirs.
    #[test]
    fn values_that_repeat_each_other_count_once() {
        let once = [1.0, 2.0, 3.0, 6.0];
        let twice = once.iter().flat_map(|x| [*x, *x]);
        assert_eq!(
            Estimate::mean_of(twice, Some(4.0)),
            Estimate::mean_of(once.into_iter(), None)
        );
        let sorted: Vec<f64> = (1..=100).map(f64::from).collect();
        let doubled: Vec<f64> = sorted.iter().flat_map(|x| [*x, *x]).collect();
        assert_eq!(
            quantile(&doubled, 0.5, Some(100.0)).ci95,
            quantile(&sorted, 0.5, None).ci95
        );
        assert!(
            Estimate::mean_of(once.into_iter(), Some(1.0))
                .std_error
                .is_nan()
        );
    }

    /// The interval's bounds for n = 100: for the median the 40th and 61st values (96.5 % together), for
    /// p = 0.95 the 90th and 100th: P(B ≤ 89) = 1.1 %, P(B ≤ 90) = 2.8 %, P(B ≥ 99) = 3.7 %.
    #[test]
    fn quantiles_lie_between_order_statistics() {
        let sorted: Vec<f64> = (1..=100).map(f64::from).collect();
        let median = quantile(&sorted, 0.5, None);
        assert_eq!(
            (median.value, median.ci95),
            (50.5, (Some(40.0), Some(61.0)))
        );
        let high = quantile(&sorted, 0.95, None);
        assert!((high.value - 95.05).abs() < 1e-12);
        assert_eq!(high.ci95, (Some(90.0), Some(100.0)));
    }

    #[test]
    fn small_samples_have_open_intervals() {
        // P(B ≤ 1) = 0.7 %, P(B ≤ 2) = 14 %, P(B = 3) = 86 %
        assert_eq!(
            quantile(&[1.0, 2.0, 3.0], 0.95, None).ci95,
            (Some(2.0), None)
        );
        assert_eq!(quantile(&[1.0, 2.0, 3.0], 0.5, None).ci95, (None, None));
        assert!(quantile(&[], 0.5, None).value.is_nan());
    }

    #[test]
    fn states_are_named_in_files() {
        let text =
            serde_json::to_string(&PerState(std::array::from_fn::<_, REPORTED, _>(|i| i))).unwrap();
        assert!(text.starts_with(r#"{"pos_n_m":0,"pos_e_m":1,"#), "{text}");
    }
}
