//! Wavelet-variance curves: of replicates, averaged, as a model implies them, and how they scatter.

mod average;
mod differing;
pub(crate) mod implied;
mod replicates;
pub(crate) mod robust_scale;
pub(crate) mod sampling;
pub(crate) mod shape;
mod stationarity;

pub use average::{AverageError, Estimator, Replicate, Trim, TrimError, average};
pub(crate) use differing::falling_root;
pub use implied::implied;
pub use replicates::{Group, Pool, Scope, SignalError, grouped, replicates, trend};
pub use robust_scale::median;
pub use stationarity::{Beginning, Beginnings, Change, WarmUp, warm_up};
