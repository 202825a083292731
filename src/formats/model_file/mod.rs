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
//! [provenance]                              # free: how the model was made
//! [[spread.accel]]                          # see `noise::spread`
//! ```
//! A sensor or axis that is not in the file is noise-free in [`ModelFile::model`] and listed in
//! [`ModelFile::missing`].

mod calibrated;
mod read;
mod write;

pub use calibrated::CalibrationNote;
pub use read::read;
pub use write::{to_toml, write};

use crate::imu::Channel;
use crate::noise::{Model, Spread};

/// The version of the layout that is written; the only one that is read.
pub const SCHEMA: u64 = 1;

/// A model and what is known about it.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelFile {
    /// The noise.
    pub model: Model,
    /// Axes the file says nothing about (empty sums in the model).
    pub missing: Vec<Channel>,
    /// How parameters vary between replicates.
    pub spread: Option<Spread>,
    /// Confidence intervals of parameters.
    pub intervals: Vec<Interval>,
    /// How the model was made.
    pub provenance: Option<toml::Table>,
}

impl ModelFile {
    /// A model of all six axes and nothing beside.
    #[must_use]
    pub const fn new(model: Model) -> Self {
        Self { model, missing: Vec::new(), spread: None, intervals: Vec::new(), provenance: None }
    }
}

/// The 95 % confidence interval of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// The axis.
    pub channel: Channel,
    /// Label of the process, as [`crate::noise::Composite::labels`].
    pub process: String,
    /// Name of the parameter, as [`crate::noise::Process::parameters`].
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
