//! Recordings in `.npy`: columns named by the manifest of their synthesis, by the caller, or by their number.

use super::error::{COLUMNS, sample};
use super::header::{HeaderPlace, Layout, npy_order};
use super::manifest::{MANIFEST, Manifest};
use super::options::ReadOptions;
use super::table::{BEYOND, LARGEST, Lines, Notes, Raw, empty_columns, fits};
use crate::formats::{FileError, Place, Setting, npy};
use std::path::Path;

/// Reads an array.
pub(super) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let name = path.display().to_string();
    let array = npy::open(path)?;
    let expected = array.columns();
    let manifest = Manifest::beside(path);
    let names = match &options.columns {
        Some(names) => names.clone(),
        None => {
            let said = manifest
                .as_ref()
                .and_then(|manifest| manifest.columns(expected));
            said.or_else(|| npy_order(expected))
                .ok_or_else(|| unnamed(&name, expected))?
        }
    };
    if names.len() != expected {
        return Err(FileError::row_length(&name, 1, expected, names.len()));
    }
    let place = HeaderPlace {
        path: &name,
        line: 1,
    };
    let layout = Layout::new(place, &names, false, options.channels.as_deref())?;
    let (indices, mut columns) = empty_columns(&layout);
    let place: Vec<Option<usize>> = (0..expected)
        .map(|index| indices.iter().position(|i| *i == index))
        .collect();
    fits(&name, &columns, array.rows() as u64)?;
    array.each(|row, index, value| {
        let Some(target) = place[index] else {
            return Ok(());
        };
        if !value.is_finite() || value.abs() > LARGEST {
            return Err(not_a_measurement(
                &name,
                row as u64 + 1,
                &columns[target].name,
                value,
            ));
        }
        columns[target].values.push(value);
        Ok(())
    })?;
    Ok(Raw {
        path: name.clone(),
        columns,
        ignored: layout.ignored,
        head_rate: manifest.map(|manifest| (manifest.rate_hz, MANIFEST)),
        lines: Lines::default(),
        notes: Notes::default(),
    })
}

/// An array whose columns are not known.
fn unnamed(path: &str, columns: usize) -> FileError {
    let message = format!("an array of {columns} columns, which names are not known");
    FileError::contents(path, Place::Within, message)
        .advice(COLUMNS)
        .setting(Setting::ColumnNames)
}

fn not_a_measurement(path: &str, line: u64, column: &str, value: f64) -> FileError {
    if value.is_finite() {
        sample(path, line, column, &format!("{value:e}"), BEYOND)
    } else {
        sample(path, line, column, &format!("\"{value}\""), "is not finite")
    }
}
