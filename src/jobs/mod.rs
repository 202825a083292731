//! What a command does, as one library call: files in, results out.
//!
//! Remarks on the way are reported to [`Remarks`] as values; words, flags and terminals belong to the command line.
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

mod calibrate;
mod catalogue;
mod certify;
mod choice_files;
mod choose;
mod compare;
mod curves;
mod design;
mod error;
mod estimator_study;
mod export;
mod files;
mod navigate;
mod reduction;
mod remarks;
mod start_files;
mod synthesize;
pub(crate) mod turn_on;
mod uncertainty;
mod wavelet;

pub use calibrate::{Calibration, CalibrationOptions, EstimatorChoice, Measured, calibrate, measure};
pub(crate) use catalogue::{catalogue_json, catalogue_text};
pub(crate) use certify::{Recorded, certify};
pub(crate) use choice_files::claim_choice;
pub use choose::{ChoiceDrive, Chosen, choose};
pub(crate) use compare::compare;
pub(crate) use curves::read_curves;
pub(crate) use design::{DesignInputs, Destination, design};
pub use error::JobError;
pub(crate) use estimator_study::EstimatorStudy;
pub use export::{Export, ExportError, Target, export, exported};
pub(crate) use files::ModelFiles;
pub use navigate::{NavigateError, NavigateInputs, Navigation, Note, TrueImu, navigate};
pub(crate) use reduction::Reduced;
pub use remarks::{Remark, Remarks, Silence};
pub(crate) use start_files::{StartFiles, write_start_files};
pub use synthesize::Synthesis;
pub(crate) use wavelet::{Intervals, WaveletOptions, wavelet_variances};
