//! Studies: grids of experiments in units that survive.

use crate::answer::Answer;
use crate::error;
use crate::request::{Clerk, SEED};
use crate::work::work;
use nav_sim::app::Context;
use nav_sim::failure::Failure;
use nav_sim::navigation::simulation::REPORTED_NAMES;
use nav_sim::study::{
    self, MergeOptions, PlanOptions, Planned, RunOptions, Shard, StudyError, Writing,
};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::thread::available_parallelism;

fn threads() -> usize {
    available_parallelism().map_or(1, Into::into)
}

/// Does a part of a study, and what it warned of.
fn watched<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    part: impl FnOnce(&Context<'_>) -> Result<T, StudyError> + Send + 'static,
) -> PyResult<(T, Vec<String>)> {
    let (done, warnings) = work(py, progress, move |meter| {
        let clerk = Clerk::new(meter);
        let done = part(&Context::new(&clerk, None));
        (done, clerk.warnings())
    })?;
    Ok((
        done.map_err(|e| error::of_failure(py, &Failure::from(e), ""))?,
        warnings,
    ))
}

/// Plans a study: its units, and what was warned of.
#[pyfunction]
#[pyo3(signature = (study, directory, seed, progress))]
pub(crate) fn study_plan(
    py: Python<'_>,
    study: PathBuf,
    directory: PathBuf,
    seed: Option<u64>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(usize, Vec<String>)> {
    watched(py, progress, move |clerk| {
        let seed = |of_study: Option<u64>| seed.or(of_study).unwrap_or(SEED);
        let options = PlanOptions {
            seed: &seed,
            threads: threads(),
            clock: None,
            writing: Writing::Write,
        };
        let planned = study::plan(&study, &directory, &options, clerk)?.planned;
        Ok(planned.plan.unit_count(&planned.grid))
    })
}

/// Runs the units of a shard that are not there yet: how many were done, how many are left, and what was warned of.
#[pyfunction]
#[pyo3(signature = (study, directory, shard, shards, progress))]
pub(crate) fn study_run(
    py: Python<'_>,
    study: PathBuf,
    directory: PathBuf,
    shard: u64,
    shards: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<((usize, usize), Vec<String>)> {
    let Some(shard) = Shard::new(shard, shards) else {
        let message = format!("shard: {shard} of {shards} is none, such as (0, 2) and (1, 2)");
        return Err(error::refused(py, &message));
    };
    watched(py, progress, move |clerk| {
        let planned = Planned::open(&study, &directory, None)?;
        let ran = study::run(
            &planned,
            &RunOptions {
                shard,
                threads: threads(),
            },
            clerk,
        )?;
        Ok((ran.finished, ran.left))
    })
}

/// Makes the tables of a study whose units are all there: its answer, and the directory of the tables.
#[pyfunction]
#[pyo3(signature = (study, directory, progress))]
pub(crate) fn study_merge(
    py: Python<'_>,
    study: PathBuf,
    directory: PathBuf,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Answer, PathBuf)> {
    let (merged, warnings) = watched(py, progress, move |clerk| {
        let planned = Planned::open(&study, &directory, None)?;
        let states = (0..REPORTED_NAMES.len()).collect();
        study::merge(
            &planned,
            &MergeOptions {
                states,
                threads: threads(),
            },
            clerk,
        )
    })?;
    let unmet = (merged.diverged > 0).then(|| format!("{} runs diverged", merged.diverged));
    let answer = Answer::of(merged.summary.to_string(), merged.document, unmet, warnings);
    Ok((answer, merged.results))
}
