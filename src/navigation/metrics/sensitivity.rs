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
/// the place of phi or beta. In files an object with the names of the parameters as keys.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivities(pub Vec<(String, PerState<f64>)>);

/// Half of a central difference, as a logarithm: its error is of the order of its square.
const STEP: f64 = 0.01;

/// A parameter of the processes of one label of a sensor.
struct Varied {
    sensor: Sensor,
    label: String,
    parameter: Parameter,
}

impl Sensitivities {
    /// Just before the first fix after each outage, of the noise that `truth` is.
    #[must_use]
    pub fn at_outage_ends(filter: &FilterPass<'_>, experiment: &Experiment<'_>, truth: &Model) -> Vec<Self> {
        let ln_rmse = |model: &Model| -> Vec<[f64; REPORTED]> {
            let side = TruthSide::together(&TruthSide::sources(experiment, model));
            filter.errors_at_ends(&side).iter().map(|end| end.rmse().map(f64::ln)).collect()
        };
        let varied = Varied::all(truth);
        let slopes: Vec<Vec<[f64; REPORTED]>> = varied
            .par_iter()
            .map(|varied| {
                // Only the truth moves; the gains stay those of the filter, which does not know of it.
                let (more, less) = (ln_rmse(&varied.by(truth, STEP)), ln_rmse(&varied.by(truth, -STEP)));
                let slope = |(more, less): (&[f64; REPORTED], &[f64; REPORTED])| {
                    std::array::from_fn(|i| (more[i] - less[i]) / (2.0 * STEP))
                };
                more.iter().zip(&less).map(slope).collect()
            })
            .collect();
        let outages = slopes.first().map_or(0, Vec::len);
        let of_outage = |k: usize| {
            let named = varied.iter().zip(&slopes).map(|(varied, ends)| (varied.name(), PerState(ends[k])));
            Self(named.collect())
        };
        (0..outages).map(of_outage).collect()
    }
}

impl Varied {
    /// All parameters that are not zero.
    fn all(model: &Model) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for channel in Channel::ALL {
            let (sensor, axis) = (channel.sensor, model.axis(channel));
            for (process, label) in axis.processes.iter().zip(axis.labels()) {
                for (&parameter, value) in process.kind().parameters().iter().zip(process.values()) {
                    let known = |v: &Self| v.sensor == sensor && v.label == label && v.parameter == parameter;
                    // Zero has no logarithm to move along.
                    if value != 0.0 && !all.iter().any(known) {
                        all.push(Self { sensor, label: label.clone(), parameter });
                    }
                }
            }
        }
        all
    }

    /// `accel.WN.sigma2`, `gyro.AR1_2.correlation_time`.
    fn name(&self) -> String {
        let parameter = match self.parameter {
            Parameter::Phi | Parameter::Beta => "correlation_time",
            other => other.name(),
        };
        format!("{}.{}.{parameter}", self.sensor.name(), self.label)
    }

    /// The model with the parameter times e^`ln`; without change where the parameter cannot be so large.
    fn by(&self, model: &Model, ln: f64) -> Model {
        let mut moved = model.clone();
        for channel in Channel::ALL.into_iter().filter(|c| c.sensor == self.sensor) {
            let labels = model.axis(channel).labels();
            let processes = &mut moved.axes[channel.index()].processes;
            for process in processes.iter_mut().zip(labels).filter(|(_, l)| *l == self.label).map(|(p, _)| p)
            {
                *process = self.moved(process, ln, model.rate_hz);
            }
        }
        moved
    }

    fn moved(&self, process: &Process, ln: f64, rate_hz: f64) -> Process {
        let change = |value: f64| match self.parameter {
            // a correlation time is −1/ln phi, or 1/beta
            Parameter::Phi => (value.ln() * (-ln).exp()).exp(),
            Parameter::Beta => value * (-ln).exp(),
            _ => value * ln.exp(),
        };
        let values = process.kind().parameters().iter().zip(process.values());
        let values: Vec<f64> =
            values.map(|(p, value)| if *p == self.parameter { change(value) } else { value }).collect();
        process.kind().process(&values, rate_hz).and_then(Result::ok).unwrap_or(*process)
    }
}

impl Serialize for Sensitivities {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize_named(&self.0, serializer)
    }
}
