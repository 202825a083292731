//! Distance of each recording from the others, over neighbouring scales and all axes of a sensor.
//!
//! A contrast is the mean of ln nu over a window of neighbouring scales, of one axis. The distance of a
//! recording is F = Σ_axes d²/(1 + 1/n) / (A·max(s², v)): d from the mean of the n others, s² their variance,
//! pooled over the A axes, v what noise alone makes (sampling law). When recordings differ by Gaussian
//! numbers, alike on the axes, F follows Fisher's law with A and A(n − 1) degrees of freedom, or lies below.
//! The spread is that of the contrast itself, so however the scales hang together, nothing is assumed of it.

use crate::curve::sampling::SamplingDistribution;
use crate::rng::{Generator, StreamKey};
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Fewer recordings cannot say which of them is abnormal.
pub const FEWEST: usize = 4;

/// Fewest recordings of which one of the others may be passed over.
const FEWEST_TO_PASS_OVER: usize = 6;

/// Values of every file on one axis, level by level as far as it has them; none of a file without that axis.
type Files = Vec<Option<Vec<f64>>>;

/// ln nu of every file on the axes of a sensor, `[axis][file][level]`; not every file has every axis.
pub(super) struct LogVarianceTable {
    pub(super) logs: Vec<Files>,
    /// Only what lies above the others counts.
    pub(super) above_only: bool,
}

impl LogVarianceTable {
    /// New files of the same noise, that differ by Gaussian numbers besides, of the standard deviation given
    /// for each level, independent from level to level; of their variance the axes of a file share a part.
    fn drawn(
        &self,
        noise: &[NullScatter],
        between: &[f64],
        shared: f64,
        generator: &mut Generator,
    ) -> Self {
        let files = self.logs.first().map_or(0, Vec::len);
        let mut normals = || -> Vec<f64> {
            between
                .iter()
                .map(|_| generator.sample(StandardNormal))
                .collect()
        };
        let common: Vec<Vec<f64>> = (0..files).map(|_| normals()).collect();
        let mut file = |noise: &NullScatter, k: usize, own: &Option<Vec<f64>>| {
            own.as_ref().map(|own| {
                let values = noise.draw(k, generator);
                let difference = |(((value, b), common), seen): (((f64, &f64), &f64), &f64)| {
                    let own: f64 = generator.sample(StandardNormal);
                    // NaN for what is no evidence: drawn, it would be one more chance of a large F.
                    let mask = if seen.is_finite() { 0.0 } else { f64::NAN };
                    mask + value + b * (shared.sqrt() * common + (1.0 - shared).sqrt() * own)
                };
                values
                    .into_iter()
                    .zip(between)
                    .zip(&common[k])
                    .zip(own)
                    .map(difference)
                    .collect()
            })
        };
        let axis = |(files, noise): (&Files, &NullScatter)| {
            files
                .iter()
                .enumerate()
                .map(|(k, own)| file(noise, k, own))
                .collect()
        };
        Self {
            logs: self.logs.iter().zip(noise).map(axis).collect(),
            above_only: self.above_only,
        }
    }

    /// Share that the axes of a file have in common of the variance by which the active files differ beyond
    /// their noise: the covariance between axes over the excess variance, over all levels, each weighted by
    /// its certainty.
    fn shared(&self, noise: &[NullScatter], between: &[f64], active: &[bool]) -> f64 {
        let (mut covariance, mut variance) = (0.0, 0.0);
        for (j, between) in between.iter().enumerate() {
            let contrasts = self.contrasts(noise, ScaleWindow { first: j, width: 1 }, j, active);
            for (i, one) in contrasts.iter().enumerate() {
                for other in &contrasts[..i] {
                    let pairs = one.values.iter().zip(&other.values);
                    let products: Vec<f64> =
                        pairs.filter_map(|(x, y)| Some((*x)? * (*y)?)).collect();
                    let excess = between * between;
                    // Inverse variance of a product of two independent values about 0, both of the mean noise
                    // plus the excess.
                    let weight = (0.5 * (one.noise + other.noise) + excess).powi(-2);
                    // Signals have independent noise: what two axes have in common is what recordings differ
                    // by.
                    covariance +=
                        weight * products.iter().sum::<f64>() / (products.len() as f64 - 1.0);
                    variance += weight * excess;
                }
            }
        }
        let share = covariance / variance;
        if share.is_finite() {
            share.clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// Standard deviation by which the active files differ at each level, beyond their noise.
    pub(super) fn between(&self, noise: &[NullScatter], active: &[bool]) -> Vec<f64> {
        let levels = noise.first().map_or(0, NullScatter::levels);
        let level = |j: usize| {
            let contrasts = self.contrasts(noise, ScaleWindow { first: j, width: 1 }, j, active);
            let (mut squares, mut freedom, mut own) = (0.0, 0.0, 0.0);
            for axis in &contrasts {
                squares += axis.squares;
                freedom += axis.count - 1.0;
                // Moments: E Σ(x − mean)² = (n − 1)(noise + between²), summed over the axes before the
                // quotient.
                own += axis.noise * (axis.count - 1.0);
            }
            let excess = (squares - own) / freedom;
            if excess.is_finite() {
                excess.max(0.0).sqrt()
            } else {
                0.0
            }
        };
        (0..levels).map(level).collect()
    }

    /// The contrasts of a window, of each axis with enough active files.
    fn contrasts(
        &self,
        noise: &[NullScatter],
        window: ScaleWindow,
        index: usize,
        active: &[bool],
    ) -> Vec<Contrast> {
        let axis = |a: usize| {
            let (files, noise) = (self.logs.get(a)?, noise.get(a)?);
            // A short recording has no value at the longest scales.
            let mean = |logs: &Vec<f64>| {
                Some(logs.get(window.range())?.iter().sum::<f64>() / window.width as f64)
            };
            let values: Vec<Option<f64>> = files
                .iter()
                .zip(active)
                .map(|(f, on)| f.as_ref().filter(|_| *on).and_then(mean))
                .collect();
            Contrast::new(a, values, &noise.variances[index])
        };
        (0..self.logs.len()).filter_map(axis).collect()
    }
}

/// The values of one axis at one window, about their mean.
struct Contrast {
    axis: usize,
    values: Vec<Option<f64>>,
    /// Σ of all values and of their squares.
    sum: f64,
    squares: f64,
    count: f64,
    /// Variance by noise alone: the mean over the files, and the excess of each over it.
    noise: f64,
    excess: Vec<f64>,
}

/// Statistics of the values without one or two of them.
struct LeaveOutStatistics {
    mean: f64,
    /// Σ of the squares about the mean.
    squares: f64,
    count: f64,
}

impl Contrast {
    fn new(axis: usize, mut values: Vec<Option<f64>>, variances: &[f64]) -> Option<Self> {
        let count = values.iter().flatten().count() as f64;
        let mean = values.iter().flatten().sum::<f64>() / count;
        let present = || {
            values
                .iter()
                .zip(variances)
                .filter(|(v, _)| v.is_some())
                .map(|(_, s)| s)
        };
        let noise = present().sum::<f64>() / count;
        // A silent scale (coarse quantisation) has no logarithm, and says nothing, as one does that is no evidence.
        if count < FEWEST as f64 || !mean.is_finite() {
            return None;
        }
        // About the mean before squares are summed, so that `without` may subtract from them and keep its
        // digits.
        values.iter_mut().flatten().for_each(|v| *v -= mean);
        let (sum, squares) = (
            values.iter().flatten().sum(),
            values.iter().flatten().map(|v| v * v).sum(),
        );
        let excess = variances.iter().map(|s| (s - noise).max(0.0)).collect();
        Some(Self {
            axis,
            values,
            sum,
            squares,
            count,
            noise,
            excess,
        })
    }

    fn without(&self, one: usize, other: usize) -> LeaveOutStatistics {
        let (mut sum, mut squares, mut count) = (self.sum, self.squares, self.count);
        for value in [one, other]
            .into_iter()
            .filter_map(|k| *self.values.get(k)?)
        {
            sum -= value;
            squares -= value * value;
            count -= 1.0;
        }
        LeaveOutStatistics {
            mean: sum / count,
            squares: (squares - sum * sum / count).max(0.0),
            count,
        }
    }
}

/// Distance of a file from the others at one window.
#[derive(Debug, Clone)]
pub(super) struct Distance {
    /// F, with one of the others passed over or none.
    f: f64,
    /// For each axis (index), d in standard deviations.
    pub(super) deviations: Vec<(usize, f64)>,
}

/// F of a file against the others, or all of them but the one without which they agree best.
fn distance(contrasts: &[Contrast], file: usize, pass_over: bool) -> Option<Distance> {
    let own: Vec<&Contrast> = contrasts
        .iter()
        .filter(|c| c.values.get(file).copied().flatten().is_some())
        .collect();
    let spread = |other: usize| {
        let rests = || own.iter().map(|c| c.without(file, other));
        rests().map(|r| r.squares).sum::<f64>() / rests().map(|r| r.count - 1.0).sum::<f64>()
    };
    let files = own.first()?.values.len();
    // Two that are abnormal alike widen each other's reference; without the one that widens it most, the
    // first stands out.
    let other = if pass_over {
        let candidates = (0..files).filter(|h| *h != file && own[0].values[*h].is_some());
        candidates
            .map(|h| (spread(h), h))
            .min_by(|a, b| a.0.total_cmp(&b.0))?
            .1
    } else {
        usize::MAX
    };
    let noise = own.iter().map(|c| c.noise).sum::<f64>() / own.len() as f64;
    // A spread below the noise is chance; divided by it any recording would look far off.
    let scale2 = spread(other).max(noise);
    let of_axis = |c: &&Contrast| {
        let rest = c.without(file, other);
        let d = c.values[file].unwrap_or(rest.mean) - rest.mean;
        (
            c.axis,
            d / (scale2 * (1.0 + 1.0 / rest.count) + c.excess[file]).sqrt(),
        )
    };
    let deviations: Vec<(usize, f64)> = own.iter().map(of_axis).collect();
    let f = deviations.iter().map(|(_, z)| z * z).sum::<f64>() / deviations.len() as f64;
    f.is_finite().then_some(Distance { f, deviations })
}

/// The largest distances of a file: against all others, and with one of them passed over (0 if too few).
#[derive(Debug, Clone)]
struct LargestDistances {
    /// The two F.
    f: [f64; 2],
    /// The window of each, with the deviations there.
    at: [Option<(ScaleWindow, Distance)>; 2],
}

/// The largest distances of every file.
fn furthest(
    table: &LogVarianceTable,
    noise: &[NullScatter],
    active: &[bool],
) -> Vec<LargestDistances> {
    let levels = noise.first().map_or(0, NullScatter::levels);
    let count = active.iter().filter(|on| **on).count();
    let mut all = vec![
        LargestDistances {
            f: [0.0; 2],
            at: [None, None]
        };
        active.len()
    ];
    for (index, window) in ScaleWindow::all(levels).into_iter().enumerate() {
        let contrasts = table.contrasts(noise, window, index, active);
        for (file, furthest) in all.iter_mut().enumerate().filter(|(k, _)| active[*k]) {
            for pass_over in [false, true] {
                if pass_over && count < FEWEST_TO_PASS_OVER {
                    continue;
                }
                let Some(distance) = distance(&contrasts, file, pass_over) else {
                    continue;
                };
                let above = distance.deviations.iter().map(|(_, z)| z).sum::<f64>() > 0.0;
                if table.above_only && !above {
                    continue;
                }
                let kind = usize::from(pass_over);
                if distance.f > furthest.f[kind] {
                    furthest.f[kind] = distance.f;
                    furthest.at[kind] = Some((window, distance));
                }
            }
        }
    }
    all
}

// Scatter of recordings by noise alone, over windows of neighbouring scales.

/// Numbers of neighbouring scales that are taken together.
const WIDTHS: [usize; 3] = [1, 3, 5];

/// Neighbouring scales.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScaleWindow {
    /// Index of the first.
    pub(super) first: usize,
    /// Number of scales.
    pub(super) width: usize,
}

impl ScaleWindow {
    /// All windows over this many scales.
    fn all(levels: usize) -> Vec<Self> {
        let of_width = |width: usize| {
            (0..(levels + 1).saturating_sub(width)).map(move |first| Self { first, width })
        };
        WIDTHS.into_iter().flat_map(of_width).collect()
    }

    fn range(self) -> std::ops::Range<usize> {
        self.first..self.first + self.width
    }
}

/// Scatter of one axis by noise alone.
#[derive(Debug, Clone)]
pub(super) struct NullScatter {
    kind: NoiseKind,
    /// Degrees of freedom, `[file][level]`.
    edof: Vec<Vec<f64>>,
    /// Variance of the contrast of each window, `[window][file]`.
    variances: Vec<Vec<f64>>,
}

/// Law of the values of a file.
#[derive(Debug, Clone)]
enum NoiseKind {
    /// Logarithms of wavelet variances.
    Law(SamplingDistribution),
    /// One Gaussian number of unit variance, times what its deviation differs by from file to file: the standard deviation of
    /// its logarithm.
    Normal(f64),
}

impl NullScatter {
    /// Noise of files of one Gaussian number each, whose standard deviation is log-normal about 1 with `log_deviation`.
    pub(super) fn normal(files: usize, log_deviation: f64) -> Self {
        let kind = NoiseKind::Normal(log_deviation);
        Self {
            kind,
            edof: vec![vec![1.0]; files],
            variances: vec![vec![1.0; files]],
        }
    }

    /// Levels that its files have at most.
    pub(super) fn levels(&self) -> usize {
        self.edof.first().map_or(0, Vec::len)
    }

    /// Draws the values of a file by noise alone, level by level.
    pub(super) fn draw(&self, file: usize, generator: &mut Generator) -> Vec<f64> {
        match &self.kind {
            NoiseKind::Law(law) => law
                .draw(&self.edof[file], generator)
                .into_iter()
                .map(f64::ln)
                .collect(),
            NoiseKind::Normal(log_deviation) => {
                let mut normal = || generator.sample::<f64, _>(StandardNormal);
                // A normal number whose standard deviation is itself log-normal: recordings differ in how far they move.
                vec![(log_deviation * normal()).exp() * normal()]
            }
        }
    }

    /// Noise of files with these degrees of freedom, `[file][level]`.
    pub(super) fn new(law: SamplingDistribution, edof: Vec<Vec<f64>>) -> Self {
        let levels = edof.first().map_or(0, Vec::len);
        let deviations: Vec<Vec<f64>> = edof
            .iter()
            .map(|e| {
                e.iter()
                    .zip(&law.shapes)
                    .map(|(e, shape)| shape.variance_of_log(*e).sqrt())
                    .collect()
            })
            .collect();
        let of_window = |window: ScaleWindow| {
            let of_file = |s: &Vec<f64>| {
                let pair = |i: usize| {
                    window
                        .range()
                        .map(|j| law.correlation[(i, j)] * s[i] * s[j])
                        .sum::<f64>()
                };
                window.range().map(pair).sum::<f64>() / (window.width * window.width) as f64
            };
            deviations.iter().map(of_file).collect()
        };
        let variances = ScaleWindow::all(levels)
            .into_iter()
            .map(of_window)
            .collect();
        Self {
            kind: NoiseKind::Law(law),
            edof,
            variances,
        }
    }
}

// Alarms: the recordings that are further from the others than chance explains.
//
// The largest F over all windows and files is compared with what it is in sets of alike recordings, drawn by
// the sampling law, that differ as much as these do (their excess variance at each scale, of which the axes share as
// much as they do among the others of the furthest; independent from scale to scale: more chances of a large F than
// real differences, which hang together, have). Then the furthest is taken out and the others are examined again.

/// Probability of an alarm in a set of alike recordings, for one sensor and one question.
pub(super) const FALSE_ALARM: f64 = 0.025;
/// Sets drawn.
const DRAWS: usize = 799;
/// Fewest recordings that can say what axes share of their differences. Of fewer all is taken as shared: three that share
/// all seem to share less so often that alike sets of four were alarmed in 14 %.
const FEWEST_TO_SHARE: usize = 4;
/// Seed of the draws: a diagnosis is an answer, the same each time.
const SEED: u64 = 1;

/// An abnormal file, and where it is so.
pub(super) struct AbnormalFile {
    pub(super) file: usize,
    /// Probability that the most unusual of alike files is as unusual.
    pub(super) p_value: f64,
    pub(super) window: ScaleWindow,
    pub(super) distance: Distance,
}

/// The abnormal files, the most abnormal first. `source` and `process` name the streams.
pub(super) fn alarms(
    table: &LogVarianceTable,
    noise: &[NullScatter],
    source: &str,
    process: &str,
) -> Vec<AbnormalFile> {
    let files = table.logs.first().map_or(0, Vec::len);
    let mut active = vec![true; files];
    let mut found = Vec::new();
    while active.iter().filter(|on| **on).count() >= FEWEST {
        let Some(next) = most_abnormal(table, noise, &active, source, process) else {
            break;
        };
        if next.p_value > FALSE_ALARM {
            break;
        }
        // An abnormal file widens the spread that the others are measured by: without it a second one may
        // show.
        active[next.file] = false;
        found.push(next);
    }
    found
}

fn most_abnormal(
    table: &LogVarianceTable,
    noise: &[NullScatter],
    active: &[bool],
    source: &str,
    process: &str,
) -> Option<AbnormalFile> {
    let mut own = furthest(table, noise, active);
    // With the furthest in it: F itself compares each with the others alone, and sets of alike recordings have a furthest one too.
    // Drawn with the spread of the others, which the furthest leaves too small, alike sets of four were alarmed in 17 %.
    let between = table.between(noise, active);
    // One file that is far off on all axes must not pass for files that share their differences.
    let mut others = active.to_vec();
    if let Some(first) = (0..own.len()).max_by(|a, b| own[*a].f[0].total_cmp(&own[*b].f[0])) {
        others[first] = false;
    }
    let shared = if others.iter().filter(|on| **on).count() < FEWEST_TO_SHARE {
        1.0
    } else {
        table.shared(noise, &table.between(noise, &others), &others)
    };
    let draw = |run: usize| {
        let key = StreamKey {
            seed: SEED,
            scenario: "diagnosis",
            run: run as u64,
            source,
            process,
        };
        let drawn = table.drawn(noise, &between, shared, &mut key.generator());
        // The whole search is repeated for each draw, so that looking at many windows and files is paid for.
        let all = furthest(&drawn, noise, active);
        [0, 1].map(|kind| all.iter().map(|f| f.f[kind]).fold(0.0, f64::max))
    };
    let draws: Vec<[f64; 2]> = (0..DRAWS).into_par_iter().map(draw).collect();
    // Both kinds of F in units of what each exceeds with the probability of a false alarm.
    let limits = [0, 1].map(|kind| limit(draws.iter().map(|d| d[kind]).collect()));
    let joint = |f: &[f64; 2]| {
        f.iter()
            .zip(&limits)
            .map(|(f, limit)| f / limit)
            .fold(0.0, f64::max)
    };
    let file = (0..own.len()).max_by(|a, b| joint(&own[*a].f).total_cmp(&joint(&own[*b].f)))?;
    let LargestDistances { f, at } = own.swap_remove(file);
    let kind = usize::from(f[1] / limits[1] > f[0] / limits[0]);
    let larger = draws.iter().filter(|d| joint(d) >= joint(&f)).count();
    let [plain, passed] = at;
    let (window, distance) = if kind == 0 { plain } else { passed }?;
    Some(AbnormalFile {
        file,
        p_value: (1 + larger) as f64 / (1 + DRAWS) as f64,
        window,
        distance,
    })
}

/// Value that a share [`FALSE_ALARM`] of the values exceeds; 1 where all are 0.
fn limit(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    // Of 799 values 19 lie above this one: 20/800 = 2.5 % with the observed one counted among them.
    let index = ((1.0 - FALSE_ALARM) * values.len() as f64) as usize;
    values
        .get(index)
        .copied()
        .filter(|v| *v > 0.0)
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::sampling::{SamplingDistribution, variance_of_log};
    use crate::noise::{Composite, Process};
    use approx::assert_abs_diff_eq;
    use rand::SeedableRng;

    fn noise(files: usize, levels: usize, edof: f64) -> NullScatter {
        let white = Composite::new(vec![Process::white(1.0).unwrap()]);
        NullScatter::new(
            SamplingDistribution::new(&white, levels),
            vec![vec![edof; levels]; files],
        )
    }

    /// Five files by hand, one axis: the others of the last are −1, −1, 1, 1 (mean 0, variance 4/3), itself
    /// 6: F = 36/(4/3·5/4) = 21.6. (Noise of 1e9 degrees of freedom is nothing.)
    #[test]
    fn a_distance_by_hand() {
        let values = [-1.0, -1.0, 1.0, 1.0, 6.0];
        let table = LogVarianceTable {
            logs: vec![values.iter().map(|v| Some(vec![*v])).collect()],
            above_only: false,
        };
        let found = furthest(&table, &[noise(5, 1, 1e9)], &[true; 5]);
        approx::assert_relative_eq!(found[4].f[0], 21.6, max_relative = 1e-12);
        assert_eq!(found[4].f[1], 0.0, "five are too few to pass one over");
        // With noise of variance 12 the spread of the others does not count: F = 36/(12·5/4).
        let edof = 2.0 / 12.0;
        let law = noise(5, 1, edof);
        let found = furthest(&table, std::slice::from_ref(&law), &[true; 5]);
        approx::assert_relative_eq!(
            found[4].f[0],
            36.0 / (1.25 * variance_of_log(edof)),
            max_relative = 1e-12
        );
    }

    /// Of files that differ by Gaussian numbers F has Fisher's mean m/(m − 2), m = A(n − 1): three axes, seven
    /// others make 18/16. 600 sets of one window: its variance is 2m²(A + m − 2)/(A(m − 2)²(m − 4)) = 1.144, so
    /// four deviations of the mean are 4·√(1.144/600) = 0.175.
    #[test]
    fn distances_follow_fishers_law() {
        let mut generator = Generator::seed_from_u64(5);
        let alike = LogVarianceTable {
            logs: vec![vec![Some(vec![0.0]); 8]; 3],
            above_only: false,
        };
        let noise = [noise(8, 1, 1e9), noise(8, 1, 1e9), noise(8, 1, 1e9)];
        let mut f = || {
            let table = alike.drawn(&noise, &[0.3], 0.0, &mut generator);
            furthest(&table, &noise, &[true; 8])[0].f[0]
        };
        let mean = (0..600).map(|_| f()).sum::<f64>() / 600.0;
        assert_abs_diff_eq!(mean, 18.0 / 16.0, epsilon = 0.175);
    }

    #[test]
    fn one_of_the_others_is_passed_over() {
        let values = [0.0, 0.1, -0.1, 0.05, -0.05, 5.0, 5.0];
        let table = LogVarianceTable {
            logs: vec![values.iter().map(|v| Some(vec![*v])).collect()],
            above_only: false,
        };
        let found = furthest(&table, &[noise(7, 1, 1e9)], &[true; 7]);
        assert!(
            found[6].f[0] < 10.0 && found[6].f[1] > 1000.0,
            "{:?}",
            found[6]
        );
    }
}

#[cfg(test)]
mod alarm_tests {
    use super::*;
    use crate::curve::sampling::SamplingDistribution;
    use crate::noise::{Composite, Process};
    use crate::rng::Generator;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// Four recordings of 2^16 samples whose three axes are louder or quieter together, at all scales, by 35 %: nothing is
    /// unusual in any. 100 sets know a rate of 2.5 % to 1.6 %, of which four are allowed.
    #[test]
    fn four_recordings_that_share_their_differences_are_alarmed_as_said() {
        let white = Composite::new(vec![Process::white(1.0).unwrap()]);
        let law = SamplingDistribution::new(&white, 13);
        let edof = law.edof(1 << 16);
        let noise: Vec<NullScatter> = (0..3)
            .map(|_| NullScatter::new(law.first(13), vec![edof.clone(); 4]))
            .collect();
        let mut generator = Generator::seed_from_u64(1);
        let mut file = || -> [Vec<f64>; 3] {
            let common = 0.3 * generator.sample::<f64, _>(StandardNormal);
            std::array::from_fn(|_| {
                law.draw(&edof, &mut generator)
                    .into_iter()
                    .map(|ratio| ratio.ln() + common)
                    .collect()
            })
        };
        let alarmed = |set: usize| {
            let files: Vec<[Vec<f64>; 3]> = (0..4).map(|_| file()).collect();
            let axis = |a: usize| files.iter().map(|file| Some(file[a].clone())).collect();
            let table = LogVarianceTable {
                logs: (0..3).map(axis).collect(),
                above_only: false,
            };
            usize::from(!alarms(&table, &noise, &set.to_string(), "noise").is_empty())
        };
        let alarms: usize = (0..100).map(alarmed).sum();
        assert!(alarms as f64 <= 2.5 + 4.0 * 1.6, "{alarms} of 100");
    }
}
