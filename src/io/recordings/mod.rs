//! Static recordings: tables of any kind and logs, one replicate a file, a directory being all its recordings in name order.
//!
//! Columns are found by their names, their units by the names' endings; what was found, and
//! what was assumed, is told in the [`Report`]. What cannot be right is refused with file and line
//! ([`Failure`]).

use super::file_kind::{self, FileKind};
use super::input::listed;
use super::logs::LogOptions;
use super::table::{
    ACCELERATION, ANGLE, ANGULAR_RATE, Column, DefaultUnit, Dictionary, INSTANCE, InputTable,
    NO_COLUMN, Quantity, SENSOR_LOGGER, TICKS, TIME, Units, is_oxts, unreadable,
};
use super::{Failure, Place, help, table};
use crate::report::six_digits;
use nav_sim_signal::facts::SampleFingerprint;
use nav_sim_signal::imu::{Channel, Recording, Sensor, Signal};
use nav_sim_signal::units::STANDARD_GRAVITY;
use rayon::prelude::*;
use std::collections::HashSet;
use std::fmt;
use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use timing::Timing;

pub mod facts;
pub(crate) mod timing;

/// Options for reading recordings.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Sample rate (Hz) for files without a time column; where there is one, it must agree within 1 %, and wins where
    /// gaps are ignored.
    pub rate_hz: Option<f64>,
    /// Seconds to leave out at the beginning (warm-up).
    pub skip_s: f64,
    /// Handling of gaps and repeated times.
    pub gaps: Gaps,
    /// The channels wanted; none: all. Others are neither parsed nor checked nor held in memory.
    pub channels: Option<Vec<Channel>>,
    /// Names of the columns, for files without a header and instead of the header of those with one.
    pub columns: Option<Vec<String>>,
    /// Selection of a log's channels.
    pub log: LogOptions,
    /// Fewest samples a recording must have (at least 2).
    pub min_samples: usize,
}

/// Handling of time steps over 1.5 or under 0.5 of the median step.
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
const ACCEL: &str = "accel acc accelerometer acceleration specific_force lin_acc a f raw_acc";
const ACCEL_SI: &str = "linear_acceleration field_linear_acceleration a_rs_s alpha";
const GYRO: &str = "gyro gyr gyroscope angular_rate ang_vel g w raw_gyro";
const GYRO_SI: &str = "angular_velocity field_angular_velocity w_rs_s omega";
const INCREMENT: Units = &[("m_s", 1.0), ("mps", 1.0)];
/// Time of measurement, preferred to the time of arrival beside it.
pub(crate) const STAMP: &str = "field_header_stamp header_stamp stamp";
pub(crate) const OF_CLOCK: &str =
    "t time timestamp time_stamp elapsed elapsed_time epoch time_since_start time_since_start_in";
/// Time of a receiver, of the week or not: the last to be taken, because it may be that of its last fix.
pub(crate) const OF_RECEIVER: &str = "tow gps_tow gpstow time_of_week gps_time_of_week sow gps_sow seconds_of_week second_of_week gps_seconds_of_week gps_seconds gps_time gpstime gps_timestamp";

const fn time(stems: &'static str, bare: DefaultUnit, rank: u8) -> Quantity {
    Quantity {
        rank: Some(rank),
        ..Quantity::new("t_s", stems, TIME, bare)
    }
}

/// Rates of a signal, in units that are to be found out or SI by convention, and its increments.
const fn signal(
    name: &'static str,
    [free, si, increment]: [&'static str; 3],
    [rate, per_sample]: [Units; 2],
) -> [Quantity; 3] {
    let any = Quantity {
        axis: name.split_at(name.len() - 1).1,
        ..Quantity::new(name, free, rate, DefaultUnit::Unknown)
    };
    let is_si = Quantity {
        stems: si,
        bare: DefaultUnit::Is(1.0),
        ..any
    };
    let is_increment = Quantity {
        stems: increment,
        units: per_sample,
        bare: DefaultUnit::Not,
        per_sample: true,
        ..any
    };
    [any, is_si, is_increment]
}

const fn accel(name: &'static str) -> [Quantity; 3] {
    signal(name, [ACCEL, ACCEL_SI, "dv"], [ACCELERATION, INCREMENT])
}

const fn gyro(name: &'static str) -> [Quantity; 3] {
    signal(name, [GYRO, GYRO_SI, "dtheta"], [ANGULAR_RATE, ANGLE])
}

/// Quantities of a recording. A packet counter starts again at 0 after 65535.
static QUANTITIES: [[Quantity; 3]; 10] = [
    [
        time(STAMP, DefaultUnit::Unknown, 0),
        time(OF_CLOCK, DefaultUnit::Unknown, 1),
        time(OF_RECEIVER, DefaultUnit::Unknown, 2),
    ],
    [
        time("timeus", DefaultUnit::Is(1e-6), 1),
        time("timems itow", DefaultUnit::Is(1e-3), 1),
        time(SENSOR_LOGGER, DefaultUnit::Is(1.0), 1),
    ],
    [
        time("timestamp*", DefaultUnit::Not, 1),
        time(TICKS, DefaultUnit::Unknown, 3),
        Quantity::number("counter", "packetcounter packet_counter"),
    ],
    [Quantity::number(INSTANCE, "i"); 3],
    accel("accel.x"),
    accel("accel.y"),
    accel("accel.z"),
    gyro("gyro.x"),
    gyro("gyro.y"),
    gyro("gyro.z"),
];

const SIX: &str = "accel_x_m_s2 accel_y_m_s2 accel_z_m_s2 gyro_x_rad_s gyro_y_rad_s gyro_z_rad_s";
const SEVEN: &str =
    "t_s accel_x_m_s2 accel_y_m_s2 accel_z_m_s2 gyro_x_rad_s gyro_y_rad_s gyro_z_rad_s";

/// Dictionary of recordings.
pub(crate) const DICTIONARY: Dictionary<'_> = Dictionary {
    array: &[SIX, SEVEN],
    bad_cell: "remove the line, or record again: made-up samples change the noise",
    ..Dictionary::new(
        QUANTITIES.as_flattened(),
        "name the columns t_s, accel_x_m_s2 … gyro_z_rad_s (also _g, _mg, _deg_s, _deg_h; t_ms, t_us, t_ns)",
    )
};

/// The channel that a column is of.
fn channel_of(column: &Column) -> Option<Channel> {
    let name = column.quantity.name;
    Channel::named(name)
        .first()
        .copied()
        .filter(|_| !column.quantity.axis.is_empty())
}

/// Reads the columns of a file: one signal at least.
pub(crate) fn load(
    path: &Path,
    options: &ReadOptions,
    dictionary: &Dictionary<'_>,
) -> Result<InputTable, Failure> {
    use FileKind as K;
    load_signals(path, options, dictionary)
        .map_err(|e| file_kind::or_wrong_kind(&[K::Recording, K::Imu, K::Log, K::Other], path, e))
}

fn load_signals(
    path: &Path,
    options: &ReadOptions,
    dictionary: &Dictionary<'_>,
) -> Result<InputTable, Failure> {
    let wanted = options.channels.as_ref();
    let is_unwanted = |q: &Quantity| {
        let own = Channel::named(q.name);
        !q.axis.is_empty() && wanted.is_some_and(|w| !own.iter().any(|c| w.contains(c)))
    };
    let dictionary = &Dictionary {
        names: options.columns.as_deref(),
        unwanted: Some(&is_unwanted),
        log: Some(&options.log),
        ..*dictionary
    };
    let mut table = table::read(path, dictionary)?;
    let is_wanted = |channel| wanted.is_none_or(|wanted| wanted.contains(&channel));
    table.warnings.extend(facts::misspelt(&table, is_wanted));
    let is_unclear = |c: &&Column| {
        let is_ticks = || c.quantity.stems == TICKS && options.rate_hz.is_none();
        c.factor.is_none() && (c.quantity.name.starts_with("gyro") || is_ticks())
    };
    if let Some(column) = table.columns.iter().find(is_unclear) {
        return Err(table.no_unit(column));
    }
    if let Some(instance) = table.take(INSTANCE) {
        let first = instance.values[0];
        for column in &mut table.columns {
            let values = column.values.iter_mut().zip(&instance.values);
            values
                .filter(|(_, own)| **own != first)
                .for_each(|(value, _)| *value = f64::NAN);
        }
        if table.drop_incomplete_rows().is_some() {
            let text = format!("of several IMUs that with {} = {first}", instance.name);
            table.assumptions.push(text);
        }
    }
    let name = file_name(path).to_lowercase();
    let is_estimate = name.starts_with("accelerometer.") || name.starts_with("linear");
    if is_estimate
        && table
            .get("t_s")
            .is_some_and(|t| t.quantity.stems == SENSOR_LOGGER)
    {
        let text = "has accelerations without gravity; TotalAcceleration.csv has measured ones";
        if path.with_file_name("TotalAcceleration.csv").exists() {
            return Err(Failure::contents(&table.path, Place::Itself, text)
                .or_hint("name TotalAcceleration.csv")
                .skipped_as("it is without gravity"));
        }
        table.warnings.push(text.to_owned());
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
            .skipped_as(NO_COLUMN)
            .or_hint(dictionary.advice)
            .or_option(help::COLUMN_NAMES));
    }
    Ok(table)
}

/// Fewer samples than are needed.
fn too_short(path: &str, samples: usize, needed: usize) -> Failure {
    let message = format!("{samples} samples, but {needed} are needed");
    Failure::contents(path, Place::Within, message).or_hint("fewer --scales, or record for longer")
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
    let files = expand(paths)?;
    let (mut looks, mut report, mut passed_over) = (Vec::new(), Report::default(), None);
    tell(0, files.len());
    let mut done = 0;
    for some in files.chunks(AT_ONCE) {
        let outcomes: Vec<_> = some
            .par_iter()
            .map(|(path, _)| held(path, options, look))
            .collect();
        for ((path, is_found), outcome) in some.iter().zip(outcomes) {
            match outcome {
                // the output of this very command, say, when it goes to a file in the directory
                Err(e) if *is_found && e.skip_reason().is_some() => {
                    let (path, why) = (path.display(), e.skip_reason().unwrap_or_default());
                    let text = format!("{path}: skipped, {why}");
                    report.warnings.push(text);
                    passed_over = passed_over.or(Some(e));
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
    same_rate(&report.files)?;
    report.warnings.extend(facts::compare(&report.files)?);
    if looks.is_empty() {
        let path = paths.first().map(|p| p.display().to_string());
        return Err(passed_over.unwrap_or_else(|| no_files(path.unwrap_or_default())));
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
    let (recordings, mut report) = recordings(table, options)?;
    path.clone_into(&mut report.path);
    Ok((report, recordings.into_iter().map(look).collect()))
}

#[cfg(test)]
mod tests;

// Which files are meant: directories stand for the recordings in them.

const ENDINGS: [&str; 10] = [
    "csv", "tsv", "txt", "npy", "npz", "mcap", "bag", "ulg", "ubx", "parquet",
];

/// The files, in the order given, those of a directory in name order; true where it was found in one, not named: it may turn out
/// to be something else.
fn expand(paths: &[PathBuf]) -> Result<Vec<(PathBuf, bool)>, Failure> {
    let mut files = Vec::new();
    for path in paths {
        let io = |e| unreadable(path, e);
        if std::fs::metadata(path).map_err(io)?.is_dir() && !is_oxts(path) {
            let mut inside = listed(std::slice::from_ref(path))?;
            inside.retain(|path| {
                let name = file_name(path);
                !name.starts_with('.') && is_recording(&name)
            });
            inside.sort_by_key(|path| natural(&file_name(path)));
            if inside.is_empty() {
                return Err(no_files(path.display().to_string()));
            }
            files.extend(inside.into_iter().map(|path| (path, true)));
        } else {
            files.push((path.clone(), false));
        }
    }
    let mut seen = HashSet::new();
    for (path, _) in &files {
        // A pipe has no path of its own.
        if !seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
            let message = "is given twice";
            return Err(Failure::contents(path.display(), Place::Itself, message)
                .or_hint("name each file once; a directory stands for its recordings"));
        }
    }
    Ok(files)
}

/// A directory without recordings.
fn no_files(path: String) -> Failure {
    Failure::contents(path, Place::Within, "no recordings in it").or_hint(
        "recordings end in .csv, .tsv, .txt (also .gz), .npy, .npz, .mcap, .bag, .ulg or .ubx",
    )
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Sort key: digits compare by value, so that `replicate_9` is before `replicate_10`.
fn natural(name: &str) -> (String, String) {
    let is_digit = |text: &[u8]| text[0].is_ascii_digit();
    let parts = name
        .as_bytes()
        .chunk_by(|a, b| is_digit(&[*a]) == is_digit(&[*b]));
    let padded = parts.map(|part| match String::from_utf8_lossy(part) {
        number if is_digit(part) => format!("{number:0>20}"),
        word => word.into_owned(),
    });
    (padded.collect(), name.to_owned())
}

/// Returns true for a name with a recording's extension.
fn is_recording(name: &str) -> bool {
    let lower = name.to_lowercase();
    let plain = lower.strip_suffix(".gz").unwrap_or(&lower);
    plain
        .rsplit_once('.')
        .is_some_and(|(stem, ending)| !stem.is_empty() && ENDINGS.contains(&ending))
}

#[cfg(test)]
mod listing_tests {
    use super::*;

    #[test]
    fn name_order_counts() {
        let mut names = ["run10.csv", "run9.csv", "a.csv", "run1.csv", "run01.csv"];
        names.sort_by_key(|n| natural(n));
        assert_eq!(
            names,
            ["a.csv", "run01.csv", "run1.csv", "run9.csv", "run10.csv"]
        );
    }

    #[test]
    fn endings() {
        for name in ["a.csv", "a.CSV.gz", "b.tsv", "mt.txt", "x.npy"] {
            assert!(is_recording(name), "{name}");
        }
        for name in [
            "manifest.json",
            "model.toml",
            "csv",
            ".csv",
            "a.gz",
            "a.csv.partial",
        ] {
            assert!(!is_recording(name), "{name}");
        }
    }
}

// What was found in the files, for the user to check.

/// Findings and assumptions of the reading.
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

/// Findings and assumptions for one file. Displays as one line.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct FileReport {
    /// The file, as shown.
    pub file: String,
    /// The file itself: its name need not be UTF-8.
    pub path: PathBuf,
    /// Columns passed over.
    pub ignored: Vec<String>,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// Source of the rate, in words.
    pub rate_from: String,
    /// Samples of each recording made of the file (several if it was split at gaps).
    pub samples: Vec<usize>,
    /// The mean removed from each signal of the first of them (m/s² or rad/s).
    pub means: Vec<(Channel, f64)>,
    /// Assumptions, in words.
    pub assumptions: Vec<String>,
    /// Doubts, in words.
    pub warnings: Vec<String>,
    /// Fingerprints that detect samples shared with other files.
    marks: Vec<SampleFingerprint>,
}

/// The name of one of the recordings of a file.
fn name_of(file: &str, index: usize, count: usize) -> String {
    if count > 1 {
        format!("{file}[{}]", index + 1)
    } else {
        file.to_owned()
    }
}

impl FileReport {
    pub(super) fn new(raw: &InputTable) -> Self {
        let mut assumptions = raw.assumptions.clone();
        if raw.columns.iter().any(|c| c.quantity.per_sample) {
            assumptions.push("increments divided by the sample interval".into());
        }
        Self {
            file: raw.path.clone(),
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
        let total: usize = self.samples.iter().sum();
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

// A file whose time, units and stretches are decided: what is left is to take its samples.

/// The recordings of a file, and what was found in it.
pub(super) fn recordings(
    mut raw: InputTable,
    options: &ReadOptions,
) -> Result<(Vec<Recording>, FileReport), Failure> {
    let mut report = FileReport::new(&raw);
    let repair = facts::repair(&mut raw, options, &mut report)?;
    let own = |rate_hz: f64| rate_hz / repair.rows_per_sample;
    raw.rate_hz = raw.rate_hz.map(|(rate_hz, of)| (own(rate_hz), of));
    let options = &ReadOptions {
        rate_hz: options.rate_hz.map(own),
        ..options.clone()
    };
    let mut timing = timing::timing(&mut raw, options, &mut report)?;
    if options.gaps == Gaps::Split {
        timing.breaks.extend(&repair.breaks);
        timing.breaks.sort_unstable();
        timing.breaks.dedup();
    }
    repair.warn_of_frozen(timing.rate_hz, &mut report);
    report.marks = facts::marks(&raw);
    raw.columns
        .sort_by_key(|c| channel_of(c).map(Channel::index));
    let factors = factors(&raw, timing.rate_hz)?;
    let pieces = pieces(&raw.path, raw.rows(), &timing, options, &mut report)?;
    let empty = |i| Recording {
        name: name_of(&raw.path, i, pieces.len()),
        rate_hz: timing.rate_hz,
        signals: Vec::new(),
    };
    let mut recordings: Vec<Recording> = (0..pieces.len()).map(empty).collect();
    // column by column, so that each is let go when it is copied
    for (column, factor) in raw.columns.into_iter().zip(factors) {
        let Some(channel) = channel_of(&column) else {
            continue;
        };
        for (recording, piece) in recordings.iter_mut().zip(&pieces) {
            let values = &column.values[piece.clone()];
            let mean = mean(values, factor);
            let mut samples = with_holes(values, piece, &timing.holes);
            samples.iter_mut().for_each(|v| *v = *v * factor - mean);
            recording.signals.push(Signal {
                channel,
                mean,
                samples,
            });
        }
    }
    for recording in &recordings {
        let means = recording.signals.iter().map(|s| (s.channel, s.mean));
        let means: Vec<(Channel, f64)> = means.collect();
        plausible(recording, &means, &mut report)?;
        facts::examine(recording, &mut report)?;
        let samples = recording.signals.first().map_or(0, |s| s.samples.len());
        report.samples.push(samples);
        if report.means.is_empty() {
            report.means = means;
        }
    }
    repair.refuse_interpolated(&report.file)?;
    report.rate_hz = timing.rate_hz;
    Ok((recordings, report))
}

/// The samples of a stretch with NaN where some are missing.
fn with_holes(samples: &[f64], piece: &Range<usize>, holes: &[(usize, usize)]) -> Vec<f64> {
    let inside = holes.iter().filter(|(sample, _)| *sample > piece.start);
    let (mut inside, mut whole) = (inside.peekable(), Vec::with_capacity(samples.len()));
    for (k, value) in piece.clone().zip(samples) {
        if let Some((_, lost)) = inside.next_if(|(sample, _)| *sample == k) {
            whole.extend(std::iter::repeat_n(f64::NAN, *lost));
        }
        whole.push(*value);
    }
    whole
}

/// Largest ratio of the longest stretch between gaps to one that is kept.
const LONGEST_OVER_SHORTEST: usize = 16;

/// The stretches of samples that become recordings: at least one.
fn pieces(
    path: &str,
    samples: usize,
    timing: &Timing,
    options: &ReadOptions,
    report: &mut FileReport,
) -> Result<Vec<Range<usize>>, Failure> {
    let skip = ((options.skip_s.max(0.0) * timing.rate_hz).round() as usize).min(samples);
    let inner = timing.breaks.iter().copied().filter(|b| *b > skip);
    let ends: Vec<usize> = std::iter::once(skip)
        .chain(inner)
        .chain([samples])
        .collect();
    let all = || ends.windows(2).map(|w| w[0]..w[1]);
    let longest = all().map(|p| p.len()).max().unwrap_or(0);
    let needed = options.min_samples.max(2);
    if longest < needed {
        let refusal = too_short(path, longest, needed);
        return Err(match skip > 0 {
            true => refusal.or_option(("skip-s", "a smaller --skip-s")),
            false => refusal,
        });
    }
    // A short one would cost all others their long scales.
    let needed = needed.max(longest / LONGEST_OVER_SHORTEST);
    let dropped = all().filter(|p| p.len() < needed).count();
    if dropped > 0 {
        report.warn(format!(
            "{} of fewer than {needed} samples between gaps: left out",
            nav_sim_document::counted(dropped, "piece")
        ));
    }
    Ok(all().filter(|p| p.len() >= needed).collect())
}

/// Below this (m/s²) the mean was removed before: nothing to be learnt from it.
const NO_GRAVITY: f64 = 0.3;

/// A column without a larger value has squares that are no variances.
const SMALLEST: f64 = 1e-45;

/// Factors that bring each column to SI units; refuses dead axes.
fn factors(raw: &InputTable, rate_hz: f64) -> Result<Vec<f64>, Failure> {
    let from_gravity = gravity_factor(raw)?;
    let factor = |column: &Column| {
        if let Some(message) = facts::dead(column) {
            return Err(Failure::contents(&raw.path, Place::Within, message)
                .or_option(help::CHANNELS)
                .or_hint("record again"));
        }
        let channel = column.quantity.name;
        let largest = column
            .values
            .iter()
            .fold(0.0_f64, |most, v| most.max(v.abs()));
        if largest < SMALLEST {
            let message = format!("{channel} is nowhere above {largest:.0e}: no measurement");
            return Err(Failure::contents(&raw.path, Place::Within, message)
                .or_option(help::CHANNELS)
                .or_hint("write it in the unit of its name"));
        }
        let per_sample = if column.quantity.per_sample {
            rate_hz
        } else {
            1.0
        };
        Ok(column
            .factor
            .map_or(from_gravity, |factor| factor * per_sample))
    };
    raw.columns.iter().map(factor).collect()
}

/// The unit of accelerometer columns that do not say it, from the length of their mean.
pub(crate) fn gravity_factor(raw: &InputTable) -> Result<f64, Failure> {
    let is_unnamed = |c: &&Column| c.factor.is_none() && channel_of(c).is_some();
    let unnamed: Vec<&Column> = raw.columns.iter().filter(is_unnamed).collect();
    let Some(first) = unnamed.first() else {
        return Ok(1.0);
    };
    let means = unnamed
        .iter()
        .map(|c| mean(&c.values, 1.0))
        .collect::<Vec<_>>();
    let norm = norm(&means);
    let near = |target: f64| (norm / target - 1.0).abs() < 0.1;
    if unnamed.len() == 3 {
        for factor in [1.0, STANDARD_GRAVITY, 1e-3 * STANDARD_GRAVITY] {
            if near(STANDARD_GRAVITY / factor) {
                return Ok(factor);
            }
        }
    }
    Err(raw.no_unit(first))
}

/// Mean of the values that are there, times a factor, summed about the first of them so that a large offset costs no digits.
fn mean(values: &[f64], factor: f64) -> f64 {
    /// Values whose sum is taken before it is added: rounding grows with their number.
    const BLOCK: usize = 4096;
    let is_there = |v: &&f64| !v.is_nan();
    let Some(first) = values.iter().find(is_there).map(|first| first * factor) else {
        return 0.0;
    };
    let present = |block: &[f64]| {
        block
            .iter()
            .filter(is_there)
            .map(|v| v * factor - first)
            .sum::<f64>()
    };
    let count = values.iter().filter(is_there).count();
    first + values.chunks(BLOCK).map(present).sum::<f64>() / count as f64
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Static specific force is gravity, or nothing where the mean was removed before; rates are small.
fn plausible(
    recording: &Recording,
    means: &[(Channel, f64)],
    report: &mut FileReport,
) -> Result<(), Failure> {
    let [accel, gyro] = Sensor::ALL.map(|sensor| -> Vec<f64> {
        let own = means.iter().filter(|(channel, _)| channel.sensor == sensor);
        own.map(|(_, mean)| *mean).collect()
    });
    let (f, rate) = (norm(&accel), norm(&gyro));
    let is_gravity = (rate / STANDARD_GRAVITY - 1.0).abs() < 0.1;
    if accel.len() == 3 && gyro.len() == 3 && f < NO_GRAVITY && is_gravity {
        let message = format!(
            "accelerometers and gyroscopes are exchanged: |f| is {f:.4} m/s², the mean rate {rate:.4} rad/s"
        );
        return Err(Failure::contents(&report.file, Place::Within, message)
            .or_hint("without names the first three columns are accelerometers")
            .or_option(help::COLUMN_NAMES));
    }
    if accel.len() == 3 {
        // the mean of noise without gravity is of any size
        let own = recording
            .signals
            .iter()
            .filter(|s| s.channel.sensor == Sensor::Accel);
        let spread = own.map(|s| mean(&s.samples.iter().map(|x| x * x).collect::<Vec<_>>(), 1.0));
        let rate_hz = Some(recording.rate_hz).filter(|_| f > 5.0 * spread.sum::<f64>().sqrt());
        check_gravity(&report.file, f, rate_hz)?;
    }
    if rate > 0.1 {
        let degrees = rate.to_degrees();
        report.warn(format!(
            "mean angular rate {degrees:.1} deg/s: not static, or deg/s named rad/s?"
        ));
    }
    Ok(())
}

/// Refuses a specific force that is not gravity, nor none; with the rate (Hz) also that of increments named rates.
pub(crate) fn check_gravity(path: &str, norm: f64, rate_hz: Option<f64>) -> Result<(), Failure> {
    let near = |target: f64| (norm / target - 1.0).abs() < 0.1;
    let step = rate_hz.map(|rate_hz| 1.0 / rate_hz);
    let step = step.filter(|step| near(STANDARD_GRAVITY * step));
    if near(STANDARD_GRAVITY) || norm < NO_GRAVITY && step.is_none() {
        return Ok(());
    }
    let increments = step.map(|step| format!("increments over {} s named rates", six_digits(step)));
    let guess = if near(1.0) {
        "it looks like g"
    } else if near(1000.0) {
        "it looks like mg"
    } else if near(STANDARD_GRAVITY * STANDARD_GRAVITY) {
        "it looks like m/s² named g"
    } else {
        "wrong unit, or moving"
    };
    let guess = increments.as_deref().unwrap_or(guess);
    let names = step.map(|_| "name increments dv_x_m_s … dv_z_m_s, dtheta_x_rad … dtheta_z_rad");
    let message = format!("static |f| is {norm:.4} m/s², not 9.81 m/s²: {guess}");
    Err(Failure::contents(path, Place::Within, message)
        .or_hint_if(names.map(str::to_owned))
        .or_hint("name the unit in the columns: accel_x_m_s2, accel_x_g or accel_x_mg"))
}

/// Replicates of one sensor have one rate (0.5 % allows for clocks).
fn same_rate(files: &[FileReport]) -> Result<(), Failure> {
    let Some(first) = files.first() else {
        return Ok(());
    };
    match files
        .iter()
        .find(|f| (f.rate_hz / first.rate_hz - 1.0).abs() > 0.005)
    {
        None => Ok(()),
        Some(other) => {
            let message = format!(
                "has {} Hz, but {} has {} Hz",
                six_digits(other.rate_hz),
                first.file,
                six_digits(first.rate_hz)
            );
            Err(Failure::contents(&other.file, Place::Itself, message)
                .or_hint("use recordings of one rate, or resample them"))
        }
    }
}

// Writing recordings.

/// Signals of the same length (m/s² or rad/s), sampled at `rate_hz` from time 0 on, with ten significant digits.
pub(crate) fn csv(rate_hz: f64, signals: &[(Channel, Vec<f64>)]) -> String {
    let name = |(c, _): &(Channel, _)| SIX.split(' ').nth(c.index());
    let names: Vec<&str> = signals.iter().filter_map(name).collect();
    let mut text = format!("t_s,{}\n", names.join(","));
    for k in 0..signals.first().map_or(0, |(_, x)| x.len()) {
        let _ = write!(text, "{}", k as f64 / rate_hz);
        for (_, x) in signals {
            let _ = write!(text, ",{:.9e}", x[k]);
        }
        text.push('\n');
    }
    text
}
