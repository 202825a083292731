//! Sensors on a trajectory: what is measured, with which errors, and when it is missing.

pub mod aiding;
pub mod defects;
pub mod gnss;
pub mod ideal_imu;
pub mod imu;
pub mod outage;
