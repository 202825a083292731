//! Units and plausibility of the signals.

use super::FileReport;
use super::error::{no_unit, storage};
use super::header::{Role, Unit};
use super::table::{Column, Raw};
use super::values::Values;
use crate::formats::{FileError, Place, Setting};
use crate::report::six_digits;
use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::units::STANDARD_GRAVITY;
use std::io;
use std::ops::Range;

/// From so many samples of one value on, and such a share of the record, a signal stands still.
const LONG_STANDING: usize = 100;
const LONG_SHARE: f64 = 0.1;
/// Below this (m/s²) the mean was removed before: nothing to be learnt from it.
const NO_GRAVITY: f64 = 0.3;

/// What brings each column to SI units; refuses dead axes, tells those that stand still for long.
pub(super) fn factors(raw: &Raw, rate_hz: f64, report: &mut FileReport) -> Result<Vec<f64>, FileError> {
    let from_gravity = gravity_factor(raw)?;
    let factor = |column: &Column| {
        let Role::Signal { channel, unit } = column.role else { return Ok(1.0) };
        let Standing { first, count, value } = standing(&column.values).map_err(storage(&raw.path))?;
        let all = column.values.len();
        if count == all && all > 1 {
            let message = format!("{channel} (column \"{}\") is dead: every sample is {value}", column.name);
            return Err(FileError::contents(raw.path.as_str(), Place::Within, message)
                .setting(Setting::Channels)
                .advice("record again"));
        }
        if count >= LONG_STANDING && count as f64 > LONG_SHARE * all as f64 {
            let (percent, line) = (100.0 * count as f64 / all as f64, raw.lines.of(first));
            report.warn(format!(
                "{channel} (column \"{}\") stands at {value} for {percent:.0} % of the record, from line {line} on",
                column.name
            ));
        }
        Ok(match unit {
            Unit::Si(factor) => factor,
            Unit::Increment(factor) => factor * rate_hz,
            Unit::FromGravity => from_gravity,
        })
    };
    raw.columns.iter().map(factor).collect()
}

/// The unit of accelerometer columns that do not say it, from the length of their mean.
pub(in crate::formats) fn gravity_factor(raw: &Raw) -> Result<f64, FileError> {
    let unnamed: Vec<&Column> = raw
        .columns
        .iter()
        .filter(|c| matches!(c.role, Role::Signal { unit: Unit::FromGravity, .. }))
        .collect();
    let Some(first) = unnamed.first() else { return Ok(1.0) };
    let means =
        unnamed.iter().map(|c| mean(&c.values, 0..c.values.len(), 1.0)).collect::<Result<Vec<_>, _>>();
    let means = means.map_err(storage(&raw.path))?;
    let norm = norm(&means);
    let near = |target: f64| (norm / target - 1.0).abs() < 0.1;
    if unnamed.len() == 3 {
        for factor in [1.0, STANDARD_GRAVITY, 1e-3 * STANDARD_GRAVITY] {
            if near(STANDARD_GRAVITY / factor) {
                return Ok(factor);
            }
        }
    }
    Err(no_unit(&raw.path, raw.lines.of(0).saturating_sub(1).max(1), &first.name))
}

/// The longest stretch of one value.
#[derive(Debug, Clone, Copy, Default)]
struct Standing {
    first: usize,
    count: usize,
    value: f64,
}

fn standing(values: &Values) -> io::Result<Standing> {
    let (mut longest, mut last, mut sample) = (Standing::default(), Standing::default(), 0);
    values.each_block(0..values.len(), |block| {
        for &value in block {
            if last.count == 0 || value.to_bits() != last.value.to_bits() {
                last = Standing { first: sample, count: 0, value };
            }
            last.count += 1;
            sample += 1;
            if last.count > longest.count {
                longest = last;
            }
        }
    })?;
    Ok(longest)
}

/// The mean of a stretch times a factor, summed about the first of them so that a large offset costs no digits.
pub(super) fn mean(values: &Values, range: Range<usize>, factor: f64) -> io::Result<f64> {
    let (mut first, mut sum, count) = (None, 0.0, range.len() as f64);
    values.each_block(range, |block| {
        let first = *first.get_or_insert(block[0] * factor);
        sum += block.iter().map(|v| v * factor - first).sum::<f64>();
    })?;
    Ok(first.map_or(0.0, |first| first + sum / count))
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Static specific force is gravity, or nothing where the mean was removed before; rates are small.
pub(super) fn plausible(
    means: &[(Channel, f64)],
    rate_hz: f64,
    report: &mut FileReport,
) -> Result<(), FileError> {
    /// Room for local gravity, a scale error and a bias of 30 mg.
    const NEAR: f64 = 0.03;
    let means_of_sensor = |sensor| -> Vec<f64> {
        means.iter().filter(|(channel, _)| channel.sensor == sensor).map(|(_, mean)| *mean).collect()
    };
    let (accel, gyro) = (means_of_sensor(Sensor::Accel), means_of_sensor(Sensor::Gyro));
    let is_gravity = |mean: &[f64]| (norm(mean) / STANDARD_GRAVITY - 1.0).abs() < 0.1;
    if accel.len() == 3 && gyro.len() == 3 && norm(&accel) < NO_GRAVITY && is_gravity(&gyro) {
        let message = format!(
            "static |f| is {:.4} m/s² and the mean angular rate {:.4} rad/s: accelerometers and gyroscopes are exchanged",
            norm(&accel),
            norm(&gyro)
        );
        return Err(FileError::contents(report.file.as_str(), Place::Within, message)
            .advice("without names the first three columns are the accelerometers")
            .setting(Setting::ColumnNames));
    }
    if accel.len() == 3 {
        check_gravity(&report.file, norm(&accel))?;
        let in_an_interval = STANDARD_GRAVITY / rate_hz;
        if (norm(&accel) / in_an_interval - 1.0).abs() < NEAR && (rate_hz - 1.0).abs() > NEAR {
            report.warn(format!(
                "static |f| is {:.4} m/s², which is what gravity adds in one sample interval: increments named as \
                 rates? Name the columns dv_x_m_s, … and dtheta_x_rad, …",
                norm(&accel)
            ));
        }
    }
    if norm(&gyro) > 0.1 {
        let degrees = norm(&gyro).to_degrees();
        report.warn(format!("mean angular rate {degrees:.1} deg/s: not static, or deg/s named rad/s?"));
    }
    Ok(())
}

pub(in crate::formats) fn check_gravity(path: &str, norm: f64) -> Result<(), FileError> {
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
    Err(FileError::contents(path, Place::Within, message)
        .advice("name the unit in the columns: accel_x_m_s2, accel_x_g or accel_x_mg"))
}

/// Replicates of one sensor have one rate (0.5 % allows for clocks).
pub(super) fn same_rate(files: &[FileReport]) -> Result<(), FileError> {
    let Some(first) = files.first() else { return Ok(()) };
    match files.iter().find(|f| (f.rate_hz / first.rate_hz - 1.0).abs() > 0.005) {
        None => Ok(()),
        Some(other) => {
            let message = format!(
                "has {} Hz, but {} has {} Hz",
                six_digits(other.rate_hz),
                first.file,
                six_digits(first.rate_hz)
            );
            Err(FileError::contents(other.file.as_str(), Place::Itself, message)
                .advice("calibrate recordings of one rate at a time, or resample them"))
        }
    }
}
