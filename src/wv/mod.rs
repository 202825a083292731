//! Wavelet variances of static recordings.

mod document;
mod job;

pub(crate) use document::{side_by_side, signals_csv};
pub(crate) use job::{Intervals, WaveletOptions, wavelet_variances};
