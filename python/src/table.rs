//! Tables of text as columns.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

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
