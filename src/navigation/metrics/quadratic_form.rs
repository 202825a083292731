//! The law of the square of a normal error: a weighted sum of chi-square variables.

use nalgebra::DMatrix;
use std::f64::consts::PI;

/// Nodes of the contour, of which half are the others' conjugates: the error is below 1e-12.
const NODES: u32 = 32;
/// Steps of the mean's integral, and their length: the integrand falls as e^(−|y|) on both sides.
const MEAN_STEPS: i32 = 72;
const MEAN_STEP: f64 = 0.5;

/// Q = Σ w (z + d)², z independent standard normal variables.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticForm {
    /// Weights w > 0 and shifts d.
    terms: Vec<(f64, f64)>,
}

impl QuadraticForm {
    /// From weights and shifts; weights that are not above zero (beside the largest: rounding) are left out.
    #[must_use]
    pub fn new(terms: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let terms: Vec<(f64, f64)> = terms.into_iter().collect();
        let largest = terms.iter().map(|t| t.0).fold(0.0, f64::max);
        Self { terms: terms.into_iter().filter(|(w, _)| *w > 1e-14 * largest).collect() }
    }

    /// eᵀ e for an error e of this covariance and mean.
    #[must_use]
    pub fn of_square(covariance: &DMatrix<f64>, mean: &[f64]) -> Self {
        let eigen = covariance.clone().symmetric_eigen();
        let terms = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).map(|(w, axis)| {
            let along: f64 = axis.iter().zip(mean).map(|(a, m)| a * m).sum();
            // a mean where there is no variance: a narrow normal variable has the same square
            let w = w.max(1e-12 * along * along);
            (w, if w > 0.0 { along / w.sqrt() } else { 0.0 })
        });
        Self::new(terms)
    }

    /// eᵀ P⁻¹ e for an error e of this covariance and mean; none where `p` is not positive definite.
    #[must_use]
    pub fn of_normalised(p: &DMatrix<f64>, covariance: &DMatrix<f64>, mean: &[f64]) -> Option<Self> {
        let factor = p.clone().cholesky()?.l();
        let whiten = |m: &DMatrix<f64>| factor.solve_lower_triangular(m);
        let half = whiten(covariance)?;
        let whole = whiten(&half.transpose())?;
        let mean = whiten(&DMatrix::from_column_slice(mean.len(), 1, mean))?;
        Some(Self::of_square(&whole, mean.as_slice()))
    }

    /// Its expectation.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.terms.iter().map(|(w, d)| w * (1.0 + d * d)).sum()
    }

    /// P(Q ≤ x): the inversion of [Imhof](crate::bibliography::Imhof61) on a parabola around the singularities,
    /// all of them on the negative axis, where the integrand falls off and no longer oscillates
    /// ([Weideman and Trefethen](crate::bibliography::WeidemanTrefethen07), sec. 2).
    #[must_use]
    pub fn cdf(&self, x: f64) -> f64 {
        if x <= 0.0 || self.terms.is_empty() {
            return f64::from(u8::from(x >= 0.0 && self.terms.is_empty()));
        }
        let n = f64::from(NODES);
        let sum: f64 = (0..NODES / 2)
            .map(|k| {
                let theta = (2.0 * f64::from(k) + 1.0) * PI / n;
                let p = Complex(0.1309 - 0.1194 * theta * theta, 0.25 * theta).scaled(n);
                let slope = Complex(-0.2388 * theta, 0.25).scaled(n);
                // ∫ e^{p} φ(p/x)/p dp/(2πi), twice the imaginary part of half the contour
                let value = p.exp().times(self.transform(p.scaled(1.0 / x))).times(slope).over(p);
                value.1
            })
            .sum();
        (2.0 * sum / n).clamp(0.0, 1.0)
    }

    /// The x with P(Q ≤ x) = `probability`, to 1e-12 of itself.
    #[must_use]
    pub fn quantile(&self, probability: f64) -> f64 {
        let mean = self.mean();
        if mean.is_nan() || self.terms.is_empty() {
            return if mean.is_nan() { f64::NAN } else { 0.0 };
        }
        let (mut low, mut high) = (0.0, mean);
        while self.cdf(high) < probability && high < 1e6 * mean {
            (low, high) = (high, 2.0 * high);
        }
        while high - low > 1e-12 * high {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.cdf(middle) < probability { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// E √Q = π^(−1/2) ∫ (1 − φ(u²)) du/u², with u = e^y by the trapezoidal rule, whose error is e^(−2π²) here.
    #[must_use]
    pub fn mean_root(&self) -> f64 {
        let scale = self.mean();
        if scale.is_nan() || scale <= 0.0 {
            return scale;
        }
        let node = |k: i32| {
            let y = f64::from(k) * MEAN_STEP;
            // 1 − φ by its logarithm: where φ is nearly 1 the difference keeps its digits
            -self.ln_transform((2.0 * y).exp() / scale).exp_m1() * (-y).exp()
        };
        scale.sqrt() * MEAN_STEP * (-MEAN_STEPS..=MEAN_STEPS).map(node).sum::<f64>() / PI.sqrt()
    }

    /// ln E e^(−pQ) for p ≥ 0.
    fn ln_transform(&self, p: f64) -> f64 {
        let term = |(w, d): &(f64, f64)| {
            let q = 2.0 * w * p;
            -0.5 * (q.ln_1p() + d * d * q / (1.0 + q))
        };
        self.terms.iter().map(term).sum()
    }

    /// E e^(−pQ).
    fn transform(&self, p: Complex) -> Complex {
        let mut product = Complex(1.0, 0.0);
        let mut exponent = Complex(0.0, 0.0);
        for (w, d) in &self.terms {
            let q = p.scaled(2.0 * w);
            let base = Complex(1.0 + q.0, q.1);
            product = product.over(base.root());
            let shift = q.over(base).scaled(-0.5 * d * d);
            exponent = Complex(exponent.0 + shift.0, exponent.1 + shift.1);
        }
        product.times(exponent.exp())
    }
}

/// A complex number, as far as it is needed here.
#[derive(Debug, Clone, Copy)]
struct Complex(f64, f64);

impl Complex {
    const fn scaled(self, s: f64) -> Self {
        Self(self.0 * s, self.1 * s)
    }

    const fn times(self, other: Self) -> Self {
        Self(self.0 * other.0 - self.1 * other.1, self.0 * other.1 + self.1 * other.0)
    }

    const fn over(self, other: Self) -> Self {
        let square = other.0 * other.0 + other.1 * other.1;
        self.times(Self(other.0, -other.1)).scaled(1.0 / square)
    }

    fn exp(self) -> Self {
        let (sin, cos) = self.1.sin_cos();
        Self(cos, sin).scaled(self.0.exp())
    }

    /// The root on the right, where no path of the contour leaves it.
    fn root(self) -> Self {
        let size = self.0.hypot(self.1);
        let re = (0.5 * (size + self.0)).max(0.0).sqrt();
        let im = (0.5 * (size - self.0)).max(0.0).sqrt();
        Self(re, im.copysign(self.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::StreamKey;
    use rand_distr::{Distribution, StandardNormal};
    use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

    #[test]
    fn equal_weights_are_chi_square() {
        for dof in [1, 2, 6, 9] {
            let form = QuadraticForm::new((0..dof).map(|_| (2.5, 0.0)));
            let law = ChiSquared::new(f64::from(dof)).unwrap();
            for p in [1e-4, 0.05, 0.5, 0.95, 0.999] {
                let x = law.inverse_cdf(p);
                assert!((form.cdf(2.5 * x) - law.cdf(x)).abs() < 1e-11, "{dof} {p}");
                assert!((form.quantile(p) / (2.5 * x) - 1.0).abs() < 1e-8, "{dof} {p}");
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
        let form = QuadraticForm::new([(a, 0.0), (b, 0.0), (a, 0.0), (b, 0.0)]);
        for x in [1e-3, 0.1, 1.0, 10.0, 60.0] {
            let beyond = |w: f64| w * (-0.5 * x / w).exp();
            let expected = 1.0 - (beyond(a) - beyond(b)) / (a - b);
            assert!((form.cdf(x) - expected).abs() < 1e-12, "{x}: {} {expected}", form.cdf(x));
        }
    }

    /// (z + d)² ≤ x is |z + d| ≤ √x.
    #[test]
    fn a_shift_is_that_of_a_normal_variable() {
        let normal = Normal::new(0.0, 1.0).unwrap();
        for d in [0.3, 2.0, 8.0] {
            for x in [0.5, 4.0, 80.0] {
                let root = f64::sqrt(x);
                let expected = normal.cdf(root - d) - normal.cdf(-root - d);
                let form = QuadraticForm::new([(1.0, d)]);
                assert!((form.cdf(x) - expected).abs() < 1e-10, "{d} {x}: {} {expected}", form.cdf(x));
            }
        }
    }

    /// 10⁶ draws of six weights of three orders of magnitude, two of them shifted: shares within five binomial
    /// standard deviations, and the mean root within five standard errors.
    #[test]
    fn draws_lie_where_they_are_computed() {
        let terms = [(1.0, 0.5), (0.3, 0.0), (0.05, -2.0), (0.01, 0.0), (2.0, 0.0), (0.004, 0.0)];
        let form = QuadraticForm::new(terms);
        let mut rng = StreamKey { seed: 3, scenario: "", run: 0, source: "form", process: "t" }.generator();
        let mut draw = || -> f64 {
            terms
                .iter()
                .map(|(w, d)| {
                    w * {
                        let z: f64 = StandardNormal.sample(&mut rng);
                        z + d
                    }
                    .powi(2)
                })
                .sum()
        };
        let n = 1_000_000;
        let draws: Vec<f64> = (0..n).map(|_| draw()).collect();
        for p in [0.01, 0.1, 0.5, 0.9, 0.95, 0.999] {
            let x = form.quantile(p);
            let share = draws.iter().filter(|q| **q <= x).count() as f64 / f64::from(n);
            assert!((share - p).abs() < 5.0 * (p * (1.0 - p) / f64::from(n)).sqrt(), "{p}: {share}");
        }
        let root = draws.iter().map(|q| q.sqrt()).sum::<f64>() / f64::from(n);
        let error = ((form.mean() - root * root) / f64::from(n)).sqrt();
        assert!((root - form.mean_root()).abs() < 5.0 * error, "{root} {}", form.mean_root());
    }

    #[test]
    fn what_is_certain_has_no_spread() {
        let none = QuadraticForm::new([]);
        assert_eq!((none.cdf(1.0), none.quantile(0.5), none.mean_root()), (1.0, 0.0, 0.0));
        let p = DMatrix::identity(2, 2);
        let sure = QuadraticForm::of_normalised(&p, &DMatrix::zeros(2, 2), &[3.0, 4.0]).unwrap();
        assert!(
            sure.cdf(24.9) < 1e-9 && sure.cdf(25.1) > 1.0 - 1e-9 && (sure.mean_root() - 5.0).abs() < 1e-6
        );
    }
}
