//! Spread of replicates: their own scatter, and their differences beyond it.
//!
//! Their ln nu scatter as their variance from replicate to replicate shows. Of that the part `within` follows from the
//! model and the length ([`SamplingDistribution`]); `between` is what is there in excess, if anything (moments of a
//! random-effects model, level by level: ln nu_ij = centre_j + between_ij + within_ij).
//!
//! The axes of a recording may share what recordings differ by (temperature, a mounting), and their own noise never: so
//! `within` is drawn signal by signal, and `between` recording by recording, all axes of a recording with the residuals of
//! one and the same other. That is right whatever they share, from nothing to all, and says what it knows: as many degrees of
//! freedom as there are recordings, less one, where `between` rules, and as there are signals, less one, where it does not.

use crate::curve::sampling::{SamplingDistribution, VarianceDistribution, variance_of_log};
use crate::curve::{Estimator, MAD_TO_DEVIATION, Replicate, falling_root, median, p_value};
use crate::fit::Weighting;
use crate::imu::Axis;
use crate::noise::{Composite, Process};
use crate::outcome::{AxesDiffer, LevelSpread, Outcome};
use crate::rng::{Generator, StreamKey};
use crate::wavelet::{Curve, Tuning};
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, StudentsT};

/// Quantile 0.975 of the normal law.
const NORMAL_975: f64 = 1.959_963_984_540_054;
/// Residuals further than this many deviations count as this many in DR-AWV.
const CLIP: f64 = 3.0;

/// The spread of replicates around an estimator's curve.
pub(crate) struct ReplicateSpread {
    /// Standard deviation of ln nu of a replicate of the same noise, of each level.
    pub(crate) within: Vec<f64>,
    /// Standard deviation of what replicates differ by beyond that.
    pub(crate) between: Vec<f64>,
    /// Degrees of freedom of each replicate at each level.
    pub(crate) edof: Vec<Vec<f64>>,
    /// Degrees of freedom with which ln nu of each replicate at each level scatters as the replicates show it: as they do,
    /// more for the shorter and less for the longer of them.
    total: Vec<Vec<f64>>,
    /// Shape of the law at each level.
    shapes: Vec<VarianceDistribution>,
    /// Residuals of each replicate over their standard deviation, 0 where it has none, so that Σ over replicates of their
    /// squares is K − 1: their combinations with normal weights over √(K − 1) have unit variance and the replicates'
    /// correlations between levels.
    units: Vec<Vec<f64>>,
    /// The recording that each replicate is of, and its position among those of it, from 0.
    origin: Vec<Origin>,
    /// Share of the K − 1 degrees of freedom of a variance that the estimator leaves.
    share_of_freedom: f64,
}

/// A signal's place among the recordings.
pub(super) struct Origin {
    pub(super) recording: usize,
    pub(super) position: usize,
}

/// Signals of one name are of one recording; a signal of its axis has the same position in every recording.
pub(super) fn origins(replicates: &[Replicate]) -> Vec<Origin> {
    let recordings = ranks(replicates.iter().map(|r| &r.name));
    let positions = ranks(replicates.iter().map(|r| r.axis));
    let pairs = recordings.into_iter().zip(positions);
    pairs
        .map(|(recording, position)| Origin {
            recording,
            position,
        })
        .collect()
}

/// Index of each among the different values, by first appearance.
fn ranks<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<usize> {
    let mut known = Vec::new();
    let rank = |value| {
        let found = known.iter().position(|k| *k == value);
        found.unwrap_or_else(|| {
            known.push(value);
            known.len() - 1
        })
    };
    values.map(rank).collect()
}

impl ReplicateSpread {
    pub(crate) fn new(
        replicates: &[Replicate],
        estimator: Estimator,
        law: &SamplingDistribution,
        tuning: &Tuning,
    ) -> Self {
        let levels = law.correlation.nrows();
        let edof: Vec<Vec<f64>> = replicates
            .iter()
            .map(|r| edof(r, estimator, law, tuning))
            .collect();
        let count = replicates.len() as f64;
        let mut within = vec![0.0; levels];
        let mut units = vec![vec![0.0; levels]; replicates.len()];
        let mut total = vec![vec![f64::INFINITY; levels]; replicates.len()];
        let mut between = vec![0.0; levels];
        for j in 0..levels {
            // Short recordings lack the longest scales, and say nothing of them.
            let present: Vec<usize> = (0..replicates.len())
                .filter(|i| replicates[*i].levels() > j)
                .collect();
            let logs: Vec<f64> = present
                .iter()
                .map(|i| replicates[*i].value(estimator, j).ln())
                .collect();
            let shape = &law.shapes[j];
            let noise: Vec<f64> = present
                .iter()
                .map(|i| shape.variance_of_log(edof[*i][j]))
                .collect();
            within[j] = (noise.iter().sum::<f64>() / present.len() as f64).sqrt();
            let scatter = Scatter::new(&logs, &noise, estimator);
            between[j] = scatter.between;
            // The weights of a draw are for the K − 1 degrees of freedom of all.
            let freedom = (present.len() as f64 - 1.0).max(1.0);
            let fewer = ((count - 1.0).max(1.0) / freedom).sqrt();
            for ((i, unit), noise) in present.into_iter().zip(scatter.units).zip(&noise) {
                units[i][j] = unit * fewer;
                total[i][j] =
                    shape.edof_of_log(scatter.factor.powi(2) * (noise + between[j].powi(2)));
            }
        }
        let (origin, share_of_freedom) = (origins(replicates), share_of_freedom(estimator));
        Self {
            within,
            between,
            edof,
            total,
            shapes: law.shapes.clone(),
            units,
            origin,
            share_of_freedom,
        }
    }

    /// Draws nu*/nu of as many new replicates as there are, `[replicate][level]`: with the variances of ln nu that the
    /// replicates show, and their correlations between levels.
    pub(crate) fn draw(&self, generator: &mut Generator) -> Vec<Vec<f64>> {
        let of_replicate = |(scores, total): (Vec<f64>, &Vec<f64>)| {
            // The law whose logarithm has the observed variance: the skew of few degrees of freedom comes with it.
            let ratio = |((score, total), shape): ((f64, &f64), &VarianceDistribution)| {
                shape.ratio(score, *total)
            };
            scores
                .into_iter()
                .zip(total)
                .zip(&self.shapes)
                .map(ratio)
                .collect()
        };
        // The part of the variance of ln nu by which recordings differ, which the axes of a recording share.
        let part = |j: usize| {
            let (within, between) = (self.within[j].powi(2), self.between[j].powi(2));
            if between > 0.0 {
                between / (within + between)
            } else {
                0.0
            }
        };
        let between: Vec<f64> = (0..self.between.len()).map(part).collect();
        self.scores(&between, generator)
            .into_iter()
            .zip(&self.total)
            .map(of_replicate)
            .collect()
    }

    /// Ratio of the quantiles 0.975 of Student's law and the normal one for each process of the model of a curve, by which
    /// draws are stretched because the variances are known from few replicates. 1 for a single replicate, whose
    /// variances are those of the law.
    pub(crate) fn student(&self, model: &Composite, curve: &Curve) -> Vec<f64> {
        self.stretches(model, curve, &self.between, |_| 1.0)
    }

    /// Ratio of [`Self::student`] where replicates differ by these standard deviations, times the median of the deviation that so few replicates show,
    /// over the true one: what half of all calibrations stretch the true scatter by, or less.
    pub(crate) fn stated_where(
        &self,
        model: &Composite,
        curve: &Curve,
        between: &[f64],
    ) -> Vec<f64> {
        self.stretches(model, curve, between, |freedom| {
            let median = ChiSquared::new(freedom).map_or(freedom, |law| law.inverse_cdf(0.5));
            (median / freedom).sqrt()
        })
    }

    fn stretches(
        &self,
        model: &Composite,
        curve: &Curve,
        between: &[f64],
        shown: impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        if self.units.len() < 2 {
            return vec![1.0; model.processes.len()];
        }
        let roots = Weighting::Model.roots(curve, &curve.wv);
        let of_process = |process: &Process| {
            // Of least squares of ln nu, in which the process has a part of each level.
            let levels = curve.levels.iter().zip(&curve.wv).zip(&roots);
            let weight = |((level, wv), root): ((&u32, &f64), &f64)| {
                process.haar_wv(*level) * wv * root * root
            };
            let weights: Vec<f64> = levels.map(weight).collect();
            // Those that the estimator leaves.
            let freedom = (self.share_of_freedom * self.freedom(between, &weights)).max(1.0);
            let student =
                StudentsT::new(0.0, 1.0, freedom).map_or(NORMAL_975, |law| law.inverse_cdf(0.975));
            student / NORMAL_975 * shown(freedom)
        };
        model.processes.iter().map(of_process).collect()
    }

    /// Degrees of freedom of the variance of a weighted mean over signals and levels: of its part that follows from the
    /// signals' own noise one less than there are signals, of what recordings differ by one less than there are
    /// recordings (Satterthwaite's rule, as if the axes shared all of it).
    fn freedom(&self, between: &[f64], weights: &[f64]) -> f64 {
        let (signals, recordings) = (self.units.len() as f64, self.recordings() as f64);
        // Their own noise falls with the number of signals, and is nearly independent from level to level; a parameter that
        // differs moves all its levels alike, in all signals of a recording.
        let own = self
            .within
            .iter()
            .zip(weights)
            .map(|(s, w)| (s * w).powi(2));
        let own = own.sum::<f64>() / signals;
        let common: f64 = between.iter().zip(weights).map(|(b, w)| b * w).sum();
        let common = common.powi(2) / recordings;
        if recordings < 2.0 || own <= 0.0 {
            return signals - 1.0;
        }
        let scatter = own * own / (signals - 1.0) + common * common / (recordings - 1.0);
        (own + common).powi(2) / scatter
    }

    fn recordings(&self) -> usize {
        self.origin
            .iter()
            .map(|origin| origin.recording + 1)
            .max()
            .unwrap_or(0)
    }

    /// Draws what ln nu of as many new replicates as there are differ by, beyond the scatter of each.
    pub(crate) fn draw_between(&self, generator: &mut Generator) -> Vec<Vec<f64>> {
        let all = vec![1.0; self.between.len()];
        let scaled = |scores: Vec<f64>| {
            scores
                .iter()
                .zip(&self.between)
                .map(|(z, b)| z * b)
                .collect()
        };
        self.scores(&all, generator)
            .into_iter()
            .map(scaled)
            .collect()
    }

    /// Normal numbers of each new replicate with the replicates' correlations between levels. `between`: the part of
    /// their variance, level by level, in which the axes of a recording hang together as the recorded ones do.
    fn scores(&self, between: &[f64], generator: &mut Generator) -> Vec<Vec<f64>> {
        let (signals, recordings) = (self.units.len(), self.recordings());
        let mut normals = |count: usize| -> Vec<f64> {
            // Σ unit² is K − 1 over the replicates: weights of variance 1/(K − 1) make a sum of variance 1.
            let freedom = (count as f64 - 1.0).max(1.0);
            (0..count)
                .map(|_| generator.sample::<f64, _>(StandardNormal) / freedom.sqrt())
                .collect()
        };
        // One signal to a recording: what is the recording's and what is the signal's cannot be distinguished,
        // and need not.
        let is_whole = recordings == signals || recordings < 2;
        let of_recordings: Vec<Vec<f64>> = (0..if is_whole { 0 } else { recordings })
            .map(|_| normals(recordings))
            .collect();
        let of_replicate = |own: &Origin| {
            let weights = normals(signals);
            let Some(common) = of_recordings.get(own.recording) else {
                return self.combined(&weights);
            };
            // the new axis takes the residuals of that axis, in the recordings that have it
            let weight = |origin: &Origin| {
                if origin.position == own.position {
                    common[origin.recording]
                } else {
                    0.0
                }
            };
            let common: Vec<f64> = self.origin.iter().map(weight).collect();
            let parts = self
                .combined(&weights)
                .into_iter()
                .zip(self.combined(&common))
                .zip(between);
            // Variances add up: the parts (1 − part) and part of a variance of 1.
            parts
                .map(|((own, common), part)| (1.0 - part).sqrt() * own + part.sqrt() * common)
                .collect()
        };
        self.origin.iter().map(of_replicate).collect()
    }

    /// Weighted sum of the residuals, level by level.
    fn combined(&self, weights: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.between.len()];
        for (weight, unit) in weights.iter().zip(&self.units) {
            sum.iter_mut()
                .zip(unit)
                .for_each(|(sum, u)| *sum += weight * u);
        }
        sum
    }
}

fn edof(
    replicate: &Replicate,
    estimator: Estimator,
    law: &SamplingDistribution,
    tuning: &Tuning,
) -> Vec<f64> {
    let (robust, classical) = (
        law.robust_edof(replicate.samples, tuning),
        law.edof(replicate.samples),
    );
    // A short recording lacks the longest scales.
    let is_robust = |j: usize| j < replicate.levels() && replicate.is_robust(estimator, j);
    let pairs = robust.into_iter().zip(classical).enumerate();
    let whole = |(j, (robust, classical))| (j, if is_robust(j) { robust } else { classical });
    pairs
        .map(whole)
        .map(|(j, edof)| (edof * replicate.covered(j)).max(1.0))
        .collect()
}

/// The degrees of freedom of a variance over those of the plain one, K − 1. That of K Gaussian numbers of which the
/// distant are clipped scatters as a chi-square of 0.87 (K − 1) degrees does (Satterthwaite's rule; 0.78 to 0.96 for K =
/// 5 … 24).
pub(super) const fn share_of_freedom(estimator: Estimator) -> f64 {
    if matches!(estimator, Estimator::DrAwv) {
        0.87
    } else {
        1.0
    }
}

/// Factor that makes the variance of K Gaussian numbers unbiased where they are clipped: 1.075 for K = 8.
pub(super) fn small_sample(count: usize, is_clipped: bool) -> f64 {
    if is_clipped {
        1.0 + 0.6 / count as f64
    } else {
        1.0
    }
}

/// Mean square of the residuals of ln nu at one level, each over the deviation that its noise alone gives it: 1 on average
/// where replicates do not differ. For DR-AWV of clipped residuals. NaN of what cannot be compared.
fn mean_square(logs: &[f64], noise: &[f64], estimator: Estimator) -> f64 {
    let weights: Vec<f64> = noise.iter().map(|n| 1.0 / n).collect();
    let clipped = estimator == Estimator::DrAwv;
    let correction = small_sample(logs.len(), clipped);
    let squares: f64 = residuals(logs, &weights, clipped)
        .iter()
        .map(|z| z * z)
        .sum();
    correction * squares / (logs.len() as f64 - 1.0)
}

/// Scatter of the ln nu of replicates at one level.
struct Scatter {
    /// Standard deviation of what they differ by beyond their noise.
    between: f64,
    /// Residuals in standard deviations, noise and differences together; Σ of their squares is K − 1.
    units: Vec<f64>,
    /// Observed standard deviation over the one predicted from noise and differences: 1, or less
    /// where the replicates scatter less than their noise.
    factor: f64,
}

impl Scatter {
    /// `noise` is the variance of each by its length. What they differ by is what brings the mean square of the
    /// residuals, each over its own variance, to 1
    /// ([Paule and Mandel](crate::bibliography::PauleMandel82)); for DR-AWV clipped residuals.
    fn new(logs: &[f64], noise: &[f64], estimator: Estimator) -> Self {
        let freedom = logs.len() as f64 - 1.0;
        let lowest = logs.iter().copied().fold(f64::INFINITY, f64::min);
        let range = logs.iter().copied().fold(lowest, f64::max) - lowest;
        if freedom < 1.0 || !range.is_finite() {
            return Self {
                between: 0.0,
                units: vec![0.0; logs.len()],
                factor: 0.0,
            };
        }
        let clipped = estimator == Estimator::DrAwv;
        let correction = small_sample(logs.len(), clipped);
        let weighted = |between: f64| {
            let weights: Vec<f64> = noise
                .iter()
                .map(|n| 1.0 / (n + between * between))
                .collect();
            let residuals = residuals(logs, &weights, clipped);
            let length = (residuals.iter().map(|z| z * z).sum::<f64>() / freedom).sqrt();
            (residuals, length)
        };
        // At twice the range each residual is below ½, so their mean square is below 1: the root lies before
        // it.
        let low = falling_root(
            |between| weighted(between).1 * correction.sqrt() - 1.0,
            2.0 * range,
        );
        let (mut units, length) = weighted(low);
        if length > 0.0 {
            units.iter_mut().for_each(|z| *z /= length);
        }
        Self {
            between: low,
            units,
            factor: length * correction.sqrt(),
        }
    }
}

/// Residuals from the weighted mean in standard deviations (weights: 1/variance); clipped ones are those from the
/// weighted median, within [`CLIP`] deviations by their median, about their own weighted mean.
pub(super) fn residuals(values: &[f64], weights: &[f64], is_clipped: bool) -> Vec<f64> {
    let kept = kept(values, weights, is_clipped);
    let mean = weighted_mean(&kept, weights);
    kept.iter()
        .zip(weights)
        .map(|(x, w)| (x - mean) * w.sqrt())
        .collect()
}

pub(super) fn weighted_mean(values: &[f64], weights: &[f64]) -> f64 {
    let sum: f64 = values.iter().zip(weights).map(|(x, w)| x * w).sum();
    sum / weights.iter().sum::<f64>()
}

/// The values; clipped ones within [`CLIP`] deviations of their weighted median, those beyond at the ends.
pub(super) fn kept(values: &[f64], weights: &[f64], is_clipped: bool) -> Vec<f64> {
    if !is_clipped {
        return values.to_vec();
    }
    let centre = weighted_median(values, weights);
    let distances: Vec<f64> = values
        .iter()
        .zip(weights)
        .map(|(x, w)| (x - centre).abs() * w.sqrt())
        .collect();
    // Distances are in the standard deviations of each replicate: a short recording scatters more and is
    // not clipped for that.
    let most = CLIP * MAD_TO_DEVIATION * median(&distances);
    let clip = |(x, w): (&f64, &f64)| {
        let most = most / w.sqrt();
        x.clamp(centre - most, centre + most)
    };
    values.iter().zip(weights).map(clip).collect()
}

/// The value below which half of the weight lies; the mean of two where it lies between them.
fn weighted_median(values: &[f64], weights: &[f64]) -> f64 {
    let mut pairs: Vec<(f64, f64)> = values
        .iter()
        .copied()
        .zip(weights.iter().copied())
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * weights.iter().sum::<f64>();
    let mut below = 0.0;
    for (i, (value, weight)) in pairs.iter().enumerate() {
        below += weight;
        if below > half * (1.0 + 1e-9) {
            return *value;
        }
        if below > half * (1.0 - 1e-9) {
            return pairs
                .get(i + 1)
                .map_or(*value, |next| 0.5 * (value + next.0));
        }
    }
    pairs.last().map_or(f64::NAN, |last| last.0)
}

// Whether replicates differ beyond their noise: a test with a level.
//
// At each scale the mean square of the residuals of ln nu, each over the deviation that noise alone gives it; of all
// scales together the largest. What that is for replicates of one noise is drawn from the large-sample law of the fitted
// model ([`SamplingDistribution`]), the correlations between scales included, so that looking at many scales costs nothing.
// Axes that are pooled may differ from one another in every recording alike: recordings are compared axis by axis.

/// Probability with which replicates of one noise are said to differ.
pub const LEVEL: f64 = 0.025;
/// Sets drawn: a probability of 2.5 % is known to 0.7 %.
const DRAWS: usize = 499;
/// Seed of the draws: a test is an answer, the same each time.
const SEED: u64 = 1;
/// A scale with fewer degrees of freedom in a replicate is left out: a robust variance of so few coefficients does not
/// follow the large-sample law.
const LEAST: f64 = 4.0;

/// Probability that replicates of one noise differ at some scale as much as these do; none of a single one.
pub(crate) fn alike_p_value(
    replicates: &[Replicate],
    estimator: Estimator,
    spread: &ReplicateSpread,
    law: &SamplingDistribution,
    group: &str,
) -> Option<f64> {
    let scales: Vec<Scale> = law
        .shapes
        .iter()
        .enumerate()
        .map_while(|(j, shape)| Scale::new(j, replicates, spread, shape))
        .collect();
    if scales.is_empty() {
        return None;
    }
    let largest = |nu: &dyn Fn(usize, usize) -> f64| {
        let squares = scales
            .iter()
            .enumerate()
            .map(|(j, scale)| scale.mean_square(&|i| nu(i, j), estimator));
        squares
            .filter(|square| square.is_finite())
            .fold(0.0, f64::max)
    };
    let observed = largest(&|i, j| replicates[i].value(estimator, j));
    let draw = |run: usize| {
        let process = estimator.name();
        let key = StreamKey {
            seed: SEED,
            scenario: "alike",
            run: run as u64,
            source: group,
            process,
        };
        let mut generator = key.generator();
        let ratios: Vec<Vec<f64>> = spread
            .edof
            .iter()
            .map(|e| law.draw(e, &mut generator))
            .collect();
        largest(&|i, j| ratios[i][j])
    };
    let drawn: Vec<f64> = (0..DRAWS).into_par_iter().map(draw).collect();
    Some(p_value(observed, &drawn))
}

impl Outcome {
    /// Probability of such differences of the replicates and the scale where they are largest, where they differ beyond their noise.
    pub fn differing(&self) -> Option<(f64, LevelSpread)> {
        let inference = self.inference.as_ref()?;
        let p_value = inference.alike.filter(|p| *p <= LEVEL)?;
        // Relative to the noise: at the last scales recordings scatter most for lack of coefficients, which is no difference.
        let ratio = |s: &LevelSpread| s.between / s.within;
        let most = inference
            .spread
            .iter()
            .max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
        Some((p_value, *most))
    }
}

/// The replicates that are compared at one scale.
struct Scale {
    /// Indices of the replicates, and the axis of each.
    members: Vec<(usize, Option<Axis>)>,
    /// Variance of ln nu of each by its noise.
    noise: Vec<f64>,
}

impl Scale {
    /// Selects the replicates long enough for the level of index `j`; none where each axis occurs
    /// only once, so that there is nothing to compare.
    fn new(
        j: usize,
        replicates: &[Replicate],
        spread: &ReplicateSpread,
        shape: &VarianceDistribution,
    ) -> Option<Self> {
        let is_long_enough = |i: &usize| replicates[*i].levels() > j && spread.edof[*i][j] >= LEAST;
        let members: Vec<(usize, Option<Axis>)> = (0..replicates.len())
            .filter(is_long_enough)
            .map(|i| (i, replicates[i].axis))
            .collect();
        let is_repeated = |(k, (_, axis)): (usize, &(usize, Option<Axis>))| {
            members[..k].iter().any(|(_, a)| a == axis)
        };
        let noise = members
            .iter()
            .map(|(i, _)| shape.variance_of_log(spread.edof[*i][j]))
            .collect();
        members
            .iter()
            .enumerate()
            .any(is_repeated)
            .then_some(Self { members, noise })
    }

    /// Mean square of the residuals of ln nu less the mean of its axis: of drawn values in the same way as of observed ones,
    /// so that the degrees of freedom of the means are allowed for.
    fn mean_square(&self, nu: &dyn Fn(usize) -> f64, estimator: Estimator) -> f64 {
        let logs: Vec<f64> = self.members.iter().map(|(i, _)| nu(*i).ln()).collect();
        let mean = |axis: &Option<Axis>| {
            let of_axis = || {
                self.members
                    .iter()
                    .zip(&logs)
                    .filter(|((_, other), _)| other == axis)
            };
            of_axis().map(|(_, log)| log).sum::<f64>() / of_axis().count() as f64
        };
        let residuals: Vec<f64> = self
            .members
            .iter()
            .zip(&logs)
            .map(|((_, axis), log)| log - mean(axis))
            .collect();
        mean_square(&residuals, &self.noise, estimator)
    }
}

// Whether the axes of a sensor that is pooled differ: one model is then none of theirs.
//
// At each scale ln nu of all recordings and axes as a two-way layout: the mean square between axes over that of what
// neither axis nor recording explains, F with A − 1 and (K − 1)(A − 1) degrees of freedom; what remains is taken to be at
// least the noise of the wavelet variance. Of one recording the noise alone is known, and the sum of squares between
// axes is a chi-square. The least probability of all scales, times their number (Bonferroni), is the answer.

/// Degrees of freedom from which on ln nu is near enough to Gaussian.
const NEARLY_GAUSSIAN: f64 = 30.0;
/// Largest over smallest axis, in wavelet variance, from which on a model an axis is worth while.
const NOTABLE: f64 = 1.1;

/// Difference of the axes of pooled replicates; none where they agree, or where a recording lacks an axis.
pub(crate) fn axes_differ(
    replicates: &[Replicate],
    estimator: Estimator,
    tuning: &Tuning,
) -> Option<AxesDiffer> {
    let axes: Vec<Axis> = Axis::ALL
        .into_iter()
        .filter(|axis| replicates.iter().any(|r| r.axis == Some(*axis)))
        .collect();
    let table = layout(replicates, &axes)?;
    let degrees = |r: &Replicate, level: u32| r.edof(estimator, level, tuning);
    let is_usable = |r: &Replicate, level: u32| {
        r.levels() >= level as usize && degrees(r, level) >= NEARLY_GAUSSIAN
    };
    let long_enough = |level: u32| -> Vec<&Vec<&Replicate>> {
        table
            .iter()
            .filter(|row| row.iter().all(|r| is_usable(r, level)))
            .collect()
    };
    // Up to the scale that more than half of the recordings have, as the average of them.
    let usable: Vec<(u32, Vec<&Vec<&Replicate>>)> = (1..)
        .map(|level| (level, long_enough(level)))
        .take_while(|(_, rows)| 2 * rows.len() > table.len())
        .collect();
    let count = usable.len() as f64;
    let of_level = |(level, rows): &(u32, Vec<&Vec<&Replicate>>)| {
        let level = *level;
        let logs = |row: &&Vec<&Replicate>| -> Vec<f64> {
            row.iter()
                .map(|r| r.value(estimator, level as usize - 1).ln())
                .collect()
        };
        // The largest, that of the shortest recording: too much noise makes the test cautious, too little
        // bold.
        let variances = rows
            .iter()
            .copied()
            .flatten()
            .map(|r| variance_of_log(degrees(r, level)));
        let noise = variances.fold(0.0, f64::max);
        let (p_value, means) = between_axes(&rows.iter().map(logs).collect::<Vec<_>>(), noise)?;
        let by_mean = |a: &(f64, Axis), b: &(f64, Axis)| a.0.total_cmp(&b.0);
        let means_of_axes = || means.iter().copied().zip(axes.iter().copied());
        let (smallest, largest) = (
            means_of_axes().min_by(by_mean)?,
            means_of_axes().max_by(by_mean)?,
        );
        Some(AxesDiffer {
            level,
            p_value: (p_value * count).min(1.0),
            largest: largest.1,
            smallest: smallest.1,
            ratio: (largest.0 - smallest.0).exp(),
        })
    };
    let all = usable.iter().filter_map(of_level);
    let told: Vec<AxesDiffer> = all
        .filter(|d| d.p_value <= LEVEL && d.ratio >= NOTABLE)
        .collect();
    told.into_iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio))
}

/// One row a recording, one column an axis.
fn layout<'a>(replicates: &'a [Replicate], axes: &[Axis]) -> Option<Vec<Vec<&'a Replicate>>> {
    let mut names: Vec<&str> = replicates.iter().map(|r| r.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let whole = axes.len() >= 2 && names.len() * axes.len() == replicates.len();
    let cell = |name: &str, axis: Axis| {
        replicates
            .iter()
            .find(|r| r.name == name && r.axis == Some(axis))
    };
    let rows = names
        .iter()
        .map(|name| axes.iter().map(|axis| cell(name, *axis)).collect());
    if whole { rows.collect() } else { None }
}

/// Probability of such means of the columns where they are equal, and the means. `noise`: variance of a value.
fn between_axes(rows: &[Vec<f64>], noise: f64) -> Option<(f64, Vec<f64>)> {
    let (count, axes) = (rows.len() as f64, rows[0].len() as f64);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let columns: Vec<f64> = (0..rows[0].len())
        .map(|axis| mean(&rows.iter().map(|row| row[axis]).collect::<Vec<_>>()))
        .collect();
    let all = mean(&columns);
    // Recordings differ as a whole too, but that is in every column alike and drops out of the means'
    // differences.
    let between = count * columns.iter().map(|m| (m - all).powi(2)).sum::<f64>();
    // One recording leaves no remainder to compare with: the noise is taken as known, and F becomes a
    // chi-square.
    if rows.len() == 1 {
        return Some((
            ChiSquared::new(axes - 1.0).ok()?.sf(between / noise),
            columns,
        ));
    }
    let remains = |row: &Vec<f64>| -> f64 {
        let own = mean(row);
        row.iter()
            .zip(&columns)
            .map(|(value, column)| (value - own - column + all).powi(2))
            .sum()
    };
    let degrees = (count - 1.0) * (axes - 1.0);
    // By few recordings the remainder may come out small by chance, and F large; it cannot truly be less than
    // the noise.
    let remaining = (rows.iter().map(remains).sum::<f64>() / degrees).max(noise);
    let law = FisherSnedecor::new(axes - 1.0, degrees).ok()?;
    Some((law.sf(between / (axes - 1.0) / remaining), columns))
}

#[cfg(test)]
#[path = "spread_tests.rs"]
mod spread_tests;

#[cfg(test)]
mod alike_tests {
    use super::*;
    use crate::tests::{generator, measured, normal, white_and_walk};
    use crate::wavelet::Tuning;

    const SAMPLES: usize = 2048;
    const GAMMA2: f64 = 1e-4;

    /// Signals of white noise and random walk, their white noise of standard deviation e^(spread/2 · N(0, 1)).
    fn set(seed: u64, count: usize, spread: f64) -> Vec<Replicate> {
        let recording = |run: usize| {
            let mut generator = generator(seed, run as u64);
            let mut normal = || normal(&mut generator);
            let sigma = (0.5 * spread * normal()).exp();
            let mut walk = 0.0;
            let signal: Vec<f64> = (0..SAMPLES)
                .map(|_| {
                    walk += GAMMA2.sqrt() * normal();
                    walk + sigma * normal()
                })
                .collect();
            measured(format!("run{run}"), &signal, 10)
        };
        (0..count).map(recording).collect()
    }

    /// Sets, of so many, that are said to differ.
    fn told(
        sets: u64,
        estimator: Estimator,
        replicates: impl Fn(u64) -> Vec<Replicate> + Sync,
    ) -> u32 {
        let law = SamplingDistribution::new(&white_and_walk(1.0, GAMMA2), 10);
        let differs = |seed: u64| {
            let replicates = replicates(seed);
            let own =
                ReplicateSpread::new(&replicates, estimator, &law, &Tuning::new(0.6).unwrap());
            u32::from(alike_p_value(&replicates, estimator, &own, &law, "accel").unwrap() <= LEVEL)
        };
        (0..sets).into_par_iter().map(differs).sum()
    }

    /// The level is 2.5 %: of 200 sets of alike replicates 5 ± 2.2, so no more than 13 (four deviations). A spread of 20 % in
    /// sigma2, of which noise makes 4.4 % at the first scale (1024 degrees of freedom or fewer), is told in nearly all.
    #[test]
    fn alike_replicates_are_said_to_differ_as_rarely_as_promised() {
        for (count, estimator) in [
            (2, Estimator::Awv),
            (3, Estimator::Awv),
            (8, Estimator::Awv),
            (3, Estimator::SrAwv),
            (8, Estimator::DrAwv),
        ] {
            let told = told(200, estimator, |seed| set(seed, count, 0.0));
            assert!(told <= 13, "{count} {}: {told} of 200", estimator.name());
        }
        for (estimator, least) in [(Estimator::Awv, 19), (Estimator::DrAwv, 18)] {
            assert!(told(20, estimator, |seed| set(seed, 8, 0.2)) >= least);
        }
    }

    /// Four recordings of three axes, of which the last has 1.7 times the variance in each of them: of 40 sets 1 ± 1 is said to
    /// differ, so no more than 5.
    #[test]
    fn axes_that_differ_are_not_recordings_that_differ() {
        let of_three_axes = |seed: u64| {
            let of_axis = |axis: Axis| {
                let mut replicates = set(3 * seed + axis as u64, 4, 0.0);
                for replicate in &mut replicates {
                    replicate.axis = Some(axis);
                    let variance = if axis == Axis::Z { 1.7 } else { 1.0 };
                    replicate
                        .classical
                        .iter_mut()
                        .for_each(|nu| *nu *= variance);
                }
                replicates
            };
            Axis::ALL.into_iter().flat_map(of_axis).collect()
        };
        let told = told(40, Estimator::Awv, of_three_axes);
        assert!(told <= 5, "{told} of 40");
    }

    #[test]
    fn one_signal_cannot_differ() {
        let law =
            SamplingDistribution::new(&Composite::new(vec![Process::white(1.0).unwrap()]), 10);
        let one = set(1, 1, 0.0);
        let own = ReplicateSpread::new(&one, Estimator::Awv, &law, &Tuning::new(0.6).unwrap());
        assert_eq!(
            alike_p_value(&one, Estimator::Awv, &own, &law, "accel"),
            None
        );
    }
}

#[cfg(test)]
mod axes_tests {
    use super::*;
    use crate::wavelet::classical_and_robust;
    use rand::RngExt;
    use rand_distr::StandardNormal;

    /// White noise of three axes, the second with this many times the variance of the others.
    fn set(seed: u64, recordings: usize, factor: f64) -> Vec<Replicate> {
        let recording = |k: usize| {
            let (run, axis) = (k as u64, Axis::ALL[k % 3]);
            let mut generator = crate::tests::generator(seed, run);
            let sigma = if axis == Axis::Y { factor.sqrt() } else { 1.0 };
            let mut normal = || sigma * generator.sample::<f64, _>(StandardNormal);
            let signal: Vec<f64> = (0..2048).map(|_| normal()).collect();
            let (classical, robust) = classical_and_robust(&signal, 8, &Tuning::default()).unwrap();
            let (name, trend) = (format!("run{}", k / 3), f64::NAN);
            Replicate {
                name,
                axis: Some(axis),
                samples: 2048,
                classical,
                robust,
                coverage: Vec::new(),
                trend,
                mean: f64::NAN,
            }
        };
        (0..3 * recordings).map(recording).collect()
    }

    /// By Bonferroni at most 2.5 % of sets of alike axes: of 100 at most 8 (2.5 and four standard deviations of 1.6), whatever the
    /// number of recordings. Axes of which one has 1.4 times the variance (7 deviations of one recording's first scale, of
    /// 1024 degrees: √(2·2/1024) = 0.0625 of 0.34) are reported.
    #[test]
    fn axes_are_told_apart_where_they_differ() {
        for (recordings, estimator) in [
            (1, Estimator::Awv),
            (2, Estimator::Awv),
            (6, Estimator::DrAwv),
        ] {
            let told = |seed: &u64| {
                axes_differ(&set(*seed, recordings, 1.0), estimator, &Tuning::default()).is_some()
            };
            let alarms = (0..100).filter(told).count();
            assert!(alarms <= 8, "{recordings} {}: {alarms}", estimator.name());
        }
        for recordings in [1, 6] {
            let found = axes_differ(&set(1, recordings, 1.4), Estimator::Awv, &Tuning::default())
                .expect("told");
            assert!(
                (found.ratio - 1.4).abs() < 0.4 && found.largest == Axis::Y,
                "{found:?}"
            );
        }
    }

    #[test]
    fn an_incomplete_layout_says_nothing() {
        let mut some = set(1, 2, 4.0);
        some.pop();
        assert_eq!(axes_differ(&some, Estimator::Awv, &Tuning::default()), None);
    }
}
