//! Requests in: JSON with the names of the commands' options.

use crate::answer::Answer;
use crate::error;
use crate::work::{Meter, work};
use nav_sim::app::{Failure, Front};
use nav_sim::document::{Importance, Note};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Takes down what a job warns of, and counts what it does.
pub(crate) struct Clerk<'a> {
    pub(crate) meter: &'a Meter,
    warnings: Mutex<Vec<String>>,
    deadline: Option<Instant>,
}

impl<'a> Clerk<'a> {
    pub(crate) fn new(meter: &'a Meter) -> Self {
        Self::until(meter, None)
    }

    /// One that stops jobs which can be resumed at a time.
    pub(crate) fn until(meter: &'a Meter, deadline: Option<Instant>) -> Self {
        let warnings = Mutex::default();
        Self {
            meter,
            warnings,
            deadline,
        }
    }

    pub(crate) fn warn_of(&self, doubt: String) {
        self.warnings
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(doubt);
    }

    pub(crate) fn warnings(self) -> Vec<String> {
        self.warnings
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

impl Front for Clerk<'_> {
    fn note(&self, note: Note) {
        if note.importance == Importance::Warning {
            self.warn_of(note.text);
        }
    }

    fn begin(&self, _: &str, steps: u64) {
        self.meter.begin(steps);
    }

    fn advance(&self, steps: u64) {
        self.meter.advance(steps);
    }

    fn go_on(&self) -> bool {
        self.meter.goes_on()
            && self
                .deadline
                .is_none_or(|deadline| Instant::now() < deadline)
    }
}

/// What `command` answers to a request. `hidden`: a directory that no text shows.
#[pyfunction]
#[pyo3(signature = (command, request, hidden, progress))]
pub(crate) fn answer(
    py: Python<'_>,
    command: String,
    request: String,
    hidden: String,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Answer> {
    let (answered, warnings) = work(py, progress, move |meter| {
        let clerk = Clerk::new(meter);
        let options = serde_json::from_str(&request).map_err(Failure::input);
        let answered =
            options.and_then(|options| nav_sim::commands::answer(&command, options, &clerk));
        (answered, clerk.warnings())
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
