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
    let class = py.import("nav_sim._errors").and_then(|module| module.getattr("NavSimError"));
    match class.and_then(|class| class.call1((message, file, line, hint))) {
        Ok(error) => PyErr::from_value(error),
        Err(e) => e,
    }
}

/// Of what concerns no file.
pub(crate) fn refused(py: Python<'_>, message: &str) -> PyErr {
    raise(py, message, None, None, None)
}

/// A failure, in whose texts the directory of what came as arrays is left out.
pub(crate) fn of_failure(py: Python<'_>, failure: &Failure, hidden: &str) -> PyErr {
    let shown = |text: &str| if hidden.is_empty() { text.to_owned() } else { text.replace(hidden, "") };
    let (file, hint) = (failure.file().map(shown), failure.advice().map(shown));
    raise(py, &shown(&failure.to_string()), file.as_deref(), failure.line(), hint.as_deref())
}
