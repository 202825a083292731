//! What a request comes to.

use crate::error;
use nav_sim::app::Answered;
use nav_sim::document::Importance;
use pyo3::prelude::*;

/// Characters of a line of a summary.
const WIDTH: usize = 120;

/// The answer to a request: as the command prints, draws and writes it.
#[pyclass(frozen, module = "nav_sim._native")]
pub(crate) struct Answer {
    answered: Answered,
    /// Directory of what came as arrays, which no text shows.
    hidden: String,
    /// Doubts about the input.
    #[pyo3(get)]
    warnings: Vec<String>,
}

impl Answer {
    pub(crate) const fn new(answered: Answered, hidden: String, warnings: Vec<String>) -> Self {
        Self {
            answered,
            hidden,
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
}

#[pymethods]
impl Answer {
    /// As JSON.
    fn json(&self) -> String {
        self.shown(&self.answered.json)
    }

    /// As the terminal shows it.
    fn summary(&self, py: Python<'_>) -> String {
        py.detach(|| {
            let document = &self.answered.document;
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
        let lines = self.answered.document.verdict.lines.iter();
        lines.map(|line| self.shown(line)).collect()
    }

    /// As a page of its own.
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
