//! Shape of the law of one wavelet variance: a mean of squares of correlated Gaussian coefficients.
//!
//! With many lengths of the scale in the record it is as good as a chi-square. With few it is not: nu is Σ λ_i z_i² with
//! weights of very different size, and its lower tail, the product of all of them, is far lighter than that of the one
//! chi-square of as many degrees of freedom (white noise and random walk, two lengths: 2.4 degrees, the variance of ln nu is
//! 0.86 and that of the chi-square's logarithm 1.24). The weights go as the spectrum of the coefficients (Whittle), each with
//! a chi-square of a common number of degrees, which is chosen so that nu has its degrees of freedom 2 nu²/var; the
//! quantiles follow by the saddlepoint ([Daniels](crate::bibliography::Daniels87), r*).

use statrs::function::erf::erfc;
use statrs::function::gamma::ln_gamma;
use std::f64::consts::FRAC_1_SQRT_2;

/// Degrees of freedom from which on a chi-square serves: ln nu has a variance of 0.0335 or 0.034 then. More lengths of the scale
/// than eight make 16 and more.
const MANY: f64 = 60.0;

/// Law of nu over its mean; the default is the chi-square's.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shape {
    /// Points of the law of one degree of freedom a weight, rising; none: a chi-square.
    points: Vec<Point>,
    /// Degrees of freedom of that law.
    degrees: f64,
}

/// A value and what its normal score consists of: the score is w·√k + c/√k, with k degrees of freedom a weight.
#[derive(Debug, Clone, Copy)]
struct Point {
    ln: f64,
    w: f64,
    c: f64,
}

impl Shape {
    /// The shape of a mean of squares with these weights, of any scale; the chi-square's where there is none.
    pub(crate) fn new(weights: &[f64]) -> Self {
        let sum: f64 = weights.iter().sum();
        if sum.is_nan() || sum <= 0.0 {
            return Self::default();
        }
        let weights: Vec<f64> = weights.iter().map(|w| w / sum).collect();
        let most = weights.iter().copied().fold(0.0, f64::max);
        // The cumulant function ends at ½/most; far below 0 is the lower tail.
        let below = (0..140).map(|i| -(10.0_f64.powf(5.0 - 0.05 * f64::from(i))));
        let above = (0..80).map(|i| 1.0 - 10.0_f64.powf(-0.03 * f64::from(i) - 0.005));
        let point = |share: f64| {
            let s = 0.5 * share / most;
            let (mut k, mut k1, mut k2) = (0.0, 0.0, 0.0);
            for w in &weights {
                let d = 1.0 - 2.0 * s * w;
                k -= 0.5 * d.ln();
                k1 += w / d;
                k2 += 2.0 * (w / d).powi(2);
            }
            let w = (2.0 * (s * k1 - k)).max(0.0).sqrt().copysign(s);
            Point {
                ln: k1.ln(),
                w,
                c: (s * k2.sqrt() / w).ln() / w,
            }
        };
        let points = below.chain(above).map(point).collect();
        Self {
            points,
            degrees: 1.0 / weights.iter().map(|w| w * w).sum::<f64>(),
        }
    }

    /// nu over its mean whose normal score is z.
    pub(crate) fn ratio(&self, z: f64, edof: f64) -> f64 {
        if self.is_chi_square(edof) {
            chi_square_ratio(z, edof)
        } else {
            self.ln(z, edof).exp()
        }
    }

    /// Variance of ln nu.
    pub(crate) fn variance_of_log(&self, edof: f64) -> f64 {
        if self.is_chi_square(edof) {
            return variance_of_log(edof);
        }
        // Over ±5 deviations of the score, in steps beside which the logarithm is smooth.
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        for i in -20..=20 {
            let z = 0.25 * f64::from(i);
            let (weight, ln) = ((-0.5 * z * z).exp(), self.ln(z, edof));
            sum += weight;
            first += weight * ln;
            second += weight * ln * ln;
        }
        second / sum - (first / sum).powi(2)
    }

    /// The degrees of freedom with which ln nu has this variance.
    pub(crate) fn edof_of_log(&self, variance: f64) -> f64 {
        // The positive root of variance·x² − x − ½ = 0, doubled: psi1(x) ≈ 1/x + 1/2x² at x = eta/2.
        let chi_square = (1.0 + (1.0 + 2.0 * variance).sqrt()) / variance;
        if self.is_chi_square(chi_square) {
            return chi_square;
        }
        // A chi-square's logarithm has the larger variance of the two, and 1/x of this one at the least a half.
        let (mut low, mut high) = (0.25 * chi_square, 2.0 * chi_square);
        // Halved to 1e-6, the interpolation being coarser.
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if self.variance_of_log(middle) > variance {
                low = middle
            } else {
                high = middle
            }
        }
        0.5 * (low + high)
    }

    fn is_chi_square(&self, edof: f64) -> bool {
        self.points.is_empty() || edof > MANY
    }

    /// ln of nu over its mean, between the points; beyond the last of them as there.
    fn ln(&self, z: f64, edof: f64) -> f64 {
        let root = (edof / self.degrees).sqrt();
        let score = |p: &Point| p.w * root + p.c / root;
        let above = self
            .points
            .partition_point(|p| score(p) < z)
            .clamp(1, self.points.len() - 1);
        let (a, b) = (&self.points[above - 1], &self.points[above]);
        let (from, to) = (score(a), score(b));
        a.ln + (z - from) / (to - from) * (b.ln - a.ln)
    }
}

/// A chi-square variable over its degrees of freedom whose normal score is z: Wilson and Hilferty's cube, and where
/// that ends, far below, the series P(x) = (x/2)^(nu/2) e^(−x/2)/Γ(nu/2 + 1)·(1 + x/(nu + 2) + …)
/// ([Best and Roberts](crate::bibliography::BestRoberts75)).
fn chi_square_ratio(z: f64, edof: f64) -> f64 {
    // No score is so far below that the series is needed for more.
    const MOST: f64 = 30.0;
    if edof < MOST && z < 1.0 {
        let probability = 0.5 * erfc(-z * FRAC_1_SQRT_2);
        // The condition of Best and Roberts for their series: there the cube is too far off, or negative.
        if edof < -1.24 * probability.ln() {
            let half = 0.5 * edof;
            let known = probability.ln() + ln_gamma(half + 1.0);
            let x = 2.0 * (known / half).exp();
            // P(x) with two terms more, solved once again for its power of x.
            let more = (1.0 + x / (edof + 2.0) * (1.0 + x / (edof + 4.0))).ln();
            return ((known + 0.5 * x - more) / half).exp() / half;
        }
    }
    // (chi²/eta)^(1/3) is nearly normal with mean 1 − 2/(9 eta) and variance 2/(9 eta).
    let variance = 2.0 / (9.0 * edof);
    (1.0 - variance + z * variance.sqrt()).powi(3)
}

/// Variance of ln(chi²/eta): the trigamma function at eta/2, by its asymptotic series.
pub(crate) fn variance_of_log(edof: f64) -> f64 {
    // psi1(x) = 1/x² + psi1(x + 1), then the series, whose error is under 1e-6 from x = 4.
    let (mut x, mut sum) = (0.5 * edof, 0.0);
    while x < 4.0 {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    sum + 1.0 / x + 0.5 * y + y / x * (1.0 / 6.0 - y * (1.0 / 30.0 - y / 42.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// psi1(½) = π²/2, psi1(1) = π²/6, psi1(2) = π²/6 − 1.
    #[test]
    fn variance_of_the_logarithm() {
        let pi2 = std::f64::consts::PI.powi(2);
        assert_relative_eq!(variance_of_log(1.0), pi2 / 2.0, max_relative = 1e-6);
        assert_relative_eq!(variance_of_log(2.0), pi2 / 6.0, max_relative = 1e-6);
        assert_relative_eq!(variance_of_log(4.0), pi2 / 6.0 - 1.0, max_relative = 1e-5);
    }

    /// Quantiles of the chi-square law at three deviations below to three above: a draw is to be off by far less than it
    /// scatters, √(2/nu). Furthest where the two formulas meet.
    #[test]
    fn scores_become_chi_square() {
        use statrs::distribution::{ChiSquared, ContinuousCDF};
        for (edof, error) in [
            (0.7, 0.05),
            (1.0, 0.04),
            (2.0, 0.03),
            (5.0, 0.06),
            (29.0, 0.01),
            (1e4, 1e-4),
        ] {
            let law = ChiSquared::new(edof).unwrap();
            for i in -30..=30 {
                let z = 0.1 * f64::from(i);
                let exact = law.inverse_cdf(0.5 * erfc(-z * FRAC_1_SQRT_2)) / edof;
                let found = chi_square_ratio(z, edof);
                assert!(
                    (found / exact).ln().abs() < error,
                    "{edof} {z}: {found} {exact}"
                );
            }
        }
    }
}
