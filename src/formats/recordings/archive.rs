//! Recordings in `.npz`: arrays by name.

use super::error::sample;
use super::header::{HeaderPlace, Layout};
use super::log::column;
use super::options::ReadOptions;
use super::table::{BEYOND, LARGEST, Lines, Notes, Raw};
use crate::formats::{FileError, Place, logs};
use nav_sim_logs::Error;
use nav_sim_logs::npz::{self, Array};
use std::path::Path;

/// Name of the array of a single number that states the rate (Hz).
const RATE: &str = "rate_hz";

/// Reads named arrays: a vector is a column, an array of three columns the three axes of a sensor.
pub(super) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let shown = path.display().to_string();
    let refused = |e| logs::refused(path, e);
    let archive = npz::Archive::open(path).map_err(refused)?;
    let names: Vec<String> = archive.names().map(str::to_owned).collect();
    let (mut columns, mut head_rate) = (Vec::new(), None);
    for name in names {
        let array = match archive.read(&name) {
            // texts and the like are passed over
            Err(Error::Encoding { .. }) => Array {
                shape: Vec::new(),
                values: Vec::new(),
            },
            read => read.map_err(refused)?,
        };
        match array.shape[..] {
            [] | [1] if name == RATE => {
                head_rate = array.values.first().map(|rate_hz| (*rate_hz, RATE))
            }
            [_] => columns.push((name, array.values)),
            [_, 3] => columns.extend((0..3).map(|k| {
                let values = array.values.iter().skip(k).step_by(3);
                (of_axis(&name, k), values.copied().collect())
            })),
            _ => columns.push((name, Vec::new())),
        }
    }
    let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    let place = HeaderPlace {
        path: &shown,
        line: 1,
    };
    let layout = Layout::new(place, &names, false, options.channels.as_deref())?;
    let mut found = Vec::new();
    for kept in &layout.found {
        let mut filled = column(kept.name.clone(), kept.role);
        for (row, value) in columns[kept.index].1.iter().enumerate() {
            if !value.is_finite() || value.abs() > LARGEST {
                let reason = if value.is_finite() {
                    BEYOND
                } else {
                    "is not finite"
                };
                return Err(sample(
                    &shown,
                    row as u64 + 1,
                    &kept.name,
                    &value.to_string(),
                    reason,
                ));
            }
            filled.values.push(*value);
        }
        found.push(filled);
    }
    if let Some(other) = found
        .iter()
        .find(|c| c.values.len() != found[0].values.len())
    {
        let (rows, name, first) = (other.values.len(), &other.name, &found[0]);
        let message = format!(
            "{name} has {rows} rows, {} has {}",
            first.name,
            first.values.len()
        );
        return Err(FileError::contents(shown.as_str(), Place::Within, message));
    }
    let (lines, notes, ignored) = (Lines::default(), Notes::default(), layout.ignored);
    Ok(Raw {
        path: shown.clone(),
        columns: found,
        ignored,
        head_rate,
        lines,
        notes,
    })
}

/// The name of one axis of a sensor's array: `accel_m_s2` has `accel_x_m_s2`.
fn of_axis(name: &str, axis: usize) -> String {
    let axis = ["x", "y", "z"][axis];
    let sensor = name.find('_').unwrap_or(name.len());
    let (stem, unit) = match name
        .find("_m_s2")
        .or(name.find("_rad_s"))
        .or(name.find("_deg_s"))
    {
        Some(unit) => name.split_at(unit),
        None => name.split_at(sensor),
    };
    format!("{stem}_{axis}{unit}")
}
