//! Studies: cells that survive and spread over machines.

use crate::answer::Answer;
use crate::error;
use crate::work::work;
use nav_sim::app::{Answer as _, Answered, Context};
use nav_sim::commands::batch::{BatchRequest, Outcome};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Computes what is missing of a study, or of a shard of it, and merges when nothing is: the answer, if nothing is
/// missing; and what was warned of.
#[pyfunction]
#[pyo3(signature = (study, directory, shard, time_limit_s, progress, threads=None))]
pub(crate) fn study_run(
    py: Python<'_>,
    study: PathBuf,
    directory: PathBuf,
    shard: Option<(u64, u64)>,
    time_limit_s: Option<f64>,
    progress: Option<&Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<(Option<Answer>, Vec<String>)> {
    if let Some((index, count)) = shard.filter(|(index, count)| index >= count) {
        let message = format!("shard: {index} of {count} is none, such as (0, 2) and (1, 2)");
        return Err(error::refused(py, &message));
    }
    let limit = time_limit_s.and_then(|s| Duration::try_from_secs_f64(s).ok());
    let (outcome, warnings) = work(py, progress, threads, move |meter| {
        let deadline = limit.and_then(|limit| Instant::now().checked_add(limit));
        deadline.map(|end| meter.deadline.set(end));
        let request = BatchRequest {
            study,
            out: Some(directory),
            shard,
            states: vec!["all".to_owned()],
            ..BatchRequest::default()
        };
        let outcome = request.run(&|_| None, &Context::new(meter, None));
        (outcome, meter.warnings())
    })?;
    let outcome = outcome.and_then(|outcome| match outcome.unmet() {
        Some(failure) if matches!(outcome, Outcome::Stopped { .. }) => Err(failure),
        _ => Ok(outcome),
    });
    let answer = match outcome.map_err(|e| error::of_failure(py, &e, ""))? {
        Outcome::Merged(answer) => {
            let answered = Answered {
                json: serde_json::to_string(&*answer).unwrap_or_default(),
                document: answer.document(),
                files: Vec::new(),
                unmet: answer.unmet(),
            };
            Some(Answer::new(answered, String::new(), warnings.clone()))
        }
        _ => None,
    };
    Ok((answer, warnings))
}
