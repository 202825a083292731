//! Expected figures by covariance analysis: the values about which runs would scatter, without a
//! run.

use super::estimate::{Estimate, PerState, QuadraticForm};
use super::outage::{EpochMetrics, is_beyond_linear, within};
use super::summary::{
    AccuracySummary, Nis, OutageSummary, QuantileSummary, Recovery, Summary, with_verdicts,
};
use super::verdict;
use crate::ekf::FilterModel;
use crate::linalg::mean;
use crate::noise::Model;
use crate::sensors::outage::Outage;
use crate::simulation::lincov::{
    AssessedInstant, ErrorDistribution, FilterPass, Instant, Track, TruthModel,
};
use crate::simulation::{
    BIASES, COVERAGE_DOF, Experiment, NEES_DOF, OutageRecord, REPORTED, RunRecord,
};
use crate::units::DEG;
use nalgebra::DMatrix;

/// States of the coverage statistic among those of the filter: position, attitude.
const COVERED: [usize; COVERAGE_DOF] = [0, 1, 2, 6, 7, 8];
/// Velocity down among the reported states.
const VELOCITY_DOWN: usize = 5;
/// Probability of the quantile that stands for the largest error, which a law without end does not have.
const NEARLY_ALL: f64 = 0.999;

/// The law of a filter's errors as the figures of a run.
#[derive(Debug, Clone)]
pub struct ExpectedRun {
    /// Statistics of every reporting epoch, all without a Monte-Carlo error.
    pub epochs: Vec<EpochMetrics>,
    /// A run whose squares are the expected ones: it stands for all runs where runs are compared.
    pub record: RunRecord,
    /// The summary: as that of runs, without what only runs have (null).
    pub summary: Summary,
}

impl ExpectedRun {
    /// The figures of a filter in an experiment whose inertial errors `truth` makes, along the experiment's track; none
    /// where a covariance did not stay finite and positive.
    pub fn along(
        track: &Track,
        experiment: &Experiment<'_>,
        filter_model: &FilterModel,
        truth: &Model,
    ) -> Option<Self> {
        let truth = TruthModel::together(&TruthModel::sources(experiment, truth));
        let filter = FilterPass::new(track, filter_model);
        let law = filter.errors(&truth);
        let limit = experiment.coverage_quantile();
        let reports = law.reports.iter().zip(&filter.biases);
        let epochs: Vec<EpochMetrics> = reports
            .map(|(instant, bias)| epoch(instant, *bias, limit))
            .collect::<Option<_>>()?;
        let ends = experiment.outages.iter().zip(&law.outage_ends);
        let of_outage = |(window, end): (&Outage, &AssessedInstant)| {
            let mut outage = outage((window.start_s, window.end_s), end, &epochs);
            // A barometer or a vehicle that measures in the outage corrects what grows upwards.
            let lasts = |rate_hz: f64| (window.end_s - window.start_s) * rate_hz >= 1.0;
            let sees_height = experiment.baro.is_some_and(|b| lasts(b.rate_hz))
                || experiment
                    .aiding
                    .nhc
                    .as_ref()
                    .is_some_and(|nhc| lasts(nhc.rate_hz));
            let sigma_m_s = outage.asee_end.0[VELOCITY_DOWN];
            outage.beyond_linear =
                !sees_height && is_beyond_linear(window, &law.reports, sigma_m_s);
            outage
        };
        let outages: Vec<OutageSummary> = ends.map(of_outage).collect();
        let record = record(&epochs, &law, &outages);
        let beyond_linear = outages.iter().position(|outage| outage.beyond_linear);
        let (verdict, verdicts) = verdict::expected(&record, beyond_linear);
        let (nis, fixes) = record.nis;
        let summary = Summary {
            method: "lincov",
            filter_states: filter_model.states,
            seed: Some(experiment.seed),
            outages: with_verdicts(outages, verdicts),
            nis: Nis {
                dof: experiment.gnss.components(),
                mean: if fixes > 0 { nis } else { f64::NAN },
                lower95: f64::NAN,
                upper95: f64::NAN,
                fixes,
            },
            ..Summary::over(&epochs, verdict, experiment.coverage_level, None)
        };
        // NaN comes from a believed covariance without a Cholesky factor: at any report it makes the mean
        // NaN.
        record.nees_mean.is_finite().then_some(Self {
            epochs,
            record,
            summary,
        })
    }
}

fn exact(value: f64) -> Estimate {
    Estimate {
        value,
        std_error: 0.0,
    }
}

fn exactly(values: [f64; REPORTED]) -> PerState<Estimate> {
    PerState(values.map(exact))
}

/// A block of a covariance, by states.
fn block(p: &[[f64; NEES_DOF]; NEES_DOF], states: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(states.len(), states.len(), |i, j| p[states[j]][states[i]])
}

/// Mean norm of the error in these states: E ‖e‖ (m, m/s, rad).
fn mean_size(instant: &Instant, states: &[usize]) -> f64 {
    square(instant, states).mean_root()
}

/// Quantiles of the horizontal error (m).
pub fn horizontal_quantiles<const N: usize>(
    instant: &Instant,
    probabilities: [f64; N],
) -> [f64; N] {
    let horizontal = square(instant, &[0, 1]);
    probabilities.map(|p| horizontal.quantile(p).sqrt())
}

/// The law of ‖e‖² over these states.
fn square(instant: &Instant, states: &[usize]) -> QuadraticForm {
    let mean: Vec<f64> = states.iter().map(|s| instant.mean[*s]).collect();
    QuadraticForm::of_square(&block(&instant.covariance, states), &mean)
}

fn epoch(judged: &AssessedInstant, bias_asee: [f64; BIASES], limit: f64) -> Option<EpochMetrics> {
    let (instant, believed) = (&judged.errors, block(&judged.believed, &COVERED));
    let mean = COVERED.map(|s| instant.mean[s]);
    // eᵀ P_f⁻¹ e is not chi-square where P_f is not the covariance of e: a weighted sum of such, whose law is
    // exact.
    let inside =
        QuadraticForm::of_normalised(&believed, &block(&instant.covariance, &COVERED), &mean)?;
    Some(EpochMetrics {
        t_s: instant.t_s,
        gnss: instant.fix,
        count: 0,
        asee: exactly(judged.sigma()),
        bias_asee,
        rmse: exactly(instant.rmse()),
        bias: exactly(instant.reported(&instant.mean)),
        first_error: None,
        mean_pos_err_m: exact(mean_size(instant, &[0, 1, 2])),
        mean_att_err_deg: exact(mean_size(instant, &[6, 7, 8]) / DEG),
        nees: exact(judged.consistency().nees),
        coverage: inside.cdf(limit),
    })
}

fn outage(
    (start_s, end_s): (f64, f64),
    end: &AssessedInstant,
    epochs: &[EpochMetrics],
) -> OutageSummary {
    let accuracy = AccuracySummary::over(within((start_s, end_s), epochs));
    let [p50, p95, p999] = horizontal_quantiles(&end.errors, [0.5, 0.95, NEARLY_ALL]);
    let consistency = end.consistency();
    OutageSummary {
        start_s,
        end_s,
        asee_mean: accuracy.asee_mean,
        rmse_mean: accuracy.rmse_mean,
        asee_end: PerState(end.sigma()),
        rmse_end: PerState(end.errors.rmse()),
        nees_end: consistency.nees,
        log_density_end: consistency.log_density,
        horizontal_error_end_m: QuantileSummary {
            p50,
            p95,
            p999: Some(p999),
            max: f64::NAN,
            ..QuantileSummary::default()
        },
        reconvergence_s: Recovery {
            p50: f64::NAN,
            p95: f64::NAN,
            never: None,
        },
        ..OutageSummary::default()
    }
}

/// The run whose squares are the expected ones.
fn record(
    epochs: &[EpochMetrics],
    law: &ErrorDistribution,
    outages: &[OutageSummary],
) -> RunRecord {
    let mean = |value: &dyn Fn(&EpochMetrics) -> f64| mean(epochs.iter().map(value));
    let of_outage = |o: &OutageSummary| OutageRecord {
        see_mean: o.asee_mean.0,
        see_end: o.asee_end.0,
        error_end: o.rmse_end.0,
        nees_end: o.nees_end,
        log_density_end: o.log_density_end,
        // The horizontal error is not normal, and a run with its mean square is not a run of its median.
        horizontal_error_end_m: f64::NAN,
        reconvergence_s: f64::NAN,
    };
    RunRecord {
        run: 0,
        diverged: false,
        outages: outages.iter().map(of_outage).collect(),
        nis: (law.nis.0 / law.nis.1.max(1) as f64, law.nis.1),
        nees_mean: mean(&|e| e.nees.value),
        covered: mean(&|e| e.coverage),
        // The mean of squares over the epochs, as runs have it; the root is taken by the verdict.
        normalised_sq: std::array::from_fn(|i| {
            mean(&|e| (e.rmse.0[i].value / e.asee.0[i].value).powi(2))
        }),
    }
}
