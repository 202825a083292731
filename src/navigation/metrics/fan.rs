//! Quantiles of the horizontal position error over time.

use super::estimate::sample_quantile;
use super::expected::horizontal_quantiles;
use crate::sensors::outage::Outage;
use crate::simulation::lincov::{FilterPass, Instant, TruthSide};
use crate::simulation::{RunRecord, RunResult, fan_epochs};
use rayon::prelude::*;

/// Probabilities of the quantiles.
pub const FAN_LEVELS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// The horizontal error at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct FanEpoch {
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// Its quantiles at [`FAN_LEVELS`] (m): over the runs, or of a covariance analysis without runs.
    pub quantiles_m: [f64; FAN_LEVELS.len()],
    /// What covariance analysis expects of them, where it stands beside runs.
    pub lincov_m: Option<[f64; FAN_LEVELS.len()]>,
}

/// Over the runs that did not diverge, at the times at which their errors were kept, and just before the first fix after
/// each outage, where errors are largest: that row stands before the one after the fix, at the same time.
#[must_use]
pub fn fan(result: &RunResult) -> Vec<FanEpoch> {
    // Runs after the hundred thousandth have no errors over time: they are left out at the ends as well, so
    // that the band is of one set of runs.
    let kept: Vec<&RunRecord> = result
        .runs
        .iter()
        .filter(|run| !run.diverged && !run.horizontal_m.is_empty())
        .collect();
    let epoch = |t_s: f64, error: &dyn Fn(&RunRecord) -> f64| {
        let mut errors: Vec<f64> = kept.iter().map(|run| error(run)).collect();
        errors.sort_unstable_by(f64::total_cmp);
        let quantiles_m = FAN_LEVELS.map(|p| sample_quantile(&errors, p));
        FanEpoch {
            t_s,
            quantiles_m,
            lincov_m: None,
        }
    };
    let over_time = result.fan_t_s.par_iter().enumerate();
    let over_time = over_time
        .map(|(k, t_s)| epoch(*t_s, &|run| f64::from(run.horizontal_m[k])))
        .collect();
    let ends = result.outage_fix_t_s.iter().enumerate();
    with_ends(
        over_time,
        ends.map(|(k, t_s)| epoch(*t_s, &|run| run.outages[k].horizontal_error_end_m)),
    )
}

/// The quantiles of a filter's errors by covariance analysis, at the same times.
#[must_use]
pub fn expected_fan(
    filter: &FilterPass<'_>,
    truth: &TruthSide,
    outages: &[Outage],
) -> Vec<FanEpoch> {
    let law = filter.errors(truth);
    let times: Vec<f64> = law.reports.iter().map(|report| report.errors.t_s).collect();
    let epoch = |instant: &Instant| {
        let quantiles_m = horizontal_quantiles(instant, FAN_LEVELS);
        FanEpoch {
            t_s: instant.t_s,
            quantiles_m,
            lincov_m: None,
        }
    };
    let over_time = fan_epochs(&times, outages)
        .par_iter()
        .map(|i| epoch(&law.reports[*i].errors))
        .collect();
    with_ends(
        over_time,
        law.outage_ends.iter().map(|end| epoch(&end.errors)),
    )
}

/// Puts the ends of outages into their places in time, before what comes after the fix.
fn with_ends(mut epochs: Vec<FanEpoch>, ends: impl Iterator<Item = FanEpoch>) -> Vec<FanEpoch> {
    for end in ends {
        // Strictly before: the end of an outage comes ahead of the report after the fix at the same time.
        epochs.insert(epochs.partition_point(|epoch| epoch.t_s < end.t_s), end);
    }
    epochs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::OutageRecord;

    /// Runs of the errors 0, 1, …, 20 m: the quantile at p is 20 p, and ten times that just before the fix at 4 s that ends an
    /// outage. One that diverged is left out.
    #[test]
    fn quantiles_over_the_runs_that_are_left() {
        let run = |run: u16, diverged| RunRecord {
            run: u64::from(run),
            diverged,
            outages: vec![OutageRecord {
                horizontal_error_end_m: 10.0 * f64::from(run),
                ..OutageRecord::default()
            }],
            horizontal_m: vec![f32::from(run), 2.0 * f32::from(20 - run.min(20))],
            ..RunRecord::default()
        };
        let runs = (0..=20)
            .map(|k| run(k, false))
            .chain([run(21, true)])
            .collect();
        let result = RunResult {
            runs,
            fan_t_s: vec![3.0, 4.0],
            outage_fix_t_s: vec![4.0],
            ..RunResult::default()
        };
        let fan = fan(&result);
        assert_eq!(fan[0].quantiles_m, [1.0, 5.0, 10.0, 15.0, 19.0]);
        assert_eq!(
            (fan[1].t_s, fan[1].quantiles_m),
            (4.0, [10.0, 50.0, 100.0, 150.0, 190.0])
        );
        assert_eq!(
            (fan[2].t_s, fan[2].quantiles_m),
            (4.0, [2.0, 10.0, 20.0, 30.0, 38.0])
        );
    }

    #[test]
    fn no_run_left_is_no_number() {
        let result = RunResult {
            fan_t_s: vec![0.0],
            ..RunResult::default()
        };
        assert!(fan(&result)[0].quantiles_m.iter().all(|q| q.is_nan()));
    }

    /// A quarter of an hour by the third second, and on both sides of where fixes end and begin again.
    #[test]
    fn epochs_are_few_and_hold_the_ends_of_outages() {
        let times: Vec<f64> = (0..=900).map(f64::from).collect();
        let outage = Outage {
            start_s: 301.0,
            end_s: 389.5,
        };
        let kept = fan_epochs(&times, &[outage]);
        assert!((301..=305).contains(&kept.len()), "{}", kept.len());
        assert!(
            [0, 300, 301, 389, 390, 900]
                .iter()
                .all(|t| kept.contains(t))
                && !kept.contains(&302)
        );
        assert!(kept.is_sorted_by(|a, b| a < b));
        assert_eq!(fan_epochs(&times[..400], &[]), (0..400).collect::<Vec<_>>());
        assert!(fan_epochs(&[], &[]).is_empty());
    }
}
