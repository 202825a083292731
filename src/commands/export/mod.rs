//! `nav-sim export`: a noise model as the parameters of other programs, each value with its key, unit, rate and meaning.
//!
//! [`Export::new`] fits the pair that the target knows ([`noise::practical`](nav_sim_signal::noise::practical)) to the model's
//! noisiest axis, states by how much the two differ, and [`Export::text`] writes it in the target's own syntax (`targets.rs`).

use crate::app::{
    Command, Context, Failure, IntoFailure, OutputKind, PlainAnswer, Result, refused,
};
use crate::io::model_file::{self, ModelFile};
use crate::io::recordings::facts;
use crate::parse::{one_of, seconds_range};
use nav_sim_calibration::percent;
use nav_sim_document::{Document, Importance, Tone, readable};
use nav_sim_signal::imu::{Axis, Sensor};
use nav_sim_signal::noise::practical::{
    AllanCurve, AxisParameters, BiasModel, Horizon, NoiseDensities, PairClosure, Policy, Ratio,
};
use nav_sim_signal::noise::{Composite, ProcessKind};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};
use serde::Serialize;
use serde_json::json;
use std::path::PathBuf;

mod targets;

pub use targets::Target;

/// Longest averaging time at which a minimum is trusted of a model that no calibration made (s).
const LONGEST_S: f64 = 10_000.0;

/// Write a noise model as the parameters of another program
///
/// Other filters know white noise (N) and one bias process, a random walk (K) or a Gauss-Markov process. --policy says
/// which such pair stands for the model's noisiest axis over --horizon.
#[derive(clap::Args, Debug, Clone)]
pub struct ExportArgs {
    /// Noise model (TOML)
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Program to export to
    #[arg(long, value_name = "PROGRAM", value_parser = one_of::<Target>(&Target::NAMES))]
    target: Target,
    /// strict: WN and RW as they are; matched: the model's Allan deviation at 1 s and the closest bias; envelope: the
    /// smallest pair that is nowhere below the model
    #[arg(long, value_name = "POLICY", value_parser = one_of::<Policy>(&Policy::NAMES), default_value = Policy::Matched.name())]
    policy: Policy,
    /// Averaging times over which the pair stands for the model
    #[arg(long, value_name = "FROM:TO", value_parser = horizon, default_value = "1s:100s")]
    horizon: Horizon,
}

fn horizon(text: &str) -> Result<Horizon, String> {
    let (from_s, to_s) = seconds_range(text)?;
    Ok(Horizon { from_s, to_s })
}

impl Command for ExportArgs {
    type Answer = PlainAnswer;
    const NAME: &'static str = "export";
    const OUT: OutputKind = OutputKind::File {
        name: "parameters.txt",
        help: "File to write (default: stdout)",
    };
    const PLOT: bool = false;
    const PRINTS_FILE: bool = true;

    fn run(&self, _: &Context<'_>) -> Result<PlainAnswer> {
        let file = model_file::read(&self.model)?;
        let model = self.model.display().to_string();
        let export = Export::new(&file, self.target, self.policy, self.horizon)
            .map_err(|failure| failure.within(&model))?;
        let mut document = Document::new(self.target.name, Tone::Good, [""; 0]);
        for line in export.summary() {
            document.note(Importance::Remark, line);
        }
        let out_of_range = facts::out_of_range(&file.model).into_iter();
        let out_of_range = out_of_range.map(|text| format!("{model}: {text}"));
        for doubt in out_of_range.chain(export.doubts()) {
            document.note(Importance::Warning, doubt);
        }
        let [accel, gyro] = &export.sensors;
        let json = json!({
            "schema_version": 1,
            "target": self.target.name,
            "model": model,
            "rate_hz": export.rate_hz,
            "policy": self.policy.name(),
            "horizon_s": [self.horizon.from_s, self.horizon.to_s],
            "entries": export.filled(&[]).0,
            "sensors": { "accel": accel, "gyro": gyro },
            "warnings": export.doubts(),
        });
        let text = export.text(&model) + "\n";
        Ok(PlainAnswer::new(json, document).with([("", text)]))
    }
}

/// One value of the exported file.
#[derive(Serialize)]
struct ExportEntry {
    /// Key, as the target writes it.
    pub key: String,
    /// The value, in the target's unit.
    pub value: f64,
    /// The unit, in ASCII.
    pub unit: &'static str,
    /// Meaning and rate of the value.
    pub meaning: String,
    /// Value of the model, where the target's documented range does not hold it.
    #[serde(rename = "model_value")]
    pub wanted: Option<f64>,
}

/// Known figures of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct SensorExport {
    #[serde(skip)]
    sensor: Sensor,
    /// Allan deviation at 1 s of each axis that the model has (units).
    #[serde(skip)]
    axes: Vec<(Axis, f64)>,
    /// Parameters of the largest axis at each averaging time: what is exported.
    largest: AxisParameters,
    /// The pair that the target is given.
    exported: NoiseDensities,
    /// Ratio of that pair to the model over the horizon.
    closure: PairClosure,
    /// Standard deviation of the bias at the start (units): of the turn-on bias where the model states one, else of the
    /// bias that the pair has.
    bias_sd: f64,
    /// Standard deviation of the turn-on bias, where the model states one (units).
    turn_on: Option<f64>,
    /// Largest share of the Allan variance that no pair has.
    left_out: Ratio,
}

/// A model in the terms of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    target: Target,
    /// Sample rate of the model, for values per sample (Hz).
    rate_hz: f64,
    policy: Policy,
    horizon: Horizon,
    /// Disagreement of the model with its recordings, in words.
    misfit: Option<String>,
    /// Accelerometer and gyroscope.
    sensors: [SensorExport; 2],
}

/// A model as the file of a target, matched over averages of 1 s to 100 s; `name` is that of the model in its head.
///
/// ```
/// use nav_sim::prelude::*;
///
/// let model = read_model("calib_data/tactical.toml".as_ref())?;
/// let yaml = nav_sim::export(&model, "tactical", "kalibr".parse()?)?;
/// assert!(yaml.contains("\ngyroscope_noise_density: 1.234"), "{yaml}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`exported`].
pub fn export(file: &ModelFile, name: &str, target: Target) -> Result<String, Failure> {
    Ok(Export::new(file, target, Policy::Matched, Horizon::default())?.text(name))
}

impl Export {
    /// The parameters of a model in the terms of a target: the pair of that policy, over averages of that horizon.
    ///
    /// # Errors
    /// When a sensor is missing or has no noise over the horizon, or the target has not what a strict pair needs.
    pub fn new(
        file: &ModelFile,
        target: Target,
        policy: Policy,
        horizon: Horizon,
    ) -> Result<Self, Failure> {
        let misfit = file.misfit().map(|misfit| misfit.to_string());
        let file = &file.clone().for_navigation();
        let rate_hz = file.model.rate_hz;
        let axes = |sensor: Sensor| -> Vec<(Axis, &Composite)> {
            file.present()
                .filter(|c| c.sensor == sensor)
                .map(|c| (c.axis, file.model.axis(c)))
                .collect()
        };
        let mut curves = Vec::new();
        for sensor in Sensor::ALL {
            let noise: Vec<&Composite> = axes(sensor).iter().map(|(_, noise)| *noise).collect();
            check(target, policy, sensor, &noise)?;
            curves.push(AllanCurve::largest(&noise, rate_hz, horizon).refuse_within(sensor)?);
        }
        let bias = if target.has_one_time && policy != Policy::Strict {
            BiasModel::MarkovOf(curves[0].shared_correlation_time_s(&curves[1], policy))
        } else {
            target.bias
        };
        let range_s = file.observed_s().unwrap_or(LONGEST_S).max(horizon.to_s);
        let second = (rate_hz.round() as u32).max(1);
        let of_sensor = |sensor: Sensor| -> Result<SensorExport, Failure> {
            let (curve, axes) = (&curves[sensor as usize], axes(sensor));
            let noise: Vec<&Composite> = axes.iter().map(|(_, noise)| *noise).collect();
            let largest = AxisParameters::of(&noise, rate_hz, horizon, policy, range_s)
                .refuse_within(sensor)?;
            let exported = curve.pair(policy, bias);
            let turn_on = file.turn_on.unwrap_or_default().sigma(sensor);
            // A random walk moves so far within the horizon.
            let spread = largest
                .markov
                .markov
                .map_or(largest.walk.walk * horizon.to_s.sqrt(), |m| m.sigma);
            let deviation = |noise: &Composite| noise.allan_variance(second).sqrt();
            Ok(SensorExport {
                sensor,
                axes: axes.iter().map(|(axis, n)| (*axis, deviation(n))).collect(),
                largest,
                exported,
                closure: exported.closure(curve),
                bias_sd: turn_on.unwrap_or(spread),
                turn_on,
                left_out: curve.left_out(),
            })
        };
        let sensors = [of_sensor(Sensor::Accel)?, of_sensor(Sensor::Gyro)?];
        if let [Some(accel), Some(gyro)] = sensors.each_ref().map(|s| s.exported.markov)
            && target.has_one_time
            && (accel.t_corr_s / gyro.t_corr_s - 1.0).abs() > 1e-9
        {
            let (name, accel_s, gyro_s) = (target.name, accel.t_corr_s, gyro.t_corr_s);
            return refused(
                format!(
                    "{name} has one correlation time; the sensors have {accel_s:.3} s and {gyro_s:.3} s"
                ),
                MATCHED,
            );
        }
        Ok(Self {
            target,
            rate_hz,
            policy,
            horizon,
            misfit,
            sensors,
        })
    }

    /// The text of the file; `model` is its name in the head.
    pub fn text(&self, model: &str) -> String {
        self.filled(&self.head(model)).1
    }
}

const MATCHED: &str = "--policy matched fits the target's bias over --horizon";

/// Refuses a sensor without axes, and a strict pair of a bias that the target has not. The AR1 beside a random walk are what a
/// strict pair leaves out, as its doubts say; a Gauss-Markov process that is the model's only bias is not left out.
fn check(
    target: Target,
    policy: Policy,
    sensor: Sensor,
    axes: &[&Composite],
) -> Result<(), Failure> {
    let (name, sensor) = (target.name, sensor.name());
    if axes.is_empty() {
        return refused(
            format!("the model has no {sensor}, and {name} needs both"),
            "calibrate both sensors, or write the other section by hand",
        );
    }
    let has = |kind| {
        axes.iter()
            .any(|a| a.processes.iter().any(|p| p.kind() == kind))
    };
    let walks = has(ProcessKind::RandomWalk);
    let lacking = match target.bias {
        BiasModel::Walk => (!walks && has(ProcessKind::GaussMarkov)).then_some("Gauss-Markov bias"),
        _ => walks.then_some("random walk"),
    };
    match lacking {
        Some(bias) if policy == Policy::Strict => refused(
            format!("{name} has no {bias}, and the model's {sensor} has one"),
            MATCHED,
        ),
        _ => Ok(()),
    }
}

// Head of an exported file, its warnings and its JSON.

/// A pair is in doubt when its Allan deviation is off by more than this.
const TOLERANCE: f64 = 1.5;
/// Shares of the Allan variance, and differences of axes, that are reported.
const NOTABLE: f64 = 0.1;

/// A quantity of a sensor.
pub(crate) enum ExportQuantity {
    /// White noise density N: velocity or angle random walk.
    Density,
    /// Random-walk density K: acceleration or rate random walk.
    Walk,
    /// A bias: its instability, its standard deviation.
    Bias,
}

impl ExportQuantity {
    /// Unit of data sheets, and the factor from SI to it.
    pub(crate) const fn data_sheet_unit(self, sensor: Sensor) -> (&'static str, f64) {
        const ROOT_HOUR: f64 = 60.0;
        match (self, sensor) {
            (Self::Density, Sensor::Accel) => ("m/s/sqrt(h)", ROOT_HOUR),
            (Self::Density, Sensor::Gyro) => ("deg/sqrt(h)", ROOT_HOUR / DEG),
            (Self::Walk, Sensor::Accel) => ("m/s^2/sqrt(h)", ROOT_HOUR),
            (Self::Walk, Sensor::Gyro) => ("deg/h/sqrt(h)", ROOT_HOUR / DEG_PER_HOUR),
            (Self::Bias, Sensor::Accel) => ("ug", 1e6 / STANDARD_GRAVITY),
            (Self::Bias, Sensor::Gyro) => ("deg/h", 1.0 / DEG_PER_HOUR),
        }
    }

    fn text(self, x: f64, sensor: Sensor) -> String {
        let (unit, factor) = self.data_sheet_unit(sensor);
        format!("{} {unit}", readable(x * factor))
    }
}

impl Export {
    /// The comment at the head of the file.
    fn head(&self, model: &str) -> Vec<String> {
        let (horizon, name) = (self.horizon, self.target.name);
        let mut lines = vec![format!(
            "{name}: {model}, {} Hz, policy {} from {} s to {} s (nav-sim export)",
            self.rate_hz, self.policy, horizon.from_s, horizon.to_s
        )];
        lines.extend(self.summary());
        lines.extend(self.doubts().into_iter().map(|d| format!("Warning: {d}")));
        lines
    }

    /// A line for each sensor: its parameters in the units of data sheets, and how far the pair is from the model.
    fn summary(&self) -> Vec<String> {
        let line = |s: &SensorExport| {
            let (low, high) = (s.closure.lowest.ratio, s.closure.highest.ratio);
            format!(
                "{}: {}; {low:.2} to {high:.2} × the model",
                s.sensor.name(),
                s.parameters()
            )
        };
        self.sensors.iter().map(line).collect()
    }

    /// Warnings before pasting, the most important first.
    fn doubts(&self) -> Vec<String> {
        let misfit = self.misfit.iter();
        let mut doubts: Vec<String> = misfit.map(|misfit| format!("the model {misfit}")).collect();
        for s in &self.sensors {
            doubts.extend(
                s.doubts(self.policy)
                    .into_iter()
                    .map(|doubt| format!("{}: {doubt}", s.sensor.name())),
            );
        }
        doubts.extend(self.filled(&[]).0.iter().filter_map(|e| {
            let (ExportEntry { key, value, .. }, wanted) = (e, e.wanted?);
            Some(format!(
                "{key} is {value:.3e}, the end of its range, for {wanted:.3e}"
            ))
        }));
        if self.target.vibrates {
            doubts.push("a recording at rest has no vibration: use larger values".into());
        }
        doubts
    }
}

impl SensorExport {
    fn doubts(&self, policy: Policy) -> Vec<String> {
        let mut doubts = Vec::new();
        let NoiseDensities {
            density,
            walk,
            markov,
        } = self.exported;
        if density <= 0.0 {
            let remedy = match policy {
                Policy::Strict => ": try --policy matched",
                _ => "",
            };
            doubts.push(format!("N is 0, which many filters refuse{remedy}"));
        }
        if walk <= 0.0 && markov.is_none_or(|m| m.sigma <= 0.0) {
            doubts.push("K is 0: a filter will never correct its bias".to_owned());
        }
        let (lowest, highest) = (self.closure.lowest, self.closure.highest);
        let is_far = [lowest.ratio < 1.0 / TOLERANCE, highest.ratio > TOLERANCE];
        for ((Ratio { ratio, tau_s }, trust), is_far) in [(lowest, "much"), (highest, "little")]
            .into_iter()
            .zip(is_far)
        {
            if is_far {
                let at = seconds(tau_s);
                doubts.push(format!(
                    "{ratio:.2} times the model's Allan deviation at {at}: trusted too {trust} there"
                ));
            }
        }
        if self.left_out.ratio > NOTABLE && policy != Policy::Envelope {
            let (share, at) = (percent(self.left_out.ratio), seconds(self.left_out.tau_s));
            doubts.push(format!(
                "quantization noise or drift, {share} of the Allan variance at {at}, is left out"
            ));
        }
        let largest = self.axes.iter().map(|(_, d)| *d).fold(0.0, f64::max);
        let shares = self.axes.iter().map(|(axis, d)| (axis, d / largest));
        if shares.clone().any(|(_, share)| share < 1.0 - NOTABLE) {
            let shares: Vec<String> = shares.map(|(axis, d)| format!("{axis} {d:.2}")).collect();
            let shares = shares.join(", ");
            doubts.push(format!(
                "axes differ (Allan deviation at 1 s: {shares}); the largest is exported"
            ));
        } else if self.axes.len() < 3 {
            doubts.push(format!("the model has {} of three axes", self.axes.len()));
        }
        doubts
    }

    /// `N 0.42 deg/sqrt(h), K 12 deg/h/sqrt(h), B 8.3 deg/h at 160 s`.
    fn parameters(&self) -> String {
        let figure = |what: ExportQuantity, x: f64| what.text(x, self.sensor);
        let pair = self.exported;
        let bias = match pair.markov {
            None => format!("K {}", figure(ExportQuantity::Walk, pair.walk)),
            Some(m) => {
                let sigma = figure(ExportQuantity::Bias, m.sigma);
                format!("bias {sigma} with T = {}", seconds(m.t_corr_s))
            }
        };
        let floor = match self.largest.minimum {
            None => "B not reached".to_owned(),
            Some(m) => {
                let floor = figure(ExportQuantity::Bias, m.deviation);
                format!("B {floor} at {}", seconds(m.tau_s))
            }
        };
        format!(
            "N {}, {bias}, {floor}",
            figure(ExportQuantity::Density, pair.density)
        )
    }
}

fn seconds(t_s: f64) -> String {
    format!("{} s", readable(t_s))
}

#[cfg(test)]
mod tests;
