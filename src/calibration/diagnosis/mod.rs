//! "My six recordings disagree: which do I use?" Each recording against the others, over neighbouring scales
//! and the axes of a sensor, by the sampling law of the model that was fitted; and what leaving it out does.
//!
//! Three things are looked at: ln of the robust wavelet variance (is its noise another?), and ln of the
//! classical over the robust one (are there outliers within it?), and the change of the level from its earlier to its later
//! half, in standard deviations of the fitted model (does it drift as no other does?). In the second what recordings honestly differ by
//! cancels, and what noise alone makes is small: a classical variance of eta degrees of freedom being
//! efficient, its covariance with a robust one of efficiency e is its variance, so that of the ratio is
//! (1/e − 1) times it.

mod alarm;
mod common;
mod contrasts;
mod leave_out;

pub use common::CommonOutliers;
pub use leave_out::{LeftOut, Movement};

use crate::curve::sampling::SamplingLaw;
use crate::curve::{Estimator, Group, Pool, Replicate};
use crate::imu::{Axis, Sensor};
use crate::noise::Composite;
use crate::outcome::{Goodness, Outcome, Settings};
use crate::wavelet::interval::edof_robust;
use alarm::alarms;
use contrasts::{Noise, Table, scores};
use rayon::prelude::*;

/// Degrees of freedom from which the scatter of classical over robust follows its large-sample law.
const LARGE_SAMPLE: f64 = 30.0;
/// Fewer recordings cannot say which of them is abnormal.
const FEWEST: usize = 4;

/// What is abnormal about a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing.
    Normal,
    /// Its classical wavelet variance is above its robust one, more than in the others: outliers within it.
    Outliers,
    /// Its level drifts as that of no other does.
    Drift,
    /// Its robust wavelet variance is: its noise is another.
    Noise,
}

impl Verdict {
    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Outliers => "outliers",
            Self::Drift => "drift",
            Self::Noise => "abnormal",
        }
    }
}

/// A drift that no other recording has.
#[derive(Debug, Clone, PartialEq)]
pub struct DriftAlarm {
    /// Probability that the most unusual of recordings that are alike is as unusual.
    pub p_value: f64,
    /// Mean of the later half less that of the earlier one, of each axis (units).
    pub change: Vec<(Axis, f64)>,
    /// The same against the others, in standard deviations.
    pub deviations: Vec<(Axis, f64)>,
}

/// Why a recording is abnormal.
#[derive(Debug, Clone, PartialEq)]
pub struct Alarm {
    /// Probability that the most unusual of recordings that are alike is as unusual.
    pub p_value: f64,
    /// First and last level of the neighbouring scales at which it is most unusual.
    pub levels: (u32, u32),
    /// What was looked at there, on all axes, against the others, in standard deviations.
    pub deviations: Vec<(Axis, f64)>,
}

/// The scores of a recording at every scale, on one axis: against the mean of the others that are not abnormal, in
/// standard deviations (those of the others, pooled over the axes, but no less than noise alone makes).
#[derive(Debug, Clone, PartialEq)]
pub struct AxisScores {
    /// Axis.
    pub axis: Axis,
    /// Of ln robust wavelet variance, level 1 first.
    pub noise: Vec<f64>,
    /// Of ln (classical / robust), of as many levels as have 30 degrees of freedom.
    pub outliers: Vec<f64>,
}

/// One sensor of one recording against the others.
///
/// Alarms are rare in sets of alike recordings: with a probability of 2.5 % there is one of their noise, and as
/// often one of outliers, and one of drift, however much alike recordings differ, if ln nu does so by Gaussian numbers
/// independent from axis to axis. Two recordings that are abnormal alike hide behind each
/// other unless there are six or more; three do in any case.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// Recording.
    pub name: String,
    /// Sensor.
    pub sensor: Sensor,
    /// Axes of the sensor that it has.
    pub axes: usize,
    /// What is said of it.
    pub verdict: Verdict,
    /// Why its noise is not that of the others.
    pub noise: Option<Alarm>,
    /// Why there are outliers within it.
    pub outliers: Option<Alarm>,
    /// Why its level is said to drift.
    pub drift: Option<DriftAlarm>,
    /// Scores; empty when there are fewer than four recordings.
    pub scores: Vec<AxisScores>,
    /// Outliers that most signals of this sensor hold, in all recordings alike.
    pub common: Option<CommonOutliers>,
    /// Whether the axes of the sensor were pooled, and what DR-AWV dropped at each end of each scale, if it ran.
    pub dropped: Option<(Pool, usize)>,
    /// What leaving it out does to each fit.
    pub left_out: Vec<LeftOut>,
    /// The fits to this sensor whose model does not describe the curve, by the J-test.
    pub misfits: Vec<Misfit>,
}

/// A fit that the J-test rejects at 5 %.
#[derive(Debug, Clone, PartialEq)]
pub struct Misfit {
    /// The group, `accel` or `accel.x`.
    pub group: String,
    /// The estimator.
    pub estimator: Estimator,
    /// Probability of such a distance if the model holds.
    pub p_value: f64,
}

/// Diagnoses every recording, sensor by sensor. Without two recordings there is nothing to compare.
#[must_use]
pub fn diagnose(groups: &[Group], outcomes: &[Outcome], settings: &Settings) -> Vec<Diagnosis> {
    Sensor::ALL.into_iter().flat_map(|sensor| of_sensor(sensor, groups, outcomes, settings)).collect()
}

fn of_sensor(sensor: Sensor, groups: &[Group], outcomes: &[Outcome], settings: &Settings) -> Vec<Diagnosis> {
    let own: Vec<&Group> = groups.iter().filter(|g| g.scope.sensor == sensor).collect();
    let mut names: Vec<&str> = Vec::new();
    for replicate in own.iter().flat_map(|g| &g.replicates) {
        if !names.contains(&replicate.name.as_str()) {
            names.push(&replicate.name);
        }
    }
    if names.len() < 2 {
        return Vec::new();
    }
    let pieces = axes(&own, &names, outcomes);
    let common = common::common(&pieces, &settings.tuning);
    let pieces = if names.len() < FEWEST { Vec::new() } else { pieces };
    let dropped = dropped(&own, settings);
    let [noise, outliers] = [Question::Noise, Question::Outliers]
        .map(|question| Sight::new(&pieces, sensor, question, settings.tuning.efficiency()));
    let drift = Sight::drift(&pieces, sensor, &noise);
    let left_out = |name: &str| {
        let fits: Vec<_> = own
            .iter()
            .flat_map(|g| outcomes.iter().filter(|o| o.scope == g.scope).map(move |o| (*g, o)))
            .collect();
        fits.into_par_iter().filter_map(|(g, o)| leave_out::left_out(g, name, o, settings)).collect()
    };
    let misfits = misfits(sensor, outcomes);
    let one = |(index, name): (usize, &&str)| {
        let (of_noise, of_outliers) = (noise.alarm(index), outliers.alarm(index));
        let of_drift = drift.drift_alarm(index, &pieces);
        let verdict = match (&of_noise, &of_outliers, &of_drift) {
            (Some(_), _, _) => Verdict::Noise,
            (None, Some(_), _) => Verdict::Outliers,
            (None, None, Some(_)) => Verdict::Drift,
            (None, None, None) => Verdict::Normal,
        };
        let has = |r: &&Replicate| r.name == **name;
        Diagnosis {
            name: (*name).to_owned(),
            sensor,
            axes: own.iter().flat_map(|g| &g.replicates).filter(has).count(),
            verdict,
            noise: of_noise,
            outliers: of_outliers,
            drift: of_drift,
            scores: joined(&pieces, noise.scores(index), outliers.scores(index)),
            common: common.clone(),
            dropped,
            left_out: left_out(name),
            misfits: misfits.clone(),
        }
    };
    names.iter().enumerate().map(one).collect()
}

/// The fits of a sensor that the J-test rejects.
fn misfits(sensor: Sensor, outcomes: &[Outcome]) -> Vec<Misfit> {
    let rejected = |o: &Outcome| {
        let goodness = o.inference.as_ref()?.goodness.filter(Goodness::is_rejected)?;
        Some(Misfit { group: o.scope.name(), estimator: o.estimator, p_value: goodness.p_value })
    };
    outcomes.iter().filter(|o| o.scope.sensor == sensor).filter_map(rejected).collect()
}

/// What DR-AWV drops of the smallest group of a sensor.
fn dropped(own: &[&Group], settings: &Settings) -> Option<(Pool, usize)> {
    let trim = own.iter().map(|g| settings.trim.count(g.replicates.len())).min()?;
    let pool = if own.iter().any(|g| g.scope.axis.is_none()) { Pool::Sensor } else { Pool::Axes };
    settings.estimators.contains(&Estimator::DrAwv).then_some((pool, trim))
}

/// The replicates of one axis, by recording.
struct Piece<'a> {
    axis: Axis,
    model: &'a Composite,
    law: SamplingLaw,
    replicates: Vec<Option<&'a Replicate>>,
}

fn axes<'a>(own: &[&'a Group], names: &[&str], outcomes: &'a [Outcome]) -> Vec<Piece<'a>> {
    let levels = own.iter().flat_map(|g| &g.replicates).map(|r| r.classical.len()).min().unwrap_or(0);
    let piece = |axis: Axis| {
        let group = own.iter().find(|g| g.replicates.iter().any(|r| r.axis == Some(axis)))?;
        // The last estimator is the most robust.
        let model = &outcomes.iter().rfind(|o| o.scope == group.scope)?.fit.composite;
        let of = |name: &&str| group.replicates.iter().find(|r| r.name == **name && r.axis == Some(axis));
        let law = SamplingLaw::new(model, levels);
        Some(Piece { axis, model, law, replicates: names.iter().map(of).collect() })
    };
    Axis::ALL.into_iter().filter_map(piece).collect()
}

/// What is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Question {
    /// ln robust wavelet variance.
    Noise,
    /// ln (classical / robust): only more than in the others is suspect.
    Outliers,
}

impl Question {
    fn value(self, r: &Replicate, level: usize) -> f64 {
        let robust = r.value(Estimator::SrAwv, level).ln();
        match self {
            Self::Noise => robust,
            Self::Outliers => r.value(Estimator::Awv, level).ln() - robust,
        }
    }

    /// Degrees of freedom of a chi-square that scatters as much, given those of the classical variance.
    fn edof(self, classical: f64, efficiency: f64) -> f64 {
        match self {
            Self::Noise => edof_robust(classical, efficiency),
            Self::Outliers => classical * efficiency / (1.0 - efficiency),
        }
    }

    /// How many levels can be looked at.
    fn levels(self, pieces: &[Piece<'_>]) -> usize {
        let enough = |p: &Piece<'_>| {
            let edof = p.law.edof(p.replicates.iter().flatten().map(|r| r.samples).min().unwrap_or(0));
            edof.iter().take_while(|e| self == Self::Noise || **e >= LARGE_SAMPLE).count()
        };
        pieces.iter().map(enough).min().unwrap_or(0)
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Noise => "noise",
            Self::Outliers => "outliers",
        }
    }
}

/// The answers to one question.
struct Sight {
    axes: Vec<Axis>,
    table: Table,
    noise: Vec<Noise>,
    found: Vec<alarm::Found>,
}

impl Sight {
    fn new(pieces: &[Piece<'_>], sensor: Sensor, question: Question, efficiency: f64) -> Self {
        let levels = question.levels(pieces);
        let logs = |r: &Replicate| (0..levels).map(|j| question.value(r, j)).collect();
        let of_piece = |p: &Piece<'_>| p.replicates.iter().map(|r| r.map(logs)).collect();
        let noise = |p: &Piece<'_>| {
            let longest = p.replicates.iter().flatten().map(|r| r.samples).max().unwrap_or(1);
            let edof = |r: &Option<&Replicate>| {
                let all = p.law.edof(r.map_or(longest, |r| r.samples)).into_iter();
                all.take(levels).map(|e| question.edof(e, efficiency)).collect()
            };
            Noise::new(p.law.first(levels), p.replicates.iter().map(edof).collect())
        };
        let above_only = question == Question::Outliers;
        let table = Table { logs: pieces.iter().map(of_piece).collect(), above_only };
        let noise: Vec<Noise> = pieces.iter().map(noise).collect();
        let found = alarms(&table, &noise, sensor.name(), question.name());
        Self { axes: pieces.iter().map(|p| p.axis).collect(), table, noise, found }
    }

    /// The change of the level within each recording, in standard deviations of the fitted model; their strengths may differ as
    /// those of the noise at the longest scales do.
    fn drift(pieces: &[Piece<'_>], sensor: Sensor, noise: &Self) -> Self {
        let deviations = |p: &Piece<'_>| {
            let of = |r: &Replicate| vec![0.5 * r.trend / wv_of_length(p.model, r.samples).sqrt()];
            p.replicates.iter().map(|r| r.map(of)).collect()
        };
        let table = Table { logs: pieces.iter().map(deviations).collect::<Vec<Vec<_>>>(), above_only: false };
        let files = pieces.first().map_or(0, |p| p.replicates.len());
        // A recording that drifts is also louder at the longest scales: it is not to hide itself.
        let size = |file: usize| -> f64 {
            table.logs.iter().filter_map(|axis| axis[file].as_ref()).map(|z| z[0] * z[0]).sum()
        };
        let largest = (0..files).max_by(|a, b| size(*a).total_cmp(&size(*b)));
        let others: Vec<bool> = (0..files).map(|file| Some(file) != largest).collect();
        let between = noise.table.between(&noise.noise, &others);
        let last = &between[between.len().saturating_sub(LONGEST_SCALES)..];
        let mean = last.iter().map(|b| b * b).sum::<f64>() / last.len().max(1) as f64;
        // Of the standard deviation, whose logarithm is half that of the variance.
        let own = pieces.iter().map(|_| Noise::normal(files, 0.5 * mean.sqrt())).collect::<Vec<_>>();
        let found = alarms(&table, &own, sensor.name(), "drift");
        Self { axes: pieces.iter().map(|p| p.axis).collect(), table, noise: own, found }
    }

    fn drift_alarm(&self, file: usize, pieces: &[Piece<'_>]) -> Option<DriftAlarm> {
        let found = self.found.iter().find(|f| f.file == file)?;
        let deviations = found.distance.deviations.iter().map(|(axis, z)| (self.axes[*axis], *z)).collect();
        let change = pieces.iter().filter_map(|p| Some((p.axis, p.replicates[file]?.trend))).collect();
        Some(DriftAlarm { p_value: found.p_value, change, deviations })
    }

    fn alarm(&self, file: usize) -> Option<Alarm> {
        let found = self.found.iter().find(|f| f.file == file)?;
        let first = found.window.first as u32 + 1;
        let named = found.distance.deviations.iter().map(|(axis, z)| (self.axes[*axis], *z));
        Some(Alarm {
            p_value: found.p_value,
            levels: (first, first + found.window.width as u32 - 1),
            deviations: named.collect(),
        })
    }

    /// Against the files that are not abnormal.
    fn scores(&self, file: usize) -> Vec<Vec<f64>> {
        let files = self.table.logs.first().map_or(0, Vec::len);
        let normal = |k: usize| k == file || self.found.iter().all(|f| f.file != k);
        scores(&self.table, &self.noise, &(0..files).map(normal).collect::<Vec<_>>(), file)
    }
}

/// Scales of which the differences between recordings are those of their level's changes too.
const LONGEST_SCALES: usize = 5;

/// Haar wavelet variance of a model at a scale as long as a record, by the power law between the neighbouring powers of two.
fn wv_of_length(model: &Composite, samples: usize) -> f64 {
    let level = samples.max(2).ilog2();
    let (below, above) = (model.haar_wv(level), model.haar_wv(level + 1));
    let part = (samples as f64).log2() - f64::from(level);
    below * (above / below).powf(part)
}

fn joined(pieces: &[Piece<'_>], noise: Vec<Vec<f64>>, outliers: Vec<Vec<f64>>) -> Vec<AxisScores> {
    let all = pieces.iter().zip(noise).zip(outliers);
    all.map(|((piece, noise), outliers)| AxisScores { axis: piece.axis, noise, outliers }).collect()
}

#[cfg(test)]
mod tests;
