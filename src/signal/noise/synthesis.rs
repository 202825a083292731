//! Synthesis: draws the noise of one axis from its model, block by block, for one run or for eight side by side.

use super::{Ar1Bank, Composite, Process, ProcessKind};
use crate::lanes::{
    Bits, Kernel, LANES, Lanes, Level, Real, Wide, dispatch, horner, sinc_cos_of_square,
};
use crate::rng::{Generator, LaneGenerator, StreamKey};
use rand::Rng;
use std::f64::consts::{FRAC_PI_2, LN_2};

/// The noise of one axis as a stream of samples: of one run, or of eight ([`Synthesizer::lanes`]), each of which has the
/// numbers that it has alone.
///
/// Every process of the sum draws from a stream of its own, of its label after the key's process, so that adding or removing one changes no
/// other's numbers. The output does not depend on the sizes of the blocks it is asked for.
///
/// FN is a sum of AR1 ([`Ar1Bank::FINE`]). AR1 and GM start stationary; MA1 and QN have a past; RW starts at 0 (its first sample is its first
/// increment) and DR at one slope (X_t = slope·t, t = 1, 2, …).
#[derive(Debug, Clone)]
pub struct Synthesizer<S: Streams = Generator> {
    direct: Vec<Direct<S>>,
    recursive: Vec<Recursive<S>>,
    /// Samples made together, and how many of them have been handed out.
    block: [S::Sample; BLOCK],
    used: usize,
}

/// Samples made at a time, an even number: every process fills a block, then the blocks are summed.
const BLOCK: usize = 64;
/// Recursions that advance together: each step waits for the last one of its own chain, and three chains side
/// by side keep the processor busy meanwhile.
const TOGETHER: usize = 3;

impl Synthesizer {
    /// The noise of one axis (units of the model) at its beginning. The key names seed, scenario, run and
    /// axis; its `process` is replaced by the label of each summand ([`Composite::labels`]).
    pub fn new(noise: &Composite, key: StreamKey<'_>) -> Self {
        Self::of(&[(noise, key)])
    }
}

impl Synthesizer<LaneGenerator> {
    /// The noise of at most eight runs; the composites have the same processes, with parameters of their own. Lanes
    /// beyond the runs are zero.
    pub fn lanes(runs: &[(&Composite, StreamKey<'_>)]) -> Self {
        Self::of(runs)
    }
}

impl<S: Streams> Synthesizer<S> {
    fn of(runs: &[(&Composite, StreamKey<'_>)]) -> Self {
        let mut synthesizer = Self {
            direct: Vec::new(),
            recursive: Vec::new(),
            block: [S::Sample::from(0.0); BLOCK],
            used: BLOCK,
        };
        let Some((first, StreamKey { process, .. })) = runs.first() else {
            return synthesizer;
        };
        for (i, label) in first.labels().into_iter().enumerate() {
            let parts: Vec<Vec<Process>> = runs
                .iter()
                .map(|(noise, _)| noise.processes[i].parts(Ar1Bank::FINE))
                .collect();
            for part in 0..parts[0].len() {
                let process = &match parts[0].len() {
                    1 => format!("{process}{label}"),
                    _ => format!("{process}{label}.{part}"),
                };
                let keys = runs.iter().map(|(_, key)| StreamKey { process, ..*key });
                let of_runs: Vec<&Process> = parts.iter().map(|p| &p[part]).collect();
                synthesizer.add(&of_runs, S::new(&keys.collect::<Vec<_>>()));
            }
        }
        synthesizer
    }

    /// Adds a process, unless it is identically zero.
    fn add(&mut self, runs: &[&Process], mut streams: S) {
        if runs.iter().all(|process| process.amplitude() == 0.0) {
            return;
        }
        let of = |value: &dyn Fn(&Process) -> f64| {
            S::sample(|lane| runs.get(lane).map_or(0.0, |process| value(process)))
        };
        let size = of(&|p| p.amplitude().abs().sqrt());
        if runs[0].recursion().is_some() {
            let recursion = |p: &Process, i: usize| p.recursion().map_or(0.0, |r| r[i]);
            // X_0 from the stationary law, so that X_1 has it too.
            let is_stationary = runs.iter().any(|p| recursion(p, 2) > 0.0);
            let initial = of(&|p| recursion(p, 2).sqrt());
            let last = if is_stationary {
                initial * first_of(&mut streams, UnitDistribution::Normal)
            } else {
                initial
            };
            return self.recursive.push(Recursive {
                phi: of(&|p| recursion(p, 0)),
                sigma: of(&|p| recursion(p, 1).sqrt()),
                last,
                streams,
            });
        }
        let zero = S::Sample::from(0.0);
        let (filter, size, last) = match runs[0].kind() {
            ProcessKind::White => (ProcessFilter::White, size, zero),
            ProcessKind::Drift => (ProcessFilter::Drift, of(&Process::amplitude), zero),
            // The value before the first one is drawn too, so that the first sample has the variance 2 Q² of
            // all others.
            ProcessKind::Quantization => {
                let step = of(&|p| (12.0 * p.amplitude()).sqrt());
                let last = first_of(&mut streams, UnitDistribution::Uniform);
                (ProcessFilter::Quantization, step, last)
            }
            _ => {
                let last = size * first_of(&mut streams, UnitDistribution::Normal);
                (ProcessFilter::Ma1(of(&Process::shape)), size, last)
            }
        };
        self.direct.push(Direct {
            filter,
            size,
            last,
            streams,
        });
    }

    /// The next [`BLOCK`] samples.
    fn make_block(&mut self) {
        self.block = [S::Sample::from(0.0); BLOCK];
        dispatch(Level::best(), MakeBlock(self));
        self.used = 0;
    }

    /// Overwrites `out` with the next samples.
    pub fn fill(&mut self, mut out: &mut [S::Sample]) {
        while !out.is_empty() {
            if self.used == BLOCK {
                self.make_block();
            }
            let n = out.len().min(BLOCK - self.used);
            let (now, later) = out.split_at_mut(n);
            now.copy_from_slice(&self.block[self.used..self.used + n]);
            self.used += n;
            out = later;
        }
    }
}

struct MakeBlock<'a, S: Streams>(&'a mut Synthesizer<S>);

impl<S: Streams> Kernel for MakeBlock<'_, S> {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        let Synthesizer {
            direct,
            recursive,
            block,
            ..
        } = self.0;
        for one in direct {
            one.add_to::<W>(block);
        }
        let (groups, rest) = recursive.as_chunks_mut::<TOGETHER>();
        for group in groups {
            add_recursive::<W, S, TOGETHER>(group, block);
        }
        for one in rest {
            add_recursive::<W, S, 1>(std::array::from_mut(one), block);
        }
    }
}

/// A process whose samples are made of fresh numbers and at most one past one.
#[derive(Debug, Clone)]
struct Direct<S: Streams> {
    filter: ProcessFilter<S::Sample>,
    /// Standard deviation of the fresh numbers; the step of a quantizer, the slope of a drift.
    size: S::Sample,
    /// The past number (QN, MA1) or time (DR).
    last: S::Sample,
    streams: S,
}

#[derive(Debug, Clone, Copy)]
enum ProcessFilter<T> {
    White,
    Quantization,
    Drift,
    /// With its coefficient theta.
    Ma1(T),
}

impl<S: Streams> Direct<S> {
    /// Adds the next samples to `block`.
    #[inline(always)]
    fn add_to<W: Wide>(&mut self, block: &mut [S::Sample; BLOCK]) {
        let mut fresh = [S::Sample::from(0.0); BLOCK];
        match self.filter {
            ProcessFilter::Drift => {}
            ProcessFilter::Quantization => self
                .streams
                .fill::<W>(UnitDistribution::Uniform, &mut fresh),
            ProcessFilter::White | ProcessFilter::Ma1(_) => {
                self.streams.fill::<W>(UnitDistribution::Normal, &mut fresh)
            }
        }
        let (size, mut last) = (S::load::<W>(&self.size), S::load::<W>(&self.last));
        for (x, fresh) in block.iter_mut().zip(&fresh) {
            let fresh = S::load::<W>(fresh);
            let more = match &self.filter {
                ProcessFilter::White => size * fresh,
                ProcessFilter::Quantization => {
                    let step = size * (fresh - last);
                    last = fresh;
                    step
                }
                ProcessFilter::Drift => {
                    last = last + 1.0;
                    size * last
                }
                ProcessFilter::Ma1(theta) => {
                    let w = size * fresh;
                    let sum = w + S::load::<W>(theta) * last;
                    last = w;
                    sum
                }
            };
            S::store(S::load::<W>(x) + more, x);
        }
        S::store(last, &mut self.last);
    }
}

/// An AR1, or a random walk (phi = 1).
#[derive(Debug, Clone)]
struct Recursive<S: Streams> {
    phi: S::Sample,
    sigma: S::Sample,
    last: S::Sample,
    streams: S,
}

/// Adds the next samples of N recursions to `block`.
#[inline(always)]
fn add_recursive<W: Wide, S: Streams, const N: usize>(
    group: &mut [Recursive<S>; N],
    block: &mut [S::Sample; BLOCK],
) {
    let zero = S::load::<W>(&S::Sample::from(0.0));
    let mut fresh = [[S::Sample::from(0.0); BLOCK]; N];
    let (mut phi, mut sigma, mut last) = ([zero; N], [zero; N], [zero; N]);
    for i in 0..N {
        group[i]
            .streams
            .fill::<W>(UnitDistribution::Normal, &mut fresh[i]);
        phi[i] = S::load(&group[i].phi);
        sigma[i] = S::load(&group[i].sigma);
        last[i] = S::load(&group[i].last);
    }
    for k in 0..BLOCK {
        let mut sum = S::load::<W>(&block[k]);
        for i in 0..N {
            last[i] = phi[i] * last[i] + sigma[i] * S::load(&fresh[i][k]);
            // In the order of the list, however it is grouped: the rounding of the sum does not depend on
            // TOGETHER.
            sum += last[i];
        }
        S::store(sum, &mut block[k]);
    }
    for i in 0..N {
        S::store(last[i], &mut group[i].last);
    }
}

// Fresh numbers: uniform ones, and normal ones by [Box and Muller](crate::bibliography::BoxMuller58)'s transform, whose logarithm, sine and cosine are
// polynomials. It has no branch, so that eight numbers are made together; the ziggurat, which has, takes three times
// as long a number.

/// Distribution of fresh numbers.
#[derive(Debug, Clone, Copy)]
pub enum UnitDistribution {
    /// On [0, 1), multiples of 2⁻⁵².
    Uniform,
    /// Mean 0 and variance 1.
    Normal,
}

/// The streams of a process: one ([`Generator`]), or eight side by side ([`LaneGenerator`]).
pub trait Streams: std::fmt::Debug + Clone {
    /// A number of each stream.
    type Sample: Real + std::fmt::Debug;
    /// The recursion in a register.
    type Register<W: Wide>: Real;
    /// The streams at their beginning.
    fn new(keys: &[StreamKey<'_>]) -> Self;
    /// A value for each lane.
    fn sample(of_lane: impl Fn(usize) -> f64) -> Self::Sample;
    /// Into a register.
    fn load<W: Wide>(sample: &Self::Sample) -> Self::Register<W>;
    /// From a register.
    fn store<W: Wide>(register: Self::Register<W>, sample: &mut Self::Sample);
    /// The next numbers, which are even in number if normal.
    fn fill<W: Wide>(&mut self, law: UnitDistribution, out: &mut [Self::Sample]);
}

/// The first number of streams; a pair is drawn for a normal one.
fn first_of<S: Streams>(streams: &mut S, law: UnitDistribution) -> S::Sample {
    struct First<'a, S>(&'a mut S, UnitDistribution);
    impl<S: Streams> Kernel for First<'_, S> {
        type Output = S::Sample;
        #[inline(always)]
        fn run<W: Wide>(self) -> S::Sample {
            let mut pair = [S::Sample::from(0.0); 2];
            let n = if matches!(self.1, UnitDistribution::Normal) {
                2
            } else {
                1
            };
            self.0.fill::<W>(self.1, &mut pair[..n]);
            pair[0]
        }
    }
    dispatch(Level::best(), First(streams, law))
}

impl Streams for LaneGenerator {
    type Sample = Lanes;
    type Register<W: Wide> = W;
    fn new(keys: &[StreamKey<'_>]) -> Self {
        Self::new(keys)
    }
    fn sample(of_lane: impl Fn(usize) -> f64) -> Lanes {
        Lanes(std::array::from_fn(of_lane))
    }
    #[inline(always)]
    fn load<W: Wide>(sample: &Lanes) -> W {
        W::load(sample)
    }
    #[inline(always)]
    fn store<W: Wide>(register: W, sample: &mut Lanes) {
        register.store(sample);
    }
    #[inline(always)]
    fn fill<W: Wide>(&mut self, law: UnitDistribution, out: &mut [Lanes]) {
        let mut generators = self.load::<W::Bits>();
        match law {
            UnitDistribution::Uniform => {
                for x in out {
                    uniform::<W>(generators.draw()).store(x);
                }
            }
            UnitDistribution::Normal => {
                for [a, b] in out.as_chunks_mut::<2>().0 {
                    let [x, y] = normals::<W>(generators.draw(), generators.draw());
                    x.store(a);
                    y.store(b);
                }
            }
        }
        LaneGenerator::store(self, generators);
    }
}

impl Streams for Generator {
    type Sample = f64;
    type Register<W: Wide> = f64;
    fn new(keys: &[StreamKey<'_>]) -> Self {
        keys[0].generator()
    }
    fn sample(of_lane: impl Fn(usize) -> f64) -> f64 {
        of_lane(0)
    }
    #[inline(always)]
    fn load<W: Wide>(sample: &f64) -> f64 {
        *sample
    }
    #[inline(always)]
    fn store<W: Wide>(register: f64, sample: &mut f64) {
        *sample = register;
    }
    /// Eight numbers or eight pairs of the one stream at a time; a block's are no others.
    #[inline(always)]
    fn fill<W: Wide>(&mut self, law: UnitDistribution, out: &mut [f64]) {
        match law {
            UnitDistribution::Uniform => {
                for x in out {
                    *x = uniform::<Lanes>([self.next_u64(); LANES])[0];
                }
            }
            UnitDistribution::Normal => {
                for pairs in out.chunks_mut(2 * LANES) {
                    let (mut radius, mut angle) = ([0; LANES], [0; LANES]);
                    for i in 0..pairs.len() / 2 {
                        (radius[i], angle[i]) = (self.next_u64(), self.next_u64());
                    }
                    let [x, y] = normals::<W>(W::Bits::load(&radius), W::Bits::load(&angle));
                    let (mut a, mut b) = (Lanes::ZERO, Lanes::ZERO);
                    x.store(&mut a);
                    y.store(&mut b);
                    for (i, pair) in pairs.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                        *pair = [a[i], b[i]];
                    }
                }
            }
        }
    }
}

/// The bits of 1.0: with 52 bits below them a number on [1, 2).
const ONE: u64 = 0x3ff0_0000_0000_0000;

/// A uniform number on [0, 1) from the upper 52 bits.
#[inline(always)]
fn uniform<W: Wide>(bits: W::Bits) -> W {
    W::from_bits(bits.shr(12).or(W::Bits::splat(ONE))) - W::from(1.0)
}

/// Two independent standard normal numbers: r cos a and r sin a with r² = −2 ln u.
#[inline(always)]
fn normals<W: Wide>(radius: W::Bits, angle: W::Bits) -> [W; 2] {
    // 1 − u is in (0, 1]: its logarithm is finite.
    let r = (ln_of_fraction(W::from(1.0) - uniform::<W>(radius)) * -2.0).sqrt();
    // An angle within an eighth of a turn to both sides of the axis; three of the bits that it leaves over choose the axis.
    let x = (uniform::<W>(angle) - W::from(0.5)) * FRAC_PI_2;
    let (sinc, cos) = sinc_cos_of_square(x * x);
    let (c, s) = (cos.to_bits(), (x * sinc).to_bits());
    // All ones where the lowest bit is 0.
    let stays = angle.and(W::Bits::splat(1)).add(W::Bits::splat(u64::MAX));
    let exchanged = c.xor(s).and(stays);
    let sign = |bits: W::Bits| bits.and(W::Bits::splat(1)).shl(63);
    let c = W::from_bits(c.xor(exchanged).xor(sign(angle.shr(1))));
    let s = W::from_bits(s.xor(exchanged).xor(sign(angle.shr(2))));
    [r * c, r * s]
}

/// ln x for 0 < x ≤ 1, x normal: exponent and mantissa m on [√½, √2), and ln m = 2 artanh((m − 1)/(m + 1)) as a series.
#[inline(always)]
fn ln_of_fraction<W: Wide>(x: W) -> W {
    const ROOT_HALF: u64 = 0x3fe6_a09e_0000_0000; // upper half of the bits of √½
    const MANTISSA: u64 = (1 << 52) - 1;
    /// 2/(2k + 1): with z ≤ 0.0295 the first term left out is 4e-17 of the sum.
    const ARTANH: [f64; 10] = [
        2.0 / 19.0,
        2.0 / 17.0,
        2.0 / 15.0,
        2.0 / 13.0,
        2.0 / 11.0,
        2.0 / 9.0,
        2.0 / 7.0,
        2.0 / 5.0,
        2.0 / 3.0,
        2.0,
    ];
    // Counted from √½, so that exponents change there and not at 1.
    let bits = x.to_bits().add(W::Bits::splat(ONE - ROOT_HALF));
    let mantissa = bits
        .and(W::Bits::splat(MANTISSA))
        .add(W::Bits::splat(ROOT_HALF));
    // An integer below 2^52 in the mantissa of 2^52 is that number, exactly.
    const TWO_52: f64 = 4_503_599_627_370_496.0;
    let exponent = W::from_bits(bits.shr(52).or(W::Bits::splat(TWO_52.to_bits())));
    let exponent = exponent - W::from(TWO_52 + 1023.0);
    let m = W::from_bits(mantissa);
    let s = (m - W::from(1.0)) / (m + 1.0);
    exponent.mul_add(W::from(LN_2), s * horner(&ARTANH, s * s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Process;
    use approx::assert_abs_diff_eq;

    const KEY: StreamKey<'_> = StreamKey {
        seed: 7,
        scenario: "",
        run: 0,
        source: "accel.x",
        process: "",
    };
    /// Standard deviations that a statistic may be off: 2·Φ(−5) = 6e-7 a comparison.
    const SIGMAS: f64 = 5.0;

    fn white() -> Process {
        Process::white(4.0).unwrap()
    }
    fn quantization() -> Process {
        Process::quantization(0.5).unwrap()
    }
    fn ar1(phi: f64) -> Process {
        Process::ar1(phi, 2.0).unwrap()
    }
    fn walk() -> Process {
        Process::random_walk(0.25).unwrap()
    }
    fn ma1() -> Process {
        Process::ma1(0.6, 1.5).unwrap()
    }

    fn draw(processes: Vec<Process>, key: StreamKey<'_>, n: usize) -> Vec<f64> {
        let mut out = vec![f64::NAN; n];
        Synthesizer::new(&Composite::new(processes), key).fill(&mut out);
        out
    }

    /// Mean of x_t x_{t+k}: the processes have mean zero by construction.
    fn autocovariance(x: &[f64], k: usize) -> f64 {
        let n = x.len() - k;
        x[..n].iter().zip(&x[k..]).map(|(a, b)| a * b).sum::<f64>() / n as f64
    }

    /// Compares sample autocovariances with `gamma(k)`, within Bartlett's standard deviation:
    /// var ĉ_k = Σ_m (γ_m² + γ_{m+k} γ_{m−k}) / n for a Gaussian linear process; the excess kurtosis of a
    /// uniform innovation is negative and only lowers it.
    fn assert_autocovariance(process: Process, gamma: impl Fn(i64) -> f64) {
        let x = draw(vec![process], KEY, 1 << 20);
        for k in [0_i64, 1, 2, 5, 20] {
            let spread: f64 = (-2000..=2000)
                .map(|m| gamma(m).powi(2) + gamma(m + k) * gamma(m - k))
                .sum();
            let bound = SIGMAS * (spread / x.len() as f64).sqrt();
            let error = autocovariance(&x, k as usize) - gamma(k);
            assert!(
                error.abs() < bound,
                "{process:?}, lag {k}: off by {error}, bound {bound}"
            );
        }
    }

    #[test]
    fn autocovariances_are_those_of_the_processes() {
        assert_autocovariance(white(), |k| if k == 0 { 4.0 } else { 0.0 });
        assert_autocovariance(quantization(), |k| {
            [1.0, -0.5, 0.0][k.unsigned_abs().min(2) as usize]
        });
        for phi in [0.98, 0.3, -0.7] {
            assert_autocovariance(ar1(phi), |k| {
                phi.powi(k.unsigned_abs() as i32) * 2.0 / (1.0 - phi * phi)
            });
        }
        let gamma_ma = [1.5 * 1.36, 1.5 * 0.6, 0.0];
        assert_autocovariance(ma1(), |k| gamma_ma[k.unsigned_abs().min(2) as usize]);
        let gm = Process::gauss_markov(2.0, 3.0, 100.0).unwrap();
        assert_autocovariance(gm, |k| 3.0 * (-2.0 * k.abs() as f64 / 100.0).exp());
    }

    /// Variance over many runs of the sample at a given time; its standard deviation is σ²√(2/R).
    fn assert_variance_at(process: Process, t: usize, expected: f64) {
        const RUNS: u64 = 20_000;
        let last_value = |run| draw(vec![process], StreamKey { run, ..KEY }, t)[t - 1];
        let variance = (0..RUNS).map(|run| last_value(run).powi(2)).sum::<f64>() / RUNS as f64;
        let bound = SIGMAS * expected * (2.0 / RUNS as f64).sqrt();
        assert!(
            (variance - expected).abs() < bound,
            "{process:?} at {t}: {variance}, expected {expected}"
        );
    }

    #[test]
    fn starts_are_stationary_where_the_process_is_and_zero_where_it_walks() {
        let stationary = 2.0 / (1.0 - 0.999_f64.powi(2));
        assert_variance_at(ar1(0.999), 1, stationary);
        assert_variance_at(ar1(0.999), 50, stationary);
        assert_variance_at(quantization(), 1, 1.0);
        assert_variance_at(ma1(), 1, 1.5 * 1.36);
        assert_variance_at(walk(), 1, 0.25);
        assert_variance_at(walk(), 64, 64.0 * 0.25);
    }

    #[test]
    fn drift_is_a_ramp_from_one_slope() {
        let x = draw(vec![Process::drift(-0.5).unwrap()], KEY, 4);
        assert_eq!(x, [-0.5, -1.0, -1.5, -2.0]);
    }

    #[test]
    fn quantization_is_bounded_by_one_step() {
        let x = draw(vec![quantization()], KEY, 100_000);
        let step = (12.0 * 0.5_f64).sqrt();
        assert!(x.iter().all(|v| v.abs() <= step));
        assert!(x.iter().any(|v| v.abs() > 0.95 * step));
    }

    /// The wavelet variance is unbiased: its mean over R runs is within 5 of its standard errors, as they
    /// scatter (Student, R − 1 degrees of freedom: 5e-6 a comparison), of the theory.
    #[test]
    fn wavelet_variance_is_the_theoretical_one() {
        const RUNS: u64 = 64;
        const LEVELS: u32 = 9;
        let gm = Process::gauss_markov(2.0, 3.0, 100.0).unwrap();
        let n2 = vec![white(), quantization(), ar1(0.9), ar1(0.999), walk()];
        for processes in [
            vec![quantization()],
            vec![Process::flicker(1.0).unwrap()],
            vec![walk()],
            vec![ma1()],
            vec![gm],
            vec![ar1(-0.7)],
            n2,
        ] {
            let theory = Composite::new(processes.clone());
            let measured: Vec<Vec<f64>> = (0..RUNS)
                .map(|run| draw(processes.clone(), StreamKey { run, ..KEY }, 1 << 13))
                .map(|x| crate::wavelet::classical(&x, LEVELS).unwrap())
                .collect();
            for level in 1..=LEVELS {
                let nu: Vec<f64> = measured.iter().map(|m| m[level as usize - 1]).collect();
                let mean = nu.iter().sum::<f64>() / RUNS as f64;
                let scatter =
                    nu.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (RUNS - 1) as f64;
                let error = mean - theory.haar_wv(level);
                let bound = SIGMAS * (scatter / RUNS as f64).sqrt();
                assert!(
                    error.abs() < bound,
                    "{processes:?}, level {level}: off by {error}, bound {bound}"
                );
            }
        }
    }

    #[test]
    fn a_sum_is_the_sum_of_its_processes() {
        let parts = vec![white(), ar1(0.9), quantization(), walk(), ma1()];
        let sum = draw(parts.clone(), KEY, 1000);
        let mut expected = vec![0.0; 1000];
        for part in parts {
            expected
                .iter_mut()
                .zip(draw(vec![part], KEY, 1000))
                .for_each(|(e, x)| *e += x);
        }
        // Summed in another order: a few roundings of numbers below 100.
        for (s, e) in sum.iter().zip(expected) {
            assert_abs_diff_eq!(*s, e, epsilon = 1e-12);
        }
    }

    #[test]
    fn block_sizes_do_not_matter() {
        let drift = Process::drift(1e-3).unwrap();
        let noise = Composite::new(vec![
            white(),
            ar1(0.9),
            ar1(0.5),
            quantization(),
            walk(),
            ma1(),
            drift,
        ]);
        let mut whole = vec![0.0; 5000];
        Synthesizer::new(&noise, KEY).fill(&mut whole);
        let mut pieces = vec![0.0; 5000];
        let mut synthesizer = Synthesizer::new(&noise, KEY);
        let mut rest = pieces.as_mut_slice();
        for size in [1, 0, 2, 7, 64, 1000, 3, 3923] {
            let (block, tail) = rest.split_at_mut(size);
            synthesizer.fill(block);
            rest = tail;
        }
        assert_eq!(whole, pieces);
    }

    #[test]
    fn nothing_is_zero() {
        assert_eq!(draw(vec![], KEY, 3), [0.0; 3]);
        assert_eq!(draw(vec![Process::white(0.0).unwrap()], KEY, 3), [0.0; 3]);
    }
}

#[cfg(test)]
mod normal_tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use statrs::distribution::{ContinuousCDF, Normal};

    const KEY: StreamKey<'_> = StreamKey {
        seed: 3,
        scenario: "",
        run: 0,
        source: "gyro.z",
        process: "WN",
    };

    fn draw(n: usize) -> Vec<f64> {
        let white = Composite::new(vec![Process::white(1.0).unwrap()]);
        let mut out = vec![f64::NAN; n];
        Synthesizer::new(&white, KEY).fill(&mut out);
        out
    }

    #[test]
    fn the_logarithm_is_within_two_roundings() {
        for k in 1..100_000 {
            let x = f64::from(k) / 100_000.0 * 2.0_f64.powi(-(k % 52));
            let ln = ln_of_fraction(Lanes::splat(x))[0];
            assert_abs_diff_eq!(ln, x.ln(), epsilon = 2.0 * f64::EPSILON * x.ln().abs());
        }
        assert_eq!(ln_of_fraction(Lanes::splat(1.0))[0], 0.0);
    }

    /// Counts in bins of equal probability, chi-square with 255 degrees of freedom: sd √(2·255).
    #[test]
    fn all_quantiles_are_hit_evenly() {
        const BINS: usize = 256;
        let law = Normal::new(0.0, 1.0).unwrap();
        let x = draw(1_000_000);
        let mut counts = [0.0; BINS];
        for x in &x {
            counts[(law.cdf(*x) * BINS as f64) as usize] += 1.0;
        }
        let expected = x.len() as f64 / BINS as f64;
        let chi2: f64 = counts
            .iter()
            .map(|c: &f64| (c - expected).powi(2) / expected)
            .sum();
        assert_abs_diff_eq!(chi2, 255.0, epsilon = 5.0 * 510.0_f64.sqrt());
    }

    /// Tail probabilities, each side, within 5 Poisson standard deviations; and the fourth moment, 3, whose
    /// sampling variance is (E x⁸ − 9)/n = 96/n.
    #[test]
    fn tails_and_fourth_moment() {
        let law = Normal::new(0.0, 1.0).unwrap();
        let x = draw(8_000_000);
        let n = x.len() as f64;
        for bound in [3.0, 4.0, 4.5, 5.0] {
            let expected = n * law.sf(bound);
            for sign in [-1.0, 1.0] {
                let count = x.iter().filter(|x| sign * **x > bound).count() as f64;
                let off = (count - expected).abs();
                assert!(
                    off < 5.0 * expected.max(1.0).sqrt(),
                    "beyond {bound}: {count}, {expected}"
                );
            }
        }
        let fourth = x.iter().map(|x| x.powi(4)).sum::<f64>() / n;
        assert_abs_diff_eq!(fourth, 3.0, epsilon = 5.0 * (96.0 / n).sqrt());
    }

    /// The two numbers of a pair share a radius: their squares are independent too. The standard deviation of a mean of
    /// (x² − 1)(y² − 1) is 2/√n.
    #[test]
    fn the_numbers_of_a_pair_are_independent() {
        let x = draw(2_000_000);
        let pairs = x.as_chunks::<2>().0;
        let n = pairs.len() as f64;
        let mean = |f: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(f).sum::<f64>() / n;
        assert!(mean(&|[x, y]| x * y).abs() < 5.0 / n.sqrt());
        assert!(mean(&|[x, y]| (x * x - 1.0) * (y * y - 1.0)).abs() < 10.0 / n.sqrt());
    }

    /// Fused products round once: the widths agree to a few roundings of r.
    #[test]
    fn vector_units_change_no_number_but_by_rounding() {
        struct Draw;
        impl Kernel for Draw {
            type Output = [Lanes; 1000];
            #[inline(always)]
            fn run<W: Wide>(self) -> [Lanes; 1000] {
                let mut out = [Lanes::ZERO; 1000];
                let keys: Vec<_> = (0..8).map(|run| StreamKey { run, ..KEY }).collect();
                LaneGenerator::new(&keys).fill::<W>(UnitDistribution::Normal, &mut out);
                out
            }
        }
        let portable = dispatch(Level::Portable, Draw);
        for level in [Level::Avx2, Level::Avx512] {
            for (a, b) in dispatch(level, Draw).iter().zip(&portable) {
                for lane in 0..LANES {
                    assert!((a[lane] - b[lane]).abs() < 1e-14, "{level}");
                }
            }
        }
    }

    /// Eight runs side by side, with parameters of their own, are each what it is alone, to the last bit.
    #[test]
    fn lanes_are_the_runs_alone() {
        let noise = |run: usize| {
            let scale = 1.0 + run as f64;
            Composite::new(vec![
                Process::white(scale).unwrap(),
                Process::ar1(0.9 - 0.1 * scale, 2.0).unwrap(),
                Process::ar1(0.999, scale).unwrap(),
                Process::quantization(0.5 * scale).unwrap(),
                Process::random_walk(0.1 * scale).unwrap(),
                Process::ma1(0.1 * scale, 1.5).unwrap(),
                Process::drift(1e-3 * scale).unwrap(),
            ])
        };
        let noises: Vec<Composite> = (0..5).map(noise).collect();
        let key = |run: usize| StreamKey {
            run: run as u64,
            ..KEY
        };
        let runs: Vec<_> = noises
            .iter()
            .enumerate()
            .map(|(i, n)| (n, key(i)))
            .collect();
        let mut together = vec![Lanes::splat(f64::NAN); 1000];
        Synthesizer::lanes(&runs).fill(&mut together);
        for (lane, (noise, key)) in runs.iter().enumerate() {
            let mut alone = vec![f64::NAN; 1000];
            Synthesizer::new(noise, *key).fill(&mut alone);
            assert!(together.iter().map(|x| x[lane]).eq(alone), "lane {lane}");
        }
        assert!(together.iter().all(|x| x.0[5..] == [0.0; 3]));
    }
}
