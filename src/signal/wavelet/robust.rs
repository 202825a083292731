//! Robust wavelet variance: an M-estimate of scale with Tukey's biweight, level by level.
//!
//! nu solves mean chi(W/√nu) = a ([Mondal and Percival](crate::bibliography::MondalPercival12),
//! [Guerrier](crate::bibliography::Guerrier21)). The left side falls to zero on both ends, so roots come in
//! pairs; the admissible one is where it *falls* through a. The estimate is consistent for Gaussian coefficients. Pure
//! quantization noise reads 15 % high at efficiency 0.6, by a known factor ([`super::QuantizationResponse`]) for which
//! fits to robust curves correct. The estimate is biased for few coefficients ([`Tuning::bias`]): for white noise it
//! reads 2 ± 0.8 % high where the record has 16 lengths of the scale, 3 ± 1.1 % with 8, 8 ± 1.7 % with 4, 21 ± 3 % with 2
//! (means of 1000 records; the command is in docs/limits.md).

use super::WaveletError;
use super::haar::{BLOCK, Compensated, Pyramid, WIDTH, array, butterflies, pairwise};
use super::interval::edof_eta3;
use crate::minimise::line_minimum;
use multiversion::multiversion;
use statrs::function::erf::erf;
use std::f64::consts::{PI, SQRT_2};

/// Kind of root that a robust variance is at one level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RootStatus {
    /// The falling root.
    Ok,
    /// Quantization moved the root or zeroed half of the coefficients: the classical variance is used.
    Coarse,
    /// No admissible root (too many gross outliers, or too few coefficients): the value that comes closest.
    NoRoot,
    /// All coefficients are zero.
    Zero,
}

crate::named!(RootStatus { Ok = "ok", Coarse = "coarse", NoRoot = "no_root", Zero = "zero" });

/// Robust variance of one level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobustVariance {
    /// nu (units²).
    pub value: f64,
    /// Kind of root.
    pub status: RootStatus,
    /// Share of the coefficients that are zero.
    pub zeros: f64,
}

/// Share of zero coefficients above which quantization biases the robust variance. Exact computation for rounded
/// Gaussian samples (0.15 to 1.5 steps, any offset, differences of up to 512 of them, efficiencies from 0.4): bias ≤
/// 1.3 % below a tenth, up to 50 % at a half.
const MOST_ZEROS: f64 = 0.1;
/// A coefficient below so many standard deviations is zero but for rounding; of Gaussian ones 0.08 % are.
const ZERO: f64 = 1e-3;

impl RobustVariance {
    /// Returns true if the quantization steps of the coefficients are so coarse that a Gaussian
    /// variance does not apply: a tenth of them are zero, and the step is a quarter of their
    /// standard deviation.
    pub fn is_stepped(&self) -> bool {
        self.zeros > MOST_ZEROS
    }

    /// Returns true if the steps leave the robust equation without a root, or move its root away
    /// from the classical variance, which has `edof` degrees of freedom. Finer steps do no harm.
    pub(super) fn is_moved_by_steps(&self, classical: f64, edof: f64, efficiency: f64) -> bool {
        let ratio = (classical / self.value).ln();
        // (1/e − 1)·2/eta is the variance of the logarithm of the two of Gaussian coefficients.
        let sigma = ((1.0 / efficiency - 1.0) * 2.0 / edof).sqrt();
        let is_moved = ratio.abs() > LEAST_MOVE.max(3.0 * sigma);
        self.is_stepped() && (is_moved || self.status == RootStatus::NoRoot)
    }
}

/// Classical over robust, less one, from which the steps of a quantiser are said to move a variance: less hardly moves a fit.
const LEAST_MOVE: f64 = 0.02;

/// Classical and robust wavelet variance at levels 1 … `levels` in one walk.
///
/// # Errors
/// When the signal is too short for the levels, or a sample is not finite.
pub fn classical_and_robust(
    signal: &[f64],
    levels: u32,
    tuning: &Tuning,
) -> Result<(Vec<f64>, Vec<RobustVariance>), WaveletError> {
    let mut pyramid = Pyramid::new(signal, levels)?;
    let mut squares = Vec::new();
    let mut walk = |level: u32| {
        // The M-estimate is scale-equivariant: it is taken of (2m·W)², and the factor goes on once, at the
        // end. `half` is read before the step doubles it.
        let scale = 0.5 / pyramid.half as f64;
        let (sums, half) = (&pyramid.sums, pyramid.half);
        let count = sums.len() - half;
        let begin = IterationStart::new(count, |t| (sums[t + half] - sums[t]).powi(2), tuning);
        squares.resize(count, 0.0);
        let mut first = [0.0; 3];
        // The first sums of the equation in the pass that makes the squares: long records are memory-bound.
        let classical = pyramid.advance(|sums, half| {
            let k = 1.0 / (tuning.c() * tuning.c() * begin.start);
            step_measuring(sums, half, &mut squares, k, &mut first)
        });
        let found = begin.solve(&squares, first, tuning);
        let mut robust = RobustVariance {
            value: found.value * scale * scale,
            ..found
        };
        if robust.is_moved_by_steps(
            classical,
            edof_eta3(signal.len(), level),
            tuning.efficiency(),
        ) {
            robust.status = RootStatus::Coarse;
        }
        (classical, robust)
    };
    Ok((1..=levels).map(&mut walk).unzip())
}

/// The M-estimate of the mean of the given squares of zero-mean Gaussian numbers.
pub(crate) fn m_scale(squares: &[f64], tuning: &Tuning) -> RobustVariance {
    let begin = IterationStart::new(squares.len(), |t| squares[t], tuning);
    let c2 = tuning.c() * tuning.c();
    let first = biweight_sums(squares, 1.0 / (c2 * begin.start));
    begin.solve(squares, first, tuning)
}

/// Starting point of the iteration.
struct IterationStart {
    /// At most 4096 evenly spaced squares; all of a short vector.
    sample: Vec<f64>,
    /// The M-estimate of more of them, or their squared MAD.
    start: f64,
}

impl IterationStart {
    fn new(count: usize, square: impl Fn(usize) -> f64, tuning: &Tuning) -> Self {
        const SIZE: usize = 4096;
        let spaced = |most: usize| -> Vec<f64> {
            let step = count.div_ceil(most).max(1);
            (0..count).step_by(step).map(&square).collect()
        };
        // The start must only be within 25 % of the root: of 4096 independent coefficients the squared MAD is
        // known to 4 %. Anything unusual goes to the search, which takes all of them.
        let sample = spaced(SIZE);
        let mad = squared_mad(&sample);
        // A 64th part knows the root to a hundredth, from which one step leads to 1e-6.
        let part = if count > 16 * SIZE {
            spaced((count / 64).max(SIZE))
        } else {
            Vec::new()
        };
        let equation = Equation {
            squares: &part,
            tuning,
        };
        let nearer = (mad > 0.0 && !part.is_empty())
            .then(|| equation.halley_near(mad, equation.at(mad), 1e-3));
        let start = nearer.flatten().unwrap_or(mad);
        Self { sample, start }
    }

    /// `first`: the sums at the start.
    fn solve(self, squares: &[f64], first: [f64; 3], tuning: &Tuning) -> RobustVariance {
        let equation = Equation { squares, tuning };
        let near = if self.start > 0.0 {
            equation.halley_near(self.start, equation.scaled(first), LAST_OF_HALLEY)
        } else {
            None
        };
        let (value, status) =
            near.map_or_else(|| equation.search(), |value| (value, RootStatus::Ok));
        // Of 4096 a share of a tenth is known to 0.5 %.
        let is_zero = |y: &&f64| **y <= ZERO * ZERO * value;
        let zeros = self.sample.iter().filter(is_zero).count() as f64;
        RobustVariance {
            value,
            status,
            zeros: zeros / self.sample.len() as f64,
        }
    }
}

/// Normal quantile of ¾: the median of |Z|.
const MAD_OF_NORMAL: f64 = 0.674_489_750_196_081_7;
/// Factor from one point of the march to the next.
const STEP: f64 = 1.25;
/// Largest ratio by which the march descends. At efficiency 0.6, g of Gaussian coefficients is
/// positive from 0.069 nu to nu: a start up to sixteen times too high still reaches that region.
const DEPTH: f64 = 16.0;
/// A Newton step this small leaves an error of its square.
const LAST_STEP: f64 = 1e-7;
/// A step of Halley's this small leaves an error of its cube.
const LAST_OF_HALLEY: f64 = 1e-5;

/// g(s) = mean chi(W/√s) − a = 0.
struct Equation<'a> {
    squares: &'a [f64],
    tuning: &'a Tuning,
}

impl Equation<'_> {
    /// g and its first two derivatives with respect to ln s.
    fn at(&self, s: f64) -> [f64; 3] {
        let c2 = self.tuning.c() * self.tuning.c();
        // chi(W/√s) = c² q (1 − q)⁴ with q = W²/(c² s).
        self.scaled(biweight_sums(self.squares, 1.0 / (c2 * s)))
    }

    fn scaled(&self, sums: [f64; 3]) -> [f64; 3] {
        let scale = self.tuning.c() * self.tuning.c() / self.squares.len() as f64;
        let [value, slope, curvature] = sums.map(|sum| sum * scale);
        [value - self.tuning.a(), slope, curvature]
    }

    /// Halley's iteration on ln s, kept within one step of the march from the start, where g is `first`. `None` when anything
    /// about it is unusual.
    fn halley_near(&self, start: f64, first: [f64; 3], last_step: f64) -> Option<f64> {
        let (mut u, mut now) = (0.0_f64, first);
        for _ in 0..8 {
            let [g, slope, curvature] = now;
            let newton = -g / slope;
            let step = newton / (1.0 + 0.5 * newton * curvature / slope);
            u += step;
            // On a rising branch the iteration would go to the spurious root; a far step may have left the
            // branch of the start.
            if slope >= 0.0 || u.abs() > STEP.ln() || !u.is_finite() {
                return None;
            }
            if step.abs() < last_step {
                return Some(start * u.exp());
            }
            now = self.at(start * u.exp());
        }
        None
    }

    /// The march from the squared MAD: up while g > 0; else down until g > 0, then to that region's falling
    /// edge; if nothing is positive downward, up to a positive region and on to its falling edge (where nearly half of the
    /// coefficients are many times as large as the others).
    fn search(&self) -> (f64, RootStatus) {
        let mad = squared_mad(self.squares);
        let status = if mad > 0.0 {
            RootStatus::Ok
        } else {
            RootStatus::Coarse
        };
        let mean = self.squares.iter().sum::<f64>() / self.squares.len() as f64;
        // More than half of the coefficients are exactly zero: the MAD says nothing, and the mean is positive
        // unless all are zero.
        let start = if mad > 0.0 { mad } else { mean };
        if mean <= 0.0 {
            return (0.0, RootStatus::Zero);
        }
        let mut s = start;
        if self.at(s)[0] > 0.0 {
            // Ends: chi(r) ≤ r², so g(s) ≤ mean/s − a.
            while self.at(s * STEP)[0] > 0.0 {
                s *= STEP;
            }
            return (self.falling_edge(s, s * STEP), status);
        }
        let (mut best, mut best_g) = (s, f64::NEG_INFINITY);
        while s > start / DEPTH {
            s /= STEP;
            let g = self.at(s)[0];
            if g > 0.0 {
                return (self.falling_edge(s, s * STEP), status);
            }
            if g > best_g {
                (best, best_g) = (s, g);
            }
        }
        // Outliers narrow the positive region (a factor of 14 for Gaussian coefficients): one narrower than a
        // step may have been marched over.
        let (top, g) = self.local_maximum(best);
        if g > 0.0 {
            return (self.falling_edge(top, best * STEP), status);
        }
        match self.root_above(start, mean) {
            Some(value) => (value, status),
            None => (top, RootStatus::NoRoot),
        }
    }

    /// The falling edge of the first positive region above a start.
    fn root_above(&self, start: f64, mean: f64) -> Option<f64> {
        // Ends: chi(r) ≤ r², so g(s) ≤ mean/s − a, which is negative beyond mean/a.
        let mut s = start;
        while self.at(s)[0] <= 0.0 {
            s *= STEP;
            if s >= STEP * mean / self.tuning.a() {
                return None;
            }
        }
        while self.at(s * STEP)[0] > 0.0 {
            s *= STEP;
        }
        Some(self.falling_edge(s, s * STEP))
    }

    /// The root in (low, high) with g(low) > 0 ≥ g(high): Newton's iteration on ln s, halving when it leaves
    /// the bracket.
    fn falling_edge(&self, low: f64, high: f64) -> f64 {
        let (mut low, mut high) = (low.ln(), high.ln());
        let mut u = 0.5 * (low + high);
        for _ in 0..200 {
            let [g, slope, _] = self.at(u.exp());
            // g > 0 lies on the left of a falling root.
            if g > 0.0 {
                low = u;
            } else {
                high = u;
            }
            let newton = u - g / slope;
            let inside = newton > low && newton < high;
            let next = if inside { newton } else { 0.5 * (low + high) };
            let last = (inside && (next - u).abs() < LAST_STEP) || high - low < 1e-14;
            u = next;
            if last {
                break;
            }
        }
        u.exp()
    }

    /// Largest g within one step of the search around s, by golden section.
    fn local_maximum(&self, s: f64) -> (f64, f64) {
        // g is flat at its maximum: 1e-7 of ln s is 1e-14 of g, and a comparison of two g tells no more.
        let (u, step) = (s.ln(), STEP.ln());
        let top = line_minimum(u - step, u + step, 1e-7, |u| -self.at(u.exp())[0]).exp();
        (top, self.at(top)[0])
    }
}

/// Adds Σ q(1 − q)₊⁴ with q = k·y over a block of squares y, and its derivatives with respect to −ln k, Σ q(1 − q)₊³(5q − 1)
/// and Σ q(1 − q)₊²(25q² − 14q + 1). As k = 1/(c² s), those are the derivatives with respect to ln s.
#[inline(always)]
fn add_biweights(sums: &mut [Compensated; 3], block: &[f64], k: f64) {
    #[inline(always)]
    fn terms(q: f64) -> [f64; 3] {
        // A select, not a branch: rejected coefficients add 0, and the loop stays a vector loop.
        let z = if q < 1.0 { 1.0 - q } else { 0.0 };
        let square = q * z * z;
        let [value, slope] = [z * z, z * (5.0 * q - 1.0)];
        [value, slope, (25.0 * q - 14.0) * q + 1.0].map(|factor| square * factor)
    }
    let [mut values, mut slopes, mut curvatures] = [[0.0; WIDTH]; 3];
    let chunks = block.chunks_exact(WIDTH);
    let rest = chunks.remainder();
    for chunk in chunks {
        let y: [f64; WIDTH] = array(chunk);
        for i in 0..WIDTH {
            let [value, slope, curvature] = terms(k * y[i]);
            values[i] += value;
            slopes[i] += slope;
            curvatures[i] += curvature;
        }
    }
    for (i, y) in rest.iter().enumerate() {
        let [value, slope, curvature] = terms(k * y);
        values[i] += value;
        slopes[i] += slope;
        curvatures[i] += curvature;
    }
    for (sum, lanes) in sums.iter_mut().zip([values, slopes, curvatures]) {
        sum.add(pairwise(&lanes));
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn biweight_sums(squares: &[f64], k: f64) -> [f64; 3] {
    let mut sums: [Compensated; 3] = Default::default();
    for block in squares.chunks(BLOCK) {
        add_biweights(&mut sums, block, k);
    }
    sums.map(|sum| sum.value())
}

/// A step of the pyramid, its squares, and their sums while a block of them is in the cache.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn step_measuring(
    sums: &mut [f64],
    half: usize,
    squares: &mut [f64],
    k: f64,
    of_squares: &mut [f64; 3],
) -> f64 {
    let mut total = Compensated::default();
    let mut biweights: [Compensated; 3] = Default::default();
    let mut from = 0;
    for block in squares.chunks_mut(BLOCK) {
        let own = &mut sums[from..from + block.len() + half];
        total.add(butterflies(own, half, |t, values| {
            block[t..t + values.len()].copy_from_slice(values)
        }));
        add_biweights(&mut biweights, block, k);
        from += block.len();
    }
    *of_squares = biweights.map(|sum| sum.value());
    total.value()
}

/// (median |W|/0.6745)².
fn squared_mad(squares: &[f64]) -> f64 {
    let mut copy = squares.to_vec();
    let middle = copy.len() / 2;
    let (below, &mut upper, _) = copy.select_nth_unstable_by(middle, f64::total_cmp);
    // The median of |W|, not the root of the median of W²: they differ for an even number.
    let root = if squares.len() % 2 == 1 {
        upper.sqrt()
    } else {
        let lower = below.iter().copied().fold(0.0, f64::max);
        0.5 * (lower.sqrt() + upper.sqrt())
    };
    (root / MAD_OF_NORMAL).powi(2)
}

// Response of the robust wavelet variance to quantization noise.
//
// The Haar coefficients of quantization noise are (U_t − 2 U_{t−m} + U_{t−2m})·√(12 Q²)/(2m) at every scale, U uniform:
// their law has no tails, and the M-estimate that is consistent for Gaussian coefficients reads it high. Of a sum of
// quantization noise and Gaussian noise, whose `share` of the variance is quantization noise, it reads b(share) times the
// variance: at efficiency 0.6, 1.009 at a share of ¼, 1.037 at ½, 1.085 at ¾, 1.154 at 1.
//
// b and the efficiency are integrals over the law of √(1 − share)·Z + √share·Y, Z standard normal, Y the second difference
// of uniform numbers at unit variance. Both depart from the Gaussian values with the square of the share (through the
// fourth cumulant), so what is tabulated is that departure over share².

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
        let law = MixtureDistribution::new();
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
    pub fn factor(&self, share: f64) -> (f64, f64) {
        departure(&self.factor, share)
    }

    /// Degrees of freedom of the robust wavelet variance over those it has of Gaussian coefficients as correlated as these.
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
struct MixtureDistribution {
    normal: Vec<(f64, f64)>,
    second_difference: Vec<(f64, f64)>,
}

impl MixtureDistribution {
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

// Tuning of the robust wavelet variance: Tukey's biweight constant for a wanted efficiency.
//
// chi(r) = r²(1 − (r/c)²)⁴ on |r| ≤ c. With Z standard normal: a = E chi(Z), M = E\[Z² chi(Z)\] − a,
// Q = E chi(Z)² − a², efficiency = M²/(2Q) ([Mondal and Percival](crate::bibliography::MondalPercival12)). The R packages wv, gmwm and
// simts have the last but one term of Q with the wrong sign: their "0.6" is c = 4.973 and an efficiency of 0.727.

/// From this c on the efficiency grows with c.
const BRANCH: f64 = 2.6;

/// The constants of the robust estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuning {
    efficiency: f64,
    c: f64,
    a: f64,
    bias: f64,
    quantization: QuantizationResponse,
}

impl Default for Tuning {
    fn default() -> Self {
        Self::new(Self::DEFAULT_EFFICIENCY).expect("range")
    }
}

impl Tuning {
    /// The usual efficiency: for the same scatter a record must be 1/0.6 times as long as with the classical variance, and
    /// up to 26 % of gross outliers leave the equation a root.
    pub const DEFAULT_EFFICIENCY: f64 = 0.6;
    /// Efficiencies that are taken, of c = 3.5 to 11.8. Below, more than two thirds of a record would be given away; above,
    /// hardly an outlier would be rejected.
    pub const EFFICIENCIES: (f64, f64) = (0.3, 0.99);

    /// For a wanted efficiency at the Gaussian model, 0.3 to 0.99.
    ///
    /// # Errors
    /// When the efficiency is out of this range.
    pub fn new(efficiency: f64) -> Result<Self, WaveletError> {
        if !(Self::EFFICIENCIES.0..=Self::EFFICIENCIES.1).contains(&efficiency) {
            return Err(WaveletError::Efficiency(efficiency));
        }
        // The efficiency is 0.014 at c = 2.6 and 0.9999 at c = 40: the range requested lies between.
        let (mut low, mut high) = (BRANCH, 40.0);
        // Halved until no number lies between.
        while let middle = 0.5 * (low + high)
            && low < middle
            && middle < high
        {
            if TruncatedMoments::new(middle).efficiency() < efficiency {
                low = middle;
            } else {
                high = middle;
            }
        }
        let moments = TruncatedMoments::new(high);
        let a = moments.chi();
        Ok(Self {
            efficiency: moments.efficiency(),
            c: high,
            a,
            bias: moments.bias(),
            quantization: QuantizationResponse::new(high, a),
        })
    }

    /// Rejection point: coefficients beyond c standard deviations have no influence.
    pub const fn c(&self) -> f64 {
        self.c
    }

    /// E chi(Z), the consistency constant.
    pub const fn a(&self) -> f64 {
        self.a
    }

    /// Relative bias of the variance of few Gaussian coefficients times its degrees of freedom (it reads
    /// high): 0.295 at efficiency 0.6, 0 for the classical variance. To second order in the estimating
    /// equation it is 1 + 2 cov(chi, chi')/var chi − E chi''/E chi', derivatives with respect to ln s of
    /// chi(W/√s).
    pub const fn bias(&self) -> f64 {
        self.bias
    }

    /// Response of the robust wavelet variance to quantization noise.
    pub const fn quantization(&self) -> &QuantizationResponse {
        &self.quantization
    }

    /// True efficiency at the Gaussian model, whatever the convention says it is.
    pub const fn efficiency(&self) -> f64 {
        self.efficiency
    }
}

/// E\[Z^2k; |Z| ≤ c\], k = 0 … 10.
struct TruncatedMoments {
    c: f64,
    even: [f64; 11],
}

impl TruncatedMoments {
    fn new(c: f64) -> Self {
        let mut even = [erf(c / SQRT_2); 11];
        // By parts: E[Z^2k; |Z| ≤ c] = (2k − 1) E[Z^(2k−2); |Z| ≤ c] − 2 c^(2k−1) φ(c).
        let mut boundary = 2.0 * c * (-0.5 * c * c).exp() / (2.0 * PI).sqrt();
        for k in 1..=10 {
            even[k] = f64::from(2 * k as u8 - 1) * even[k - 1] - boundary;
            boundary *= c * c;
        }
        Self { c, even }
    }

    /// E\[Z^2p (1 − Z²/c²)^n\].
    fn bump(&self, p: usize, n: usize) -> f64 {
        // Binomial theorem: the sum of (n choose i)(−1)^i c^(−2i) E[Z^(2p+2i)].
        let (mut binomial, mut power, mut sum) = (1.0, 1.0, 0.0);
        for i in 0..=n {
            sum += binomial * power * self.even[p + i];
            binomial *= -((n - i) as f64) / (i + 1) as f64;
            power /= self.c * self.c;
        }
        sum
    }

    fn chi(&self) -> f64 {
        self.bump(1, 4)
    }

    fn bias(&self) -> f64 {
        let c2 = self.c * self.c;
        // chi = r² y⁴, chi' = −r² y⁴ + 4 r⁴ y³/c², chi'' = r² y⁴ − 12 r⁴ y³/c² + 12 r⁶ y²/c⁴ with y = 1 − r²/c².
        let first = 4.0 * self.bump(2, 3) / c2 - self.chi();
        let second = self.chi() - 12.0 * self.bump(2, 3) / c2 + 12.0 * self.bump(3, 2) / (c2 * c2);
        let variance = self.bump(2, 8) - self.chi() * self.chi();
        // chi·chi' = 4 r⁶ y⁷/c² − r⁴ y⁸.
        let covariance = 4.0 * self.bump(3, 7) / c2 - self.bump(2, 8) - self.chi() * first;
        // E δ of δ = ln(nu_hat/nu), times eta, is the rest; the 1 is that of E(e^δ − 1) = E δ + var(δ)/2 with
        // var δ = 2/eta.
        1.0 + 2.0 * covariance / variance - second / first
    }

    fn efficiency(&self) -> f64 {
        let a = self.chi();
        let m = self.bump(2, 4) - a;
        let q = self.bump(2, 8) - a * a;
        m * m / (2.0 * q)
    }
}

#[cfg(test)]
#[path = "robust_tests.rs"]
mod robust_tests;

#[cfg(test)]
mod quantization_tests {
    use super::m_scale;
    use crate::rng::Generator;
    use crate::wavelet::Tuning;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn tuning() -> Tuning {
        Tuning::new(0.6).unwrap()
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
            let t = Tuning::new(efficiency).unwrap();
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

#[cfg(test)]
mod tuning_tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Published by the R package wv, as its source computes them.
    #[test]
    fn constants_of_the_package_wv() {
        let its = TruncatedMoments::new(4.973362);
        assert_relative_eq!(its.chi(), 0.636724, max_relative = 1e-6);
        assert_relative_eq!(its.efficiency(), 0.727, max_relative = 1e-3);
    }

    #[test]
    fn efficiencies_without_a_constant_are_refused() {
        for efficiency in [f64::NAN, 0.0, 0.29, 0.995, 1.0, 60.0] {
            assert!(Tuning::new(efficiency).is_err(), "{efficiency}");
        }
        for efficiency in [0.3, 0.99] {
            let t = Tuning::new(efficiency).unwrap();
            assert_relative_eq!(t.efficiency(), efficiency, max_relative = 1e-12);
        }
    }
}
