//! The summary of an experiment: what `summary.json` holds.

use super::consistency::{Band, chi_square_band, coverage_band};
use super::epoch::EpochMetrics;
use super::estimate::{Estimate, PerState, Quantile};
use super::outage::{self, OutageMetrics};
use super::reduction::ReductionSummary;
use crate::simulation::{NEES_DOF, RunResult};
use serde::Serialize;

/// Version of the layout of `summary.json`.
const SCHEMA_VERSION: u32 = 1;

/// What the user reads first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Layout version.
    pub schema_version: u32,
    /// "monte-carlo".
    pub method: &'static str,
    /// Runs, diverged ones included.
    pub runs: u64,
    /// Runs whose state or covariance stopped being finite; they are in no other number.
    pub diverged: u64,
    /// Their indices: with the seed, each can be repeated.
    pub diverged_runs: Vec<u64>,
    /// States of the filter.
    pub filter_states: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Outages in time order.
    pub outages: Vec<OutageSummary>,
    /// Normalised estimation error squared of position, velocity and attitude.
    pub nees: Consistency,
    /// Normalised innovation squared of the fixes.
    pub nis: Nis,
    /// Share of runs inside the filter's ellipsoid of position and attitude.
    pub coverage: Coverage,
    /// What the reduction to 15 states leaves of the model; none for the full filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reduction: Option<ReductionSummary>,
    /// IMU epochs a second, all runs together; only known to who measured it.
    pub throughput_epochs_per_s: f64,
}

/// One outage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutageSummary {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
    /// Mean over the outage's epochs of the ASEE.
    pub asee_mean: PerState<f64>,
    /// Its Monte-Carlo standard error.
    pub asee_mean_std_error: PerState<f64>,
    /// RMSE just before the first fix after the outage.
    pub rmse_end: PerState<f64>,
    /// Its Monte-Carlo standard error.
    pub rmse_end_std_error: PerState<f64>,
    /// Horizontal error at the same instant.
    pub horizontal_error_end_m: Spread,
    /// Time until the error is back to what it was before.
    pub reconvergence_s: Recovery,
}

/// Quantiles of a distribution over runs, with distribution-free 95 % intervals (null: too few runs).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub p50: f64,
    /// 95 % quantile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Interval of the median.
    pub p50_ci95: (Option<f64>, Option<f64>),
    /// Interval of the 95 % quantile.
    pub p95_ci95: (Option<f64>, Option<f64>),
}

/// Quantiles over the runs that recover, and how many do not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Recovery {
    /// Median.
    pub p50: f64,
    /// 95 % quantile.
    pub p95: f64,
    /// Runs that never recover.
    pub never: u64,
}

/// Whether a chi-square statistic is where a correct filter puts it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Consistency {
    /// Degrees of freedom: what a correct filter's mean is.
    pub dof: usize,
    /// Mean over epochs and runs.
    pub mean: f64,
    /// 95 % band of the mean over the runs at one epoch.
    pub lower95: f64,
    /// Its upper end.
    pub upper95: f64,
    /// Share of epochs whose mean lies in the band.
    pub fraction_inside: f64,
}

/// Normalised innovation squared, all fixes of all runs together (independent for a correct filter).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Nis {
    /// Degrees of freedom of one fix.
    pub dof: usize,
    /// Mean over fixes and runs.
    pub mean: f64,
    /// 95 % band of that mean.
    pub lower95: f64,
    /// Its upper end.
    pub upper95: f64,
    /// Fixes used.
    pub fixes: u64,
    /// Fixes refused by the gate on the NIS.
    pub rejected: u64,
}

/// Empirical coverage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Coverage {
    /// Nominal level.
    pub level: f64,
    /// Mean over epochs.
    pub mean: f64,
    /// 95 % band of the share at one epoch if the level is true.
    pub lower95: f64,
    /// Its upper end.
    pub upper95: f64,
    /// Share of epochs in the band.
    pub fraction_inside: f64,
}

impl Summary {
    /// The summary of a Monte-Carlo experiment that took `wall_s` seconds.
    #[must_use]
    pub fn of(result: &RunResult, epochs: &[EpochMetrics], seed: u64, wall_s: f64) -> Self {
        let diverged_runs: Vec<u64> = result.runs.iter().filter(|r| r.diverged).map(|r| r.run).collect();
        Self {
            schema_version: SCHEMA_VERSION,
            method: "monte-carlo",
            runs: result.runs.len() as u64,
            diverged: diverged_runs.len() as u64,
            diverged_runs,
            filter_states: result.filter_states,
            seed,
            outages: outage::outages(result).iter().map(OutageSummary::from).collect(),
            nees: nees(epochs),
            nis: nis(result),
            coverage: coverage(epochs, result.coverage_level),
            reduction: None,
            throughput_epochs_per_s: result.run_epochs as f64 / wall_s,
        }
    }
}

impl From<&OutageMetrics> for OutageSummary {
    fn from(o: &OutageMetrics) -> Self {
        let values = |all: &PerState<Estimate>| PerState(all.0.map(|e| e.value));
        let errors = |all: &PerState<Estimate>| PerState(all.0.map(|e| e.std_error));
        let (p50, p95) = (o.horizontal_p50_m, o.horizontal_p95_m);
        Self {
            start_s: o.start_s,
            end_s: o.end_s,
            asee_mean: values(&o.asee_mean),
            asee_mean_std_error: errors(&o.asee_mean),
            rmse_end: values(&o.rmse_end),
            rmse_end_std_error: errors(&o.rmse_end),
            horizontal_error_end_m: Spread::new(p50, p95, o.horizontal_max_m),
            reconvergence_s: Recovery {
                p50: o.reconvergence.p50_s.value,
                p95: o.reconvergence.p95_s.value,
                never: o.reconvergence.never,
            },
        }
    }
}

impl Spread {
    const fn new(p50: Quantile, p95: Quantile, max: f64) -> Self {
        Self { p50: p50.value, p95: p95.value, max, p50_ci95: p50.ci95, p95_ci95: p95.ci95 }
    }
}

/// The runs behind most epochs (all but the diverged ones).
fn count(epochs: &[EpochMetrics]) -> u64 {
    epochs.iter().map(|e| e.count).max().unwrap_or(0)
}

fn nees(epochs: &[EpochMetrics]) -> Consistency {
    let band = chi_square_band(NEES_DOF, count(epochs));
    let (mean, fraction_inside) = mean_and_inside(epochs, band, |e| e.nees.value);
    Consistency { dof: NEES_DOF, mean, lower95: band.lower, upper95: band.upper, fraction_inside }
}

fn coverage(epochs: &[EpochMetrics], level: f64) -> Coverage {
    let band = coverage_band(level, count(epochs));
    let (mean, fraction_inside) = mean_and_inside(epochs, band, |e| e.coverage);
    Coverage { level, mean, lower95: band.lower, upper95: band.upper, fraction_inside }
}

fn mean_and_inside(epochs: &[EpochMetrics], band: Band, value: impl Fn(&EpochMetrics) -> f64) -> (f64, f64) {
    let n = epochs.len() as f64;
    let inside = epochs.iter().filter(|e| band.contains(value(e))).count();
    (epochs.iter().map(value).sum::<f64>() / n, inside as f64 / n)
}

fn nis(result: &RunResult) -> Nis {
    let kept = || result.runs.iter().filter(|r| !r.diverged).map(|r| r.nis).filter(|(_, fixes)| *fixes > 0);
    let fixes: u64 = kept().map(|(_, fixes)| fixes).sum();
    let sum: f64 = kept().map(|(mean, fixes)| mean * fixes as f64).sum();
    let band = chi_square_band(result.fix_components, fixes);
    Nis {
        dof: result.fix_components,
        mean: sum / fixes as f64,
        lower95: band.lower,
        upper95: band.upper,
        fixes,
        rejected: result.runs.iter().filter(|r| !r.diverged).map(|r| r.rejected).sum(),
    }
}

#[cfg(test)]
#[path = "summary_tests.rs"]
mod tests;
