//! What a caller of the engine is told on the way.

use nav_sim_navigation::sensors::outage::OutageRemark;
use std::path::PathBuf;

/// How much a remark matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Importance {
    /// For who wants to know all.
    Detail,
    /// What is done.
    Note,
    /// A doubt.
    Warning,
}

/// Something to know about a study.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Remark {
    /// What was found in an input.
    #[error("{0}")]
    InputRead(String),
    /// What is doubtful about an input.
    #[error("{0}")]
    InputDoubt(String),
    /// What the filters do not expect of the true IMU.
    #[error("{0}")]
    FilterDoubt(String),
    /// A candidate is being calibrated.
    #[error("calibrating {candidate} ({})", .estimators.join(", "))]
    Calibrating {
        /// Its name.
        candidate: String,
        /// What makes its models.
        estimators: Vec<String>,
    },
    /// An outage is not as it was asked for.
    #[error("{cell}: {remark}")]
    Outage {
        /// Names of the cell.
        cell: String,
        /// What became of it.
        remark: OutageRemark,
    },
    /// A cell without outages.
    #[error("cell \"{cell}\" has no outages: its table is empty")]
    NoOutages {
        /// Its name.
        cell: String,
    },
    /// More such cells than are named.
    #[error("{cells} more cells have no outages")]
    MoreWithoutOutages {
        /// How many.
        cells: usize,
    },
    /// Unit files of another plan.
    #[error("{units} unit files are of another plan and left out, such as {}", .example.display())]
    ForeignUnits {
        /// How many.
        units: usize,
        /// One of them.
        example: PathBuf,
    },
    /// Tables of another plan.
    #[error("{} holds the tables of another plan; `merge` replaces them", .path.display())]
    StaleResults {
        /// The directory.
        path: PathBuf,
    },
    /// A model of the plan was lost and is made again.
    #[error("wrote {} again", .path.display())]
    ModelRestored {
        /// File.
        path: PathBuf,
    },
    /// A unit file is damaged.
    #[error("{what}; it is computed again")]
    DamagedUnit {
        /// Which, and how.
        what: String,
    },
    /// Some units are there.
    #[error("{done} units are done already, {pending} to do")]
    DoneAlready {
        /// Those that are whole.
        done: usize,
        /// Those of the shard that are left.
        pending: usize,
    },
}

impl Remark {
    /// How much it matters.
    pub(crate) const fn importance(&self) -> Importance {
        match self {
            Self::InputRead(_) => Importance::Detail,
            Self::Calibrating { .. } | Self::ModelRestored { .. } | Self::DoneAlready { .. } => {
                Importance::Note
            }
            _ => Importance::Warning,
        }
    }
}
