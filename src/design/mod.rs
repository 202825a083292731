//! Calibrations that are not made yet: what so many recordings of an IMU, so long each, would tell.

mod document;
mod job;
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
mod request;

pub(crate) use document::{Design, DesignedParameter, DesignedQuantile, Designs};
pub(crate) use job::{DesignInputs, Destination, design};
pub use request::DesignRequest;
