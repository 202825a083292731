//! Files: recordings, models, trajectories. The only library module that reads files.

pub mod atomic;
pub mod contamination_file;
pub mod curve_file;
pub mod datasheet;
mod difference;
pub mod efficiency_directory;
pub mod efficiency_file;
mod error;
pub mod fusion_files;
pub mod hash;
pub mod model_file;
pub mod npy;
pub mod parameters_file;
pub mod recordings;
pub mod run_directory;
pub mod scenario_file;
mod source;
pub mod study_directory;
pub mod study_file;
pub mod suggest;
pub mod table_files;
mod toml_described;
pub mod toml_file;
pub mod trajectory_file;
pub mod unit_file;

pub use error::{FileError, Kind, Place, Remedy, Setting};
