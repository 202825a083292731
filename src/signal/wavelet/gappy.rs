//! Haar wavelet variance of a signal with holes: nothing is bridged, nothing is cut.
//!
//! The coefficient of a window is made of the samples that are there, W_u = (mean of the later ones − mean of the earlier
//! ones)/2, n2 and n1 of m, where each half has half of its samples or more. It scatters more than a whole one. With D(k) the
//! mean squared difference of samples at lag k,
//!
//! 4 E W² = Σ_cross D/(n1 n2) − ½ Σ_early D/n1² − ½ Σ_late D/n2²
//!
//! over the pairs that are there, of whatever noise with stationary increments. D is estimated from products of the pairs observed
//! at each lag over their number ([Mondal and Percival](crate::bibliography::MondalPercival10)); what it says E W² of the
//! windows exceeds that of whole ones by is taken off: nu = Σ w_u W_u²/Σ w_u − excess, w_u = 2 n1 n2/(m(n1 + n2)). So nu is
//! unbiased given the holes, and the plain wavelet variance where there are none. (The variance by pairs alone, which D gives as
//! well, scatters up to five times as much at the last scales: the pairs at the ends of the record no longer make up whole
//! windows.)
//!
//! Robust: W_u²/v_u are the squares, v_u = 1 + λ(m/(2 n1) + m/(2 n2) − 1) the variance of each over that of a whole window,
//! λ such that the mean excess is the one found: 1 for white noise, about 0 for what changes slowly.
//!
//! The degrees of freedom are those of a whole record times the mean of w over all its windows: as 200 simulated records with
//! a tenth lost scatter, to their own accuracy.

use super::haar::Compensated;
use super::interval::edof_eta3;
use super::robust::m_scale;
use super::{RobustVariance, RootStatus, Tuning, WaveletError, check_levels, coefficient_count};

/// Wavelet variances of a signal with holes at levels 1, 2, …
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GappyVariances {
    /// Classical (units²).
    pub classical: Vec<f64>,
    /// Robust.
    pub robust: Vec<RobustVariance>,
    /// Factor of the degrees of freedom of a whole record.
    pub coverage: Vec<f64>,
}

/// Classical and robust wavelet variance at levels 1 … `levels` of a signal whose missing samples are NaN; fewer where no window has
/// the samples.
///
/// # Errors
/// When the signal is too short for the levels, a sample is infinite, or fewer than two are there.
pub fn gappy(signal: &[f64], levels: u32, tuning: &Tuning) -> Result<GappyVariances, WaveletError> {
    let present: Vec<f64> = signal.iter().copied().filter(|x| !x.is_nan()).collect();
    check_levels(&present, 1)?;
    if coefficient_count(signal.len(), levels) == 0 {
        return Err(WaveletError::TooShort {
            samples: signal.len(),
            levels,
        });
    }
    let first = present[0];
    let mean = first + present.iter().map(|x| x - first).sum::<f64>() / present.len() as f64;
    let samples: Vec<f64> = signal
        .iter()
        .map(|x| if x.is_nan() { 0.0 } else { x - mean })
        .collect();
    let there: Vec<f64> = signal
        .iter()
        .map(|x| f64::from(u8::from(!x.is_nan())))
        .collect();
    let mut windows = Windows {
        sums: samples.clone(),
        counts: there.clone(),
        half: 1,
    };
    let mut found = GappyVariances::default();
    for level in 1..=levels {
        let Some(coefficients) = windows.coefficients() else {
            break;
        };
        let excess = Blocks::new(&samples, &there, windows.half).excess(&windows);
        let nu = (coefficients.mean_square() - excess).max(0.0);
        let mut robust = coefficients.robust(nu, excess, tuning);
        let degrees = edof_eta3(signal.len(), level) * coefficients.coverage;
        if robust.is_moved_by_steps(nu, degrees, tuning.efficiency()) {
            robust.status = RootStatus::Coarse;
        }
        found.classical.push(nu);
        found.robust.push(robust);
        found.coverage.push(coefficients.coverage);
        windows.double();
    }
    Ok(found)
}

/// Running sums and counts of m samples.
struct Windows {
    sums: Vec<f64>,
    counts: Vec<f64>,
    half: usize,
}

impl Windows {
    /// From sums of m samples to sums of 2m; pairwise, as [`super::haar`] adds.
    fn double(&mut self) {
        let count = self.sums.len() - self.half;
        for values in [&mut self.sums, &mut self.counts] {
            (0..count).for_each(|t| values[t] += values[t + self.half]);
            values.truncate(count);
        }
        self.half *= 2;
    }

    /// Samples of the two halves of the window that begins at `u`; none where either lacks more than half of them.
    fn halves(&self, u: usize) -> Option<[f64; 2]> {
        let (early, late, m) = (self.counts[u], self.counts[u + self.half], self.half as f64);
        (2.0 * early >= m && 2.0 * late >= m).then_some([early, late])
    }

    /// w of a window with this many samples.
    fn weight(&self, [early, late]: [f64; 2]) -> f64 {
        2.0 * early * late / (self.half as f64 * (early + late))
    }

    /// Σ over the windows before each, at steps of `step` samples, of what is made of weight and halves, for the windows that serve.
    fn cumulated(&self, step: usize, made: impl Fn(f64, [f64; 2]) -> f64) -> Vec<f64> {
        let count = self.sums.len() - self.half;
        let mut total = 0.0;
        let next = |u: usize| {
            total += self
                .halves(u)
                .map_or(0.0, |halves| made(self.weight(halves), halves));
            total
        };
        std::iter::once(0.0)
            .chain((0..count).step_by(step).map(next))
            .collect()
    }

    fn coefficients(&self) -> Option<Coefficients> {
        let count = self.sums.len() - self.half;
        let (mut squares, mut weights, mut losses) = (Vec::new(), Vec::new(), Vec::new());
        for u in 0..count {
            let Some(halves) = self.halves(u) else {
                continue;
            };
            let [early, late] = halves;
            let difference = 0.5 * (self.sums[u + self.half] / late - self.sums[u] / early);
            squares.push(difference * difference);
            weights.push(self.weight(halves));
            // 1/w is the mean of m/n1 and m/n2.
            losses.push(1.0 / self.weight(halves) - 1.0);
        }
        let total = weights.iter().sum::<f64>();
        (total > 0.0).then(|| Coefficients {
            squares,
            weights,
            losses,
            coverage: total / count as f64,
        })
    }
}

/// The coefficients of one level.
struct Coefficients {
    squares: Vec<f64>,
    weights: Vec<f64>,
    /// Relative excess of the variance of each over a whole one's, for white noise.
    losses: Vec<f64>,
    coverage: f64,
}

impl Coefficients {
    /// Σ w x/Σ w.
    fn mean(&self, values: &[f64]) -> f64 {
        let (mut sum, mut weights) = (Compensated::default(), Compensated::default());
        for (value, weight) in values.iter().zip(&self.weights) {
            sum.add(weight * value);
            weights.add(*weight);
        }
        sum.value() / weights.value()
    }

    fn mean_square(&self) -> f64 {
        self.mean(&self.squares)
    }

    fn robust(&self, nu: f64, excess: f64, tuning: &Tuning) -> RobustVariance {
        let loss = self.mean(&self.losses);
        let lambda = if loss > 0.0 && nu > 0.0 {
            (excess / nu / loss).clamp(-0.5, 1.0)
        } else {
            0.0
        };
        let squares = self
            .squares
            .iter()
            .zip(&self.losses)
            .map(|(square, loss)| square / (1.0 + lambda * loss));
        m_scale(&squares.collect::<Vec<_>>(), tuning)
    }
}

/// Blocks to a half of a window: fewer samples are blocks of their own. What noise does within a 64th of a half is averaged.
const BLOCKS: usize = 64;

/// Sums over blocks of samples, and the mean squared differences between them.
struct Blocks {
    length: usize,
    /// Blocks to a half.
    half: usize,
    /// Samples there.
    counts: Vec<f64>,
    /// D at lags in blocks; at 0 that of two samples of a block.
    differences: Vec<f64>,
}

impl Blocks {
    fn new(samples: &[f64], there: &[f64], m: usize) -> Self {
        let length = (m / BLOCKS).max(1);
        let half = m / length;
        let of_blocks = |values: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
            let values: Vec<f64> = values.collect();
            values
                .chunks_exact(length)
                .map(|block| block.iter().sum())
                .collect()
        };
        let counts = of_blocks(&mut there.iter().copied());
        let sums = of_blocks(&mut samples.iter().copied());
        let squares = of_blocks(&mut samples.iter().map(|x| x * x));
        // Σ (x − y)² over the pairs of two blocks is n Σx² + n' Σy² − 2 Σx Σy.
        let at_lag = |k: usize| {
            let late = k..counts.len();
            let cross = dot(&squares, &counts[late.clone()]) + dot(&counts, &squares[late.clone()])
                - 2.0 * dot(&sums, &sums[late.clone()]);
            let same = if k == 0 { counts.iter().sum() } else { 0.0 };
            let pairs = dot(&counts, &counts[late]) - same;
            if pairs > 0.0 {
                (cross / pairs).max(0.0)
            } else {
                0.0
            }
        };
        let differences = (0..(2 * half).min(counts.len())).map(at_lag).collect();
        Self {
            length,
            half,
            counts,
            differences,
        }
    }

    /// By how much the mean of w W² over the windows, at the blocks' beginnings, exceeds that of whole windows.
    fn excess(&self, windows: &Windows) -> f64 {
        let cumulated = |made: fn(f64, [f64; 2]) -> f64| windows.cumulated(self.length, made);
        let total = *cumulated(|w, _| w).last().unwrap_or(&0.0);
        if total <= 0.0 || self.differences.len() < 2 * self.half {
            return 0.0;
        }
        let early = cumulated(|w, [n, _]| w / (n * n));
        let late = cumulated(|w, [_, n]| w / (n * n));
        let cross = cumulated(|w, [n1, n2]| w / (n1 * n2));
        let h = self.half as isize;
        // Σ over the windows of blocks before the one at `i`.
        let up_to = |sums: &[f64], i: isize| sums[i.clamp(0, sums.len() as isize - 1) as usize];
        let weighted = |made: &dyn Fn(isize) -> f64| -> Vec<f64> {
            self.counts
                .iter()
                .enumerate()
                .map(|(i, n)| n * made(i as isize))
                .collect()
        };
        // A pair (i, i + k) is in the early half of the windows from i + k − h + 1 to i, in the late half of those from
        // i + k − 2h + 1 to i − h, and across where i is in the early and i + k in the late half: a sum over windows is one that
        // depends on i less one that depends on i + k.
        let within = |i: isize| up_to(&early, i + 1) + up_to(&late, i - h + 1);
        let before = |i: isize| up_to(&early, i - h + 1) + up_to(&late, i - 2 * h + 1);
        let near = [
            weighted(&|i| -within(i) - up_to(&cross, i - h + 1)),
            weighted(&|i| before(i) + up_to(&cross, i - h + 1)),
        ];
        let far = [
            weighted(&|i| up_to(&cross, i + 1)),
            weighted(&|i| -up_to(&cross, i - 2 * h + 1)),
        ];
        let mut four = 0.0;
        for (k, difference) in self.differences.iter().enumerate().skip(1) {
            let [of_first, of_second] = if k < self.half { &near } else { &far };
            four += difference
                * (dot(of_first, &self.counts[k..]) + dot(&self.counts, &of_second[k..]));
        }
        let same = |i: usize| {
            self.counts[i] * (self.counts[i] - 1.0) * (within(i as isize) - before(i as isize))
        };
        four -= 0.5 * self.differences[0] * (0..self.counts.len()).map(same).sum::<f64>();
        0.25 * (four / total - self.whole())
    }

    /// 4 E W² of whole windows.
    fn whole(&self) -> f64 {
        let (h, length) = (self.half as f64, self.length as f64);
        let of_lag = |(k, difference): (usize, &f64)| {
            let k = k as f64;
            let cross = (h - (k - h).abs()) / (h * h);
            let halves = 2.0 * (h - k).max(0.0) / (h * h);
            difference * (cross - halves)
        };
        let all: f64 = self
            .differences
            .iter()
            .enumerate()
            .skip(1)
            .map(of_lag)
            .sum();
        all - self.differences[0] * (1.0 - 1.0 / length) / h
    }
}

/// Σ a_i b_i over the shorter of the two, in sixteen lanes.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (a[..n].chunks_exact(16), b[..n].chunks_exact(16));
    let rest: f64 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(x, y)| x * y)
        .sum();
    let mut lanes = [0.0; 16];
    for (x, y) in a.zip(b) {
        for i in 0..16 {
            lanes[i] += x[i] * y[i];
        }
    }
    super::haar::pairwise(&lanes) + rest
}

#[cfg(test)]
#[path = "gappy_tests.rs"]
mod tests;
