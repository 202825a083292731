//! A file as columns of numbers, before anything is decided about time and units.

use super::error::{COLUMNS, sample, storage};
use super::header::{self, HeaderPlace, Role};
use super::manifest::{MANIFEST, Manifest};
use super::values::Values;
use super::{ReadOptions, text};
use crate::formats::{FileError, Place, Setting, npy};
use nav_sim_signal::imu::Channel;
use std::path::Path;

/// A file's columns as found, before anything is decided about time and units.
#[derive(Debug)]
pub(crate) struct Raw {
    pub(crate) path: String,
    pub(crate) columns: Vec<Column>,
    /// Names of columns that mean nothing here.
    pub(crate) ignored: Vec<String>,
    /// Rate said in the head of the file or beside it (Hz), and where.
    pub(crate) head_rate: Option<(f64, &'static str)>,
    pub(crate) lines: Lines,
    pub(crate) notes: Notes,
}

/// What is said of a file's text.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    /// What was passed over, or taken for granted.
    pub(crate) assumptions: Vec<String>,
    /// What is doubtful.
    pub(crate) warnings: Vec<String>,
}

/// A column with a meaning.
#[derive(Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) role: Role,
    pub(crate) values: Values,
}

impl Column {
    pub(super) const fn channel(&self) -> Option<Channel> {
        match self.role {
            Role::Signal { channel, .. } => Some(channel),
            _ => None,
        }
    }
}

/// Which line of the file each sample stands on.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    /// (sample from which on, line less sample index), where it changes.
    shifts: Vec<(usize, u64)>,
}

impl Lines {
    pub(super) fn is_empty(&self) -> bool {
        self.shifts.is_empty()
    }

    pub(super) fn push(&mut self, sample: usize, line: u64) {
        let shift = line.saturating_sub(sample as u64);
        if self.shifts.last().is_none_or(|(_, s)| *s != shift) {
            self.shifts.push((sample, shift));
        }
    }

    /// Line of a sample (row, from 1, in a file without lines).
    pub(crate) fn of(&self, sample: usize) -> u64 {
        let before = self.shifts.partition_point(|(from, _)| *from <= sample);
        sample as u64 + before.checked_sub(1).map_or(1, |i| self.shifts[i].1)
    }
}

/// Beyond this a number is no measurement, and its square may be no number.
pub(super) const LARGEST: f64 = 1e100;
pub(super) const BEYOND: &str = "is beyond 1e100, no measurement";

/// Reads a file's columns.
pub(crate) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        load_npy(path, options)
    } else {
        text::load(path, options)
    }
}

fn load_npy(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let name = path.display().to_string();
    let array = npy::open(path)?;
    let expected = array.columns();
    let manifest = Manifest::beside(path);
    let names = match &options.columns {
        Some(names) => names.clone(),
        None => {
            let said = manifest.as_ref().and_then(|manifest| manifest.columns(expected));
            said.or_else(|| header::npy_order(expected)).ok_or_else(|| unnamed(&name, expected))?
        }
    };
    if names.len() != expected {
        return Err(FileError::row_length(&name, 1, expected, names.len()));
    }
    let place = HeaderPlace { path: &name, line: 1 };
    let layout = header::Layout::new(place, &names, false, options.channels.as_deref())?;
    let (indices, mut columns) = layout.columns();
    let place: Vec<Option<usize>> =
        (0..expected).map(|index| indices.iter().position(|i| *i == index)).collect();
    let stored = storage(&name);
    let mut count = 0;
    array.each(|row, index, value| {
        let Some(target) = place[index] else { return Ok(()) };
        if !value.is_finite() || value.abs() > LARGEST {
            return Err(not_a_measurement(&name, row as u64 + 1, &columns[target].name, value));
        }
        if count % BETWEEN == 0 {
            relieve(&mut columns, options).map_err(&stored)?;
        }
        count += 1;
        columns[target].values.push(value);
        Ok(())
    })?;
    settle(&mut columns, options).map_err(&stored)?;
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
    FileError::contents(path, Place::Within, message).advice(COLUMNS).setting(Setting::ColumnNames)
}

fn not_a_measurement(path: &str, line: u64, column: &str, value: f64) -> FileError {
    if value.is_finite() {
        sample(path, line, column, &format!("{value:e}"), BEYOND)
    } else {
        sample(path, line, column, &format!("\"{value}\""), "is not finite")
    }
}

/// So many rows, or elements, come between one look at what is held and the next.
pub(super) const BETWEEN: usize = 1 << 16;

/// Stores the columns of a file that are more than is to be held.
pub(super) fn relieve(columns: &mut [Column], options: &ReadOptions) -> std::io::Result<()> {
    let bytes: usize = columns.iter().map(|c| size_of::<f64>() * c.values.len()).sum();
    if bytes > options.hold_bytes {
        columns.iter_mut().try_for_each(|c| c.values.store())?;
    }
    Ok(())
}

/// Once all is read: all columns of the file are stored, or none.
pub(super) fn settle(columns: &mut [Column], options: &ReadOptions) -> std::io::Result<()> {
    relieve(columns, options)?;
    let any = columns.iter().any(|c| c.values.is_stored());
    for column in columns {
        if any {
            column.values.store()?;
        }
        column.values.fit();
    }
    Ok(())
}
