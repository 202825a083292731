//! Each recording against the others, sensor by sensor.

use super::comparison::{
    AxisReplicates, ComparedQuantity, RecordingComparison, axes, excess_of_classical,
};
use super::contrasts::{FALSE_ALARM, FEWEST};
use crate::curve::{Group, Replicate};
use crate::imu::{Axis, Sensor};
use crate::noise::{Process, ProcessKind};
use crate::outcome::{CalibrationSettings, Outcome, tau_s};
use serde::{Serialize, Serializer};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Diagnoses every recording, sensor by sensor. Without two recordings there is nothing to compare.
pub fn diagnose(
    groups: &[Group],
    outcomes: &[Outcome],
    settings: &CalibrationSettings,
) -> Vec<Diagnosis> {
    Sensor::ALL
        .into_iter()
        .flat_map(|sensor| of_sensor(sensor, groups, outcomes, settings))
        .collect()
}

fn of_sensor(
    sensor: Sensor,
    groups: &[Group],
    outcomes: &[Outcome],
    settings: &CalibrationSettings,
) -> Vec<Diagnosis> {
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
    let common = common(&pieces, settings);
    let pieces = if names.len() < FEWEST {
        Vec::new()
    } else {
        pieces
    };
    let [noise, outliers] = [ComparedQuantity::Noise, ComparedQuantity::Outliers]
        .map(|test| RecordingComparison::new(&pieces, sensor, test, settings.tuning.efficiency()));
    let drift = RecordingComparison::drift(&pieces, sensor, &noise);
    let diagnosis = |(index, name): (usize, &&str)| {
        let [of_noise, of_outliers] =
            [&noise, &outliers].map(|test| test.alarm(index, settings.rate_hz));
        let change = |p: &AxisReplicates<'_>| Some((p.axis, p.replicates[index]?.trend));
        let of_drift = drift.alarm(index, settings.rate_hz).map(|alarm| Alarm {
            tau_s: Vec::new(),
            change: pieces.iter().filter_map(change).collect(),
            ..alarm
        });
        let verdict = match (&of_noise, &of_outliers, &of_drift) {
            (Some(_), _, _) => RecordingVerdict::Noise,
            (None, Some(_), _) => RecordingVerdict::Outliers,
            (None, None, Some(_)) => RecordingVerdict::Drift,
            (None, None, None) => RecordingVerdict::Normal,
        };
        Diagnosis {
            name: (*name).to_owned(),
            sensor,
            verdict,
            noise: of_noise,
            outliers: of_outliers,
            drift: of_drift,
            common: common.clone(),
        }
    };
    names.iter().enumerate().map(diagnosis).collect()
}

// What all recordings have in common, which comparing one recording with the others does not show: outliers, steps of a
// quantizer, a drift.
//
// ln (classical / robust) of every signal has, when the noise is Gaussian, the mean (1/e − 1)/eta and the variance
// (1/e − 1)·2/eta (see [`super`]); quantization noise, which the robust variance reads high, is allowed for. Looked at is
// the median over the signals, so that a minority makes no alarm.
//
// What is allowed for is the noise of a quantizer, of uniform numbers. Where the same spectrum is of Gaussian numbers (a
// dithered output of velocity or angle increments, the difference of white noise), the robust variance reads it as it is, and
// the classical one seems too high by what was allowed. That is reported apart: the two variances then agree.
//
// Where the steps of a quantiser are comparable with the noise the two variances differ without an outlier: there nothing is said
// of outliers.

/// Standard deviations of the median: by chance 3 in 10⁷, of a normal law, at each of some ten scales.
const ALARM: f64 = 5.0;
/// Classical over robust, less one, from which it is reported: less than that hardly moves a fit.
const LEAST: f64 = 0.02;
/// Standard deviation of a median of many Gaussian numbers, times the root of how many: √(π/2). Of few it is less (1 of one,
/// 1.16 of three), and the alarm the rarer.
const MEDIAN: f64 = 1.2533;

/// Cause of what most signals of a sensor have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommonCause {
    /// Outliers: the classical wavelet variance is above the robust one.
    Outliers,
    /// Quantization noise whose numbers are Gaussian, not a quantizer's: robust fits read it low.
    GaussianQuantization,
    /// Steps of a quantiser that are comparable with the noise, by which the two variances differ.
    CoarseSteps,
    /// A drift that the model has not.
    Drift,
}

nav_sim_signal::named!(
    CommonCause {
        Outliers = "outliers",
        GaussianQuantization = "gaussian_quantization",
        CoarseSteps = "coarse_steps",
        Drift = "drift",
    }, in files
);

/// Finding that most signals of a sensor have in common.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct CommonFinding {
    /// Cause.
    pub cause: CommonCause,
    /// The scales (s) at which it is seen; none of a drift.
    pub tau_s: Vec<f64>,
    /// The axis of a drift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<Axis>,
    /// Median of classical over robust wavelet variance, less one, where it is largest; of Gaussian quantization by how much
    /// robust fits read it low; of a drift its mean slope (units per hour).
    pub size: f64,
    /// The statistic in its standard deviations, where it is largest; of a drift Student's t.
    pub deviations: f64,
}

/// The median over the signals of ln (classical / robust) at a scale, less what is expected.
struct RobustExcess {
    tau_s: f64,
    /// Excess with the allowance for the noise of a quantizer.
    quantizer: f64,
    /// Excess as if all noise were Gaussian.
    gaussian: f64,
    /// Standard deviation of either.
    sigma: f64,
    is_stepped: bool,
}

impl RobustExcess {
    fn alarms(&self, excess: f64) -> bool {
        excess.is_finite() && excess > ALARM * self.sigma && excess.exp_m1() > LEAST
    }
}

/// The findings of all signals of a sensor together.
fn common(pieces: &[AxisReplicates<'_>], settings: &CalibrationSettings) -> Vec<CommonFinding> {
    let all = (0..ComparedQuantity::Outliers.most_levels(pieces))
        .map(|level| excess(pieces, level, settings));
    let (stepped, fine): (Vec<RobustExcess>, Vec<RobustExcess>) = all.partition(|e| e.is_stepped);
    let found: Vec<RobustExcess> = fine.into_iter().filter(|e| e.alarms(e.quantizer)).collect();
    let mut findings = Vec::new();
    if found.is_empty() {
        let differ = stepped
            .into_iter()
            .filter(|e| e.alarms(e.gaussian.abs()))
            .collect::<Vec<_>>();
        findings.extend(finding_at(CommonCause::CoarseSteps, &differ, |e| {
            e.gaussian
        }));
    } else if found.iter().all(|e| !e.alarms(e.gaussian.abs())) {
        // Outliers raise the classical variance by anything; that they make up for the allowance, no more and no less, at
        // every scale is not to be expected.
        findings.extend(finding_at(CommonCause::GaussianQuantization, &found, |e| {
            e.quantizer - e.gaussian
        }));
    } else {
        // Outliers of the finer scales explain what coarser steps show.
        findings.extend(finding_at(CommonCause::Outliers, &found, |e| e.quantizer));
    }
    findings.extend(drifts(pieces, settings.rate_hz));
    findings
}

/// The finding of scales at which a logarithm is far from 0.
fn finding_at(
    cause: CommonCause,
    scales: &[RobustExcess],
    log: impl Fn(&RobustExcess) -> f64,
) -> Option<CommonFinding> {
    let most = scales
        .iter()
        .max_by(|a, b| log(a).abs().total_cmp(&log(b).abs()))?;
    Some(CommonFinding {
        cause,
        tau_s: scales.iter().map(|e| e.tau_s).collect(),
        axis: None,
        size: log(most).exp_m1(),
        deviations: log(most) / most.sigma,
    })
}

/// The drifts that the recordings share, axis by axis; none where the model has one.
///
/// The mean slope of the recordings on an axis, over its standard deviation by their scatter, is Student's t with K − 1 degrees of
/// freedom if recordings drift by chance. The fitted model is not asked: a random walk fitted to the drift would explain it.
/// Where recordings scatter unequally (one is shorter), t exceeds its limit for 2.5 % the more rarely
/// ([Ibragimov and Müller](crate::bibliography::IbragimovMuller10)).
fn drifts(pieces: &[AxisReplicates<'_>], rate_hz: f64) -> Vec<CommonFinding> {
    let is_drift = |p: &Process| p.kind() == ProcessKind::Drift;
    if pieces
        .iter()
        .any(|p| p.model.processes.iter().any(is_drift))
    {
        return Vec::new();
    }
    let tested: Vec<(CommonFinding, f64)> = pieces
        .iter()
        .filter_map(|piece| {
            // The two halves are half a record apart.
            let slopes = piece
                .replicates
                .iter()
                .flatten()
                .map(|r| r.trend * rate_hz * 3600.0 / (0.5 * r.samples as f64))
                .filter(|slope| slope.is_finite())
                .collect::<Vec<_>>();
            let (size, deviations, p_value) = student(&slopes)?;
            let finding = CommonFinding {
                cause: CommonCause::Drift,
                tau_s: Vec::new(),
                axis: Some(piece.axis),
                size,
                deviations,
            };
            Some((finding, p_value))
        })
        .collect();
    // Bonferroni: any axis may be the one.
    let limit = FALSE_ALARM / tested.len() as f64;
    let is_seen = |(finding, p_value)| (p_value <= limit).then_some(finding);
    tested.into_iter().filter_map(is_seen).collect()
}

/// Fewest recordings that say what they have in common: of two, t exceeds 25 in one set of 40 by chance.
const FEWEST_TO_SHARE: usize = 3;

/// Mean, Student's t and the probability of one as far from 0 on either side; none of too few, or of equal numbers.
fn student(values: &[f64]) -> Option<(f64, f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    let t = mean / (squares / (count * (count - 1.0))).sqrt();
    let is_known = values.len() >= FEWEST_TO_SHARE && t.is_finite();
    let law = StudentsT::new(0.0, 1.0, count - 1.0)
        .ok()
        .filter(|_| is_known)?;
    Some((mean, t, 2.0 * law.sf(t.abs())))
}

fn excess(
    pieces: &[AxisReplicates<'_>],
    level: usize,
    settings: &CalibrationSettings,
) -> RobustExcess {
    let (test, tuning) = (ComparedQuantity::Outliers, &settings.tuning);
    let (mut of_quantizer, mut of_gaussian, mut variance, mut stepped) =
        (Vec::new(), Vec::new(), 0.0, 0);
    for piece in pieces.iter().filter(|p| !p.drifts(level)) {
        let long_enough = |r: &&&Replicate| test.levels(piece, r) > level;
        for replicate in piece.replicates.iter().flatten().filter(long_enough) {
            let eta = test.edof(
                piece.law.edof(replicate.samples)[level],
                tuning.efficiency(),
            );
            let (read_high, _) = tuning.quantization().factor(piece.law.quantization[level]);
            // E ln(chi²/eta) ≈ −1/eta: lower for the robust variance, by (1/e − 1)/eta of the classical one,
            // which is 1/eta here. The bias of robust variances of few coefficients is left out.
            let gaussian = excess_of_classical(replicate, level) - 1.0 / eta;
            stepped += usize::from(replicate.robust[level].is_stepped());
            of_gaussian.push(gaussian);
            of_quantizer.push(gaussian + read_high.ln());
            // The standard deviation of a mean of n is √(Σ variances)/n, that of the median √(π/2) times it where the
            // variances are alike, as those of recordings of one length are.
            variance += 2.0 / eta;
        }
    }
    RobustExcess {
        tau_s: tau_s(level as u32 + 1, settings.rate_hz),
        quantizer: crate::curve::median(&of_quantizer),
        gaussian: crate::curve::median(&of_gaussian),
        sigma: MEDIAN * variance.sqrt() / of_gaussian.len() as f64,
        is_stepped: 2 * stepped >= of_gaussian.len(),
    }
}

// Results of the diagnosis of each recording.

/// Verdict on a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordingVerdict {
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
    RecordingVerdict {
        Normal = "normal",
        Outliers = "outliers",
        Drift = "drift",
        Noise = "abnormal",
    }, in files
);

fn by_axis<S: Serializer>(values: &[(Axis, f64)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(values.iter().copied())
}

/// Reason that a recording is abnormal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alarm {
    /// Probability that the most unusual of recordings that are alike is as unusual.
    pub p_value: f64,
    /// First and last of the neighbouring scales (s) at which it is most unusual.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tau_s: Vec<f64>,
    /// Drift of each axis: mean of the later half minus that of the earlier one (units of the
    /// sensor).
    #[serde(serialize_with = "by_axis", skip_serializing_if = "Vec::is_empty")]
    pub change: Vec<(Axis, f64)>,
    /// Deviations from the others there, axis by axis, in standard deviations.
    #[serde(serialize_with = "by_axis")]
    pub deviations: Vec<(Axis, f64)>,
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
    pub verdict: RecordingVerdict,
    /// Evidence that its noise differs.
    pub noise: Option<Alarm>,
    /// Evidence of outliers.
    pub outliers: Option<Alarm>,
    /// Evidence of a drift.
    pub drift: Option<Alarm>,
    /// Findings that most signals of this sensor have in common.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub common: Vec<CommonFinding>,
}

#[cfg(test)]
mod common_tests {
    use super::*;

    /// By hand: 1, 2, 3 have the mean 2 and the standard error √(1/3), t = 2√3; for two degrees of freedom P(|T| > t) =
    /// 1 − t/√(2 + t²) = 1 − √12/√14.
    #[test]
    fn student_by_hand() {
        let (mean, t, p) = student(&[1.0, 2.0, 3.0]).unwrap();
        approx::assert_relative_eq!(mean, 2.0);
        approx::assert_relative_eq!(t, 12.0_f64.sqrt(), max_relative = 1e-14);
        approx::assert_relative_eq!(p, 1.0 - (12.0_f64 / 14.0).sqrt(), max_relative = 1e-9);
        assert_eq!((student(&[1.0, 2.0]), student(&[2.0; 3])), (None, None));
    }
}
