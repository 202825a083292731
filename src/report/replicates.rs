//! Which recordings are abnormal, as JSON and as words.

use crate::calibration::{Alarm, AxisScores, Diagnosis, LeftOut, Movement, advice, effects, tau_s};
use crate::imu::Sensor;
use serde::Serialize;
use std::collections::BTreeMap;

/// One sensor of one recording against the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ReplicateEntry {
    /// Recording.
    pub file: String,
    /// `accel` or `gyro`.
    pub sensor: &'static str,
    /// `normal`, `outliers` (within it) or `abnormal` (its noise is another).
    pub verdict: &'static str,
    /// Why its noise is not that of the others (ln robust wv).
    pub noise: Option<AlarmEntry>,
    /// Why there are outliers within it (ln (classical / robust wv)).
    pub outliers: Option<AlarmEntry>,
    /// Why its level is said to drift.
    pub drift: Option<DriftEntry>,
    /// Outliers that most signals of this sensor hold, in all recordings alike.
    pub common_outliers: Option<CommonEntry>,
    /// Scores at every scale, by axis.
    pub scores: BTreeMap<&'static str, ScoresEntry>,
    /// What leaving it out does to each fit.
    pub left_out: Vec<LeftOutEntry>,
}

/// A drift that no other recording has.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct DriftEntry {
    /// Probability that the most unusual of recordings that are alike is as unusual.
    pub p_value: f64,
    /// Mean of the later half less that of the earlier one, by axis (units of the sensor).
    pub change: BTreeMap<&'static str, f64>,
    /// The same against the others, in standard deviations.
    pub deviations: BTreeMap<&'static str, f64>,
}

/// Outliers that most signals of a sensor hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CommonEntry {
    /// The scales (s) at which there are.
    pub tau_s: Vec<f64>,
    /// The one where they weigh most.
    pub most_tau_s: f64,
    /// Median of classical over robust wv, less one, there.
    pub excess: f64,
    /// The same in standard deviations.
    pub deviations: f64,
}

/// Why a recording is abnormal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct AlarmEntry {
    /// Probability that the most unusual of recordings that are alike is as unusual.
    pub p_value: f64,
    /// First and last of the neighbouring scales (s) at which it is most unusual.
    pub tau_s: [f64; 2],
    /// What was looked at there against the others, in standard deviations, by axis.
    pub deviations: BTreeMap<&'static str, f64>,
}

/// Scores of one axis against the others at every scale, in standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ScoresEntry {
    /// Of ln robust wv.
    pub noise: Vec<f64>,
    /// Of ln (classical / robust wv).
    pub outliers: Vec<f64>,
}

/// How far a fit moves without a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct LeftOutEntry {
    /// What was fitted: `accel`, `accel.x`, …
    pub signals: String,
    /// Estimator.
    pub estimator: &'static str,
    /// Scale (s) at which its curve moves most, in standard deviations.
    pub tau_s: f64,
    /// wv without it over wv with it, less one, there.
    pub change: f64,
    /// The same in standard deviations of ln wv of the curve.
    pub deviations: f64,
    /// Every parameter without it.
    pub parameters: Vec<Movement>,
}

impl ReplicateEntry {
    /// The entry of a diagnosis at a rate (Hz).
    #[must_use]
    pub(crate) fn new(diagnosis: &Diagnosis, rate_hz: f64) -> Self {
        let scores = |s: &AxisScores| {
            let entry = ScoresEntry { noise: s.noise.clone(), outliers: s.outliers.clone() };
            (s.axis.name(), entry)
        };
        Self {
            file: diagnosis.name.clone(),
            sensor: diagnosis.sensor.name(),
            verdict: diagnosis.verdict.name(),
            noise: diagnosis.noise.as_ref().map(|a| AlarmEntry::new(a, rate_hz)),
            outliers: diagnosis.outliers.as_ref().map(|a| AlarmEntry::new(a, rate_hz)),
            drift: diagnosis.drift.as_ref().map(|d| DriftEntry {
                p_value: d.p_value,
                change: d.change.iter().map(|(axis, x)| (axis.name(), *x)).collect(),
                deviations: d.deviations.iter().map(|(axis, z)| (axis.name(), *z)).collect(),
            }),
            common_outliers: diagnosis.common.as_ref().map(|c| CommonEntry {
                tau_s: c.levels.iter().map(|level| tau_s(*level, rate_hz)).collect(),
                most_tau_s: tau_s(c.most, rate_hz),
                excess: c.excess,
                deviations: c.deviations,
            }),
            scores: diagnosis.scores.iter().map(scores).collect(),
            left_out: diagnosis.left_out.iter().map(|l| LeftOutEntry::new(l, rate_hz)).collect(),
        }
    }
}

impl AlarmEntry {
    fn new(alarm: &Alarm, rate_hz: f64) -> Self {
        Self {
            p_value: alarm.p_value,
            tau_s: [tau_s(alarm.levels.0, rate_hz), tau_s(alarm.levels.1, rate_hz)],
            deviations: alarm.deviations.iter().map(|(axis, z)| (axis.name(), *z)).collect(),
        }
    }
}

impl LeftOutEntry {
    fn new(left_out: &LeftOut, rate_hz: f64) -> Self {
        Self {
            signals: left_out.group.clone(),
            estimator: left_out.estimator.name(),
            tau_s: tau_s(left_out.level, rate_hz),
            change: left_out.change,
            deviations: left_out.deviations,
            parameters: left_out.parameters.clone(),
        }
    }
}

/// What the recordings of each sensor say of one another, in words; nothing of a single one.
#[must_use]
pub(crate) fn describe_replicates(diagnoses: &[Diagnosis], rate_hz: f64) -> Vec<String> {
    let of_sensor = |sensor: Sensor| {
        let mut lines = advice(diagnoses, sensor, rate_hz);
        lines.extend(effects(diagnoses, sensor, rate_hz));
        let head = format!("{}: do the recordings agree?", sensor.name());
        let text = std::iter::once(head).chain(lines.iter().map(|l| format!("  {l}")));
        (!lines.is_empty()).then(|| text.collect::<Vec<_>>().join("\n"))
    };
    Sensor::ALL.into_iter().filter_map(of_sensor).collect()
}
