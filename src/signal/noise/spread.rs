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
use super::{Composite, Model, Parameter, ParameterRef, Synthesizer};
use crate::imu::{Channel, Recording, Signal};
use crate::rng::{Generator, StreamKey};
use rand::RngExt;
use rand_distr::{Beta, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A law that is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct SpreadError {
    /// Its key in files.
    pub key: &'static str,
    message: String,
}

fn refused<T>(key: &'static str, message: impl ToString) -> Result<T, SpreadError> {
    let message = message.to_string();
    Err(SpreadError { key, message })
}

/// Largest standard deviation of a logarithm.
const LARGEST_SD: f64 = 10.0;

/// A distribution, as in model files.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", tag = "distribution")]
pub enum ParameterDistribution {
    /// low + width × a beta law
    Beta {
        /// First shape
        a: f64,
        /// Second shape
        b: f64,
        /// Least value (units of the parameter)
        low: f64,
        /// Greatest less least value (units of the parameter)
        width: f64,
    },
    /// A normal law about the parameter, truncated to its domain
    Normal {
        /// Standard deviation before truncation (units of the parameter)
        sd: f64,
    },
    /// A normal law of the logarithm of the parameter, of phi and beta of that of the correlation time
    Lognormal {
        /// Median (units of the parameter)
        median: f64,
        /// Its 95 % interval, where it was estimated
        #[serde(skip_serializing_if = "Option::is_none")]
        median_ci95: Option<[f64; 2]>,
        /// Standard deviation of the logarithm
        sd: f64,
        /// Its 95 % interval
        #[serde(skip_serializing_if = "Option::is_none")]
        sd_ci95: Option<[f64; 2]>,
    },
}

/// The law of one parameter of one process of one axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Variation {
    /// Label of the process, as [`Composite::labels`].
    pub process: String,
    /// The parameter.
    #[serde(skip)]
    pub of: ParameterRef,
    /// Its law.
    pub law: ParameterDistribution,
}

impl Variation {
    /// The law of `parameter` of the process labelled `process` in `noise`.
    ///
    /// # Errors
    /// When the process or parameter does not exist, or the law is no law or leaves the domain.
    pub fn new(
        noise: &Composite,
        process: &str,
        parameter: &str,
        law: ParameterDistribution,
    ) -> Result<Self, SpreadError> {
        let labels = noise.labels();
        let Some(at) = labels.iter().position(|l| l == process) else {
            let known = labels.join(", ");
            return refused(
                "process",
                format!("the model has no process \"{process}\" there, only {known}"),
            );
        };
        let mut own = noise.parameters().filter(|(of, _)| of.process == at);
        let Some((of, value)) = own.find(|(of, _)| of.parameter.name() == parameter) else {
            let process = &noise.processes[at];
            let known: Vec<_> = process.parameters().into_iter().map(|(n, _)| n).collect();
            let (code, known) = (process.code(), known.join(", "));
            return refused(
                "parameter",
                format!("{code} has no parameter \"{parameter}\", only {known}"),
            );
        };
        let variation = Self {
            process: process.to_owned(),
            of,
            law,
        };
        variation.check_constants()?;
        // The domains are intervals: a beta law stays inside if its two ends do. Other laws are drawn again
        // until inside, so only their centres must be there.
        let ends = match law {
            ParameterDistribution::Beta { low, width, .. } => [low, low + width],
            ParameterDistribution::Normal { .. } => [value; 2],
            ParameterDistribution::Lognormal { median, .. } => [median; 2],
        };
        for end in ends {
            if let Err(e) = noise.clone().set(of, end) {
                let message = format!("the distribution reaches refused values: {e}");
                return refused("distribution", message);
            }
        }
        Ok(variation)
    }

    fn check_constants(&self) -> Result<(), SpreadError> {
        let check = |name, value: f64, ok: bool, domain| {
            if value.is_finite() && ok {
                Ok(())
            } else {
                refused(name, format!("{name} = {value} is not {domain}"))
            }
        };
        match self.law {
            ParameterDistribution::Beta { a, b, low, width } => {
                check("a", a, a > 0.0, "a finite number > 0")?;
                check("b", b, b > 0.0, "a finite number > 0")?;
                check("low", low, true, "a finite number")?;
                check("width", width, width >= 0.0, "a finite number ≥ 0")
            }
            // Below 1, at least 47 % of the draws of a coefficient in (−1, 1) are inside: redrawing ends.
            ParameterDistribution::Normal { sd }
                if matches!(self.of.parameter, Parameter::Phi | Parameter::Theta) =>
            {
                check("sd", sd, (0.0..=1.0).contains(&sd), "between 0 and 1")
            }
            ParameterDistribution::Normal { sd } => {
                check("sd", sd, sd >= 0.0, "a finite number ≥ 0")
            }
            ParameterDistribution::Lognormal { .. } if self.of.parameter == Parameter::Theta => {
                refused(
                    "distribution",
                    "theta has no logarithm: lognormal is for variances, slopes, phi and beta",
                )
            }
            ParameterDistribution::Lognormal { median, sd, .. } => {
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

    /// Draws this parameter of `noise`: again while it is outside its domain.
    fn draw(&self, noise: &mut Composite, g: &mut Generator) {
        let parameter = self.of.parameter;
        let centre = noise.value(self.of);
        loop {
            let value = match self.law {
                ParameterDistribution::Beta { a, b, low, width } => {
                    let share = Beta::new(a, b).expect("shapes");
                    low + width * g.sample(share)
                }
                ParameterDistribution::Normal { sd } => {
                    centre + sd * g.sample::<f64, _>(StandardNormal)
                }
                ParameterDistribution::Lognormal {
                    median, sd: 0.0, ..
                } => median,
                ParameterDistribution::Lognormal { median, sd, .. } => {
                    let scaled = parameter.scaled(median) + sd * g.sample::<f64, _>(StandardNormal);
                    parameter.unscaled(scaled)
                }
            };
            if noise.set(self.of, value).is_ok() {
                return;
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
    /// The model of one replicate (counted from 0) of the model that the laws are of: every law drawn, from streams of its own.
    pub fn draw(&self, model: &Model, seed: u64, replicate: u64) -> Model {
        let mut drawn = model.clone();
        for channel in Channel::ALL {
            let source = channel.to_string();
            for variation in &self.axes[channel.index()] {
                let name = variation.of.parameter.name();
                let process = format!("spread.{}.{name}", variation.process);
                // A stream for each law: to let one more parameter vary changes no other's draws.
                let key = StreamKey {
                    seed,
                    scenario: "",
                    run: replicate,
                    source: &source,
                    process: &process,
                };
                let noise = &mut drawn.axes[channel.index()];
                variation.draw(noise, &mut key.generator());
            }
        }
        drawn
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

/// A contamination that does not fit the model or the record.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{source} (replicate {replicate})")]
pub struct ReplicateError {
    /// Index of the replicate, counted from 1.
    pub replicate: u64,
    /// Reason of the refusal.
    pub source: RefusedRule,
}

impl VirtualImu<'_> {
    /// The model of a replicate, counted from 1: parameters drawn, then scaled by the contamination.
    ///
    /// # Errors
    /// When the contamination does not fit the model.
    pub fn model_of(&self, replicate: u64) -> Result<Model, ReplicateError> {
        let mut model = match self.spread {
            Some(spread) => spread.draw(self.model, self.seed, replicate.wrapping_sub(1)),
            None => self.model.clone(),
        };
        for channel in Channel::ALL {
            let Some(contamination) = self.contamination else {
                break;
            };
            let noise = &mut model.axes[channel.index()];
            contamination
                .scale(noise, channel, replicate)
                .map_err(|source| ReplicateError { replicate, source })?;
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
                .map_err(|source| ReplicateError { replicate, source })?;
        }
        Ok(out)
    }

    /// A replicate (counted from 1) as a recording, means removed.
    ///
    /// # Errors
    /// When the contamination does not fit the model or the record.
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
    use crate::noise::contamination::Operation;
    use crate::noise::contamination::tests::contamination;
    use crate::noise::{Composite, ParameterDistribution, Process, ProcessKind, Variation};

    const X: Channel = Channel {
        sensor: Sensor::Accel,
        axis: Axis::X,
    };

    fn model() -> Model {
        let process = |code, values: &[f64]| {
            Process::of_values(ProcessKind::named(code).unwrap(), values, 100.0).unwrap()
        };
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
        let first = clean.signal(&model, 2, X, 100).unwrap();
        assert_ne!(first, clean.signal(&model, 1, X, 100).unwrap());
        assert_eq!(first, clean.signal(&model, 2, X, 100).unwrap());

        let contamination = contamination([Operation::Step {
            at: crate::noise::contamination::Extent::Share(0.5),
            amplitude: 1000.0,
        }]);
        let dirty = VirtualImu {
            contamination: Some(&contamination),
            ..clean
        };
        let stepped = dirty.signal(&model, 2, X, 100).unwrap();
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
        let law = ParameterDistribution::Beta {
            a: 2.0,
            b: 2.0,
            low: 1.0,
            width: 1.0,
        };
        let variation = Variation::new(&model.axes[0], "RW", "gamma2", law).unwrap();
        let mut spread = Spread::default();
        spread.axes[0].push(variation);
        let contamination = contamination([Operation::Scale {
            process: "RW".into(),
            parameter: "gamma2".into(),
            factor: 4.0,
        }]);
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
        assert!((ratio(2) - 4.0).abs() < 1e-14 && (ratio(1) - 1.0).abs() < 1e-14);
    }
}
