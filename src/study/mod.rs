//! Studies: grids of Monte-Carlo experiments, cut into units of work that survive, resume and spread over
//! machines.
//!
//! A study is the product of trajectories, truths, scenarios, receivers and outage sets: its *cells*.
//! Candidates (noise models) and filter variants are the *columns* of a cell: all of them run on one draw
//! of the noise, so that ratios between them are paired. The runs of a cell are cut into *units*; a unit is
//! named by the hash of everything that decides its bytes (`Plan::named_units`), so that finished work is
//! recognised wherever it was done, and work of another study never passes for it.
//!
//! ```text
//! STUDY.toml ── plan: check, calibrate, probe ─► plan.json ─► run ─► units/xx/<id>.unit (any order, any machine)
//!                                                          └► merge, in run order ─► results/
//! ```
//!
//! Nothing goes by time stamps: clocks that disagree do no harm. Sums of a unit are made in run order, sums of a cell in the order of its units; the plan fixes the
//! units, so the merged result is the same to the last bit for any number of shards, threads or restarts.
//!
//! ```no_run
//! use nav_sim::study::{self, MergeOptions, PlanOptions, Planned, RunOptions, Shard, Writing};
//! use std::path::Path;
//!
//! let (file, directory) = (Path::new("examples/quick_study.toml"), Path::new("out/quick"));
//! let seed = |of_study: Option<u64>| of_study.unwrap_or(1);
//! let options = PlanOptions { seed: &seed, threads: 2, clock: None, writing: Writing::Write };
//! study::plan(file, directory, &options, &())?;
//!
//! // here or elsewhere, in any order, as often as it takes
//! let planned = Planned::open(file, directory, None)?;
//! for index in 0..2 {
//!     let shard = Shard::new(index, 2).expect("0 and 1 are below 2");
//!     study::run(&planned, &RunOptions { shard, threads: 2 }, &())?;
//! }
//! let merged = study::merge(&planned, &MergeOptions { states: vec![1, 6], threads: 2 }, &())?;
//! println!("{}", merged.document.terminal(100));
//! # Ok::<(), study::StudyError>(())
//! ```

mod calibrating;
mod cell_tables;
mod check;
mod description;
mod document;
mod error;
mod failure;
pub(crate) mod file;
mod fingerprint;
mod grid;
mod inputs;
mod leave_one_out;
mod merging;
pub(crate) mod named_files;
mod plan;
mod planned;
mod planning;
mod reader;
mod rules;
mod running;
mod sweep;
mod tables;
mod unit;
pub mod unit_file;

pub(crate) use description::Study;
pub(crate) use document::{MergedStudy, ShownCell, ShownColumn};
pub use error::DescriptionError;
pub use failure::StudyError;
pub use grid::Grid;
pub use merging::{MergeOptions, MergeReport, merge};
pub use plan::{NamedUnit, Plan, Shard, Unit};
pub(crate) use planned::plan_in;
pub use planned::{Planned, Status};
pub use planning::{PlanOptions, PlanReport, Writing, plan};
pub use running::{RunOptions, RunReport, VerifyOptions, VerifyReport, run, verify};
pub use unit::{Finding, UnitResult};
