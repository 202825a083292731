//! Results of the diagnosis of each recording.

use super::common::CommonFinding;
use super::leave_out::LeftOut;
use crate::imu::{Axis, Sensor};
use serde::{Serialize, Serializer};

/// Verdict on a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing.
    Normal,
    /// Its classical wavelet variance is above its robust one, more than in the others: outliers within it.
    Outliers,
    /// Its level drifts as that of no other does.
    Drift,
    /// Its robust wavelet variance is not that of the others: its noise is another.
    Noise,
}

nav_sim_signal::named!(
    Verdict {
        Normal = "normal",
        Outliers = "outliers",
        Drift = "drift",
        Noise = "abnormal",
    }, in files
);

fn by_axis<S: Serializer>(values: &[(Axis, f64)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(values.iter().copied())
}

fn scores_by_axis<S: Serializer>(scores: &[AxisScores], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(scores.iter().map(|of_axis| (of_axis.axis, of_axis)))
}

/// A drift that no other recording has.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriftAlarm {
    /// Probability that the most unusual of recordings that are alike is as unusual.
    pub p_value: f64,
    /// Mean of the later half less that of the earlier one, of each axis (units).
    #[serde(serialize_with = "by_axis")]
    pub change: Vec<(Axis, f64)>,
    /// The same against the others, in standard deviations.
    #[serde(serialize_with = "by_axis")]
    pub deviations: Vec<(Axis, f64)>,
}

/// Why a recording is abnormal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alarm {
    /// Probability that the most unusual of recordings that are alike is as unusual.
    pub p_value: f64,
    /// First and last of the neighbouring scales (s) at which it is most unusual.
    pub tau_s: [f64; 2],
    /// Deviations from the others there, axis by axis, in standard deviations.
    #[serde(serialize_with = "by_axis")]
    pub deviations: Vec<(Axis, f64)>,
}

/// The scores of a recording at every scale, on one axis: against the mean of the others that are not abnormal, in
/// standard deviations (those of the others, pooled over the axes, but no less than noise alone makes).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisScores {
    /// Axis.
    #[serde(skip)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Recording.
    #[serde(rename = "file")]
    pub name: String,
    /// Sensor.
    pub sensor: Sensor,
    /// The verdict.
    pub verdict: Verdict,
    /// Why its noise is not that of the others.
    pub noise: Option<Alarm>,
    /// Why there are outliers within it.
    pub outliers: Option<Alarm>,
    /// Why its level is said to drift.
    pub drift: Option<DriftAlarm>,
    /// Findings that most signals of this sensor have in common.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub common: Vec<CommonFinding>,
    /// Scores; empty when there are fewer than four recordings.
    #[serde(serialize_with = "scores_by_axis")]
    pub scores: Vec<AxisScores>,
    /// Effect of leaving it out on each fit.
    pub left_out: Vec<LeftOut>,
}
