//! The summary of an experiment: what `summary.json` holds.

use super::budget::Budget;
use super::consistency::{Band, chi_square_band, coverage_band};
use super::epoch::{Accuracy, EpochMetrics};
use super::estimate::{Estimate, PerState, Quantile, SampleSize};
use super::outage::{self, OutageMetrics};
use super::reduction::ReductionSummary;
use super::requirement::Met;
use super::verdict::{OutageVerdict, Verdict};
use crate::simulation::{NEES_DOF, RunResult};
use serde::Serialize;

/// Version of the layout of `summary.json`.
pub(super) const SCHEMA_VERSION: u32 = 1;

/// What the user reads first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Layout version.
    pub schema_version: u32,
    /// "monte-carlo", "lincov" or "both".
    pub method: &'static str,
    /// Whether the filter is as good as it believes.
    pub verdict: Verdict,
    /// Runs, diverged ones included.
    pub runs: u64,
    /// Runs whose state or covariance stopped being finite; they are in no other number.
    pub diverged: u64,
    /// Their indices: with the seed, each can be repeated.
    pub diverged_runs: Vec<u64>,
    /// Runs that count as independent in every error stated here: fewer than were made where they share the
    /// windows of static recordings.
    pub independent_runs: f64,
    /// States of the filter.
    pub filter_states: usize,
    /// Seed of all random numbers; none for a covariance analysis that drew nothing.
    pub seed: Option<u64>,
    /// Means over all epochs, with and without fixes.
    pub accuracy: AccuracySummary,
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
    /// Largest error that the strapdown alone makes at the IMU's rate, over the sigma that the filter states; 0 (and not in
    /// files) where the trajectory closes.
    #[serde(skip_serializing_if = "is_zero")]
    pub strapdown_over_sigma: f64,
    /// What covariance analysis expects, where it stands beside runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lincov: Option<Box<Summary>>,
    /// Whether covariance analysis has another verdict, and figures that the runs contradict: errors are no longer small.
    #[serde(skip)]
    pub is_contradicted: bool,
    /// What was required, and whether it is met.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<Met>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands references")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// ASEE and RMSE as means over epochs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AccuracySummary {
    /// Mean over the epochs of the ASEE.
    pub asee_mean: PerState<f64>,
    /// Mean over the epochs of the RMSE.
    pub rmse_mean: PerState<f64>,
    /// Its Monte-Carlo standard error (an upper bound: as if all epochs erred together).
    pub rmse_mean_std_error: PerState<f64>,
}

/// One outage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutageSummary {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
    /// Whether the filter is as good at its end as it believes.
    pub verdict: OutageVerdict,
    /// Mean over the outage's epochs of the ASEE.
    pub asee_mean: PerState<f64>,
    /// Its Monte-Carlo standard error.
    asee_mean_std_error: PerState<f64>,
    /// Mean over the outage's epochs of the RMSE.
    pub rmse_mean: PerState<f64>,
    /// Its Monte-Carlo standard error (an upper bound: as if all epochs erred together).
    pub rmse_mean_std_error: PerState<f64>,
    /// ASEE just before the first fix after the outage.
    pub asee_end: PerState<f64>,
    /// Its Monte-Carlo standard error.
    asee_end_std_error: PerState<f64>,
    /// RMSE just before the first fix after the outage.
    pub rmse_end: PerState<f64>,
    /// Its Monte-Carlo standard error.
    pub rmse_end_std_error: PerState<f64>,
    /// 95 % interval of the ASEE that the calibration of the model leaves: what a filter would state whose model were
    /// known for certain; of a covariance analysis whose model has its draws beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub asee_end_ci95: Option<PerState<(f64, f64)>>,
    /// The same of the mean over the outage's epochs of the ASEE.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub asee_mean_ci95: Option<PerState<(f64, f64)>>,
    /// 95 % interval of the RMSE of this filter that the calibration of what makes the errors leaves; as above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_end_ci95: Option<PerState<(f64, f64)>>,
    /// Mean NEES at the same instant.
    pub nees_end: f64,
    /// Its Monte-Carlo standard error.
    pub nees_end_std_error: f64,
    /// Mean logarithm of the density of the nine errors (m, m/s, rad) under the filter's belief there (nats): a proper
    /// score, by which filters on the same errors can be ranked. Higher is better.
    pub log_density_end: f64,
    /// Its Monte-Carlo standard error.
    pub log_density_end_std_error: f64,
    /// Horizontal error at the same instant.
    pub horizontal_error_end_m: Spread,
    /// Whether covariance analysis finds errors in it that are beyond linear theory.
    pub beyond_linear: bool,
    /// Time until the error is back to what it was before.
    pub reconvergence_s: Recovery,
    /// Shares of the sources of the true errors in their mean squares just before the first fix after the outage,
    /// by covariance analysis; none where nothing models them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<Budget>,
    /// The same of what the filter believes in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub believed_budget: Option<Budget>,
}

/// Quantiles of a distribution over runs, with distribution-free 95 % intervals (null: too few runs); of a covariance
/// analysis with the intervals that the calibration of what makes the errors leaves (null: its draws are not there).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub p50: f64,
    /// 95 % quantile.
    pub p95: f64,
    /// 99.9 % quantile; of a covariance analysis only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p999: Option<f64>,
    /// Largest; NaN (null) of a covariance analysis, whose law has no end.
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
    /// Runs that never recover; none of a covariance analysis, which follows no run.
    pub never: Option<u64>,
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
    /// Whether its figures are those of a covariance analysis, or stand beside them.
    #[must_use]
    pub const fn is_analysed(&self) -> bool {
        self.runs == 0 || self.lincov.is_some()
    }

    /// The summary of a Monte-Carlo experiment.
    #[must_use]
    pub fn of(result: &RunResult, epochs: &[EpochMetrics], seed: u64) -> Self {
        let windows = result.independent_windows;
        let verdict = Verdict::of(&result.runs, result.outages.len(), windows);
        let verdicts = OutageVerdict::of(&result.runs, result.outages.len(), windows);
        let diverged_runs: Vec<u64> = result
            .runs
            .iter()
            .filter(|r| r.diverged)
            .map(|r| r.run)
            .collect();
        Self {
            schema_version: SCHEMA_VERSION,
            method: "monte-carlo",
            verdict,
            runs: result.runs.len() as u64,
            diverged: diverged_runs.len() as u64,
            diverged_runs,
            independent_runs: verdict.independent_runs,
            filter_states: result.filter_states,
            seed: Some(seed),
            accuracy: AccuracySummary::from(&Accuracy::over(epochs.iter())),
            outages: OutageSummary::all(&outage::outages(result), verdicts),
            nees: nees(epochs, windows),
            nis: nis(result),
            coverage: coverage(epochs, result.coverage_level, windows),
            reduction: None,
            lincov: None,
            is_contradicted: false,
            strapdown_over_sigma: 0.0,
            require: Vec::new(),
        }
    }
}

fn values(all: &PerState<Estimate>) -> PerState<f64> {
    PerState(all.0.map(|e| e.value))
}

fn errors(all: &PerState<Estimate>) -> PerState<f64> {
    PerState(all.0.map(|e| e.std_error))
}

impl From<&Accuracy> for AccuracySummary {
    fn from(a: &Accuracy) -> Self {
        Self {
            asee_mean: values(&a.asee_mean),
            rmse_mean: values(&a.rmse_mean),
            rmse_mean_std_error: errors(&a.rmse_mean),
        }
    }
}

impl OutageSummary {
    /// All outages with their verdicts.
    pub(super) fn all(outages: &[OutageMetrics], verdicts: Vec<OutageVerdict>) -> Vec<Self> {
        outages
            .iter()
            .zip(verdicts)
            .map(|(o, verdict)| Self::new(o, verdict))
            .collect()
    }

    fn new(o: &OutageMetrics, verdict: OutageVerdict) -> Self {
        Self {
            start_s: o.start_s,
            end_s: o.end_s,
            verdict,
            asee_mean: values(&o.asee_mean),
            asee_mean_std_error: errors(&o.asee_mean),
            rmse_mean: values(&o.rmse_mean),
            rmse_mean_std_error: errors(&o.rmse_mean),
            asee_end: values(&o.asee_end),
            asee_end_std_error: errors(&o.asee_end),
            rmse_end: values(&o.rmse_end),
            rmse_end_std_error: errors(&o.rmse_end),
            asee_end_ci95: None,
            asee_mean_ci95: None,
            rmse_end_ci95: None,
            nees_end: o.nees_end.value,
            nees_end_std_error: o.nees_end.std_error,
            log_density_end: o.log_density_end.value,
            log_density_end_std_error: o.log_density_end.std_error,
            horizontal_error_end_m: Spread {
                p999: o.horizontal_p999_m,
                ..Spread::new(o.horizontal_p50_m, o.horizontal_p95_m, o.horizontal_max_m)
            },
            beyond_linear: o.beyond_linear,
            reconvergence_s: Recovery {
                p50: o.reconvergence.p50_s.value,
                p95: o.reconvergence.p95_s.value,
                never: o.reconvergence.never,
            },
            budget: None,
            believed_budget: None,
        }
    }
}

impl Spread {
    const fn new(p50: Quantile, p95: Quantile, max: f64) -> Self {
        Self {
            p50: p50.value,
            p95: p95.value,
            p999: None,
            max,
            p50_ci95: p50.ci95,
            p95_ci95: p95.ci95,
        }
    }
}

/// Independent runs behind most epochs (all but the diverged ones).
fn count(epochs: &[EpochMetrics], windows: Option<f64>) -> f64 {
    SampleSize::of(epochs.iter().map(|e| e.count).max().unwrap_or(0), windows).independent
}

fn nees(epochs: &[EpochMetrics], windows: Option<f64>) -> Consistency {
    let band = chi_square_band(NEES_DOF, count(epochs, windows));
    let (mean, fraction_inside) = mean_and_inside(epochs, band, |e| e.nees.value);
    Consistency {
        dof: NEES_DOF,
        mean,
        lower95: band.lower,
        upper95: band.upper,
        fraction_inside,
    }
}

fn coverage(epochs: &[EpochMetrics], level: f64, windows: Option<f64>) -> Coverage {
    let band = coverage_band(level, count(epochs, windows));
    let (mean, fraction_inside) = mean_and_inside(epochs, band, |e| e.coverage);
    Coverage {
        level,
        mean,
        lower95: band.lower,
        upper95: band.upper,
        fraction_inside,
    }
}

fn mean_and_inside(
    epochs: &[EpochMetrics],
    band: Band,
    value: impl Fn(&EpochMetrics) -> f64,
) -> (f64, f64) {
    let n = epochs.len() as f64;
    let inside = epochs.iter().filter(|e| band.contains(value(e))).count();
    (epochs.iter().map(value).sum::<f64>() / n, inside as f64 / n)
}

fn nis(result: &RunResult) -> Nis {
    let kept = || {
        result
            .runs
            .iter()
            .filter(|r| !r.diverged)
            .map(|r| r.nis)
            .filter(|(_, fixes)| *fixes > 0)
    };
    let fixes: u64 = kept().map(|(_, fixes)| fixes).sum();
    let sum: f64 = kept().map(|(mean, fixes)| mean * fixes as f64).sum();
    let runs = SampleSize::of(kept().count() as u64, result.independent_windows);
    // NIS are independent within a run and between runs; of runs that share windows only this share is new.
    let share = runs.independent / runs.values as f64;
    let band = chi_square_band(result.fix_components, fixes as f64 * share);
    Nis {
        dof: result.fix_components,
        // Weighted by fixes: a run of which the gate refused most must not count as one that used them all.
        mean: sum / fixes as f64,
        lower95: band.lower,
        upper95: band.upper,
        fixes,
        rejected: result
            .runs
            .iter()
            .filter(|r| !r.diverged)
            .map(|r| r.rejected)
            .sum(),
    }
}

#[cfg(test)]
#[path = "summary_tests.rs"]
mod tests;
