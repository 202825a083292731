//! Tables of text as columns.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// A CSV with a header: numbers as arrays, where a cell without one is NaN; other columns as lists of texts.
#[pyfunction]
pub(crate) fn columns<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyDict>> {
    let (names, columns) = py
        .detach(|| parse(text))
        .map_err(|e| pyo3::exceptions::PyValueError::new_err(e.to_string()))?;
    let table = PyDict::new(py);
    for (name, cells) in names.into_iter().zip(columns) {
        match cells {
            Column::Numbers(values) => table.set_item(name, PyArray1::from_vec(py, values))?,
            Column::Texts(texts) => table.set_item(name, PyList::new(py, texts)?)?,
        }
    }
    Ok(table)
}

enum Column {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

impl Column {
    fn push(&mut self, cell: &str) {
        match self {
            Self::Numbers(values) => match number(cell) {
                Some(value) => values.push(value),
                None => {
                    let mut texts: Vec<String> = values.iter().map(ToString::to_string).collect();
                    texts.push(cell.to_owned());
                    *self = Self::Texts(texts);
                }
            },
            Self::Texts(texts) => texts.push(cell.to_owned()),
        }
    }
}

fn number(cell: &str) -> Option<f64> {
    if cell.is_empty() {
        Some(f64::NAN)
    } else {
        cell.parse().ok()
    }
}

fn parse(text: &str) -> Result<(Vec<String>, Vec<Column>), csv::Error> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
    let mut columns: Vec<Column> = names.iter().map(|_| Column::Numbers(Vec::new())).collect();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record)? {
        columns
            .iter_mut()
            .zip(&record)
            .for_each(|(column, cell)| column.push(cell));
    }
    Ok((names, columns))
}
