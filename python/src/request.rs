//! Requests in: JSON with the names of the commands' options.

use crate::answer::Answer;
use crate::error;
use crate::work::work;
use nav_sim::app::Failure;
use pyo3::prelude::*;
use std::ffi::OsString;

/// What `command` answers to a request. `hidden`: a directory that no text shows.
#[pyfunction]
#[pyo3(signature = (command, request, hidden, progress, threads=None))]
pub(crate) fn answer(
    py: Python<'_>,
    command: String,
    request: String,
    hidden: String,
    progress: Option<&Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let (answered, warnings) = work(py, progress, threads, move |meter| {
        let options = serde_json::from_str(&request).map_err(Failure::input);
        let answered =
            options.and_then(|options| nav_sim::commands::answer(&command, options, meter));
        (answered, meter.warnings())
    })?;
    let answered = answered.map_err(|failure| error::of_failure(py, &failure, &hidden))?;
    let warnings = warnings
        .iter()
        .map(|doubt| error::shown(doubt, &hidden))
        .collect();
    Ok(Answer::new(answered, hidden, warnings))
}

/// JSON as TOML.
#[pyfunction]
pub(crate) fn toml(py: Python<'_>, json: &str) -> PyResult<String> {
    let table: Result<::toml::Table, _> = serde_json::from_str(json);
    let text = table.map(|table| ::toml::to_string(&table));
    match text {
        Ok(Ok(text)) => Ok(text),
        Ok(Err(e)) => Err(error::refused(py, &e.to_string())),
        Err(e) => Err(error::refused(py, &e.to_string())),
    }
}

/// The command line: does what its words, the program first, ask for, and returns the exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| nav_sim::cli::run(words))
}
