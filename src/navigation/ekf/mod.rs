//! The error-state extended Kalman filter (loosely coupled INS/GNSS).
//!
//! Closed loop: corrections go into the nominal state at once and the error mean is zero between fixes.
//! Errors are estimate − truth; attitude by C_est = (I + \[psi_n×\]) C_true.
//!
//! The filter never sees truth: it is given increments, fixes, and what it believes of the noise.

mod aiding;
pub mod belief;
pub mod covariance;
pub mod dynamics;
pub mod filter;
pub mod gate;
pub mod initial;
mod iterated;
mod snapshot;
pub mod states;
mod transition;
pub mod unknowns;
pub mod update;

pub(crate) use aiding::{
    BodyVelocity, body_velocity_rows, dense_yaw_row, update_body_velocity, update_yaw,
};
pub use belief::{Belief, BeliefError};
pub use covariance::Covariance;
pub use filter::{Ekf, advance, settle};
pub(crate) use gate::{nis_limit, update_within};
pub use initial::InitialSettings;
pub(crate) use snapshot::Snapshot;
pub use states::FilterStates;
pub use unknowns::{Unknown, UnknownKind};
pub use update::{Fix, FixUpdate, update};
pub(crate) use update::{fix_rows, update_height};

#[cfg(test)]
mod tests;
#[cfg(test)]
mod unknowns_tests;
