//! Confidence intervals of wavelet variances.
//!
//! eta·nu_hat/nu is taken as chi-square with eta degrees of freedom
//! ([Percival](crate::bibliography::Percival95)).

use super::coefficient_count;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The field's usual equivalent degrees of freedom, eta3 = max(M_j/2^j, 1). Conservative: beyond the first
/// scale a 95 % interval covers 99 % or more.
pub fn edof_eta3(samples: usize, level: u32) -> f64 {
    (coefficient_count(samples, level) as f64 / f64::from(level).exp2()).max(1.0)
}

/// Degrees of freedom of a robust variance: those of the classical one times the efficiency, at least 1.
pub fn edof_robust(edof: f64, efficiency: f64) -> f64 {
    (edof * efficiency).max(1.0)
}

/// Large-sample degrees of freedom of one level from its own coefficients, eta1 = M·s_0²/Σ_k s_k²: for
/// Gaussian coefficients 2·s_k² is the autocovariance of W². Where eta3 is at least 8, a 95 % interval was
/// seen to cover in 92.6 to 96 % of simulations; elsewhere eta3 is returned.
///
/// The lags run to twice the scale, where the coefficients of every process of this crate are uncorrelated
/// or nearly so, in steps of a sixteenth of it; the sampling noise of s_k², Σ s²/M each, is taken out.
pub fn edof_large_sample(coefficients: &[f64], level: u32) -> f64 {
    let samples = coefficients.len() + (1 << level) - 1;
    let count = coefficients.len();
    let eta3 = edof_eta3(samples, level);
    // The autocovariance is as smooth as the scale is long: every sixteenth of a scale resolves it, and
    // spares the rest.
    let step = (1_usize << level).div_ceil(16);
    let lags = (2_usize << level) / step;
    if eta3 < 8.0 {
        return eta3;
    }
    let thinned: Vec<f64> = coefficients.iter().step_by(step).copied().collect();
    let autocovariance = |lag: usize| {
        thinned
            .iter()
            .zip(&thinned[lag..])
            .map(|(a, b)| a * b)
            .sum::<f64>()
            / thinned.len() as f64
    };
    let s0 = autocovariance(0);
    let tail: f64 = (1..=lags).map(|lag| autocovariance(lag).powi(2)).sum();
    // Σ over all lags of both signs; each lag kept stands for `step` of them.
    let sum = step as f64 * (s0 * s0 + 2.0 * tail);
    // Each estimated s_k² is too large by its sampling variance, Σ s²/M in the mean: 2·lags·step of them
    // raise the sum by this factor.
    let noise = 1.0 + 2.0 * (lags * step) as f64 / count as f64;
    (count as f64 * s0 * s0 * noise / sum).max(1.0)
}

/// Interval \[eta·nu/q(1 − α/2), eta·nu/q(α/2)\] of confidence 1 − α (units²).
pub fn interval(nu: f64, edof: f64, confidence: f64) -> (f64, f64) {
    let tail = 0.5 * (1.0 - confidence);
    // nu = eta·nu_hat/chi²: the upper quantile of chi² gives the lower end.
    let (high, low) = (quantile(edof, 1.0 - tail), quantile(edof, tail));
    (nu * edof / high, nu * edof / low)
}

/// Quantile of the chi-square distribution; NaN when the degrees of freedom are not positive.
fn quantile(edof: f64, p: f64) -> f64 {
    ChiSquared::new(edof).map_or(f64::NAN, |d| d.inverse_cdf(p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Generator;
    use crate::wavelet::haar;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// 1000 independent numbers have 1000 degrees of freedom. The tail of a record is a sum of 2 chi-square numbers of one degree,
    /// 1/M each, at 4 lags: the inverse has a standard deviation of 2√8/M, and its mean over 2000 records one of 0.13/M. Four of these
    /// are 5e-4; the sampling noise of the lags, 8/M, is 16 times that. (The ratio's own second order is of 8·6/M² = 5e-5.)
    #[test]
    fn independent_numbers_count_one_each() {
        let (count, records) = (1000, 2000);
        let mut generator = Generator::seed_from_u64(11);
        let mut inverse = || {
            let w: Vec<f64> = (0..count)
                .map(|_| generator.sample(StandardNormal))
                .collect();
            count as f64 / edof_large_sample(&w, 1)
        };
        let mean = (0..records).map(|_| inverse()).sum::<f64>() / f64::from(records);
        assert_abs_diff_eq!(mean, 1.0, epsilon = 5.5e-4);
    }

    /// Coefficients that never forget, cos(2π k/2^level): Σ s_k²/s_0² over the 32 lags of a sixteenth of the
    /// scale, two scales in all, is 16; eta1 = M/(step·(1 + 2·16)) to order 2^(level + 2)/M. Lags to one scale
    /// only would give twice as many degrees of freedom.
    #[test]
    fn large_sample_degrees_of_freedom_have_lags_to_two_scales() {
        let (level, count) = (6_u32, 1 << 18);
        let w: Vec<f64> = (0..count)
            .map(|k| (std::f64::consts::TAU * f64::from(k % 64) / 64.0).cos())
            .collect();
        let expected = f64::from(count) / (4.0 * 33.0);
        assert_relative_eq!(edof_large_sample(&w, level), expected, max_relative = 5e-3);
    }

    /// 400 white signals: a frequency that is really 0.95 lies within 4 standard deviations,
    /// 4·√(0.95·0.05/400) = 0.044, of it.
    #[test]
    fn large_sample_intervals_cover_at_their_level_and_eta3_above() {
        const SIGNALS: u32 = 400;
        let mut generator = Generator::seed_from_u64(20);
        for level in [1, 3, 5] {
            let (mut large, mut conservative) = (0, 0);
            for _ in 0..SIGNALS {
                let signal: Vec<f64> = (0..1024)
                    .map(|_| generator.sample(StandardNormal))
                    .collect();
                let w = haar::coefficients(&signal, level).unwrap();
                let nu = w.iter().map(|w| w * w).sum::<f64>() / w.len() as f64;
                let truth = 1.0 / f64::from(level).exp2();
                let covers = |edof: f64| {
                    let (low, high) = interval(nu, edof, 0.95);
                    u32::from(low < truth && truth < high)
                };
                large += covers(edof_large_sample(&w, level));
                conservative += covers(edof_eta3(1024, level));
            }
            let frequency = f64::from(large) / f64::from(SIGNALS);
            assert!(
                (frequency - 0.95).abs() < 0.044,
                "level {level}: {frequency}"
            );
            assert!(
                f64::from(conservative) / f64::from(SIGNALS) > 0.95,
                "level {level}"
            );
        }
    }
}
