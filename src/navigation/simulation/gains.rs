//! One covariance for all runs of a filter.
//!
//! The gains of a filter depend on its own estimate only through the point about which it linearises. The covariance
//! along the reference therefore serves every run, and runs need strapdown and corrections alone. That holds while
//! errors are small: runs are made both ways in the first batch and in one of [`CHECKED`], and compared.

use super::batch::{Batch, BatchFilter, run_candidates};
use super::lincov::{FilterPass, Track};
use super::plan::Plan;
use super::{BIASES, NEES_DOF, REPORTED};
use crate::ekf::{FixUpdate, SharedUpdate};
use crate::lanes::LANES;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Covariance from which the runs of a filter take their gains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Gains {
    /// Shared where runs 0 to 7, made both ways, agree within 3 % in standard deviations and errors.
    #[default]
    Auto,
    /// Each run has its own, about its own estimate.
    Own,
    /// All runs have those along the reference.
    Shared,
}

nav_sim_signal::named!(Gains { Auto = "auto", Own = "own", Shared = "shared" });

/// The gains that runs had.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct GainsUsed {
    /// True if they shared those along the reference.
    pub is_shared: bool,
    /// Largest relative difference between eight runs with shared and with own gains, wherever they were made both ways.
    pub largest_difference: Option<f64>,
}

impl GainsUsed {
    /// Adds the comparison of further runs.
    pub(crate) fn add(&mut self, further: Self) {
        let differences = [self.largest_difference, further.largest_difference];
        self.largest_difference = differences.into_iter().flatten().reduce(f64::max);
    }

    /// True if later runs made both ways differ by more than eight runs do by chance.
    pub fn disagree(&self) -> bool {
        self.is_shared
            && self
                .largest_difference
                .is_some_and(|found| found > 2.0 * AGREEMENT)
    }
}

/// Figures of eight runs made both ways may differ by this share; those of many then differ by less (docs/validation.md).
const AGREEMENT: f64 = 0.03;
/// One batch in this many is made both ways.
const CHECKED: u64 = 64;

/// A filter along the reference, event by event.
pub(super) type SharedFilter = Vec<SharedEvent>;

/// A filter at an event of the reference.
#[derive(Debug)]
pub(super) struct SharedEvent {
    /// Covariance of the navigation error before the measurements, where an outage ends.
    pub before: Option<NavigationCovariance>,
    pub updates: Arc<[SharedUpdate]>,
    /// The same after them, and standard deviations of the sensors' biases (m/s², rad/s), where they are reported.
    pub after: Option<(NavigationCovariance, [f64; BIASES])>,
}

type NavigationCovariance = [[f64; NEES_DOF]; NEES_DOF];

/// The gains of all candidates, decided once a plan.
#[derive(Debug)]
pub(super) struct SharedGains {
    /// For each candidate its filter along the reference, or none where runs have their own.
    shared: Vec<Option<SharedFilter>>,
    /// Runs 0 to 7, where they were made to decide it.
    first: Option<Vec<Batch>>,
}

impl SharedGains {
    pub(super) fn new(plan: &Plan<'_>) -> Self {
        let (filter_models, gains) = (plan.experiment.filter_models, plan.experiment.gains);
        if gains == Gains::Own || plan.experiment.update == FixUpdate::Iterated {
            let shared = filter_models.iter().map(|_| None).collect();
            return Self {
                shared,
                first: None,
            };
        }
        let own;
        let track = match plan.track {
            Some(track) => track,
            None => {
                own = Track::along(plan.experiment).expect("planned");
                &own
            }
        };
        let along = |filter_model| Some(FilterPass::new(track, filter_model).events());
        let mut shared: Vec<_> = filter_models.iter().map(along).collect();
        if gains == Gains::Shared {
            return Self {
                shared,
                first: None,
            };
        }
        let mut first = Vec::new();
        for (i, (batch, own)) in both_ways(plan, 0, LANES, &shared).into_iter().enumerate() {
            let difference = batch.gains.largest_difference;
            match own.filter(|_| difference.is_some_and(|found| found > AGREEMENT)) {
                Some(mut own) => {
                    shared[i] = None;
                    own.gains.largest_difference = difference;
                    first.push(own);
                }
                None => first.push(batch),
            }
        }
        let first = Some(first);
        Self { shared, first }
    }
}

/// Runs `first..first + live` (at most [`LANES`]) through all candidates: the noise is drawn once.
pub fn run_batch(plan: &Plan<'_>, first: u64, live: usize) -> Vec<Batch> {
    let decision = plan.decision();
    let is_whole = live == LANES;
    let Some(decided) = decision.first.as_ref().filter(|_| is_whole) else {
        return run_candidates(plan, first, live, &filters(plan, &decision.shared));
    };
    if first == 0 {
        return decided.clone();
    }
    if (first / LANES as u64).is_multiple_of(CHECKED) {
        let both = both_ways(plan, first, live, &decision.shared).into_iter();
        return both.map(|(batch, _)| batch).collect();
    }
    run_candidates(plan, first, live, &filters(plan, &decision.shared))
}

fn filters<'a>(plan: &'a Plan<'_>, shared: &'a [Option<SharedFilter>]) -> Vec<BatchFilter<'a>> {
    let shared = shared.iter().map(Option::as_ref);
    plan.experiment.filter_models.iter().zip(shared).collect()
}

/// A batch with the gains given, and for each candidate that shares them the same with its own.
fn both_ways(
    plan: &Plan<'_>,
    first: u64,
    live: usize,
    shared: &[Option<SharedFilter>],
) -> Vec<(Batch, Option<Batch>)> {
    let mut candidates = filters(plan, shared);
    let sharing = candidates
        .clone()
        .into_iter()
        .filter(|(_, shared)| shared.is_some());
    candidates.extend(sharing.map(|(filter_model, _)| (filter_model, None)));
    let mut batches = run_candidates(plan, first, live, &candidates);
    let mut owns = batches.split_off(shared.len()).into_iter();
    let compared = |(mut batch, shared): (Batch, &Option<SharedFilter>)| {
        let own = shared.as_ref().and_then(|_| owns.next());
        batch.gains.largest_difference = own.as_ref().map(|own| largest_difference(&batch, own));
        (batch, own)
    };
    batches.into_iter().zip(shared).map(compared).collect()
}

/// Largest relative difference of two batches on the same noise: of mean standard deviations at any report, and of root
/// mean squares of errors at the ends of outages, which a persistent error that no filter knows moves while standard
/// deviations stay. Infinite where a run diverged.
fn largest_difference(shared: &Batch, own: &Batch) -> f64 {
    if shared.runs.iter().chain(&own.runs).any(|run| run.diverged) {
        return f64::INFINITY;
    }
    let [shared, own] = [shared, own].map(|batch| {
        let deviations = batch
            .epochs
            .iter()
            .flat_map(|e| e.see.iter().chain(&e.bias_see));
        let mut figures: Vec<f64> = deviations.copied().collect();
        for k in 0..batch.runs[0].outages.len() {
            let ends = || batch.runs.iter().map(|run| run.outages[k].error_end);
            let rms = |i: usize| ends().map(|e| e[i] * e[i]).sum::<f64>().sqrt();
            figures.extend((0..REPORTED).map(rms));
        }
        figures
    });
    let differences = shared.iter().zip(&own).map(|(a, b)| (a / b - 1.0).abs());
    // of a perfect start both are zero
    differences.filter(|d| !d.is_nan()).fold(0.0, f64::max)
}
