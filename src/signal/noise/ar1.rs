//! First-order autoregressive process: X_t = phi X_{t−1} + W_t, W white with variance sigma2.

use std::f64::consts::LN_2;

/// Haar wavelet variance per unit of sigma2, and its derivative with respect to phi. Relative error a
/// few 1e-15 for every |phi| < 1, up to |phi| = 1 − 1e-16.
pub(super) fn haar_shape(phi: f64, level: u32) -> (f64, f64) {
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

/// Haar shape in kappa = −ln phi > 0, the inverse correlation time in samples: value and derivative with
/// respect to kappa. Keeps the digits of a kappa too small to be told from 0 in phi.
pub(super) fn haar_shape_of_kappa(kappa: f64, level: u32) -> (f64, f64) {
    if kappa < LN_2 && level > 1 {
        slow_shape(kappa, half_scale(level))
    } else {
        let phi = (-kappa).exp();
        let (value, derivative) = haar_shape(phi, level);
        (value, -phi * derivative)
    }
}

/// ½ < phi < 1, in kappa = −ln phi, where nothing cancels.
fn slow_shape(kappa: f64, m: f64) -> (f64, f64) {
    let bracket = SlowTerms::new(kappa).bracket(m);
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
pub(super) struct SlowTerms {
    kappa: f64,
    /// 2·S(κ) and its derivative.
    excess: (f64, f64),
    /// s(κ/2) and the derivative of 2·ln s(κ/2) with respect to κ.
    sinhc_half: (f64, f64),
}

impl SlowTerms {
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

/// The ramp by f = Σ_{n≥3} (−1)^n (4 − 2^n) x^(n−3)/n!, for small x.
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

/// Largest Allan deviation over standard deviation, reached with averages of [`ALLAN_PEAK_AT`] correlation times: with averages of
/// x correlation times the Allan variance is s2·(2/x)·[1 − (3 − 4e^(−x) + e^(−2x))/(2x)].
pub(crate) const ALLAN_PEAK: f64 = 0.617_364_283_144_441_3;
/// Averaging time of the largest Allan deviation (correlation times).
pub(crate) const ALLAN_PEAK_AT: f64 = 1.892_617_8;

/// Haar wavelet variance per unit of s2, and its derivative with respect to kappa = beta/f, the inverse
/// correlation time in samples.
pub(super) fn markov_haar_shape(kappa: f64, level: u32) -> (f64, f64) {
    let m = half_scale(level);
    if kappa < LN_2 {
        let bracket = SlowTerms::new(kappa).bracket(m);
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

// The Allan variance at any averaging time: the Haar wavelet variance lives on octaves, a data sheet asks for one second, whatever
// the rate. With averages over m samples it is twice the Haar wavelet variance of scale 2m, in closed form for every whole m.

/// Allan variance of a Gauss-Markov process of variance 1 and correlation time 1/kappa samples.
pub(super) fn unit_markov(kappa: f64, samples: u32) -> f64 {
    // The textbook form loses every digit as kappa → 0; this one is a sum of positive terms.
    if kappa < LN_2 && samples > 1 {
        return 4.0 * kappa * SlowTerms::new(kappa).bracket(f64::from(samples)).value;
    }
    let phi = (-kappa).exp();
    match samples {
        // Half the variance of the difference of neighbours, 1 − phi.
        1 => -(-kappa).exp_m1(),
        m => 2.0 * (1.0 - phi) * (1.0 + phi) * fast_shape(phi, f64::from(m)).0,
    }
}

/// Allan variance of an AR1.
pub(super) fn allan_variance(phi: f64, sigma2: f64, samples: u32) -> f64 {
    let m = f64::from(samples);
    if samples == 1 {
        return sigma2 / (1.0 + phi);
    }
    if phi > 0.0 {
        let variance = sigma2 / ((1.0 - phi) * (1.0 + phi));
        return variance * unit_markov(-(phi - 1.0).ln_1p(), samples);
    }
    // Between the octaves m may be odd: phi^m keeps its sign, and the product form of the wavelet variance
    // does not apply.
    // 1 − u by the logarithm of −phi = 1 − (1 + phi): as phi → −1 it vanishes for an even m as m (1 + phi) does.
    let log_power = m * (-(1.0 + phi)).ln_1p();
    let rest = if samples.is_multiple_of(2) {
        -log_power.exp_m1()
    } else {
        1.0 + log_power.exp()
    };
    let bump = rest * (2.0 + rest);
    sigma2 * (m * (1.0 - phi) * (1.0 + phi) - phi * bump)
        / (m * m * (1.0 - phi).powi(3) * (1.0 + phi))
}

/// Variance of the mean of n samples of an AR1 of variance 1:
/// 1/n² [n (1 + φ)/(1 − φ) − 2 φ (1 − φⁿ)/(1 − φ)²]
pub(super) fn mean_shape(phi: f64, n: f64) -> f64 {
    let left = 1.0 - phi;
    if n * left < 1e-2 {
        // The difference would lose its digits: e^(−κd) in powers of the distances d, what is left out is below 2e-8.
        // Over the n² pairs the mean of |i − k| is (n² − 1)/(3n) and that of its square (n² − 1)/6.
        let (kappa, squares) = (-phi.ln(), n * n - 1.0);
        return 1.0 - kappa * squares / (3.0 * n) + kappa * kappa * squares / 12.0;
    }
    (n * (1.0 + phi) / left - 2.0 * phi * (1.0 - phi.powf(n)) / (left * left)) / (n * n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Process;
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
                let (value, _) = haar_shape(phi, level);
                assert_relative_eq!(value, by_definition(phi, level), max_relative = 1e-11);
            }
        }
    }

    #[test]
    fn derivatives_are_central_differences() {
        for phi in PHIS {
            for level in 1..=20 {
                let h = 1e-6;
                let difference = haar_shape(phi + h, level).0 - haar_shape(phi - h, level).0;
                let (value, derivative) = haar_shape(phi, level);
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
            let (value, derivative) = haar_shape(-1.0 + f64::EPSILON, level);
            assert_relative_eq!(value, 0.25 / m, max_relative = 1e-8);
            assert_relative_eq!(derivative, 0.25 / m, max_relative = 1e-6);
        }
    }

    #[test]
    fn a_gauss_markov_process_is_its_ar1() {
        for kappa in [1e-14_f64, 1e-6, 0.01, 0.69, 0.7, 3.0] {
            let ar1 = Process::ar1((-kappa).exp(), -(-2.0 * kappa).exp_m1()).unwrap();
            for level in [1, 5, 20] {
                let (value, derivative) = markov_haar_shape(kappa, level);
                // The rounding of phi, 1e-16, is 1e-16/kappa of 1 − phi.
                let tolerance = 1e-14 + 2e-16 / kappa;
                assert_relative_eq!(value, ar1.haar_wv(level), max_relative = tolerance);
                let h = 1e-5 * kappa;
                let (high, low) = (
                    markov_haar_shape(kappa + h, level),
                    markov_haar_shape(kappa - h, level),
                );
                let scale = value / kappa;
                let difference = (high.0 - low.0) / (2.0 * h);
                assert_relative_eq!(derivative / scale, difference / scale, epsilon = 1e-8);
            }
        }
    }
}

#[cfg(test)]
mod allan_tests {
    use crate::noise::Process;

    fn processes() -> Vec<Process> {
        let ar1 = |phi| Process::ar1(phi, 1e-8).unwrap();
        vec![
            Process::white(5e-5).unwrap(),
            Process::quantization(1e-7).unwrap(),
            Process::random_walk(3e-11).unwrap(),
            Process::drift(-2e-9).unwrap(),
            Process::gauss_markov(0.02, 1e-6, 100.0).unwrap(),
            Process::gauss_markov(120.0, 1e-6, 100.0).unwrap(),
            Process::ma1(-0.4, 2e-6).unwrap(),
            ar1(0.9999),
            ar1(0.7),
            ar1(0.3),
            ar1(0.0),
            ar1(-0.6),
            ar1(-1.0 + 1e-12),
        ]
    }

    #[test]
    fn on_octaves_it_is_twice_the_wavelet_variance() {
        for process in processes() {
            for level in 1..20 {
                let (a, b) = (
                    process.allan_variance(1 << (level - 1)),
                    2.0 * process.haar_wv(level),
                );
                assert!(
                    (a / b - 1.0).abs() < 1e-12,
                    "{process:?} level {level}: {a:e} {b:e}"
                );
            }
        }
    }

    /// Between octaves against the definition: half the variance of the difference of two adjacent means of m samples,
    /// summed from the autocovariance, Σ over the 2m × 2m pairs of samples with signs.
    #[test]
    fn between_octaves_it_is_the_variance_of_the_definition() {
        for phi in [0.95_f64, 0.3, -0.6] {
            let ar1 = Process::ar1(phi, 2.0).unwrap();
            for m in [3_i32, 7, 13] {
                let mut sum = 0.0;
                for i in 0..2 * m {
                    for j in 0..2 * m {
                        let sign = if (i < m) == (j < m) { 1.0 } else { -1.0 };
                        sum += sign * ar1.initial_variance() * phi.powi((i - j).abs());
                    }
                }
                let definition = 0.5 * sum / f64::from(m * m);
                let value = ar1.allan_variance(m as u32);
                assert!(
                    (value / definition - 1.0).abs() < 1e-11,
                    "{phi} {m}: {value:e} {definition:e}"
                );
            }
        }
    }
}

#[cfg(test)]
mod mean_tests {
    use crate::noise::Process;
    use approx::assert_relative_eq;

    /// By definition: the double sum of the autocovariances of X_1 … X_n.
    fn by_definition(n: usize, covariance: impl Fn(usize, usize) -> f64) -> f64 {
        let sum: f64 = (1..=n)
            .map(|i| (1..=n).map(|k| covariance(i, k)).sum::<f64>())
            .sum();
        sum / (n * n) as f64
    }

    fn closed_form(process: Process, n: usize) -> f64 {
        process.mean_variance(n as f64)
    }

    #[test]
    fn the_mean_of_n_samples_has_the_sum_of_their_covariances() {
        let n = 50;
        let of_distance = |at: &dyn Fn(usize) -> f64| by_definition(n, |i, k| at(i.abs_diff(k)));
        let white = closed_form(Process::white(2.0).unwrap(), n);
        assert_relative_eq!(
            white,
            of_distance(&|d| if d == 0 { 2.0 } else { 0.0 }),
            max_relative = 1e-12
        );
        let steps = closed_form(Process::quantization(2.0).unwrap(), n);
        let exact = of_distance(&|d| [4.0, -2.0].get(d).copied().unwrap_or(0.0));
        assert_relative_eq!(steps, exact, max_relative = 1e-10);
        let average = closed_form(Process::ma1(0.5, 2.0).unwrap(), n);
        let exact = of_distance(&|d| [2.5, 1.0].get(d).copied().unwrap_or(0.0));
        assert_relative_eq!(average, exact, max_relative = 1e-12);
        let walk = closed_form(Process::random_walk(2.0).unwrap(), n);
        assert_relative_eq!(
            walk,
            by_definition(n, |i, k| 2.0 * i.min(k) as f64),
            max_relative = 1e-12
        );
        // On both sides of the series at 50 (1 − φ) = 0.01.
        for phi in [-0.5_f64, 0.0, 0.3, 0.9, 0.999, 0.9998, 0.99999] {
            let p = Process::ar1(phi, 2.0).unwrap();
            let exact = of_distance(&|d| p.initial_variance() * phi.powi(d as i32));
            assert_relative_eq!(closed_form(p, n), exact, max_relative = 1e-7);
        }
        let markov = Process::gauss_markov(0.5, 3.0, 10.0).unwrap();
        let [phi, innovation, _] = markov.recursion().unwrap();
        let same = closed_form(Process::ar1(phi, innovation).unwrap(), n);
        // 1 − phi of the AR1 has lost two bits
        assert_relative_eq!(closed_form(markov, n), same, max_relative = 1e-14);
    }
}
