//! The error-state extended Kalman filter (loosely coupled INS/GNSS).
//!
//! Closed loop: corrections go into the nominal state at once and the error mean is zero between fixes.
//! Errors are estimate − truth; attitude by C_est = (I + \[psi_n×\]) C_true.
//!
//! The filter never sees truth: it is given increments, fixes, and what it believes of the noise.

pub mod covariance;
pub mod filter;
pub mod filter_model;
pub mod update;

pub use covariance::Covariance;
pub(crate) use filter::Snapshot;
pub use filter::{CoefficientKind, Ekf, ErrorCoefficient, advance, apply_pending_earth_step};
pub use filter_model::{FilterModel, FilterModelError, FilterStates, InitialSettings};
pub(crate) use update::{
    BodyVelocity, GainSource, SharedUpdate, body_velocity_rows, fix_rows, update_body_velocity,
    update_height, update_yaw, yaw_row,
};
pub use update::{Fix, FixUpdate, update};

#[cfg(test)]
mod tests;
#[cfg(test)]
mod unknowns_tests;
