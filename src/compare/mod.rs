//! Ratios between runs.

mod document;
mod job;
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
mod request;

pub(crate) use document::{Comparison, RatioCurves};
pub(crate) use job::compare;
pub use request::CompareRequest;
pub(crate) use request::states;
