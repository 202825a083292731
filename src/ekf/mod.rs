//! The error-state extended Kalman filter (loosely coupled INS/GNSS).

mod initial;

pub use initial::{FilterStates, InitialSettings};
