//! Ratios between runs.

mod document;
mod job;
mod request;

pub(crate) use document::{Comparison, RatioCurves};
pub(crate) use job::compare;
pub use request::CompareRequest;
pub(crate) use request::states;
