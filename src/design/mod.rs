//! Calibrations that are not made yet: what so many recordings of an IMU, so long each, would tell.

mod document;
mod job;
mod request;

pub(crate) use document::{Design, DesignedParameter, DesignedQuantile, Designs};
pub(crate) use job::{DesignInputs, Destination, design};
pub use request::DesignRequest;
