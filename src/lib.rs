//! **nav-sim**: an INS/GNSS navigation simulator with a robust stochastic-calibration front end.
//!
//! Replicate static recordings → robust wavelet variance → one noise model → Monte-Carlo INS/GNSS
//! navigation → comparison of estimators by what they do to the navigation solution.
//!
//! # Notation
//! SI units and radians inside; units stand in the names of everything at the border (`lat_deg`,
//! `pos_sigma_m`). Frames are in the name: `f_ib_b` is the specific force of b with respect to i, written
//! in b; `q_b_n` and `C_b_n` take b and return n. n = North-East-Down, b = front-right-down,
//! e = Earth-centred Earth-fixed (WGS-84).
//!
//! | name | meaning |
//! |---|---|
//! | `phi` | AR(1) coefficient, only |
//! | `Phi` | transition matrix |
//! | `lat`, `lon`, `h` | geodetic latitude, longitude (rad), ellipsoidal height (m) |
//! | `roll`, `pitch`, `yaw` | attitude (ZYX); `psi_n` is the attitude *error* rotation vector in n |
//! | `tau` | wavelet scale in samples, 2^j; `t_corr_s` a correlation time |
//! | `sigma2` | white or innovation variance per sample; `gamma2` random-walk increment variance; `q2` is Q² |
//! | `omega` | angular rate; a drift is a `slope` |
//! | `psd` | two-sided, units²/Hz |
//!
//! # Architecture
//! Calibration (data → model) and navigation (trajectory → errors) never import each other; they meet in
//! [`noise::Model`]. Modules are listed below in layer order; a module names only what stands above it,
//! held by `tests/layering.rs`. Nothing below the command line reads a clock, the environment, a terminal
//! or a source of randomness: generators and seeds are arguments.

// L0
pub mod bibliography;
pub mod lanes;
pub mod linalg;
pub mod rng;
pub mod units;
// L1
pub mod earth;
pub mod frames;
pub mod gnss;
pub mod imu;
// L2
pub mod noise;
pub mod trajectory;
pub mod wavelet;
// L3
pub mod calibration;
pub mod sensors;
pub mod strapdown;
// L4
pub mod ekf;
// L5
pub mod closure;
pub mod fusion;
pub mod monte_carlo;
pub mod scenario;
pub mod simulation;
pub mod throughput;
// L6
pub mod metrics;
// L7
pub mod batch;
pub mod data;
pub mod report;
pub mod study;
