//! How errors follow from the parameters of what makes them.

use super::estimate::{PerState, serialize_named};
use crate::imu::{Channel, Sensor};
use crate::noise::{Model, Parameter, Process};
use crate::simulation::lincov::{FilterPass, TruthSide};
use crate::simulation::{Experiment, REPORTED};
use rayon::prelude::*;
use serde::{Serialize, Serializer};

/// d ln RMSE / d ln parameter of each reported state: by how many per cent an error grows where a parameter of the true
/// noise is one per cent larger, on all axes of its sensor, and the filter stays as it is. Of a correlated process the
/// parameters are its variance in the model file (of an AR1 that of its innovations) and its correlation time, in
/// the place of phi or beta; an AR1 whose phi is negative has none, and its phi is moved away from zero. In files an
/// object with the names of the parameters as keys.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivities(pub Vec<(String, PerState<f64>)>);

/// Half of a central difference, as a logarithm: its error is of the order of its square.
const STEP: f64 = 0.01;

/// A quantity of the processes of one label of a sensor.
struct Varied {
    sensor: Sensor,
    label: String,
    quantity: &'static str,
    /// How much larger it can be on all axes, as a logarithm.
    room: f64,
}

impl Sensitivities {
    /// Just before the first fix after each outage, of the noise that `truth` is.
    #[must_use]
    pub fn at_outage_ends(
        filter: &FilterPass<'_>,
        experiment: &Experiment<'_>,
        truth: &Model,
    ) -> Vec<Self> {
        let ln_rmse = |model: &Model| -> Vec<[f64; REPORTED]> {
            let side = TruthSide::together(&TruthSide::sources(experiment, model));
            filter
                .errors_at_ends(&side)
                .iter()
                .map(|end| end.errors.rmse().map(f64::ln))
                .collect()
        };
        let varied = Varied::all(truth);
        let slopes: Vec<Vec<[f64; REPORTED]>> = varied
            .par_iter()
            .map(|varied| {
                // Only the truth moves; the gains stay those of the filter, which does not know of it.
                let (terms, step) = varied.difference();
                let moved = |(steps, _): &(f64, f64)| ln_rmse(&varied.by(truth, steps * step));
                let ends: Vec<_> = terms.iter().map(moved).collect();
                let slope = |end: usize| {
                    let sum = |i: usize| {
                        terms
                            .iter()
                            .zip(&ends)
                            .map(|((_, c), ends)| c * ends[end][i])
                            .sum::<f64>()
                    };
                    std::array::from_fn(|i| sum(i) / (2.0 * step))
                };
                (0..ends[0].len()).map(slope).collect()
            })
            .collect();
        let outages = slopes.first().map_or(0, Vec::len);
        let of_outage = |k: usize| {
            let named = varied
                .iter()
                .zip(&slopes)
                .map(|(varied, ends)| (varied.name(), PerState(ends[k])));
            Self(named.collect())
        };
        (0..outages).map(of_outage).collect()
    }
}

/// What is moved in the place of a parameter of this value: its name, and how much larger it can be, as a logarithm.
fn quantity(parameter: Parameter, value: f64) -> (&'static str, f64) {
    match parameter {
        Parameter::Phi if value > 0.0 => (CORRELATION_TIME, f64::INFINITY),
        Parameter::Beta => (CORRELATION_TIME, f64::INFINITY),
        // An alternating process has no correlation time: what moves is phi, between −1 and 0.
        Parameter::Phi | Parameter::Theta => (parameter.name(), -value.abs().ln()),
        _ => (parameter.name(), f64::INFINITY),
    }
}

const CORRELATION_TIME: &str = "correlation_time";

const CENTRAL: [(f64, f64); 2] = [(1.0, 1.0), (-1.0, -1.0)];
/// Of second order, as the central one.
const ONE_SIDED: [(f64, f64); 3] = [(0.0, 3.0), (-1.0, -4.0), (-2.0, 1.0)];

impl Varied {
    /// All quantities that are not zero.
    fn all(model: &Model) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for channel in Channel::ALL {
            let (sensor, axis) = (channel.sensor, model.axis(channel));
            for (process, label) in axis.processes.iter().zip(axis.labels()) {
                for (&parameter, value) in process.kind().parameters().iter().zip(process.values())
                {
                    // Zero has no logarithm to move along.
                    if value == 0.0 {
                        continue;
                    }
                    let (quantity, room) = quantity(parameter, value);
                    let known = |v: &&mut Self| {
                        v.sensor == sensor && v.label == label && v.quantity == quantity
                    };
                    match all.iter_mut().find(known) {
                        Some(varied) => varied.room = varied.room.min(room),
                        None => all.push(Self {
                            sensor,
                            label: label.clone(),
                            quantity,
                            room,
                        }),
                    }
                }
            }
        }
        all
    }

    /// `accel.WN.sigma2`, `gyro.AR1_2.correlation_time`.
    fn name(&self) -> String {
        format!("{}.{}.{}", self.sensor.name(), self.label, self.quantity)
    }

    /// The difference that is the derivative, from (steps of the logarithm, coefficient) and the step: the sum of coefficient
    /// times value over twice the step.
    fn difference(&self) -> (&'static [(f64, f64)], f64) {
        if self.room > STEP * STEP {
            // Errors may vary as the reciprocal of what is left to the end of the domain (the variance of an AR1);
            // with a fortieth of that their derivative is right to a thousandth (1/40²).
            return (&CENTRAL, STEP.min(self.room / 40.0));
        }
        // At the end of the domain (theta = ±1). Small, because over n samples the errors of theta near −1 change as
        // n (1 + theta)².
        (&ONE_SIDED, STEP * STEP)
    }

    /// The model with the quantity times e^`ln`.
    fn by(&self, model: &Model, ln: f64) -> Model {
        let mut moved = model.clone();
        for channel in Channel::ALL.into_iter().filter(|c| c.sensor == self.sensor) {
            let labels = model.axis(channel).labels();
            let processes = &mut moved.axes[channel.index()].processes;
            for process in processes
                .iter_mut()
                .zip(labels)
                .filter(|(_, l)| *l == self.label)
                .map(|(p, _)| p)
            {
                *process = self.moved(process, ln, model.rate_hz);
            }
        }
        moved
    }

    fn moved(&self, process: &Process, ln: f64, rate_hz: f64) -> Process {
        let change = |parameter: Parameter, value: f64| match parameter {
            // a correlation time is −1/ln phi, or 1/beta
            Parameter::Phi if value > 0.0 => (value.ln() * (-ln).exp()).exp(),
            Parameter::Beta => value * (-ln).exp(),
            _ => value * ln.exp(),
        };
        let moved = |(&parameter, value): (&Parameter, f64)| {
            let moves = quantity(parameter, value).0 == self.quantity;
            if moves {
                change(parameter, value)
            } else {
                value
            }
        };
        let values: Vec<f64> = process
            .kind()
            .parameters()
            .iter()
            .zip(process.values())
            .map(moved)
            .collect();
        process
            .kind()
            .process(&values, rate_hz)
            .and_then(Result::ok)
            .unwrap_or(*process)
    }
}

impl Serialize for Sensitivities {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize_named(&self.0, serializer)
    }
}
