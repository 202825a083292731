//! The law of the square of a normal error: a weighted sum of chi-square variables.

use nalgebra::DMatrix;
use std::f64::consts::PI;

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
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticForm {
    /// The part without scatter, c ≥ 0.
    certain: f64,
    /// Weights w > 0 and shifts d.
    terms: Vec<(f64, f64)>,
}

/// Weights below this share of the largest are rounding: what they carry is certain.
const ROUNDING: f64 = 1e-14;

impl QuadraticForm {
    /// From weights and shifts; weights that are not above zero (beside the largest: rounding) are left out.
    #[must_use]
    pub fn new(terms: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let terms: Vec<(f64, f64)> = terms.into_iter().collect();
        let largest = terms.iter().map(|t| t.0).fold(0.0, f64::max);
        let terms = terms
            .into_iter()
            .filter(|(w, _)| *w > ROUNDING * largest)
            .collect();
        Self {
            certain: 0.0,
            terms,
        }
    }

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
    pub(crate) fn mean(&self) -> f64 {
        self.certain
            + self
                .terms
                .iter()
                .map(|(w, d)| w * (1.0 + d * d))
                .sum::<f64>()
    }

    /// P(Q ≤ x): the inversion of [Imhof](crate::bibliography::Imhof61).
    pub(crate) fn cdf(&self, x: f64) -> f64 {
        let x = x - self.certain;
        if x <= 0.0 || self.terms.is_empty() {
            return f64::from(u8::from(x >= 0.0 && self.terms.is_empty()));
        }
        let far = self.terms.iter().map(|(_, d)| d * d).sum::<f64>() > FAR;
        let probability = if far {
            self.along_line(x)
        } else {
            self.along_parabola(x)
        };
        probability.clamp(0.0, 1.0)
    }

    /// ∫ e^{px} φ(p)/p dp/(2πi) on a parabola around the singularities, all of them on the negative axis, where the
    /// integrand falls off and no longer oscillates ([Weideman and
    /// Trefethen](crate::bibliography::WeidemanTrefethen07), sec. 2).
    fn along_parabola(&self, x: f64) -> f64 {
        let n = f64::from(NODES);
        let node = |k: u32| {
            // Midpoints: the rule is symmetric about the real axis and no node lies on it. The constants of
            // the parabola below are the optimal ones for the plain transform; scaled by the number of nodes
            // it follows x through p/x.
            let theta = (2.0 * f64::from(k) + 1.0) * PI / n;
            let p = Complex(0.1309 - 0.1194 * theta * theta, 0.25 * theta).scaled(n);
            let slope = Complex(-0.2388 * theta, 0.25).scaled(n);
            // twice the imaginary part of half the contour
            p.exp()
                .times(self.transform(p.scaled(1.0 / x)))
                .times(slope)
                .over(p)
                .1
        };
        2.0 / n * (0..NODES / 2).map(node).sum::<f64>()
    }

    /// The same on the vertical line through the saddle point, where the shifts make the integrand fall as a normal
    /// density: by the trapezoidal rule, until nothing is added.
    fn along_line(&self, x: f64) -> f64 {
        let (saddle, width) = self.saddle(x);
        // On a line through the saddle the integrand is like exp(−y²/2) in widths: the trapezoidal rule
        // converges geometrically, and a quarter of a width is exact to rounding.
        let step = LINE_STEP * width;
        let value = |k: u32| {
            let p = Complex(saddle, f64::from(k) * step);
            // the transform by its logarithm: beside e^{px} it would be 0
            let ln = self.ln_transform_at(p);
            Complex(ln.0 + p.0 * x, ln.1 + p.1 * x).exp().over(p).0
        };
        let first = value(0);
        let mut sum = 0.5 * first;
        for k in 1..LINE_STEPS {
            let next = value(k);
            sum += next;
            // The second condition: the integrand oscillates and may pass through zero before it has fallen.
            if next.abs() < 1e-17 * first && f64::from(k) * LINE_STEP > 8.0 {
                break;
            }
        }
        sum * step / PI
    }

    /// The least of e^{px} φ(p)/p for p > 0, and the width of the integrand across it. The logarithm is convex there.
    fn saddle(&self, x: f64) -> (f64, f64) {
        let slope = |p: f64| {
            let term = |(w, d): &(f64, f64)| {
                let base = 1.0 + 2.0 * w * p;
                w / base + w * d * d / (base * base)
            };
            x - self.terms.iter().map(term).sum::<f64>() - 1.0 / p
        };
        // At p = 1/x the slope is −Σ … < 0: the least lies above.
        let (mut low, mut high) = (0.0, 1.0 / x);
        while slope(high) < 0.0 {
            (low, high) = (high, 2.0 * high);
        }
        // Bisection of a monotone slope; the place of the line need not be exact, only its neighbourhood.
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if slope(middle) < 0.0 {
                low = middle
            } else {
                high = middle
            }
        }
        let p = 0.5 * (low + high);
        let term = |(w, d): &(f64, f64)| {
            let base = 1.0 + 2.0 * w * p;
            2.0 * w * w / (base * base) + 4.0 * w * w * d * d / (base * base * base)
        };
        (
            p,
            (1.0 / (p * p) + self.terms.iter().map(term).sum::<f64>())
                .sqrt()
                .recip(),
        )
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
        // Bisection, since near 0 and 1 the distribution function has only its rounding to give to a secant.
        while high - low > 1e-12 * high {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.cdf(middle) < probability {
                low = middle
            } else {
                high = middle
            }
        }
        0.5 * (low + high)
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
        self.terms.iter().map(term).sum::<f64>() - self.certain * p
    }

    /// ln E e^(−p(Q − c)) for a complex p on the right.
    fn ln_transform_at(&self, p: Complex) -> Complex {
        let mut sum = Complex(0.0, 0.0);
        for (w, d) in &self.terms {
            let q = p.scaled(2.0 * w);
            let base = Complex(1.0 + q.0, q.1);
            let shift = q.over(base).scaled(d * d);
            sum.0 -= 0.5 * (base.0.hypot(base.1).ln() + shift.0);
            sum.1 -= 0.5 * (base.1.atan2(base.0) + shift.1);
        }
        sum
    }

    /// E e^(−p(Q − c)).
    fn transform(&self, p: Complex) -> Complex {
        let mut product = Complex(1.0, 0.0);
        let mut exponent = Complex(0.0, 0.0);
        for (w, d) in &self.terms {
            let q = p.scaled(2.0 * w);
            let base = Complex(1.0 + q.0, q.1);
            // Root by root: each factor 1 + 2wp keeps to the plane cut along its negative axis, their product
            // does not.
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
        Self(
            self.0 * other.0 - self.1 * other.1,
            self.0 * other.1 + self.1 * other.0,
        )
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
        let form = QuadraticForm::new([(a, 0.0), (b, 0.0), (a, 0.0), (b, 0.0)]);
        for x in [1e-3, 0.1, 1.0, 10.0, 60.0] {
            let beyond = |w: f64| w * (-0.5 * x / w).exp();
            let expected = 1.0 - (beyond(a) - beyond(b)) / (a - b);
            assert!(
                (form.cdf(x) - expected).abs() < 1e-12,
                "{x}: {} {expected}",
                form.cdf(x)
            );
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
                    let found = QuadraticForm::new([(w, d)]).cdf(w * x);
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
        let form = QuadraticForm::new(terms);
        let mut rng = StreamKey {
            seed: 3,
            scenario: "",
            run: 0,
            source: "form",
            process: "t",
        }
        .generator();
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
            assert!(
                (share - p).abs() < 5.0 * (p * (1.0 - p) / f64::from(n)).sqrt(),
                "{p}: {share}"
            );
        }
        let root = draws.iter().map(|q| q.sqrt()).sum::<f64>() / f64::from(n);
        let error = ((form.mean() - root * root) / f64::from(n)).sqrt();
        assert!(
            (root - form.mean_root()).abs() < 5.0 * error,
            "{root} {}",
            form.mean_root()
        );
    }

    #[test]
    fn what_is_certain_has_no_spread() {
        let none = QuadraticForm::new([]);
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
        assert!(
            (sure.mean_root() / 5.0 - 1.0).abs() < 1e-8,
            "{}",
            sure.mean_root()
        );
        // z² beside a certain 4: χ² of one degree of freedom from there on
        let mut half = DMatrix::zeros(2, 2);
        half[(0, 0)] = 1.0;
        let form = QuadraticForm::of_square(&half, &[0.0, 2.0]);
        let law = ChiSquared::new(1.0).unwrap();
        assert!(form.cdf(3.9) == 0.0 && (form.cdf(5.0) - law.cdf(1.0)).abs() < 1e-10);
    }
}
