//! Spread of replicates: their own scatter, and their differences beyond it.
//!
//! Their ln nu scatter as their variance from replicate to replicate shows. Of that the part `within` follows from the
//! model and the length ([`SamplingLaw`]); `between` is what is there in excess, if anything (moments of a
//! random-effects model, level by level: ln nu_ij = centre_j + between_ij + within_ij).
//!
//! The axes of a recording may share what recordings differ by (temperature, a mounting), and their own noise never: so
//! `within` is drawn signal by signal, and `between` recording by recording, all axes of a recording with the residuals of
//! one and the same other. That is right whatever they share, from nothing to all, and says what it knows: as many degrees of
//! freedom as there are recordings, less one, where `between` rules, and as there are signals, less one, where it does not.

use crate::curve::robust_scale::{MAD_TO_DEVIATION, median};
use crate::curve::sampling::SamplingLaw;
use crate::curve::shape::Shape;
use crate::curve::{Estimator, Replicate, falling_root};
use crate::rng::Generator;
use crate::wavelet::Tuning;
use rand::RngExt;
use rand_distr::StandardNormal;
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Quantile 0.975 of the normal law.
const NORMAL_975: f64 = 1.959_963_984_540_054;
/// Residuals further than this many deviations count as this many in DR-AWV.
const CLIP: f64 = 3.0;

/// The spread of replicates around an estimator's curve.
#[derive(Debug, Clone)]
pub(crate) struct Spread {
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
    shapes: Vec<Shape>,
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Origin {
    pub(super) recording: usize,
    pub(super) position: usize,
}

/// Signals of one name are of one recording; a signal of its axis has the same position in every recording.
pub(super) fn origins(replicates: &[Replicate]) -> Vec<Origin> {
    let first = |is_same: &dyn Fn(&Replicate) -> bool| replicates.iter().position(is_same);
    let ranked = |firsts: Vec<Option<usize>>| -> Vec<usize> {
        let mut known = firsts.clone();
        known.sort_unstable();
        known.dedup();
        firsts
            .iter()
            .map(|of| known.partition_point(|other| other < of))
            .collect()
    };
    let recordings = ranked(
        replicates
            .iter()
            .map(|r| first(&|other| other.name == r.name))
            .collect(),
    );
    let positions = ranked(
        replicates
            .iter()
            .map(|r| first(&|other| other.axis == r.axis))
            .collect(),
    );
    let pairs = recordings.into_iter().zip(positions);
    pairs
        .map(|(recording, position)| Origin {
            recording,
            position,
        })
        .collect()
}

impl Spread {
    pub(crate) fn new(
        replicates: &[Replicate],
        estimator: Estimator,
        law: &SamplingLaw,
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
            let ratio = |((score, total), shape): ((f64, &f64), &Shape)| shape.ratio(score, *total);
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

    /// Ratio of the quantiles 0.975 of Student's law and the normal one, by which intervals are stretched
    /// because the variances are known from few replicates. 1 for a single replicate, whose variances are
    /// those of the law.
    pub(crate) fn student(&self) -> f64 {
        self.student_where(&self.between)
    }

    /// The same where replicates differ by these standard deviations, times the median of the deviation that so few replicates show,
    /// over the true one: what half of all calibrations stretch the true scatter by, or less.
    pub(crate) fn stated_where(&self, between: &[f64]) -> f64 {
        if self.units.len() < 2 {
            return 1.0;
        }
        let freedom = self.left_of(self.freedom(between));
        let median = ChiSquared::new(freedom).map_or(freedom, |law| law.inverse_cdf(0.5));
        self.student_where(between) * (median / freedom).sqrt()
    }

    fn student_where(&self, between: &[f64]) -> f64 {
        if self.units.len() < 2 {
            return 1.0;
        }
        let freedom = self.left_of(self.freedom(between));
        let student =
            StudentsT::new(0.0, 1.0, freedom).map_or(NORMAL_975, |law| law.inverse_cdf(0.975));
        student / NORMAL_975
    }

    /// Degrees of freedom that the estimator leaves of so many.
    fn left_of(&self, freedom: f64) -> f64 {
        (self.share_of_freedom * freedom).max(1.0)
    }

    /// Degrees of freedom of the variance of a mean: of its part that follows from the signals' own noise one less than
    /// there are signals, of what recordings differ by one less than there are recordings (Satterthwaite's rule, as if the
    /// axes shared all of it); the median over the levels.
    fn freedom(&self, between: &[f64]) -> f64 {
        let (signals, recordings) = (self.units.len() as f64, self.recordings() as f64);
        if recordings < 2.0 {
            return signals - 1.0;
        }
        let at_level = |(within, between): (&f64, &f64)| {
            // Variance of the mean of all signals: their own noise falls with the number of signals, shared
            // differences with that of recordings.
            let (own, common) = (within * within / signals, between * between / recordings);
            let scatter = own * own / (signals - 1.0) + common * common / (recordings - 1.0);
            (own + common).powi(2) / scatter
        };
        median(
            &self
                .within
                .iter()
                .zip(between)
                .map(at_level)
                .collect::<Vec<_>>(),
        )
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
        // One signal to a recording: what is the recording's and what is the signal's cannot be told apart,
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
    law: &SamplingLaw,
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

/// Factor that makes the clipped variance of K Gaussian numbers unbiased: 1.075 for K = 8.
pub(super) fn small_sample(count: usize) -> f64 {
    1.0 + 0.6 / count as f64
}

/// Mean square of the residuals of ln nu at one level, each over the deviation that its noise alone gives it: 1 on average
/// where replicates do not differ. For DR-AWV of clipped residuals. NaN of what cannot be compared.
pub(crate) fn mean_square(logs: &[f64], noise: &[f64], estimator: Estimator) -> f64 {
    let weights: Vec<f64> = noise.iter().map(|n| 1.0 / n).collect();
    let clipped = estimator == Estimator::DrAwv;
    let correction = if clipped {
        small_sample(logs.len())
    } else {
        1.0
    };
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
    /// Those standard deviations over what noise and differences make: 1, or less where the replicates scatter less
    /// than their noise does.
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
        let correction = if clipped {
            small_sample(logs.len())
        } else {
            1.0
        };
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
fn residuals(values: &[f64], weights: &[f64], is_clipped: bool) -> Vec<f64> {
    let kept = if is_clipped {
        clipped(values, weights)
    } else {
        values.to_vec()
    };
    let sum: f64 = kept.iter().zip(weights).map(|(x, w)| x * w).sum();
    let mean = sum / weights.iter().sum::<f64>();
    kept.iter()
        .zip(weights)
        .map(|(x, w)| (x - mean) * w.sqrt())
        .collect()
}

/// The values within [`CLIP`] deviations of their weighted median, those beyond at the ends.
pub(super) fn clipped(values: &[f64], weights: &[f64]) -> Vec<f64> {
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

#[cfg(test)]
mod tests;
