//! Statistics at one reporting epoch.

use super::estimate::{Estimate, PerState, SampleSize};
use crate::simulation::{BIASES, EpochSums, RunResult};
use serde::{Deserialize, Serialize};

/// What the runs say at one epoch (m, m/s, degrees).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// The same of each sensor's bias (m/s², rad/s).
    pub bias_asee: [f64; BIASES],
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

impl EpochMetrics {
    fn of(s: &EpochSums, windows: Option<f64>) -> Self {
        let size = SampleSize::of(s.count, windows);
        let mean = |sum, sum_sq| Estimate::mean(size, sum, sum_sq);
        let per_state = |f: &dyn Fn(usize) -> Estimate| PerState(std::array::from_fn(f));
        Self {
            t_s: s.t_s,
            gnss: s.gnss,
            count: s.count,
            asee: per_state(&|i| mean(s.see[i], s.see_sq[i])),
            bias_asee: s.bias_see.map(|sum| sum / s.count as f64),
            rmse: per_state(&|i| Estimate::root_mean_square(size, s.error_sq[i], s.error_4[i])),
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
pub fn epochs(result: &RunResult) -> Vec<EpochMetrics> {
    result
        .epochs
        .iter()
        .map(|sums| EpochMetrics::of(sums, result.independent_windows))
        .collect()
}

/// ASEE and RMSE as means over epochs, the one beside the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// Mean over the epochs of the ASEE.
    pub asee_mean: PerState<Estimate>,
    /// Mean over the epochs of the RMSE: like the ASEE a mean of standard deviations, so that their ratio is 1
    /// for a right filter, however fast both grow.
    pub rmse_mean: PerState<Estimate>,
}

impl Accuracy {
    /// Over some epochs. The standard errors are upper bounds: as if all epochs erred together.
    pub(crate) fn over<'a>(epochs: impl Iterator<Item = &'a EpochMetrics> + Clone) -> Self {
        let n = epochs.clone().count() as f64;
        let mean = |of: &dyn Fn(&EpochMetrics) -> Estimate| Estimate {
            value: epochs.clone().map(|e| of(e).value).sum::<f64>() / n,
            // The mean of the errors, not the root of the sum of their squares: epochs of a run are strongly
            // correlated.
            std_error: epochs.clone().map(|e| of(e).std_error).sum::<f64>() / n,
        };
        Self {
            asee_mean: PerState(std::array::from_fn(|i| mean(&|e| e.asee.0[i]))),
            rmse_mean: PerState(std::array::from_fn(|i| mean(&|e| e.rmse.0[i]))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::REPORTED;

    /// Two runs of SEE 1 and 3, errors 1 and −7: ASEE is the mean 2 (not the root mean square √5), its standard
    /// error √2/√2; RMSE √25, bias −3; NEES 8 and 12.
    fn two_runs() -> EpochSums {
        EpochSums {
            count: 2,
            see: [4.0; REPORTED],
            see_sq: [10.0; REPORTED],
            bias_see: [0.5; BIASES],
            error: [-6.0; REPORTED],
            error_sq: [50.0; REPORTED],
            error_4: [2402.0; REPORTED],
            nees: [20.0, 208.0],
            covered: 1,
            ..EpochSums::default()
        }
    }

    #[test]
    fn an_epoch_of_two_runs_in_closed_form() {
        let e = EpochMetrics::of(&two_runs(), None);
        assert_eq!(
            (e.asee.0[3].value, e.rmse.0[3].value, e.bias.0[3].value),
            (2.0, 5.0, -3.0)
        );
        assert!((e.asee.0[3].std_error - 1.0).abs() < 1e-15);
        assert_eq!(e.bias_asee, [0.25; BIASES]);
        // squares 1 and 49: standard deviation 24 √2, of their mean 24, of its root 24/(2·5)
        assert!(
            (e.rmse.0[3].std_error - 2.4).abs() < 1e-14,
            "{:?}",
            e.rmse.0[3]
        );
        assert_eq!(
            (e.nees.value, e.nees.std_error, e.coverage),
            (10.0, 2.0, 0.5)
        );
    }

    #[test]
    fn accuracy_is_the_mean_of_standard_deviations() {
        let mut later = two_runs();
        later.see = [12.0; REPORTED];
        later.error_sq = [2.0 * 81.0; REPORTED];
        let all = [
            EpochMetrics::of(&two_runs(), None),
            EpochMetrics::of(&later, None),
        ];
        let accuracy = Accuracy::over(all.iter());
        assert_eq!(
            (accuracy.asee_mean.0[0].value, accuracy.rmse_mean.0[8].value),
            (4.0, 7.0)
        );
    }
}
