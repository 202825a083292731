//! Haar wavelet variance of first-order autoregressions, free of cancellation.
//!
//! The textbook closed form loses every digit as phi → 1. Written in kappa = −ln phi it is a sum of
//! positive terms: with m = 2^(level−1),
//! nu = sigma2·e^κ·B/s(κ), B = [2·S(κ) + m²·f(mκ)]/[4m·s(κ/2)²], where s = sinh x/x, S = (sinh x − x)/x³
//! and f = (2x − 3 + 4e^−x − e^−2x)/x³.

/// Half the scale of a level, in samples: m = 2^(level−1).
pub(super) fn half_scale(level: u32) -> f64 {
    f64::from(level.saturating_sub(1)).exp2()
}

/// B and the derivative of its logarithm with respect to κ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bracket {
    pub(super) value: f64,
    pub(super) log_derivative: f64,
}

/// The parts of B that depend on κ alone, for 0 ≤ κ ≤ ln 2 (phi ≥ ½).
#[derive(Debug, Clone, Copy)]
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
pub(super) fn sinhc(kappa: f64) -> (f64, f64) {
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
