//! Recordings of KITTI: a directory `oxts` with one line a sample in `data/`, and their times in `timestamps.txt`.
//!
//! The numbers of a line are those of `dataformat.txt` there ([Geiger et al. 2013](https://doi.org/10.1177/0278364913491297),
//! sec. III-A): accelerations and angular rates in the axes of the vehicle, front, left, up, are its 12th to 14th and 18th
//! to 20th.

use super::error::{empty, unreadable};
use super::header::{HeaderPlace, Layout};
use super::options::ReadOptions;
use super::table::{Lines, Notes, Raw, empty_columns};
use super::text::number;
use crate::formats::{FileError, source};
use chrono::NaiveDateTime;
use std::path::{Path, PathBuf};

/// Names of the quantities that are read, and their places in a line.
const NAMES: [(&str, usize); 6] = [
    ("accel_x_m_s2", 11),
    ("accel_y_m_s2", 12),
    ("accel_z_m_s2", 13),
    ("gyro_x_rad_s", 17),
    ("gyro_y_rad_s", 18),
    ("gyro_z_rad_s", 19),
];

/// Whether a directory is such a recording.
pub(super) fn is_oxts(directory: &Path) -> bool {
    directory.join("timestamps.txt").is_file() && directory.join("data").is_dir()
}

/// Reads a recording.
pub(super) fn load(directory: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let name = directory.display().to_string();
    let times = times(&directory.join("timestamps.txt"))?;
    let names: Vec<String> = std::iter::once("t_s")
        .chain(NAMES.map(|(name, _)| name))
        .map(str::to_owned)
        .collect();
    let layout = Layout::new(
        HeaderPlace {
            path: &name,
            line: 1,
        },
        &names,
        false,
        options.channels.as_deref(),
    )?;
    let (indices, mut columns) = empty_columns(&layout);
    let files = samples(&directory.join("data"))?;
    if files.is_empty() {
        return Err(empty(&name));
    }
    if files.len() != times.len() {
        let message = format!(
            "{} samples in data, {} times in timestamps.txt",
            files.len(),
            times.len()
        );
        return Err(FileError::contents(
            name,
            crate::formats::Place::Within,
            message,
        ));
    }
    for (path, t_s) in files.iter().zip(times) {
        let row = row(path, t_s)?;
        indices
            .iter()
            .zip(&mut columns)
            .for_each(|(index, column)| column.values.push(row[*index]));
    }
    let (lines, mut notes) = (Lines::default(), Notes::default());
    notes
        .assumptions
        .push("KITTI oxts, axes front, left, up".to_owned());
    Ok(Raw {
        path: name,
        columns,
        ignored: Vec::new(),
        head_rate: None,
        lines,
        notes,
    })
}

/// Files of the samples, in order.
fn samples(data: &Path) -> Result<Vec<PathBuf>, FileError> {
    let io = |e| unreadable(data, e);
    let entries = std::fs::read_dir(data).map_err(io)?;
    let mut files = entries
        .map(|entry| Ok(entry.map_err(io)?.path()))
        .collect::<Result<Vec<_>, _>>()?;
    files.retain(|path| path.extension().is_some_and(|e| e == "txt"));
    files.sort();
    Ok(files)
}

/// Times of the samples (s since 1970).
fn times(path: &Path) -> Result<Vec<f64>, FileError> {
    let text = source::text(path).map_err(|e| unreadable(path, e))?;
    let time = |(i, line): (usize, &str)| {
        let parsed = NaiveDateTime::parse_from_str(line.trim(), "%Y-%m-%d %H:%M:%S%.f");
        let found = parsed.map_err(|_| {
            let message = format!("\"{}\" is not a time", super::error::shown(line, 40));
            FileError::contents(path.display().to_string(), i + 1, message)
                .advice("2011-09-26 13:02:25.964389445")
        })?;
        let since = found.and_utc();
        Ok(since.timestamp() as f64 + 1e-9 * f64::from(since.timestamp_subsec_nanos()))
    };
    text.lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .map(time)
        .collect()
}

/// Time and quantities of a sample.
fn row(path: &Path, t_s: f64) -> Result<[f64; 7], FileError> {
    let text = source::text(path).map_err(|e| unreadable(path, e))?;
    let cells: Vec<&str> = text.split_ascii_whitespace().collect();
    let mut row = [t_s; 7];
    for (value, (name, at)) in row[1..].iter_mut().zip(NAMES) {
        let cell = cells.get(at).copied().unwrap_or_default();
        let finite = number(cell.as_bytes()).filter(|x| x.is_finite());
        *value = finite.ok_or_else(|| {
            FileError::cell(
                path.display().to_string().as_str(),
                1,
                name,
                format!("\"{cell}\""),
                "is not a finite number",
            )
        })?;
    }
    Ok(row)
}
