//! First-order autoregressive process: X_t = phi X_{t−1} + W_t, W white with variance sigma2.

use super::{Kind, ParameterError, checked};
use std::f64::consts::LN_2;

/// First-order autoregressive process, stationary: |phi| < 1.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Ar1 {
    phi: f64,
    sigma2: f64,
}

impl Ar1 {
    /// From the coefficient (dimensionless) and the innovation variance (units²).
    ///
    /// # Errors
    /// When |phi| ≥ 1, the variance is negative, or either is not finite.
    pub fn new(phi: f64, sigma2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            phi: checked(Kind::Ar1, "phi", phi)?,
            sigma2: checked(Kind::Ar1, "sigma2", sigma2)?,
        })
    }

    /// Coefficient.
    pub const fn phi(&self) -> f64 {
        self.phi
    }

    /// Innovation variance (units²).
    pub const fn sigma2(&self) -> f64 {
        self.sigma2
    }

    /// Stationary variance sigma2/(1 − phi²) (units²).
    pub fn variance(&self) -> f64 {
        // Factorised: 1 − phi is exact for phi ≥ ½, whereas phi² would be rounded before the subtraction.
        self.sigma2 / ((1.0 - self.phi) * (1.0 + self.phi))
    }

    /// Haar wavelet variance per unit of sigma2, and its derivative with respect to phi. Relative error a
    /// few 1e-15 for every |phi| < 1, up to |phi| = 1 − 1e-16.
    pub(crate) fn haar_shape(phi: f64, level: u32) -> (f64, f64) {
        let m = half_scale(level);
        if level <= 1 {
            // m = 1: W is half the difference of neighbours, nu = γ₀(1 − phi)/2, and 1 − phi cancels against
            // that of γ₀.
            let sum = 1.0 + phi;
            (0.5 / sum, -0.5 / (sum * sum))
        } else if phi > 0.5 {
            // phi − 1 is exact here, so kappa keeps all its digits.
            let (value, derivative) = slow_shape(-(phi - 1.0).ln_1p(), m);
            // dκ/dphi = −1/phi.
            (value, -derivative / phi)
        } else if phi >= 0.0 {
            fast_shape(phi, m)
        } else {
            let (value, derivative) = alternating_shape(-phi, level);
            (value, -derivative)
        }
    }

    /// The same in kappa = −ln phi > 0, the inverse correlation time in samples: value and derivative with
    /// respect to kappa. Keeps the digits of a kappa too small to be told from 0 in phi.
    pub fn haar_shape_of_kappa(kappa: f64, level: u32) -> (f64, f64) {
        if kappa < LN_2 && level > 1 {
            slow_shape(kappa, half_scale(level))
        } else {
            let phi = (-kappa).exp();
            let (value, derivative) = Self::haar_shape(phi, level);
            (value, -phi * derivative)
        }
    }
}

/// ½ < phi < 1, in kappa = −ln phi, where nothing cancels.
fn slow_shape(kappa: f64, m: f64) -> (f64, f64) {
    let bracket = Slow::new(kappa).bracket(m);
    // nu = s2·2κB for the stationary variance s2, and sigma2 = s2 (1 − e^(−2κ)) = s2·2κ e^(−κ) s(κ).
    let (s, s_log_derivative) = sinhc(kappa);
    let value = bracket.value * kappa.exp() / s;
    (
        value,
        value * (1.0 + bracket.log_derivative - s_log_derivative),
    )
}

/// 0 ≤ phi ≤ ½: [m(1 − phi²) − phi(1 − u)(3 − u)]/[2m²(1 − phi)³(1 + phi)], u = phi^m.
pub(super) fn fast_shape(phi: f64, m: f64) -> (f64, f64) {
    let u = phi.powf(m);
    let (minus, plus) = (1.0 - phi, 1.0 + phi);
    let bump = (1.0 - u) * (3.0 - u);
    let numerator = m * minus * plus - phi * bump;
    // d(phi·bump)/dphi = bump + phi (2u − 4) du/dphi with phi·du/dphi = m·u: no division by phi, which may be
    // 0.
    let derivative = -2.0 * m * phi - bump + (4.0 - 2.0 * u) * m * u;
    let value = numerator / (2.0 * m * m * minus * minus * minus * plus);
    (
        value,
        value * (derivative / numerator + 3.0 / minus - 1.0 / plus),
    )
}

/// phi = −r < 0, level ≥ 2: [m(1 + r) + r·G(3 − u)]/[2m²(1 + r)³] with u = r^m and G = Σ_{k<m} r^k, a
/// product of 1 + r^(2^i); the derivative is with respect to r.
fn alternating_shape(r: f64, level: u32) -> (f64, f64) {
    let m = half_scale(level);
    // From level 2 on m is even, phi^m = r^m, and the factor 1 − r of 1 − u = (1 − r) G cancels against 1 +
    // phi.
    // p = r^(2^i), q = 1 − p without cancellation; slant = Σ 2^i q/(1 + p) = m − 1 − 2rG'/G.
    let (mut p, mut q, mut sum, mut slant, mut weight) = (r, 1.0 - r, 1.0, 0.0, 1.0);
    for _ in 1..level {
        sum *= 1.0 + p;
        slant += weight * q / (1.0 + p);
        q *= 1.0 + p;
        p *= p;
        weight *= 2.0;
    }
    let plus = 1.0 + r;
    let numerator = m * plus + r * sum * (3.0 - p);
    let moment = 0.5 * sum * (m - 1.0 - slant);
    // d/dr = m + (G + rG')(3 − u) − m·u·G. As r → 1 its terms of order m² cancel: with 2rG' = G(m − 1 −
    // slant) they do so on paper, and q = 1 − u has all its digits.
    let derivative = m + sum * (2.0 - p - slant) + q * (moment + m * sum);
    let value = numerator / (2.0 * m * m * plus * plus * plus);
    (value, value * (derivative / numerator - 3.0 / plus))
}

// Haar wavelet variance of first-order autoregressions, free of cancellation.
//
// The textbook closed form loses every digit as phi → 1. Written in kappa = −ln phi it is a sum of
// positive terms: with m = 2^(level−1),
// nu = sigma2·e^κ·B/s(κ), B = [2·S(κ) + m²·f(mκ)]/[4m·s(κ/2)²], where s = sinh x/x, S = (sinh x − x)/x³
// and f = (2x − 3 + 4e^−x − e^−2x)/x³.

/// Half the scale of a level, in samples: m = 2^(level−1).
pub(super) fn half_scale(level: u32) -> f64 {
    f64::from(level.saturating_sub(1)).exp2()
}

/// B and the derivative of its logarithm with respect to κ.
pub(super) struct Bracket {
    pub(super) value: f64,
    log_derivative: f64,
}

/// The parts of B that depend on κ alone, for 0 ≤ κ ≤ ln 2 (phi ≥ ½).
pub(super) struct Slow {
    kappa: f64,
    /// 2·S(κ) and its derivative.
    excess: (f64, f64),
    /// s(κ/2) and the derivative of 2·ln s(κ/2) with respect to κ.
    sinhc_half: (f64, f64),
}

impl Slow {
    pub(super) fn new(kappa: f64) -> Self {
        let (s, ds) = sinh_series::<1>(0.5 * kappa);
        let (excess, excess_derivative) = sinh_series::<3>(kappa);
        Self {
            kappa,
            excess: (2.0 * excess, 2.0 * excess_derivative),
            sinhc_half: (s, ds / s),
        }
    }

    pub(super) fn bracket(&self, m: f64) -> Bracket {
        let (f, df) = ramp(m * self.kappa);
        let sum = m.mul_add(m * f, self.excess.0);
        let derivative = self.excess.1 + m * m * m * df;
        let (s, half_log_derivative) = self.sinhc_half;
        Bracket {
            value: sum / (4.0 * m * s * s),
            log_derivative: derivative / sum - half_log_derivative,
        }
    }
}

/// s(κ) = sinh κ/κ and d ln s/dκ.
fn sinhc(kappa: f64) -> (f64, f64) {
    let (s, ds) = sinh_series::<1>(kappa);
    (s, ds / s)
}

/// Σ_k x^2k/(2k+N)! and its derivative, |x| ≤ ln 2: sinh x/x for N = 1, (sinh x − x)/x³ for N = 3.
fn sinh_series<const N: usize>(x: f64) -> (f64, f64) {
    let x2 = x * x;
    let mut term = if N == 1 { 1.0 } else { 1.0 / 6.0 };
    let (mut sum, mut derivative) = (term, 0.0);
    // At x = ln 2 the first term left out, x^20/21!, is below 1e-22 of the sum.
    for k in 1..10_usize {
        let n = 2 * k + N;
        term /= ((n - 1) * n) as f64;
        let power = x2.powi(k as i32 - 1);
        sum += term * power * x2;
        derivative += term * (2 * k) as f64 * power * x;
    }
    (sum, derivative)
}

/// f(x) = (2x − 3 + 4e^−x − e^−2x)/x³ and its derivative, x ≥ 0.
fn ramp(x: f64) -> (f64, f64) {
    if x < 1.0 {
        return ramp_series(x);
    }
    // At x = 1 the numerator is 0.34, of terms up to 3: at most one digit is lost here, and fewer as x grows.
    let e = (-x).exp();
    let f = (2.0 * x - 3.0 + e * (4.0 - e)) / (x * x * x);
    (f, (2.0 * (1.0 - e) * (1.0 - e) / (x * x) - 3.0 * f) / x)
}

/// The same by f = Σ_{n≥3} (−1)^n (4 − 2^n) x^(n−3)/n!, for small x.
fn ramp_series(x: f64) -> (f64, f64) {
    let (mut f, mut df) = (0.0, 0.0);
    for &c in RAMP.iter().rev() {
        // Horner's rule for the derivative needs f from before this coefficient.
        df = df * x + f;
        f = f * x + c;
    }
    (f, df)
}

/// Coefficients of x^k, k = n − 3; the first one left out is below 1e-17 of the sum at x = 1.
const RAMP: [f64; 24] = {
    let mut c = [0.0; 24];
    let (mut factorial, mut power, mut n) = (2.0, 4.0, 3);
    while n < 27 {
        factorial *= n as f64;
        power *= 2.0;
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        c[n - 3] = sign * (4.0 - power) / factorial;
        n += 1;
    }
    c
};

// First-order moving average: X_t = W_t + theta W_{t−1}.

/// First-order moving average, invertible: |theta| ≤ 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ma1 {
    theta: f64,
    sigma2: f64,
}

impl Ma1 {
    /// From the coefficient (dimensionless) and the innovation variance (units²).
    ///
    /// # Errors
    /// When |theta| > 1, the variance is negative, or either is not finite.
    pub fn new(theta: f64, sigma2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            theta: checked(Kind::Ma1, "theta", theta)?,
            sigma2: checked(Kind::Ma1, "sigma2", sigma2)?,
        })
    }

    /// Coefficient.
    pub const fn theta(&self) -> f64 {
        self.theta
    }

    /// Innovation variance (units²).
    pub const fn sigma2(&self) -> f64 {
        self.sigma2
    }

    /// Haar wavelet variance per unit of sigma2, and its derivative with respect to theta.
    pub fn haar_shape(theta: f64, level: u32) -> (f64, f64) {
        let m = half_scale(level);
        let sum = 1.0 + theta;
        (
            (m * sum * sum - 3.0 * theta) / (2.0 * m * m),
            (2.0 * m * sum - 3.0) / (2.0 * m * m),
        )
    }
}

// First-order Gauss-Markov process: an AR1 described in continuous time.

/// Gauss-Markov process: autocovariance s2·exp(−beta·|t|); sampled, an AR1 with phi = exp(−beta/f).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussMarkov {
    beta: f64,
    s2: f64,
    rate_hz: f64,
    ar1: Ar1,
}

impl GaussMarkov {
    /// Largest Allan deviation over standard deviation, reached with averages of [`Self::ALLAN_PEAK_AT`]
    /// correlation times: with averages of x correlation times the Allan variance is
    /// s2·(2/x)·[1 − (3 − 4e^(−x) + e^(−2x))/(2x)].
    pub(crate) const ALLAN_PEAK: f64 = 0.617_364_283_144_441_3;
    /// Averaging time of the largest Allan deviation (correlation times).
    pub(crate) const ALLAN_PEAK_AT: f64 = 1.892_617_8;

    /// From the inverse correlation time beta (1/s), the stationary variance s2 (units²) and the rate (Hz).
    ///
    /// # Errors
    /// When beta or the rate is not positive, the variance is negative, or one is not finite.
    pub fn new(beta: f64, s2: f64, rate_hz: f64) -> Result<Self, ParameterError> {
        let positive = |parameter, value| checked(Kind::GaussMarkov, parameter, value);
        let x = positive("beta", beta)? / positive("rate_hz", rate_hz)?;
        let s2 = checked(Kind::GaussMarkov, "s2", s2)?;
        // sigma2 = s2 (1 − phi²) by expm1: of a slow process phi² is next to 1 and the difference would lose
        // its digits.
        let ar1 = Ar1::new((-x).exp(), s2 * -(-2.0 * x).exp_m1())?;
        Ok(Self {
            beta,
            s2,
            rate_hz,
            ar1,
        })
    }

    /// Inverse correlation time (1/s).
    pub const fn beta(&self) -> f64 {
        self.beta
    }

    /// Sample rate (Hz).
    pub const fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Stationary variance (units²).
    pub const fn s2(&self) -> f64 {
        self.s2
    }

    /// The same process sampled: an AR1 with phi = e^(−beta/f) and sigma2 = s2 (1 − phi²).
    pub const fn ar1(&self) -> Ar1 {
        self.ar1
    }

    /// Haar wavelet variance per unit of s2, and its derivative with respect to kappa = beta/f, the inverse
    /// correlation time in samples.
    pub fn haar_shape(kappa: f64, level: u32) -> (f64, f64) {
        let m = half_scale(level);
        if kappa < LN_2 {
            let bracket = Slow::new(kappa).bracket(m);
            let value = 2.0 * kappa * bracket.value;
            (value, 2.0 * bracket.value + value * bracket.log_derivative)
        } else {
            let phi = (-kappa).exp();
            // phi ≤ ½: nothing cancels in the form of phi. d/dκ = −phi d/dphi, and 1 − phi² is sigma2/s2.
            let variance = (1.0 - phi) * (1.0 + phi);
            let (value, derivative) = fast_shape(phi, m);
            (
                value * variance,
                -phi * (derivative * variance - 2.0 * phi * value),
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::GaussMarkov;
    use approx::assert_relative_eq;

    /// The definition: the variance of a filtered process is a double sum over its autocovariance.
    fn by_definition(phi: f64, level: u32) -> f64 {
        let m = 1_i32 << (level - 1);
        let h = |k: i32| if k < m { 0.5 } else { -0.5 } / f64::from(m);
        let covariance = |lag: i32| phi.powi(lag.abs()) / (1.0 - phi * phi);
        let pairs = (0..2 * m).flat_map(|s| (0..2 * m).map(move |t| (s, t)));
        pairs.map(|(s, t)| h(s) * h(t) * covariance(s - t)).sum()
    }

    const PHIS: [f64; 12] = [
        -0.99, -0.9, -0.6, -0.1, 0.0, 0.1, 0.3, 0.499, 0.5, 0.501, 0.9, 0.99,
    ];

    #[test]
    fn haar_shape_is_the_variance_of_the_filtered_process() {
        for phi in PHIS {
            for level in 1..=6 {
                let (value, _) = Ar1::haar_shape(phi, level);
                assert_relative_eq!(value, by_definition(phi, level), max_relative = 1e-11);
            }
        }
    }

    #[test]
    fn derivatives_are_central_differences() {
        for phi in PHIS {
            for level in 1..=20 {
                let h = 1e-6;
                let difference =
                    Ar1::haar_shape(phi + h, level).0 - Ar1::haar_shape(phi - h, level).0;
                let (value, derivative) = Ar1::haar_shape(phi, level);
                let scale = derivative.abs() + value;
                assert_relative_eq!(
                    derivative / scale,
                    difference / (2.0 * h) / scale,
                    epsilon = 3e-7
                );
            }
        }
    }

    /// Close to −1 the derivative is a difference of terms of order m²: at phi = −1 it is exactly
    /// known (N = 4m, N' = 2m, value 1/(4m)); beyond level 16 phi = −1 + 2e-16 is no longer close in this sense.
    #[test]
    fn an_alternating_process_keeps_its_digits_at_long_scales() {
        for level in [2, 10, 16] {
            let m = half_scale(level);
            let (value, derivative) = Ar1::haar_shape(-1.0 + f64::EPSILON, level);
            assert_relative_eq!(value, 0.25 / m, max_relative = 1e-8);
            assert_relative_eq!(derivative, 0.25 / m, max_relative = 1e-6);
        }
    }

    #[test]
    fn a_gauss_markov_process_is_its_ar1() {
        for kappa in [1e-14_f64, 1e-6, 0.01, 0.69, 0.7, 3.0] {
            let ar1 = Ar1::new((-kappa).exp(), -(-2.0 * kappa).exp_m1()).unwrap();
            for level in [1, 5, 20] {
                let (value, derivative) = GaussMarkov::haar_shape(kappa, level);
                // The rounding of phi, 1e-16, is 1e-16/kappa of 1 − phi.
                let tolerance = 1e-14 + 2e-16 / kappa;
                assert_relative_eq!(
                    value,
                    crate::noise::Process::Ar1(ar1).haar_wv(level),
                    max_relative = tolerance
                );
                let h = 1e-5 * kappa;
                let (high, low) = (
                    GaussMarkov::haar_shape(kappa + h, level),
                    GaussMarkov::haar_shape(kappa - h, level),
                );
                let scale = value / kappa;
                let difference = (high.0 - low.0) / (2.0 * h);
                assert_relative_eq!(derivative / scale, difference / scale, epsilon = 1e-8);
            }
        }
    }
}
