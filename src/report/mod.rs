//! Results as files: tables, JSON, one self-contained page. It computes no statistic and touches no file:
//! every function makes a text, the command line writes it.

mod comparison;
mod html;
mod manifest;
mod number;
mod run_directory;
#[cfg(test)]
mod sample;
mod svg;
mod tables;

pub use comparison::{CandidateResult, ComparisonFile, Label, table_rows};
pub use manifest::{Input, Manifest, ModelNote};
pub use run_directory::{OutputFile, json, run_directory};
pub use tables::{TableError, epochs_csv, parse_epochs, parse_runs, runs_csv};
