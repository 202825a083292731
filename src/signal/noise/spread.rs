//! Variation of the parameters between replicates: each time an IMU is switched on, its noise is drawn from a
//! model that is itself drawn (θ_i ~ G, [Minaretzis](crate::bibliography::Minaretzis24), eq. 1).
//!
//! In a model file:
//! ```toml
//! [[spread.accel]]                  # the three axes alike; or [[spread.accel.x]], …
//! process = "AR1_1"                 # label of the process: "WN", "AR1_1", "AR1_2", …
//! parameter = "phi"
//! distribution = "beta"             # low + width·B, B ~ Beta(a, b)
//! a = 6.0
//! b = 2.0
//! low = 0.9835489
//! width = 3.4476489e-3
//!
//! [[spread.gyro]]
//! process = "WN"
//! parameter = "sigma2"
//! distribution = "normal"           # about the model's value, drawn again while outside its domain
//! sd = 1.0e-9
//!
//! [[spread.gyro]]
//! process = "AR1"
//! parameter = "sigma2"
//! distribution = "lognormal"        # of phi and beta: the correlation time is
//! median = 2.1e-9
//! median_ci95 = [1.6e-9, 2.8e-9]    # of both, where they were estimated
//! sd = 0.3                          # of the logarithm
//! sd_ci95 = [0.18, 0.62]
//! ```
//! A parameter without a law keeps the model's value. Every axis of every replicate draws for itself, also
//! where one law stands for three axes.

use super::contamination::{Contamination, RefusedRule};
use super::{Composite, Model, Parameter, ParameterError, Process, Synthesizer};
use crate::imu::{Channel, Recording, Signal};
use crate::rng::{Generator, StreamKey};
use rand::RngExt;
use rand_distr::{Beta, StandardNormal};

/// Why a law is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpreadError {
    /// The model has no process of that label.
    #[error("the model has no process \"{label}\" there, only {}", known.join(", "))]
    NoProcess {
        /// Label asked for.
        label: String,
        /// Labels of the processes of the model.
        known: Vec<String>,
    },
    /// The process has no parameter of that name.
    #[error("{process} has no parameter \"{parameter}\", only {}", known.join(", "))]
    NoParameter {
        /// Code of the process.
        process: &'static str,
        /// Name asked for.
        parameter: String,
        /// Names of the parameters of the process.
        known: Vec<&'static str>,
    },
    /// A constant of the law is outside its domain.
    #[error("{name} = {value} is not {domain}")]
    Constant {
        /// Name of the constant.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be accepted.
        domain: &'static str,
    },
    /// Theta may be negative.
    #[error("theta has no logarithm: a lognormal law is of variances, slopes, phi and beta")]
    Lognormal,
    /// The law would draw values that the process cannot have.
    #[error("the law reaches values that are refused: {0}")]
    Reaches(ParameterError),
}

/// Largest standard deviation of a logarithm.
const LARGEST_SD: f64 = 10.0;

/// A distribution.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub enum Law {
    /// low + width·B, B ~ Beta(a, b).
    Beta {
        /// First shape.
        a: f64,
        /// Second shape.
        b: f64,
        /// Least value (units of the parameter).
        low: f64,
        /// Greatest less least value (units of the parameter).
        width: f64,
    },
    /// Normal about the model's value, truncated to the parameter's domain.
    Normal {
        /// Standard deviation before truncation (units of the parameter).
        sd: f64,
    },
    /// Normal on the scale of [`Parameter::scaled`]: of a variance or slope the logarithm, of phi and beta that of the correlation
    /// time.
    Lognormal {
        /// Median (units of the parameter).
        median: f64,
        /// Standard deviation of the logarithm.
        sd: f64,
        /// 95 % intervals of the two, where they were estimated.
        #[serde(skip_serializing_if = "Option::is_none")]
        ci95: Option<LognormalIntervals>,
    },
}

/// What recordings leave open of a lognormal law: 95 % intervals.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct LognormalIntervals {
    /// Of the median (units of the parameter).
    pub median: [f64; 2],
    /// Of the standard deviation of the logarithm.
    pub sd: [f64; 2],
}

/// The law of one parameter of one process of one axis.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Variation {
    process: String,
    parameter: String,
    law: Law,
}

impl Variation {
    /// The law of `parameter` of the process labelled `process` in `noise` sampled at `rate_hz`.
    ///
    /// # Errors
    /// When the process or parameter does not exist, or the law is no law or leaves the domain.
    pub fn new(
        noise: &Composite,
        rate_hz: f64,
        process: &str,
        parameter: &str,
        law: Law,
    ) -> Result<Self, SpreadError> {
        let labels = noise.labels();
        let Some(at) = labels.iter().position(|l| l == process) else {
            return Err(SpreadError::NoProcess {
                label: process.to_owned(),
                known: labels,
            });
        };
        let variation = Self {
            process: process.to_owned(),
            parameter: parameter.to_owned(),
            law,
        };
        variation.check_constants()?;
        // The domains are intervals: a beta law stays inside if its two ends do. A normal law is drawn again
        // until inside, so only its centre must be there.
        let (low, high) = match law {
            Law::Beta { low, width, .. } => (low, low + width),
            Law::Normal { .. } => {
                let value = variation.centre(&noise.processes[at])?;
                (value, value)
            }
            Law::Lognormal { median, .. } => (median, median),
        };
        for end in [low, high] {
            variation.applied(&noise.processes[at], end, rate_hz)?;
        }
        Ok(variation)
    }

    /// Label of the process, as [`Composite::labels`].
    pub fn process(&self) -> &str {
        &self.process
    }

    /// Name of the parameter, as [`Process::parameters`].
    pub fn parameter(&self) -> &str {
        &self.parameter
    }

    /// Its law.
    pub const fn law(&self) -> Law {
        self.law
    }

    fn check_constants(&self) -> Result<(), SpreadError> {
        let check = |name, value: f64, ok: bool, domain| {
            if value.is_finite() && ok {
                Ok(())
            } else {
                Err(SpreadError::Constant {
                    name,
                    value,
                    domain,
                })
            }
        };
        match self.law {
            Law::Beta { a, b, low, width } => {
                check("a", a, a > 0.0, "a finite number > 0")?;
                check("b", b, b > 0.0, "a finite number > 0")?;
                check("low", low, true, "a finite number")?;
                check("width", width, width >= 0.0, "a finite number ≥ 0")
            }
            // Below 1, at least 47 % of the draws of a coefficient in (−1, 1) are inside: redrawing ends.
            Law::Normal { sd } if matches!(self.parameter.as_str(), "phi" | "theta") => {
                check("sd", sd, (0.0..=1.0).contains(&sd), "between 0 and 1")
            }
            Law::Normal { sd } => check("sd", sd, sd >= 0.0, "a finite number ≥ 0"),
            Law::Lognormal { .. } if self.parameter == Parameter::Theta.name() => {
                Err(SpreadError::Lognormal)
            }
            Law::Lognormal { median, sd, .. } => {
                check("median", median, median > 0.0, "a finite number > 0")?;
                // ±8 standard deviations of 10 are 1e±35: more is a slip, and would leave the range of numbers.
                check(
                    "sd",
                    sd,
                    (0.0..=LARGEST_SD).contains(&sd),
                    "between 0 and 10",
                )
            }
        }
    }

    /// The error of a law for a parameter that the process does not have.
    pub fn no_parameter(&self, process: &Process) -> SpreadError {
        let known = process.parameters().into_iter().map(|(n, _)| n).collect();
        SpreadError::NoParameter {
            process: process.code(),
            parameter: self.parameter.clone(),
            known,
        }
    }

    fn centre(&self, process: &Process) -> Result<f64, SpreadError> {
        Ok(self.found(process)?.1)
    }

    /// The parameter and its value.
    fn found(&self, process: &Process) -> Result<(Parameter, f64), SpreadError> {
        let mut parameters = process.kind().parameters().iter().zip(process.values());
        let found = parameters.find(|(p, _)| p.name() == self.parameter);
        found
            .map(|(p, value)| (*p, value))
            .ok_or_else(|| self.no_parameter(process))
    }

    fn applied(&self, process: &Process, value: f64, rate_hz: f64) -> Result<Process, SpreadError> {
        let changed = process.with_parameter(&self.parameter, value, rate_hz);
        changed
            .ok_or_else(|| self.no_parameter(process))?
            .map_err(SpreadError::Reaches)
    }

    /// The process with this parameter drawn.
    fn draw(
        &self,
        process: &Process,
        rate_hz: f64,
        g: &mut Generator,
    ) -> Result<Process, SpreadError> {
        match self.law {
            Law::Beta { a, b, low, width } => {
                let error = |_| SpreadError::Constant {
                    name: "a",
                    value: a,
                    domain: "usable with b",
                };
                let share: f64 = g.sample(Beta::new(a, b).map_err(error)?);
                self.applied(process, low + width * share, rate_hz)
            }
            Law::Normal { sd } => {
                let centre = self.centre(process)?;
                loop {
                    match self.applied(
                        process,
                        centre + sd * g.sample::<f64, _>(StandardNormal),
                        rate_hz,
                    ) {
                        Err(SpreadError::Reaches(_)) => {}
                        done => return done,
                    }
                }
            }
            Law::Lognormal {
                median, sd: 0.0, ..
            } => self.applied(process, median, rate_hz),
            Law::Lognormal { median, sd, .. } => {
                let (parameter, _) = self.found(process)?;
                let scaled = parameter.scaled(median) + sd * g.sample::<f64, _>(StandardNormal);
                self.applied(process, parameter.unscaled(scaled), rate_hz)
            }
        }
    }
}

/// The laws of the six axes, in the order of [`Channel::ALL`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Spread {
    /// For each axis, the parameters that vary.
    pub axes: [Vec<Variation>; 6],
}

impl Spread {
    /// The model of one replicate (counted from 0): every law drawn, from streams of its own.
    ///
    /// # Errors
    /// When a law does not belong to this model ([`Variation::new`] was given another one).
    pub fn draw(&self, model: &Model, seed: u64, replicate: u64) -> Result<Model, SpreadError> {
        let mut drawn = model.clone();
        for channel in Channel::ALL {
            let source = channel.to_string();
            let noise = &mut drawn.axes[channel.index()];
            let labels = noise.labels();
            for variation in &self.axes[channel.index()] {
                let Some(at) = labels.iter().position(|l| *l == variation.process) else {
                    return Err(SpreadError::NoProcess {
                        label: variation.process.clone(),
                        known: labels,
                    });
                };
                let process = format!("spread.{}.{}", variation.process, variation.parameter);
                // A stream for each law: to let one more parameter vary changes no other's draws.
                let key = StreamKey {
                    seed,
                    scenario: "",
                    run: replicate,
                    source: &source,
                    process: &process,
                };
                noise.processes[at] =
                    variation.draw(&noise.processes[at], model.rate_hz, &mut key.generator())?;
            }
        }
        Ok(drawn)
    }
}

impl Spread {
    /// The model of one replicate of another centre: what is drawn about `model`, moved as `centre` lies from it on the scale of each
    /// parameter; parameters without a law are those of `centre`.
    ///
    /// # Errors
    /// As [`Spread::draw`]; `centre` has the processes of the model.
    pub fn draw_about(
        &self,
        centre: &Model,
        model: &Model,
        seed: u64,
        replicate: u64,
    ) -> Result<Model, SpreadError> {
        let drawn = self.draw(model, seed, replicate)?;
        let mut moved = centre.clone();
        for (axis, laws) in self.axes.iter().enumerate() {
            let labels = drawn.axes[axis].labels();
            for variation in laws {
                let Some(at) = labels.iter().position(|l| *l == variation.process) else {
                    continue;
                };
                let value = |model: &Model| variation.found(&model.axes[axis].processes[at]);
                let ((parameter, own), (_, from), (_, to)) =
                    (value(&drawn)?, value(model)?, value(centre)?);
                let scaled = parameter.scaled(own) + parameter.scaled(to) - parameter.scaled(from);
                let process = &mut moved.axes[axis].processes[at];
                // An amplitude of 0 has no logarithm: what was drawn stands.
                *process = variation
                    .applied(process, parameter.unscaled(scaled), model.rate_hz)
                    .or_else(|_| variation.applied(process, own, model.rate_hz))?;
            }
        }
        Ok(moved)
    }
}

// Virtual replicates: what a laboratory would record, switched on again and again.

/// Source of virtual replicates: an IMU with known noise.
#[derive(Debug, Clone, Copy)]
pub struct VirtualImu<'a> {
    /// The noise.
    pub model: &'a Model,
    /// Variation of its parameters between replicates; none: they do not vary.
    pub spread: Option<&'a Spread>,
    /// Contamination of the signals; none: they are clean.
    pub contamination: Option<&'a Contamination>,
    /// Seed of everything.
    pub seed: u64,
}

/// A replicate that cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReplicateError {
    /// The spread does not belong to the model.
    #[error(transparent)]
    Spread(#[from] SpreadError),
    /// The contamination does not fit the model or the record.
    #[error("{source} (replicate {replicate})")]
    Contamination {
        /// Which replicate, counted from 1.
        replicate: u64,
        /// Why.
        source: RefusedRule,
    },
}

impl VirtualImu<'_> {
    /// The model of a replicate, counted from 1: parameters drawn, then scaled by the contamination.
    ///
    /// # Errors
    /// When spread or contamination do not belong to the model.
    pub fn model_of(&self, replicate: u64) -> Result<Model, ReplicateError> {
        let mut model = match self.spread {
            Some(spread) => spread.draw(self.model, self.seed, replicate.wrapping_sub(1))?,
            None => self.model.clone(),
        };
        for channel in Channel::ALL {
            let Some(contamination) = self.contamination else {
                break;
            };
            let (noise, rate_hz) = (&mut model.axes[channel.index()], model.rate_hz);
            contamination
                .scale(noise, channel, replicate, rate_hz)
                .map_err(|source| ReplicateError::Contamination { replicate, source })?;
        }
        Ok(model)
    }

    /// The signal of one channel of a replicate (counted from 1) with the model from
    /// [`VirtualImu::model_of`] (m/s² or rad/s).
    ///
    /// # Errors
    /// When the record is too short for the contamination.
    pub fn signal(
        &self,
        model: &Model,
        replicate: u64,
        channel: Channel,
        samples: usize,
    ) -> Result<Vec<f64>, ReplicateError> {
        let source = channel.to_string();
        let run = replicate.wrapping_sub(1);
        let key = StreamKey {
            seed: self.seed,
            scenario: "",
            run,
            source: &source,
            process: "",
        };
        let mut out = vec![0.0; samples];
        Synthesizer::new(model.axis(channel), key).fill(&mut out);
        if let Some(contamination) = self.contamination {
            contamination
                .apply(&mut out, channel, replicate, model.rate_hz, self.seed)
                .map_err(|source| ReplicateError::Contamination { replicate, source })?;
        }
        Ok(out)
    }

    /// A replicate (counted from 1) as a recording, means removed.
    ///
    /// # Errors
    /// When spread or contamination do not belong to the model or the record.
    pub fn recording(
        &self,
        replicate: u64,
        channels: &[Channel],
        samples: usize,
    ) -> Result<Recording, ReplicateError> {
        let model = self.model_of(replicate)?;
        let signal = |channel: &Channel| {
            let mut x = self.signal(&model, replicate, *channel, samples)?;
            let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
            x.iter_mut().for_each(|v| *v -= mean);
            Ok(Signal {
                channel: *channel,
                mean,
                samples: x,
            })
        };
        let signals = channels
            .iter()
            .map(signal)
            .collect::<Result<_, ReplicateError>>()?;
        Ok(Recording {
            name: format!("replicate_{replicate}"),
            rate_hz: model.rate_hz,
            signals,
        })
    }
}

#[cfg(test)]
#[path = "spread_tests.rs"]
mod spread_tests;

#[cfg(test)]
mod replicate_tests {
    use super::*;
    use crate::imu::{Axis, Sensor};
    use crate::noise::contamination::{Operation, Rule};
    use crate::noise::{Composite, Law, Process, Variation};

    const X: Channel = Channel {
        sensor: Sensor::Accel,
        axis: Axis::X,
    };

    fn model() -> Model {
        let process =
            |code, values: &[f64]| Process::from_values(code, values, 100.0).unwrap().unwrap();
        let noise = Composite::new(vec![process("WN", &[1.0]), process("RW", &[0.01])]);
        Model::pooled(100.0, &noise, &noise)
    }

    #[test]
    fn replicates_differ_and_repeat_and_contamination_leaves_the_noise_alone() {
        let model = model();
        let clean = VirtualImu {
            model: &model,
            spread: None,
            contamination: None,
            seed: 3,
        };
        let first = clean.signal(&model, 1, X, 100).unwrap();
        assert_ne!(first, clean.signal(&model, 2, X, 100).unwrap());
        assert_eq!(first, clean.signal(&model, 1, X, 100).unwrap());

        let operation = Operation::Step {
            at: crate::noise::contamination::Extent::Share(0.5),
            amplitude: 1000.0,
        };
        let rule = Rule {
            sensor: Sensor::Accel,
            replicate: Some(1),
            operation,
            place: String::new(),
        };
        let contamination = Contamination {
            name: "step".into(),
            rules: vec![rule],
        };
        let dirty = VirtualImu {
            contamination: Some(&contamination),
            ..clean
        };
        let stepped = dirty.signal(&model, 1, X, 100).unwrap();
        assert_eq!(stepped[..50], first[..50]);
        assert!(
            stepped[50..]
                .iter()
                .zip(&first[50..])
                .all(|(a, b)| (a - b - 1000.0).abs() < 1e-9)
        );
    }

    #[test]
    fn parameters_are_drawn_then_scaled() {
        let model = model();
        let law = Law::Beta {
            a: 2.0,
            b: 2.0,
            low: 1.0,
            width: 1.0,
        };
        let variation = Variation::new(&model.axes[0], 100.0, "RW", "gamma2", law).unwrap();
        let mut spread = Spread::default();
        spread.axes[0].push(variation);
        let operation = Operation::Scale {
            process: "RW".into(),
            parameter: "gamma2".into(),
            factor: 4.0,
        };
        let rule = Rule {
            sensor: Sensor::Accel,
            replicate: Some(1),
            operation,
            place: String::new(),
        };
        let contamination = Contamination {
            name: "scale".into(),
            rules: vec![rule],
        };
        let drawn = VirtualImu {
            model: &model,
            spread: Some(&spread),
            contamination: None,
            seed: 3,
        };
        let scaled = VirtualImu {
            contamination: Some(&contamination),
            ..drawn
        };
        let gamma2 = |imu: &VirtualImu<'_>, replicate| {
            imu.model_of(replicate).unwrap().axes[0].processes[1].parameters()[0].1
        };
        let ratio = |replicate| gamma2(&scaled, replicate) / gamma2(&drawn, replicate);
        assert!((ratio(1) - 4.0).abs() < 1e-14 && (ratio(2) - 1.0).abs() < 1e-14);
    }
}
