//! Facts about recorded columns that no noise explains: copied rows, zeros for lost samples, held and frozen values,
//! interpolation, motion, samples in two recordings, drift, noise that axes share.
//!
//! Columns are as a file has them, in any unit. The null hypothesis is a noise with stationary increments that is rounded to
//! the steps of a quantiser, with axes that are independent of one another within a block of rows: equal neighbours of one
//! axis are those that its step explains. [`LEVEL`] bounds the false alarms of each fact and recording.

use crate::imu::{Recording, Sensor};
use std::borrow::Cow;
use std::collections::HashSet;
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};
use std::ops::Range;

/// Probability of a false alarm.
pub const LEVEL: f64 = 1e-4;
/// Rows over which the shares of equal neighbours are those of one level of the signal.
const BLOCK: usize = 256;
/// Changes (in steps) from which on a step is fine: wherever the mean lies between two steps, neighbours are rarely equal.
const FINE: f64 = 4.0;

/// Median of |x| of a standard normal.
const MAD_OF_NORMAL: f64 = 0.674_489_75;

/// True if `count` of `trials` is more than a chance of `p` explains.
fn is_beyond(count: usize, trials: usize, p: f64) -> bool {
    log_improbability(count, trials, p) > -LEVEL.ln()
}

/// Chernoff's bound on the tail of a binomial distribution from `count` up: −ln of it, 0 below the mean.
fn log_improbability(count: usize, trials: usize, p: f64) -> f64 {
    let (n, q, p) = (
        trials as f64,
        count as f64 / trials.max(1) as f64,
        p.max(1e-15),
    );
    let term = |q: f64, p: f64| if q > 0.0 { q * (q / p).ln() } else { 0.0 };
    match q > p {
        true => n * (term(q, p) + term(1.0 - q, 1.0 - p)),
        false => 0.0,
    }
}

/// Upper median; NaN of an empty iterator. Two passes (histogram of the leading bits, then the median's bin): cheaper
/// than copying a day-long column.
fn median(values: impl Iterator<Item = f64> + Clone) -> f64 {
    // sign, exponent and three bits of the mantissa, in the order of the numbers
    let bin = |x: f64| {
        let bits = x.to_bits();
        let order = bits ^ ((bits.cast_signed() >> 63).cast_unsigned() | 1 << 63);
        (order >> 49) as usize
    };
    let mut counts = vec![0_usize; 1 << 15];
    values.clone().for_each(|x| counts[bin(x)] += 1);
    let mut place = counts.iter().sum::<usize>() / 2;
    let mut of_middle = 0;
    while let Some(&count) = counts.get(of_middle)
        && place >= count
    {
        place -= count;
        of_middle += 1;
    }
    if of_middle == counts.len() {
        return f64::NAN;
    }
    let mut near: Vec<f64> = Vec::with_capacity(counts[of_middle]);
    near.extend(values.filter(|x| bin(*x) == of_middle));
    *near.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Step of a quantiser, and the median change from one sample to the next in such steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuantizerStep {
    /// Smallest change (unit of the column).
    pub step: f64,
    /// Median of the changes that are not zero, in steps.
    pub changes: f64,
}

/// Changes of a column that are not zero.
fn changes(axis: &[f64]) -> impl Iterator<Item = f64> + Clone {
    let changes = axis.windows(2).map(|x| (x[1] - x[0]).abs());
    changes.filter(|change| *change > 0.0)
}

/// Smallest change of a column; none of a constant one.
fn step(axis: &[f64]) -> Option<f64> {
    changes(axis).reduce(f64::min)
}

/// Quantizer step of a column; `None` for a constant one.
#[must_use]
pub fn quantizer_step(axis: &[f64]) -> Option<QuantizerStep> {
    let step = step(axis)?;
    let changes = median(changes(axis)) / step;
    Some(QuantizerStep { step, changes })
}

/// The values that are there.
fn present(axis: &[f64]) -> Cow<'_, [f64]> {
    match axis.iter().any(|x| x.is_nan()) {
        true => axis.iter().copied().filter(|x| !x.is_nan()).collect(),
        false => Cow::from(axis),
    }
}

/// Chance that all axes have the value of the row before. An axis explains its own share of such rows, but no more than its
/// step does: differences of a rounded Gaussian are zero 0.27 times in this many steps as their median has; ten leaves room for
/// numbers of this many digits, whose steps differ by ten.
/// Rows that are `held` are none of chance.
fn chance(axes: &[&[f64]], held: f64) -> f64 {
    let most: Vec<f64> = axes
        .iter()
        .map(|axis| {
            quantizer_step(axis).map_or(1.0, |quantizer_step| 10.0 / quantizer_step.changes)
        })
        .collect();
    let rows = axes.first().map_or(0, |axis| axis.len());
    let starts = (0..rows.saturating_sub(1)).step_by(BLOCK);
    let blocks = starts.map(|from| from..(from + BLOCK).min(rows - 1));
    let all = blocks.map(|block| {
        let share = |axis: &&[f64]| {
            let equal = block.clone().filter(|k| axis[*k] == axis[k + 1]);
            let share = equal.count() as f64 / block.len() as f64;
            ((share - held) / (1.0 - held)).max(0.0)
        };
        let shares = axes
            .iter()
            .zip(&most)
            .map(|(axis, most)| share(axis).min(*most));
        shares.product::<f64>() * block.len() as f64
    });
    all.sum::<f64>() / (rows.max(2) - 1) as f64
}

/// Rows that are the row before once more, in stamp and all values.
#[must_use]
pub fn copies(stamps: &[f64], columns: &[&[f64]]) -> Vec<usize> {
    let stands = (1..stamps.len()).filter(|k| stamps[*k] == stamps[k - 1]);
    let stands: Vec<usize> = stands.collect();
    let is_copy = |k: &usize| columns.iter().all(|x| x[*k] == x[k - 1]);
    let copies: Vec<usize> = stands.iter().copied().filter(is_copy).collect();
    let is_beyond =
        !copies.is_empty() && is_beyond(copies.len(), stands.len(), chance(columns, 0.0));
    copies.into_iter().filter(|_| is_beyond).collect()
}

/// Rows in which every column is exactly zero, where one of the accelerometers has a mean over ten of its steps, which no
/// noise takes to zero on all axes at once.
#[must_use]
pub fn zero_rows(columns: &[&[f64]], accel: &[&[f64]]) -> Vec<usize> {
    let rows = columns.first().map_or(0, |x| x.len());
    let zero: Vec<usize> = (0..rows)
        .filter(|k| columns.iter().all(|x| x[*k] == 0.0))
        .collect();
    let has_gravity = |axis: &&[f64]| {
        let mean = axis.iter().sum::<f64>() / (rows - zero.len()).max(1) as f64;
        let spread = axis
            .iter()
            .filter(|x| **x != 0.0)
            .map(|x| (x - mean).powi(2));
        let spread = (spread.sum::<f64>() / (rows - zero.len()).max(1) as f64).sqrt();
        let step = step(axis).unwrap_or(f64::INFINITY);
        mean.abs() > (10.0 * step).max(6.0 * spread)
    };
    let is_lost = !zero.is_empty() && accel.iter().any(has_gravity);
    zero.into_iter().filter(|_| is_lost).collect()
}

/// Share of zeros in a column, where its step does not explain them: a dead band, or zeros for lost samples. About any mean
/// the density at zero is at most that within the median of |x|, times two for its mode.
#[must_use]
pub fn zeros(axis: &[f64]) -> Option<f64> {
    let zeros = axis.iter().filter(|x| **x == 0.0).count();
    if zeros == 0 {
        return None;
    }
    let other = axis.iter().map(|x| x.abs()).filter(|x| *x > 0.0);
    let there = zeros + other.clone().count();
    let width = median(other) / step(axis)?;
    let p = 10.0 / width;
    let share = zeros as f64 / there as f64;
    (p < 0.5 && share > p + 0.005 && is_beyond(zeros, there, p)).then_some(share)
}

/// Share of a column at one of its extremes, and that value, where the next value inward is far rarer: the range of a sensor was
/// exceeded. The tail of a noise has no more at its end than one step inside, that of a sine 2.4 times as much; a column of few
/// steps about its median has no tail to tell by.
#[must_use]
pub fn clipped(axis: &[f64]) -> Option<(f64, f64)> {
    let there = || axis.iter().copied().filter(|x| x.is_finite());
    [-1.0, 1.0].into_iter().find_map(|sign| {
        // the value farthest out and the next, each with its number
        let (mut end, mut inside) = ((f64::NEG_INFINITY, 0), (f64::NEG_INFINITY, 0));
        for x in there().map(|x| sign * x) {
            if x > end.0 {
                (end, inside) = ((x, 1), end);
            } else if x == end.0 {
                end.1 += 1;
            } else if x > inside.0 {
                inside = (x, 1);
            } else if x == inside.0 {
                inside.1 += 1;
            }
        }
        let ((end, at_end), (_, next)) = (end, inside);
        let is_tail = || Some((sign * end - median(there())).abs() >= FINE * step(axis)?);
        (next > 0 && is_beyond(at_end, at_end + next, 0.75) && is_tail()?)
            .then(|| (at_end as f64 / there().count() as f64, sign * end))
    })
}

/// Rows that repeat the one before on all axes of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct RepeatedRows {
    /// Share of the rows that repeat the one before, beyond chance.
    pub share: f64,
    /// Rows of a sample of the sensor, and the first row of each sample, where the sensor has a rate of its own.
    pub held: Option<(f64, Vec<usize>)>,
    /// Rows that repeat the one before, where hardly one of them is chance.
    pub rows: Vec<usize>,
}

/// First rows and lengths of stretches in which no axis changes.
fn runs<'a>(axes: &'a [&'a [f64]]) -> impl Iterator<Item = (usize, usize)> + Clone + 'a {
    let rows = axes.first().map_or(0, |axis| axis.len());
    let begins = move |k: &usize| *k == rows || axes.iter().any(|x| x[*k] != x[k - 1]);
    let mut from = 0;
    (1..=rows).filter(begins).map(move |to| {
        let run = (from, to - from);
        from = to;
        run
    })
}

/// The repeated rows of a sensor, if there are more than its steps explain. Stretches far longer than the usual one are
/// frozen, not repeated, and do not count.
#[must_use]
pub fn repeats(axes: &[&[f64]]) -> Option<RepeatedRows> {
    /// Share of repeated rows that changes no figure.
    const LEAST: [f64; 2] = [0.005, 0.05];
    let runs = runs(axes);
    runs.clone().next()?;
    let usual = median(runs.clone().map(|(_, rows)| rows as f64));
    let longest = 8 * usual as usize + 24;
    let counted = runs.clone().filter(|(_, rows)| *rows <= longest);
    let add = |(rows, repeated), (_, own)| (rows + own, repeated + own - 1);
    let (rows, repeated) = counted.clone().fold((0, 0), add);
    if repeated == 0 {
        return None;
    }
    let p = repeated as f64 / rows.max(1) as f64;
    let beyond = |by_chance: f64| (p - by_chance) / (1.0 - by_chance);
    let by_chance = chance(axes, 0.0);
    let (is_rare, mut share) = (by_chance < 1e-3, beyond(by_chance));
    let least = LEAST[usize::from(!is_rare || axes.len() == 1)];
    if !(share > least && is_beyond(repeated, rows, by_chance)) {
        return None;
    }
    for _ in 0..8 {
        share = beyond(chance(axes, share));
    }
    // a stretch of n rows is of as many samples as have no more rows
    let per_sample = 1.0 / (1.0 - share);
    let firsts = runs.flat_map(|(from, rows)| {
        let samples = ((rows - 1) as f64 / per_sample) as usize + 1;
        (0..samples).map(move |k| from + k * rows / samples)
    });
    let firsts: Vec<usize> = firsts.collect();
    let total = axes[0].len();
    let per_sample = total as f64 / firsts.len() as f64;
    let repeated = counted.flat_map(|(from, rows)| from + 1..from + rows);
    Some(RepeatedRows {
        share,
        rows: repeated.filter(|_| is_rare).collect(),
        held: is_regular(&firsts, total).then_some((per_sample, firsts)),
    })
}

/// True if nine of ten windows have the same number of samples, give or take two: repeated at random, they would differ by the
/// root of the number of repeated rows.
fn is_regular(firsts: &[usize], rows: usize) -> bool {
    let width = (rows / 8).clamp(1, 1000);
    let mut counts = vec![0.0_f64; rows / width];
    for first in firsts {
        if let Some(count) = counts.get_mut(first / width) {
            *count += 1.0;
        }
    }
    let usual = median(counts.iter().copied());
    let near = counts.iter().filter(|count| (*count - usual).abs() <= 2.0);
    10 * near.count() >= 9 * counts.len()
}

/// Stretches of rows in which a column of fine steps holds one value: three times as long as the longest that its step
/// explains.
#[must_use]
pub fn frozen(axis: &[f64]) -> Vec<Range<usize>> {
    /// Fewest rows.
    const LEAST: usize = 16;
    let axes = [axis];
    let long = |least| runs(&axes).filter(move |(_, rows)| *rows >= least);
    let quantizer_step = long(LEAST).next().and_then(|_| quantizer_step(axis));
    let Some(quantizer_step) =
        quantizer_step.filter(|quantizer_step| quantizer_step.changes >= FINE)
    else {
        return Vec::new();
    };
    let longest = (axis.len() as f64 / LEVEL).ln() / quantizer_step.changes.ln();
    let least = ((3.0 * longest).ceil() as usize).max(LEAST);
    long(least).map(|(from, rows)| from..from + rows).collect()
}

/// Share of samples on the line between their neighbours, where steps do not explain it: samples that were interpolated. Second
/// differences of noise have a mode no higher than their neighbourhood; those of interpolated samples have two sizes, rounding
/// and that of the noise.
#[must_use]
pub fn interpolated(axis: &[f64]) -> Option<f64> {
    let step = step(axis)?;
    let largest = axis.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let rounding = (2.01 * step).max(4.0 * f64::EPSILON * largest);
    let moving = axis.windows(3).filter(|x| x[0] != x[1] && x[1] != x[2]);
    let second = moving.map(|x| (x[2] - 2.0 * x[1] + x[0]).abs());
    let second = second.filter(|d| d.is_finite());
    let count = |(trials, on_line, near), d| {
        let (is_on_line, is_near) = (d <= rounding, d > rounding && d <= 8.0 * rounding);
        (
            trials + 1,
            on_line + usize::from(is_on_line),
            near + usize::from(is_near),
        )
    };
    let (trials, on_line, near) = second.clone().fold((0, 0, 0), count);
    if trials < BLOCK {
        return None;
    }
    // of the rounded 5 values against 28; twice and more for a peak
    let explained = 0.5 * near as f64 / trials.max(1) as f64;
    let share = on_line as f64 / trials.max(1) as f64;
    let is_apart = || on_line < trials && median(second.filter(|d| *d > rounding)) > 8.0 * rounding;
    (share > 0.1 + explained && is_beyond(on_line, trials, explained) && is_apart())
        .then_some(share)
}

/// White noise of a column (units·√s), from the median change of its samples; none where steps hide it.
#[must_use]
pub fn white_noise(axis: &[f64], rate_hz: f64) -> Option<f64> {
    let quantizer_step =
        quantizer_step(&present(axis)).filter(|quantizer_step| quantizer_step.changes >= FINE)?;
    Some(quantizer_step.changes * quantizer_step.step / (MAD_OF_NORMAL * SQRT_2 * rate_hz.sqrt()))
}

/// Change of the mean from one second to the next from which on a unit moves (m/s² or rad/s): 0.3° of tilt, or turning with
/// 0.25 °/s. The white noise of the noisiest units in the catalogue changes it by a tenth.
const fn motion(sensor: Sensor) -> f64 {
    match sensor {
        Sensor::Accel => 0.05,
        Sensor::Gyro => 0.0044,
    }
}

/// Two axes whose samples are the same, of 64 changes and more: one was written twice.
#[must_use]
pub fn copied(axes: &[&[f64]]) -> Option<(usize, usize)> {
    let is_same = |a: &[f64], b: &[f64]| {
        let pairs = a.iter().zip(b);
        let changes = a.windows(2).filter(|x| x[0] != x[1]);
        pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits()) && changes.count() >= 64
    };
    let mut pairs = (1..axes.len()).flat_map(|later| (0..later).map(move |first| (first, later)));
    pairs.find(|(first, later)| is_same(axes[*first], axes[*later]))
}

/// Seconds in which a unit moves, and all of them: its mean changes by more than a unit at rest, by more than its white noise
/// explains, and by more than the steps of all seconds do (those of noise with stationary increments, walks too, are Gaussian of
/// one size); or samples change by four times as much as usual. Where noise is not stationary because the level of a second
/// differs more than χ² does, the unit moves most of the time, and the usual step tells nothing.
#[must_use]
pub fn moving(recording: &Recording) -> (usize, usize) {
    let width = recording.rate_hz.round() as usize;
    let seconds = recording.len() / width.max(1);
    if width < 10 || seconds < 10 {
        return (0, seconds);
    }
    // 3.4 deviations of a median of this many; Gaussian tail of the means of all seconds and axes
    let sampling = 1.0 + 4.0 / (seconds as f64).sqrt();
    let z = (2.0 * (12.0 * seconds as f64 / LEVEL).ln()).sqrt();
    let mut moves = vec![false; seconds];
    for signal in &recording.signals {
        let step = step(&present(&signal.samples)).unwrap_or(0.0);
        let windows = || signal.samples.chunks_exact(width);
        let means: Vec<f64> = windows()
            .map(|x| x.iter().sum::<f64>() / width as f64)
            .collect();
        let square = |x: &[f64]| {
            let squares = x.windows(2).map(|x| (x[1] - x[0]).powi(2));
            squares.sum::<f64>() / (width - 1) as f64
        };
        let squares: Vec<f64> = windows().map(square).collect();
        let steps: Vec<f64> = means.windows(2).map(|x| (x[1] - x[0]).abs()).collect();
        let there = |all: &[f64]| {
            all.iter()
                .copied()
                .filter(|x| !x.is_nan())
                .collect::<Vec<_>>()
        };
        let (usual, own) = (there(&steps), there(&squares));
        if usual.is_empty() || own.is_empty() {
            continue;
        }
        let level = median(own.iter().copied()).max(step * step);
        let levels = own
            .iter()
            .map(|square| (square.max(step * step) / level).ln().abs());
        // the squares of second differences of white noise are of half as many
        let explained = 2.0 * MAD_OF_NORMAL / (width as f64).sqrt() * sampling;
        let is_stationary = median(levels) < explained;
        let usual = if is_stationary {
            median(usual.into_iter()) / MAD_OF_NORMAL
        } else {
            0.0
        };
        // white noise by the quietest tenth, which χ² of ten samples has below 0.36 of its mean
        let mut quiet = own;
        let tenth = quiet.len() / 10;
        let quiet = *quiet.select_nth_unstable_by(tenth, f64::total_cmp).1;
        let below = (1.0 - 2.6 / (width as f64).sqrt()).max(0.36);
        let noise = (quiet / (below * width as f64)).sqrt();
        let limit = motion(signal.channel.sensor)
            .max(z * noise.max(sampling * usual))
            .max(1.5 * step);
        for k in 0..seconds {
            moves[k] |= squares[k] > 16.0 * level || k > 0 && steps[k - 1] > limit;
        }
    }
    (moves.iter().filter(|moves| **moves).count(), seconds)
}

/// Means of blocks of a column, and how many samples are in each.
type Blocks = Vec<(f64, f64)>;

/// The blocks of one sample each.
fn samples_of(axis: &[f64]) -> Blocks {
    let block = |x: &f64| if x.is_nan() { (0.0, 0.0) } else { (*x, 1.0) };
    axis.iter().map(block).collect()
}

/// Each two blocks as one.
fn joined(blocks: &[(f64, f64)]) -> Blocks {
    let join = |pair: &[(f64, f64)]| {
        let ((a, of_a), (b, of_b)) = (pair[0], pair[1]);
        let count = of_a + of_b;
        ((a * of_a + b * of_b) / count.max(1.0), count)
    };
    blocks.chunks_exact(2).map(join).collect()
}

/// Haar wavelet coefficients without overlap, of blocks of `width` samples: NaN where more than half a block is missing. Those of
/// white noise and of a random walk are independent of one another, those between nearly so.
fn haar(blocks: &[(f64, f64)], width: f64) -> Vec<f64> {
    let of = |pair: &[(f64, f64)]| match pair[0].1.min(pair[1].1) < 0.5 * width {
        true => f64::NAN,
        false => pair[1].0 - pair[0].0,
    };
    blocks.chunks_exact(2).map(of).collect()
}

/// Slope of a column (units a sample), where it is more than a random walk explains: its Haar coefficients at the longest scale
/// with 32 of them are independent and without a mean in any noise with stationary increments, so their mean is Student's t
/// of 31 degrees of freedom and more. It exceeds its limit with 5e-6, which is for six axes.
#[must_use]
pub fn drift(axis: &[f64]) -> Option<f64> {
    const COEFFICIENTS: usize = 32;
    const LIMIT: f64 = 5.5;
    let (mut blocks, mut width) = (samples_of(axis), 1.0);
    while blocks.len() >= 4 * COEFFICIENTS {
        (blocks, width) = (joined(&blocks), 2.0 * width);
    }
    let mut all = haar(&blocks, width);
    all.retain(|x| x.is_finite());
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    let square = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // what a column of few steps has is no normal distribution
    let is_drift = all.len() >= COEFFICIENTS && width >= 16.0;
    (is_drift && mean.abs() > LIMIT * (square / n).sqrt()).then(|| mean / width)
}

/// Noise that two axes share.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedNoise {
    /// The axes.
    pub axes: [usize; 2],
    /// Correlation at the averaging time at which it is largest.
    pub correlation: f64,
    /// Averaging times at which they are correlated, the first and the last (samples).
    pub averages: [f64; 2],
}

/// Correlation below which intervals of two axes are those of independent ones, to 5 %.
const LEAST_CORRELATION: f64 = 0.1;

/// Pairs of axes that share noise: their Haar coefficients have the same sign more often, or more rarely, than by chance.
/// Signs hold for any distribution and any change of its level; of normal ones with correlation ρ a share of 1/2 + asin(ρ)/π
/// is the same. At each scale as many of them count as there are coefficients, which are independent as `haar` says.
#[must_use]
pub fn shared_noise(axes: &[&[f64]]) -> Vec<SharedNoise> {
    let pairs = (1..axes.len()).flat_map(|later| (0..later).map(move |first| [first, later]));
    let is_copy = |[a, b]: &[usize; 2]| copied(&[axes[*a], axes[*b]]).is_some();
    let pairs: Vec<[usize; 2]> = pairs.filter(|pair| !is_copy(pair)).collect();
    let mut found: Vec<Option<SharedNoise>> = vec![None; pairs.len()];
    let rows = axes.first().map_or(0, |axis| axis.len());
    let tests = 2.0 * pairs.len() as f64 * (rows.max(2) as f64).log2();
    let mut blocks: Vec<Blocks> = axes.iter().map(|axis| samples_of(axis)).collect();
    let mut width = 1.0;
    while blocks.first().is_some_and(|blocks| blocks.len() >= 4) {
        let signs: Vec<Vec<Signs>> = blocks.iter().map(|own| signs(&haar(own, width))).collect();
        for (pair, found) in pairs.iter().zip(&mut found) {
            let correlation = sign_correlation(&signs[pair[0]], &signs[pair[1]], tests);
            let Some(correlation) = correlation.filter(|x| x.abs() >= LEAST_CORRELATION) else {
                continue;
            };
            let own = found.get_or_insert(SharedNoise {
                axes: *pair,
                correlation,
                averages: [width, width],
            });
            own.averages[1] = width;
            if correlation.abs() > own.correlation.abs() {
                own.correlation = correlation;
            }
        }
        blocks = blocks.iter().map(|own| joined(own)).collect();
        width *= 2.0;
    }
    found.into_iter().flatten().collect()
}

/// Bits of 64 values: those above the median, and those below it.
type Signs = [u64; 2];

fn signs(values: &[f64]) -> Vec<Signs> {
    let there = values.iter().copied().filter(|x| x.is_finite());
    let middle = there.clone().next().map_or(f64::NAN, |_| median(there));
    let of = |values: &[f64]| {
        let bits = values.iter().enumerate();
        bits.fold([0; 2], |[above, below], (i, x)| {
            let bit = |is_there| u64::from(is_there) << i;
            [above | bit(*x > middle), below | bit(*x < middle)]
        })
    };
    values.chunks(64).map(of).collect()
}

/// Correlation by signs, where one of so many tests that find none has a share of [`LEVEL`].
fn sign_correlation(a: &[Signs], b: &[Signs], tests: f64) -> Option<f64> {
    let (mut trials, mut same, mut above) = (0_usize, 0_usize, [0_usize; 2]);
    let count = |bits: u64| bits.count_ones() as usize;
    for ([a, below_a], [b, below_b]) in a.iter().zip(b) {
        let both = (a | below_a) & (b | below_b);
        trials += count(both);
        same += count(a & b | below_a & below_b);
        above[0] += count(a & both);
        above[1] += count(b & both);
    }
    // steps put more on one side of the median than on the other
    let [of_a, of_b] = above.map(|count| count as f64 / trials.max(1) as f64);
    let by_chance = of_a * of_b + (1.0 - of_a) * (1.0 - of_b);
    let share = same as f64 / trials.max(1) as f64;
    let beyond = log_improbability(same, trials, by_chance).max(log_improbability(
        trials - same,
        trials,
        1.0 - by_chance,
    ));
    (beyond > (tests / LEVEL).ln()).then(|| {
        (PI * (share - by_chance))
            .clamp(-FRAC_PI_2, FRAC_PI_2)
            .sin()
    })
}

/// Marks of the samples of a sensor, to be found again in another recording: hashes of some of its windows of 64 rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleFingerprint {
    /// One window in this many is kept, a power of two.
    one_in: u64,
    hashes: HashSet<u64>,
}

/// The marks of all axes of a sensor. Windows with fewer than 16 changes are left out: rows of coarse steps agree by chance.
#[must_use]
pub fn marks(axes: &[&[f64]]) -> SampleFingerprint {
    const WINDOW: usize = 64;
    const BASE: u64 = 0x9e37_79b9_7f4a_7c15;
    let rows = axes.first().map_or(0, |axis| axis.len());
    let mix = |hash: u64| (hash ^ (hash >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let of_row = |k: usize| {
        let bits = axes.iter().map(|x| (x[k] + 0.0).to_bits());
        bits.fold(0, |hash, bits| mix(hash ^ mix(bits).wrapping_add(BASE)))
    };
    let hashes: Vec<u64> = (0..rows).map(of_row).collect();
    let one_in = (rows as u64 >> 12).next_power_of_two();
    let oldest = (0..WINDOW).fold(1_u64, |power, _| power.wrapping_mul(BASE));
    let (mut rolling, mut changes) = (0_u64, 0);
    let (mut kept, mut windows) = (HashSet::new(), 0);
    for k in 0..rows {
        rolling = rolling.wrapping_mul(BASE).wrapping_add(hashes[k]);
        changes += usize::from(k > 0 && hashes[k] != hashes[k - 1]);
        if let Some(out) = k.checked_sub(WINDOW) {
            rolling = rolling.wrapping_sub(hashes[out].wrapping_mul(oldest));
            changes -= usize::from(hashes[out + 1] != hashes[out]);
        }
        let mark = mix(mix(rolling));
        if k + 1 >= WINDOW && changes >= 16 && mark % one_in == 0 {
            windows += 1;
            kept.insert(mark);
        }
    }
    // what comes again in one recording tells nothing of two
    if 2 * kept.len() < windows {
        kept.clear();
    }
    SampleFingerprint {
        one_in,
        hashes: kept,
    }
}

impl SampleFingerprint {
    /// Share of the samples that are those of another recording, from four windows on.
    #[must_use]
    pub fn shared_with(&self, other: &Self) -> Option<f64> {
        let one_in = self.one_in.max(other.one_in);
        let own = self.hashes.iter().filter(|mark| *mark % one_in == 0);
        let own: Vec<&u64> = own.collect();
        let shared = own
            .iter()
            .filter(|mark| other.hashes.contains(mark))
            .count();
        (shared >= 4).then(|| shared as f64 / own.len() as f64)
    }
}
