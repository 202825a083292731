//! What was found in the files, for the user to check.

use super::channel_of;
use crate::io::table::{Column, Table};
use crate::report::six_digits;
use nav_sim_signal::imu::{Channel, Sensor};
use std::fmt;
use std::path::PathBuf;

/// What was found and assumed while reading.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// One entry a file.
    pub files: Vec<FileReport>,
    /// Doubts that belong to no file's contents.
    pub warnings: Vec<String>,
}

impl Report {
    /// Every doubt, those about a file with its name.
    #[must_use]
    pub fn all_warnings(&self) -> Vec<String> {
        let named = |f: &FileReport| {
            f.warnings
                .iter()
                .map(|w| format!("{}: {w}", f.file))
                .collect::<Vec<_>>()
        };
        self.warnings
            .iter()
            .cloned()
            .chain(self.files.iter().flat_map(named))
            .collect()
    }
}

/// What was found and assumed in one file. Displays as one line.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct FileReport {
    /// The file, as shown.
    pub file: String,
    /// The file itself: its name need not be UTF-8.
    pub path: PathBuf,
    /// Columns that became signals.
    pub columns: Vec<(String, Channel)>,
    /// Columns passed over.
    pub ignored: Vec<String>,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// Where the rate is from, in words.
    pub rate_from: String,
    /// Samples of each recording made of the file (several if it was split at gaps).
    pub samples: Vec<usize>,
    /// The mean removed from each signal of the first of them (m/s² or rad/s).
    pub means: Vec<(Channel, f64)>,
    /// What was assumed, in words.
    pub assumptions: Vec<String>,
    /// Doubts, in words.
    pub warnings: Vec<String>,
}

/// The name of one of the recordings of a file.
pub(super) fn name_of(file: &str, index: usize, count: usize) -> String {
    if count > 1 {
        format!("{file}[{}]", index + 1)
    } else {
        file.to_owned()
    }
}

impl FileReport {
    pub(super) fn new(raw: &Table) -> Self {
        let signal = |c: &Column| Some((c.name.clone(), channel_of(c)?));
        let mut assumptions = raw.assumptions.clone();
        if raw.columns.iter().any(|c| c.quantity.per_sample) {
            assumptions.push("increments divided by the sample interval".into());
        }
        Self {
            file: raw.path.clone(),
            columns: raw.columns.iter().filter_map(signal).collect(),
            ignored: raw.ignored.clone(),
            assumptions,
            warnings: raw.warnings.clone(),
            ..Self::default()
        }
    }

    /// The names of its recordings, with their samples: of several, such as stretches between gaps, `a.csv[1]`, …
    pub(crate) fn recordings(&self) -> impl Iterator<Item = (String, usize)> + Clone {
        let count = self.samples.len();
        self.samples
            .iter()
            .enumerate()
            .map(move |(i, samples)| (name_of(&self.file, i, count), *samples))
    }

    /// Samples of all its recordings.
    fn count(&self) -> usize {
        self.samples.iter().sum()
    }

    pub(super) fn warn(&mut self, text: String) {
        self.warnings.push(text);
    }

    fn means_of(&self, sensor: Sensor) -> Option<String> {
        let of_sensor = self.means.iter().filter(|(c, _)| c.sensor == sensor);
        let parts: Vec<String> = of_sensor
            .map(|(c, m)| format!("{} {m:.6}", c.axis.name()))
            .collect();
        (!parts.is_empty())
            .then(|| format!("{} {} {}", sensor.name(), parts.join(", "), sensor.unit()))
    }
}

impl fmt::Display for FileReport {
    /// `a.csv: 524284 samples at 100 Hz (time column), 5242.84 s; means removed: accel x 0.02, …`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let total = self.count();
        let (rate, from, seconds) = (
            six_digits(self.rate_hz),
            &self.rate_from,
            crate::report::seconds(total as f64 / self.rate_hz),
        );
        write!(
            f,
            "{}: {total} samples at {rate} Hz ({from}), {seconds} s",
            self.file
        )?;
        if self.samples.len() > 1 {
            write!(f, ", in {} stretches", self.samples.len())?;
        }
        let means: Vec<String> = Sensor::ALL
            .into_iter()
            .filter_map(|s| self.means_of(s))
            .collect();
        write!(f, "; means removed: {}", means.join("; "))?;
        self.assumptions.iter().try_for_each(|a| write!(f, "; {a}"))
    }
}
