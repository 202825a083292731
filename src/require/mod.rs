//! The IMU that a limit needs, what a given one makes of it, and a ranking of several.

mod given;
mod job;
mod needed;
mod question;
mod ranking;
mod request;

pub use job::Ask;
pub(crate) use job::{CatalogueUnit, Misplaced, Requirements};
pub use request::{Catalogue, LimitFlag, Require};
