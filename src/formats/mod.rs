//! Files: recordings, models, trajectories. The only library module that reads files.

pub mod atomic;
pub mod contamination_file;
pub mod curve_file;
pub mod datasheet;
pub(crate) mod difference;
pub mod draws_file;
pub mod efficiency_directory;
pub mod efficiency_file;
mod error;
pub mod file_kind;
pub mod fusion_files;
pub mod hash;
pub mod input;
pub mod model_file;
pub mod npy;
pub mod parameters_file;
pub mod recordings;
pub mod run_directory;
mod run_tables;
pub mod scenario_file;
pub(crate) mod source;
pub mod suggest;
pub mod table_files;
pub(crate) mod toml_described;
pub mod toml_file;
mod toml_path;
pub mod trajectory_file;

pub use error::{FileError, Kind, Place, Remedy, Setting};
