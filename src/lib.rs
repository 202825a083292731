//! **nav-sim** calibrates the noise of an IMU from static recordings, and simulates what that noise costs in INS/GNSS
//! navigation.
//!
//! The main job: a noise model in the filter, a drive, an outage, and the error at its end.
//!
//! ```
//! use nav_sim::prelude::*;
//!
//! let model = read_model("calib_data/tactical.toml".as_ref())?.model;
//! let (drive, _) = load_trajectory("trajectories/figure_eight.toml".as_ref(), None)?;
//! let inputs = NavigateInputs::new(drive, model, TrueImu::AsBelieved);
//! let mut scenario = Scenario::default();
//! scenario.run.method = Method::Lincov;
//! let outage = Outage { start_s: 60.0, end_s: 90.0 };
//! let found = navigate(&inputs, &scenario, &[outage], 1, &Context::default())?;
//! println!("p95 after 30 s: {:.1} m", found.summary.outages[0].horizontal_error_end_m.p95);
//! // The filter has the model of the true IMU: the squared error of nine states is nine times what it believes of one.
//! assert!((found.summary.nees.mean - 9.0).abs() < 0.4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`prelude`] has what most programs need, [`commands`] a struct for each command, [`commands::batch`] studies.
//! The mathematics is in three crates: [`signal`] (noise, wavelet variance), [`calibration`] (recordings to model) and
//! [`navigation`] (trajectory to errors). `calibration` and `navigation` stand on `signal` and never import each other.
//!
//! # Notation
//! Units are SI and radians inside; in files, flags and reports the unit is in the name (`lat_deg`, `pos_sigma_m`). Frames
//! are in the name: `f_ib_b` is the specific force of b with respect to i, written in b; `q_b_n` and `C_b_n` take b and
//! return n. n = North-East-Down, b = front-right-down, e = Earth-centred Earth-fixed (WGS-84).
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
//! Within a crate a module names only modules above it in the list of its `lib.rs`, as `tests/layering.rs` checks. Nothing
//! below the command line reads a clock, the environment, a terminal or a source of randomness: generators and seeds are
//! arguments.

#![cfg_attr(
    not(feature = "cli"),
    allow(dead_code, unused_imports, reason = "the program uses them")
)]

#[doc(inline)]
pub use {
    nav_sim_calibration as calibration, nav_sim_document as document,
    nav_sim_navigation as navigation, nav_sim_signal as signal,
};

pub use commands::export::export;

// Values of arguments.
mod parse;
// Failures and results.
pub mod failure;
// Words and shapes that several results share.
pub mod report;
// Files.
pub mod io;
// What every command does: options, inputs, notes, outputs.
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
pub mod app;
// A file or a folder for each command.
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
pub mod commands;
// A directory to start from.
mod init;
// All that most programs need.
pub mod prelude;
// Readers of all files, for fuzzing.
#[doc(hidden)]
pub mod fuzz;
// Arguments, words and exit codes.
#[allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "help texts have sections of files and names to be filled in"
)]
#[cfg(feature = "cli")]
pub mod cli;
