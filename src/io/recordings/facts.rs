//! Rows and values of recordings that are no measurements: repaired and counted where it is certain, a warning where it is not, refused
//! where it makes a noise model worthless. The tests are those of [`nav_sim_signal::facts`].

use super::{Channel, DICTIONARY, FileReport, Gaps, ReadOptions, SIX, channel_of, timing};
use crate::io::table::{Column, InputTable, find, normalised};
use crate::io::{Failure, Place, help};
use crate::report::{readable, six_digits};
use nav_sim_calibration::percent;
use nav_sim_document::counted;
use nav_sim_signal::facts::{self, RepeatedRows, SampleFingerprint};
use nav_sim_signal::imu::{Recording, Sensor, Signal};
use nav_sim_signal::noise::{Composite, Model, Process, ProcessKind};
use nav_sim_signal::units::{DEG, STANDARD_GRAVITY};
use std::fmt::Display;
use std::ops::Range;

/// Repeated rows up to which they are missing samples, not those of another rate.
const MOST_REPEATED: f64 = 0.1;
/// Seconds in motion from which on a recording is not static.
const MOST_MOVING: f64 = 0.5;

fn axes(table: &InputTable, is: impl Fn(Channel) -> bool) -> Vec<&[f64]> {
    let own = |c: &&Column| channel_of(c).is_some_and(&is);
    table
        .columns
        .iter()
        .filter(own)
        .map(|c| &c.values[..])
        .collect()
}

/// Rows removed or to be removed from a table.
#[derive(Default)]
pub(super) struct Repair {
    /// Rows of a sample where a sensor is slower than the file, else 1.
    pub(super) rows_per_sample: f64,
    /// Stretches without a measurement, by channel; none of the channel: of all.
    missing: Vec<(Option<Channel>, Range<usize>)>,
    /// First rows after rows that were left out.
    pub(super) breaks: Vec<usize>,
    /// A warning of interpolated samples.
    interpolated: Option<String>,
    /// Stretches of one value, to be reported with their times.
    frozen: Vec<(Channel, f64, Range<usize>)>,
}

/// Leaves out rows that are copies.
pub(crate) fn drop_copies(table: &mut InputTable) -> Option<String> {
    let stamps = table.get("t_s").or_else(|| table.get("counter"))?;
    let copies = facts::copies(&stamps.values, &axes(table, |_| true));
    leave_out(table, &copies);
    let count = copies.len();
    let rows = counted(count, "row");
    (count > 0).then(|| format!("{rows} left out: copies of the row before, stamp and values"))
}

fn leave_out(table: &mut InputTable, rows: &[usize]) {
    if !rows.is_empty() {
        let mut out = rows.iter().peekable();
        let kept = (0..table.rows()).filter(|row| out.next_if_eq(&row).is_none());
        let kept: Vec<usize> = kept.collect();
        table.keep(&kept);
    }
}

/// Rows that are zero for lost samples, and a warning of them.
fn lost(table: &InputTable) -> (Vec<usize>, Option<String>) {
    let accel = axes(table, |channel| channel.sensor == Sensor::Accel);
    let rows = facts::zero_rows(&axes(table, |_| true), &accel);
    let (count, share) = (rows.len(), percent(rows.len() as f64 / table.rows() as f64));
    let text = format!(
        "{} ({share}) zero in all columns: missing samples",
        counted(count, "row")
    );
    (rows, (count > 0).then_some(text))
}

/// A warning of the zeros of a column.
fn zeros(name: impl Display, values: &[f64]) -> Option<String> {
    let share = percent(facts::zeros(values)?);
    let why = "more than its step explains: a dead band, or lost samples";
    Some(format!("{share} of {name} is exactly 0, {why}"))
}

/// A warning of a column whose range was exceeded.
fn clipped(name: impl Display, values: &[f64]) -> Option<String> {
    let (share, end) = facts::clipped(values)?;
    let share = percent(share);
    Some(format!(
        "{name} is clipped: {share} of it is {end}, its extreme; N reads low"
    ))
}

/// A warning of a column that was interpolated.
fn interpolated(name: impl Display, values: &[f64]) -> Option<String> {
    let share = percent(facts::interpolated(values)?);
    let why = "interpolated, not measured";
    Some(format!(
        "{share} of {name} lies on the line between its neighbours: {why}"
    ))
}

/// Warnings of one signal in memory, NaN where a sample is missing.
#[must_use]
pub fn doubts(name: &str, signal: &[f64]) -> Vec<String> {
    let repeats = facts::repeats(&[signal]);
    let frozen = facts::frozen(signal).into_iter().next();
    let frozen = frozen.filter(|rows| rows.len() < signal.len());
    let frozen = frozen.map(|rows| {
        let (value, from, to) = (signal[rows.start], rows.start, rows.end - 1);
        format!("{name} holds {value} from sample {from} to {to}")
    });
    let repeated = repeats.map(|repeats| repeated(name, &repeats, f64::NAN));
    let all = [
        repeated,
        frozen,
        zeros(name, signal),
        clipped(name, signal),
        interpolated(name, signal),
    ];
    all.into_iter().flatten().collect()
}

/// The signals of a table, by channel.
fn signals(table: &InputTable) -> impl Iterator<Item = (Channel, &[f64])> {
    let columns = table.columns.iter();
    columns.filter_map(|column| Some((channel_of(column)?, &column.values[..])))
}

fn repeats_of(table: &InputTable) -> Vec<(Sensor, Option<RepeatedRows>)> {
    let of = |sensor| {
        let own = axes(table, |channel| channel.sensor == sensor);
        (!own.is_empty()).then(|| (sensor, facts::repeats(&own)))
    };
    Sensor::ALL.into_iter().filter_map(of).collect()
}

/// A warning of repeated rows; `rate_hz` is that of the rows, if it is known.
fn repeated(name: impl Display, repeats: &RepeatedRows, rate_hz: f64) -> String {
    let share = percent(repeats.share);
    let repeated = format!("{name}: {share} of its rows repeat the row before");
    match &repeats.held {
        Some((rows, _)) if rate_hz.is_finite() => {
            let [native, written] = [rate_hz / rows, rate_hz].map(readable);
            format!("{repeated}: a sensor of {native} Hz written at {written} Hz")
        }
        _ => repeated,
    }
}

/// Repairs a table of a static recording before its time is examined.
///
/// # Errors
/// When the rows make a noise model worthless.
pub(super) fn repair(
    table: &mut InputTable,
    options: &ReadOptions,
    report: &mut FileReport,
) -> Result<Repair, Failure> {
    let mut repair = Repair {
        rows_per_sample: 1.0,
        ..Repair::default()
    };
    report.warnings.extend(drop_copies(table));
    report.warnings.extend(copied(table));
    let (zero, text) = lost(table);
    let is_lossy = text.is_some();
    if let (Gaps::Refuse, Some(text)) = (options.gaps, &text) {
        return Err(missing(table, zero[0], text));
    }
    report.warnings.extend(text);
    repair
        .missing
        .extend(zero.iter().map(|row| (None, *row..row + 1)));
    repair.apply(table, options.gaps);
    repair.resample_held_rows(table, options, report)?;
    for (channel, values) in signals(table) {
        for rows in facts::frozen(values) {
            repair.missing.push((Some(channel), rows.clone()));
            repair.frozen.push((channel, values[rows.start], rows));
        }
    }
    if let (Gaps::Refuse, Some((channel, value, rows))) = (options.gaps, repair.frozen.first()) {
        let count = rows.len();
        let text = format!("{channel} holds one value, {value}, for {count} rows: missing samples");
        return Err(missing(table, rows.start, &text));
    }
    repair.interpolated =
        signals(table).find_map(|(channel, values)| interpolated(channel, values));
    let zeros = signals(table).filter_map(|(channel, values)| zeros(channel, values));
    report.warnings.extend(zeros.filter(|_| !is_lossy));
    repair.apply(table, options.gaps);
    let clipped = signals(table).filter_map(|(channel, values)| clipped(channel, values));
    report.warnings.extend(clipped);
    Ok(repair)
}

fn missing(table: &InputTable, row: usize, text: &str) -> Failure {
    Failure::contents(&table.path, table.line(row), text)
        .or_option(help::GAPS)
        .or_hint_without(help::GAPS_ELSEWHERE)
}

impl Repair {
    /// Removes missing samples: NaN with `Gaps::Keep`, else the whole row.
    fn apply(&mut self, table: &mut InputTable, gaps: Gaps) {
        let missing = std::mem::take(&mut self.missing);
        if gaps != Gaps::Keep {
            let mut rows: Vec<usize> = missing.into_iter().flat_map(|(_, rows)| rows).collect();
            rows.sort_unstable();
            rows.dedup();
            let stands_at = |row: usize| row - rows.partition_point(|left_out| *left_out < row);
            self.breaks
                .iter_mut()
                .for_each(|row| *row = stands_at(*row));
            self.breaks.extend(rows.iter().map(|row| stands_at(*row)));
            return leave_out(table, &rows);
        }
        for (channel, rows) in missing {
            for column in &mut table.columns {
                let own = channel_of(column);
                if own.is_some() && (channel.is_none() || own == channel) {
                    column.values[rows.clone()].fill(f64::NAN);
                }
            }
        }
    }

    /// Keeps one row per sample if the sensors are slower than the file. Isolated repeated rows become missing
    /// samples.
    fn resample_held_rows(
        &mut self,
        table: &mut InputTable,
        options: &ReadOptions,
        report: &mut FileReport,
    ) -> Result<(), Failure> {
        let (Some(rate_hz), found) = (rate_of_rows(table, options), repeats_of(table)) else {
            return Ok(());
        };
        let mut held: Vec<&(f64, Vec<usize>)> = Vec::new();
        for (sensor, repeats) in &found {
            let Some(repeats) = repeats else { continue };
            let text = repeated(*sensor, repeats, rate_hz);
            if let Some(own) = &repeats.held {
                held.push(own);
                report.warn(format!("{text}, taken at its own rate"));
                continue;
            }
            if repeats.share > MOST_REPEATED {
                return Err(Failure::contents(&table.path, Place::Within, text)
                    .or_hint("write each sample once, at its own stamp")
                    .or_option(help::CHANNELS));
            }
            if let (Gaps::Refuse, Some(row)) = (options.gaps, repeats.rows.first()) {
                return Err(missing(table, *row, &text));
            }
            let what = match repeats.rows.is_empty() {
                true => "",
                false => ", taken as missing samples",
            };
            report.warn(format!("{text}{what}"));
            for channel in Channel::ALL.into_iter().filter(|c| c.sensor == *sensor) {
                let rows = repeats
                    .rows
                    .iter()
                    .map(|row| (Some(channel), *row..row + 1));
                self.missing.extend(rows);
            }
        }
        let Some((rows_per_sample, firsts)) = held.first() else {
            return Ok(());
        };
        let is_same =
            |(other, _): &&(f64, Vec<usize>)| (other / rows_per_sample - 1.0).abs() < 0.01;
        if held.len() < found.len() || !held.iter().all(is_same) {
            let first = found.iter().find_map(|(s, r)| Some((*s, r.as_ref()?)));
            let text = first.map_or_else(String::new, |(s, r)| repeated(s, r, rate_hz));
            return Err(Failure::contents(&table.path, Place::Within, text)
                .or_option((
                    "axes",
                    "take one sensor at a time, each at its rate: --axes accel, then --axes gyro",
                ))
                .or_hint_without((
                    "axes",
                    "wv and calibrate take one sensor at a time: --axes accel, then --axes gyro",
                )));
        }
        table.keep(firsts);
        let kept_before = |row: usize| firsts.partition_point(|first| *first < row);
        self.breaks
            .iter_mut()
            .for_each(|row| *row = kept_before(*row));
        self.rows_per_sample = *rows_per_sample;
        for clock in ["t_s", "counter"] {
            let clock = table.columns.iter_mut().find(|c| c.quantity.name == clock);
            clock
                .into_iter()
                .for_each(|c| even_out(&mut c.values, *rows_per_sample));
        }
        Ok(())
    }
}

/// Rate of the rows (Hz), by their stamps or as it is given.
fn rate_of_rows(table: &InputTable, options: &ReadOptions) -> Option<f64> {
    let Some(time) = table.get("t_s") else {
        return options
            .rate_hz
            .or(table.rate_hz.map(|(rate_hz, _)| rate_hz));
    };
    let step = timing::median_step(&time.values);
    let unit_s = time.factor.unwrap_or_else(|| timing::unit_of_step(step).0);
    Some(1.0 / (step * unit_s)).filter(|rate_hz| rate_hz.is_finite())
}

/// Stamps of samples that were taken evenly, and written with the next row; gaps stay.
fn even_out(stamps: &mut [f64], rows_per_sample: f64) {
    let longest = (1.5 + 1.0 / rows_per_sample) * timing::median_step(stamps);
    let mut from = 0;
    for k in 1..=stamps.len() {
        if k == stamps.len() || stamps[k] - stamps[k - 1] > longest {
            let (first, last, steps) = (stamps[from], stamps[k - 1], k - 1 - from);
            for (i, stamp) in stamps[from..k].iter_mut().enumerate() {
                *stamp = first + (last - first) * i as f64 / steps.max(1) as f64;
            }
            from = k;
        }
    }
}

impl Repair {
    /// Refuses interpolated samples.
    ///
    /// # Errors
    /// Where there are some.
    pub(super) fn refuse_interpolated(self, path: &str) -> Result<(), Failure> {
        let refused = |text: String| {
            Failure::contents(path, Place::Within, text)
                .or_hint("write the samples at the sensor's own rate and stamps")
                .or_option(help::CHANNELS)
        };
        self.interpolated.map_or(Ok(()), |text| Err(refused(text)))
    }

    /// Warns of stretches of one value, now that the rate is known.
    pub(super) fn warn_of_frozen(&self, rate_hz: f64, report: &mut FileReport) {
        for channel in Channel::ALL {
            let own = self.frozen.iter().filter(|(c, ..)| *c == channel);
            let own: Vec<_> = own.map(|(_, value, rows)| (*value, rows.clone())).collect();
            let text = holds(channel, &own, rate_hz);
            report
                .warnings
                .extend(text.map(|text| format!("{text}: left out as missing")));
        }
    }
}

/// Warnings of a static recording in SI units.
///
/// # Errors
/// When it moves in most of its seconds.
pub(super) fn examine(recording: &Recording, report: &mut FileReport) -> Result<(), Failure> {
    let (moving, seconds) = facts::moving(recording);
    let share = moving as f64 / seconds.max(1) as f64;
    if share > MOST_MOVING {
        let text = format!("moves in {} of its seconds: not static", percent(share));
        return Err(Failure::contents(&report.file, Place::Itself, text)
            .or_hint("record at rest; nav-sim fuse reads drives and flights"));
    }
    if moving > 0 {
        report.warn(format!(
            "moves in {moving} of {seconds} seconds, or was knocked"
        ));
    }
    report.warnings.extend(drift(recording));
    report.warnings.extend(shared_noise(recording));
    let noise = |signal: &Signal| facts::white_noise(&signal.samples, recording.rate_hz);
    let signals = recording.signals.iter();
    let found = signals.filter_map(|signal| Some((signal.channel, noise(signal)?)));
    let found: Vec<(Channel, f64)> = found.collect();
    report.warnings.extend(exchanged(&found));
    for (channel, n) in found {
        let noisiest = range(channel.sensor)[1];
        let is_loud = n > NOISIER * noisiest;
        let [shown, noisiest] = [n, noisiest].map(|n| in_hours(channel.sensor, n));
        let loud = format!(
            "{channel}: N {shown}, above three times the noisiest units' {noisiest}: wrong unit, or vibration?"
        );
        report.warnings.extend(is_loud.then_some(loud));
        report.warnings.extend(quiet(channel, n));
    }
    Ok(())
}

/// A warning of the axis that drifts most against its walk.
fn drift(recording: &Recording) -> Option<String> {
    let found = recording.signals.iter().filter_map(|signal| {
        let per_s = facts::drift(&signal.samples)? * recording.rate_hz;
        Some((signal.channel, per_s))
    });
    let found: Vec<(Channel, f64)> = found.collect();
    let (channel, per_s) = *found.first()?;
    let slope = match channel.sensor {
        Sensor::Accel => format!("{} m/s² an hour", readable(3600.0 * per_s)),
        Sensor::Gyro => format!("{} deg/h an hour", readable(3600.0 * 3600.0 * per_s / DEG)),
    };
    let more = and_more(found.len() - 1, ["axis", "axes"]);
    Some(format!(
        "{channel} drifts by {slope}{more}, more than a random walk: add DR, or keep the temperature"
    ))
}

/// A warning of the noise that axes share, of the pair with the most.
fn shared_noise(recording: &Recording) -> Option<String> {
    let axes: Vec<&[f64]> = recording.signals.iter().map(|s| &s.samples[..]).collect();
    let found = facts::shared_noise(&axes);
    let most = found
        .iter()
        .max_by(|a, b| a.correlation.abs().total_cmp(&b.correlation.abs()))?;
    let [a, b] = most.axes.map(|k| recording.signals[k].channel);
    let [from, to] = most.averages.map(|n| readable(n / recording.rate_hz));
    let correlation = most.correlation;
    let more = and_more(found.len() - 1, ["pair", "pairs"]);
    Some(format!(
        "{a} and {b}{more} share noise (correlation {correlation:.2}, averages of {from} to {to} s): intervals assume independent axes and are too narrow"
    ))
}

fn and_more(count: usize, [one, many]: [&str; 2]) -> String {
    match count {
        0 => String::new(),
        1 => format!(" (and 1 more {one})"),
        n => format!(" (and {n} more {many})"),
    }
}

/// White noise of units (units·√s): from navigation grade, 0.001 deg/√h of ring lasers and 0.001 m/s/√h of quartz
/// accelerometers, to the noisiest of the catalogue, ADIS16405 (2 deg/√h) and MPU-6050 (400 µg/√Hz).
const fn range(sensor: Sensor) -> [f64; 2] {
    match sensor {
        Sensor::Accel => [0.001 / 60.0, 400e-6 * STANDARD_GRAVITY],
        Sensor::Gyro => [0.001 * DEG / 60.0, 2.0 * DEG / 60.0],
    }
}

/// Noise over that of the noisiest unit from which on it is none of a unit.
const NOISIER: f64 = 3.0;

/// White noise as data sheets have it.
fn in_hours(sensor: Sensor, n: f64) -> String {
    match sensor {
        Sensor::Accel => format!("{} m/s/√h", readable(60.0 * n)),
        Sensor::Gyro => format!("{} deg/√h", readable(60.0 * n / DEG)),
    }
}

/// A warning of the white noise (units·√s) of a channel that is below that of any unit.
fn quiet(channel: Channel, n: f64) -> Option<String> {
    let [quietest, _] = range(channel.sensor);
    let is_quiet = n < 0.1 * quietest;
    let [n, quietest] = [n, quietest].map(|n| in_hours(channel.sensor, n));
    is_quiet.then(|| format!("{channel}: N {n}, below a tenth of the quietest units' {quietest}: wrong unit, or increments named rates?"))
}

/// A warning of white noises (units·√s) of which none of an accelerometer is above one of a gyroscope: in SI units they are 3.4
/// (MTi-300) to 143 times (DMU41) as large in the catalogue, and more in units with optical gyroscopes.
fn exchanged(found: &[(Channel, f64)]) -> Option<String> {
    let of = |sensor| {
        let own = found
            .iter()
            .filter(move |(c, n)| c.sensor == sensor && *n > 0.0);
        own.map(|(_, n)| *n)
    };
    let (accel, gyro) = (
        of(Sensor::Accel).reduce(f64::max)?,
        of(Sensor::Gyro).reduce(f64::min)?,
    );
    let [of_accel, of_gyro] =
        [(Sensor::Accel, accel), (Sensor::Gyro, gyro)].map(|(s, n)| in_hours(s, n));
    (accel < gyro).then(|| {
        format!("accel N {of_accel}, gyro N {of_gyro}: sensors exchanged, or deg/s named rad/s?")
    })
}

/// Sensors of a model whose noise is none of a unit: white noise over three times that of the noisiest or under a third of the
/// quietest's over 1 s, a random walk that rules from a third of a second on.
pub(crate) fn out_of_range(model: &Model) -> Vec<String> {
    let deviation = |noise: &Composite, t_s: f64| {
        let samples = (t_s * model.rate_hz).round().max(1.0);
        noise.allan_variance(samples as u32).sqrt()
    };
    let noises = || {
        Channel::ALL
            .into_iter()
            .map(|c| (c, &model.axes[c.index()]))
    };
    let found: Vec<(Channel, f64)> = noises()
        .map(|(c, noise)| (c, deviation(noise, 1.0)))
        .collect();
    let of = |sensor: Sensor| {
        let own = || {
            noises()
                .filter(move |(c, _)| c.sensor == sensor)
                .map(|(_, noise)| noise)
        };
        let [low, high] = range(sensor);
        let is_out = |n: &f64| *n > 0.0 && !(low / 3.0..=NOISIER * high).contains(n);
        if let Some(n) = own().map(|noise| deviation(noise, 1.0)).find(is_out) {
            let [n, low, high] = [n, low, high].map(|n| in_hours(sensor, n));
            let why = "wrong unit, or a standard deviation for a variance?";
            return Some(format!(
                "{sensor} N {n} over 1 s, units have {low} to {high}: {why}"
            ));
        }
        let walks = |noise: &Composite| {
            let is_walk = |process: &Process| process.kind() == ProcessKind::RandomWalk;
            let (walk, rest) = noise
                .processes
                .iter()
                .cloned()
                .partition::<Vec<_>, _>(is_walk);
            let [walk, rest] = [walk, rest].map(|own| deviation(&Composite::new(own), 0.3));
            rest > 0.0 && walk > rest
        };
        let text = "random walk exceeds the other noise from 0.3 s on: gamma2 is the variance of an increment";
        own().any(walks).then(|| format!("{sensor} {text}"))
    };
    let each = Sensor::ALL.into_iter().filter_map(of);
    exchanged(&found).into_iter().chain(each).collect()
}

/// A column of one value, in words.
pub(super) fn dead(column: &Column) -> Option<String> {
    let [value, others @ ..] = &column.values[..] else {
        return None;
    };
    let is_same = |other: &f64| other.to_bits() == value.to_bits();
    let (name, channel) = (&column.name, column.quantity.name);
    (!others.is_empty() && others.iter().all(is_same))
        .then(|| format!("{channel} (column \"{name}\") is dead: every sample is {value}"))
}

/// A warning of an axis that is another one once more.
fn copied(table: &InputTable) -> Option<String> {
    let all: Vec<(Channel, &[f64])> = signals(table).collect();
    let axes: Vec<&[f64]> = all.iter().map(|(_, values)| *values).collect();
    let (first, later) = facts::copied(&axes)?;
    let [first, later] = [first, later].map(|k| all[k].0);
    Some(format!(
        "{later} repeats {first}: one axis was written twice"
    ))
}

/// Leaves copies and lost samples out of a recording under way; warnings of it.
pub(crate) fn repair_drive(table: &mut InputTable) -> Vec<String> {
    let mut warnings: Vec<String> = drop_copies(table).into_iter().collect();
    let (zero, text) = lost(table);
    leave_out(table, &zero);
    let is_lossy = text.is_some();
    warnings.extend(text);
    let rate_hz = rate_of_rows(table, &ReadOptions::default()).unwrap_or(f64::NAN);
    for (sensor, repeats) in repeats_of(table) {
        warnings.extend(repeats.map(|repeats| repeated(sensor, &repeats, rate_hz)));
    }
    warnings.extend(signals(table).find_map(|(channel, values)| interpolated(channel, values)));
    warnings.extend(copied(table));
    for column in &table.columns {
        let (Some(channel), values) = (channel_of(column), &column.values) else {
            continue;
        };
        let frozen: Vec<_> = facts::frozen(values);
        let frozen = frozen.into_iter().map(|rows| (values[rows.start], rows));
        let factor = column.factor.filter(|_| !column.quantity.per_sample);
        let noise = || Some(factor? * facts::white_noise(values, rate_hz)?);
        let all = [
            dead(column),
            holds(channel, &frozen.collect::<Vec<_>>(), rate_hz),
            zeros(channel, values).filter(|_| !is_lossy),
            clipped(channel, values),
            noise().and_then(|n| quiet(channel, n)),
        ];
        warnings.extend(all.into_iter().flatten());
    }
    warnings
}

/// Stretches in which a channel holds a value, in words.
fn holds(channel: Channel, stretches: &[(f64, Range<usize>)], rate_hz: f64) -> Option<String> {
    let (value, rows) = stretches.first()?;
    let [from, to] = [rows.start, rows.end].map(|row| six_digits(row as f64 / rate_hz));
    let more = match stretches.len() - 1 {
        0 => String::new(),
        n => format!(", and {n} more such stretches"),
    };
    Some(format!(
        "{channel} holds {value} from {from} s to {to} s{more}"
    ))
}

/// Marks of the samples of each sensor.
pub(super) fn marks(table: &InputTable) -> Vec<SampleFingerprint> {
    let of = |sensor| facts::marks(&axes(table, |channel| channel.sensor == sensor));
    Sensor::ALL.map(of).into()
}

/// Refuses recordings that share samples, and warns of channels that some of them lack.
///
/// # Errors
/// When two recordings share samples.
pub(super) fn compare(files: &[FileReport]) -> Result<Vec<String>, Failure> {
    for (i, later) in files.iter().enumerate() {
        for first in &files[..i] {
            let pairs = later.marks.iter().zip(&first.marks);
            let shared = pairs.filter_map(|(a, b)| a.shared_with(b));
            if let Some(share) = shared.reduce(f64::max) {
                let name = &first.file;
                let message = match share > 0.99 && later.samples == first.samples {
                    true => format!("is a copy of {name}"),
                    false => format!("shares {} of its samples with {name}", percent(share)),
                };
                return Err(Failure::contents(&later.file, Place::Itself, message)
                    .or_hint("leave one out, or cut the common part from one"));
            }
        }
    }
    let has = |file: &FileReport, channel| file.means.iter().any(|(c, _)| *c == channel);
    let lacks = Channel::ALL.into_iter().filter_map(|channel| {
        let with = files.iter().find(|file| has(file, channel))?;
        // Phones write a file for each sensor: these lack nothing.
        let is_like = |file: &&FileReport| with.means.iter().any(|(own, _)| has(file, *own));
        let without = files
            .iter()
            .filter(is_like)
            .find(|file| !has(file, channel))?;
        let (with, without) = (&with.file, &without.file);
        Some(format!("{channel} is in {with}, but not in {without}"))
    });
    Ok(lacks.collect())
}

/// Columns that nearly have the name of a channel that is missing.
pub(crate) fn misspelt(table: &InputTable, is_wanted: impl Fn(Channel) -> bool) -> Vec<String> {
    let has = |channel| table.columns.iter().any(|c| channel_of(c) == Some(channel));
    let missing = Channel::ALL
        .into_iter()
        .filter(|c| is_wanted(*c) && !has(*c));
    let names: Vec<String> = missing
        .flat_map(|channel| names_of(table, channel))
        .collect();
    let meant = |ignored: &String| {
        let plain = normalised(ignored);
        let near = names
            .iter()
            .map(|name| (strsim::osa_distance(&normalised(name), &plain), name));
        let (edits, name) = near.min_by_key(|(edits, _)| *edits)?;
        (1..=2)
            .contains(&edits)
            .then(|| format!("column \"{ignored}\" is not used: did you mean \"{name}\"?"))
    };
    table.ignored.iter().filter_map(meant).collect()
}

/// Names that a column of a channel may have beside the others of a table: theirs with its axis, and our own.
fn names_of(table: &InputTable, channel: Channel) -> Vec<String> {
    let is_name = |name: &String| {
        find(DICTIONARY.quantities, name).is_some_and(|(q, _)| q.name == channel.to_string())
    };
    let own = SIX.split(' ').nth(channel.index()).map(str::to_owned);
    let beside = table
        .columns
        .iter()
        .filter_map(|c| Some((c.name.to_lowercase(), channel_of(c)?)));
    let swapped = beside.flat_map(|(name, other)| {
        let places = name.match_indices(other.axis.name()).map(|(at, _)| at);
        places
            .map(|at| format!("{}{}{}", &name[..at], channel.axis.name(), &name[at + 1..]))
            .collect::<Vec<_>>()
    });
    own.into_iter().chain(swapped.filter(is_name)).collect()
}
