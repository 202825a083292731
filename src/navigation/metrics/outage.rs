//! Statistics of one outage.

use super::epoch::{Accuracy, EpochMetrics, epochs};
use super::estimate::{Estimate, PerState, Quantile, quantile};
use crate::sensors::outage::Outage;
use crate::simulation::{OutageRecord, REPORTED, RunResult};
use crate::units::{DEG, STANDARD_GRAVITY};
use serde::{Deserialize, Serialize};

/// What the runs say about one outage (m, m/s, degrees, s).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutageMetrics {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
    /// Mean over the outage's epochs of the ASEE.
    pub asee_mean: PerState<Estimate>,
    /// Mean over the outage's epochs of the RMSE (NaN where the epochs were not kept).
    pub rmse_mean: PerState<Estimate>,
    /// ASEE just before the first fix after the outage.
    pub asee_end: PerState<Estimate>,
    /// Mean NEES at the same instant.
    pub nees_end: Estimate,
    /// Mean logarithm of the density of the errors under the filter's belief there (nats).
    pub log_density_end: Estimate,
    /// Root mean square error just before the first fix after the outage.
    pub rmse_end: PerState<Estimate>,
    /// Horizontal error there: median.
    pub horizontal_p50_m: Quantile,
    /// 95 % quantile.
    pub horizontal_p95_m: Quantile,
    /// 99.9 % quantile; of a covariance analysis only.
    pub horizontal_p999_m: Option<f64>,
    /// Largest; NaN of a covariance analysis, whose law has no end.
    pub horizontal_max_m: f64,
    /// Whether covariance analysis finds errors in it that are beyond linear theory.
    pub beyond_linear: bool,
    /// How soon the runs recover.
    pub reconvergence: Reconvergence,
}

/// Time from the outage's end until the error is back to what it was (s).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reconvergence {
    /// Median over the runs that recover.
    pub p50_s: Quantile,
    /// 95 % quantile over the runs that recover.
    pub p95_s: Quantile,
    /// Runs that do not recover before the trajectory or the next outage ends their chance; none of a covariance
    /// analysis, which follows no run.
    pub never: Option<u64>,
}

/// Statistics of every outage, diverged runs left out.
#[must_use]
pub fn outages(result: &RunResult) -> Vec<OutageMetrics> {
    let kept = || result.runs.iter().filter(|r| !r.diverged);
    let epochs = epochs(result);
    let metrics_of_outage = |(i, window): (usize, &(f64, f64))| {
        let records: Vec<&OutageRecord> = kept().filter_map(|r| r.outages.get(i)).collect();
        let mut metrics = outage(*window, &records, result.independent_windows);
        metrics.rmse_mean = Accuracy::over(within(*window, &epochs)).rmse_mean;
        metrics
    };
    result
        .outages
        .iter()
        .enumerate()
        .map(metrics_of_outage)
        .collect()
}

/// The epochs without a fix of an outage.
pub(super) fn within(
    (start_s, end_s): (f64, f64),
    epochs: &[EpochMetrics],
) -> impl Iterator<Item = &EpochMetrics> + Clone {
    let outage = Outage { start_s, end_s };
    epochs.iter().filter(move |e| outage.withholds(e.t_s))
}

/// Whether tilts in an outage shift the velocity down by more than 0.3 of the standard deviation that linear theory gives it
/// at the end, `sigma_m_s`.
///
/// A tilt ψ shortens what is left upright of the specific force to g cos ψ: the vehicle seems to accelerate downwards with
/// gψ²/2, whatever the sign of ψ, which no linear analysis contains. Below 0.3, runs were as it expects them to 10 %.
pub(super) fn is_beyond_linear(
    window: (f64, f64),
    epochs: &[EpochMetrics],
    sigma_m_s: f64,
) -> bool {
    let tilts = |epoch: &EpochMetrics| {
        TILT.map(|i| (epoch.rmse.0[i].value * DEG).powi(2))
            .iter()
            .sum::<f64>()
    };
    let (sum, count) =
        within(window, epochs).fold((0.0, 0), |(sum, count), e| (sum + tilts(e), count + 1));
    let shift_m_s = STANDARD_GRAVITY / 2.0 * sum / f64::from(count) * (window.1 - window.0);
    shift_m_s > 0.3 * sigma_m_s
}

/// Roll and pitch among the reported states.
const TILT: [usize; 2] = [6, 7];

/// Statistics of an outage from the records of the runs; what needs the epochs is NaN.
fn outage(
    (start_s, end_s): (f64, f64),
    records: &[&OutageRecord],
    windows: Option<f64>,
) -> OutageMetrics {
    let horizontal = sorted(records.iter().map(|r| r.horizontal_error_end_m));
    // Runs that never recover have NaN here. They are counted apart: no finite time stands for them.
    let recovery = sorted(
        records
            .iter()
            .map(|r| r.reconvergence_s)
            .filter(|s| s.is_finite()),
    );
    let mean = |value: &dyn Fn(&OutageRecord) -> f64| {
        Estimate::mean_of(records.iter().map(|r| value(r)), windows)
    };
    let per_state = |f: &dyn Fn(usize) -> Estimate| PerState(std::array::from_fn(f));
    OutageMetrics {
        start_s,
        end_s,
        asee_mean: per_state(&|i| mean(&|r| r.see_mean[i])),
        rmse_mean: PerState(
            [Estimate {
                value: f64::NAN,
                std_error: f64::NAN,
            }; REPORTED],
        ),
        asee_end: per_state(&|i| mean(&|r| r.see_end[i])),
        nees_end: mean(&|r| r.nees_end),
        log_density_end: mean(&|r| r.log_density_end),
        // Mean square first, then the root: the standard error is linearised once, at the root.
        rmse_end: per_state(&|i| mean(&|r| r.error_end[i].powi(2)).root()),
        horizontal_p50_m: quantile(&horizontal, 0.5, windows),
        horizontal_p95_m: quantile(&horizontal, 0.95, windows),
        horizontal_p999_m: None,
        horizontal_max_m: horizontal.last().copied().unwrap_or(f64::NAN),
        beyond_linear: false,
        reconvergence: Reconvergence {
            p50_s: quantile(&recovery, 0.5, windows),
            p95_s: quantile(&recovery, 0.95, windows),
            never: Some((records.len() - recovery.len()) as u64),
        },
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{EpochSums, RunRecord};

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
        let metrics = &outages(&result)[0];
        assert_eq!(metrics.asee_mean.0[1].value, 3.0);
        assert!((metrics.rmse_end.0[4].value - (35.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(
            (metrics.asee_end.0[1].value, metrics.nees_end.value),
            (6.0, 27.0)
        );
        assert_eq!(metrics.log_density_end.value, -3.0);
        assert_eq!(
            (metrics.horizontal_p50_m.value, metrics.horizontal_max_m),
            (3.0, 5.0)
        );
        assert_eq!(
            (
                metrics.reconvergence.p50_s.value,
                metrics.reconvergence.never
            ),
            (2.0, Some(1))
        );
    }

    /// Two tilts of 1° that stand still for 100 s: g·(1°)²·100 s = 0.2987 m/s, against 0.3 of a standard deviation.
    #[test]
    fn tilts_beyond_linear_theory_in_closed_form() {
        let sums = |t: u32| EpochSums {
            t_s: f64::from(t),
            count: 1,
            ..EpochSums::default()
        };
        let result = RunResult {
            epochs: (0..=100).map(sums).collect(),
            ..RunResult::default()
        };
        let mut epochs = epochs(&result);
        for epoch in &mut epochs {
            TILT.iter().for_each(|i| {
                epoch.rmse.0[*i] = Estimate {
                    value: 1.0,
                    std_error: 0.0,
                }
            });
        }
        let is_beyond = |sigma_m_s: f64| is_beyond_linear((0.0, 100.0), &epochs, sigma_m_s);
        assert!(is_beyond(0.298 / 0.3) && !is_beyond(0.299 / 0.3));
        assert!(!is_beyond_linear((200.0, 300.0), &epochs, 1e-3));
    }

    #[test]
    fn no_run_left_is_no_number() {
        let result = RunResult {
            runs: vec![run(0, 1.0, true)],
            outages: vec![(0.0, 1.0)],
            ..RunResult::default()
        };
        let metrics = &outages(&result)[0];
        assert!(metrics.asee_mean.0[0].value.is_nan() && metrics.horizontal_max_m.is_nan());
    }
}
