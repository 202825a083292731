//! Which replicates are abnormal, as JSON and as words.

use super::curves::tau_s;
use crate::calibration::{Group, LeftOut, ReplicateDiagnosis, Settings, advice, diagnose, large};
use serde::Serialize;

/// One replicate of one signal against the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReplicateEntry {
    /// Recording.
    pub file: String,
    /// `accel` or `gyro`.
    pub sensor: &'static str,
    /// `x`, `y` or `z`.
    pub axis: Option<&'static str>,
    /// `normal`, `outliers` (only its classical wavelet variance is far off) or `abnormal` (its robust one is).
    pub verdict: &'static str,
    /// Scores of the classical wavelet variance against the other replicates, a scale each.
    pub z_classical: Vec<f64>,
    /// Scores of the robust one.
    pub z_robust: Vec<f64>,
    /// Scales (s) at which either is beyond five deviations.
    pub at_tau_s: Vec<f64>,
    /// What leaving it out does to each estimator.
    pub left_out: Vec<LeftOutEntry>,
}

/// How far an estimator's curve moves without a replicate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOutEntry {
    /// Estimator.
    pub estimator: &'static str,
    /// Scale (s) at which its curve moves most, in standard deviations.
    pub tau_s: f64,
    /// wv without it over wv with it, less one, there.
    pub change: f64,
    /// The same in standard deviations of ln wv of the curve.
    pub deviations: f64,
}

/// The entries of a group.
pub(super) fn replicate_entries(group: &Group, settings: &Settings) -> Vec<ReplicateEntry> {
    diagnose(group, settings).into_iter().map(|d| entry(group, d, settings.rate_hz)).collect()
}

fn entry(group: &Group, diagnosis: ReplicateDiagnosis, rate_hz: f64) -> ReplicateEntry {
    let mut levels = [large(&diagnosis.classical), large(&diagnosis.robust)].concat();
    levels.sort_unstable();
    levels.dedup();
    let left_out = |l: &LeftOut| LeftOutEntry {
        estimator: l.estimator.name(),
        tau_s: tau_s(l.level, rate_hz),
        change: l.change,
        deviations: l.deviations,
    };
    ReplicateEntry {
        sensor: group.sensor.name(),
        axis: diagnosis.axis.map(|a| a.name()),
        verdict: diagnosis.verdict.name(),
        at_tau_s: levels.into_iter().map(|level| tau_s(level, rate_hz)).collect(),
        left_out: diagnosis.left_out.iter().map(left_out).collect(),
        file: diagnosis.name,
        z_classical: diagnosis.classical,
        z_robust: diagnosis.robust,
    }
}

/// What the replicates of a group say of one another, in words; none for a single one.
#[must_use]
pub fn describe_replicates(group: &Group, settings: &Settings) -> Option<String> {
    let lines = advice(&diagnose(group, settings), settings);
    if lines.is_empty() {
        return None;
    }
    let head = format!("{}: do the replicates agree?", group.name());
    Some(std::iter::once(head).chain(lines.iter().map(|l| format!("  {l}"))).collect::<Vec<_>>().join("\n"))
}
