//! A file as columns of numbers, before anything is decided about time and units.

use super::error::too_large;
use super::header::{Found, Layout, Role};
use crate::formats::FileError;
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
    pub(crate) values: Vec<f64>,
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
        values: Vec::new(),
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

/// Rows from one look at the memory to the next.
pub(super) const BETWEEN: usize = 1 << 16;

/// Refuses columns whose rows, so many or more, do not fit into the memory that is free.
pub(super) fn fits(path: &str, columns: &[Column], rows: u64) -> Result<(), FileError> {
    let bytes = |rows: u64| rows.saturating_mul((size_of::<f64>() * columns.len()) as u64);
    let held = bytes(columns.first().map_or(0, |c| c.values.len() as u64));
    let free = free_memory().map_or(u64::MAX, |free| free.saturating_add(held));
    if bytes(rows) > free {
        return Err(too_large(path, bytes(rows), free));
    }
    Ok(())
}

/// Memory that is free (bytes), where the system says it.
fn free_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let (_, rest) = text.split_once("MemAvailable:")?;
    Some(rest.split_whitespace().next()?.parse::<u64>().ok()? << 10)
}
