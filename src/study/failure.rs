//! Why the engine stops, and what to do about it.

use super::plan::NamedUnit;
use super::unit_file::UnitFileError;
use crate::formats::FileError;
use nav_sim_navigation::metrics::ComparisonError;
use std::path::PathBuf;

/// A study that cannot be planned, run, merged or verified.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A file that cannot be read or written, or whose contents are refused.
    #[error(transparent)]
    File(Box<FileError>),
    /// A unit's file.
    #[error(transparent)]
    Unit(#[from] UnitFileError),
    /// There is no plan.
    #[error("{} holds no plan", .directory.display())]
    NoPlan {
        /// The directory.
        directory: PathBuf,
    },
    /// It is the plan of another study, or the study has changed since.
    #[error("{} is of another study: \"{key}\" is {found} in the plan, {wanted} in the study", .plan.display())]
    OtherStudy {
        /// The plan's file.
        plan: PathBuf,
        /// The key that differs.
        key: String,
        /// Its value in the plan.
        found: String,
        /// Its value in the study.
        wanted: String,
    },
    /// A part of the study that cannot be made, or does not fit the others.
    #[error("{part}: {reason}")]
    Unfit {
        /// Names of the cell, the candidate, or a file.
        part: String,
        /// Why.
        reason: String,
        /// What helps.
        hint: Option<String>,
    },
    /// A candidate that leaves out the recordings of a truth, and has none of them, or no other.
    #[error("leave_out: {}", match .left {
        0 => format!("without those of the truth \"{}\" no recording is left", .truth),
        _ => format!("none of its recordings makes the errors of the truth \"{}\"", .truth),
    })]
    NothingLeftOut {
        /// Name of the truth.
        truth: String,
        /// How many recordings are left.
        left: usize,
    },
    /// A covariance that ran away.
    #[error(
        "{cell}: the covariance analysis of {column} did not stay finite and positive definite"
    )]
    NotFinite {
        /// Names of the cell.
        cell: String,
        /// The candidate.
        column: String,
    },
    /// An input is not what it was.
    #[error("{what} has changed since the study was planned")]
    Changed {
        /// File, or name of a truth.
        what: String,
    },
    /// A model calibrated by the plan is lost, or not what it was.
    #[error("{} is lost, or has changed since the study was planned", .path.display())]
    LostModel {
        /// Its file.
        path: PathBuf,
    },
    /// This build or machine makes other numbers than the one that planned.
    #[error(
        "the plan was made by nav-sim {} whose numbers are {}; this is {}, whose numbers are {}",
        .planned.0, .planned.1, .here.0, .here.1
    )]
    OtherNumbers {
        /// Version and fingerprint of the plan.
        planned: (String, String),
        /// Version and fingerprint here.
        here: (String, String),
    },
    /// Units are missing or damaged: nothing was written.
    #[error("{} of {units} units are missing or damaged", .missing.len())]
    Incomplete {
        /// Units of the plan.
        units: usize,
        /// The missing and damaged units.
        missing: Vec<NamedUnit>,
    },
    /// There is nothing to verify.
    #[error("no unit is done yet")]
    NothingDone,
    /// Columns of a cell that have no ratio.
    #[error(transparent)]
    Comparison(#[from] ComparisonError),
}

impl From<FileError> for StudyError {
    fn from(e: FileError) -> Self {
        Self::File(Box::new(e))
    }
}

impl StudyError {
    pub(super) fn unfit(part: impl ToString, reason: impl ToString) -> Self {
        Self::Unfit {
            part: part.to_string(),
            reason: reason.to_string(),
            hint: None,
        }
    }

    /// Whether contents or the request are at fault (rather than the machine).
    pub(crate) fn is_usage(&self) -> bool {
        match self {
            Self::File(e) => !e.is_system(),
            Self::Unit(_)
            | Self::Comparison(_)
            | Self::NotFinite { .. }
            | Self::LostModel { .. } => false,
            _ => true,
        }
    }

    /// What to do about it.
    pub(crate) fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::File(e) => return e.hint(),
            Self::Unfit { hint, .. } => return hint.clone(),
            Self::NoPlan { .. } => "make one with `nav-sim batch plan STUDY.toml`",
            Self::OtherStudy { .. } => "plan into another directory with --out, or remove this one",
            Self::Changed { .. } => "put it back, or plan into another directory with --out",
            Self::LostModel { .. } => "`nav-sim batch plan` makes it anew",
            Self::OtherNumbers { .. } => {
                "use the build that planned, or plan into another directory with --out"
            }
            Self::Incomplete { .. } => "`nav-sim batch run` computes them; nothing was written",
            Self::NothingDone => "see `nav-sim batch run`",
            _ => return None,
        };
        Some(hint.to_owned())
    }
}
