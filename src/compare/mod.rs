//! Ratios between runs.

mod document;
mod job;

pub(crate) use document::{Comparison, RatioCurves};
pub(crate) use job::compare;
