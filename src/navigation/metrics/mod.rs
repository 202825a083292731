//! Statistics of the runs: ASEE, RMSE, bias, consistency (NEES, NIS, coverage), errors at the end of outages,
//! ratios between experiments; each with its Monte-Carlo standard error or interval.
//!
//! Everything here is a pure function of a [`RunResult`](crate::simulation::RunResult) or of what a run
//! directory keeps of it.
//!
//! ```
//! use nav_sim_navigation::metrics::chi_square_band;
//!
//! // Of two degrees of freedom the chi-square law is exponential: its quantiles are −2 ln(1 − p).
//! let band = chi_square_band(2, 1.0);
//! assert!((band.lower + 2.0 * 0.975_f64.ln()).abs() < 1e-9);
//! assert!((band.upper + 2.0 * 0.025_f64.ln()).abs() < 1e-9);
//! ```

mod agreement;
mod budget;
mod consistency;
mod epoch;
mod estimate;
mod expected;
mod fan;
mod outage;
mod quadratic_form;
mod ratio;
mod reduction;
mod requirement;
mod summary;
mod verdict;

pub use budget::Budget;
pub use consistency::{Band, chi_square_band};
pub use epoch::{Accuracy, EpochMetrics, epochs};
pub use estimate::{Estimate, PerState, Quantile, SampleSize, quantile};
pub use expected::{Expected, horizontal_quantiles};
pub use fan::{FAN_LEVELS, FanEpoch, expected_fan, fan};
pub use outage::{OutageMetrics, Reconvergence, outages};
pub use quadratic_form::QuadraticForm;
pub use ratio::{
    ComparisonError, EpochRow, Measured, OutageComparison, RatioError, StateRatio, compare,
};
pub use reduction::{AxisReduction, ReductionQuality, ReductionSummary, TOLERANCE};
pub use requirement::{Met, Requirement, UnknownRequirement};
pub use summary::{
    AccuracySummary, Consistency, Coverage, Nis, OutageSummary, Recovery, Spread, Summary,
};
pub use verdict::{ALL_STATES, OutageVerdict, StateName, Verdict, VerdictKind};
