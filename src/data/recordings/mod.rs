//! Static recordings: text tables with a header (CSV, TSV, gzipped or not) and `.npy` arrays, one replicate
//! a file, a directory being all its recordings in name order.
//!
//! Columns are found by their names ([`header`]), their units by the names' endings; what was found, and
//! what was assumed, is told in the [`Report`]. What cannot be right is refused with file and line
//! ([`RecordingError`]).

pub mod header;

pub(in crate::data) mod checks;
mod error;
mod files;
mod report;
mod text;
pub(in crate::data) mod timing;
mod write;

pub use error::RecordingError;
pub use files::is_recording;
pub use report::{FileReport, Report};
pub use write::FileFormat;

use crate::data::npy;
use crate::imu::{Channel, Recording, Signal};
use header::Role;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use timing::Timing;

/// How recordings are read.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Sample rate (Hz) for files without a time column; where there is one, it must agree within 1 %.
    pub rate_hz: Option<f64>,
    /// Seconds to leave out at the beginning (warm-up).
    pub skip_s: f64,
    /// What to do where the time jumps or stands still.
    pub gaps: Gaps,
    /// The channels wanted; none: all. Others are neither parsed nor checked nor held in memory.
    pub channels: Option<Vec<Channel>>,
    /// Names of the columns, for files without a header and instead of the header of those with one.
    pub columns: Option<Vec<String>>,
    /// Fewest samples a recording must have (at least 2).
    pub min_samples: usize,
}

/// What to do where a time step is over 1.5 or under 0.5 of the median step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Gaps {
    /// Refuse the file.
    #[default]
    Refuse,
    /// Make each stretch between such steps a recording of its own.
    Split,
    /// Take the samples as evenly spaced all the same (late stamps, not lost samples).
    Ignore,
}

/// Reads recordings; those of a directory in name order (numbers in names by value).
///
/// # Errors
/// When a file cannot be read, or holds what no sound recording can: [`RecordingError`].
pub fn read(paths: &[PathBuf], options: &ReadOptions) -> Result<(Vec<Recording>, Report), RecordingError> {
    let files = files::expand(paths)?;
    let outcomes: Vec<_> = files.par_iter().map(|file| read_file(&file.path, options)).collect();
    let (mut recordings, mut report) = (Vec::new(), Report::default());
    for (file, outcome) in files.iter().zip(outcomes) {
        match outcome {
            Err(RecordingError::NoChannels { .. }) if file.from_directory => {
                let text = format!("{}: passed over, no column is a known one", file.path.display());
                report.warnings.push(text);
            }
            outcome => {
                let (pieces, of_file) = outcome?;
                recordings.extend(pieces);
                report.files.push(of_file);
            }
        }
    }
    checks::same_rate(&recordings)?;
    if recordings.is_empty() {
        let path = paths.first().map(|p| p.display().to_string()).unwrap_or_default();
        return Err(RecordingError::NoFiles { path });
    }
    Ok((recordings, report))
}

fn read_file(path: &Path, options: &ReadOptions) -> Result<(Vec<Recording>, FileReport), RecordingError> {
    let mut raw = load(path, options)?;
    let mut report = FileReport::new(&raw);
    let timing = timing::timing(&mut raw, options, &mut report)?;
    raw.columns.retain(|c| matches!(c.role, Role::Signal { .. }));
    checks::resolve_units(&mut raw, timing.rate_hz)?;
    let pieces = pieces(&raw, &timing, options);
    let needed = options.min_samples.max(2);
    let longest = pieces.iter().map(|p| p.len()).max().unwrap_or(0);
    if longest < needed && options.skip_s > 0.0 {
        let seconds = raw.columns.first().map_or(0, |c| c.values.len()) as f64 / timing.rate_hz;
        let (path, skip_s) = (raw.path, options.skip_s);
        return Err(RecordingError::Skipped { path, skip_s, seconds, samples: longest, needed });
    }
    if longest < needed {
        return Err(RecordingError::TooShort { path: raw.path, samples: longest, needed });
    }
    let dropped = pieces.iter().filter(|p| p.len() < needed).count();
    if dropped > 0 {
        report.warn(format!("{dropped} stretches between gaps have fewer than {needed} samples: left out"));
    }
    let kept: Vec<_> = pieces.into_iter().filter(|p| p.len() >= needed).collect();
    let recordings = cut(raw, &timing, &kept);
    report.finish(&recordings);
    checks::plausible(&recordings, &mut report)?;
    Ok((recordings, report))
}

/// A file's columns as found, before anything is decided about time and units.
#[derive(Debug)]
pub(crate) struct Raw {
    pub(crate) path: String,
    pub(crate) columns: Vec<Column>,
    /// Names of columns that mean nothing here.
    pub(crate) ignored: Vec<String>,
    /// Rate said in the head of the file (Hz).
    pub(crate) head_rate_hz: Option<f64>,
    pub(crate) lines: Lines,
}

/// A column with a meaning.
#[derive(Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) role: Role,
    pub(crate) values: Vec<f64>,
}

/// Which line of the file each sample stands on.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    /// (sample from which on, line less sample index), where it changes.
    shifts: Vec<(usize, u64)>,
}

impl Lines {
    fn push(&mut self, sample: usize, line: u64) {
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
const LARGEST: f64 = 1e100;

/// Reads a file's columns.
pub(crate) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, RecordingError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        load_npy(path, options)
    } else {
        text::load(path, options)
    }
}

fn load_npy(path: &Path, options: &ReadOptions) -> Result<Raw, RecordingError> {
    let name = path.display().to_string();
    let array = npy::read(path)?;
    let names = match &options.columns {
        Some(names) => names.clone(),
        None => header::npy_order(array.columns.len())
            .ok_or_else(|| RecordingError::NpyColumns { path: name.clone(), found: array.columns.len() })?,
    };
    if names.len() != array.columns.len() {
        let (expected, found) = (names.len(), array.columns.len());
        return Err(RecordingError::RowLength { path: name, line: 1, found, expected });
    }
    let layout = header::Layout::new(&names, false, options.channels.as_deref())
        .map_err(|e| RecordingError::header(&name, 1, e))?;
    let mut arrays: Vec<Option<Vec<f64>>> = array.columns.into_iter().map(Some).collect();
    let take = |found: header::Found| {
        let values = arrays[found.index].take().unwrap_or_default();
        Column { name: found.name, role: found.role, values }
    };
    let (ignored, columns) = (layout.ignored, layout.found.into_iter().map(take).collect());
    let raw = Raw { path: name, columns, ignored, head_rate_hz: None, lines: Lines::default() };
    for column in &raw.columns {
        if let Some(at) = column.values.iter().position(|v| v.is_nan() || v.abs() > LARGEST) {
            let (line, column, value) = (raw.lines.of(at), column.name.clone(), column.values[at]);
            let path = raw.path;
            return Err(if value.is_finite() {
                RecordingError::Absurd { path, line, column, value: format!("{value:e}") }
            } else {
                RecordingError::NotFinite { path, line, column, value: value.to_string() }
            });
        }
    }
    Ok(raw)
}

/// The stretches of samples that become recordings.
fn pieces(raw: &Raw, timing: &Timing, options: &ReadOptions) -> Vec<std::ops::Range<usize>> {
    let samples = raw.columns.first().map_or(0, |c| c.values.len());
    let skip = ((options.skip_s.max(0.0) * timing.rate_hz).round() as usize).min(samples);
    let inner = timing.breaks.iter().copied().filter(|b| *b > skip);
    let ends: Vec<usize> = std::iter::once(skip).chain(inner).chain([samples]).collect();
    ends.windows(2).map(|w| w[0]..w[1]).collect()
}

/// The recordings of a file, their means removed.
fn cut(raw: Raw, timing: &Timing, pieces: &[std::ops::Range<usize>]) -> Vec<Recording> {
    let whole = pieces.len() == 1;
    let mut columns = raw.columns;
    columns.sort_by_key(|c| c.channel().map(Channel::index));
    let mut recordings: Vec<Recording> = (0..pieces.len())
        .map(|i| {
            let name = if whole { raw.path.clone() } else { format!("{}[{}]", raw.path, i + 1) };
            Recording { name, rate_hz: timing.rate_hz, signals: Vec::new() }
        })
        .collect();
    for column in columns {
        let Some(channel) = column.channel() else { continue };
        for (recording, piece) in recordings.iter_mut().zip(pieces) {
            let mut samples = column.values[piece.clone()].to_vec();
            let mean = checks::remove_mean(&mut samples);
            recording.signals.push(Signal { channel, mean, samples });
        }
    }
    recordings
}

impl Column {
    fn channel(&self) -> Option<Channel> {
        match self.role {
            Role::Signal { channel, .. } => Some(channel),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
