//! The Haar MODWT: classical wavelet variance and the coefficients it is made of.
//!
//! Scale tau = 2^level samples, m = tau/2. W_t = (mean of the later m samples − mean of the earlier m)/2,
//! t = 0 … T − tau; nu = mean(W²), not centred
//! ([Percival](crate::bibliography::Percival95)). The Allan variance of averages over m samples is 2·nu.

use super::{QuantizationResponse, WaveletError, check_levels};
use multiversion::multiversion;

/// Elements that advance together. The order of every sum follows from it alone, so that a machine with wider
/// registers gives the same bytes.
pub(super) const WIDTH: usize = 16;
/// Length of the partial sums that are added with compensation (elements).
pub(super) const BLOCK: usize = 2048;

/// Classical wavelet variance at levels 1 … `levels` (units²); the entry of level j is at j − 1.
///
/// # Errors
/// When the signal is too short for the levels, or a sample is not finite.
pub fn classical(signal: &[f64], levels: u32) -> Result<Vec<f64>, WaveletError> {
    let mut pyramid = Pyramid::new(signal, levels)?;
    Ok((0..levels).map(|_| pyramid.next_variance()).collect())
}

/// The wavelet coefficients W_t of one level (units), `signal.len() − 2^level + 1` of them.
///
/// # Errors
/// When the signal is too short for the level, or a sample is not finite.
pub fn coefficients(signal: &[f64], level: u32) -> Result<Vec<f64>, WaveletError> {
    let mut pyramid = Pyramid::new(signal, level)?;
    for _ in 1..level {
        pyramid.next_variance();
    }
    let m = pyramid.half;
    // The sums are over m samples: (late − early)/(2m) is half the difference of the two means.
    let scale = 0.5 / m as f64;
    let pairs = pyramid.sums.iter().zip(&pyramid.sums[m..]);
    Ok(pairs.map(|(early, late)| (late - early) * scale).collect())
}

/// Running sums of m samples, m doubling from level to level, in one working array. Pairwise addition: the
/// rounding error grows with log2 of the scale; the first sample is subtracted, so an offset costs no digits.
pub(super) struct Pyramid {
    /// Sums of `half` consecutive samples.
    pub(super) sums: Vec<f64>,
    /// m of the level that comes next.
    pub(super) half: usize,
}

impl Pyramid {
    pub(super) fn new(signal: &[f64], levels: u32) -> Result<Self, WaveletError> {
        check_levels(signal, levels)?;
        // The coefficients do not see a constant. The first sample does as well as the mean, and needs no
        // pass over the record.
        let first = signal[0];
        Ok(Self {
            sums: signal.iter().map(|x| x - first).collect(),
            half: 1,
        })
    }

    /// The classical variance of the next level.
    fn next_variance(&mut self) -> f64 {
        self.advance(step)
    }

    /// The classical variance of the next level; `step` is [`butterflies`].
    pub(super) fn advance(&mut self, step: impl FnOnce(&mut [f64], usize) -> f64) -> f64 {
        let count = self.sums.len() - self.half;
        let total = step(&mut self.sums, self.half);
        // W_t = (b − a)/(2m); the factor is the same for all t and leaves the sum. Divided by M_j, not M_j −
        // 1: E W_t = 0 is known, so no mean is estimated.
        let scale = 0.5 / self.half as f64;
        // A sum of 2m samples begins at `count` places only; the entries behind are still sums of m.
        self.sums.truncate(count);
        self.half *= 2;
        total * scale * scale / count as f64
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn step(sums: &mut [f64], half: usize) -> f64 {
    butterflies(sums, half, |_, _| ())
}

/// Replaces each a = sums\[t\] by a + b, b = sums\[t + half\], and returns Σ (b − a)²; `keep` sees the squares.
#[inline(always)]
pub(super) fn butterflies(
    sums: &mut [f64],
    half: usize,
    mut keep: impl FnMut(usize, &[f64]),
) -> f64 {
    let count = sums.len() - half;
    let mut total = Compensated::default();
    let mut lanes = [0.0; WIDTH];
    let whole = count - count % WIDTH;
    for t in (0..whole).step_by(WIDTH) {
        // Both are copied before anything is written: for half < WIDTH they overlap, and `late` must still be
        // sums of m.
        let mut early: [f64; WIDTH] = array(&sums[t..t + WIDTH]);
        let late: [f64; WIDTH] = array(&sums[t + half..t + half + WIDTH]);
        let mut squares = [0.0; WIDTH];
        for i in 0..WIDTH {
            let difference = late[i] - early[i];
            squares[i] = difference * difference;
            early[i] += late[i];
            lanes[i] += squares[i];
        }
        sums[t..t + WIDTH].copy_from_slice(&early);
        keep(t, &squares);
        // BLOCK/WIDTH = 128 positive terms to a lane: plain addition errs by at most 128·2⁻⁵³ = 1.4e-14
        // relative.
        if t % BLOCK == BLOCK - WIDTH {
            total.add(pairwise(&lanes));
            lanes = [0.0; WIDTH];
        }
    }
    total.add(pairwise(&lanes));
    for t in whole..count {
        let difference = sums[t + half] - sums[t];
        sums[t] += sums[t + half];
        keep(t, &[difference * difference]);
        total.add(difference * difference);
    }
    total.value()
}

#[inline(always)]
pub(super) fn array<const N: usize>(slice: &[f64]) -> [f64; N] {
    let mut a = [0.0; N];
    a.copy_from_slice(&slice[..N]);
    a
}

/// Sum of the lanes by halving: log2 N roundings.
#[inline(always)]
pub(super) fn pairwise<const N: usize>(lanes: &[f64; N]) -> f64 {
    let mut a = *lanes;
    let mut n = N;
    while n > 1 {
        n /= 2;
        for i in 0..n {
            a[i] += a[i + n];
        }
    }
    a[0]
}

/// Compensated (Neumaier) sum.
#[derive(Default)]
pub(super) struct Compensated {
    sum: f64,
    lost: f64,
}

impl Compensated {
    #[inline(always)]
    pub(super) fn add(&mut self, x: f64) {
        let sum = self.sum + x;
        // The part of the smaller operand that rounding cut off, exactly (Neumaier; Kahan's form fails when a
        // term exceeds the sum).
        self.lost += if self.sum.abs() >= x.abs() {
            (self.sum - sum) + x
        } else {
            (x - sum) + self.sum
        };
        self.sum = sum;
    }

    pub(super) fn value(&self) -> f64 {
        self.sum + self.lost
    }
}

// A wavelet-variance curve: what a model is fitted to.

/// Wavelet variance over scales, with its degrees of freedom.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// Levels, ascending; level j has scale 2^j samples.
    pub levels: Vec<u32>,
    /// Wavelet variance (units²).
    pub wv: Vec<f64>,
    /// Equivalent degrees of freedom.
    pub edof: Vec<f64>,
    /// Response of robust variances to quantization noise; none for classical ones, which read it as it is.
    pub quantization: Option<QuantizationResponse>,
    /// Variance of ln nu, at all scales alike, by which the curve of other recordings would differ beyond the degrees of
    /// freedom; 0 where it is not known.
    pub differing: f64,
    /// Median ln of each variance over the true one: that of few coefficients is read high if it is robust, and is low in the median.
    /// Empty: 0.
    pub log_bias: Vec<f64>,
    /// Levels of a robust curve whose variance is the classical one, which reads quantization noise as it is.
    pub classical: Vec<u32>,
    /// Levels without weight in a fit.
    pub ignored: Vec<u32>,
}

impl Curve {
    /// Variances that can be fitted (units²): their squares and quotients are numbers.
    pub const WV_RANGE: (f64, f64) = (1e-100, 1e100);
    /// Degrees of freedom that are accepted.
    pub const EDOF_RANGE: (f64, f64) = (1e-15, 1e15);

    /// The curve of recordings that differ by another variance of ln nu besides.
    pub fn widened(&self, variance: f64) -> Self {
        Self {
            differing: self.differing + variance,
            ..self.clone()
        }
    }

    /// The levels that count in a fit.
    pub fn counted_levels(&self) -> Vec<u32> {
        let levels = self.levels.iter().copied();
        levels
            .filter(|level| !self.ignored.contains(level))
            .collect()
    }

    /// Response to quantization noise at a level; none where it is read as it is.
    pub fn response(&self, level: u32) -> Option<&QuantizationResponse> {
        self.quantization
            .as_ref()
            .filter(|_| !self.classical.contains(&level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Generator;
    use approx::assert_relative_eq;
    use rand::{RngExt, SeedableRng};

    /// Σ W²·(2m)² in integers: exact.
    fn exact(signal: &[i64], level: u32) -> f64 {
        let m = 1_usize << (level - 1);
        let mut prefix = vec![0_i128; signal.len() + 1];
        for (t, &x) in signal.iter().enumerate() {
            prefix[t + 1] = prefix[t] + i128::from(x);
        }
        let count = signal.len() - 2 * m + 1;
        let difference = |t: usize| prefix[t + 2 * m] - 2 * prefix[t + m] + prefix[t];
        let sum: i128 = (0..count).map(|t| difference(t) * difference(t)).sum();
        sum as f64 / (2 * m) as f64 / (2 * m) as f64 / count as f64
    }

    /// White noise on an offset a million times larger, and a random walk far from its start, in
    /// integers so that the expected value is exact.
    #[test]
    fn digits_survive_offsets_and_random_walks() {
        let mut generator = Generator::seed_from_u64(1);
        let n = 150_001;
        let noise: Vec<i64> = (0..n)
            .map(|_| generator.random_range(-1000..=1000))
            .collect();
        let offset: Vec<i64> = noise.iter().map(|x| 9_810_000_000_000 + x).collect();
        let mut position = 0;
        let walk: Vec<i64> = noise
            .iter()
            .map(|x| {
                position += x;
                position
            })
            .collect();
        for signal in [noise, offset, walk] {
            let floats: Vec<f64> = signal.iter().map(|&x| x as f64).collect();
            for (i, nu) in classical(&floats, 17).unwrap().iter().enumerate() {
                assert_relative_eq!(*nu, exact(&signal, i as u32 + 1), max_relative = 1e-13);
            }
        }
    }

    #[test]
    fn the_shortest_signals() {
        assert_eq!(classical(&[1.0, 2.0], 1).unwrap(), [0.25]);
        assert_eq!(
            classical(&[1.0, 2.0, 4.0, 8.0], 2).unwrap(),
            [(1.0 + 4.0 + 16.0) / 12.0, (4.5_f64 / 2.0).powi(2)]
        );
        assert_eq!(coefficients(&[1.0, 2.0, 4.0, 8.0], 2).unwrap(), [2.25]);
        for (samples, levels) in [(3, 2), (0, 1), (8, 64)] {
            let refused = Err(WaveletError::TooShort { samples, levels });
            assert_eq!(classical(&vec![1.0; samples], levels), refused);
        }
        assert_eq!(classical(&[1.0], 0), Err(WaveletError::NoLevels));
        assert!(matches!(
            classical(&[1.0, f64::NAN], 1),
            Err(WaveletError::NotFinite { index: 1, .. })
        ));
    }
}
