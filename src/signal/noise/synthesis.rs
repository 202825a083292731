//! Synthesis: draws the noise of one axis from its model, block by block.

use super::{Composite, Kind, Ladder, Process};
use crate::rng::{Generator, StreamKey};
use rand::{Rng, RngExt};
use std::sync::LazyLock;

/// The noise of one axis of one run, as a stream of samples.
///
/// Every process of the sum draws from a stream of its own, so that adding or removing one changes no
/// other's numbers. What comes out does not depend on the sizes of the blocks it is asked for.
///
/// FN is a sum of AR1 ([`Ladder::FINE`]). AR1 and GM start stationary; MA1 and QN have a past; RW starts at 0 (its first sample is its first
/// increment) and DR at one slope (X_t = slope·t, t = 1, 2, …).
#[derive(Debug, Clone)]
pub struct Synthesizer {
    direct: Vec<Direct>,
    recursive: Vec<Recursive>,
}

/// Samples made at a time: every process fills a block, then the blocks are summed.
const BLOCK: usize = 64;
/// Recursions that advance together: each step waits for the last one of its own chain, and three chains side
/// by side keep the processor busy meanwhile.
const TOGETHER: usize = 3;

impl Synthesizer {
    /// The noise of one axis (units of the model) at its beginning. The key names seed, scenario, run and
    /// axis; its `process` is replaced by the label of each summand ([`Composite::labels`]).
    pub fn new(noise: &Composite, key: StreamKey<'_>) -> Self {
        let mut synthesizer = Self {
            direct: Vec::new(),
            recursive: Vec::new(),
        };
        for (process, label) in noise.processes.iter().zip(noise.labels()) {
            let parts = process.parts(Ladder::FINE);
            for (i, part) in parts.iter().enumerate() {
                let label = match parts.len() {
                    1 => label.clone(),
                    _ => format!("{label}.{i}"),
                };
                let key = StreamKey {
                    process: &label,
                    ..key
                };
                synthesizer.add(part, key.generator());
            }
        }
        synthesizer
    }

    /// Adds a process, unless it is identically zero.
    fn add(&mut self, process: &Process, mut generator: Generator) {
        let (theta, size) = (process.shape(), process.amplitude());
        if size == 0.0 {
            return;
        }
        let draw = |g: &mut Generator| Ziggurat::get().draw(g);
        if let Some([phi, innovation, initial]) = process.recursion() {
            // X_0 from the stationary law, so that X_1 has it too.
            let is_stationary = initial > 0.0;
            let start = is_stationary.then(|| initial.sqrt() * draw(&mut generator));
            return self.recursive.push(Recursive {
                phi,
                sigma: innovation.sqrt(),
                last: start.unwrap_or(0.0),
                generator,
                block: [0.0; BLOCK],
            });
        }
        let sigma = size.abs().sqrt();
        let (filter, last) = match process.kind() {
            Kind::White => (Filter::White { sigma }, 0.0),
            Kind::Drift => (Filter::Drift { slope: size }, 0.0),
            // The value before the first one is drawn too, so that the first sample has the variance 2 Q² of
            // all others.
            Kind::Quantization => {
                let scale = (12.0 * size).sqrt();
                (Filter::Quantization { scale }, generator.random())
            }
            _ => (Filter::Ma1 { theta, sigma }, sigma * draw(&mut generator)),
        };
        self.direct.push(Direct {
            filter,
            last,
            generator,
        });
    }

    /// Overwrites `out` with the next samples.
    pub fn fill(&mut self, out: &mut [f64]) {
        for block in out.chunks_mut(BLOCK) {
            block.fill(0.0);
            self.direct.iter_mut().for_each(|d| d.add_to(block));
            let (groups, rest) = self.recursive.as_chunks_mut::<TOGETHER>();
            groups
                .iter_mut()
                .for_each(|group| add_recursive(group, block));
            rest.iter_mut()
                .for_each(|one| add_recursive(std::array::from_mut(one), block));
        }
    }
}

/// A process whose samples are made of fresh numbers and at most one past one.
#[derive(Debug, Clone)]
struct Direct {
    filter: Filter,
    /// The past number (QN, MA1) or time (DR).
    last: f64,
    generator: Generator,
}

#[derive(Debug, Clone)]
enum Filter {
    White { sigma: f64 },
    Quantization { scale: f64 },
    Drift { slope: f64 },
    Ma1 { theta: f64, sigma: f64 },
}

impl Direct {
    /// Adds the next samples to `out`.
    fn add_to(&mut self, out: &mut [f64]) {
        // A local copy of the generator stays in registers; the one behind `self` would be stored at every
        // draw.
        let (z, mut g, mut last) = (Ziggurat::get(), self.generator.clone(), self.last);
        match self.filter {
            Filter::White { sigma } => out.iter_mut().for_each(|x| *x += sigma * z.draw(&mut g)),
            Filter::Quantization { scale } => out.iter_mut().for_each(|x| {
                let u = g.random::<f64>();
                *x += scale * (u - last);
                last = u;
            }),
            Filter::Drift { slope } => out.iter_mut().for_each(|x| {
                last += 1.0;
                *x += slope * last;
            }),
            Filter::Ma1 { theta, sigma } => out.iter_mut().for_each(|x| {
                let w = sigma * z.draw(&mut g);
                *x += w + theta * last;
                last = w;
            }),
        }
        (self.generator, self.last) = (g, last);
    }
}

/// An AR1, or a random walk (phi = 1).
#[derive(Debug, Clone)]
struct Recursive {
    phi: f64,
    sigma: f64,
    last: f64,
    generator: Generator,
    /// Fresh numbers, then samples.
    block: [f64; BLOCK],
}

/// Adds the next samples of N recursions to `out`.
fn add_recursive<const N: usize>(group: &mut [Recursive; N], out: &mut [f64]) {
    let n = out.len().min(BLOCK);
    // All numbers first, then all recursions: the draws branch, and would break up the chains that run side
    // by side.
    for r in group.iter_mut() {
        let (z, mut g) = (Ziggurat::get(), r.generator.clone());
        r.block[..n].iter_mut().for_each(|w| *w = z.draw(&mut g));
        r.generator = g;
    }
    let (phi, sigma) = (
        group.each_ref().map(|r| r.phi),
        group.each_ref().map(|r| r.sigma),
    );
    let mut last = group.each_ref().map(|r| r.last);
    for (k, x) in out.iter_mut().enumerate().take(n) {
        for i in 0..N {
            last[i] = phi[i] * last[i] + sigma[i] * group[i].block[k];
            // In the order of the list, however it is grouped: the rounding of the sum does not depend on
            // TOGETHER.
            *x += last[i];
        }
    }
    for (r, last) in group.iter_mut().zip(last) {
        r.last = last;
    }
}

// Standard normal numbers, fast: the ziggurat of 256 layers ([Doornik](crate::bibliography::Doornik05)'s
// ZIGNOR) with its common path small enough to be inlined and the generator kept in registers. A general
// distribution library's sampler, which is called rather than inlined, costs twice as much here, where
// noise is as dear as the filter.

const LAYERS: usize = 256;
/// Beginning of the tail. With this value 256 layers of equal area close at the top (tested).
const R: f64 = 3.654_152_885_361_009;
/// Area of each layer, R·f(R) + ∫_R^∞ f, of the unnormalised density f.
const AREA: f64 = 0.004_928_673_233_974_655;

/// Edges of the layers and the density there.
struct Ziggurat {
    x: [f64; LAYERS + 1],
    f: [f64; LAYERS + 1],
}

/// The density, unnormalised.
fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp()
}

static ZIGGURAT: LazyLock<Ziggurat> = LazyLock::new(Ziggurat::new);

impl Ziggurat {
    /// The tables, computed once.
    fn get() -> &'static Self {
        &ZIGGURAT
    }

    fn new() -> Self {
        let mut x = [0.0; LAYERS + 1];
        // The bottom layer is as wide as a rectangle of its area, which includes the tail.
        x[0] = AREA / density(R);
        x[1] = R;
        // Layers of one area: x[i−1] (f(x[i]) − f(x[i−1])) = AREA. x[LAYERS] stays 0, so the top layer has no
        // part that is accepted unseen.
        for i in 2..LAYERS {
            x[i] = (-2.0 * (AREA / x[i - 1] + density(x[i - 1])).ln()).sqrt();
        }
        Self {
            x,
            f: x.map(density),
        }
    }

    /// A standard normal number.
    #[inline(always)]
    fn draw(&self, g: &mut Generator) -> f64 {
        let (layer, u, x) = self.candidate(g);
        // Within the next narrower layer the whole height of this one lies below the density.
        if x.abs() < self.x[layer + 1] {
            return x;
        }
        // By value, so that the generator's address is never taken in the common path.
        let (x, after) = self.edge(g.clone(), layer, u, x);
        *g = after;
        x
    }

    /// A layer, a uniform number in [−1, 1) and the point of the layer there: 8 and 52 bits of one draw.
    #[inline(always)]
    fn candidate(&self, g: &mut Generator) -> (usize, f64, f64) {
        let bits = g.next_u64();
        let layer = (bits & 0xff) as usize;
        // Mantissa bits under the exponent of 2: uniform on [2, 4), and the subtraction is exact. The layer's
        // 8 bits are not among them.
        let u = f64::from_bits((bits >> 12) | 2.0_f64.to_bits()) - 3.0;
        (layer, u, u * self.x[layer])
    }

    /// The 1.2 % that fall on a layer's edge or into the tail.
    #[cold]
    #[inline(never)]
    fn edge(&self, mut g: Generator, mut layer: usize, mut u: f64, mut x: f64) -> (f64, Generator) {
        loop {
            if layer == 0 {
                return (tail(&mut g).copysign(u), g);
            }
            // A uniform height within the layer, accepted below the density: von Neumann's rejection on the
            // edge.
            let (low, high) = (self.f[layer], self.f[layer + 1]);
            if high + (low - high) * g.random::<f64>() < density(x) {
                return (x, g);
            }
            (layer, u, x) = self.candidate(&mut g);
            if x.abs() < self.x[layer + 1] {
                return (x, g);
            }
        }
    }
}

/// A number beyond R (Marsaglia 1964).
fn tail(g: &mut Generator) -> f64 {
    // 1 − U is in (0, 1]: its logarithm is finite.
    let mut exponential = || -(1.0 - g.random::<f64>()).ln();
    loop {
        let (x, y) = (exponential() / R, exponential());
        // f(R + x) is e^(−Rx)·e^(−x²/2) but for a constant: the first factor is drawn, the second accepts
        // with P(y > x²/2).
        if 2.0 * y > x * x {
            return R + x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Process;

    const KEY: StreamKey<'_> = StreamKey {
        seed: 7,
        scenario: "",
        run: 0,
        source: "accel.x",
        process: "",
    };
    /// How many standard deviations a statistic may be off: 2·Φ(−5) = 6e-7 a comparison.
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
    fn increments_of_a_walk_are_white() {
        let x = draw(vec![walk()], KEY, 1 << 20);
        let increments: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
        let n = increments.len() as f64;
        assert!((autocovariance(&increments, 0) - 0.25).abs() < SIGMAS * 0.25 * (2.0 / n).sqrt());
        assert!(autocovariance(&increments, 1).abs() < SIGMAS * 0.25 / n.sqrt());
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

    /// Kolmogorov-Smirnov: √n·D exceeds 1.95 with probability 1e-3.
    #[test]
    fn white_noise_is_normal() {
        use statrs::distribution::{ContinuousCDF, Normal};
        let law = Normal::new(0.0, 2.0).unwrap();
        let mut x = draw(vec![white()], KEY, 200_000);
        x.sort_by(f64::total_cmp);
        let n = x.len() as f64;
        let distance = |(i, v): (usize, &f64)| {
            let p = law.cdf(*v);
            (p - i as f64 / n).abs().max((p - (i + 1) as f64 / n).abs())
        };
        let d = x.iter().enumerate().map(distance).fold(0.0, f64::max);
        assert!(n.sqrt() * d < 1.95, "{}", n.sqrt() * d);
    }

    /// Correlations between streams that differ in one part of the key; standard deviation 1/√n.
    #[test]
    fn streams_are_independent() {
        let n = 1 << 18;
        let sigma = |x: &[f64]| autocovariance(x, 0).sqrt();
        let base = draw(vec![white()], KEY, n);
        let twins = [
            draw(vec![white()], StreamKey { run: 1, ..KEY }, n),
            draw(
                vec![white()],
                StreamKey {
                    source: "accel.y",
                    ..KEY
                },
                n,
            ),
            draw(vec![white()], StreamKey { seed: 8, ..KEY }, n),
            // White because phi = 0, but another process with another label.
            draw(vec![ar1(0.0)], KEY, n),
        ];
        for twin in &twins {
            let cross = base.iter().zip(twin).map(|(a, b)| a * b).sum::<f64>() / n as f64;
            let r = cross / (sigma(&base) * sigma(twin));
            assert!(r.abs() < SIGMAS / (n as f64).sqrt(), "{r}");
        }
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
            assert!((s - e).abs() < 1e-12, "{s}, {e}");
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
    use rand::SeedableRng;
    use statrs::distribution::{ContinuousCDF, Normal};

    #[test]
    fn the_layers_close_at_the_top_and_have_the_area() {
        let z = Ziggurat::new();
        let top = AREA / z.x[LAYERS - 1] + z.f[LAYERS - 1];
        assert!((top - 1.0).abs() < 1e-12, "{top}");
        let beyond = Normal::new(0.0, 1.0).unwrap().sf(R) * std::f64::consts::TAU.sqrt();
        assert!(
            (R * density(R) + beyond - AREA).abs() < 1e-12,
            "{}",
            R * density(R) + beyond
        );
    }

    /// Counts in bins of equal probability, chi-square with 255 degrees of freedom: sd √(2·255).
    #[test]
    fn all_quantiles_are_hit_evenly() {
        const BINS: usize = 256;
        let law = Normal::new(0.0, 1.0).unwrap();
        let mut g = Generator::seed_from_u64(3);
        let n = 1_000_000;
        let mut counts = [0.0; BINS];
        for _ in 0..n {
            counts[(law.cdf(Ziggurat::get().draw(&mut g)) * BINS as f64) as usize] += 1.0;
        }
        let expected = f64::from(n) / BINS as f64;
        let chi2: f64 = counts
            .iter()
            .map(|c: &f64| (c - expected).powi(2) / expected)
            .sum();
        assert!((chi2 - 255.0).abs() < 5.0 * 510.0_f64.sqrt(), "{chi2}");
    }

    /// Tail probabilities, each side, within 5 Poisson standard deviations; and the fourth moment, 3, whose
    /// sampling variance is (E x⁸ − 9)/n = 96/n.
    #[test]
    fn tails_and_fourth_moment() {
        let law = Normal::new(0.0, 1.0).unwrap();
        let mut g = Generator::seed_from_u64(4);
        let n = 8_000_000;
        let bounds = [3.0, R, 4.0, 4.5];
        let (mut above, mut below, mut fourth) = ([0.0; 4], [0.0; 4], 0.0);
        for _ in 0..n {
            let x = Ziggurat::get().draw(&mut g);
            fourth += x.powi(4);
            for (i, b) in bounds.iter().enumerate() {
                above[i] += f64::from(u8::from(x > *b));
                below[i] += f64::from(u8::from(x < -*b));
            }
        }
        for (i, b) in bounds.iter().enumerate() {
            let expected = f64::from(n) * law.sf(*b);
            for count in [above[i], below[i]] {
                let off: f64 = count - expected;
                assert!(
                    off.abs() < 5.0 * expected.sqrt(),
                    "beyond {b}: {count}, {expected}"
                );
            }
        }
        let n = f64::from(n);
        assert!(
            (fourth / n - 3.0).abs() < 5.0 * (96.0 / n).sqrt(),
            "{}",
            fourth / n
        );
    }
}
