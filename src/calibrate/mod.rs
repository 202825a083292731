//! Calibration: from recordings, or directories of them, to noise models, their files and their document.
//!
//! [`calibrate()`] goes from a directory of recordings to models. From signals in memory:
//! ```
//! use nav_sim::calibration::{ModelChoice, Pool, Settings, calibrate, grouped, replicates};
//! use nav_sim::signal::imu::Channel;
//! use nav_sim::signal::noise::{Composite, Model, Process, VirtualImu, White};
//!
//! let white = Composite::new(vec![Process::White(White::new(4e-6)?)]);
//! let model = Model::pooled(100.0, &white, &white);
//! let imu = VirtualImu { model: &model, spread: None, contamination: None, seed: 1 };
//! let settings = Settings { model: ModelChoice::Given("WN".parse()?), rate_hz: 100.0, ..Settings::default() };
//! let mut signals = Vec::new();
//! for replicate in 1..=5 {
//!     signals.extend(replicates(&imu.recording(replicate, &Channel::ALL, 4096)?, None, &settings.tuning)?);
//! }
//! let outcomes = calibrate(&grouped(signals, Pool::Sensor), &settings)?;
//! let sigma2 = outcomes[0].fit.composite.processes[0].values()[0];
//! // The variance of 15 × 4096 samples at an efficiency near 0.6 is known to 0.8 %.
//! assert!((sigma2 / 4e-6 - 1.0).abs() < 0.05);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod charts;
mod curve;
mod document;
mod figures;
pub(crate) mod files;
mod fits;
mod job;
mod model_file;
mod request;
mod turn_on;
mod words;

pub(crate) use charts::{CAPTION, variance as variance_chart};
pub(crate) use document::ShownCalibration;
pub(crate) use fits::FitsFile;
pub use job::{Calibration, CalibrationOptions, EstimatorChoice, Measured, calibrate, measure};
pub(crate) use job::{visit, without_warm_up};
pub(crate) use model_file::CalibrationNote;
pub(crate) use request::ESTIMATORS;
pub use request::{Calibrate, CalibrationAnswer};
pub(crate) use words::stem;
use words::{notes, reasons, turn_on_remark};
