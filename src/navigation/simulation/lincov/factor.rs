//! Factors on the variances of a noise model.

use crate::imu::{Channel, Sensor};
use crate::noise::{Model, Process};

/// What is multiplied, and by what.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factor {
    /// The sensor.
    pub sensor: Sensor,
    /// The factor on the variances of all its processes.
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

/// The factors of a model, all 1: of the sensors with noise that a filter models.
pub(super) fn multiplied(model: &Model) -> Vec<Factor> {
    let has_noise = |sensor: &Sensor| {
        Channel::ALL
            .into_iter()
            .filter(|channel| channel.sensor == *sensor)
            .any(|channel| model.axis(channel).processes.iter().any(is_felt))
    };
    let one = |sensor| Factor {
        sensor,
        on_variance: 1.0,
    };
    Sensor::ALL.into_iter().filter(has_noise).map(one).collect()
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
            ..*f
        })
        .collect()
}

/// A model whose processes are multiplied; the factors are the same at any sample rate.
#[must_use]
pub fn scaled(model: &Model, factors: &[Factor]) -> Model {
    let mut scaled = model.clone();
    for channel in Channel::ALL {
        let Some(factor) = factors.iter().find(|f| f.sensor == channel.sensor) else {
            continue;
        };
        for process in &mut scaled.axes[channel.index()].processes {
            if is_felt(process) {
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
