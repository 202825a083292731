//! A file whose time, units and stretches are decided: what is left is to take its samples.

use super::report::{FileReport, name_of};
use super::timing::{self, Timing};
use super::{ReadOptions, channel_of, no_unit, too_short};
use crate::io::table::{Column, Table};
use crate::io::{Failure, Place, help};
use crate::report::six_digits;
use nav_sim_signal::imu::{Channel, Recording, Sensor, Signal};
use nav_sim_signal::units::STANDARD_GRAVITY;
use std::ops::Range;

/// The recordings of a file, and what was found in it.
pub(super) fn recordings(
    mut raw: Table,
    options: &ReadOptions,
) -> Result<(Vec<Recording>, FileReport), Failure> {
    let mut report = FileReport::new(&raw);
    let timing = timing::timing(&mut raw, options, &mut report)?;
    raw.columns
        .sort_by_key(|c| channel_of(c).map(Channel::index));
    let factors = factors(&raw, timing.rate_hz)?;
    clipped(&raw, &mut report);
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
        plausible(&means, &mut report)?;
        let samples = recording.signals.first().map_or(0, |s| s.samples.len());
        report.samples.push(samples);
        if report.means.is_empty() {
            report.means = means;
        }
    }
    report.rate_hz = timing.rate_hz;
    Ok((recordings, report))
}

/// The samples of a stretch with NaN where some are missing.
fn with_holes(samples: &[f64], piece: &Range<usize>, holes: &[(usize, usize)]) -> Vec<f64> {
    let is_inside = |(sample, _): &&(usize, usize)| *sample > piece.start && *sample < piece.end;
    let inside = holes.iter().filter(is_inside);
    let lost: usize = inside.clone().map(|(_, lost)| lost).sum();
    let (mut whole, mut done) = (Vec::with_capacity(samples.len() + lost), 0);
    for (sample, lost) in inside {
        let next = sample - piece.start;
        whole.extend_from_slice(&samples[done..next]);
        whole.extend(std::iter::repeat_n(f64::NAN, *lost));
        done = next;
    }
    whole.extend_from_slice(&samples[done..]);
    whole
}

/// Of the stretches between gaps those shorter than the longest by more than this are left out.
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
    if longest < needed && options.skip_s > 0.0 {
        let (skip_s, seconds) = (
            options.skip_s,
            crate::report::seconds(samples as f64 / timing.rate_hz),
        );
        let message = format!(
            "leaving out the first {skip_s} s leaves {longest} samples of {seconds} s, but {needed} are needed"
        );
        return Err(Failure::contents(path, Place::Within, message)
            .or(help::SKIP)
            .or_hint("a longer recording"));
    }
    if longest < needed {
        return Err(too_short(path, longest, needed));
    }
    // A short one would cost all others their long scales.
    let needed = needed.max(longest / LONGEST_OVER_SHORTEST);
    let dropped = all().filter(|p| p.len() < needed).count();
    if dropped > 0 {
        report.warn(format!(
            "{dropped} stretches between gaps have fewer than {needed} samples: left out"
        ));
    }
    Ok(all().filter(|p| p.len() >= needed).collect())
}

/// Below this (m/s²) the mean was removed before: nothing to be learnt from it.
const NO_GRAVITY: f64 = 0.3;

/// What brings each column to SI units; refuses dead axes.
fn factors(raw: &Table, rate_hz: f64) -> Result<Vec<f64>, Failure> {
    let from_gravity = gravity_factor(raw)?;
    let factor = |column: &Column| {
        let channel = column.quantity.name;
        if let Some(value) = only_value(&column.values) {
            let message = format!(
                "{channel} (column \"{}\") is dead: every sample is {value}",
                column.name
            );
            return Err(Failure::contents(&raw.path, Place::Within, message)
                .or(help::CHANNELS)
                .or_hint("record again"));
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
pub(in crate::io) fn gravity_factor(raw: &Table) -> Result<f64, Failure> {
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
    Err(no_unit(raw, &first.name))
}

/// The value of all samples, if two or more have the same.
fn only_value(values: &[f64]) -> Option<f64> {
    let (first, rest) = values.split_first()?;
    let is_same = |value: &f64| value.to_bits() == first.to_bits();
    (!rest.is_empty() && rest.iter().all(is_same)).then_some(*first)
}

/// Warns of axes whose samples pile up at an end of their range. Noise that is quantized, however coarsely, has fewer
/// values at its ends than next to them.
fn clipped(raw: &Table, report: &mut FileReport) {
    const SHARE: f64 = 0.01;
    const FEWEST: usize = 20;
    for column in &raw.columns {
        let channel = column.quantity.name;
        let rows = column.values.len() as f64;
        let [high, low] = [1.0, -1.0].map(|side| outermost(&column.values, side));
        let has_four_values = -low[1].0 < high[1].0;
        for (side, [end, next]) in [(1.0, high), (-1.0, low)] {
            let share = end.1 as f64 / rows;
            if has_four_values && end.1 >= FEWEST && share > SHARE && end.1 > 4 * next.1 {
                let (value, percent) = (side * end.0, 100.0 * share);
                report.warn(format!(
                    "{channel} is clipped: {percent:.0} % of the rows are {value}, its extreme"
                ));
            }
        }
    }
}

/// The two outermost values on a side (times ±1), and how often each comes.
fn outermost(values: &[f64], side: f64) -> [(f64, usize); 2] {
    let mut ends = [(f64::NEG_INFINITY, 0); 2];
    for value in values.iter().map(|value| value * side) {
        match ends.iter().position(|end| end.0 == value) {
            Some(known) => ends[known].1 += 1,
            None if value > ends[0].0 => ends = [(value, 1), ends[0]],
            None if value > ends[1].0 => ends[1] = (value, 1),
            None => {}
        }
    }
    ends
}

/// Mean of values times a factor, summed about the first of them so that a large offset costs no digits.
fn mean(values: &[f64], factor: f64) -> f64 {
    /// Values whose sum is taken before it is added: rounding grows with their number.
    const BLOCK: usize = 4096;
    let Some(first) = values.first().map(|first| first * factor) else {
        return 0.0;
    };
    let sum_of = |block: &[f64]| block.iter().map(|v| v * factor - first).sum::<f64>();
    first + values.chunks(BLOCK).map(sum_of).sum::<f64>() / values.len() as f64
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Static specific force is gravity, or nothing where the mean was removed before; rates are small.
fn plausible(means: &[(Channel, f64)], report: &mut FileReport) -> Result<(), Failure> {
    let means_of_sensor = |sensor| -> Vec<f64> {
        means
            .iter()
            .filter(|(channel, _)| channel.sensor == sensor)
            .map(|(_, mean)| *mean)
            .collect()
    };
    let (accel, gyro) = (
        means_of_sensor(Sensor::Accel),
        means_of_sensor(Sensor::Gyro),
    );
    let is_gravity = |mean: &[f64]| (norm(mean) / STANDARD_GRAVITY - 1.0).abs() < 0.1;
    if accel.len() == 3 && gyro.len() == 3 && norm(&accel) < NO_GRAVITY && is_gravity(&gyro) {
        let (f, rate) = (norm(&accel), norm(&gyro));
        let message = format!(
            "accelerometers and gyroscopes are exchanged: |f| is {f:.4} m/s², the mean rate {rate:.4} rad/s"
        );
        return Err(Failure::contents(&report.file, Place::Within, message)
            .or_hint("without names the first three columns are the accelerometers")
            .or(help::COLUMN_NAMES));
    }
    if accel.len() == 3 {
        check_gravity(&report.file, norm(&accel))?;
    }
    if norm(&gyro) > 0.1 {
        let degrees = norm(&gyro).to_degrees();
        report.warn(format!(
            "mean angular rate {degrees:.1} deg/s: not static, or deg/s named rad/s?"
        ));
    }
    Ok(())
}

pub(in crate::io) fn check_gravity(path: &str, norm: f64) -> Result<(), Failure> {
    let near = |target: f64| (norm / target - 1.0).abs() < 0.1;
    if near(STANDARD_GRAVITY) || norm < NO_GRAVITY {
        return Ok(());
    }
    let guess = if near(1.0) {
        "it looks like g"
    } else if near(1000.0) {
        "it looks like mg"
    } else if near(STANDARD_GRAVITY * STANDARD_GRAVITY) {
        "it looks like m/s² named g"
    } else {
        "wrong unit, or the sensor was moving"
    };
    let message = format!("static |f| is {norm:.4} m/s², far from 9.81 m/s²: {guess}");
    Err(Failure::contents(path, Place::Within, message)
        .or_hint("name the unit in the columns: accel_x_m_s2, accel_x_g or accel_x_mg"))
}

/// Replicates of one sensor have one rate (0.5 % allows for clocks).
pub(super) fn same_rate(files: &[FileReport]) -> Result<(), Failure> {
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
                .or_hint("calibrate recordings of one rate at a time, or resample them"))
        }
    }
}
