//! From a noise model to navigation errors: trajectories, sensors, strapdown, error-state filter, Monte
//! Carlo, covariance analysis, metrics.
//!
//! Part of [nav-sim](https://docs.rs/nav-sim), which lists what its users need of it. The modules are listed in layer
//! order: one names only what stands above it.

#[allow(unused_imports, reason = "sources are named in the documentation")]
pub(crate) use nav_sim_signal::{bibliography, imu, lanes, minimise, noise, rng, units, wavelet};

// L0
pub mod linalg;
// L1
pub mod frames;
pub mod gnss;
// L2
pub mod earth;
// L3
pub mod trajectory;
// L4
pub mod sensors;
pub mod strapdown;
// L5
pub mod ekf;
// L6
pub mod closure;
pub mod simulation;
// L7
pub mod monte_carlo;
pub mod scenario;
// L8
pub mod metrics;
// L9
pub mod fusion;
pub mod require;

#[cfg(test)]
pub(crate) mod tests;
