//! Static recordings: tables of any kind and logs, one replicate a file, a directory being all its recordings in name order.
//!
//! Columns are found by their names, their units by the names' endings; what was found, and
//! what was assumed, is told in the [`Report`]. What cannot be right is refused with file and line
//! ([`Failure`]).

mod files;
mod report;
mod samples;
pub(in crate::io) mod timing;
mod write;

pub use report::{FileReport, Report};
pub(in crate::io) use samples::{check_gravity, gravity_factor};
pub(crate) use write::csv;

use super::logs::LogOptions;
use super::table::NO_COLUMN;
use super::table::{
    self, ACCELERATION, ANGLE, ANGULAR_RATE, Asked, Bare, Column, Dictionary, NONE, Numbers,
    Quantity, TIME, Table, Units,
};
use super::{Failure, Place, help};
use files::no_files;
use nav_sim_signal::imu::{Channel, Recording};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// How recordings are read.
#[derive(Debug, Clone)]
pub struct ReadOptions {
    /// Sample rate (Hz) for files without a time column; where there is one, it must agree within 1 %, and wins where
    /// gaps are ignored.
    pub rate_hz: Option<f64>,
    /// Seconds to leave out at the beginning (warm-up).
    pub skip_s: f64,
    /// What to do where the time jumps or stands still.
    pub gaps: Gaps,
    /// The channels wanted; none: all. Others are neither parsed nor checked nor held in memory.
    pub channels: Option<Vec<Channel>>,
    /// Names of the columns, for files without a header and instead of the header of those with one.
    pub columns: Option<Vec<String>>,
    /// What is read of a log.
    pub log: LogOptions,
    /// Fewest samples a recording must have (at least 2).
    pub min_samples: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            rate_hz: None,
            skip_s: 0.0,
            gaps: Gaps::default(),
            channels: None,
            columns: None,
            log: LogOptions::default(),
            min_samples: 2,
        }
    }
}

/// What to do where a time step is over 1.5 or under 0.5 of the median step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Gaps {
    /// Refuse the file.
    #[default]
    Refuse,
    /// Leave out what is missing where it is less than a tenth; refuse the file otherwise. Missing samples are NaN.
    Keep,
    /// Make each stretch between such steps a recording of its own.
    Split,
    /// Take the samples as evenly spaced over the whole time all the same (late stamps, not lost samples).
    Ignore,
}

nav_sim_signal::named!(Gaps { Refuse = "refuse", Keep = "keep", Split = "split", Ignore = "ignore" });

/// Names before the axis, and those that mean SI by convention.
const ACCEL: &[&str] = &[
    "accel",
    "acc",
    "accelerometer",
    "acceleration",
    "specific_force",
    "lin_acc",
    "a",
    "f",
    "raw_acc",
];
const ACCEL_SI: &[&str] = &[
    "linear_acceleration",
    "field_linear_acceleration",
    "a_rs_s",
    "alpha",
];
const GYRO: &[&str] = &[
    "gyro",
    "gyr",
    "gyroscope",
    "angular_rate",
    "ang_vel",
    "g",
    "w",
    "raw_gyro",
];
const GYRO_SI: &[&str] = &[
    "angular_velocity",
    "field_angular_velocity",
    "w_rs_s",
    "omega",
];
const INCREMENT: Units = &[(&["m_s"], 1.0), (&["mps"], 1.0)];
/// Time of measurement, preferred to the time of arrival beside it.
pub(in crate::io) const STAMP: &[&str] = &["field_header_stamp", "header_stamp", "stamp"];
pub(in crate::io) const OF_CLOCK: &[&str] = &[
    "t",
    "time",
    "timestamp",
    "time_stamp",
    "elapsed",
    "elapsed_time",
    "epoch",
];
/// Time of a receiver, of the week or not: the last to be taken, because it may be that of its last fix.
pub(in crate::io) const OF_RECEIVER: &[&str] = &[
    "tow",
    "gps_tow",
    "gpstow",
    "time_of_week",
    "gps_time_of_week",
    "sow",
    "gps_sow",
    "seconds_of_week",
    "second_of_week",
    "gps_seconds_of_week",
    "gps_seconds",
    "gps_time",
    "gpstime",
    "gps_timestamp",
];

const fn time(stems: &'static [&'static str], bare: Bare, rank: u8) -> Quantity {
    Quantity {
        rank: Some(rank),
        ..Quantity::new("t_s", stems, TIME, bare)
    }
}

/// Rates of a signal, in units that are to be found out or SI by convention, and its increments.
const fn signal(
    name: &'static str,
    [free, si, increment]: [&'static [&'static str]; 3],
    [rate, per_sample]: [Units; 2],
) -> [Quantity; 3] {
    let any = Quantity {
        axis: name.split_at(name.len() - 1).1,
        ..Quantity::new(name, free, rate, Bare::Unknown)
    };
    let is_si = Quantity {
        stems: si,
        bare: Bare::Is(1.0),
        ..any
    };
    let is_increment = Quantity {
        stems: increment,
        units: per_sample,
        bare: Bare::Not,
        per_sample: true,
        ..any
    };
    [any, is_si, is_increment]
}

const fn accel(name: &'static str) -> [Quantity; 3] {
    signal(name, [ACCEL, ACCEL_SI, &["dv"]], [ACCELERATION, INCREMENT])
}

const fn gyro(name: &'static str) -> [Quantity; 3] {
    signal(name, [GYRO, GYRO_SI, &["dtheta"]], [ANGULAR_RATE, ANGLE])
}

/// Quantities of a recording. A packet counter starts again at 0 after 65535; ticks of 0.1 ms do after 2^32 − 1, and an
/// exporter may leave them empty.
static QUANTITIES: [[Quantity; 3]; 9] = [
    [
        time(STAMP, Bare::Unknown, 0),
        time(OF_CLOCK, Bare::Unknown, 1),
        time(OF_RECEIVER, Bare::Unknown, 2),
    ],
    [
        time(&["timeus"], Bare::Is(1e-6), 1),
        time(&["timems"], Bare::Is(1e-3), 1),
        time(&["itow"], Bare::Is(1e-3), 1),
    ],
    [
        Quantity::new("counter", &["packetcounter"], NONE, Bare::Is(1.0)),
        Quantity::new("counter", &["packet_counter"], NONE, Bare::Is(1.0)),
        Quantity {
            may_be_empty: true,
            ..Quantity::new("ticks", &["sampletimefine"], NONE, Bare::Is(1.0))
        },
    ],
    accel("accel.x"),
    accel("accel.y"),
    accel("accel.z"),
    gyro("gyro.x"),
    gyro("gyro.y"),
    gyro("gyro.z"),
];

const SIX: [&str; 6] = [
    "accel_x_m_s2",
    "accel_y_m_s2",
    "accel_z_m_s2",
    "gyro_x_rad_s",
    "gyro_y_rad_s",
    "gyro_z_rad_s",
];
const SEVEN: [&str; 7] = ["t_s", SIX[0], SIX[1], SIX[2], SIX[3], SIX[4], SIX[5]];

/// Dictionary of recordings.
pub(in crate::io) const DICTIONARY: Dictionary = Dictionary {
    quantities: QUANTITIES.as_flattened(),
    bare: &[],
    array: &[&SIX, &SEVEN],
    numbers: Numbers::Finite,
    advice: "name the columns t_s, accel_x_m_s2 … gyro_z_rad_s (also _g, _mg, _deg_s, _deg_h; t_ms, t_us, t_ns)",
    bad_cell: |error, value| match value.matches(':').count() > 1 {
        _ if error.advice().is_some() => error,
        true => {
            error.or_hint("write the time in seconds, from any instant on, and name the column t_s")
        }
        false => error
            .or(help::REMOVE_LINE)
            .or_hint("record again: a sample that is made up would change the noise"),
    },
};

/// The name of a channel's column in files of this program.
const fn column_name(channel: Channel) -> &'static str {
    SIX[channel.index()]
}

/// The channel that a column is of.
fn channel_of(column: &Column) -> Option<Channel> {
    let name = column.quantity.name;
    Channel::named(name)
        .first()
        .copied()
        .filter(|_| !column.quantity.axis.is_empty())
}

/// Reads the columns of a file: one signal at least.
pub(in crate::io) fn load(
    path: &Path,
    options: &ReadOptions,
    dictionary: &Dictionary,
) -> Result<Table, Failure> {
    let wanted = options.channels.as_ref();
    let is_unwanted = |q: &Quantity| {
        let own = Channel::named(q.name);
        !q.axis.is_empty() && wanted.is_some_and(|w| !own.iter().any(|c| w.contains(c)))
    };
    let asked = Asked {
        names: options.columns.as_deref(),
        unwanted: Some(&is_unwanted),
        log: options.log.clone(),
    };
    let table = table::read(path, dictionary, &asked)?;
    let is_gyro = |c: &&Column| c.factor.is_none() && c.quantity.name.starts_with("gyro");
    if let Some(column) = table.columns.iter().find(is_gyro) {
        return Err(no_unit(&table, &column.name));
    }
    if table.columns.iter().all(|c| c.quantity.axis.is_empty()) {
        let known = table.columns.iter().map(|c| &c.name);
        let names: Vec<String> = known
            .chain(&table.ignored)
            .take(20)
            .map(|name| format!("\"{}\"", table::shown(name, 40)))
            .collect();
        let message = format!(
            "no accelerometer or gyroscope column among {}",
            names.join(", ")
        );
        return Err(table
            .refused(message)
            .passing_over(NO_COLUMN)
            .or_hint(dictionary.advice)
            .or(help::COLUMN_NAMES));
    }
    Ok(table)
}

/// A column without a unit that cannot be known.
fn no_unit(table: &Table, column: &str) -> Failure {
    let units = if column.to_lowercase().starts_with('a') {
        "end its name in _m_s2, _g or _mg"
    } else {
        "end its name in _rad_s, _deg_s or _deg_h"
    };
    table
        .refused(format!("column \"{column}\" has no unit in its name"))
        .or_hint(units)
        .or(help::COLUMN_NAMES)
}

/// Fewer samples than are needed.
fn too_short(path: &str, samples: usize, needed: usize) -> Failure {
    let message = format!("{samples} samples, but {needed} are needed");
    Failure::contents(path, Place::Within, message)
        .or_hint("record for longer, or ask for fewer scales")
}

/// Reads recordings; those of a directory in name order (numbers in names by value). All are held.
///
/// # Errors
/// When a file cannot be read, or holds what no sound recording can: [`Failure`].
pub fn read(paths: &[PathBuf], options: &ReadOptions) -> Result<(Vec<Recording>, Report), Failure> {
    visit(paths, options, &|recording| recording, &|_, _| {})
}

/// Files that are read side by side.
const AT_ONCE: usize = 8;

/// Reads recordings and shows each to `look`, from any thread, then lets it go: no more than eight files are held at a
/// time. What `look` returned is in the order of the files. `tell` is told how many files are done, and of how many, from 0 on.
///
/// # Errors
/// When a file cannot be read, or holds what no sound recording can: [`Failure`].
pub(crate) fn visit<T: Send>(
    paths: &[PathBuf],
    options: &ReadOptions,
    look: &(dyn Fn(Recording) -> T + Sync),
    tell: &dyn Fn(usize, usize),
) -> Result<(Vec<T>, Report), Failure> {
    let files = files::expand(paths)?;
    let (mut looks, mut report) = (Vec::new(), Report::default());
    tell(0, files.len());
    let mut done = 0;
    for some in files.chunks(AT_ONCE) {
        let outcomes: Vec<_> = some
            .par_iter()
            .map(|file| held(&file.path, options, look))
            .collect();
        for (file, outcome) in some.iter().zip(outcomes) {
            match outcome {
                // the output of this very command, say, when it goes to a file in the directory
                Err(e) if file.from_directory && e.passed_over().is_some() => {
                    let (path, why) = (file.path.display(), e.passed_over().unwrap_or_default());
                    let text = format!("{path}: passed over, {why}");
                    report.warnings.push(text);
                }
                outcome => {
                    let (of_file, held) = outcome?;
                    looks.extend(held);
                    report.files.push(of_file);
                }
            }
            done += 1;
            tell(done, files.len());
        }
    }
    samples::same_rate(&report.files)?;
    if looks.is_empty() {
        let path = paths
            .first()
            .map(|p| p.display().to_string())
            .unwrap_or_default();
        return Err(no_files(path));
    }
    Ok((looks, report))
}

/// Results of `look` for the recordings of a file.
fn held<T>(
    path: &Path,
    options: &ReadOptions,
    look: &(dyn Fn(Recording) -> T + Sync),
) -> Result<(FileReport, Vec<T>), Failure> {
    let table = load(path, options, &DICTIONARY)?;
    let (recordings, mut report) = samples::recordings(table, options)?;
    path.clone_into(&mut report.path);
    Ok((report, recordings.into_iter().map(look).collect()))
}

#[cfg(test)]
mod tests;
