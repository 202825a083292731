//! The library against closed forms, independent truths and statistical bounds.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::duplicate_mod,
    unreachable_pub,
    reason = "tests, some with figures"
)]

#[allow(dead_code, reason = "shared with the other tests")]
#[path = "../common/mod.rs"]
mod common;

mod alignment;
mod calibration_intervals;
mod calibration_truth;
mod case_study;
mod consistency;
mod correlated;
mod covariance_truth;
mod displaced;
mod estimator_bias;
mod formats;
mod fusion;
mod global_minimum;
mod imu_unknowns;
mod lincov;
mod lincov_sampled;
mod long_records;
mod mounting;
mod paper_section4;
mod reduction;
mod require;
mod shared;
mod smoothing;
mod strapdown_error;
mod trajectories;
mod tune;
mod vehicle;
