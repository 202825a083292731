//! Studies: grids of Monte-Carlo experiments, cut into units of work that survive, resume and spread over
//! machines.
//!
//! A [`Study`] is the product of trajectories, truths, scenarios, receivers and outage sets: its *cells*.
//! Candidates (noise models) and filter variants are the *columns* of a cell: all of them run on one draw
//! of the noise, so that ratios between them are paired. The runs of a cell are cut into *units*; a unit is
//! named by the hash of everything that decides its bytes ([`Plan::unit_id`]), so that finished work is
//! recognised wherever it was done, and work of another study never passes for it.
//!
//! ```text
//! STUDY.toml ── check, prepare, probe ─► plan.json ─► units/xx/<id>.unit … (any order, any machine)
//!                                                  └► merge, in run order ─► outages, ratios, epochs, runs
//! ```
//!
//! Nothing goes by time stamps: clocks that disagree do no harm. Sums of a unit are made in run order, sums of a cell in the order of its units; the plan fixes the
//! units, so the merged result is the same to the last bit for any number of shards, threads or restarts.

mod check;
mod description;
mod error;
mod fingerprint;
mod grid;
mod merge;
mod plan;
mod prepare;
mod sweep;
mod unit;

pub use description::{
    CalibrateStep, CandidateEntry, GnssEntry, Metric, OutagesEntry, ScenarioEntry, Study, Synthesis,
    TrajectoryEntry, TruthEntry,
};
pub use error::{PrepareError, StudyError};
pub use fingerprint::fingerprint;
pub use grid::{Cell, Column, Grid};
pub use merge::CellSums;
pub use plan::{Estimate, Plan, Prepared, Unit};
pub use prepare::{Material, calibrated, channels};
pub use sweep::{OneOrMany, OutageSet, Periodic, Random, Sweep};
pub use unit::{Kept, UnitResult, run_unit};
