//! Estimates from a finite number of runs, with their uncertainty.

use crate::minimise::bisection;
use crate::simulation::{REPORTED, REPORTED_NAMES};
use nalgebra::{Complex, DMatrix};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF, Normal};
use std::collections::HashMap;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::iter::Sum;

/// A value estimated from runs and its Monte-Carlo standard error (NaN when one run cannot tell).
#[derive(Debug, Clone, Copy, PartialEq)]
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
    pub fn root_mean_square(size: SampleSize, sum_sq: f64, sum_4: f64) -> Self {
        Self::mean(size, sum_sq, sum_4).root()
    }

    /// The square root, its standard error by linearisation: that of the square over twice the root.
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

/// Number of values in a statistic, and the number of independent values they are equivalent to.
#[derive(Debug, Clone, Copy)]
pub struct SampleSize {
    /// Values.
    pub values: u64,
    /// Independent values that would tell as much.
    pub independent: f64,
}

impl SampleSize {
    /// The size of a sample of `values` runs, no more than `windows` of which have noise of their own (none: all
    /// have).
    pub fn of(values: u64, windows: Option<f64>) -> Self {
        Self {
            values,
            independent: windows.unwrap_or(f64::INFINITY).min(values as f64),
        }
    }

    /// The size of the sample that the mean square of series of normalised errors is made of (NaN: not known), the states
    /// of one drive. The energy of a series at a scale of the Haar wavelet is the sum of N squares, alike and almost
    /// independent; by Satterthwaite the sum of all scales has (Σ E)² degrees of freedom over Σ E²/N. White errors are all
    /// independent; of an error that never changes there is one sample.
    pub fn of_series<S: Iterator<Item = f64>>(series: impl Iterator<Item = S>) -> Self {
        let (mut energy, mut square, mut states, mut values) = (0.0, 0.0, 0.0, 0);
        for own in series {
            let mut smooth: Vec<f64> = own.filter(|z| z.is_finite()).collect();
            values = values.max(smooth.len() as u64);
            states += 1.0;
            let mut last = 0.0; // of the means that have no neighbour: as slow as the drive
            while smooth.len() > 1 {
                let (pairs, rest) = smooth.as_chunks::<2>();
                last += rest.iter().map(|z| z * z).sum::<f64>();
                let detail: f64 = pairs.iter().map(|[a, b]| 0.5 * (a - b).powi(2)).sum();
                energy += detail;
                square += detail * detail / pairs.len() as f64;
                smooth = pairs.iter().map(|[a, b]| (a + b) * FRAC_1_SQRT_2).collect();
            }
            last += smooth.first().map_or(0.0, |z| z * z);
            energy += last;
            square += last * last;
        }
        let independent = energy * energy / (square * states);
        let independent = if independent.is_finite() {
            independent
        } else {
            1.0
        };
        Self {
            values,
            independent: independent.clamp(1.0, (values as f64).max(1.0)),
        }
    }
}

/// One value for each reported state; in files an object with their names as keys.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PerState<T>(pub [T; REPORTED]);

impl PerState<f64> {
    /// Values and standard errors.
    pub(super) fn split(all: [Estimate; REPORTED]) -> [Self; 2] {
        [all.map(|e| e.value), all.map(|e| e.std_error)].map(Self)
    }
}

impl<T: Serialize> Serialize for PerState<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(REPORTED_NAMES.iter().zip(&self.0))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for PerState<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut by_name = HashMap::<String, T>::deserialize(deserializer)?;
        let values: Vec<T> = REPORTED_NAMES
            .iter()
            .filter_map(|name| by_name.remove(*name))
            .collect();
        let values = values.try_into().map(Self);
        values.map_err(|_| D::Error::custom("expected a value for each state"))
    }
}

/// The quantile at `p` of a sorted sample; NaN of no value.
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

/// The distribution-free 95 % interval of the quantile at `p`; none where the sample is too small for a bound. It runs between
/// order statistics: the number of values below the true quantile is binomial (n, p), whatever the distribution. Where no more
/// than `windows` values are independent, it runs between the order statistics at the same shares of the sample.
///
/// x_(l) and x_(u), counted from 1, with P(B < l) ≤ 2.5 % and P(B ≥ u) ≤ 2.5 %, B binomial.
pub(super) fn quantile_interval(
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

// Where consistency statistics of a correct filter lie: NEES and NIS means, coverage.

/// Interval of a statistic for a consistent filter, 95 % unless said otherwise (discrete ones: at
/// least).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// 2.5 % (or what was asked for) lie below.
    pub lower: f64,
    /// Upper end: as many lie above.
    pub upper: f64,
}

impl Band {
    const NONE: Self = Self {
        lower: f64::NAN,
        upper: f64::NAN,
    };

    /// Returns true if a value lies in the band, its ends included.
    pub(crate) fn contains(&self, value: f64) -> bool {
        self.lower <= value && value <= self.upper
    }
}

/// The band of the mean of `count` independent chi-square statistics of `dof` degrees of freedom:
/// χ²(count·dof)/count ([Bar-Shalom et al.](crate::bibliography::BarShalom01), sec. 5.4).
pub fn chi_square_band(dof: usize, count: f64) -> Band {
    chi_square_interval(dof, count, 0.025)
}

/// Interval of chi-square with probability `tail` on each side. `count` need not be whole: so many independent values the
/// mean is worth.
pub(crate) fn chi_square_interval(dof: usize, count: f64, tail: f64) -> Band {
    if dof == 0 || count.is_nan() || count <= 0.0 {
        return Band::NONE;
    }
    // The sum of independent chi-square variables is one of the sum of their degrees of freedom.
    let total = dof as f64 * count;
    let mean_at = |p: f64| chi_square_quantile(total, p) / count;
    Band {
        lower: mean_at(tail),
        upper: mean_at(1.0 - tail),
    }
}

/// Exact to rounding up to 10⁵ degrees of freedom; above, by Wilson and Hilferty's cube root of a normal,
/// whose relative error there is below 1e-8 at 2.5 % and below 1e-6 at 1e-4.
fn chi_square_quantile(dof: f64, p: f64) -> f64 {
    if dof > 1e5 {
        let c = 2.0 / (9.0 * dof);
        let z = Normal::new(0.0, 1.0).map_or(f64::NAN, |normal| normal.inverse_cdf(p));
        // (χ²/dof)^(1/3) is nearly normal with mean 1 − 2/(9 dof) and variance 2/(9 dof).
        return dof * (1.0 - c + z * c.sqrt()).powi(3);
    }
    ChiSquared::new(dof).map_or(f64::NAN, |chi_square| chi_square.inverse_cdf(p))
}

/// The band of the share of `count` independent runs that a region of probability `level` covers.
pub(crate) fn coverage_band(level: f64, count: f64) -> Band {
    let whole = count as u64;
    match Binomial::new(level, whole) {
        Ok(binomial) if whole > 0 => {
            // The binomial law is discrete: the smallest count that reaches p, so that the band holds 95 % or
            // more.
            let quantile = |p: f64| binomial.inverse_cdf(p) as f64 / whole as f64;
            Band {
                lower: quantile(0.025),
                upper: quantile(0.975),
            }
        }
        _ => Band::NONE,
    }
}

// The law of the square of a normal error: a weighted sum of chi-square variables.

/// Nodes of the parabola, of which half are the others' conjugates: the error is below 1e-12 for shifts up to
/// [`FAR`].
const NODES: u32 = 48;
/// Sum of the squares of the shifts beyond which the line through the saddle point is taken: the parabola then
/// passes where the integrand is larger than there.
const FAR: f64 = 64.0;
/// Steps along that line in widths of the saddle, and how many at most.
const LINE_STEP: f64 = 0.25;
const LINE_STEPS: u32 = 20_000;
/// Steps of the mean's integral, and their length: the integrand falls as e^(−|y|) on both sides.
const MEAN_STEPS: i32 = 144;
const MEAN_STEP: f64 = 0.25;

/// Q = c + Σ w (z + d)², z independent standard normal variables.
#[derive(Debug, Clone)]
pub struct QuadraticForm {
    /// The part without scatter, c ≥ 0.
    certain: f64,
    /// Weights w > 0 and shifts d.
    terms: Vec<(f64, f64)>,
}

/// A quantile is found to this share of itself.
const QUANTILE: f64 = 1e-12;

/// Weights below this share of the largest are rounding: what they carry is certain.
const ROUNDING: f64 = 1e-14;

impl QuadraticForm {
    /// eᵀ e for an error e of this covariance and mean.
    pub(crate) fn of_square(covariance: &DMatrix<f64>, mean: &[f64]) -> Self {
        let eigen = covariance.clone().symmetric_eigen();
        let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let (mut certain, mut terms) = (0.0, Vec::new());
        for (w, axis) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            // In the axes of the covariance the components are independent: w (z + d)² with d = mean/√w.
            let along: f64 = axis.iter().zip(mean).map(|(a, m)| a * m).sum();
            if *w > ROUNDING * largest {
                terms.push((*w, along / w.sqrt()));
            } else {
                // A direction without variance: what mean there is in it belongs to every error.
                certain += along * along;
            }
        }
        Self { certain, terms }
    }

    /// eᵀ P⁻¹ e for an error e of this covariance and mean; none where `p` is not positive definite.
    pub(crate) fn of_normalised(
        p: &DMatrix<f64>,
        covariance: &DMatrix<f64>,
        mean: &[f64],
    ) -> Option<Self> {
        let factor = p.clone().cholesky()?.l();
        let whiten = |m: &DMatrix<f64>| factor.solve_lower_triangular(m);
        // L⁻¹ C L⁻ᵀ with P = L Lᵀ has the eigenvalues of P⁻¹ C and is symmetric.
        let half = whiten(covariance)?;
        let whole = whiten(&half.transpose())?;
        let mean = whiten(&DMatrix::from_column_slice(mean.len(), 1, mean))?;
        Some(Self::of_square(&whole, mean.as_slice()))
    }

    /// Expectation, c + Σ w (1 + d²).
    fn mean(&self) -> f64 {
        self.certain + self.sum(|w, d| w * (1.0 + d * d))
    }

    /// The sum of a function of weights and shifts.
    fn sum<T: Sum>(&self, of: impl Fn(f64, f64) -> T) -> T {
        self.terms.iter().map(|(w, d)| of(*w, *d)).sum()
    }

    /// P(Q ≤ x): the inversion of [Imhof](crate::bibliography::Imhof61).
    pub(crate) fn cdf(&self, x: f64) -> f64 {
        self.law(x)[0]
    }

    /// P(Q ≤ x), and its density at x.
    fn law(&self, x: f64) -> [f64; 2] {
        let x = x - self.certain;
        if x <= 0.0 || self.terms.is_empty() {
            let is_sure = x >= 0.0 && self.terms.is_empty();
            return [f64::from(u8::from(is_sure)), 0.0];
        }
        let far = self.sum(|_, d| d * d) > FAR;
        let [probability, density] = if far {
            self.along_line(x)
        } else {
            self.along_parabola(x)
        };
        [probability.clamp(0.0, 1.0), density.max(0.0)]
    }

    /// ∫ e^{px} φ(p)/p dp/(2πi), and without the 1/p, on a parabola around the singularities, all of them on the negative
    /// axis, where the integrand falls off and no longer oscillates ([Weideman and
    /// Trefethen](crate::bibliography::WeidemanTrefethen07), sec. 2).
    fn along_parabola(&self, x: f64) -> [f64; 2] {
        let n = f64::from(NODES);
        let mut sums = [0.0; 2];
        for k in 0..NODES / 2 {
            // Midpoints: the rule is symmetric about the real axis and no node lies on it. The constants of
            // the parabola below are the optimal ones for the plain transform; scaled by the number of nodes
            // it follows x through p/x.
            let theta = (2.0 * f64::from(k) + 1.0) * PI / n;
            let p = Complex::new(0.1309 - 0.1194 * theta * theta, 0.25 * theta) * n;
            let slope = Complex::new(-0.2388 * theta, 0.25) * n;
            // twice the imaginary part of half the contour
            let node = p.exp() * self.transform(p / x) * slope;
            sums[0] += (node / p).im;
            sums[1] += node.im / x;
        }
        sums.map(|sum| 2.0 / n * sum)
    }

    /// The sums on the vertical line through the saddle point, where the shifts make the integrand fall as a normal
    /// density: by the trapezoidal rule, until nothing is added.
    fn along_line(&self, x: f64) -> [f64; 2] {
        let (saddle, width) = self.saddle(x);
        // On a line through the saddle the integrand is like exp(−y²/2) in widths: the trapezoidal rule
        // converges geometrically, and a quarter of a width is exact to rounding.
        let step = LINE_STEP * width;
        let value = |k: u32| {
            let p = Complex::new(saddle, f64::from(k) * step);
            // the transform by its logarithm: beside e^{px} it would be 0
            let value = (self.ln_transform_at(p) + p * x).exp();
            [(value / p).re, value.re]
        };
        let first = value(0);
        let mut sums = first.map(|value| 0.5 * value);
        for k in 1..LINE_STEPS {
            let next = value(k);
            sums = [sums[0] + next[0], sums[1] + next[1]];
            // The second condition: the integrand oscillates and may pass through zero before it has fallen.
            if next[0].abs() < 1e-17 * first[0] && f64::from(k) * LINE_STEP > 8.0 {
                break;
            }
        }
        sums.map(|sum| sum * step / PI)
    }

    /// The least of e^{px} φ(p)/p for p > 0, and the width of the integrand across it. The logarithm is convex there.
    fn saddle(&self, x: f64) -> (f64, f64) {
        let slope = |p: f64| {
            let sum = self.sum(|w, d| {
                let base = 1.0 + 2.0 * w * p;
                w / base + w * d * d / (base * base)
            });
            x - sum - 1.0 / p
        };
        // At p = 1/x the slope is −Σ … < 0: the least lies above.
        let (mut low, mut high) = (0.0, 1.0 / x);
        while slope(high) < 0.0 {
            (low, high) = (high, 2.0 * high);
        }
        // Bisection of a monotone slope; the place of the line need not be exact, only its neighbourhood.
        let p = bisection(low, high, 1e-15, |p| slope(p) < 0.0);
        let curvature = self.sum(|w, d| {
            let base = 1.0 + 2.0 * w * p;
            2.0 * w * w / (base * base) + 4.0 * w * w * d * d / (base * base * base)
        });
        (p, (1.0 / (p * p) + curvature).sqrt().recip())
    }

    /// The x with P(Q ≤ x) = `probability`, to 1e-12 of itself.
    pub(crate) fn quantile(&self, probability: f64) -> f64 {
        let mean = self.mean();
        if mean.is_nan() || self.terms.is_empty() {
            return mean;
        }
        // Markov: P(Q ≤ k · mean) ≥ 1 − 1/k, so that doubling finds a bracket.
        let (mut low, mut high) = (0.0, mean);
        while self.cdf(high) < probability && high < 1e6 * mean {
            (low, high) = (high, 2.0 * high);
        }
        // Newton's steps on ln P over ln x, or on ln (1 − P) over x: the tails of either side are nearly straight there.
        // Within the bracket, since at its ends the distribution function has only its rounding to give to a step.
        let mut x = 0.5 * (low + high);
        while high - low > QUANTILE * high {
            let [below, density] = self.law(x);
            if below < probability {
                low = x
            } else {
                high = x
            }
            let next = if probability < 0.5 {
                x * ((probability / below).ln() * below / (density * x)).exp()
            } else {
                let beyond = 1.0 - below;
                x + (beyond / (1.0 - probability)).ln() * beyond / density
            };
            if (next - x).abs() <= QUANTILE * x {
                return next;
            }
            x = if low < next && next < high {
                next
            } else {
                0.5 * (low + high)
            };
        }
        x
    }

    /// E √Q = π^(−1/2) ∫ (1 − φ(u²)) du/u², with u = e^y by the trapezoidal rule, whose error is e^(−2π²), 3e-9, at most:
    /// that of a certain Q, whose transform grows beyond an imaginary part of π/4.
    pub(crate) fn mean_root(&self) -> f64 {
        // In units of its mean Q is about 1, and the fixed range of y holds the integrand of any Q.
        let scale = self.mean();
        if scale.is_nan() || scale <= 0.0 {
            return scale;
        }
        let node = |k: i32| {
            let u = (f64::from(k) * MEAN_STEP).exp();
            self.less_than_one(u * u / scale) / u
        };
        scale.sqrt() * MEAN_STEP * (-MEAN_STEPS..=MEAN_STEPS).map(node).sum::<f64>() / PI.sqrt()
    }

    /// 1 − E e^(−pQ) for p ≥ 0, with all its digits where it is small.
    fn less_than_one(&self, p: f64) -> f64 {
        // E e^(−pQ) = e^(−shift)/√(1 + product): 1 + product of the factors 1 + 2wp, without taking 1 from it.
        let (mut product, mut shift) = (0.0, self.certain * p);
        for (w, d) in &self.terms {
            let q = 2.0 * w * p;
            product += q + product * q;
            shift += 0.5 * d * d * q / (1.0 + q);
        }
        let root = (1.0 + product).sqrt();
        let beyond = if shift > 0.0 { (-shift).exp_m1() } else { 0.0 };
        (product / (1.0 + root) - beyond) / root
    }

    /// ln E e^(−p(Q − c)) for a complex p on the right.
    fn ln_transform_at(&self, p: Complex<f64>) -> Complex<f64> {
        self.sum(|w, d| {
            let q = p * (2.0 * w);
            ((1.0 + q).ln() + q / (1.0 + q) * (d * d)) * -0.5
        })
    }

    /// E e^(−p(Q − c)).
    fn transform(&self, p: Complex<f64>) -> Complex<f64> {
        // Root by root: each factor 1 + 2wp keeps to the plane cut along its negative axis, their product
        // does not.
        let factor = |(w, d): &(f64, f64)| {
            let q = p * (2.0 * w);
            (q / (1.0 + q) * (-0.5 * d * d)).exp() / (1.0 + q).sqrt()
        };
        self.terms.iter().map(factor).product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn mean_and_root_mean_square_of_a_known_sample() {
        // 1, 2, 3, 6: mean 3, sample variance 14/3
        let mean = Estimate::mean_of([1.0, 2.0, 3.0, 6.0].into_iter(), None);
        assert_eq!(mean.value, 3.0);
        assert_abs_diff_eq!(mean.std_error, (14.0_f64 / 12.0).sqrt(), epsilon = 1e-15);
        // squares 1, 4, 9, 36: mean 12.5, sample variance 769/3
        let rms =
            Estimate::mean_of([1.0_f64, -2.0, 3.0, -6.0].into_iter().map(|x| x * x), None).root();
        assert_abs_diff_eq!(rms.value, 12.5_f64.sqrt(), epsilon = 1e-15);
        let expected = (769.0_f64 / 12.0).sqrt() / (2.0 * 12.5_f64.sqrt());
        assert_abs_diff_eq!(rms.std_error, expected, epsilon = 1e-14);
    }

    /// Every value twice: the mean of half as many independent ones, its standard error theirs; one value has none.
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
            quantile_interval(&doubled, 0.5, Some(100.0)),
            quantile_interval(&sorted, 0.5, None)
        );
        let one = [
            Estimate::mean_of(once.into_iter(), Some(1.0)),
            Estimate::mean_of([2.0].into_iter(), None),
        ];
        assert!(one.iter().all(|one| one.std_error.is_nan()));
    }

    /// The interval's bounds for n = 100: for the median the 40th and 61st values (96.5 % together), for
    /// p = 0.95 the 90th and 100th: P(B ≤ 89) = 1.1 %, P(B ≤ 90) = 2.8 %, P(B ≥ 99) = 3.7 %.
    #[test]
    fn quantiles_lie_between_order_statistics() {
        let sorted: Vec<f64> = (1..=100).map(f64::from).collect();
        for (p, value, ci95) in [(0.5, 50.5, (40.0, 61.0)), (0.95, 95.05, (90.0, 100.0))] {
            assert_abs_diff_eq!(sample_quantile(&sorted, p), value, epsilon = 1e-12);
            assert_eq!(
                quantile_interval(&sorted, p, None),
                (Some(ci95.0), Some(ci95.1))
            );
        }
    }

    #[test]
    fn small_samples_have_open_intervals() {
        // P(B ≤ 1) = 0.7 %, P(B ≤ 2) = 14 %, P(B = 3) = 86 %
        assert_eq!(
            quantile_interval(&[1.0, 2.0, 3.0], 0.95, None),
            (Some(2.0), None)
        );
        assert_eq!(quantile_interval(&[1.0, 2.0, 3.0], 0.5, None), (None, None));
        assert!(sample_quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn states_are_named_in_files() {
        let text =
            serde_json::to_string(&PerState(std::array::from_fn::<_, REPORTED, _>(|i| i))).unwrap();
        assert!(text.starts_with(r#"{"pos_n_m":0,"pos_e_m":1,"#), "{text}");
    }
}

#[cfg(test)]
mod consistency_tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Quantiles from tables: χ²(9): 2.7004, 19.0228; χ²(900): 818.756, 985.032.
    #[test]
    fn chi_square_bands_agree_with_tables() {
        for (n, lower, upper) in [(1.0, 2.700_39, 19.022_77), (100.0, 8.187_56, 9.850_32)] {
            let band = chi_square_band(9, n);
            assert_abs_diff_eq!(band.lower, lower, epsilon = 1e-5);
            assert_abs_diff_eq!(band.upper, upper, epsilon = 1e-5);
        }
    }

    #[test]
    fn the_approximation_for_many_degrees_of_freedom_joins_the_exact_quantile() {
        for (p, bound) in [(1e-4, 1e-6), (0.025, 1e-8), (0.975, 1e-8), (0.9999, 1e-6)] {
            let exact = ChiSquared::new(1.01e5).unwrap().inverse_cdf(p);
            let error = (chi_square_quantile(1.01e5, p) / exact - 1.0).abs();
            assert!(error < bound, "{error:e} at {p}");
        }
    }

    /// Binomial(100, 0.95): P(X ≤ 89) = 1.1 %, P(X ≤ 90) = 2.8 %, P(X ≤ 98) = 96.3 %, P(X ≤ 99) = 99.4 %.
    #[test]
    fn coverage_band_agrees_with_binomial_tables() {
        assert_eq!(
            coverage_band(0.95, 100.0),
            Band {
                lower: 0.90,
                upper: 0.99
            }
        );
        assert!(coverage_band(0.95, 0.0).lower.is_nan());
    }
}

#[cfg(test)]
mod quadratic_form_tests {
    use super::*;
    use crate::tests::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

    fn form_of(terms: impl IntoIterator<Item = (f64, f64)>) -> QuadraticForm {
        let terms = terms.into_iter().collect();
        QuadraticForm {
            certain: 0.0,
            terms,
        }
    }

    #[test]
    fn equal_weights_are_chi_square() {
        for dof in [1, 2, 6, 9] {
            let form = form_of((0..dof).map(|_| (2.5, 0.0)));
            let law = ChiSquared::new(f64::from(dof)).unwrap();
            for p in [1e-4, 0.05, 0.5, 0.95, 0.999] {
                let x = law.inverse_cdf(p);
                assert!((form.cdf(2.5 * x) - law.cdf(x)).abs() < 1e-11, "{dof} {p}");
                assert!(
                    (law.cdf(form.quantile(p) / 2.5) - p).abs() < 1e-11,
                    "{dof} {p}"
                );
            }
            // E √χ²(n) = √2 Γ((n + 1)/2)/Γ(n/2)
            let gamma = statrs::function::gamma::gamma;
            let half = f64::from(dof) / 2.0;
            let expected = (2.0_f64 * 2.5).sqrt() * gamma(half + 0.5) / gamma(half);
            assert!((form.mean_root() / expected - 1.0).abs() < 1e-8, "{dof}");
        }
    }

    /// Two pairs of weights a and b: P(Q > x) = (a e^{−x/2a} − b e^{−x/2b})/(a − b).
    #[test]
    fn two_pairs_have_their_closed_form() {
        let (a, b) = (3.0, 0.2);
        let form = form_of([(a, 0.0), (b, 0.0), (a, 0.0), (b, 0.0)]);
        for x in [1e-3, 0.1, 1.0, 10.0, 60.0] {
            let beyond = |w: f64| w * (-0.5 * x / w).exp();
            let expected = 1.0 - (beyond(a) - beyond(b)) / (a - b);
            assert_abs_diff_eq!(form.cdf(x), expected, epsilon = 1e-12);
        }
    }

    /// w (z + d)² ≤ w x is |z + d| ≤ √x.
    #[test]
    fn a_shift_is_that_of_a_normal_variable() {
        let normal = Normal::new(0.0, 1.0).unwrap();
        for d in [0.3, 2.0, 7.9, 8.1, 50.0, -50.0, 1e4] {
            for x in [
                0.5,
                4.0,
                80.0,
                0.9 * d * d,
                d * d + 1.0,
                (d + 1.0) * (d + 1.0),
            ] {
                let root = f64::sqrt(x);
                let expected = normal.cdf(root - d) - normal.cdf(-root - d);
                for w in [1.0, 1e-3] {
                    let found = form_of([(w, d)]).cdf(w * x);
                    assert!(
                        (found - expected).abs() < 1e-10,
                        "{w} {d} {x}: {found} {expected}"
                    );
                }
            }
        }
    }

    /// 10⁶ draws of six weights of three orders of magnitude, two of them shifted: shares within five binomial
    /// standard deviations, and the mean root within five standard errors.
    #[test]
    fn draws_lie_where_they_are_computed() {
        let terms = [
            (1.0, 0.5),
            (0.3, 0.0),
            (0.05, -2.0),
            (0.01, 0.0),
            (2.0, 0.0),
            (0.004, 0.0),
        ];
        let form = form_of(terms);
        let mut normal = normals(3);
        let mut draw = || terms.iter().map(|(w, d)| w * (normal() + d).powi(2)).sum();
        let n = 1_000_000;
        let draws: Vec<f64> = (0..n).map(|_| draw()).collect();
        for p in [0.01, 0.1, 0.5, 0.9, 0.95, 0.999] {
            let x = form.quantile(p);
            let share = draws.iter().filter(|q| **q <= x).count() as f64 / f64::from(n);
            assert_abs_diff_eq!(
                share,
                p,
                epsilon = 5.0 * (p * (1.0 - p) / f64::from(n)).sqrt()
            );
        }
        let root = draws.iter().map(|q| q.sqrt()).sum::<f64>() / f64::from(n);
        let error = ((form.mean() - root * root) / f64::from(n)).sqrt();
        assert_abs_diff_eq!(root, form.mean_root(), epsilon = 5.0 * error);
    }

    #[test]
    fn what_is_certain_has_no_spread() {
        let none = form_of([]);
        assert_eq!(
            (none.cdf(1.0), none.quantile(0.5), none.mean_root()),
            (1.0, 0.0, 0.0)
        );
        let p = DMatrix::identity(2, 2);
        let sure = QuadraticForm::of_normalised(&p, &DMatrix::zeros(2, 2), &[3.0, 4.0]).unwrap();
        assert_eq!(
            (sure.cdf(24.9), sure.cdf(25.1), sure.quantile(0.5)),
            (0.0, 1.0, 25.0)
        );
        assert_relative_eq!(sure.mean_root(), 5.0, max_relative = 1e-8);
        // z² beside a certain 4: χ² of one degree of freedom from there on
        let mut half = DMatrix::zeros(2, 2);
        half[(0, 0)] = 1.0;
        let form = QuadraticForm::of_square(&half, &[0.0, 2.0]);
        let law = ChiSquared::new(1.0).unwrap();
        assert!(form.cdf(3.9) == 0.0 && (form.cdf(5.0) - law.cdf(1.0)).abs() < 1e-10);
    }
}
