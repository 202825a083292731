//! **nav-sim**: an INS/GNSS navigation simulator with a robust stochastic-calibration front end.
//!
//! Static recordings (replicates) → robust wavelet variance → one noise model → Monte-Carlo INS/GNSS navigation →
//! comparison of estimators by their effect on the navigation solution.
//!
//! # Notation
//! Units are SI and radians inside; in files, flags and reports the unit is in the name (`lat_deg`,
//! `pos_sigma_m`). Frames are in the name: `f_ib_b` is the specific force of b with respect to i, written
//! in b; `q_b_n` and `C_b_n` take b and return n. n = North-East-Down, b = front-right-down,
//! e = Earth-centred Earth-fixed (WGS-84).
//!
//! | name | meaning |
//! |---|---|
//! | `phi` | AR(1) coefficient, nothing else |
//! | `Phi` | transition matrix |
//! | `lat`, `lon`, `h` | geodetic latitude, longitude (rad), ellipsoidal height (m) |
//! | `roll`, `pitch`, `yaw` | attitude (ZYX); `psi_n` is the attitude *error* rotation vector in n |
//! | `tau` | wavelet scale in samples, 2^j; `t_corr_s` a correlation time |
//! | `sigma2` | white or innovation variance per sample; `gamma2` random-walk increment variance; `q2` is Q² |
//! | `omega` | angular rate; a drift is a `slope` |
//! | `psd` | two-sided, units²/Hz |
//!
//! # Architecture
//! Three crates hold the mathematics, this one the files, words and commands. `nav-sim-signal` (noise, wavelet
//! variance) is the lowest. `nav-sim-calibration` (recordings → model) and `nav-sim-navigation` (trajectory → errors)
//! both depend on it and cannot import each other: they meet in [`noise::Model`]. Their modules are re-exported
//! here, so that `nav_sim::ekf`, for example, is the only path a user needs. Within a crate a module names only
//! modules above it in the list of its `lib.rs`, as `tests/layering.rs` checks. Nothing below the command line
//! reads a clock, the environment, a terminal or a source of randomness: generators and seeds are arguments.
//!
//! What a command does is one call in [`jobs`]: it takes files and returns results, and reports remarks as values.
//!
//! The division into crates also shortens compilation: a changed line in the filter recompiles `nav-sim-navigation`
//! and the crates that depend on it. Its unit tests are `cargo test -p nav-sim-navigation`.

pub use nav_sim_calibration as calibration;
pub use nav_sim_calibration::efficiency;
pub use nav_sim_navigation::{
    closure, earth, ekf, frames, fusion, gnss, lanes, linalg, metrics, monte_carlo, require, scenario,
    sensors, simulation, strapdown, throughput, trajectory,
};
pub use nav_sim_signal::{bibliography, imu, names, noise, rng, units, wavelet};

// Parameters for other programs.
mod export;
// Which model, on the user's own recordings.
pub mod choose;
// What follows a job.
pub mod observer;
// Words and pages.
pub mod report;
// Files.
pub mod formats;
// The engine of studies.
pub mod study;
// What a command does, as one call.
pub mod jobs;
// All that most programs need.
pub mod prelude;
// Arguments, words and exit codes.
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
pub mod cli;
