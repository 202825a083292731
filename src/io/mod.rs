//! Files: recordings, models, trajectories. The only library module that reads files.

pub(crate) mod atomic;
pub mod contamination_file;
pub(crate) mod curve_file;
pub mod datasheet;
pub mod draws_file;
pub(crate) mod file_kind;
pub(crate) mod fusion_files;
pub(crate) mod input;
pub mod logs;
pub mod model_file;
pub mod recordings;
pub(crate) mod run_tables;
pub(crate) mod scenario_file;
pub(crate) mod source;
pub(crate) mod suggest;
pub(crate) mod table;
pub(crate) mod toml_file;
pub mod trajectory_file;

pub(crate) use crate::failure::{Failure, Place, help};

#[cfg(test)]
mod property_tests;
#[cfg(test)]
mod tests;
