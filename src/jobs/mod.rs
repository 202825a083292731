//! Errors and remarks of the jobs that read recordings.

mod error;
mod remarks;

pub use error::JobError;
pub use remarks::{Remark, Remarks, Silence};
