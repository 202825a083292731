//! Why a run has no answer.

use super::NavigateError;
use crate::formats::FileError;
use nav_sim_navigation::metrics::Requirement;
use nav_sim_navigation::sensors::outage::OutageError;
use nav_sim_signal::noise::continuous::RateError;
use nav_sim_signal::units::SettingError;
use std::path::PathBuf;

/// Why a run has no answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A model that cannot be converted to the rate of the IMU.
    #[error("{}: {source}", path.display())]
    Rate {
        /// Its file.
        path: PathBuf,
        /// Its rate (Hz).
        from_hz: f64,
        /// Why.
        source: RateError,
    },
    /// A model without a spread, from which parameters were to be drawn.
    #[error("{}: no [spread] to draw parameters from", .0.display())]
    NoSpread(PathBuf),
    /// A model drawn from a spread that cannot be converted to the rate of the IMU.
    #[error("a model drawn from the [spread] of {}: {source}", path.display())]
    Drawn {
        /// File of the spread.
        path: PathBuf,
        /// Why.
        source: RateError,
    },
    /// A setting that is refused.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// No outage, and one.
    #[error("--outage none stands beside other outages")]
    Outages,
    /// An outage that does not lie on the trajectory.
    #[error("{}{source}", file.as_ref().map_or(String::new(), |file| format!("{}: ", file.display())))]
    Outage {
        /// The scenario file that has it.
        file: Option<PathBuf>,
        /// Why.
        source: OutageError,
    },
    /// A requirement of the ends of outages, and no outage.
    #[error("--require {0}: {name} is of the ends of outages, and there is none", name = .0.name())]
    NoOutage(Requirement),
    /// No such navigation.
    #[error("{source}")]
    Navigate {
        /// File of the model in the filter.
        model: PathBuf,
        /// File of the settings, if there is one.
        settings: Option<PathBuf>,
        /// Why.
        source: Box<NavigateError>,
    },
}
