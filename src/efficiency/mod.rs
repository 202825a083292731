//! Monte-Carlo studies of the estimators themselves.

pub(crate) mod directory;
mod document;
pub mod file;
mod job;

pub(crate) use document::{EfficiencyFile, EfficiencyRow, efficiency_csv};
pub(crate) use job::EstimatorStudy;
