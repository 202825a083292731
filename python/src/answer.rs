//! What a request comes to.

use crate::{error, table};
use nav_sim::app::Answered;
use nav_sim::document::{Document, Importance};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Characters of a line of a summary.
const WIDTH: usize = 120;

/// The answer to a request: as the command prints, draws and writes it.
#[pyclass(frozen, module = "nav_sim._native")]
pub(crate) struct Answer {
    json: String,
    document: Document,
    files: Vec<(String, String)>,
    unmet: Option<String>,
    hidden: String,
    #[pyo3(get)]
    warnings: Vec<String>,
}

impl Answer {
    pub(crate) fn new(answered: Answered, hidden: String, warnings: Vec<String>) -> Self {
        let unmet = answered.unmet.map(|unmet| unmet.to_string());
        Self {
            files: answered.files,
            hidden,
            ..Self::of(answered.json, answered.document, unmet, warnings)
        }
    }

    /// An answer whose files are where the engine wrote them.
    pub(crate) const fn of(
        json: String,
        document: Document,
        unmet: Option<String>,
        warnings: Vec<String>,
    ) -> Self {
        Self {
            json,
            document,
            files: Vec::new(),
            unmet,
            hidden: String::new(),
            warnings,
        }
    }

    /// A text without the directory of what came as arrays. JSON writes the backslashes of Windows twice.
    fn shown(&self, text: &str) -> String {
        if self.hidden.is_empty() {
            return text.to_owned();
        }
        text.replace(&self.hidden.replace('\\', "\\\\"), "")
            .replace(&self.hidden, "")
    }

    fn file(&self, py: Python<'_>, name: &str) -> PyResult<&str> {
        let found = self.files.iter().find(|(own, _)| own == name);
        let missing = || error::refused(py, &format!("there is no {name} in this answer"));
        found.map(|(_, text)| text.as_str()).ok_or_else(missing)
    }
}

#[pymethods]
impl Answer {
    /// As JSON.
    fn json(&self) -> String {
        self.shown(&self.json)
    }

    /// As the terminal shows it.
    fn summary(&self, py: Python<'_>) -> String {
        py.detach(|| {
            let document = &self.document;
            let text = document.terminal(WIDTH);
            let spoken = document.spoken(false).map(|note| match note.importance {
                Importance::Warning => format!("\nwarning: {}", note.text),
                _ => format!("\nnote: {}", note.text),
            });
            self.shown(&(text.trim_end().to_owned() + &spoken.collect::<String>()))
        })
    }

    /// Its verdict, a line each.
    fn verdict(&self) -> Vec<String> {
        self.document
            .verdict
            .lines
            .iter()
            .map(|line| self.shown(line))
            .collect()
    }

    /// As a page of its own.
    fn html(&self, py: Python<'_>) -> String {
        py.detach(|| self.shown(&self.document.html()))
    }

    /// Names of the files that the command writes.
    fn names(&self) -> Vec<String> {
        self.files.iter().map(|(name, _)| name.clone()).collect()
    }

    /// The text of one of them.
    fn text(&self, py: Python<'_>, name: &str) -> PyResult<String> {
        Ok(self.shown(self.file(py, name)?))
    }

    /// The columns of one of them: numbers as arrays, other cells as lists of texts.
    fn table<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
        table::columns(py, self.file(py, name)?)
    }

    /// Why the command would end with exit code 3.
    #[getter]
    fn unmet(&self) -> Option<String> {
        self.unmet.as_deref().map(|unmet| self.shown(unmet))
    }
}
