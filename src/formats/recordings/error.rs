//! Refusals that several of the readers make.

use crate::formats::source::is_damage;
use crate::formats::{FileError, Kind, Place, Setting};
use std::io::{self, ErrorKind};
use std::path::Path;

/// What the columns of a recording are called.
pub(super) const COLUMNS: &str = "name the columns t_s, accel_x_m_s2 … gyro_z_rad_s (also _g, _mg, _deg_s, _deg_h; t_ms, t_us, t_ns)";

/// What the system said of a recording, with what helps.
pub(super) fn unreadable(path: &Path, source: io::Error) -> FileError {
    let kind = source.kind();
    let error = FileError::io(path, source);
    match kind {
        ErrorKind::FileTooLarge => error.advice("write what comes through a pipe to a file first"),
        kind if is_damage(kind) => error.advice_instead(
            "the file is cut off, or not gzipped though it ends in .gz: copy it again, or rename it",
        ),
        ErrorKind::NotFound => error.advice("check the path; a directory stands for all its recordings"),
        _ => error,
    }
}

/// A file whose samples are more than the memory that is free.
pub(super) fn too_large(path: &str, needed: u64, free: u64) -> FileError {
    let [needed, free] = [needed, free].map(|bytes| bytes.div_ceil(1 << 20));
    let message = format!("its samples need {needed} MiB of memory, and {free} MiB are free");
    FileError::contents(path, Place::Within, message).setting(Setting::FewerChannels)
}

/// A sample that is no measurement.
pub(super) fn sample(path: &str, line: u64, column: &str, value: &str, reason: &str) -> FileError {
    let error = FileError::cell(path, line, column, value, reason);
    if value.matches(':').count() > 1 {
        return error
            .advice("write the time in seconds, from any instant on, and name the column t_s");
    }
    error
        .setting(Setting::RemoveLine)
        .advice("record again: a sample that is made up would change the noise")
}

/// A column without a unit that cannot be known.
pub(super) fn no_unit(path: &str, line: u64, column: &str) -> FileError {
    let units = if column.to_lowercase().starts_with('a') {
        "end its name in _m_s2, _g or _mg"
    } else {
        "end its name in _rad_s, _deg_s or _deg_h"
    };
    FileError::contents(
        path,
        line,
        format!("column \"{column}\" has no unit in its name"),
    )
    .advice(units)
    .setting(Setting::ColumnNames)
}

/// Fewer samples than are needed.
pub(super) fn too_short(path: &str, samples: usize, needed: usize) -> FileError {
    FileError::contents(
        path,
        Place::Within,
        format!("{samples} samples, but {needed} are needed"),
    )
    .advice("record for longer, or ask for fewer scales")
}

/// A file without samples.
pub(super) fn empty(path: &str) -> FileError {
    FileError::new(path, Place::Within, Kind::Empty("no samples in it"))
        .advice("a recording has a header line and a row for each sample")
}

/// A directory without recordings.
pub(super) fn no_files(path: String) -> FileError {
    FileError::contents(path, Place::Within, "no recordings in it").advice(
        "recordings end in .csv, .tsv, .txt (also .gz), .npy, .npz, .mcap, .bag, .ulg or .ubx",
    )
}

/// At most `longest` characters of what a file holds, safe to print.
pub(super) fn shown(text: &str, longest: usize) -> String {
    let short: String = text.chars().take(longest).flat_map(escaped).collect();
    if text.chars().nth(longest).is_some() {
        short + "…"
    } else {
        short
    }
}

fn escaped(c: char) -> Vec<char> {
    if c.is_control() {
        c.escape_default().collect()
    } else {
        vec![c]
    }
}
