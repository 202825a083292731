//! What can be wrong with a recording.

use super::header::HeaderError;
use crate::formats::npy::NpyError;
use crate::formats::source::is_damage;
use crate::imu::Channel;
use std::io::ErrorKind;

/// What is wrong with a recording: which file, which line, which column, which value.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "fields are what the messages name: file, line, column, value")]
pub enum RecordingError {
    /// A file or directory cannot be read.
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
    /// A file too long to be held, and no place for it.
    #[error(
        "{path}: too long to be held in memory, and its samples cannot be kept in a temporary file: {source}"
    )]
    Storage { path: String, source: std::io::Error },
    /// A directory without recordings.
    #[error("{path}: no recordings in it")]
    NoFiles { path: String },
    /// A file named twice.
    #[error("{path} is given twice: it would count as two replicates")]
    GivenTwice { path: String },
    /// A file without samples.
    #[error("{path}: no samples in it")]
    Empty { path: String },
    /// A file without a header.
    #[error("{path}, line {line}: a header that names the columns is missing, found \"{found}\"")]
    NoHeader { path: String, line: u64, found: String },
    /// No column means anything here.
    #[error("{path}, line {line}: no accelerometer or gyroscope column among {columns}")]
    NoChannels { path: String, line: u64, columns: String },
    /// A gyroscope column whose unit cannot be known.
    #[error("{path}, line {line}: column \"{column}\" has no unit in its name")]
    NoUnit { path: String, line: u64, column: String },
    /// A column of an axis in a unit that is not known.
    #[error("{path}, line {line}: column \"{column}\" is in a unit that is not known")]
    UnknownUnit { path: String, line: u64, column: String, units: String },
    /// A file that is no text of lines.
    #[error("{path} is no table of text: {what}")]
    NotText { path: String, what: &'static str },
    /// A warm-up as long as the recording.
    #[error("{path}: --skip-s {skip_s} leaves {samples} samples of {seconds} s, but {needed} are needed")]
    Skipped { path: String, skip_s: f64, seconds: f64, samples: usize, needed: usize },
    /// Two columns for one channel.
    #[error("{path}, line {line}: columns \"{first}\" and \"{second}\" are both {channel}")]
    ColumnTwice { path: String, line: u64, channel: Channel, first: String, second: String },
    /// A cell that is no number.
    #[error("{path}, line {line}: column \"{column}\": \"{value}\" is not a number")]
    NotANumber { path: String, line: u64, column: String, value: String },
    /// A cell that is NaN or infinite.
    #[error("{path}, line {line}: column \"{column}\": \"{value}\" is not finite")]
    NotFinite { path: String, line: u64, column: String, value: String },
    /// A number that no sensor gives, whose square is none a computer has.
    #[error("{path}, line {line}: column \"{column}\": {value} is beyond 1e100, no measurement")]
    Absurd { path: String, line: u64, column: String, value: String },
    /// A row with too few or too many cells.
    #[error("{path}, line {line}: {found} values, but {expected} columns")]
    RowLength { path: String, line: u64, found: usize, expected: usize },
    /// An array whose columns are not known.
    #[error("{path}: an array of {found} columns, which names are not known")]
    NpyColumns { path: String, found: usize },
    /// An array that cannot be read.
    #[error(transparent)]
    Npy(#[from] NpyError),
    /// Time going back.
    #[error("{path}, line {line}: time goes back from {from} s to {to} s")]
    TimeBack { path: String, line: u64, from: f64, to: f64 },
    /// A step over 1.5 times the median.
    #[error(
        "{path}, line {line}: gap in time from {from} s to {to} s, the median step is {step} s{}",
        more(*irregular)
    )]
    Gap { path: String, line: u64, from: f64, to: f64, step: f64, irregular: usize },
    /// A step under 0.5 of the median.
    #[error(
        "{path}, line {line}: duplicate in time: {from} s to {to} s, the median step is {step} s{}",
        more(*irregular)
    )]
    Duplicate { path: String, line: u64, from: f64, to: f64, step: f64, irregular: usize },
    /// A time column that does not advance.
    #[error("{path}: column \"{column}\" does not advance: its median step is 0")]
    Still { path: String, column: String },
    /// No time column and no rate given.
    #[error("{path}: no time column, and no rate is given")]
    NoRate { path: String },
    /// A rate given that is not the file's.
    #[error("{path}: the time column runs at {found} Hz, but {given} Hz is given")]
    RateGiven { path: String, found: f64, given: f64 },
    /// A rate that is none.
    #[error("{rate_hz} Hz is not a sample rate")]
    NotARate { rate_hz: f64 },
    /// Replicates of different rates.
    #[error("{path} has {rate_hz} Hz, but {first} has {first_hz} Hz")]
    RatesDiffer { path: String, rate_hz: f64, first: String, first_hz: f64 },
    /// Static specific force that is neither gravity nor nothing.
    #[error("{path}: static |f| is {found:.4} m/s², far from 9.81 m/s²: {guess}")]
    Gravity { path: String, found: f64, guess: &'static str },
    /// An axis whose samples are all the same.
    #[error("{path}: {channel} (column \"{column}\") is dead: every sample is {value}")]
    Dead { path: String, channel: Channel, column: String, value: f64 },
    /// Fewer samples than are needed.
    #[error("{path}: {samples} samples, but {needed} are needed")]
    TooShort { path: String, samples: usize, needed: usize },
}

fn more(irregular: usize) -> String {
    match irregular {
        0 | 1 => String::new(),
        n => format!(" ({n} such steps in all)"),
    }
}

const COLUMNS: &str = "name the columns t_s, accel_x_m_s2 … gyro_z_rad_s (also _g, _mg, _deg_s, _deg_h; t_ms, t_us, \
                       t_ns), or give the names with --columns";

impl RecordingError {
    /// For a file whose samples cannot be kept, or taken back.
    pub(in crate::formats) fn storage(path: &str) -> impl Fn(std::io::Error) -> Self {
        move |source| Self::Storage { path: path.to_owned(), source }
    }

    pub(super) fn header(path: &str, line: u64, e: HeaderError) -> Self {
        let path = path.to_owned();
        match e {
            HeaderError::NoChannels { columns } => Self::NoChannels { path, line, columns },
            HeaderError::NoUnit { column } => Self::NoUnit { path, line, column },
            HeaderError::UnknownUnit { column, units } => Self::UnknownUnit { path, line, column, units },
            HeaderError::Twice { channel, first, second } => {
                Self::ColumnTwice { path, line, channel, first, second }
            }
        }
    }

    /// Whether the system, not the contents, is at fault.
    #[must_use]
    pub fn is_io(&self) -> bool {
        match self {
            Self::Io { source, .. } => !is_damage(source.kind()),
            Self::Npy(NpyError::Io { .. }) | Self::Storage { .. } => true,
            _ => false,
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::NoHeader { .. } | Self::NoChannels { .. } | Self::NpyColumns { .. } => COLUMNS,
            Self::UnknownUnit { units, .. } => {
                return Some(format!(
                    "known units: {units}; give the names with --columns, or leave the axis out with --axes"
                ));
            }
            Self::NotText { .. } => {
                "save it as CSV in UTF-8, one row a line; arrays end in .npy, gzipped tables in .gz"
            }
            Self::Skipped { .. } => "a smaller --skip-s, or a longer recording",
            Self::Io { source, .. } if source.kind() == ErrorKind::FileTooLarge => {
                "write what comes through a pipe to a file first"
            }
            Self::Io { source, .. } if is_damage(source.kind()) => {
                "the file is cut off, or not gzipped though it ends in .gz: copy it again, or rename it"
            }
            Self::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
                "check the path; a directory stands for all its recordings"
            }
            Self::Storage { .. } => {
                "make room there, or name another directory in TMPDIR; --axes takes fewer signals at a time"
            }
            Self::Empty { .. } => "a recording has a header line and a row for each sample",
            Self::NoUnit { column, .. } if column.to_lowercase().starts_with('a') => {
                "end its name in _m_s2, _g or _mg, or give the names with --columns"
            }
            Self::NoUnit { .. } => {
                "end its name in _rad_s, _deg_s or _deg_h, or give the names with --columns"
            }
            Self::NotANumber { value, .. } if decimal_comma(value) => {
                "write decimals with a point: 0.5, not 0,5"
            }
            Self::NotANumber { .. } | Self::NotFinite { .. } | Self::Absurd { .. } => {
                "remove the line, or record again: a sample that is made up would change the noise"
            }
            Self::RowLength { .. } => "every row needs one value a column; was the file cut off?",
            Self::TimeBack { .. } => "sort the rows by time, or split the file where the clock was set back",
            Self::Gap { .. } | Self::Duplicate { .. } => {
                "--gaps split takes the stretches between as recordings of their own; --gaps ignore takes the \
                 samples as evenly spaced (stamped late, none lost)"
            }
            Self::NoRate { .. } => "give the rate with --rate-hz",
            Self::RateGiven { .. } | Self::NotARate { .. } => "leave --rate-hz out, or correct it",
            Self::RatesDiffer { .. } => "calibrate recordings of one rate at a time, or resample them",
            Self::Gravity { .. } => "name the unit in the columns: accel_x_m_s2, accel_x_g or accel_x_mg",
            Self::Dead { .. } => "leave the axis out with --axes, or record again",
            Self::TooShort { .. } => "record for longer, or ask for fewer scales",
            Self::GivenTwice { .. } => "name each file once; a directory stands for all its recordings",
            Self::NoFiles { .. } => "recordings end in .csv, .tsv, .txt (also .gz) or .npy",
            _ => return None,
        };
        Some(text.to_owned())
    }
}

/// At most `longest` characters of what a file holds, safe to print.
pub(super) fn shown(text: &str, longest: usize) -> String {
    let short: String = text.chars().take(longest).flat_map(escaped).collect();
    if text.chars().nth(longest).is_some() { short + "…" } else { short }
}

fn escaped(c: char) -> Vec<char> {
    if c.is_control() { c.escape_default().collect() } else { vec![c] }
}

fn decimal_comma(value: &str) -> bool {
    value.contains(',') && value.replacen(',', ".", 1).trim().parse::<f64>().is_ok()
}
