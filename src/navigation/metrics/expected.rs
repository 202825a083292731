//! What a covariance analysis says: the figures that runs would scatter about, without a run.

use super::epoch::{Accuracy, EpochMetrics};
use super::estimate::{Estimate, PerState};
use super::quadratic_form::QuadraticForm;
use super::summary::{
    AccuracySummary, Consistency, Coverage, Nis, OutageSummary, Recovery, SCHEMA_VERSION, Spread, Summary,
};
use super::verdict::Verdict;
use crate::simulation::lincov::{ErrorLaw, Instant};
use crate::simulation::{COVERAGE_DOF, NEES_DOF, OutageRecord, REPORTED, RunRecord};
use crate::units::DEG;
use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// States of the coverage statistic among those of the filter: position, attitude.
const COVERED: [usize; COVERAGE_DOF] = [0, 1, 2, 6, 7, 8];
/// Probability of the quantile that stands for the largest error, which a law without end does not have.
const NEARLY_ALL: f64 = 0.999;

/// The law of a filter's errors as the figures of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// Statistics of every reporting epoch, all without a Monte-Carlo error.
    pub epochs: Vec<EpochMetrics>,
    /// A run whose squares are the expected ones: it stands for all runs where runs are compared.
    pub record: RunRecord,
    outages: Vec<OutageSummary>,
    nis: (f64, u64),
}

/// What a covariance analysis does not know of its experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<'a> {
    /// Outages (start, end) (s).
    pub outages: &'a [(f64, f64)],
    /// States of the filter.
    pub filter_states: usize,
    /// Components of a fix.
    pub fix_components: usize,
    /// Level of the coverage statistic.
    pub coverage_level: f64,
    /// Seed of the outages, where they were drawn.
    pub seed: u64,
}

impl Expected {
    /// From the law of the errors along the track; none where a covariance did not stay finite and positive.
    #[must_use]
    pub fn of(law: &ErrorLaw, frame: &Frame<'_>) -> Option<Self> {
        let chi2 = ChiSquared::new(COVERAGE_DOF as f64).expect("degrees of freedom are positive");
        let limit = chi2.inverse_cdf(frame.coverage_level);
        let epochs: Vec<EpochMetrics> =
            law.reports.iter().map(|instant| epoch(instant, limit)).collect::<Option<_>>()?;
        let ends = frame.outages.iter().zip(&law.outage_ends);
        let outages: Vec<OutageSummary> = ends.map(|(window, end)| outage(*window, end, &epochs)).collect();
        let record = record(&epochs, law, &outages);
        record.nees_mean.is_finite().then_some(Self { epochs, record, outages, nis: law.nis })
    }

    /// The summary: as that of runs, without what only runs have (null).
    #[must_use]
    pub fn summary(&self, frame: &Frame<'_>) -> Summary {
        let verdict = Verdict::expected(&self.record);
        let unknown = f64::NAN;
        Summary {
            schema_version: SCHEMA_VERSION,
            method: "lincov",
            verdict,
            runs: 0,
            diverged: 0,
            diverged_runs: Vec::new(),
            independent_runs: verdict.independent_runs,
            filter_states: frame.filter_states,
            seed: frame.seed,
            accuracy: AccuracySummary::from(&Accuracy::over(self.epochs.iter())),
            outages: self.outages.clone(),
            nees: Consistency {
                dof: NEES_DOF,
                mean: self.record.nees_mean,
                lower95: unknown,
                upper95: unknown,
                fraction_inside: unknown,
            },
            nis: Nis {
                dof: frame.fix_components,
                mean: self.nis.0 / self.nis.1 as f64,
                lower95: unknown,
                upper95: unknown,
                fixes: self.nis.1,
                rejected: 0,
            },
            coverage: Coverage {
                level: frame.coverage_level,
                mean: self.record.covered,
                lower95: unknown,
                upper95: unknown,
                fraction_inside: unknown,
            },
            reduction: None,
            lincov: None,
            agreement: None,
            require: Vec::new(),
        }
    }
}

fn exact(value: f64) -> Estimate {
    Estimate { value, std_error: 0.0 }
}

fn exactly(values: [f64; REPORTED]) -> PerState<Estimate> {
    PerState(values.map(exact))
}

/// A block of a covariance, by states.
fn block(p: &[[f64; NEES_DOF]; NEES_DOF], states: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(states.len(), states.len(), |i, j| p[states[j]][states[i]])
}

/// Mean size of the part of the error that these states have.
fn mean_size(instant: &Instant, states: &[usize]) -> f64 {
    square(instant, states).mean_root()
}

/// The square of that part.
fn square(instant: &Instant, states: &[usize]) -> QuadraticForm {
    let mean: Vec<f64> = states.iter().map(|s| instant.mean[*s]).collect();
    QuadraticForm::of_square(&block(&instant.covariance, states), &mean)
}

fn epoch(instant: &Instant, limit: f64) -> Option<EpochMetrics> {
    let believed = block(&instant.believed, &COVERED);
    let mean = COVERED.map(|s| instant.mean[s]);
    let inside = QuadraticForm::of_normalised(&believed, &block(&instant.covariance, &COVERED), &mean)?;
    Some(EpochMetrics {
        t_s: instant.t_s,
        gnss: instant.fix,
        count: 0,
        asee: exactly(instant.sigma()),
        rmse: exactly(instant.rmse()),
        bias: exactly(instant.reported(&instant.mean)),
        mean_pos_err_m: exact(mean_size(instant, &[0, 1, 2])),
        mean_att_err_deg: exact(mean_size(instant, &[6, 7, 8]) / DEG),
        nees: exact(instant.consistency().nees),
        coverage: inside.cdf(limit),
    })
}

fn outage((start_s, end_s): (f64, f64), end: &Instant, epochs: &[EpochMetrics]) -> OutageSummary {
    // a nanosecond of slack: sample times are multiples of 1/rate, outage times are typed
    let inside = epochs.iter().filter(|e| start_s <= e.t_s + 1e-9 && e.t_s + 1e-9 < end_s);
    let mean = Accuracy::over(inside);
    let values = |all: &PerState<Estimate>| PerState(all.0.map(|e| e.value));
    let none = PerState([0.0; REPORTED]);
    let horizontal = square(end, &[0, 1]);
    let quantile = |p: f64| horizontal.quantile(p).sqrt();
    OutageSummary {
        start_s,
        end_s,
        asee_mean: values(&mean.asee_mean),
        asee_mean_std_error: none,
        rmse_mean: values(&mean.rmse_mean),
        rmse_mean_std_error: none,
        asee_end: PerState(end.sigma()),
        asee_end_std_error: none,
        rmse_end: PerState(end.rmse()),
        rmse_end_std_error: none,
        nees_end: end.consistency().nees,
        nees_end_std_error: 0.0,
        log_density_end: end.consistency().log_density,
        log_density_end_std_error: 0.0,
        horizontal_error_end_m: Spread {
            p50: quantile(0.5),
            p95: quantile(0.95),
            p999: Some(quantile(NEARLY_ALL)),
            max: f64::NAN,
            p50_ci95: (None, None),
            p95_ci95: (None, None),
        },
        reconvergence_s: Recovery { p50: f64::NAN, p95: f64::NAN, never: None },
        budget: None,
        believed_budget: None,
    }
}

/// The run whose squares are the expected ones.
fn record(epochs: &[EpochMetrics], law: &ErrorLaw, outages: &[OutageSummary]) -> RunRecord {
    let mean =
        |value: &dyn Fn(&EpochMetrics) -> f64| epochs.iter().map(value).sum::<f64>() / epochs.len() as f64;
    let of_outage = |o: &OutageSummary| OutageRecord {
        see_mean: o.asee_mean.0,
        see_end: o.asee_end.0,
        error_end: o.rmse_end.0,
        nees_end: o.nees_end,
        log_density_end: o.log_density_end,
        horizontal_error_end_m: f64::NAN,
        reconvergence_s: f64::NAN,
    };
    RunRecord {
        run: 0,
        diverged: false,
        outages: outages.iter().map(of_outage).collect(),
        nis: (law.nis.0 / law.nis.1.max(1) as f64, law.nis.1),
        rejected: 0,
        nees_mean: mean(&|e| e.nees.value),
        covered: mean(&|e| e.coverage),
        normalised_sq: std::array::from_fn(|i| mean(&|e| (e.rmse.0[i].value / e.asee.0[i].value).powi(2))),
    }
}
