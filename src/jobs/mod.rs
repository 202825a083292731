//! Errors and remarks of the jobs that read recordings.

mod error;
mod failure;
mod reading;
mod remarks;

pub use error::JobError;
pub(crate) use failure::{of_calibration, unknown_model};
pub(crate) use reading::WHOLE;
pub use reading::{
    ChannelSet, LogRequest, ReadingRequest, RecordingRequest, Scales, Skip, Stamps, VarianceRequest,
};
pub(crate) use remarks::note_report;
