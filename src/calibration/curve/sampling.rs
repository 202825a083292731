//! Large-sample law of the wavelet variance: its scatter from recording to recording of the same noise.
//!
//! For Gaussian coefficients cov(nu_j, nu_k) ≈ 2/√(M_j M_k) ∫ |H_j|² |H_k|² S² df, H the Haar filters, S the spectrum
//! of the model ([Percival](crate::bibliography::Percival95)). Each nu_j is taken as chi-square with the degrees of
//! freedom 2 nu²/var that follow, joined by the correlations that follow; where the record has few lengths of the
//! scale, with those of var = 2/M² Σ (M − |k|) s_k² over the lags there are, s_k the autocovariance of the
//! coefficients, and of a shape of its own ([`VarianceDistribution`]). Drift is not noise: it adds to nu and, but for its product with
//! the mean of the coefficients, not to its scatter. Quantization noise is not Gaussian: what that leaves of the scatter
//! of a robust variance is in [`SamplingDistribution::robust_edof`].

use crate::noise::{Composite, Process, ProcessKind};
use crate::rng::Generator;
use crate::wavelet::interval::edof_robust;
use crate::wavelet::{Curve, QuantizationResponse, Tuning};
use multiversion::multiversion;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_distr::StandardNormal;
use statrs::function::erf::erfc;
use statrs::function::gamma::ln_gamma;
use std::array;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// The law of the wavelet variances of one model at levels 1, 2, …
#[derive(Debug, Clone)]
pub(crate) struct SamplingDistribution {
    /// Degrees of freedom per coefficient, of each level.
    per_coefficient: Vec<f64>,
    /// The part of the wavelet variance that is quantization noise, of each level.
    pub(crate) quantization: Vec<f64>,
    /// Squares of the autocorrelations of the coefficients of the last levels ([`squared_autocorrelations`]); none of others.
    autocorrelations: Vec<Vec<f64>>,
    /// Excess scatter of the robust variance over the classical one, at each level: the part that
    /// remains in correlated coefficients ([`fourth_powers`]).
    fourth: Vec<f64>,
    /// Shape of the law of each level: a chi-square's but at the last levels.
    pub(crate) shapes: Vec<VarianceDistribution>,
    /// Correlations between levels, and the lower Cholesky factor.
    pub(crate) correlation: DMatrix<f64>,
    factor: DMatrix<f64>,
}

impl SamplingDistribution {
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
        let mut first = self.clone();
        for matrix in [&mut first.correlation, &mut first.factor] {
            *matrix = matrix.view((0, 0), (levels, levels)).into_owned();
        }
        let Self {
            per_coefficient,
            quantization,
            fourth,
            ..
        } = &mut first;
        for list in [per_coefficient, quantization, fourth] {
            list.truncate(levels);
        }
        first.autocorrelations.truncate(levels);
        first.shapes.truncate(levels);
        first
    }

    /// Degrees of freedom of the classical wavelet variance of a signal of this many samples.
    pub(crate) fn edof(&self, samples: usize) -> Vec<f64> {
        let count = |i: usize| crate::wavelet::coefficient_count(samples, i as u32 + 1) as f64;
        let of_level = |(i, e): (usize, &f64)| {
            (e * count(i))
                .max(edof_few_lengths(
                    &self.autocorrelations[i],
                    count(i),
                    i as u32 + 1,
                ))
                .max(1.0)
        };
        self.per_coefficient
            .iter()
            .enumerate()
            .map(of_level)
            .collect()
    }

    /// Degrees of freedom of the robust wavelet variance of `samples` samples; at least 1.
    pub(crate) fn robust_edof(&self, samples: usize, tuning: &Tuning) -> Vec<f64> {
        let robust = |((edof, share), fourth): ((f64, &f64), &f64)| {
            // The efficiency is that of independent coefficients. Hermite expansion: the second-order term scatters as
            // the classical variance; the excess comes from orders ≥ 4, whose covariances fall as the fourth power of
            // the correlation or faster.
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
fn shape(model: &Composite, level: usize, levels: usize) -> VarianceDistribution {
    /// Frequencies to a gain's main lobe, 1/tau wide: eight make the sums of powers of it integrals.
    const TO_A_LOBE: usize = 8;
    if !is_last(level, levels) {
        return VarianceDistribution::default();
    }
    let m = f64::from(level as u32 - 1).exp2();
    // Up to 8/tau, beyond which there is a thousandth of a random walk's power and a hundredth of white noise's.
    let weight = |k: usize| gain(model, (k as f64 + 0.5) / (TO_A_LOBE as f64 * 2.0 * m), m);
    VarianceDistribution::new(&(0..8 * TO_A_LOBE).map(weight).collect::<Vec<f64>>())
}

/// Returns true at a level whose scale fits only a few times into the record. Below level 4 a
/// sixteenth of the scale is less than a sample.
const fn is_last(level: usize, levels: usize) -> bool {
    level + LAST > levels && level >= 4
}

/// |H|² S of a frequency, with the Haar gain |H|² = sin⁴(πfm)/(m² sin²(πf)).
fn gain(model: &Composite, f: f64, m: f64) -> f64 {
    let sin2 = (PI * f).sin().powi(2);
    let density = model
        .processes
        .iter()
        .map(|p| p.spectrum(sin2))
        .sum::<f64>();
    density * (PI * f * m).sin().powi(4) / (m * m * sin2)
}

/// Degrees of freedom of a mean of `count` squares with these squared autocorrelations; 0 where the large-sample law holds.
fn edof_few_lengths(squared: &[f64], count: f64, level: u32) -> f64 {
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

/// Frequencies that advance together.
const WIDTH: usize = 8;

/// Adds the products of the gains of all levels at some frequencies, of which sin²(πf) and the density are given.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn add_products(
    lanes: &mut [[f64; WIDTH]],
    gains: &mut [[f64; WIDTH]],
    base: [f64; WIDTH],
    density: [f64; WIDTH],
) {
    let (levels, mut sin2, mut m) = (gains.len(), base, 1.0);
    for gain in gains.iter_mut() {
        for lane in 0..WIDTH {
            let s = sin2[lane];
            // sin2 is sin²(πfm) here, base sin²(πf). Midpoints leave out f = 0, where a random walk has no
            // density.
            gain[lane] = density[lane] * s * s / (m * m * base[lane]);
            sin2[lane] = 4.0 * s * (1.0 - s);
        }
        m *= 2.0;
    }
    for j in 0..levels {
        let own = gains[j];
        for (sum, gain) in lanes[j * levels..][j..levels].iter_mut().zip(&gains[j..]) {
            (0..WIDTH).for_each(|lane| sum[lane] += gain[lane] * own[lane]);
        }
    }
}

/// ∫ |H_j|² |H_k|² S² df over −½ … ½, for all pairs of levels (units⁴).
///
/// A sum over 2^(levels + 1) frequencies: exact where the autocovariance of the coefficients of the longest
/// scale ends within that scale, as it does for WN, QN, MA1 and RW.
fn products(model: &Composite, levels: usize) -> DMatrix<f64> {
    let half = 1_usize << levels;
    let mut lanes = vec![[0.0; WIDTH]; levels * levels];
    let mut gains = vec![[0.0; WIDTH]; levels];
    for first in (0..half).step_by(WIDTH) {
        // sin²(πf) of the midpoint; then sin²(2x) = 4 sin²x (1 − sin²x) from level to level.
        let base: [f64; WIDTH] = array::from_fn(|lane| {
            let k = (first + lane) as f64;
            (0.5 * PI * (k + 0.5) / half as f64).sin().powi(2)
        });
        let density: [f64; WIDTH] = array::from_fn(|lane| {
            let spectra = model.processes.iter().map(|p| p.spectrum(base[lane]));
            // Up to level 2 there are fewer frequencies than lanes.
            if first + lane < half {
                spectra.sum()
            } else {
                0.0
            }
        });
        add_products(&mut lanes, &mut gains, base, density);
    }
    let mut sums = DMatrix::from_fn(levels, levels, |i, j| {
        lanes[j * levels + i].iter().sum::<f64>()
    });
    // The midpoint rule with step ½/half over 0 … ½, doubled for the negative frequencies.
    sums /= half as f64;
    sums.fill_upper_triangle_with_lower_triangle();
    sums
}

// Shape of the law of one wavelet variance: a mean of squares of correlated Gaussian coefficients.
//
// With many lengths of the scale in the record it is as good as a chi-square. With few it is not: nu is Σ λ_i z_i² with
// weights of very different size, and its lower tail, the product of all of them, is far lighter than that of the one
// chi-square of as many degrees of freedom (white noise and random walk, two lengths: 2.4 degrees, the variance of ln nu is
// 0.86 and that of the chi-square's logarithm 1.24). The weights go as the spectrum of the coefficients (Whittle), each with
// a chi-square of a common number of degrees, which is chosen so that nu has its degrees of freedom 2 nu²/var; the
// quantiles follow by the saddlepoint ([Daniels](crate::bibliography::Daniels87), r*).

/// Degrees of freedom from which on a chi-square serves: ln nu has a variance of 0.0335 or 0.034 then. More lengths of the scale
/// than eight make 16 and more.
const MANY_DEGREES: f64 = 60.0;

/// Law of nu over its mean; the default is the chi-square's.
#[derive(Debug, Clone, Default)]
pub(crate) struct VarianceDistribution {
    /// Points of the law of one degree of freedom a weight, rising; none: a chi-square.
    points: Vec<ScorePoint>,
    /// Degrees of freedom of that law.
    degrees: f64,
}

/// A value and what its normal score consists of: the score is w·√k + c/√k, with k degrees of freedom a weight.
#[derive(Debug, Clone)]
struct ScorePoint {
    ln: f64,
    w: f64,
    c: f64,
}

impl VarianceDistribution {
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
            ScorePoint {
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
        self.points.is_empty() || edof > MANY_DEGREES
    }

    /// ln of nu over its mean, between the points; beyond the last of them as there.
    fn ln(&self, z: f64, edof: f64) -> f64 {
        let root = (edof / self.degrees).sqrt();
        let score = |p: &ScorePoint| p.w * root + p.c / root;
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

// The curve that a model implies: the expected values of the wavelet variances to which it is fitted.
//
// For classical variances these are nu_j(theta). Robust ones read quantization noise high
// ([`QuantizationResponse`]): nu_j(theta)·b(s_j), s_j the part of nu_j that is quantization noise.

/// The part of a model's wavelet variance that is quantization noise, at a level.
fn quantization_share(model: &Composite, level: u32) -> f64 {
    share(model, level, is_quantization)
}

/// The part of a model's wavelet variance that is drift, at a level.
pub(crate) fn drift_share(model: &Composite, level: u32) -> f64 {
    share(model, level, |p| p.kind() == ProcessKind::Drift)
}

fn share(model: &Composite, level: u32, is_counted: impl Fn(&Process) -> bool) -> f64 {
    let counted: f64 = model
        .processes
        .iter()
        .filter(|p| is_counted(p))
        .map(|p| p.haar_wv(level))
        .sum();
    if counted > 0.0 {
        counted / model.haar_wv(level)
    } else {
        0.0
    }
}

fn is_quantization(process: &Process) -> bool {
    process.kind() == ProcessKind::Quantization
}

/// The curve a model implies, at the levels and of the kind (classical or robust) of a given one.
pub fn implied(model: &Composite, curve: &Curve) -> Vec<f64> {
    let at_level = |level: &u32| {
        let nu = model.haar_wv(*level);
        match curve.response(*level) {
            None => nu,
            Some(response) => nu * response.factor(quantization_share(model, *level)).0,
        }
    };
    curve.levels.iter().map(at_level).collect()
}

/// Derivatives of nu·b(q/nu), q the variance of quantization noise and nu that of all: with respect to q and to that of
/// any other process. nu·b is homogeneous, so that it is q times the first plus (nu − q) times the second.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    pub(crate) quantization: f64,
    pub(crate) others: f64,
}

impl Response {
    /// Response of a curve that reads quantization noise as it is.
    pub(crate) const PLAIN: Self = Self {
        quantization: 1.0,
        others: 1.0,
    };

    pub(crate) fn new(response: &QuantizationResponse, share: f64) -> Self {
        // With s = q/nu: d(nu·b)/dq = b + (1 − s)·db/ds for quantization noise, which is in q and in nu;
        // b − s·db/ds for a process that is in nu only.
        let (b, slope) = response.factor(share);
        Self {
            quantization: b + (1.0 - share) * slope,
            others: b - share * slope,
        }
    }
}

#[cfg(test)]
#[path = "sampling_tests.rs"]
mod sampling_tests;

#[cfg(test)]
mod shape_tests {
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

#[cfg(test)]
mod implied_tests {
    use super::*;
    use crate::tests::*;

    fn model(values: [f64; 5]) -> Composite {
        Composite::new(vec![
            Process::white(values[0]).unwrap(),
            Process::quantization(values[1]).unwrap(),
            Process::ar1(values[2], values[3]).unwrap(),
            Process::random_walk(values[4]).unwrap(),
        ])
    }

    /// All columns against central differences, robust and classical; the parts of a homogeneous curve make the whole.
    #[test]
    fn gradients_are_the_differences() {
        let values = [1.0, 0.6, 0.95, 0.02, 1e-4];
        let levels: Vec<u32> = (1..=10).collect();
        let tuning = Tuning::new(0.6).unwrap();
        for quantization in [None, Some(*tuning.quantization())] {
            let curve = Curve {
                levels: levels.clone(),
                quantization,
                ..Curve::default()
            };
            let gradient = |level: &u32| -> Vec<f64> {
                let (model, mut scale) = (model(values), Response::PLAIN);
                if let Some(response) = curve.response(*level) {
                    scale = Response::new(response, quantization_share(&model, *level));
                }
                let of_process = |process: &Process| {
                    let scale = match is_quantization(process) {
                        true => scale.quantization,
                        false => scale.others,
                    };
                    let slopes = process.haar_wv_gradient(*level).into_iter();
                    slopes.map(move |slope| slope * scale)
                };
                model.processes.iter().flat_map(of_process).collect()
            };
            let gradients: Vec<Vec<f64>> = levels.iter().map(gradient).collect();
            for p in 0..5 {
                let step = 1e-5 * values[p];
                let shifted = |sign: f64| {
                    let mut there = values;
                    there[p] += sign * step;
                    implied(&model(there), &curve)
                };
                let (up, down) = (shifted(1.0), shifted(-1.0));
                for j in 0..levels.len() {
                    let difference = 0.5 * (up[j] - down[j]) / step;
                    // Rounding of the values over the step, and the step's square.
                    let scale = implied(&model(values), &curve)[j] / values[p];
                    assert_abs_diff_eq!(
                        gradients[j][p],
                        difference,
                        epsilon = 1e-8 * scale + 1e-6 * difference.abs()
                    );
                }
            }
        }
    }
}
