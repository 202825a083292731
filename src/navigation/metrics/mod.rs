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

mod estimate;
mod expected;
mod outage;
mod ratio;
mod summary;
mod verdict;

pub use estimate::{Band, Estimate, PerState, QuadraticForm, SampleSize, chi_square_band};
pub use expected::{ExpectedRun, horizontal_quantiles};
pub use outage::{Budget, EpochMetrics, epochs};
pub use ratio::{EpochRow, ExperimentResult, OutageComparison, StateRatio, compare};
pub(crate) use summary::name_and_limit;
pub use summary::{
    AccuracySummary, ConsistencySummary, Coverage, Nis, OutageSummary, QuantileSummary, Recovery,
    ReductionQuality, Requirement, RequirementResult, Summary, TOLERANCE,
};
pub use verdict::{
    ALL_STATES, Basis, DriveVerdict, NormalisedErrors, OutageVerdict, StateName, Verdict,
    VerdictKind,
};
