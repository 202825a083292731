//! Requests in: JSON with the names of the commands' options.

use crate::error;
use crate::work::work;
use nav_sim::app::{Answer as _, Context, Failure, RenderedAnswer};
use nav_sim::commands::batch::{BatchOutcome, BatchRequest};
use nav_sim::document::Importance;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Answers a request to `command`. `hidden`: a directory that no text shows.
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
    Ok(Answer {
        answered,
        hidden,
        warnings,
    })
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

// What a request comes to.

/// Characters of a line of a summary.
const WIDTH: usize = 120;

/// The answer to a request: as the command prints, draws and writes it.
#[pyclass(frozen, module = "nav_sim._native")]
pub(crate) struct Answer {
    answered: RenderedAnswer,
    /// Directory of what came as arrays, which no text shows.
    hidden: String,
    /// Doubts about the input.
    #[pyo3(get)]
    warnings: Vec<String>,
}

impl Answer {
    /// A text without the directory of what came as arrays. JSON writes the backslashes of Windows twice.
    fn shown(&self, text: &str) -> String {
        if self.hidden.is_empty() {
            return text.to_owned();
        }
        text.replace(&self.hidden.replace('\\', "\\\\"), "")
            .replace(&self.hidden, "")
    }
}

#[pymethods]
impl Answer {
    /// The answer in JSON.
    fn json(&self) -> String {
        self.shown(&self.answered.json)
    }

    /// The answer as text for the terminal.
    fn summary(&self, py: Python<'_>) -> String {
        py.detach(|| {
            let document = &self.answered.document;
            let text = document.terminal(WIDTH);
            let spoken = document
                .shown_notes(false)
                .map(|note| match note.importance {
                    Importance::Warning => format!("\nwarning: {}", note.text),
                    _ => format!("\nnote: {}", note.text),
                });
            self.shown(&(text.trim_end().to_owned() + &spoken.collect::<String>()))
        })
    }

    /// Its verdict, a line each.
    fn verdict(&self) -> Vec<String> {
        let lines = self.answered.document.verdict.iter();
        lines.map(|line| self.shown(line)).collect()
    }

    /// The answer as a self-contained page.
    fn html(&self, py: Python<'_>) -> String {
        py.detach(|| self.shown(&self.answered.document.html()))
    }

    /// Names of the files that the command writes.
    fn names(&self) -> Vec<String> {
        let names = self.answered.files.iter().map(|(name, _)| name.clone());
        names.collect()
    }

    /// The text of one of them.
    fn text(&self, py: Python<'_>, name: &str) -> PyResult<String> {
        let found = self.answered.files.iter().find(|(own, _)| own == name);
        let missing = || error::refused(py, &format!("there is no {name} in this answer"));
        found.map(|(_, text)| self.shown(text)).ok_or_else(missing)
    }

    /// Why the command would end with exit code 3.
    #[getter]
    fn unmet(&self) -> Option<String> {
        let unmet = self.answered.unmet.as_ref();
        unmet.map(|unmet| self.shown(&unmet.to_string()))
    }
}

// Studies: cells that survive and spread over machines.

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
            ..BatchRequest::default()
        };
        let outcome = request.run(&|_| None, &Context::new(meter, None));
        (outcome, meter.warnings())
    })?;
    let outcome = outcome.and_then(|outcome| match outcome.unmet() {
        Some(failure) if matches!(outcome, BatchOutcome::Stopped { .. }) => Err(failure),
        _ => Ok(outcome),
    });
    let answer = match outcome.map_err(|e| error::of_failure(py, &e, ""))? {
        BatchOutcome::Merged(answer) => {
            let answered = RenderedAnswer {
                json: serde_json::to_string(&*answer).unwrap_or_default(),
                document: answer.document(),
                files: Vec::new(),
                unmet: answer.unmet(),
            };
            Some(Answer {
                answered,
                hidden: String::new(),
                warnings: warnings.clone(),
            })
        }
        _ => None,
    };
    Ok((answer, warnings))
}

// Tables of text as columns.

/// A CSV with a header: numbers as arrays, where a cell without one is NaN; other columns as lists of texts.
#[pyfunction]
pub(crate) fn columns<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyDict>> {
    let read = || {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let names = reader.headers()?.clone();
        let rows = reader.records().collect::<Result<Vec<_>, _>>()?;
        Ok::<_, csv::Error>((names, rows))
    };
    let (names, rows) = py
        .detach(read)
        .map_err(|e| pyo3::exceptions::PyValueError::new_err(e.to_string()))?;
    let number = |cell: &str| match cell {
        "" => Some(f64::NAN),
        cell => cell.parse().ok(),
    };
    let table = PyDict::new(py);
    for (k, name) in names.iter().enumerate() {
        let cells = || rows.iter().filter_map(|row| row.get(k));
        match cells().map(number).collect::<Option<Vec<f64>>>() {
            Some(values) => table.set_item(name, PyArray1::from_vec(py, values))?,
            None => table.set_item(name, PyList::new(py, cells().collect::<Vec<_>>())?)?,
        }
    }
    Ok(table)
}
