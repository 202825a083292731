//! One lane batch: eight runs through one trajectory.

mod batch;
mod gains;
pub mod lincov;
mod plan;
mod source;

pub use batch::Batch;
pub(crate) use batch::reported_error;
pub use gains::{Gains, GainsUsed, run_batch};
pub(crate) use plan::samples_per;
pub use plan::{Experiment, ExperimentError, Plan};
pub use source::{SimulatedRecording, record};

use serde::{Deserialize, Serialize};

/// Number of reported navigation states: position, velocity (n, e, d), roll, pitch, yaw.
pub const REPORTED: usize = 9;

/// Column names of the reported states, units included (m, m/s, degrees).
pub const REPORTED_NAMES: [&str; REPORTED] = [
    "pos_n_m",
    "pos_e_m",
    "pos_d_m",
    "vel_n_m_s",
    "vel_e_m_s",
    "vel_d_m_s",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
];

/// Biases of an IMU: three accelerometers, three gyroscopes.
pub const BIASES: usize = 6;

/// Column names of the biases, units included.
pub const BIAS_NAMES: [&str; BIASES] = [
    "b_ax_m_s2",
    "b_ay_m_s2",
    "b_az_m_s2",
    "b_gx_rad_s",
    "b_gy_rad_s",
    "b_gz_rad_s",
];

/// Errors that differ by less than this share from a filter's standard deviations are let pass.
pub const TOLERANCE: f64 = 0.1;

/// Degrees of freedom of the NEES: position, velocity, attitude.
pub const NEES_DOF: usize = 9;
/// Degrees of freedom of the coverage statistic: position, attitude
/// ([Cucci et al.](crate::bibliography::Cucci23)).
pub(crate) const COVERAGE_DOF: usize = 6;

/// Sums over runs at one reporting epoch (1 Hz), from which `metrics` makes means and their errors.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct EpochSums {
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// True if a GNSS fix was used at this epoch.
    pub gnss: bool,
    /// Runs summed (diverged runs are left out).
    pub count: u64,
    /// Σ SEE of each reported state: the square root of the filter's own variance (m, m/s, degrees).
    pub see: [f64; REPORTED],
    /// Σ SEE².
    pub see_sq: [f64; REPORTED],
    /// Σ SEE of each sensor's bias (m/s², rad/s).
    pub bias_see: [f64; BIASES],
    /// Σ error, estimate − truth (m, m/s, degrees).
    pub error: [f64; REPORTED],
    /// Error of run 0 alone; none in sums without it, or where it diverged.
    pub first_error: Option<[f64; REPORTED]>,
    /// Σ error².
    pub error_sq: [f64; REPORTED],
    /// Σ error⁴ (for the standard error of the RMSE).
    pub error_4: [f64; REPORTED],
    /// Σ and Σ² of the 3-D position error (m).
    pub pos_error: [f64; 2],
    /// Σ and Σ² of the attitude error ‖log(C_refᵀ C)‖ (degrees).
    pub att_error: [f64; 2],
    /// Σ and Σ² of the NEES over [`NEES_DOF`] states.
    pub nees: [f64; 2],
    /// Runs whose position and attitude error is inside the filter's ellipsoid at the coverage level.
    pub covered: u64,
}

/// Record of one run in one outage.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct OutageRecord {
    /// Mean over the outage's reporting epochs (start ≤ t < end) of the SEE of each reported state.
    pub see_mean: [f64; REPORTED],
    /// SEE of each reported state at the instant of `error_end`.
    pub see_end: [f64; REPORTED],
    /// Error of each reported state just before the first fix after the outage (or at the end).
    pub error_end: [f64; REPORTED],
    /// NEES over [`NEES_DOF`] states at the same instant.
    pub nees_end: f64,
    /// Logarithm of the density of the same errors (m, m/s, rad) under the filter's belief, a normal law (nats): a
    /// proper score, highest in the mean for the filter that is right.
    pub log_density_end: f64,
    /// Horizontal position error at the same instant (m).
    pub horizontal_error_end_m: f64,
    /// Time from the outage's end until the first report at which the horizontal error is within the
    /// receiver's own standard deviation (s); NaN if never.
    pub reconvergence_s: f64,
}

/// Record of one run.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct RunRecord {
    /// Run, counted from 0: with the seed it names every random number of the run.
    pub run: u64,
    /// True if state or covariance stopped being finite; such a run is in no sum.
    pub diverged: bool,
    /// One record an outage.
    pub outages: Vec<OutageRecord>,
    /// Mean NIS of its GNSS updates (per fix) and how many fixes.
    pub nis: (f64, u64),
    /// Mean over its reporting epochs of the NEES over [`NEES_DOF`] states.
    pub nees_mean: f64,
    /// Share of its reporting epochs inside the filter's ellipsoid at the coverage level.
    pub covered: f64,
    /// Mean over its reporting epochs of (error/SEE)² of each reported state.
    pub normalised_sq: [f64; REPORTED],
}

/// All runs of one experiment, reduced in run order.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct RunResult {
    /// Reporting epochs in time order.
    pub epochs: Vec<EpochSums>,
    /// Runs in run order.
    pub runs: Vec<RunRecord>,
    /// Outages (start, end) in seconds on the trajectory.
    pub outages: Vec<(f64, f64)>,
    /// States of the filter.
    pub filter_states: usize,
    /// Components of one fix: 3 (position) or 6 (and velocity): degrees of freedom of the NIS.
    pub fix_components: usize,
    /// Level of the coverage statistic.
    pub coverage_level: f64,
    /// IMU epochs processed, all runs.
    pub run_epochs: u64,
    /// Number of disjoint windows of the recordings that made the errors: more runs than these
    /// share their noise. None: every run has noise of its own.
    pub independent_windows: Option<f64>,
    /// The gains of the filter.
    #[serde(default)]
    pub gains: GainsUsed,
}
