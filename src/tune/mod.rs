//! Tuning of a noise model: the smallest factors on its variances that make its filter consistent with other truths.

mod document;
mod job;
mod request;
mod result;

pub use request::TuneRequest;
pub(crate) use request::Tuned;
