//! Wavelet variances of static recordings.

mod document;
mod job;
mod request;

pub(crate) use document::{side_by_side, signals_csv};
pub use job::Intervals;
pub use request::WaveletRequest;
