//! Statistics at one reporting epoch.

use super::estimate::{Estimate, PerState};
use crate::simulation::EpochSums;

/// What the runs say at one epoch (m, m/s, degrees).
#[derive(Debug, Clone, PartialEq)]
pub struct EpochMetrics {
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// Whether a fix was used.
    pub gnss: bool,
    /// Runs behind the numbers.
    pub count: u64,
    /// Averaged standard estimation error: mean over runs of the filter's own standard deviation
    /// ([Minaretzis et al.](crate::bibliography::Minaretzis24), Section V).
    pub asee: PerState<Estimate>,
    /// Root mean square error.
    pub rmse: PerState<Estimate>,
    /// Mean error, estimate − truth.
    pub bias: PerState<Estimate>,
    /// Mean 3-D position error (m).
    pub mean_pos_err_m: Estimate,
    /// Mean attitude error (degrees).
    pub mean_att_err_deg: Estimate,
    /// Mean NEES of position, velocity and attitude.
    pub nees: Estimate,
    /// Share of runs inside the filter's ellipsoid at the coverage level.
    pub coverage: f64,
}

impl From<&EpochSums> for EpochMetrics {
    fn from(s: &EpochSums) -> Self {
        let mean = |sum, sum_sq| Estimate::mean(s.count, sum, sum_sq);
        let per_state = |f: &dyn Fn(usize) -> Estimate| PerState(std::array::from_fn(f));
        Self {
            t_s: s.t_s,
            gnss: s.gnss,
            count: s.count,
            asee: per_state(&|i| mean(s.see[i], s.see_sq[i])),
            rmse: per_state(&|i| Estimate::root_mean_square(s.count, s.error_sq[i], s.error_4[i])),
            bias: per_state(&|i| mean(s.error[i], s.error_sq[i])),
            mean_pos_err_m: mean(s.pos_error[0], s.pos_error[1]),
            mean_att_err_deg: mean(s.att_error[0], s.att_error[1]),
            nees: mean(s.nees[0], s.nees[1]),
            coverage: s.covered as f64 / s.count as f64,
        }
    }
}

/// Statistics of every epoch.
#[must_use]
pub fn epochs(sums: &[EpochSums]) -> Vec<EpochMetrics> {
    sums.iter().map(EpochMetrics::from).collect()
}
