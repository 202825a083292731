//! Wavelet-variance curves as JSON: of signals (`wv`), and of fits (`<model>.wv.json`).

use nav_sim_calibration::{
    CalibrationSettings, Diagnosis, Estimator, Group, Outcome, Replicate, implied, tau_s,
};
use nav_sim_document::{Mark, short_names};
use nav_sim_signal::imu::{Axis, Channel, Sensor};
use nav_sim_signal::wavelet::interval;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashSet};

/// Confidence of all intervals.
pub(crate) const CONFIDENCE: f64 = 0.95;

/// A wavelet variance with its intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VarianceBand {
    /// Wavelet variance (units²).
    pub wv: Vec<f64>,
    /// Lower ends of its 95 % intervals.
    pub ci_low: Vec<f64>,
    /// Upper ends.
    pub ci_high: Vec<f64>,
    /// Status of each robust variance.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub status: Vec<String>,
}

impl VarianceBand {
    fn new(wv: Vec<f64>, edof: &[f64], status: Vec<String>) -> Self {
        let (ci_low, ci_high) = wv
            .iter()
            .zip(edof)
            .map(|(nu, edof)| interval::interval(*nu, *edof, CONFIDENCE))
            .unzip();
        Self {
            wv,
            ci_low,
            ci_high,
            status,
        }
    }
}

/// The wavelet variances of one signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalCurves {
    /// Recording.
    pub file: String,
    /// Sensor.
    pub sensor: Sensor,
    /// Axis.
    pub axis: Axis,
    /// Samples.
    pub samples: usize,
    /// Scales, 2^j samples (s).
    pub tau_s: Vec<f64>,
    /// Equivalent degrees of freedom of the classical variance.
    pub edof: Vec<f64>,
    /// Classical.
    pub classical: VarianceBand,
    /// Robust.
    pub robust: VarianceBand,
}

impl SignalCurves {
    /// The curves of a signal at a rate (Hz); `edof` are the degrees of freedom of its classical variance.
    pub(crate) fn new(
        channel: Channel,
        replicate: &Replicate,
        rate_hz: f64,
        edof: Vec<f64>,
        efficiency: f64,
    ) -> Self {
        let robust_edof: Vec<f64> = edof
            .iter()
            .map(|e| interval::edof_robust(*e, efficiency))
            .collect();
        let (values, status) = replicate
            .robust
            .iter()
            .map(|r| (r.value, r.status.name().to_owned()))
            .unzip();
        Self {
            file: replicate.name.clone(),
            sensor: channel.sensor,
            axis: channel.axis,
            samples: replicate.samples,
            tau_s: (1..=edof.len() as u32).map(|j| tau_s(j, rate_hz)).collect(),
            classical: VarianceBand::new(replicate.classical.clone(), &edof, Vec::new()),
            robust: VarianceBand::new(values, &robust_edof, status),
            edof,
        }
    }

    pub(crate) fn channel(&self) -> Channel {
        let (sensor, axis) = (self.sensor, self.axis);
        Channel { sensor, axis }
    }

    /// The Allan deviation at a scale, if it has that: the wavelet variance is half the Allan variance.
    pub(crate) fn allan_deviation(&self, scale: usize) -> Option<f64> {
        Some((2.0 * self.classical.wv.get(scale)?).sqrt())
    }
}

/// JSON answer of `wv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalsFile {
    /// Layout version.
    pub schema_version: u32,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// Efficiency of the robust variance; its degrees of freedom are edof times this.
    pub efficiency: f64,
    /// Source of the degrees of freedom: `eta3` or `large-sample`.
    pub edof_method: String,
    /// Confidence of the intervals.
    pub confidence: f64,
    /// One entry a signal.
    pub signals: Vec<SignalCurves>,
    /// Each recording against the others; none of too few.
    #[serde(
        rename = "replicates",
        skip_deserializing,
        skip_serializing_if = "Vec::is_empty"
    )]
    pub diagnoses: Vec<Diagnosis>,
}

impl From<SignalsFile> for CurvesFile {
    /// The classical variance of each signal as the curve of GMWM, the robust one as that of RGMWM.
    fn from(file: SignalsFile) -> Self {
        let curves = file.signals.iter().flat_map(|s| {
            [
                (Estimator::Gmwm, &s.classical),
                (Estimator::Rgmwm, &s.robust),
            ]
            .map(|(estimator, band)| {
                let efficiency = estimator.is_robust().then_some(file.efficiency);
                let edof =
                    |e: &f64| efficiency.map_or(*e, |share| interval::edof_robust(*e, share));
                FittedCurve {
                    efficiency,
                    sensor: s.sensor,
                    axis: s.axis.name().to_owned(),
                    estimator: estimator.name().to_owned(),
                    tau_s: s.tau_s.clone(),
                    wv: band.wv.clone(),
                    edof: s.edof.iter().map(edof).collect(),
                    ..FittedCurve::default()
                }
            })
        });
        Self {
            schema_version: file.schema_version,
            rate_hz: file.rate_hz,
            curves: curves.collect(),
        }
    }
}

/// The curves behind a model, and what the model makes of them.
#[derive(Serialize, Deserialize)]
pub(crate) struct CurvesFile {
    /// Layout version.
    pub schema_version: u32,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// One entry a fit.
    pub curves: Vec<FittedCurve>,
}

/// A curve, the model fitted to it, and the replicates it is the average of. Only sensor, axis, tau_s, wv
/// and edof are needed to fit a model to it again.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct FittedCurve {
    /// Sensor.
    pub sensor: Sensor,
    /// `x`, `y`, `z`, or `all`.
    pub axis: String,
    /// Estimator.
    #[serde(default)]
    pub estimator: String,
    /// Scales, 2^j samples (s).
    pub tau_s: Vec<f64>,
    /// Wavelet variance (units²).
    pub wv: Vec<f64>,
    /// Equivalent degrees of freedom.
    pub edof: Vec<f64>,
    /// Efficiency of the robust wavelet variance, where it is one: says how it reads quantization noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub efficiency: Option<f64>,
    /// Scales (s) at which it is the classical one all the same.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub classical_tau_s: Vec<f64>,
    /// Median ln of each variance over the true one, for a fit that is centred by it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub log_bias: Vec<f64>,
    /// Variance of ln nu, at all scales alike, by which the curve of other recordings would differ beyond that.
    #[serde(default)]
    pub differing: f64,
    /// Lower ends of the 95 % intervals.
    #[serde(default)]
    pub ci_low: Vec<f64>,
    /// Upper ends.
    #[serde(default)]
    pub ci_high: Vec<f64>,
    /// The curve that the model implies: its wavelet variance, or what the robust one reads of it.
    #[serde(default)]
    pub implied: Vec<f64>,
    /// Wavelet variance of each of its processes.
    #[serde(default)]
    pub processes: BTreeMap<String, Vec<f64>>,
    /// The replicates.
    #[serde(default)]
    pub replicates: Vec<ReplicateCurve>,
}

/// The wavelet variance of one replicate: robust where the estimator is.
#[derive(Serialize, Deserialize)]
pub(crate) struct ReplicateCurve {
    /// Recording.
    pub file: String,
    /// Axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// Samples.
    pub samples: usize,
    /// Wavelet variance (units²).
    pub wv: Vec<f64>,
}

impl CurvesFile {
    /// The file of some outcomes and the groups they are of.
    pub(crate) fn new(
        groups: &[Group],
        outcomes: &[Outcome],
        settings: &CalibrationSettings,
    ) -> Self {
        let replicates = |o: &Outcome| {
            groups
                .iter()
                .find(|g| g.scope == o.scope)
                .map_or(&[][..], |g| &g.replicates)
        };
        let curves = outcomes
            .iter()
            .map(|o| fitted(o, replicates(o), settings))
            .collect();
        Self {
            schema_version: 1,
            rate_hz: settings.rate_hz,
            curves,
        }
    }
}

fn fitted(
    outcome: &Outcome,
    replicates: &[Replicate],
    settings: &CalibrationSettings,
) -> FittedCurve {
    let Outcome {
        curve,
        fit,
        estimator,
        ..
    } = outcome;
    let band = VarianceBand::new(curve.wv.clone(), &curve.edof, Vec::new());
    let model = &fit.composite;
    let over_levels = |f: &dyn Fn(u32) -> f64| curve.levels.iter().map(|level| f(*level)).collect();
    let parts = model.labels().into_iter().zip(&model.processes);
    let replicate = |r: &Replicate| ReplicateCurve {
        file: r.name.clone(),
        axis: r.axis.map(|a| a.name().to_owned()),
        samples: r.samples,
        wv: r.values(*estimator),
    };
    FittedCurve {
        sensor: outcome.scope.sensor,
        axis: outcome.scope.axis.map_or("all", |a| a.name()).to_owned(),
        estimator: estimator.name().to_owned(),
        tau_s: over_levels(&|level| tau_s(level, settings.rate_hz)),
        wv: band.wv,
        edof: curve.edof.clone(),
        efficiency: estimator.is_robust().then(|| settings.tuning.efficiency()),
        classical_tau_s: curve
            .classical
            .iter()
            .map(|level| tau_s(*level, settings.rate_hz))
            .collect(),
        log_bias: curve.log_bias.clone(),
        differing: curve.differing,
        ci_low: band.ci_low,
        ci_high: band.ci_high,
        implied: implied(model, curve),
        processes: parts
            .map(|(label, p)| (label, over_levels(&|level| p.haar_wv(level))))
            .collect(),
        replicates: replicates.iter().map(replicate).collect(),
    }
}

// Axes, points and bands of charts of wavelet variances.

/// Names of recordings, short and without the endings of their files: `run4` of `static/run4.csv.gz`.
pub(crate) fn recording_names<'a>(files: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let stem = |name: &String| {
        let unpacked = name.strip_suffix(".gz").unwrap_or(name);
        // Of `imu.1.csv` the number stays.
        let is_ending = |(_, ending): &(&str, &str)| ending.starts_with(char::is_alphabetic);
        let parts = unpacked.rsplit_once('.').filter(is_ending);
        parts.map_or(unpacked, |(stem, _)| stem).to_owned()
    };
    let files: Vec<&str> = files.into_iter().collect();
    let names = short_names(&files);
    let stems: Vec<String> = names.iter().map(stem).collect();
    let distinct: HashSet<&String> = stems.iter().collect();
    if distinct.len() < names.iter().collect::<HashSet<_>>().len() {
        names
    } else {
        stems
    }
}

/// A sensor in words.
pub(crate) fn sensor_name(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Accel => "Accelerometer",
        Sensor::Gyro => "Gyroscope",
    }
}

/// Points of a curve.
pub(crate) fn curve(tau_s: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    tau_s.iter().copied().zip(values.iter().copied()).collect()
}

/// The area between two curves.
pub(crate) fn band(tau_s: &[f64], low: &[f64], high: &[f64]) -> Mark {
    Mark::Band(
        tau_s
            .iter()
            .zip(low)
            .zip(high)
            .map(|((t, a), b)| (*t, *a, *b))
            .collect(),
    )
}
