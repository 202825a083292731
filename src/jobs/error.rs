//! Why a job has no result.

use crate::commands::run::NavigateError;
use crate::formats::FileError;
use nav_sim_calibration::{AnticipationError, CalibrationError, Estimator, SignalError};
use nav_sim_navigation::metrics::ComparisonError;
use nav_sim_signal::noise::ReplicateError;
use nav_sim_signal::wavelet::WaveletError;

/// Why a job has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A signal without a wavelet variance.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// Degrees of freedom that cannot be estimated.
    #[error(transparent)]
    Wavelet(#[from] WaveletError),
    /// No fit.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Copies: one replicate would count as two, and intervals come out too narrow.
    #[error("{copy} is a copy of {first}: it would count as two replicates")]
    Copy {
        /// The recording.
        copy: String,
        /// The one it is a copy of.
        first: String,
    },
    /// Parameters or a contamination that a recording cannot have.
    #[error(transparent)]
    Replicate(#[from] ReplicateError),
    /// No calibration of such recordings to anticipate.
    #[error(transparent)]
    Anticipation(#[from] AnticipationError),
    /// No such navigation.
    #[error(transparent)]
    Navigate(#[from] NavigateError),
    /// Runs along another trajectory than that of the reference: a ratio means nothing.
    #[error("{run}: not the trajectory of the reference")]
    OtherTrajectory {
        /// The run.
        run: String,
    },
    /// Runs that have no ratio.
    #[error("{run}: {source}")]
    Ratio {
        /// The run.
        run: String,
        /// Why.
        source: ComparisonError,
    },
    /// An estimator of one recording was given several.
    #[error("{estimator} takes one recording at a time; there are {recordings}")]
    Single {
        /// The estimator.
        estimator: Estimator,
        /// How many recordings there are.
        recordings: usize,
    },
    /// An estimator of one signal was to pool the axes.
    #[error("gmwm, rgmwm and avlr take one signal at a time")]
    Pooled,
    /// A curve that says its rate, and another one given.
    #[error("{path}: the curve says its rate, {stated} Hz; {given} Hz is another")]
    TwoRates {
        /// File.
        path: String,
        /// Its rate.
        stated: f64,
        /// The rate given.
        given: f64,
    },
    /// A curve without a rate.
    #[error("{path}: the curve does not say its sample rate")]
    NoRate {
        /// File.
        path: String,
    },
    /// A curve without a sensor.
    #[error("{path}: the curve does not say of which sensor it is")]
    NoSensor {
        /// File.
        path: String,
    },
    /// Two curves for one model.
    #[error("{path}: there are two curves of {name} for {estimator}")]
    TwoCurves {
        /// File.
        path: String,
        /// What they are of.
        name: String,
        /// The estimator.
        estimator: Estimator,
    },
}
