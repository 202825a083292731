//! Tuning of a noise model: the smallest factors on its variances that make its filter consistent with other truths.

mod document;
mod job;
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
mod request;
mod result;

pub use request::TuneRequest;
pub(crate) use request::Tuned;
