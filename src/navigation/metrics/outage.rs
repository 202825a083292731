//! Statistics of one outage.

use super::estimate::{Estimate, PerState, SampleSize, quantile_interval, sample_quantile};
use super::summary::{AccuracySummary, OutageSummary, QuantileSummary, Recovery};
use crate::linalg::mean;
use crate::sensors::outage::Outage;
use crate::simulation::lincov::{AssessedInstant, FilterPass, NamedSource};
use crate::simulation::{BIASES, EpochSums, OutageRecord, REPORTED, RunResult};
use crate::units::STANDARD_GRAVITY;
use rayon::prelude::*;
use serde::{Serialize, Serializer};

/// Statistics of every outage, diverged runs left out.
pub(super) fn outages(result: &RunResult, epochs: &[EpochMetrics]) -> Vec<OutageSummary> {
    let windows = result.independent_windows;
    let kept = || result.runs.iter().filter(|r| !r.diverged);
    let of_outage = |(i, window): (usize, &(f64, f64))| {
        let records: Vec<&OutageRecord> = kept().filter_map(|r| r.outages.get(i)).collect();
        let horizontal = sorted(records.iter().map(|r| r.horizontal_error_end_m));
        // Runs that never recover have NaN here. They are counted apart: no finite time stands for them.
        let times = records.iter().map(|r| r.reconvergence_s);
        let recovery = sorted(times.filter(|s| s.is_finite()));
        let mean = |value: &dyn Fn(&OutageRecord) -> f64| {
            Estimate::mean_of(records.iter().map(|r| value(r)), windows)
        };
        let per_state = |f: &dyn Fn(usize) -> Estimate| PerState::split(std::array::from_fn(f));
        let [asee_mean, asee_mean_std_error] = per_state(&|i| mean(&|r| r.see_mean[i]));
        let [asee_end, asee_end_std_error] = per_state(&|i| mean(&|r| r.see_end[i]));
        // Mean square first, then the root: the standard error is linearised once, at the root.
        let [rmse_end, rmse_end_std_error] =
            per_state(&|i| mean(&|r| r.error_end[i].powi(2)).root());
        let accuracy = AccuracySummary::over(within(*window, epochs));
        let (nees, density) = (mean(&|r| r.nees_end), mean(&|r| r.log_density_end));
        OutageSummary {
            start_s: window.0,
            end_s: window.1,
            asee_mean,
            asee_mean_std_error,
            rmse_mean: accuracy.rmse_mean,
            rmse_mean_std_error: accuracy.rmse_mean_std_error,
            asee_end,
            asee_end_std_error,
            rmse_end,
            rmse_end_std_error,
            nees_end: nees.value,
            nees_end_std_error: nees.std_error,
            log_density_end: density.value,
            log_density_end_std_error: density.std_error,
            horizontal_error_end_m: QuantileSummary {
                p50: sample_quantile(&horizontal, 0.5),
                p95: sample_quantile(&horizontal, 0.95),
                p999: None,
                max: horizontal.last().copied().unwrap_or(f64::NAN),
                p50_ci95: quantile_interval(&horizontal, 0.5, windows),
                p95_ci95: quantile_interval(&horizontal, 0.95, windows),
            },
            reconvergence_s: Recovery {
                p50: sample_quantile(&recovery, 0.5),
                p95: sample_quantile(&recovery, 0.95),
                never: Some((records.len() - recovery.len()) as u64),
            },
            ..OutageSummary::default()
        }
    };
    result.outages.iter().enumerate().map(of_outage).collect()
}

/// The epochs without a fix of an outage.
pub(super) fn within(
    (start_s, end_s): (f64, f64),
    epochs: &[EpochMetrics],
) -> impl Iterator<Item = &EpochMetrics> + Clone {
    let outage = Outage { start_s, end_s };
    epochs.iter().filter(move |e| outage.withholds(e.t_s))
}

/// Returns true if tilts in an outage shift the down velocity by more than 0.3 of its standard
/// deviation at the end by linear theory, `sigma_m_s`.
///
/// A tilt ψ reduces the vertical component of the specific force to g cos ψ: the vehicle seems to
/// accelerate downwards with gψ²/2, whatever the sign of ψ, which no linear analysis contains.
/// Below 0.3, runs agreed with linear theory to 10 %.
pub(super) fn is_beyond_linear(
    outage: &Outage,
    reports: &[AssessedInstant],
    sigma_m_s: f64,
) -> bool {
    let within = reports.iter().filter(|r| outage.withholds(r.errors.t_s));
    let tilt_sq = |report: &AssessedInstant| {
        let moments = report.errors.moments();
        TILT.map(|i| moments[i][i]).iter().sum::<f64>()
    };
    let lasts_s = outage.end_s - outage.start_s;
    let shift_m_s = STANDARD_GRAVITY / 2.0 * mean(within.map(tilt_sq)) * lasts_s;
    shift_m_s > 0.3 * sigma_m_s
}

/// North and east components of psi_n among the states: near the vertical roll is no tilt.
const TILT: [usize; 2] = [6, 7];

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

// Statistics at one reporting epoch.

/// Statistics of the runs at one epoch (m, m/s, degrees).
#[derive(Debug, Clone)]
pub struct EpochMetrics {
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// True if a fix was used.
    pub gnss: bool,
    /// Runs behind the numbers.
    pub count: u64,
    /// Averaged standard estimation error: mean over runs of the filter's own standard deviation
    /// ([Minaretzis et al.](crate::bibliography::Minaretzis24), Section V).
    pub asee: PerState<Estimate>,
    /// ASEE of each sensor's bias (m/s², rad/s).
    pub bias_asee: [f64; BIASES],
    /// Root mean square error.
    pub rmse: PerState<Estimate>,
    /// Mean error, estimate − truth.
    pub bias: PerState<Estimate>,
    /// Error of run 0, estimate − truth; none where it diverged, or of expected values.
    pub first_error: Option<[f64; REPORTED]>,
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
            first_error: s.first_error,
            mean_pos_err_m: mean(s.pos_error[0], s.pos_error[1]),
            mean_att_err_deg: mean(s.att_error[0], s.att_error[1]),
            nees: mean(s.nees[0], s.nees[1]),
            coverage: s.covered as f64 / s.count as f64,
        }
    }
}

/// Statistics of every epoch.
pub fn epochs(result: &RunResult) -> Vec<EpochMetrics> {
    result
        .epochs
        .iter()
        .map(|sums| EpochMetrics::of(sums, result.independent_windows))
        .collect()
}

impl AccuracySummary {
    /// Over some epochs. The standard errors are upper bounds, the mean of those of the epochs: epochs of a run are strongly
    /// correlated.
    pub(super) fn over<'a>(epochs: impl Iterator<Item = &'a EpochMetrics> + Clone) -> Self {
        let mean = |of: &dyn Fn(&EpochMetrics, usize) -> f64| {
            let of_state = |i| mean(epochs.clone().map(|e| of(e, i)));
            PerState(std::array::from_fn(of_state))
        };
        Self {
            asee_mean: mean(&|e, i| e.asee.0[i].value),
            rmse_mean: mean(&|e, i| e.rmse.0[i].value),
            rmse_mean_std_error: mean(&|e, i| e.rmse.0[i].std_error),
        }
    }
}

// Error budgets: which share of the mean square of the errors each of their sources has.

/// Shares of independent sources in the mean square of each reported state; of a state they sum to 1. In files an
/// object with the names of the sources as keys.
#[derive(Debug, Clone)]
pub struct Budget {
    /// Every source with its shares.
    pub shares: Vec<(String, PerState<f64>)>,
    /// Mean squares, all sources together (m², (m/s)², degrees²).
    pub total: [f64; REPORTED],
}

impl Budget {
    /// Just before the first fix after each outage: every source goes alone through the gains of one filter.
    pub fn at_outage_ends(filter: &FilterPass<'_>, sources: &[NamedSource]) -> Vec<Self> {
        let squares = |source: &NamedSource| -> (String, Vec<[f64; REPORTED]>) {
            // Mean squares, not variances: a deterministic source (drift) has a mean and no variance.
            let squares = |end: &AssessedInstant| end.errors.variances(&end.errors.moments());
            let ends = filter.errors_at_ends(&source.side);
            (source.name.clone(), ends.iter().map(squares).collect())
        };
        let mut all: Vec<(String, Vec<[f64; REPORTED]>)> =
            sources.par_iter().map(squares).collect();
        all.retain(|(_, ends)| ends.iter().flatten().any(|square| *square != 0.0));
        let outages = all.first().map_or(0, |(_, ends)| ends.len());
        let budget = |k: usize| {
            let total = std::array::from_fn(|i| all.iter().map(|(_, ends)| ends[k][i]).sum());
            let share = |(name, ends): &(String, Vec<[f64; REPORTED]>)| {
                let shares = std::array::from_fn(|i| ends[k][i] / total[i]);
                (name.clone(), PerState(shares))
            };
            let shares = all.iter().map(share).collect();
            Self { shares, total }
        };
        (0..outages).map(budget).collect()
    }

    /// Shares in the sum of the mean squares of some states (horizontal position: 0 and 1), the largest first.
    pub fn ranked(&self, states: &[usize]) -> Vec<(&str, f64)> {
        let whole: f64 = states.iter().map(|i| self.total[*i]).sum();
        let share = |of: &PerState<f64>| {
            states
                .iter()
                .map(|i| of.0[*i] * self.total[*i])
                .sum::<f64>()
                / whole
        };
        let mut all: Vec<(&str, f64)> = self
            .shares
            .iter()
            .map(|(name, of)| (name.as_str(), share(of)))
            .collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all
    }
}

impl Serialize for Budget {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.shares.iter().map(|(name, share)| (name, share)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::RunRecord;
    use crate::units::DEG;
    use approx::assert_abs_diff_eq;

    fn run(run: u64, value: f64, diverged: bool) -> RunRecord {
        let record = OutageRecord {
            see_mean: [value; 9],
            error_end: [-value; 9],
            horizontal_error_end_m: value,
            reconvergence_s: if value > 4.0 { f64::NAN } else { value },
            see_end: [2.0 * value; 9],
            nees_end: 9.0 * value,
            log_density_end: -value,
        };
        RunRecord {
            run,
            diverged,
            outages: vec![record],
            nis: (6.0, 1),
            ..RunRecord::default()
        }
    }

    #[test]
    fn diverged_runs_are_left_out_and_lost_ones_counted() {
        let runs = vec![
            run(0, 1.0, false),
            run(1, 1e9, true),
            run(2, 5.0, false),
            run(3, 3.0, false),
        ];
        let result = RunResult {
            runs,
            outages: vec![(300.0, 390.0)],
            ..RunResult::default()
        };
        let metrics = &outages(&result, &[])[0];
        assert_eq!(metrics.asee_mean.0[1], 3.0);
        assert_abs_diff_eq!(
            metrics.rmse_end.0[4],
            (35.0_f64 / 3.0).sqrt(),
            epsilon = 1e-15
        );
        assert_eq!((metrics.asee_end.0[1], metrics.nees_end), (6.0, 27.0));
        assert_eq!(metrics.log_density_end, -3.0);
        let (horizontal, back) = (&metrics.horizontal_error_end_m, &metrics.reconvergence_s);
        assert_eq!((horizontal.p50, horizontal.max), (3.0, 5.0));
        assert_eq!((back.p50, back.never), (2.0, Some(1)));
    }

    /// Tilts of 1° about north and east that stand still for 100 s, at any roll and pitch: g·(1°)²·100 s = 0.2987 m/s, against 0.3 of a standard deviation.
    #[test]
    fn tilts_beyond_linear_theory_in_closed_form() {
        let report = |t: u32| {
            let mut report = AssessedInstant::default();
            report.errors.t_s = f64::from(t);
            (report.errors.mean[6], report.errors.covariance[7][7]) = (DEG, DEG * DEG);
            report
        };
        let reports: Vec<AssessedInstant> = (0..=100).map(report).collect();
        let is_beyond = |start_s: f64, sigma_m_s: f64| {
            let end_s = start_s + 100.0;
            is_beyond_linear(&Outage { start_s, end_s }, &reports, sigma_m_s)
        };
        assert!(is_beyond(0.0, 0.298 / 0.3) && !is_beyond(0.0, 0.299 / 0.3));
        assert!(!is_beyond(200.0, 1e-3));
    }

    #[test]
    fn no_run_left_is_no_number() {
        let result = RunResult {
            runs: vec![run(0, 1.0, true)],
            outages: vec![(0.0, 1.0)],
            ..RunResult::default()
        };
        let metrics = &outages(&result, &[])[0];
        assert!(metrics.asee_mean.0[0].is_nan() && metrics.horizontal_error_end_m.max.is_nan());
    }
}

#[cfg(test)]
mod epoch_tests {
    use super::*;
    use crate::simulation::REPORTED;
    use approx::assert_abs_diff_eq;

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

    /// The accuracy of a run is the mean of its epochs.
    #[test]
    fn an_epoch_of_two_runs_in_closed_form() {
        let e = EpochMetrics::of(&two_runs(), None);
        assert_eq!(
            (e.asee.0[3].value, e.rmse.0[3].value, e.bias.0[3].value),
            (2.0, 5.0, -3.0)
        );
        assert_abs_diff_eq!(e.asee.0[3].std_error, 1.0, epsilon = 1e-15);
        assert_eq!(e.bias_asee, [0.25; BIASES]);
        // squares 1 and 49: standard deviation 24 √2, of their mean 24, of its root 24/(2·5)
        assert_abs_diff_eq!(e.rmse.0[3].std_error, 2.4, epsilon = 1e-14);
        assert_eq!(
            (e.nees.value, e.nees.std_error, e.coverage),
            (10.0, 2.0, 0.5)
        );
        let later = EpochSums {
            see: [12.0; REPORTED],
            error_sq: [2.0 * 81.0; REPORTED],
            ..two_runs()
        };
        let accuracy = AccuracySummary::over([e, EpochMetrics::of(&later, None)].iter());
        assert_eq!(
            (accuracy.asee_mean.0[0], accuracy.rmse_mean.0[8]),
            (4.0, 7.0)
        );
    }
}
