//! Wavelet variances of static recordings.

mod document;
mod job;
mod request;

pub(crate) use document::signals_csv;
pub use job::Intervals;
pub use request::WaveletRequest;
