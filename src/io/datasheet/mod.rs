//! Datasheets: their figures in their units, and the noise model they are assumed to mean.
//!
//! | figure | becomes |
//! |---|---|
//! | noise density N | white noise, sigma2 = N²·rate |
//! | bias instability B, correlation time T | Gauss-Markov processes whose Allan deviation has the floor B |
//! | rate random walk K | a random walk, gamma2 = K²/rate |
//! | turn-on bias (repeatability) | `[turn_on]` of the model file, taken as a standard deviation |
//! | zero offset (initial tolerance) | said, not part of a noise model: measured and removed before use |
//! | scale factor | said, not part of a noise model |
//!
//! **Bias instability.** Manufacturers read B off the lowest point of the Allan deviation (Sensonor's FAQ: "the
//! minimum point of the Allan Variance curve"); [IEEE 952](nav_sim_signal::bibliography::Ieee952) calls that point 0.664
//! times the coefficient of a flicker noise. B is read as that floor: [`Flicker`] has correlation times T, T/16, T/256, …
//! down to 1 s, and its Allan deviation is at least B and at most 1.08 B from 1.9 times the shortest to 1.9 times T.
//! White noise comes on top, so that the model is nowhere in that range below the datasheet; by how much its lowest point
//! is above B is said where it is more than a fifth. (A single Gauss-Markov process whose largest Allan deviation is B, as in
//! Farrell, Silva, Rahman, Wendel: *IMU error modeling tutorial*, IEEE Control Systems 42(6), 2022, is below B at every
//! other averaging time: errors after an outage come out up to two times too small.)

mod catalogue;
mod figure;

pub(crate) use catalogue::CATALOGUE;
pub use catalogue::{catalogued, read};
pub use figure::{Figure, Quantity};

use crate::io::model_file::{ModelFile, NOT_STATED, PROGRAM, SCHEMA, TurnOn, known};
use crate::report::readable;
use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::noise::{
    Composite, Flicker, Model, ParameterError, Process, RandomWalk, White, continuous,
};
use serde_json::json;
use toml::Table;

/// The correlation time that is assumed where none is given (s).
const ASSUMED_CORRELATION_TIME_S: f64 = 300.0;

/// One figure of one sensor, and where it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Whose.
    pub sensor: Sensor,
    /// Which.
    pub figure: Figure,
    /// How much.
    pub quantity: Quantity,
    /// Document and place.
    pub source: Option<String>,
    /// The line that was read.
    pub quote: Option<String>,
}

/// What is known of an IMU from its datasheet.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Datasheet {
    /// Manufacturer and name, if known.
    pub name: Option<String>,
    /// Consumer, industrial, tactical or navigation.
    pub class: Option<String>,
    /// At most one entry for each figure of each sensor.
    pub entries: Vec<Entry>,
    /// What was assumed beside the figures.
    pub assumptions: Vec<String>,
}

/// A model made of a datasheet, and what to say of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// The model.
    pub file: ModelFile,
    /// What had to be assumed, or does not fit together.
    pub doubts: Vec<String>,
}

impl Datasheet {
    /// A figure in SI (ppm for scale factors).
    #[must_use]
    pub fn value(&self, sensor: Sensor, figure: Figure) -> Option<f64> {
        Some(self.quantity(sensor, figure)?.value)
    }

    /// The same as it is given.
    pub(crate) fn given(&self, sensor: Sensor, figure: Figure) -> Option<&str> {
        Some(self.quantity(sensor, figure)?.given.as_str())
    }

    fn quantity(&self, sensor: Sensor, figure: Figure) -> Option<&Quantity> {
        self.entries
            .iter()
            .find(|e| e.sensor == sensor && e.figure == figure)
            .map(|e| &e.quantity)
    }

    /// The figures that decide an outage and the datasheet does not state: the model has no such error.
    pub(crate) fn not_stated(&self) -> Vec<String> {
        // A tolerance of the zero offset stands for no turn-on bias: once removed, it says nothing of the next switching-on.
        let figures = [Figure::Noise, Figure::Bias, Figure::TurnOn].into_iter();
        let needed = figures.flat_map(|figure| Sensor::ALL.map(|sensor| (sensor, figure)));
        let lacking = needed.filter(|(sensor, figure)| self.value(*sensor, *figure).is_none());
        lacking
            .map(|(sensor, figure)| format!("{} {}", sensor.name(), figure.name()))
            .collect()
    }

    /// Puts a figure in the place of what was known of it.
    pub(crate) fn set(&mut self, entry: Entry) {
        self.entries
            .retain(|e| (e.sensor, e.figure) != (entry.sensor, entry.figure));
        self.entries.push(entry);
    }

    /// The model at a rate (Hz).
    ///
    /// # Errors
    /// When a figure is beyond what a process can have.
    pub fn model_file(&self, rate_hz: f64) -> Result<Made, ParameterError> {
        let mut doubts = Vec::new();
        let mut noise = |sensor| self.noise(sensor, rate_hz, &mut doubts);
        let (accel, gyro) = (noise(Sensor::Accel)?, noise(Sensor::Gyro)?);
        let mut file = ModelFile::new(Model::pooled(rate_hz, &accel, &gyro));
        let silent = |channel: &Channel| file.model.axis(*channel).processes.is_empty();
        file.missing = Channel::ALL.into_iter().filter(silent).collect();
        let turn_on = |sensor| self.value(sensor, Figure::TurnOn).map(|sigma| [sigma; 3]);
        let turn_on = TurnOn {
            accel_m_s2: turn_on(Sensor::Accel),
            gyro_rad_s: turn_on(Sensor::Gyro),
        };
        file.turn_on = (turn_on != TurnOn::default()).then_some(turn_on);
        file.provenance = Some(self.provenance(&doubts));
        Ok(Made { file, doubts })
    }

    fn noise(
        &self,
        sensor: Sensor,
        rate_hz: f64,
        doubts: &mut Vec<String>,
    ) -> Result<Composite, ParameterError> {
        let mut processes = Vec::new();
        let density = self.value(sensor, Figure::Noise);
        if let Some(density) = density {
            let sigma2 = continuous::white_sigma2(density, rate_hz);
            processes.push(Process::White(White::new(sigma2)?));
        }
        let given_s = self.value(sensor, Figure::CorrelationTime);
        let t_corr_s = given_s.unwrap_or(ASSUMED_CORRELATION_TIME_S);
        if let Some(floor) = self.value(sensor, Figure::Bias) {
            let flicker = Flicker { floor, t_corr_s };
            processes.extend(
                flicker
                    .processes(rate_hz)?
                    .into_iter()
                    .map(Process::GaussMarkov),
            );
            doubts.extend(doubt_floor(
                sensor,
                flicker,
                density.unwrap_or(0.0),
                given_s.is_some(),
            ));
        }
        if let Some(density) = self.value(sensor, Figure::Walk) {
            let gamma2 = continuous::walk_gamma2(density, rate_hz);
            processes.push(Process::RandomWalk(RandomWalk::new(gamma2)?));
        }
        Ok(Composite::new(processes))
    }

    fn provenance(&self, doubts: &[String]) -> Table {
        let figures: Vec<Table> = self.entries.iter().map(Entry::provenance).collect();
        let not_stated = self.not_stated();
        known(json!({
            "estimator": "datasheet",
            "label": "an assumption: figures of a datasheet, not a calibration",
            "program": PROGRAM,
            "schema": SCHEMA,
            "unit": self.name,
            "assumptions": ([&self.assumptions, doubts].concat()),
            "figures": figures,
            NOT_STATED: (!not_stated.is_empty()).then_some(not_stated),
        }))
    }
}

impl Entry {
    fn provenance(&self) -> Table {
        known(json!({
            "figure": format!("{}.{}", self.sensor.name(), self.figure.name()),
            "given": self.quantity.given,
            "source": self.source,
            "quote": self.quote,
        }))
    }
}

/// How far the lowest point of the whole Allan deviation may be above the bias instability, as a ratio.
const NOTABLE: f64 = 1.2;

fn doubt_floor(sensor: Sensor, flicker: Flicker, density: f64, is_time_given: bool) -> Vec<String> {
    let name = sensor.name();
    let mut doubts = Vec::new();
    if !is_time_given {
        doubts.push(format!(
            "{name}: no correlation time is given; {ASSUMED_CORRELATION_TIME_S} s is assumed for the bias instability"
        ));
    }
    // the white noise falls throughout, so that both together are lowest where the floor ends
    let tau_s = flicker.range_s().1;
    let white = density / tau_s.sqrt() / flicker.floor;
    let lowest = white.hypot(1.0);
    if white > 1.0 {
        doubts.push(format!(
            "{name}: at {} s the white noise alone is above the bias instability, which the Allan deviation then \
             does not show; a correlation time above {} s would",
            readable(tau_s),
            readable(flicker.t_corr_s * white * white)
        ));
    } else if lowest > NOTABLE {
        doubts.push(format!(
            "{name}: with the white noise the lowest Allan deviation of this model is {lowest:.2} times the bias instability, \
             at {} s: the model is cautious; a longer correlation time is less so",
            readable(tau_s)
        ));
    }
    doubts
}

#[cfg(test)]
mod tests;
