//! Factors on the variances of a noise model.

use super::tune::Per;
use crate::imu::{Channel, Sensor};
use crate::noise::{Model, Process};

/// What is multiplied, and by what.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// The sensor.
    pub sensor: Sensor,
    /// Label of the process, as [`crate::noise::Composite::labels`]; none: all of the sensor's.
    pub process: Option<String>,
    /// The factor on its variance.
    pub on_variance: f64,
}

impl Factor {
    /// Whether the search ended at the largest factor that it tries, e^12: the factor says nothing then.
    #[must_use]
    pub fn is_at_limit(&self) -> bool {
        self.on_variance.ln().abs() > MAX_LN - 1e-6
    }
}

/// Largest logarithm of a factor.
pub(super) const MAX_LN: f64 = 12.0;

/// The factors of a model, all 1. Processes without amplitude have none, nor has quantization noise, which no
/// filter contains.
pub(super) fn multiplied(model: &Model, per: Per) -> Vec<Factor> {
    let mut factors: Vec<Factor> = Vec::new();
    for channel in Channel::ALL {
        let axis = model.axis(channel);
        for (_, label) in axis
            .processes
            .iter()
            .zip(axis.labels())
            .filter(|(p, _)| is_felt(p))
        {
            let process = (per == Per::Process).then_some(label);
            if !factors
                .iter()
                .any(|f| f.sensor == channel.sensor && f.process == process)
            {
                factors.push(Factor {
                    sensor: channel.sensor,
                    process,
                    on_variance: 1.0,
                });
            }
        }
    }
    factors
}

/// Whether a filter models the process and its amplitude is not zero.
fn is_felt(process: &Process) -> bool {
    let (_, amplitude) = amplitude(process);
    amplitude != 0.0 && !matches!(process, Process::Quantization(_))
}

/// The parameter that a process is proportional to.
fn amplitude(process: &Process) -> (&'static str, f64) {
    match process {
        Process::White(p) => ("sigma2", p.sigma2()),
        Process::Quantization(p) => ("q2", p.q2()),
        Process::Ar1(p) => ("sigma2", p.sigma2()),
        Process::Flicker(p) => ("b2", p.b2()),
        Process::RandomWalk(p) => ("gamma2", p.gamma2()),
        Process::Drift(p) => ("slope", p.slope()),
        Process::GaussMarkov(p) => ("s2", p.s2()),
        Process::Ma1(p) => ("sigma2", p.sigma2()),
    }
}

pub(super) fn set(factors: &[Factor], ln: &[f64]) -> Vec<Factor> {
    factors
        .iter()
        .zip(ln)
        .map(|(f, ln)| Factor {
            on_variance: ln.exp(),
            ..f.clone()
        })
        .collect()
}

/// A model whose processes are multiplied; the factors are the same at any sample rate.
#[must_use]
pub fn scaled(model: &Model, factors: &[Factor]) -> Model {
    let mut scaled = model.clone();
    for channel in Channel::ALL {
        let axis = &mut scaled.axes[channel.index()];
        for (process, label) in axis.processes.iter_mut().zip(model.axis(channel).labels()) {
            let own = |f: &&Factor| {
                f.sensor == channel.sensor && f.process.as_ref().is_none_or(|p| *p == label)
            };
            if let Some(factor) = factors.iter().find(own).filter(|_| is_felt(process)) {
                *process = times(process, factor.on_variance, model.rate_hz);
            }
        }
    }
    scaled
}

/// A process whose variance is multiplied.
fn times(process: &Process, on_variance: f64, rate_hz: f64) -> Process {
    let (name, value) = amplitude(process);
    // a drift has an amplitude, the others a variance
    let factor = if matches!(process, Process::Drift(_)) {
        on_variance.sqrt()
    } else {
        on_variance
    };
    let changed = process
        .with_parameter(name, value * factor, rate_hz)
        .and_then(Result::ok);
    // beyond the largest number nothing is left to enlarge
    changed.unwrap_or(*process)
}
