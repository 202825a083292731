//! Monte Carlo: lane batches distributed over threads, reduced in run order.
//!
//! Batches of eight runs are handed out to any number of threads and added up in order, so that the result is the same
//! to the last bit. At most 64 wait for their turn: memory does not grow with the number of runs, except for one
//! small record per run.
//!
//! ```
//! # use nav_sim_navigation::trajectory::profile::{Bank, SegmentKind, Length, Profile, Segment, ProfileStart};
//! use nav_sim_navigation::ekf::{FilterModel, FilterStates};
//! use nav_sim_navigation::metrics::{chi_square_band, epochs};
//! use nav_sim_navigation::monte_carlo;
//! use nav_sim_navigation::scenario::Scenario;
//! use nav_sim_navigation::sensors::imu::Truth;
//! use nav_sim_signal::noise::{Composite, Model, Process};
//!
//! # let start = ProfileStart { t_s: 0.0, lat: 0.9, lon: 0.2, h: 0.0, heading: 0.0, speed: 20.0 };
//! # let north = Segment { kind: SegmentKind::Straight(Length::Duration(60.0)), climb_m: 0.0, ramp_s: None };
//! # let drive = Profile { start, bank: Bank::None, ramp_s: 2.0, segments: vec![north] }.build()?;
//! let axis = Composite::new(vec![Process::white(1e-6)?, Process::random_walk(1e-14)?]);
//! let model = Model::pooled(100.0, &axis, &axis);
//! let scenario = Scenario::default();
//! let beliefs = [FilterModel::new(&model, FilterStates::Full, 1.0, 800.0)?.with_initial(&scenario.initial)];
//! let experiment = scenario.experiment(&drive, Truth::Model(&model), &beliefs, &[], 1);
//! let results = monte_carlo::run(&experiment, 40, &|_| {})?;
//! let last = epochs(&results[0]).pop().expect("an epoch a second");
//! // The filter has the model of the truth: the mean of 40 NEES is chi-square of 360 degrees of freedom over 40.
//! let band = chi_square_band(9, 40.0);
//! assert!((band.lower..band.upper).contains(&last.nees.value));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::ekf::FilterModel;
use crate::lanes::LANES;
use crate::simulation::{
    EpochSums, Experiment, ExperimentError, GainsUsed, Plan, REPORTED, RunRecord, RunResult,
    run_batch,
};
use rayon::prelude::*;

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
    let results = run_range(&Plan::new(experiment)?, 0, runs, &|| true, progress);
    Ok(results.expect("unstoppable"))
}

/// Runs `first..first + runs` of a planned experiment; `None` if `go_on`, asked before each batch of eight,
/// said no. Sums are made in run order, batches of eight from `first` on.
pub fn run_range(
    plan: &Plan<'_>,
    first: u64,
    runs: u64,
    go_on: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn(u64) + Sync),
) -> Option<Vec<RunResult>> {
    let experiment = plan.experiment;
    let windows = experiment.outages.iter().map(|o| (o.start_s, o.end_s));
    let empty = |filter_model: &FilterModel| RunResult {
        outages: windows.clone().collect(),
        filter_states: filter_model.states,
        fix_components: experiment.gnss.components(),
        coverage_level: experiment.coverage_level,
        independent_windows: experiment.truth.independent_windows(plan.samples()),
        ..RunResult::default()
    };
    let mut results: Vec<RunResult> = experiment.filter_models.iter().map(empty).collect();
    let all: Vec<u64> = (0..runs).step_by(LANES).collect();
    for together in all.chunks(TOGETHER) {
        let batch = |done: &u64| {
            let live = (runs - done).min(LANES as u64);
            let computed = go_on().then(|| run_batch(plan, first + done, live as usize))?;
            progress(live);
            Some(computed)
        };
        // Floating-point sums depend on their order: they are made in the order of the runs, whoever finishes first.
        for parts in together.par_iter().map(batch).collect::<Option<Vec<_>>>()? {
            for (result, part) in results.iter_mut().zip(parts) {
                result.run_epochs += (plan.samples() * part.runs.len()) as u64;
                result.add(part.epochs, part.runs, part.gains);
            }
        }
    }
    Some(results)
}

/// Batches that wait to be added: memory is bounded, and no thread waits long for the last of them.
const TOGETHER: usize = 64;

impl RunResult {
    fn add(&mut self, epochs: Vec<EpochSums>, runs: Vec<RunRecord>, gains: GainsUsed) {
        if self.epochs.is_empty() {
            self.epochs = epochs;
            self.gains = gains;
        } else {
            self.epochs
                .iter_mut()
                .zip(&epochs)
                .for_each(|(sum, epoch)| sum.add(epoch));
            self.gains.add(gains);
        }
        self.runs.extend(runs);
    }

    /// Adds the result of further runs of the same experiment, made at the same epochs.
    pub fn append(&mut self, later: Self) {
        self.run_epochs += later.run_epochs;
        self.add(later.epochs, later.runs, later.gains);
    }
}

impl EpochSums {
    /// Adds the sums of further runs at the same epoch.
    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.covered += other.covered;
        self.first_error = self.first_error.or(other.first_error);
        for i in 0..REPORTED {
            self.see[i] += other.see[i];
            self.see_sq[i] += other.see_sq[i];
            self.error[i] += other.error[i];
            self.error_sq[i] += other.error_sq[i];
            self.error_4[i] += other.error_4[i];
        }
        for (sum, more) in self.bias_see.iter_mut().zip(other.bias_see) {
            *sum += more;
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
