//! The one exception.

use nav_sim::failure::Failure;
use pyo3::prelude::*;

/// `nav_sim.NavSimError`; whatever prevents that it is made is raised instead.
pub(crate) fn raise(
    py: Python<'_>,
    message: &str,
    file: Option<&str>,
    line: Option<u64>,
    hint: Option<&str>,
) -> PyErr {
    let class = py
        .import("nav_sim._errors")
        .and_then(|module| module.getattr("NavSimError"));
    match class.and_then(|class| class.call1((message, file, line, hint))) {
        Ok(error) => PyErr::from_value(error),
        Err(e) => e,
    }
}

/// Error that concerns no file.
pub(crate) fn refused(py: Python<'_>, message: &str) -> PyErr {
    raise(py, message, None, None, None)
}

/// A failure, told as [`shown`].
pub(crate) fn of_failure(py: Python<'_>, failure: &Failure, hidden: &str) -> PyErr {
    let staged = failure
        .file()
        .and_then(|file| StagedArgument::of(file.strip_prefix(hidden)?, hidden));
    let file = staged.map_or_else(|| failure.file(), |staged| Some(staged.argument));
    let line = failure
        .line()
        .and_then(|line| staged.map_or(Some(line), |staged| staged.row(line)));
    let hint = failure.advice().map(|hint| shown(&hint, hidden));
    raise(
        py,
        &shown(&failure.to_string(), hidden),
        file,
        line,
        hint.as_deref(),
    )
}

/// A text in which what came as arrays goes by the name of its argument and the index of its row, not by file and line.
pub(crate) fn shown(text: &str, hidden: &str) -> String {
    if hidden.is_empty() {
        return text.to_owned();
    }
    let mut parts = text.split(hidden);
    let mut shown = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        shown += &StagedArgument::of(part, hidden)
            .map_or_else(|| part.to_owned(), |staged| staged.told(part));
    }
    shown
}

/// An argument that was written to a file, as a text names it.
#[derive(Clone, Copy)]
struct StagedArgument<'a> {
    argument: &'a str,
    ending: &'a str,
}

impl<'a> StagedArgument<'a> {
    /// The one that a text begins with; none where nothing is hidden.
    fn of(text: &'a str, hidden: &str) -> Option<Self> {
        let endings = ["csv", "npz", "toml"]
            .into_iter()
            .filter(|_| !hidden.is_empty());
        let at = endings.filter_map(|ending| Some((text.find(&format!(".{ending}"))?, ending)));
        let (at, ending) = at.min()?;
        let is_name = !text[..at].contains([' ', ',', ':']);
        is_name.then(|| Self {
            argument: &text[..at],
            ending: &text[at + 1..at + 1 + ending.len()],
        })
    }

    /// Index of the row that stands in a line: a table has a header above its rows. Settings have no rows.
    fn row(self, line: u64) -> Option<u64> {
        match self.ending {
            "csv" => line.checked_sub(2),
            "npz" => line.checked_sub(1),
            _ => None,
        }
    }

    fn told(self, text: &str) -> String {
        let rest = &text[self.argument.len() + 1 + self.ending.len()..];
        let line = rest.strip_prefix(", line ").map(|rest| {
            let digits = rest
                .find(|c: char| !c.is_ascii_digit())
                .unwrap_or(rest.len());
            rest.split_at(digits)
        });
        let Some((line, rest)) = line else {
            return format!("{}{rest}", self.argument);
        };
        match line.parse().ok().and_then(|line| self.row(line)) {
            Some(row) => format!("{}, row {row}{rest}", self.argument),
            None => format!("{}{rest}", self.argument),
        }
    }
}
