//! Why the engine stops, and what to do about it.

use super::error::{DescriptionError, PrepareError};
use super::plan::Unit;
use super::remedy::Remedy;
use super::unit_file::UnitFileError;
use crate::formats::FileError;
use nav_sim_navigation::ekf::BeliefError;
use nav_sim_navigation::metrics::ComparisonError;
use nav_sim_navigation::sensors::outage::OutageError;
use std::path::PathBuf;

/// Any error, where only its words matter.
type Source = Box<dyn std::error::Error + Send + Sync>;

/// What helps where fixes are too rare to reduce a model.
const RARE_FIXES: &str =
    "raise it, or take the full filter alone (filters = [\"full\"]), which reduces nothing";

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
    #[error(
        "{} is the plan of another study, or the study has changed since: \"{key}\" is {found} in the plan, {wanted} in the study",
        .plan.display()
    )]
    OtherStudy {
        /// The plan's file.
        plan: PathBuf,
        /// What differs.
        key: String,
        /// What is in the plan.
        found: String,
        /// What is in the study.
        wanted: String,
    },
    /// The study means no grid.
    #[error("{}: {source}", .study.display())]
    Description {
        /// Its file.
        study: PathBuf,
        /// Why.
        source: DescriptionError,
    },
    /// A step of calibration, or virtual recordings.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// A candidate that cannot be calibrated.
    #[error("{candidate}: {source}")]
    Candidate {
        /// Its name.
        candidate: String,
        /// Why.
        source: Box<StudyError>,
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
    /// Outages that do not lie on a trajectory.
    #[error("{place}: {source}")]
    Outage {
        /// Study file and names of the cell.
        place: String,
        /// Which, and why.
        source: OutageError,
    },
    /// Trajectory, truth, scenario and candidate that do not fit together.
    #[error("{part}: {source}")]
    Unfit {
        /// Names of the cell, or the candidate.
        part: String,
        /// Why.
        source: Source,
    },
    /// A candidate's model without the filter that is asked for.
    #[error("{part}: {source}")]
    NoFilter {
        /// The candidate.
        part: String,
        /// Why.
        source: BeliefError,
    },
    /// A covariance that ran away.
    #[error("{cell}: the covariance analysis of {column} did not stay finite and positive definite")]
    NotFinite {
        /// Names of the cell.
        cell: String,
        /// The candidate.
        column: String,
    },
    /// A model without the spread that virtual recordings draw from.
    #[error("{}: has no [spread], which \"spread = true\" draws from", .model.display())]
    NoSpread {
        /// File.
        model: PathBuf,
    },
    /// An input is not what it was.
    #[error("{what} has changed since the study was planned")]
    Changed {
        /// File, or name of a truth.
        what: String,
    },
    /// A model calibrated by the plan is lost, or not what it was.
    #[error(transparent)]
    CalibratedModel(Box<StudyError>),
    /// A model that is lost comes out otherwise now.
    #[error("{model} cannot be made again as it was planned")]
    NotMadeAgain {
        /// File.
        model: String,
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
        /// Those, with their names.
        missing: Vec<(Unit, String)>,
        /// Tables that another plan left.
        stale: Option<PathBuf>,
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
    /// Whether contents or the request are at fault (rather than the machine).
    pub(crate) fn is_usage(&self) -> bool {
        match self {
            Self::File(e) => !e.is_system(),
            Self::Candidate { source, .. } | Self::CalibratedModel(source) => source.is_usage(),
            Self::Unit(_) | Self::Comparison(_) | Self::NotFinite { .. } => false,
            _ => true,
        }
    }

    /// What to do about it.
    pub(crate) fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::File(e) => e.hint().map(Remedy::Advice),
            Self::Description { source, .. } => source.hint().map(Remedy::Advice),
            Self::Outage { source, .. } => source.hint().map(|hint| Remedy::Advice(hint.to_owned())),
            Self::Candidate { source, .. } => source.remedy(),
            Self::NoFilter { source: BeliefError::Setting(_), .. } => {
                Some(Remedy::Advice(RARE_FIXES.to_owned()))
            }
            Self::NoPlan { .. } => Some(Remedy::Plan),
            Self::OtherStudy { .. } => Some(Remedy::PlanElsewhere),
            Self::Changed { .. } => Some(Remedy::PutBack),
            Self::CalibratedModel(_) => Some(Remedy::PlanAgain),
            Self::NotMadeAgain { .. } => Some(Remedy::UsePlanningBuild),
            Self::OtherNumbers { .. } => Some(Remedy::UseOneBuild),
            Self::Incomplete { .. } | Self::NothingDone => Some(Remedy::Run),
            _ => None,
        }
    }
}
