//! Requests in: TOML with the keys of the commands' options.

use crate::answer::Answer;
use crate::error;
use crate::work::{Meter, work};
use nav_sim::answered::request;
use nav_sim::app::{self, Answered, Context, Front};
use nav_sim::calibrate::CalibrationRequest;
use nav_sim::choose::ChoiceRequest;
use nav_sim::commands::run::Run;
use nav_sim::compare::CompareRequest;
use nav_sim::design::DesignRequest;
use nav_sim::document::{Importance, Note};
use nav_sim::failure::Failure;
use nav_sim::fuse::FuseRequest;
use nav_sim::require::RequireRequest;
use nav_sim::tune::TuneRequest;
use nav_sim::wv::WaveletRequest;
use pyo3::prelude::*;
use serde_json::{Map, Value};
use std::ffi::OsString;
use std::sync::{Mutex, PoisonError};

/// Seed where neither the request nor a file has one: the same call gives the same answer.
pub(crate) const SEED: u64 = 1;

/// Takes down what a job warns of, and counts what it does.
pub(crate) struct Clerk<'a> {
    pub(crate) meter: &'a Meter,
    warnings: Mutex<Vec<String>>,
}

impl<'a> Clerk<'a> {
    pub(crate) fn new(meter: &'a Meter) -> Self {
        Self {
            meter,
            warnings: Mutex::default(),
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
        let answered = answered(&command, &request, &clerk);
        (answered, clerk.warnings())
    })?;
    let answered = answered.map_err(|e| match e {
        Some(failure) => error::of_failure(py, &failure, &hidden),
        None => error::refused(py, "there is no such command"),
    })?;
    let warnings = warnings
        .iter()
        .map(|doubt| error::shown(doubt, &hidden))
        .collect();
    Ok(Answer::new(answered, hidden, warnings))
}

/// The answer, or the failure; no failure where there is no such command.
fn answered(command: &str, text: &str, clerk: &Clerk<'_>) -> Result<Answered, Option<Failure>> {
    let mut options: Map<String, Value> =
        serde_json::from_str(text).map_err(|e| Failure::input(e))?;
    let seed = options.get("seed").and_then(Value::as_u64);
    let context = Context::new(clerk, seed);
    if command == "run" {
        options.remove("seed");
        return Ok(app::answered::<Run>(&options, context)?);
    }
    let context = &context;
    let text = &toml::to_string(&options).map_err(|e| Failure::input(e))?;
    Ok(match command {
        "wv" => request::<WaveletRequest>(text)?.answer(context)?,
        "calibrate" => {
            let advance = |steps| clerk.meter.advance(steps);
            request::<CalibrationRequest>(text)?.answer(context, &advance)?
        }
        "fuse" => request::<FuseRequest>(text)?.answer()?,
        "tune" => request::<TuneRequest>(text)?.answer(context)?,
        "require" => request::<RequireRequest>(text)?.answer(context)?,
        "design" => request::<DesignRequest>(text)?.answer(context)?,
        "choose" => request::<ChoiceRequest>(text)?.answer(|| SEED, context)?,
        "compare" => request::<CompareRequest>(text)?.answer()?,
        _ => return Err(None),
    })
}

/// The command line: does what its words, the program first, ask for, and returns the exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| nav_sim::cli::run(words))
}
