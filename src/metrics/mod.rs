//! What the runs say: ASEE, RMSE, bias, consistency (NEES, NIS, coverage), errors at the end of outages,
//! ratios between experiments; each with its Monte-Carlo standard error or interval.
//!
//! Everything here is a pure function of a [`RunResult`](crate::simulation::RunResult) or of what a run
//! directory keeps of it.

mod consistency;
mod epoch;
mod estimate;
mod outage;
mod ratio;
mod reduction;
mod summary;

pub use consistency::{Band, chi_square_band, coverage_band};
pub use epoch::{EpochMetrics, epochs};
pub use estimate::{Estimate, PerState, Quantile, quantile};
pub use outage::{OutageMetrics, Reconvergence, outages};
pub use ratio::{ComparisonError, EpochRow, Measured, OutageComparison, RatioError, StateRatio, compare};
pub use reduction::{AxisReduction, ReductionQuality, ReductionSummary, TOLERANCE};
pub use summary::{Consistency, Coverage, Nis, OutageSummary, Recovery, Spread, Summary};
