//! Wavelet-variance curves: of replicates, averaged, as a model implies them, and how they scatter.

mod average;
pub(crate) mod sampling;
mod stationarity;

pub use average::{
    CalibrationError, CalibrationFault, Estimator, Group, Pool, Replicate, Scope, Trim, average,
    grouped, log_bias, median, replicates, robust_bias, trend,
};
pub(crate) use average::{LARGEST_BIAS, MAD_TO_DEVIATION, falling_root, p_value};
pub use sampling::implied;
pub use stationarity::{RecordingWarmUp, WarmUp, warm_up};
