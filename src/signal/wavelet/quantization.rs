//! Response of the robust wavelet variance to quantization noise.
//!
//! The Haar coefficients of quantization noise are (U_t − 2 U_{t−m} + U_{t−2m})·√(12 Q²)/(2m) at every scale, U uniform:
//! their law has no tails, and the M-estimate that is consistent for Gaussian coefficients reads it high. Of a sum of
//! quantization noise and Gaussian noise, whose `share` of the variance is quantization noise, it reads b(share) times the
//! variance: at efficiency 0.6, 1.009 at a share of ¼, 1.037 at ½, 1.085 at ¾, 1.154 at 1.
//!
//! b and the efficiency are integrals over the law of √(1 − share)·Z + √share·Y, Z standard normal, Y the second difference
//! of uniform numbers at unit variance. Both depart from the Gaussian values with the square of the share (through the
//! fourth cumulant), so what is tabulated is that departure over share².

use std::f64::consts::{PI, SQRT_2};

/// Chebyshev nodes of the share: the departures over share² are smooth, and known to 1e-8 with these.
const NODES: usize = 10;

/// The robust wavelet variance of quantization noise among Gaussian noise, for one tuning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuantizationResponse {
    /// Chebyshev coefficients of (b − 1)/share².
    factor: [f64; NODES],
    /// Chebyshev coefficients of (efficiency/Gaussian efficiency − 1)/share².
    efficiency: [f64; NODES],
}

impl QuantizationResponse {
    /// For a rejection point and the consistency constant that belongs to it.
    pub(super) fn new(c: f64, a: f64) -> Self {
        let law = Law::new();
        let gaussian = law.solve(0.0, c, a).1;
        let mut response = Self {
            factor: [0.0; NODES],
            efficiency: [0.0; NODES],
        };
        for node in 0..NODES {
            let angle = PI * (node as f64 + 0.5) / NODES as f64;
            // Chebyshev's nodes leave out share = 0, where the quotient by share² would be 0/0.
            let share = 0.5 * (1.0 + angle.cos());
            let (factor, efficiency) = law.solve(share, c, a);
            for k in 0..NODES {
                let weight =
                    if k == 0 { 1.0 } else { 2.0 } * (k as f64 * angle).cos() / NODES as f64;
                response.factor[k] += weight * (factor - 1.0) / (share * share);
                response.efficiency[k] += weight * (efficiency / gaussian - 1.0) / (share * share);
            }
        }
        response
    }

    /// b, the robust wavelet variance over the variance, and db/dshare, where `share` (0 to 1) of the variance is
    /// quantization noise.
    #[must_use]
    pub fn factor(&self, share: f64) -> (f64, f64) {
        departure(&self.factor, share)
    }

    /// Degrees of freedom of the robust wavelet variance over those it has of Gaussian coefficients as correlated as these.
    #[must_use]
    pub fn degrees(&self, share: f64) -> f64 {
        departure(&self.efficiency, share).0
    }
}

/// 1 + share²·p(share) and its derivative, p a Chebyshev series on 0 … 1.
fn departure(series: &[f64; NODES], share: f64) -> (f64, f64) {
    let x = 2.0 * share - 1.0;
    // T_k and its derivative, by their recurrences.
    let (mut t, mut dt, mut before, mut d_before) = (1.0, 0.0, x, 1.0);
    let (mut p, mut dp) = (0.0, 0.0);
    for coefficient in series {
        p += coefficient * t;
        dp += coefficient * dt;
        let (next, d_next) = (2.0 * x * t - before, 2.0 * t + 2.0 * x * dt - d_before);
        (before, d_before, t, dt) = (t, dt, next, d_next);
    }
    (
        1.0 + share * share * p,
        2.0 * share * p + 2.0 * share * share * dp,
    )
}

/// Law of √(1 − share)·Z + √share·Y: nodes and weights of the quadratures over Z and Y.
struct Law {
    normal: Vec<(f64, f64)>,
    second_difference: Vec<(f64, f64)>,
}

impl Law {
    fn new() -> Self {
        // The trapezoidal rule is exact to rounding for a Gaussian weight; chi's fourth derivative jumps where that is 1e-5.
        let normal = (-64..=64).map(|i| {
            let z = 0.125 * f64::from(i);
            (z, 0.125 * (-0.5 * z * z).exp() / (2.0 * PI).sqrt())
        });
        Self {
            normal: normal.collect(),
            second_difference: second_difference(),
        }
    }

    /// E chi(W/√b), E dchi/dln b and E chi² over the law of W.
    fn means(&self, share: f64, c: f64, b: f64) -> (f64, f64, f64) {
        let (gaussian, uniform) = (((1.0 - share) / b).sqrt(), (share / b).sqrt());
        let mut sums = (0.0, 0.0, 0.0);
        for (y, wy) in &self.second_difference {
            for (z, wz) in &self.normal {
                let r = gaussian * z + uniform * y;
                let q = (r / c).powi(2);
                // chi and its derivatives vanish beyond the rejection point.
                if q >= 1.0 {
                    continue;
                }
                let cube = r * r * (1.0 - q).powi(3);
                let chi = cube * (1.0 - q);
                let weight = wy * wz;
                sums.0 += weight * chi;
                // dchi/dln b = −r² (1 − q)³ (1 − 5q), since r² and q fall as 1/b.
                sums.1 -= weight * cube * (1.0 - 5.0 * q);
                sums.2 += weight * chi * chi;
            }
        }
        sums
    }

    /// b by Newton's iteration on ln b, and the efficiency 2 (E dchi/dln b)²/var chi.
    fn solve(&self, share: f64, c: f64, a: f64) -> (f64, f64) {
        let mut log_b = 0.0_f64;
        for _ in 0..20 {
            let (chi, slope, _) = self.means(share, c, log_b.exp());
            // The same constant a as for Gaussian coefficients: that it does not fit here is what b measures.
            let step = (a - chi) / slope;
            log_b += step;
            if step.abs() < 1e-14 {
                break;
            }
        }
        let (chi, slope, squares) = self.means(share, c, log_b.exp());
        // An M-estimate has var ln b = var chi/(n (E dchi/dln b)²); the mean square of n Gaussian numbers has
        // 2/n.
        (log_b.exp(), 2.0 * slope * slope / (squares - chi * chi))
    }
}

/// Y = √2 (U₁ − 2U₂ + U₃) from 0 upwards (the law is symmetric, and so is that of Z): the density of U₁ − 2U₂ + U₃ is
/// ½(1 − v²/2) up to 1 and (2 − v)²/4 up to 2, by Simpson's rule on both pieces.
fn second_difference() -> Vec<(f64, f64)> {
    const INTERVALS: usize = 64;
    let mut nodes = Vec::new();
    // The second derivative of the density jumps at v = 1: one rule over both pieces would lose Simpson's
    // order.
    for from in [0.0, 1.0] {
        for i in 0..=INTERVALS {
            let v = from + i as f64 / INTERVALS as f64;
            let density = if from < 1.0 {
                0.5 - 0.25 * v * v
            } else {
                0.25 * (2.0 - v).powi(2)
            };
            let simpson = match i {
                0 | INTERVALS => 1.0,
                i if i % 2 == 1 => 4.0,
                _ => 2.0,
            } / (3.0 * INTERVALS as f64);
            // Twice: for −Y.
            nodes.push((SQRT_2 * v, 2.0 * density * simpson));
        }
    }
    nodes
}

#[cfg(test)]
mod tests {
    use crate::rng::Generator;
    use crate::wavelet::robust::m_scale;
    use crate::wavelet::{Convention, Tuning};
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn tuning() -> Tuning {
        Tuning::new(0.6, Convention::Exact).unwrap()
    }

    /// Simulated with 2·10⁷ draws by an independent program, known to √(2/0.6/2·10⁷) = 4.1e-4, four of which are allowed.
    #[test]
    fn the_factor_is_what_was_simulated_elsewhere() {
        let t = tuning();
        assert_eq!(t.quantization().factor(0.0), (1.0, 0.0));
        for (share, expected) in [
            (0.25, 1.00805),
            (0.5, 1.03641),
            (0.75, 1.08431),
            (1.0, 1.15287),
        ] {
            let (factor, slope) = t.quantization().factor(share);
            assert!(
                (factor - expected).abs() < 4.0 * 4.1e-4,
                "{share}: {factor}"
            );
            let difference = (t.quantization().factor(share + 1e-5).0
                - t.quantization().factor(share - 1e-5).0)
                / 2e-5;
            assert!(
                (slope - difference).abs() < 1e-8,
                "{share}: {slope} {difference}"
            );
        }
    }

    /// 800 samples of 1000 independent coefficients: the mean of the M-estimate is the factor, and its scatter that of the
    /// efficiency. The mean is known to √(2/e/1000/800) = 0.2 %, less 1000 coefficients' own bias of 0.05 %; a variance from
    /// 800 to √(2/800) = 5 %; four of each are allowed.
    #[test]
    fn mean_and_scatter_of_the_estimate_are_those_of_the_law() {
        const SAMPLES: usize = 800;
        let mut generator = Generator::seed_from_u64(3);
        for (efficiency, share) in [(0.6, 0.5), (0.6, 1.0), (0.9, 1.0), (0.4, 0.8)] {
            let t = Tuning::new(efficiency, Convention::Exact).unwrap();
            let mut square = || {
                let mut uniform = || generator.random::<f64>();
                let y = std::f64::consts::SQRT_2 * (uniform() - 2.0 * uniform() + uniform());
                let z = generator.sample::<f64, _>(StandardNormal);
                ((1.0_f64 - share).sqrt() * z + f64::sqrt(share) * y).powi(2)
            };
            let mut estimate =
                || m_scale(&(0..1000).map(|_| square()).collect::<Vec<_>>(), &t).value;
            let all: Vec<f64> = (0..SAMPLES).map(|_| estimate()).collect();
            let mean = all.iter().sum::<f64>() / SAMPLES as f64;
            let scatter =
                all.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / SAMPLES as f64;
            let expected = 2.0 / (1000.0 * efficiency * t.quantization().degrees(share));
            let (factor, _) = t.quantization().factor(share);
            assert!(
                (mean / factor - 1.0).abs() < 4.0 * (expected / 800.0).sqrt() + 5e-4,
                "{share}: {mean} {factor}"
            );
            assert!(
                (scatter / expected - 1.0).abs() < 0.2,
                "{share}: {scatter:e} {expected:e}"
            );
        }
    }
}
