//! A noise model as the parameters of other programs: each value with its key, unit, rate and meaning.
//!
//! [`Export::new`] fits the pair that the target knows ([`noise::practical`](nav_sim_signal::noise::practical)) to the model's
//! noisiest axis, states by how much the two differ, and [`Export::text`] writes it in the target's own syntax.
//!
//! ```
//! use nav_sim::export::{Export, Settings, Target};
//! use nav_sim::prelude::*;
//!
//! let white = Composite::new(vec![Process::White(White::new(4e-6)?)]);
//! let model = Model::pooled(100.0, &white, &white);
//! let (policy, horizon) = (Policy::Matched, Horizon::default());
//! let settings = Settings { policy, horizon, range_s: 1e4, turn_on: [None; 2], misfit: None };
//! let yaml = Export::new(Target::Kalibr, &model, &[], settings)?.text("white");
//! // N = √(sigma2/f) = √(4e-6/100)
//! let line = yaml.lines().find(|line| line.starts_with("gyroscope_noise_density: ")).expect("a key of Kalibr");
//! let n: f64 = line.split(' ').nth(1).expect("a value").parse()?;
//! assert!((n / 2e-4 - 1.0).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod autopilots;
mod filters;
mod gazebo;
mod job;
mod json;
mod layout;
mod lidar;
mod sheet;
mod simulators;
mod target;
mod vision;
mod words;

pub use job::{export, exported};
pub(crate) use json::parameters as parameters_json;
pub(crate) use sheet::Quantity;
pub use target::Target;

use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::noise::practical::{
    AxisParameters, Bias, Closure, Curve, CurveError, Horizon, Markov, Pair, Policy,
};
use nav_sim_signal::noise::{Composite, Model, Process};

/// How a model is turned into parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Which pair stands for the model.
    pub policy: Policy,
    /// Over which averaging times.
    pub horizon: Horizon,
    /// Longest averaging time at which a minimum of the Allan deviation is believed (s).
    pub range_s: f64,
    /// Standard deviation of the turn-on bias of accelerometer (m/s²) and gyroscope (rad/s), where known.
    pub turn_on: [Option<f64>; 2],
    /// Disagreement of the model with its recordings, in words.
    pub misfit: Option<String>,
}

/// Why a model cannot be exported.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// A sensor is not in the model.
    #[error("the model has no {}, and {target} needs both sensors", .sensor.name())]
    NoSensor {
        /// The sensor.
        sensor: Sensor,
        /// The target.
        target: &'static str,
    },
    /// A bias is to be taken as it is, and the target has none of that kind.
    #[error("{target} has no {bias}, and the model's {} has one", .sensor.name())]
    NoSuchBias {
        /// What it has not.
        bias: &'static str,
        /// The sensor.
        sensor: Sensor,
        /// The target.
        target: &'static str,
    },
    /// Two correlation times are to be taken as they are, and the target has one.
    #[error(
        "KF-GINS has one correlation time, the model's sensors have {accel_s:.3} s and {gyro_s:.3} s"
    )]
    TwoTimes {
        /// Of the accelerometer (s).
        accel_s: f64,
        /// Of the gyroscope (s).
        gyro_s: f64,
    },
    /// Its noise cannot be described.
    #[error("{}: {source}", .sensor.name())]
    Curve {
        /// The sensor.
        sensor: Sensor,
        /// Why.
        source: CurveError,
    },
}

/// One line of the exported file.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Key, as the target writes it.
    pub key: &'static str,
    /// The value, in the target's unit.
    pub value: f64,
    /// The unit, in ASCII.
    pub unit: &'static str,
    /// What it is, and at which rate.
    pub meaning: String,
    /// What the model asks for, where the target's documented range does not hold it.
    pub wanted: Option<f64>,
}

impl Entry {
    fn new(key: &'static str, value: f64, unit: &'static str, meaning: impl Into<String>) -> Self {
        Self {
            key,
            value,
            unit,
            meaning: meaning.into(),
            wanted: None,
        }
    }

    /// The same within a documented range.
    fn within(mut self, low: f64, high: f64) -> Self {
        if !(low..=high).contains(&self.value) {
            self.wanted = Some(self.value);
            self.value = self.value.clamp(low, high);
        }
        self
    }
}

/// What is known of one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorExport {
    /// Which sensor.
    pub sensor: Sensor,
    /// Parameters of each axis that the model has.
    pub axes: Vec<(Channel, AxisParameters)>,
    /// Parameters of the largest axis at each averaging time: what is exported.
    pub largest: AxisParameters,
    /// Allan deviation at 1 s of each axis (units), in the order of `axes`.
    pub deviation_at_1_s: Vec<f64>,
    /// The pair that the target is given.
    pub exported: Pair,
    /// How that pair compares with the model over the horizon.
    pub closure: Closure,
    /// Standard deviation of the bias at the start (units): of the turn-on bias where the model states one, else of the
    /// bias that the pair has.
    pub bias_sd: f64,
    /// Standard deviation of the turn-on bias, where the model states one (units).
    pub turn_on: Option<f64>,
    left_out: nav_sim_signal::noise::practical::Ratio,
}

/// A model in the terms of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// Which program.
    pub(crate) target: Target,
    /// Sample rate of the model, for values per sample (Hz).
    pub(crate) rate_hz: f64,
    /// How it was made.
    pub(crate) settings: Settings,
    /// Accelerometer and gyroscope.
    pub(crate) sensors: [SensorExport; 2],
    /// The lines of the file.
    pub(crate) entries: Vec<Entry>,
}

impl Export {
    /// The parameters of a model; axes in `missing` are not in it.
    ///
    /// # Errors
    /// When a sensor is missing or has no noise over the horizon, or the horizon does not suit the rate.
    pub fn new(
        target: Target,
        model: &Model,
        missing: &[Channel],
        settings: Settings,
    ) -> Result<Self, ExportError> {
        let mut curves = Vec::new();
        for sensor in Sensor::ALL {
            let channels: Vec<Channel> = Channel::ALL
                .into_iter()
                .filter(|c| c.sensor == sensor && !missing.contains(c))
                .collect();
            if channels.is_empty() {
                return Err(ExportError::NoSensor {
                    sensor,
                    target: target.name(),
                });
            }
            let axes: Vec<&Composite> = channels.iter().map(|c| model.axis(*c)).collect();
            let lacking = (settings.policy == Policy::Strict)
                .then(|| lacking(target.bias(), &axes))
                .flatten();
            if let Some(bias) = lacking {
                return Err(ExportError::NoSuchBias {
                    bias,
                    sensor,
                    target: target.name(),
                });
            }
            let curve = Curve::largest(&axes, model.rate_hz, settings.horizon)
                .map_err(|source| ExportError::Curve { sensor, source })?;
            curves.push((channels, curve));
        }
        let bias = common_bias(target, settings.policy, [&curves[0].1, &curves[1].1]);
        let mut sensors = Vec::new();
        for (channels, curve) in &curves {
            sensors.push(SensorExport::new(model, channels, curve, bias, &settings)?);
        }
        let sensors: [SensorExport; 2] = sensors.try_into().expect("two sensors");
        if let (Target::KfGins, [Some(accel), Some(gyro)]) =
            (target, sensors.each_ref().map(|s| s.exported.markov))
            && (accel.t_corr_s / gyro.t_corr_s - 1.0).abs() > 1e-9
        {
            return Err(ExportError::TwoTimes {
                accel_s: accel.t_corr_s,
                gyro_s: gyro.t_corr_s,
            });
        }
        let entries = (target.layout().entries)(&Values::new(model.rate_hz, &sensors));
        Ok(Self {
            target,
            rate_hz: model.rate_hz,
            settings,
            sensors,
            entries,
        })
    }
}

/// The kind of bias that the model has and the target has not. The AR1 beside a random walk are what a strict pair leaves out,
/// as its doubts say; a Gauss-Markov process that is the model's only bias is not left out.
fn lacking(known: Bias, axes: &[&Composite]) -> Option<&'static str> {
    let has = |kind: fn(&Process) -> bool| axes.iter().any(|a| a.processes.iter().any(kind));
    let walks = has(|p| matches!(p, Process::RandomWalk(_)));
    match known {
        Bias::Walk => {
            (!walks && has(|p| matches!(p, Process::GaussMarkov(_)))).then_some("Gauss-Markov bias")
        }
        _ => walks.then_some("random walk"),
    }
}

/// The bias that the target knows. KF-GINS has one correlation time for both sensors.
fn common_bias(target: Target, policy: Policy, [accel, gyro]: [&Curve; 2]) -> Bias {
    if target == Target::KfGins && policy != Policy::Strict {
        return Bias::MarkovOf(accel.shared_correlation_time_s(gyro, policy));
    }
    target.bias()
}

impl SensorExport {
    fn new(
        model: &Model,
        channels: &[Channel],
        curve: &Curve,
        bias: Bias,
        settings: &Settings,
    ) -> Result<Self, ExportError> {
        let sensor = channels[0].sensor;
        let parameters = |axes: &[&Composite]| {
            AxisParameters::of(
                axes,
                model.rate_hz,
                settings.horizon,
                settings.policy,
                settings.range_s,
            )
            .map_err(|source| ExportError::Curve { sensor, source })
        };
        let all: Vec<&Composite> = channels.iter().map(|c| model.axis(*c)).collect();
        let mut axes = Vec::new();
        for channel in channels {
            axes.push((*channel, parameters(&[model.axis(*channel)])?));
        }
        let largest = parameters(&all)?;
        let exported = curve.pair(settings.policy, bias);
        let second = (model.rate_hz.round() as u32).max(1);
        let turn_on = settings.turn_on[sensor as usize];
        let walked = largest.walk.walk * settings.horizon.to_s.sqrt();
        let spread = largest.markov.markov.map_or(walked, |m| m.sigma);
        Ok(Self {
            sensor,
            deviation_at_1_s: all
                .iter()
                .map(|a| a.allan_variance(second).sqrt())
                .collect(),
            axes,
            largest,
            exported,
            closure: exported.closure(curve),
            bias_sd: turn_on.unwrap_or(spread),
            turn_on,
            left_out: curve.left_out(),
        })
    }
}

/// The numbers that targets write, in SI units.
#[derive(Debug, Clone, Copy)]
struct Values {
    rate_hz: f64,
    accel: SensorValues,
    gyro: SensorValues,
}

#[derive(Debug, Clone, Copy)]
struct SensorValues {
    /// White noise density N (units/√Hz).
    density: f64,
    /// Random-walk density K (units/s/√Hz).
    walk: f64,
    /// Gauss-Markov bias; of no size and endless memory where the model has none.
    markov: Markov,
    /// Standard deviation of the bias at the start (units).
    bias_sd: f64,
    /// Standard deviation of the turn-on bias, where known (units).
    turn_on: Option<f64>,
    /// What `bias_sd` is, in words.
    bias_meaning: &'static str,
}

/// The correlation time that a search leaves to a bias of no size means nothing.
const NO_BIAS: Markov = Markov {
    sigma: 0.0,
    t_corr_s: f64::INFINITY,
};

impl Values {
    fn new(rate_hz: f64, sensors: &[SensorExport; 2]) -> Self {
        let of_sensor = |s: &SensorExport| SensorValues {
            density: s.exported.density,
            // Programs that list K beside a Gauss-Markov bias do not use it; it is that of the other pair.
            walk: s.largest.walk.walk,
            markov: s
                .exported
                .markov
                .filter(|m| m.sigma > 0.0)
                .unwrap_or(NO_BIAS),
            bias_sd: s.bias_sd,
            turn_on: s.turn_on,
            bias_meaning: if s.turn_on.is_some() {
                "turn-on bias, standard deviation"
            } else {
                "standard deviation of the moving bias; the model states no turn-on bias"
            },
        };
        Self {
            rate_hz,
            accel: of_sensor(&sensors[0]),
            gyro: of_sensor(&sensors[1]),
        }
    }
}

#[cfg(test)]
mod tests;
