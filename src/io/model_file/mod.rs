//! Model files (TOML): what `calibrate` writes and `synthesize`, `run`, `export` read.
//!
//! ```toml
//! schema = 1
//! rate_hz = 100.0
//! [accel]                                   # all three axes; or [accel.x], [accel.y], [accel.z]
//! processes = [
//!   { type = "WN", sigma2 = 5.2e-5, sigma2_ci95 = [5.1e-5, 5.3e-5] },
//!   { type = "AR1", phi = 0.9835, sigma2 = 1.3e-8 },
//! ]
//! [turn_on]                                 # standard deviation of the constant bias of a switching-on: one, or x, y, z
//! accel_m_s2 = 0.02
//! gyro_rad_s = [1e-3, 1e-3, 2e-3]
//! [provenance]                              # free: how the model was made
//! [[spread.accel]]                          # see `noise::spread`
//! ```
//! A sensor or axis that is not in the file is noise-free in [`ModelFile::model`] and listed in
//! [`ModelFile::missing`].

mod description;
mod provenance;
mod read;
mod write;

pub(crate) use description::schema;
pub use provenance::Misfit;
pub(crate) use provenance::known;
pub use read::{from_text, read};
pub use write::to_toml;
pub use write::write;

use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::noise::{Model, Spread};

/// Where the provenance of a model made from a data sheet names the figures that it lacks.
pub(crate) const NOT_STATED: &str = "not_stated";
/// What wrote a file, in its provenance.
pub(crate) const PROGRAM: &str = concat!("nav-sim ", env!("CARGO_PKG_VERSION"));

/// The version of the layout that is written; the only one that is read.
pub(crate) const SCHEMA: u64 = 1;

/// A model and what is known about it.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelFile {
    /// The noise.
    pub model: Model,
    /// Axes that the file does not have (empty sums in the model).
    pub missing: Vec<Channel>,
    /// The constant bias of a switching-on.
    pub turn_on: Option<TurnOn>,
    /// How parameters vary between replicates.
    pub spread: Option<Spread>,
    /// Confidence intervals of parameters.
    pub intervals: Vec<Interval>,
    /// How the model was made.
    pub provenance: Option<toml::Table>,
}

impl ModelFile {
    /// Axes that the file has.
    pub fn present(&self) -> impl Iterator<Item = Channel> {
        let is_present = |channel: &Channel| !self.missing.contains(channel);
        Channel::ALL.into_iter().filter(is_present)
    }

    /// What is doubtful about the file at this path, in words.
    pub(crate) fn doubts(&self, path: &std::path::Path) -> Vec<String> {
        let shown = path.display();
        let unsaid = |channel: &Channel| {
            format!("{shown} has no noise model for {channel}; it is taken as free of noise")
        };
        let misfit = self.misfit().map(|misfit| format!("{shown} {misfit}"));
        misfit
            .into_iter()
            .chain(self.missing.iter().map(unsaid))
            .collect()
    }

    /// What counts as none in it because its data sheet does not state it: figures, or axes without noise.
    pub(crate) fn not_stated(&self) -> Vec<String> {
        let figures = self
            .provenance
            .as_ref()
            .and_then(|table| table.get(NOT_STATED)?.as_array());
        let name = |figure: &toml::Value| figure.as_str().map(str::to_owned);
        match figures {
            Some(figures) => figures.iter().filter_map(name).collect(),
            None => self.missing.iter().map(ToString::to_string).collect(),
        }
    }

    /// A model of all six axes and nothing beside.
    pub(crate) const fn new(model: Model) -> Self {
        Self {
            model,
            missing: Vec::new(),
            turn_on: None,
            spread: None,
            intervals: Vec::new(),
            provenance: None,
        }
    }
}

/// Standard deviations of the constant bias that each switching-on draws anew, axis by axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TurnOn {
    /// Of the accelerometers (m/s²).
    pub accel_m_s2: Option<[f64; 3]>,
    /// Of the gyroscopes (rad/s).
    pub gyro_rad_s: Option<[f64; 3]>,
}

impl TurnOn {
    /// Those of a sensor's axes (m/s² or rad/s).
    #[must_use]
    pub const fn axes(&self, sensor: Sensor) -> Option<[f64; 3]> {
        match sensor {
            Sensor::Accel => self.accel_m_s2,
            Sensor::Gyro => self.gyro_rad_s,
        }
    }

    /// One for the three axes of a sensor, with the sum of their variances (m/s² or rad/s).
    pub(crate) fn sigma(&self, sensor: Sensor) -> Option<f64> {
        let [x, y, z] = self.axes(sensor)?;
        // like axes keep every bit
        let alike = x.to_bits() == y.to_bits() && y.to_bits() == z.to_bits();
        Some(if alike {
            x
        } else {
            ((x * x + y * y + z * z) / 3.0).sqrt()
        })
    }

    /// The key of a sensor.
    const fn key(sensor: Sensor) -> &'static str {
        match sensor {
            Sensor::Accel => "accel_m_s2",
            Sensor::Gyro => "gyro_rad_s",
        }
    }
}

/// The 95 % confidence interval of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// The axis.
    pub channel: Channel,
    /// Label of the process, as [`nav_sim_signal::noise::Composite::labels`].
    pub process: String,
    /// Name of the parameter, as [`nav_sim_signal::noise::Process::parameters`].
    pub parameter: String,
    /// Lower end (units of the parameter; −∞ if unbounded).
    pub low: f64,
    /// Upper end (units of the parameter; ∞ if unbounded).
    pub high: f64,
}

/// Ending of the key of a parameter's interval.
const CI: &str = "_ci95";

#[cfg(test)]
mod tests;
