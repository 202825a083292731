//! Units and plausibility of the signals.

use super::error::no_unit;
use super::header::{Role, Unit};
use super::report::FileReport;
use super::table::{Column, Raw};
use crate::formats::{FileError, Place, Setting};
use crate::report::six_digits;
use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::units::STANDARD_GRAVITY;

/// Below this (m/s²) the mean was removed before: nothing to be learnt from it.
const NO_GRAVITY: f64 = 0.3;

/// What brings each column to SI units; refuses dead axes.
pub(super) fn factors(raw: &Raw, rate_hz: f64) -> Result<Vec<f64>, FileError> {
    let from_gravity = gravity_factor(raw)?;
    let factor = |column: &Column| {
        let Role::Signal { channel, unit } = column.role else {
            return Ok(1.0);
        };
        if let Some(value) = only_value(&column.values) {
            let message = format!(
                "{channel} (column \"{}\") is dead: every sample is {value}",
                column.name
            );
            return Err(
                FileError::contents(raw.path.as_str(), Place::Within, message)
                    .setting(Setting::Channels)
                    .advice("record again"),
            );
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
        .filter(|c| {
            matches!(
                c.role,
                Role::Signal {
                    unit: Unit::FromGravity,
                    ..
                }
            )
        })
        .collect();
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
    Err(no_unit(
        &raw.path,
        raw.lines.of(0).saturating_sub(1).max(1),
        &first.name,
    ))
}

/// The value of all samples, if two or more have the same.
fn only_value(values: &[f64]) -> Option<f64> {
    let (first, rest) = values.split_first()?;
    let is_same = |value: &f64| value.to_bits() == first.to_bits();
    (!rest.is_empty() && rest.iter().all(is_same)).then_some(*first)
}

/// Warns of axes whose samples pile up at an end of their range. Noise that is quantized, however coarsely, has fewer
/// values at its ends than next to them.
pub(super) fn clipped(raw: &Raw, report: &mut FileReport) {
    const SHARE: f64 = 0.01;
    const FEWEST: usize = 20;
    for column in &raw.columns {
        let Some(channel) = column.channel() else {
            continue;
        };
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
pub(super) fn mean(values: &[f64], factor: f64) -> f64 {
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
pub(super) fn plausible(
    means: &[(Channel, f64)],
    report: &mut FileReport,
) -> Result<(), FileError> {
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
        return Err(
            FileError::contents(report.file.as_str(), Place::Within, message)
                .advice("without names the first three columns are the accelerometers")
                .setting(Setting::ColumnNames),
        );
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
            Err(
                FileError::contents(other.file.as_str(), Place::Itself, message)
                    .advice("calibrate recordings of one rate at a time, or resample them"),
            )
        }
    }
}
