//! Units and plausibility of the signals.

use super::header::{Role, Unit};
use super::{Column, FileReport, Raw, RecordingError};
use crate::imu::{Recording, Sensor};
use crate::units::STANDARD_GRAVITY;

/// Brings every signal to SI units; refuses dead axes.
pub(super) fn resolve_units(raw: &mut Raw, rate_hz: f64) -> Result<(), RecordingError> {
    let from_gravity = gravity_factor(raw)?;
    for column in &mut raw.columns {
        let Role::Signal { channel, unit } = column.role else { continue };
        if let Some(value) = constant(&column.values) {
            let (path, column) = (raw.path.clone(), column.name.clone());
            return Err(RecordingError::Dead { path, channel, column, value });
        }
        let factor = match unit {
            Unit::Si(factor) => factor,
            Unit::Increment(factor) => factor * rate_hz,
            Unit::FromGravity => from_gravity,
        };
        if factor.to_bits() != 1.0_f64.to_bits() {
            column.values.iter_mut().for_each(|v| *v *= factor);
        }
    }
    Ok(())
}

/// The unit of accelerometer columns that do not say it, from the length of their mean.
pub(in crate::data) fn gravity_factor(raw: &Raw) -> Result<f64, RecordingError> {
    let unnamed: Vec<&Column> = raw
        .columns
        .iter()
        .filter(|c| matches!(c.role, Role::Signal { unit: Unit::FromGravity, .. }))
        .collect();
    let Some(first) = unnamed.first() else { return Ok(1.0) };
    let norm = unnamed.iter().map(|c| mean(&c.values).powi(2)).sum::<f64>().sqrt();
    let near = |target: f64| (norm / target - 1.0).abs() < 0.1;
    if unnamed.len() == 3 {
        for factor in [1.0, STANDARD_GRAVITY, 1e-3 * STANDARD_GRAVITY] {
            if near(STANDARD_GRAVITY / factor) {
                return Ok(factor);
            }
        }
    }
    Err(RecordingError::NoUnit {
        path: raw.path.clone(),
        line: raw.lines.of(0).saturating_sub(1).max(1),
        column: first.name.clone(),
    })
}

fn constant(values: &[f64]) -> Option<f64> {
    let first = *values.first()?;
    (values.len() > 1 && values.iter().all(|v| v.to_bits() == first.to_bits())).then_some(first)
}

/// The mean, summed about the first sample so that a large offset costs no digits.
fn mean(values: &[f64]) -> f64 {
    let Some(first) = values.first() else { return 0.0 };
    let sums = values.chunks(4096).map(|c| c.iter().map(|v| v - first).sum::<f64>());
    first + sums.sum::<f64>() / values.len() as f64
}

/// Removes the mean and returns it.
pub(super) fn remove_mean(values: &mut [f64]) -> f64 {
    let mean = mean(values);
    values.iter_mut().for_each(|v| *v -= mean);
    mean
}

/// Static specific force is gravity, or nothing where the mean was removed before; rates are small.
pub(super) fn plausible(recordings: &[Recording], report: &mut FileReport) -> Result<(), RecordingError> {
    for recording in recordings {
        let means = |sensor| -> Vec<f64> {
            recording.signals.iter().filter(|s| s.channel.sensor == sensor).map(|s| s.mean).collect()
        };
        let (accel, gyro) = (means(Sensor::Accel), means(Sensor::Gyro));
        let norm = |v: &[f64]| v.iter().map(|m| m * m).sum::<f64>().sqrt();
        if accel.len() == 3 {
            check_gravity(&report.file, norm(&accel))?;
        }
        if norm(&gyro) > 0.1 {
            let degrees = norm(&gyro).to_degrees();
            report.warn(format!("mean angular rate {degrees:.1} deg/s: not static, or deg/s named rad/s?"));
        }
    }
    Ok(())
}

pub(in crate::data) fn check_gravity(path: &str, norm: f64) -> Result<(), RecordingError> {
    let near = |target: f64| (norm / target - 1.0).abs() < 0.1;
    // Below 0.3 m/s² the mean was removed before: nothing to be learnt from it.
    if near(STANDARD_GRAVITY) || norm < 0.3 {
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
    Err(RecordingError::Gravity { path: path.to_owned(), found: norm, guess })
}

/// Replicates of one sensor have one rate (0.5 % allows for clocks).
pub(super) fn same_rate(recordings: &[Recording]) -> Result<(), RecordingError> {
    let Some(first) = recordings.first() else { return Ok(()) };
    match recordings.iter().find(|r| (r.rate_hz / first.rate_hz - 1.0).abs() > 0.005) {
        None => Ok(()),
        Some(other) => Err(RecordingError::RatesDiffer {
            path: other.name.clone(),
            rate_hz: other.rate_hz,
            first: first.name.clone(),
            first_hz: first.rate_hz,
        }),
    }
}
