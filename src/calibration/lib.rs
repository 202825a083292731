//! From replicate recordings to one noise model: AWV, SR-AWV, DR-AWV, GMWM.
//!
//! [`replicates()`] takes the wavelet variances of all signals, [`average()`] makes one curve of those of a
//! group, [`fit()`] finds the model whose theoretical wavelet variance is nearest to it; [`calibrate`] is
//! all of it but the first.

#[allow(unused_imports, reason = "sources are named in the documentation")]
pub(crate) use nav_sim_signal::bibliography;
pub(crate) use nav_sim_signal::{imu, noise, rng, wavelet};

mod alike;
mod auto;
mod average;
mod avlr;
mod bootstrap;
mod bounded;
mod diagnosis;
pub mod efficiency;
mod fit;
mod goodness;
mod implied;
mod indistinct;
mod inference;
mod limits;
mod notes;
mod objective;
mod optimise;
mod parameter_intervals;
mod pipeline;
mod replicates;
mod robust_scale;
mod sampling;
mod sandwich;
mod search;
mod spec;
mod spread;
mod stationarity;

pub use alike::LEVEL as ALIKE_LEVEL;
pub use auto::{Candidate, Ranking};
pub use average::{AverageError, Estimator, Replicate, Trim, average};
pub use diagnosis::{
    Alarm, AxisScores, CommonOutliers, Diagnosis, DriftAlarm, LeftOut, Misfit, Movement, Verdict, advice,
    diagnose, effects,
};
pub use fit::{Fit, FitError, fit};
pub use goodness::Goodness;
pub use implied::implied;
pub use indistinct::Indistinct;
pub use inference::{Bootstrap, Inference, infer};
pub use limits::{LimitError, Limits};
pub use notes::{Share, correlation_time_s, duration, notes, percent, shares};
pub use objective::Weighting;
pub use optimise::Termination;
pub use parameter_intervals::{ParameterInterval, Undetermined};
pub use pipeline::{
    CalibrationError, Cause, ModelChoice, Outcome, ParameterLimit, Settings, calibrate, estimate, fit_curve,
};
pub use replicates::{Group, Pool, SignalError, grouped, replicates, trend};
pub use spec::{Kind, ModelSpec, SpecError};
pub use stationarity::{WarmUp, warm_up};
