//! From replicate recordings to one noise model: AWV, SR-AWV, DR-AWV, GMWM.
//!
//! [`replicates()`] computes the wavelet variances of all signals, [`average()`] averages those of a group to one
//! curve, and [`fit()`] finds the model whose theoretical wavelet variance is closest to the curve. [`calibrate`]
//! does the last two.
//!
//! ```
//! use nav_sim_calibration::{ModelSpec, Weighting, fit};
//! use nav_sim_signal::noise::{Composite, Process};
//! use nav_sim_signal::wavelet::Curve;
//!
//! let (white, walk) = (Process::white(4e-6)?, Process::random_walk(1e-12)?);
//! let truth = Composite::new(vec![white, walk]);
//! let levels: Vec<u32> = (1..=14).collect();
//! let wv = levels.iter().map(|level| truth.haar_wv(*level)).collect();
//! let curve = Curve { wv, edof: vec![100.0; levels.len()], levels, ..Curve::default() };
//! let found = fit(&curve, &"WN+RW".parse::<ModelSpec>()?, 100.0, Weighting::Model)?.composite;
//! // An exact curve gives the parameters back.
//! for (found, true_value) in found.parameters().zip([4e-6, 1e-12]) {
//!     assert!((found.1 / true_value - 1.0).abs() < 1e-9);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[allow(unused_imports, reason = "sources are named in the documentation")]
pub(crate) use nav_sim_signal::{bibliography, imu, minimise, noise, rng, units, wavelet};

// Wavelet variances: of replicates, averaged, as a model implies them, and how they scatter.
mod curve;
// The model that is fitted.
mod model;
// The fit of a model to a curve.
mod fit;
// Settings and results of a calibration.
mod outcome;
// Uncertainty of a fit.
mod uncertainty;
// Choice of the model.
mod selection;
// Diagnosis: recordings that are unlike the others.
mod diagnosis;
// Numbers for people.
mod format;
// Slopes read off curves that their models do not describe.
mod reading;
// The whole calibration.
mod pipeline;
// Turn-on bias, from the means of recordings.
mod turn_on;
// Intervals to be expected of a calibration that is planned.
mod anticipated;

pub use anticipated::PlannedRecordings;
pub use curve::{
    CalibrationError, CalibrationFault, Estimator, Group, Pool, RecordingWarmUp, Replicate, Scope,
    Trim, WarmUp, average, grouped, implied, log_bias, median, replicates, robust_bias, trend,
    warm_up,
};
pub use diagnosis::{
    Alarm, CommonCause, CommonFinding, Diagnosis, FEWEST_TO_COMPARE, RecordingVerdict, diagnose,
};
pub use fit::{Fit, Termination, Weighting, estimate, fit};
pub use format::{duration, percent};
pub use model::{ModelSpec, SpecError};
pub use outcome::{
    Advance, AxesDiffer, Bootstrap, CalibrationSettings, CurveDeparture, FitRange, Goodness,
    IndistinctProcesses, Inference, LevelSpread, ModelCandidate, ModelChoice, ModelRanking,
    Outcome, ParameterInterval, ParameterSpread, Practical, PracticalIntervals, ScaleMisfit,
    Undetermined, model_of, tau_s,
};
pub use pipeline::{
    add_intervals, add_intervals_with_progress, calibrate, calibrate_with_progress, fit_curve,
};
pub use turn_on::{MeansOfAxis, TURN_ON_LEVEL, TurnOnFinding, TurnOnSpread, turn_on};
pub use uncertainty::{
    ALIKE_LEVEL, ScatterSource, UNDETERMINED_RATIO, derived_interval, figures_with_intervals,
};

#[cfg(test)]
pub(crate) mod tests;
