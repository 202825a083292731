//! Large-sample law of the wavelet variance: its scatter from recording to recording of the same noise.
//!
//! For Gaussian coefficients cov(nu_j, nu_k) ≈ 2/√(M_j M_k) ∫ |H_j|² |H_k|² S² df, H the Haar filters, S the spectrum
//! of the model ([Percival](crate::bibliography::Percival95)). Each nu_j is taken as chi-square with the degrees of
//! freedom 2 nu²/var that follow, joined by the correlations that follow; where the record has few lengths of the
//! scale, with those of var = 2/M² Σ (M − |k|) s_k² over the lags there are, s_k the autocovariance of the
//! coefficients, and of a shape of its own ([`Shape`]). Drift is not noise: it adds to nu and, but for its product with
//! the mean of the coefficients, not to its scatter. Quantization noise is not Gaussian: what that leaves of the scatter
//! of a robust variance is in [`SamplingLaw::robust_edof`].

use super::implied::quantization_share;
use super::shape::Shape;
use crate::noise::{Composite, Process};
use crate::rng::Generator;
use crate::wavelet::Tuning;
use crate::wavelet::interval::edof_robust;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

/// The law of the wavelet variances of one model at levels 1, 2, …
#[derive(Debug, Clone)]
pub(crate) struct SamplingLaw {
    /// Degrees of freedom per coefficient, of each level.
    per_coefficient: Vec<f64>,
    /// The part of the wavelet variance that is quantization noise, of each level.
    pub(crate) quantization: Vec<f64>,
    /// Squares of the autocorrelations of the coefficients of the last levels ([`squared_autocorrelations`]); none of others.
    autocorrelations: Vec<Vec<f64>>,
    /// Of what a robust variance scatters more than the classical one, the part that is left in correlated coefficients, of each
    /// level ([`fourth_powers`]).
    fourth: Vec<f64>,
    /// Shape of the law of each level: a chi-square's but at the last levels.
    pub(crate) shapes: Vec<Shape>,
    /// Correlations between levels, and the lower Cholesky factor.
    pub(crate) correlation: DMatrix<f64>,
    factor: DMatrix<f64>,
}

impl SamplingLaw {
    /// The law for a model, at levels 1 … `levels`.
    pub(crate) fn new(model: &Composite, levels: usize) -> Self {
        let products = products(model, levels);
        let per_coefficient = (0..levels)
            .map(|i| {
                let nu = model.haar_wv(i as u32 + 1);
                let plain = 0.5_f64.powi(i as i32 + 1);
                // var nu_hat = 2/M ∫(|H|² S)² df, so 2 nu²/var over M is this quotient. A drift alone does
                // not scatter and gets those of eta3, 1/tau.
                if products[(i, i)] > 0.0 {
                    nu * nu / products[(i, i)]
                } else {
                    plain
                }
            })
            .collect();
        let mut correlation = DMatrix::from_fn(levels, levels, |i, j| {
            let scale = (products[(i, i)] * products[(j, j)]).sqrt();
            if scale > 0.0 {
                products[(i, j)] / scale
            } else {
                0.0
            }
        });
        // Also for a level without noise, whose row is zero: the matrix must stay positive definite.
        correlation.fill_diagonal(1.0);
        let factor = factor(&correlation);
        let quantization = (1..=levels as u32)
            .map(|level| quantization_share(model, level))
            .collect();
        let autocorrelations = (1..=levels)
            .map(|level| match is_last(level, levels) {
                true => squared_autocorrelations(model, level, 1 << levels),
                false => Vec::new(),
            })
            .collect();
        let fourth = (1..=levels)
            .map(|level| fourth_powers(model, level))
            .collect();
        let shapes = (1..=levels)
            .map(|level| shape(model, level, levels))
            .collect();
        Self {
            per_coefficient,
            quantization,
            autocorrelations,
            fourth,
            shapes,
            correlation,
            factor,
        }
    }

    /// The law of the first so many levels.
    pub(crate) fn first(&self, levels: usize) -> Self {
        let correlation = self.correlation.view((0, 0), (levels, levels)).into_owned();
        // The leading block of a lower triangular factor is the factor of the leading block.
        let factor = self.factor.view((0, 0), (levels, levels)).into_owned();
        let per_coefficient = self.per_coefficient[..levels].to_vec();
        let quantization = self.quantization[..levels].to_vec();
        let autocorrelations = self.autocorrelations[..levels].to_vec();
        let fourth = self.fourth[..levels].to_vec();
        let shapes = self.shapes[..levels].to_vec();
        Self {
            per_coefficient,
            quantization,
            autocorrelations,
            fourth,
            shapes,
            correlation,
            factor,
        }
    }

    /// Degrees of freedom of the classical wavelet variance of a signal of so many samples.
    pub(crate) fn edof(&self, samples: usize) -> Vec<f64> {
        let count = |i: usize| crate::wavelet::coefficient_count(samples, i as u32 + 1) as f64;
        let of_level = |(i, e): (usize, &f64)| {
            (e * count(i))
                .max(of_few(&self.autocorrelations[i], count(i), i as u32 + 1))
                .max(1.0)
        };
        self.per_coefficient
            .iter()
            .enumerate()
            .map(of_level)
            .collect()
    }

    /// The same of the robust one, at least 1.
    pub(crate) fn robust_edof(&self, samples: usize, tuning: &Tuning) -> Vec<f64> {
        let robust = |((edof, share), fourth): ((f64, &f64), &f64)| {
            // The efficiency is that of independent coefficients. In Hermite polynomials of a coefficient the robust variance has the
            // second, by which it scatters as the classical one does, and others from the fourth on, whose covariances fall
            // as the fourth powers of the correlations or faster.
            let efficiency = 1.0 / (1.0 + (1.0 / tuning.efficiency() - 1.0) * fourth);
            edof_robust(edof, efficiency * tuning.quantization().degrees(*share))
        };
        self.edof(samples)
            .into_iter()
            .zip(&self.quantization)
            .zip(&self.fourth)
            .map(robust)
            .collect()
    }

    /// Draws nu*/nu of every level, given the degrees of freedom.
    pub(crate) fn draw(&self, edof: &[f64], generator: &mut Generator) -> Vec<f64> {
        let z = DVector::from_fn(edof.len(), |_, _| {
            generator.sample::<f64, _>(StandardNormal)
        });
        let correlated = &self.factor * z;
        let scores = self.shapes.iter().zip(&correlated);
        scores
            .zip(edof)
            .map(|((shape, z), edof)| shape.ratio(*z, *edof))
            .collect()
    }
}

/// The last levels, whose scale a record may hold few times.
const LAST: usize = 4;
/// Lengths of the scale from which on the large-sample law is used.
const MANY: f64 = 8.0;
/// Number of lags into which the scale is divided.
const LAGS: usize = 16;

/// Squares of the autocorrelations of a level's coefficients at up to [`LAGS`] lags up to the scale, beyond which they are
/// uncorrelated or nearly so. `half`: number of frequencies up to half the rate, no fewer than the scale has samples.
fn squared_autocorrelations(model: &Composite, level: usize, half: usize) -> Vec<f64> {
    let tau = 1_usize << level;
    let m = 0.5 * tau as f64;
    let lags = LAGS.min(tau);
    // The gain falls as 1/f² or faster: beyond 32/tau there is a hundredth of it.
    let frequencies = (64 * half / tau).min(half);
    let mut sums = vec![0.0; lags + 1];
    for k in 0..frequencies {
        let f = 0.5 * (k as f64 + 0.5) / half as f64;
        let gain = gain(model, f, m);
        for (lag, sum) in sums.iter_mut().enumerate() {
            *sum += gain * (2.0 * PI * f * 2.0 * m * lag as f64 / lags as f64).cos();
        }
    }
    sums.iter().map(|s| (s / sums[0]).powi(2)).collect()
}

/// Sum of the fourth powers of a level's autocorrelations over that of their squares; 1 of a process without noise.
fn fourth_powers(model: &Composite, level: usize) -> f64 {
    let squared = squared_autocorrelations(model, level, 1 << level);
    let over_lags =
        |power: i32| 1.0 + 2.0 * squared.iter().skip(1).map(|s| s.powi(power)).sum::<f64>();
    let ratio = over_lags(2) / over_lags(1);
    if ratio.is_finite() { ratio } else { 1.0 }
}

/// The shape of the law of a level's wavelet variance; a chi-square's for a level that is not among the last.
fn shape(model: &Composite, level: usize, levels: usize) -> Shape {
    /// Frequencies to a gain's main lobe, 1/tau wide: eight make the sums of powers of it integrals.
    const TO_A_LOBE: usize = 8;
    if !is_last(level, levels) {
        return Shape::default();
    }
    let m = f64::from(level as u32 - 1).exp2();
    // Up to 8/tau, beyond which there is a thousandth of a random walk's power and a hundredth of white noise's.
    let weight = |k: usize| gain(model, (k as f64 + 0.5) / (TO_A_LOBE as f64 * 2.0 * m), m);
    Shape::new(&(0..8 * TO_A_LOBE).map(weight).collect::<Vec<f64>>())
}

/// Whether a record may hold a level's scale few times. Below level 4 a sixteenth of the scale is less than a sample.
const fn is_last(level: usize, levels: usize) -> bool {
    level + LAST > levels && level >= 4
}

/// |H|² S of a frequency, with the Haar gain |H|² = sin⁴(πfm)/(m² sin²(πf)).
fn gain(model: &Composite, f: f64, m: f64) -> f64 {
    let sin2 = (PI * f).sin().powi(2);
    let density = model
        .processes
        .iter()
        .map(|p| spectrum(p, sin2))
        .sum::<f64>();
    density * (PI * f * m).sin().powi(4) / (m * m * sin2)
}

/// Degrees of freedom of a mean of `count` squares with these squared autocorrelations; 0 where the large-sample law holds.
fn of_few(squared: &[f64], count: f64, level: u32) -> f64 {
    let step = f64::from(level).exp2() / LAGS as f64;
    // Counted in steps of the lag, so that each lag kept stands for a step of them.
    let n = count / step;
    if squared.is_empty() || n > MANY * LAGS as f64 {
        return 0.0;
    }
    let lags = squared.iter().enumerate().skip(1);
    let sum = n * squared[0]
        + 2.0
            * lags
                .map(|(lag, s)| (n - lag as f64).max(0.0) * s)
                .sum::<f64>();
    // Of a process without noise (a drift) nothing is known.
    if sum > 0.0 { n * n / sum } else { 0.0 }
}

/// The Cholesky factor; where rounding leaves no positive definite matrix, that of independent levels.
fn factor(correlation: &DMatrix<f64>) -> DMatrix<f64> {
    let n = correlation.nrows();
    correlation
        .clone()
        .cholesky()
        .map_or_else(|| DMatrix::identity(n, n), |c| c.l())
}

/// ∫ |H_j|² |H_k|² S² df over −½ … ½, for all pairs of levels (units⁴).
///
/// A sum over 2^(levels + 1) frequencies: exact where the autocovariance of the coefficients of the longest
/// scale ends within that scale, as it does for WN, QN, MA1 and RW.
fn products(model: &Composite, levels: usize) -> DMatrix<f64> {
    let half = 1_usize << levels;
    let mut sums = DMatrix::zeros(levels, levels);
    let mut gains = vec![0.0; levels];
    for k in 0..half {
        // sin²(πf) of the midpoint; then sin²(2x) = 4 sin²x (1 − sin²x) from level to level.
        let base = (0.5 * PI * (k as f64 + 0.5) / half as f64).sin().powi(2);
        let density = model
            .processes
            .iter()
            .map(|p| spectrum(p, base))
            .sum::<f64>();
        let mut sin2 = base;
        for (i, gain) in gains.iter_mut().enumerate() {
            let m = f64::from(i as u32).exp2();
            // sin2 is sin²(πfm) here, base sin²(πf). Midpoints leave out f = 0, where a random walk has no
            // density.
            *gain = density * sin2 * sin2 / (m * m * base);
            sin2 = 4.0 * sin2 * (1.0 - sin2);
        }
        for j in 0..levels {
            for i in j..levels {
                sums[(i, j)] += gains[i] * gains[j];
            }
        }
    }
    // The midpoint rule with step ½/half over 0 … ½, doubled for the negative frequencies.
    sums /= half as f64;
    sums.fill_upper_triangle_with_lower_triangle();
    sums
}

/// Two-sided spectral density per sample (units²), at the frequency whose sin²(πf) is given.
fn spectrum(process: &Process, sin2: f64) -> f64 {
    // |1 − r e^(−2πif)|²
    let distance = |r: f64| (1.0 - r) * (1.0 - r) + 4.0 * r * sin2;
    match process {
        Process::White(p) => p.sigma2(),
        Process::Quantization(p) => 4.0 * p.q2() * sin2,
        Process::Ar1(p) => p.sigma2() / distance(p.phi()),
        Process::GaussMarkov(p) => p.ar1().sigma2() / distance(p.ar1().phi()),
        Process::Ma1(p) => p.sigma2() * distance(-p.theta()),
        Process::Flicker(p) => p.b2() / (2.0 * sin2.sqrt()),
        Process::RandomWalk(p) => p.gamma2() / (4.0 * sin2),
        Process::Drift(_) => 0.0,
    }
}

#[cfg(test)]
mod tests;
