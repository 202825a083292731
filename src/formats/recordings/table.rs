//! A file as columns of numbers, before anything is decided about time and units.

use super::header::{Found, Layout, Role};
use super::options::ReadOptions;
use super::values::Values;
use nav_sim_signal::imu::Channel;

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

/// Where each column of a layout stands in a row, and the columns, empty.
pub(super) fn empty_columns(layout: &Layout) -> (Vec<usize>, Vec<Column>) {
    let empty = |f: &Found| Column {
        name: f.name.clone(),
        role: f.role,
        values: Values::default(),
    };
    layout.found.iter().map(|f| (f.index, empty(f))).unzip()
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

/// So many rows, or elements, come between one look at what is held and the next.
pub(super) const BETWEEN: usize = 1 << 16;

/// Stores the columns of a file that are more than is to be held.
pub(super) fn relieve(columns: &mut [Column], options: &ReadOptions) -> std::io::Result<()> {
    let bytes: usize = columns
        .iter()
        .map(|c| size_of::<f64>() * c.values.len())
        .sum();
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
