//! All runs: lane batches over threads, reduced in run order.
//!
//! Batches of eight runs are handed out in order to any number of threads and added up in order as they
//! come back, so that the result is the same to the last bit. One batch a thread is in flight and few
//! wait for their turn: memory does not grow with the number of runs (but for one small record a run).

use crate::lanes::LANES;
use crate::simulation::{
    Batch, EpochSums, Experiment, ExperimentError, Plan, REPORTED, RunResult, run_batch,
};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Runs `0..runs` of an experiment, all candidates on the same noise; one result a candidate, in their
/// order. `progress` is told how many runs have been completed.
///
/// # Errors
/// When the experiment does not fit together; see [`ExperimentError`].
pub fn run(
    experiment: &Experiment<'_>,
    runs: u64,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Vec<RunResult>, ExperimentError> {
    let plan = Plan::new(experiment)?;
    let results = experiment.beliefs.iter().map(|b| empty(experiment, b.states)).collect();
    let sums = Mutex::new(InOrder { results, next: 0, waiting: BTreeMap::new() });
    (0..runs.div_ceil(LANES as u64)).par_bridge().for_each(|batch| {
        let first = batch * LANES as u64;
        let live = (runs - first).min(LANES as u64);
        let computed = run_batch(&plan, first, live as usize);
        progress(live);
        sums.lock().unwrap_or_else(PoisonError::into_inner).take(batch, computed, plan.samples());
    });
    Ok(sums.into_inner().unwrap_or_else(PoisonError::into_inner).results)
}

/// The results so far, and the batches that came before their turn: one of each candidate.
struct InOrder {
    results: Vec<RunResult>,
    next: u64,
    waiting: BTreeMap<u64, Vec<Batch>>,
}

impl InOrder {
    fn take(&mut self, batch: u64, computed: Vec<Batch>, samples: usize) {
        self.waiting.insert(batch, computed);
        while let Some(parts) = self.waiting.remove(&self.next) {
            self.next += 1;
            for (result, part) in self.results.iter_mut().zip(parts) {
                result.run_epochs += (samples * part.runs.len()) as u64;
                add(result, part);
            }
        }
    }
}

fn empty(experiment: &Experiment<'_>, filter_states: usize) -> RunResult {
    RunResult {
        outages: experiment.outages.iter().map(|o| (o.start_s, o.end_s)).collect(),
        filter_states,
        fix_components: experiment.gnss.components(),
        coverage_level: experiment.coverage_level,
        ..RunResult::default()
    }
}

fn add(result: &mut RunResult, part: Batch) {
    if result.epochs.is_empty() {
        result.epochs = part.epochs;
    } else {
        result.epochs.iter_mut().zip(&part.epochs).for_each(|(sum, epoch)| sum.add(epoch));
    }
    result.runs.extend(part.runs);
}

impl EpochSums {
    /// Adds the sums of further runs at the same epoch.
    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.covered += other.covered;
        for i in 0..REPORTED {
            self.see[i] += other.see[i];
            self.see_sq[i] += other.see_sq[i];
            self.error[i] += other.error[i];
            self.error_sq[i] += other.error_sq[i];
            self.error_4[i] += other.error_4[i];
        }
        for i in 0..2 {
            self.pos_error[i] += other.pos_error[i];
            self.att_error[i] += other.att_error[i];
            self.nees[i] += other.nees[i];
        }
    }
}

#[cfg(test)]
mod tests;
