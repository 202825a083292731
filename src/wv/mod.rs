//! Wavelet variances of static recordings.

mod document;
mod job;
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
mod request;

pub(crate) use document::{side_by_side, signals_csv};
pub use job::Intervals;
pub use request::WaveletRequest;
