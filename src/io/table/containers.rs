//! Tables that are no text: arrays of NumPy, Parquet, directories of KITTI, logs.

use super::text::{layout, number};
use super::{Asked, Dictionary, Table, shown, unreadable};
use crate::io::{Failure, Place, help, logs, source};
use chrono::NaiveDateTime;
use nav_sim_logs::npy::{self, Array};
use nav_sim_logs::{Channel, Clock, Content, in_seconds};
use std::path::{Path, PathBuf};

/// Columns by their names.
type Columns = Vec<(String, Vec<f64>)>;

/// The table of such columns.
pub(super) fn table(
    path: &Path,
    columns: Columns,
    dictionary: &Dictionary,
    asked: &Asked<'_>,
) -> Result<Table, Failure> {
    let path = path.display().to_string();
    let names: Vec<String> = match asked.names {
        Some(names) if names.len() != columns.len() => {
            return Err(Failure::row_length(&path, 1, columns.len(), names.len()));
        }
        Some(names) => names.to_vec(),
        None => columns.iter().map(|(name, _)| name.clone()).collect(),
    };
    let (mut table, places) = Table::new(&path, 0, &names, dictionary, asked, false)?;
    table.fits(columns.first().map_or(0, |(_, values)| values.len() as u64))?;
    for ((_, values), place) in columns.into_iter().zip(places) {
        let Some(column) = place else { continue };
        for (line, value) in (1..).zip(values) {
            table.push(column, value, None, line, dictionary)?;
        }
    }
    Ok(table)
}

/// Every `step`-th number from the `first` on.
fn strided(array: &Array, first: usize, step: usize) -> Vec<f64> {
    array
        .values
        .iter()
        .skip(first)
        .step_by(step)
        .copied()
        .collect()
}

/// Reads an array: columns named by who asks, or by their number.
pub(super) fn npy(
    path: &Path,
    dictionary: &Dictionary,
    asked: &Asked<'_>,
) -> Result<Columns, Failure> {
    let array = npy::read(path).map_err(|e| logs::refused(path, e))?;
    let refused = |message: String| Failure::contents(path.display(), Place::Within, message);
    let count = match array.shape[..] {
        [_] => 1,
        [_, columns] => columns,
        _ => {
            let dimensions = array.shape.len();
            return Err(refused(format!(
                "an array of {dimensions} dimensions, samples × columns are needed"
            )));
        }
    };
    let named = asked.names.map(|_| vec![String::new(); count]);
    let names = named.or_else(|| layout(dictionary.array, count));
    let names = names.ok_or_else(|| {
        refused(format!(
            "an array of {count} columns, which names are not known"
        ))
        .or_hint(dictionary.advice)
        .or(help::COLUMN_NAMES)
    })?;
    let columns = (0..).zip(names);
    Ok(columns
        .map(|(k, name)| (name, strided(&array, k, count)))
        .collect())
}

/// Name of the array of a single number that states the rate (Hz).
#[cfg(feature = "npz")]
pub(super) const RATE: &str = "rate_hz";

/// Reads named arrays: a vector is a column, an array of three columns the three axes of a sensor. Also the rate (Hz), if
/// it is stated.
#[cfg(feature = "npz")]
pub(super) fn npz(path: &Path) -> Result<(Columns, Option<f64>), Failure> {
    use nav_sim_logs::{Error, Fault, npz::Archive};
    let refused = |e| logs::refused(path, e);
    let mut archive = Archive::open(path).map_err(refused)?;
    let (mut columns, mut rate_hz) = (Vec::new(), None);
    for name in archive.names() {
        let Array { shape, values } = match archive.read(&name) {
            // texts and the like are passed over
            Err(Error::At(_, Fault::Encoding(_))) => {
                columns.push((name, Vec::new()));
                continue;
            }
            read => read.map_err(refused)?,
        };
        match shape[..] {
            [] | [1] if name == RATE => rate_hz = values.first().copied(),
            [_] => columns.push((name, values)),
            [_, 3] => {
                let array = Array { shape, values };
                columns.extend((0..3).map(|k| (of_axis(&name, k), strided(&array, k, 3))));
            }
            _ => columns.push((name, Vec::new())),
        }
    }
    Ok((columns, rate_hz))
}

/// The name of one axis of a sensor's array: `accel_m_s2` has `accel_x_m_s2`.
#[cfg(feature = "npz")]
fn of_axis(name: &str, axis: usize) -> String {
    let units = ["_m_s2", "_rad_s", "_deg_s"];
    let unit = units.iter().find_map(|unit| name.find(unit));
    let (stem, unit) = name.split_at(unit.or(name.find('_')).unwrap_or(name.len()));
    format!("{stem}_{}{unit}", ["x", "y", "z"][axis])
}

/// Reads Apache Parquet: columns by their names; what is no number is NaN.
#[cfg(feature = "parquet")]
pub(super) fn parquet(path: &Path) -> Result<Columns, Failure> {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    let damaged = |e: parquet::errors::ParquetError| {
        Failure::contents(path.display(), Place::Within, e.to_string())
    };
    let file = std::fs::File::open(path).map_err(|e| unreadable(path, e))?;
    let reader = SerializedFileReader::new(file).map_err(damaged)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let named = schema.columns().iter();
    let named = named.map(|column| (column.name().to_owned(), Vec::new()));
    let mut columns: Columns = named.collect();
    for row in reader.get_row_iter(None).map_err(damaged)? {
        let row = row.map_err(damaged)?;
        for ((_, field), (_, values)) in row.get_column_iter().zip(&mut columns) {
            values.push(match field {
                Field::Double(value) => *value,
                Field::Float(value) => f64::from(*value),
                Field::Int(value) => f64::from(*value),
                Field::Long(value) => *value as f64,
                _ => f64::NAN,
            });
        }
    }
    Ok(columns)
}

/// Names of the quantities of a sample of KITTI that are read, and their places in its line.
///
/// The numbers are those of `dataformat.txt` there ([Geiger et al. 2013](https://doi.org/10.1177/0278364913491297), sec.
/// III-A): accelerations and angular rates in the axes of the vehicle, front, left, up, are the 12th to 14th and 18th to 20th.
const OXTS: [(&str, usize); 6] = [
    ("accel_x_m_s2", 11),
    ("accel_y_m_s2", 12),
    ("accel_z_m_s2", 13),
    ("gyro_x_rad_s", 17),
    ("gyro_y_rad_s", 18),
    ("gyro_z_rad_s", 19),
];

/// True if a directory is a recording of KITTI: one line a sample in `data/`, and their times in `timestamps.txt`.
pub(crate) fn is_oxts(directory: &Path) -> bool {
    directory.join("timestamps.txt").is_file() && directory.join("data").is_dir()
}

/// Reads such a directory.
pub(super) fn oxts(directory: &Path) -> Result<Columns, Failure> {
    let times = oxts_times(&directory.join("timestamps.txt"))?;
    let data = directory.join("data");
    let entries = std::fs::read_dir(&data).map_err(|e| unreadable(&data, e))?;
    let mut files: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "txt"));
    files.sort();
    if files.len() != times.len() {
        let (samples, times) = (files.len(), times.len());
        let message = format!("{samples} samples in data, {times} times in timestamps.txt");
        return Err(Failure::contents(
            directory.display(),
            Place::Within,
            message,
        ));
    }
    let mut columns = vec![("t_s".to_owned(), times)];
    columns.extend(OXTS.map(|(name, _)| (name.to_owned(), Vec::new())));
    for path in &files {
        let text = source::text(path).map_err(|e| unreadable(path, e))?;
        let cells: Vec<&str> = text.split_ascii_whitespace().collect();
        for ((_, values), (name, at)) in columns[1..].iter_mut().zip(OXTS) {
            let cell = cells.get(at).copied().unwrap_or_default();
            let finite = number(cell.as_bytes(), b' ').filter(|x| x.is_finite());
            values.push(finite.ok_or_else(|| {
                let (path, cell) = (path.display().to_string(), format!("\"{cell}\""));
                Failure::cell(&path, 1, name, cell, "is not a finite number")
            })?);
        }
    }
    Ok(columns)
}

/// Times of the samples (s since 1970).
fn oxts_times(path: &Path) -> Result<Vec<f64>, Failure> {
    let text = source::text(path).map_err(|e| unreadable(path, e))?;
    let time = |(i, line): (usize, &str)| {
        let parsed = NaiveDateTime::parse_from_str(line.trim(), "%Y-%m-%d %H:%M:%S%.f");
        let found = parsed.map_err(|_| {
            let message = format!("\"{}\" is not a time", shown(line, 40));
            Failure::contents(path.display(), i + 1, message)
                .or_hint("2011-09-26 13:02:25.964389445")
        })?;
        let since = found.and_utc();
        Ok(since.timestamp() as f64 + 1e-9 * f64::from(since.timestamp_subsec_nanos()))
    };
    let lines = text.lines().enumerate();
    lines
        .filter(|(_, line)| !line.trim().is_empty())
        .map(time)
        .collect()
}

/// Reads the samples of the IMU of a log.
pub(super) fn log(
    path: &Path,
    dictionary: &Dictionary,
    asked: &Asked<'_>,
) -> Result<Table, Failure> {
    let refused = |e| logs::refused(path, e);
    let log = logs::open(path)?;
    let channel = log.channel(Content::Imu, asked.log.topic.as_deref());
    let channel = channel.map_err(refused)?;
    let samples = log.imu(channel, asked.log.stamp).map_err(refused)?;
    let times = samples.iter().map(|sample| in_seconds(sample.stamp_ns));
    let mut columns = vec![("t_s".to_owned(), times.collect())];
    for (k, (name, _)) in OXTS.iter().enumerate() {
        let values = samples.iter().map(|sample| match k.checked_sub(3) {
            None => sample.accel_m_s2[k],
            Some(axis) => sample.gyro_rad_s[axis],
        });
        columns.push(((*name).to_owned(), values.collect()));
    }
    let mut table = table(path, columns, dictionary, asked)?;
    table.assumptions.push(format!("topic {}", channel.topic));
    table.warnings.extend(log.damage().map(logs::cut_off));
    let is_other = |c: &&Channel| c.topic != channel.topic && c.clock == Clock::Unix;
    let others = log.channels().iter().filter(is_other);
    table.ignored = others.map(|c| c.topic.clone()).collect();
    Ok(table)
}
