//! Signals of an inertial sensor: noise processes and models, their synthesis, and the wavelet variance.
//!
//! Part of [nav-sim](https://docs.rs/nav-sim), which lists what its users need of it; calibration and navigation both
//! stand on it and never import each other.
//! The modules are listed in layer order: one names only what stands above it.

// L0
pub mod bibliography;
pub mod lanes;
pub mod minimise;
pub mod names;
pub mod rng;
pub mod units;
// L1
pub mod imu;
// L2
pub mod facts;
pub mod noise;
pub mod wavelet;
