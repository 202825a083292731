//! The summary of an experiment: what `summary.json` holds.

use super::estimate::{Band, PerState, SampleSize, chi_square_band, coverage_band};
use super::outage::{Budget, EpochMetrics, outages};
use super::verdict::{OutageVerdict, Verdict, VerdictKind, verdicts};
use crate::linalg::{by_value, mean};
use crate::simulation::lincov::{self, Assessment};
use crate::simulation::{GainsUsed, NEES_DOF, REPORTED, REPORTED_NAMES, RunResult};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::fmt;
use std::str::FromStr;

/// Summary of an experiment: `summary.json`.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Summary {
    /// Layout version.
    pub schema_version: u32,
    /// "monte-carlo", "lincov" or "both".
    pub method: &'static str,
    /// Verdict on the filter's consistency.
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
    /// The gains of the filter in sampled runs; none for a covariance analysis.
    pub gains: Option<GainsUsed>,
    /// Seed of all random numbers; none for a covariance analysis that drew nothing.
    pub seed: Option<u64>,
    /// Means over all epochs, with and without fixes.
    pub accuracy: AccuracySummary,
    /// Outages in time order.
    pub outages: Vec<OutageSummary>,
    /// Normalised estimation error squared of position, velocity and attitude.
    pub nees: ConsistencySummary,
    /// Normalised innovation squared of the fixes.
    pub nis: Nis,
    /// Share of runs inside the filter's ellipsoid of position and attitude.
    pub coverage: Coverage,
    /// Cost of the reduction to 15 states; none where it loses nothing.
    pub reduction: Option<ReductionQuality>,
    /// Largest error that the strapdown alone makes at the IMU's rate, over the sigma that the filter states; 0 (and not in
    /// files) where the trajectory closes.
    #[serde(skip_serializing_if = "is_zero")]
    pub strapdown_over_sigma: f64,
    /// Summary by covariance analysis, beside one by runs.
    pub lincov: Option<Box<Summary>>,
    /// True if covariance analysis gives another verdict and figures that the runs contradict:
    /// errors are too large for linear theory.
    #[serde(skip)]
    pub is_contradicted: bool,
    /// Requirements, each with its result.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<RequirementResult>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serialises")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// ASEE and RMSE as means over epochs.
#[derive(Debug, Clone, Default, Serialize)]
pub struct AccuracySummary {
    /// Mean over the epochs of the ASEE.
    pub asee_mean: PerState<f64>,
    /// Mean over the epochs of the RMSE.
    pub rmse_mean: PerState<f64>,
    /// Its Monte-Carlo standard error (an upper bound: as if all epochs erred together).
    pub rmse_mean_std_error: PerState<f64>,
}

/// One outage.
#[derive(Debug, Clone, Default, Serialize)]
pub struct OutageSummary {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
    /// Verdict on the filter's consistency at its end.
    pub verdict: OutageVerdict,
    /// Mean over the outage's epochs of the ASEE.
    pub asee_mean: PerState<f64>,
    /// Its Monte-Carlo standard error.
    pub(super) asee_mean_std_error: PerState<f64>,
    /// Mean over the outage's epochs of the RMSE.
    pub rmse_mean: PerState<f64>,
    /// Its Monte-Carlo standard error (an upper bound: as if all epochs erred together).
    pub rmse_mean_std_error: PerState<f64>,
    /// ASEE just before the first fix after the outage.
    pub asee_end: PerState<f64>,
    /// Its Monte-Carlo standard error.
    pub(super) asee_end_std_error: PerState<f64>,
    /// RMSE just before the first fix after the outage.
    pub rmse_end: PerState<f64>,
    /// Its Monte-Carlo standard error.
    pub rmse_end_std_error: PerState<f64>,
    /// 95 % interval of the ASEE that the calibration of the model leaves: what a filter would state whose model were
    /// known for certain, by covariance analysis; of a model that has its draws beside it.
    pub asee_end_ci95: Option<PerState<(f64, f64)>>,
    /// 95 % interval of the mean over the outage's epochs of the ASEE.
    pub asee_mean_ci95: Option<PerState<(f64, f64)>>,
    /// 95 % interval of the RMSE of this filter due to the calibration of what makes the errors; as above.
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
    pub horizontal_error_end_m: QuantileSummary,
    /// True if its errors are beyond linear theory by covariance analysis.
    pub beyond_linear: bool,
    /// Time until the error is back to what it was before.
    pub reconvergence_s: Recovery,
    /// Shares of the sources of the true errors in their mean squares just before the first fix after the outage,
    /// by covariance analysis; none where nothing models them.
    pub budget: Option<Budget>,
}

/// Quantiles of a distribution over runs, with distribution-free 95 % intervals (null: too few runs), widened by what the
/// calibration of what makes the errors leaves open where its draws are there; of a covariance analysis that alone.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct QuantileSummary {
    /// Median.
    pub p50: f64,
    /// 95 % quantile.
    pub p95: f64,
    /// 99.9 % quantile; of a covariance analysis only.
    pub p999: Option<f64>,
    /// Largest; NaN (null) of a covariance analysis, whose law has no end.
    pub max: f64,
    /// Interval of the median.
    pub p50_ci95: (Option<f64>, Option<f64>),
    /// Interval of the 95 % quantile.
    pub p95_ci95: (Option<f64>, Option<f64>),
}

/// Quantiles over the runs that recover, and how many do not.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Recovery {
    /// Median.
    pub p50: f64,
    /// 95 % quantile.
    pub p95: f64,
    /// Runs that never recover; none of a covariance analysis, which follows no run.
    pub never: Option<u64>,
}

/// Chi-square statistic with its band for a consistent filter.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct ConsistencySummary {
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
#[derive(Debug, Clone, Copy, Default, Serialize)]
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
}

/// Empirical coverage.
#[derive(Debug, Clone, Copy, Default, Serialize)]
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
    /// The summary of a Monte-Carlo experiment.
    pub fn of(result: &RunResult, epochs: &[EpochMetrics], seed: u64) -> Self {
        let windows = result.independent_windows;
        let (verdict, verdicts) = verdicts(&result.runs, result.outages.len(), windows);
        let diverged = result.runs.iter().filter(|r| r.diverged);
        let diverged_runs: Vec<u64> = diverged.map(|r| r.run).collect();
        Self {
            method: "monte-carlo",
            runs: result.runs.len() as u64,
            diverged: diverged_runs.len() as u64,
            diverged_runs,
            filter_states: result.filter_states,
            gains: Some(result.gains),
            seed: Some(seed),
            outages: with_verdicts(outages(result, epochs), verdicts),
            nis: nis(result),
            ..Self::over(epochs, verdict, result.coverage_level, windows)
        }
    }

    /// Summary of the epochs alone.
    pub(super) fn over(
        epochs: &[EpochMetrics],
        verdict: Verdict,
        coverage_level: f64,
        windows: Option<f64>,
    ) -> Self {
        Self {
            schema_version: 1,
            verdict,
            independent_runs: verdict.independent_samples,
            accuracy: AccuracySummary::over(epochs.iter()),
            nees: nees(epochs, windows),
            coverage: coverage(epochs, coverage_level, windows),
            ..Self::default()
        }
    }
}

/// Outages with their verdicts.
pub(super) fn with_verdicts(
    mut outages: Vec<OutageSummary>,
    verdicts: Vec<OutageVerdict>,
) -> Vec<OutageSummary> {
    for (outage, verdict) in outages.iter_mut().zip(verdicts) {
        outage.verdict = verdict;
    }
    outages
}

/// Independent runs behind most epochs (all but the diverged ones).
fn count(epochs: &[EpochMetrics], windows: Option<f64>) -> f64 {
    SampleSize::of(epochs.iter().map(|e| e.count).max().unwrap_or(0), windows).independent
}

fn nees(epochs: &[EpochMetrics], windows: Option<f64>) -> ConsistencySummary {
    let band = chi_square_band(NEES_DOF, count(epochs, windows));
    let [mean, lower95, upper95, fraction_inside] = over_epochs(epochs, band, |e| e.nees.value);
    ConsistencySummary {
        dof: NEES_DOF,
        mean,
        lower95,
        upper95,
        fraction_inside,
    }
}

fn coverage(epochs: &[EpochMetrics], level: f64, windows: Option<f64>) -> Coverage {
    let band = coverage_band(level, count(epochs, windows));
    let [mean, lower95, upper95, fraction_inside] = over_epochs(epochs, band, |e| e.coverage);
    Coverage {
        level,
        mean,
        lower95,
        upper95,
        fraction_inside,
    }
}

/// Mean over the epochs, the band, and the share of epochs in it: none of expected values, which have no scatter.
fn over_epochs(
    epochs: &[EpochMetrics],
    band: Band,
    value: impl Fn(&EpochMetrics) -> f64,
) -> [f64; 4] {
    let n = epochs.len() as f64;
    let inside = epochs.iter().filter(|e| band.contains(value(e))).count();
    let mean = mean(epochs.iter().map(&value));
    let share = if band.lower.is_finite() {
        inside as f64 / n
    } else {
        f64::NAN
    };
    [mean, band.lower, band.upper, share]
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
    }
}

// Whether runs scatter about what covariance analysis expects of them.

/// Probability at which runs that scatter as they should are said not to, all figures together.
const LEVEL: f64 = 1e-3;

impl Summary {
    /// The runs beside what covariance analysis expects of them.
    pub fn expect(&mut self, expected: Self) {
        self.method = "both";
        self.compare_with(&expected);
        self.lincov = Some(Box::new(expected));
    }

    /// Puts the word of covariance analysis beside the verdict, which stays that of the runs.
    pub fn compare_with(&mut self, expected: &Self) {
        for (own, expected) in self.outages.iter_mut().zip(&expected.outages) {
            own.beyond_linear = expected.beyond_linear;
        }
        self.verdict.by_covariance_analysis = Some(expected.verdict.kind);
        self.verdict.beyond_linear = expected.verdict.beyond_linear;
        self.is_contradicted =
            self.contradicts(expected) && self.verdict.kind != expected.verdict.kind;
    }

    /// Returns true if a figure of the runs (RMSE of every state and NEES at the end of each
    /// outage, means over the run of RMSE, NEES and coverage) is further from the expected one, in
    /// Monte-Carlo standard errors, than chance explains.
    fn contradicts(&self, expected: &Self) -> bool {
        let distance = |value: f64, error: f64, expected: f64| (value - expected) / error;
        let v = &self.verdict;
        let mut all = vec![
            distance(v.nees, v.nees_std_error, expected.nees.mean),
            distance(v.coverage, v.coverage_std_error, expected.coverage.mean),
        ];
        type States = PerState<f64>;
        let distances = |value: &States, error: &States, expected: &States| -> [f64; REPORTED] {
            std::array::from_fn(|i| distance(value.0[i], error.0[i], expected.0[i]))
        };
        let (a, e) = (&self.accuracy, &expected.accuracy);
        all.extend(distances(
            &a.rmse_mean,
            &a.rmse_mean_std_error,
            &e.rmse_mean,
        ));
        for (o, e) in self.outages.iter().zip(&expected.outages) {
            all.push(distance(o.nees_end, o.nees_end_std_error, e.nees_end));
            all.extend(distances(&o.rmse_end, &o.rmse_end_std_error, &e.rmse_end));
        }
        // coverage that is 1 in every run has no error of its own, and tells nothing
        all.retain(|z| z.is_finite());
        // Two sides, and Bonferroni over all figures: they are correlated, so that the true level is below
        // LEVEL.
        let tail = LEVEL / (2.0 * all.len().max(1) as f64);
        // The standard errors are estimated from the same runs: Student's t, not the normal law.
        StudentsT::new(0.0, 1.0, self.independent_runs - 1.0)
            .is_ok_and(|t| all.iter().any(|z| z.abs() > t.inverse_cdf(1.0 - tail)))
    }
}

// What the reduction of a model to 15 states leaves of it, and how consistent the reduced filter is.

/// A ratio of RMSE to standard deviation that is further from 1 at the end of an outage deserves a warning.
pub const TOLERANCE: f64 = 0.1;

/// Quality of the reduced filter by covariance analysis, with the model as truth.
#[derive(Debug, Clone, Serialize)]
pub struct ReductionQuality {
    /// True RMSE over the filter's own standard deviation at the end of each outage: above 1 it is
    /// overconfident, below 1 overcautious.
    pub outage_end: Vec<PerState<f64>>,
    /// RMSE over the filter's own standard deviation, mean over all epochs after the start.
    pub mean: PerState<f64>,
    /// Expected NEES, mean over all epochs after the start; 9 is right.
    pub nees: f64,
    /// True RMSE over that of the full filter at the end of each outage; none where the model has no full filter.
    pub rmse_over_full: Option<Vec<PerState<f64>>>,
}

impl ReductionQuality {
    /// From a covariance analysis of the reduced filter and, where there is one, of the full filter.
    pub fn of(reduced: &Assessment, full: Option<&Assessment>) -> Self {
        // At the start the errors are those that the filter believes in, or none: that says nothing of it.
        let later: Vec<&lincov::Consistency> =
            reduced.reports.iter().filter(|r| r.after_s > 0.0).collect();
        let ratios: Vec<[f64; REPORTED]> = later.iter().map(|r| r.ratio()).collect();
        let over = |(a, b): (&lincov::Consistency, &lincov::Consistency)| {
            PerState(std::array::from_fn(|i| a.rmse[i] / b.rmse[i]))
        };
        Self {
            outage_end: reduced
                .outage_ends
                .iter()
                .map(|e| PerState(e.ratio()))
                .collect(),
            mean: PerState(std::array::from_fn(|i| mean(ratios.iter().map(|r| r[i])))),
            nees: mean(later.iter().map(|r| r.nees)),
            rmse_over_full: full.map(|f| {
                reduced
                    .outage_ends
                    .iter()
                    .zip(&f.outage_ends)
                    .map(over)
                    .collect()
            }),
        }
    }

    /// Reported state, outage and ratio that is further from 1 than the tolerance, the furthest of all; none where none is.
    pub fn worst(&self) -> Option<(usize, usize, f64)> {
        let ends = self.outage_end.iter().enumerate();
        let all = ends
            .flat_map(|(outage, end)| end.0.iter().enumerate().map(move |(s, r)| (s, outage, *r)));
        // By the logarithm: half and twice are equally far off.
        let worst = all.max_by(|a, b| a.2.ln().abs().total_cmp(&b.2.ln().abs()))?;
        (worst.2.ln().abs() > TOLERANCE.ln_1p()).then_some(worst)
    }

    /// Errors over those of the full filter at the ends of outages: the largest ratio of the horizontal position (north or east,
    /// whichever is larger), and that of all states with its state.
    pub fn cost(&self) -> Option<(f64, (usize, f64))> {
        let ends = || self.rmse_over_full.iter().flatten();
        let most = |state: usize| (state, ends().map(|end| end.0[state]).fold(0.0, f64::max));
        let worst = (0..REPORTED).map(most).max_by(by_value)?;
        (worst.1 > 0.0).then_some((most(0).1.max(most(1).1), worst))
    }
}

// Limits that the errors must keep.

/// The figure that a limit is set on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LimitedFigure {
    /// Median of the horizontal error at the end of an outage.
    P50,
    /// Its 95 % quantile.
    P95,
    /// RMSE of a reported state at the end of an outage; without outages its mean over the run.
    Rmse(usize),
    /// The verdict on the filter: its worst ratio of error to standard deviation, and that runs could have found a larger one.
    Consistent,
}

/// A figure and the most it may be, at the end of every outage: `p95_m<=5`, `rmse_pos_e_m<=2`, `yaw_deg<=1`; or
/// `consistent`, a verdict.
#[derive(Debug, Clone, Copy)]
pub struct Requirement {
    figure: LimitedFigure,
    limit: f64,
}

/// Position and velocity down among the reported states.
const DOWN: [usize; 2] = [2, 5];

/// Requirement with its result and margin.
#[derive(Debug, Clone, Serialize)]
pub struct RequirementResult {
    /// The figure.
    pub name: String,
    /// The most it may be.
    pub limit: f64,
    /// Its largest value.
    pub value: f64,
    /// The outage at whose end that is (from 0); none: the mean over the run.
    pub outage: Option<usize>,
    /// True if it is within the limit; by covariance analysis, only where linear theory holds.
    pub met: bool,
    /// The outage (from 0) in which errors are beyond linear theory, where covariance analysis would call the limit met and cannot, for
    /// want of what comes after that outage, or where runs decide in its place.
    pub beyond_linear: Option<usize>,
}

/// NAME<=LIMIT with a positive limit.
pub(crate) fn name_and_limit(text: &str) -> Option<(&str, f64)> {
    let (name, limit) = text.split_once("<=").or_else(|| text.split_once('<'))?;
    let limit: f64 = limit.trim().parse().ok()?;
    (limit > 0.0 && limit.is_finite()).then_some((name.trim(), limit))
}

impl FromStr for Requirement {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text.trim() == "consistent" {
            return Ok(Self {
                figure: LimitedFigure::Consistent,
                limit: 1.0 + TOLERANCE,
            });
        }
        let read = || {
            let (name, limit) = name_and_limit(text)?;
            let state = name.strip_prefix("rmse_").unwrap_or(name);
            let figure = match name {
                "p50_m" => LimitedFigure::P50,
                "p95_m" => LimitedFigure::P95,
                _ => LimitedFigure::Rmse(REPORTED_NAMES.iter().position(|known| *known == state)?),
            };
            Some(Self { figure, limit })
        };
        read().ok_or(
            "expected \"consistent\" or NAME<=LIMIT with a positive limit, NAME one of p50_m, p95_m, rmse_pos_e_m, yaw_deg and the other states",
        )
    }
}

impl Requirement {
    /// Returns true for a figure that exists only with outages.
    pub const fn needs_outage(&self) -> bool {
        matches!(self.figure, LimitedFigure::P50 | LimitedFigure::P95)
    }

    /// Its name.
    pub fn name(&self) -> String {
        match self.figure {
            LimitedFigure::P50 => "p50_m".to_owned(),
            LimitedFigure::P95 => "p95_m".to_owned(),
            LimitedFigure::Rmse(state) => format!("rmse_{}", REPORTED_NAMES[state]),
            LimitedFigure::Consistent => "consistent".to_owned(),
        }
    }

    /// Compares the limit with the expectation of the covariance analysis where there is one, else with the runs. From the first
    /// outage that is beyond linear theory on, position and velocity down are not in the analysis: the runs beside it decide, and
    /// without runs no limit is met. All other figures hold (docs/limits.md).
    pub fn check(&self, summary: &Summary) -> RequirementResult {
        if self.figure == LimitedFigure::Consistent {
            let Verdict {
                kind,
                ratio,
                worst_outage,
                beyond_linear,
                ..
            } = summary.verdict;
            let (name, met) = (self.name(), kind == VerdictKind::Consistent);
            return RequirementResult {
                name,
                limit: self.limit,
                value: ratio,
                outage: worst_outage,
                met,
                beyond_linear,
            };
        }
        // Free of chance: a limit is then not kept or missed by the luck of the runs.
        let expected = summary.lincov.as_deref().unwrap_or(summary);
        let of_outage = |o: &OutageSummary| match self.figure {
            LimitedFigure::P50 => o.horizontal_error_end_m.p50,
            LimitedFigure::P95 => o.horizontal_error_end_m.p95,
            LimitedFigure::Rmse(state) => o.rmse_end.0[state],
            LimitedFigure::Consistent => o.verdict.ratio,
        };
        let is_down = matches!(self.figure, LimitedFigure::Rmse(state) if DOWN.contains(&state));
        let is_shifted = |o: &OutageSummary| o.beyond_linear;
        let shifted = expected
            .outages
            .iter()
            .position(is_shifted)
            .filter(|_| is_down && expected.runs == 0);
        let is_beyond = |outage: usize| shifted.is_some_and(|shifted| outage >= shifted);
        let outages = summary.outages.iter().zip(&expected.outages).enumerate();
        let ends = outages
            .map(|(k, (own, expected))| (k, of_outage(if is_beyond(k) { own } else { expected })));
        // a figure that is not a number is the worst of all
        let worst = ends.max_by(|a, b| (a.1.is_nan().cmp(&b.1.is_nan())).then(a.1.total_cmp(&b.1)));
        let (outage, value) = match (worst, self.figure) {
            (Some((outage, value)), _) => (Some(outage), value),
            (None, LimitedFigure::Rmse(state)) => (None, expected.accuracy.rmse_mean.0[state]),
            (None, _) => (None, f64::NAN),
        };
        let (is_kept, is_sampled) = (value <= self.limit, summary.runs > 0);
        let decides = match is_sampled {
            true => outage.is_some_and(is_beyond),
            // any of the outages after it, not the one that is largest in linear theory alone
            false => is_kept && summary.outages.len().checked_sub(1).is_some_and(is_beyond),
        };
        let beyond_linear = shifted.filter(|_| decides);
        let met = is_kept && (is_sampled || beyond_linear.is_none());
        RequirementResult {
            name: self.name(),
            limit: self.limit,
            value,
            outage,
            met,
            beyond_linear,
        }
    }
}

impl fmt::Display for Requirement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.figure {
            LimitedFigure::Consistent => f.write_str("consistent"),
            _ => write!(f, "{}<={}", self.name(), self.limit),
        }
    }
}

#[cfg(test)]
#[path = "summary_tests.rs"]
mod summary_tests;

#[cfg(test)]
mod reduction_tests {
    use super::*;

    /// At the start the errors are drawn from the filter's own belief (or are none): its ratio is 1 (or 0), whatever
    /// the filter does afterwards.
    #[test]
    fn the_start_says_nothing_of_the_filter() {
        let report = |after_s, rmse, nees| lincov::Consistency {
            after_s,
            measured: false,
            sigma: [1.0; REPORTED],
            rmse: [rmse; REPORTED],
            nees,
            divergence: 0.0,
            log_density: 0.0,
        };
        let reports = vec![
            report(0.0, 1.0, 9.0),
            report(1.0, 2.0, 36.0),
            report(2.0, 4.0, 144.0),
        ];
        let quality = ReductionQuality::of(
            &Assessment {
                reports,
                outage_ends: vec![],
            },
            None,
        );
        assert_eq!((quality.mean.0, quality.nees), ([3.0; REPORTED], 90.0));
    }

    /// The position north costs 1.9 % at the end of one outage, yaw a quarter at that of the other; the sigma of yaw is off by 1.25.
    #[test]
    fn cost_and_worst_state_of_a_reduction() {
        let mut ends = vec![PerState([1.0; REPORTED]); 2];
        (ends[0].0[0], ends[1].0[8]) = (1.019, 1.25);
        let quality = |ends: &[PerState<f64>]| ReductionQuality {
            outage_end: ends.to_vec(),
            mean: PerState([1.0; REPORTED]),
            nees: 9.0,
            rmse_over_full: Some(ends.to_vec()),
        };
        assert_eq!(quality(&ends).cost(), Some((1.019, (8, 1.25))));
        assert_eq!(quality(&ends).worst(), Some((8, 1, 1.25)));
        assert_eq!((quality(&[]).cost(), quality(&[]).worst()), (None, None));
        ends[1].0[8] = 1.0 / 1.25;
        assert_eq!(quality(&ends).worst(), Some((8, 1, 0.8)));
        ends[1].0[8] = 1.05;
        assert_eq!(quality(&ends).worst(), None);
    }
}

#[cfg(test)]
mod requirement_tests {
    use super::*;

    #[test]
    fn requirements_are_read_as_they_are_written() {
        for (text, shown) in [
            ("p95_m<=5", "p95_m<=5"),
            ("p50_m < 2.5", "p50_m<=2.5"),
            ("rmse_pos_e_m<=1", "rmse_pos_e_m<=1"),
            ("yaw_deg<=0.5", "rmse_yaw_deg<=0.5"),
            ("consistent", "consistent"),
        ] {
            assert_eq!(text.parse::<Requirement>().unwrap().to_string(), shown);
        }
        for wrong in [
            "p95_m",
            "p95_m>=5",
            "p95<=5",
            "p95_m<=-1",
            "p95_m<=nan",
            "p95_m<=",
            "rmse_p95_m<=1",
        ] {
            assert!(wrong.parse::<Requirement>().is_err(), "{wrong}");
        }
    }
}
