//! Recorded IMU data.

use super::{doubt, of_file, remark, time_back};
use crate::io::logs::LogOptions;
use crate::io::recordings::timing::{median_step, unit_of_step};
use crate::io::recordings::{self, ReadOptions, check_gravity, gravity_factor};
use crate::io::table::{Column, Dictionary, Table};
use crate::io::{Failure as Error, Place};
use glam::DVec3;
use nav_sim_document::Note;
use nav_sim_navigation::fusion::{LONGEST_GAP_S, bridged};
use nav_sim_navigation::strapdown::MAX_ROTATION;
use nav_sim_signal::imu::ImuIncrement;
use nav_sim_signal::units::DEG;
use std::path::Path;

/// A step this many times the median one is a gap.
const GAP: f64 = 1.5;
/// Mean angular rate above which the unit is doubted (rad/s).
const FAST: f64 = 2.0;

/// A recording, ready to be fused.
pub(crate) struct ImuFile {
    /// Samples whose intervals follow one another.
    pub samples: Vec<ImuIncrement>,
    /// Samples a second, by the median step.
    pub rate_hz: f64,
    /// What is doubtful, and how the file was read.
    pub remarks: Vec<Note>,
}

/// Dictionary of recordings under way. Texts without a header are those of KF-GINS, with or without an odometer.
const DICTIONARY: Dictionary = Dictionary {
    bare: &[
        &[
            "t_s",
            "dtheta_x_rad",
            "dtheta_y_rad",
            "dtheta_z_rad",
            "dv_x_m_s",
            "dv_y_m_s",
            "dv_z_m_s",
        ],
        &[
            "t_s",
            "dtheta_x_rad",
            "dtheta_y_rad",
            "dtheta_z_rad",
            "dv_x_m_s",
            "dv_y_m_s",
            "dv_z_m_s",
            "odometer_m_s",
        ],
    ],
    advice: "columns: t_s, gyro_x_rad_s … accel_z_m_s2 (rates) or t_s, dtheta_x_rad … dv_z_m_s (increments); without a header, \
             as KF-GINS has it, 7 of them (t_s, dtheta_x, dtheta_y, dtheta_z in rad, dv_x, dv_y, dv_z in m/s), or 8 with an \
             odometer",
    ..recordings::DICTIONARY
};

/// Reads a recording: a table whose headers are those of static recordings (rates, or increments over the
/// interval that ends at the time given), or the text of KF-GINS: time, three angle increments (rad), three
/// velocity increments (m/s), and perhaps an odometer's speed, which is left. `names` are those of the columns of a file
/// without a header, `topic` is that of a log that has several.
///
/// # Errors
/// Whatever is wrong with it, with its line.
pub(crate) fn read_imu(
    path: &Path,
    names: Option<&[String]>,
    topic: Option<&str>,
) -> Result<ImuFile, Error> {
    let options = ReadOptions {
        columns: names.map(<[String]>::to_vec),
        log: LogOptions {
            topic: topic.map(str::to_owned),
            ..LogOptions::default()
        },
        ..ReadOptions::default()
    };
    let table = recordings::load(path, &options, &DICTIONARY)?;
    let names = [
        "t_s", "accel.x", "accel.y", "accel.z", "gyro.x", "gyro.y", "gyro.z",
    ];
    let [time, signals @ ..] = table.columns(names, &DICTIONARY)?;
    let unit_s = |values| unit_of_step(median_step(values)).0;
    let unit_s = time.factor.unwrap_or_else(|| unit_s(&time.values));
    let from_gravity = gravity_factor(&table)?;
    let mut remarks: Vec<Note> = table.assumptions.iter().map(remark).collect();
    remarks.extend(table.warnings.iter().map(doubt));
    if table.is_bare {
        let odometer = match table.ignored.is_empty() {
            true => "",
            false => "; the odometer's speed in column 8 is not used",
        };
        let text = "no header: read as KF-GINS text, angle then velocity increments";
        remarks.push(remark(format!("{text}{odometer}")));
    }
    let t_s: Vec<f64> = time.values.iter().map(|t| t * unit_s).collect();
    let sample = |k: usize, dt_s: f64| {
        let three = |own: &[&Column]| {
            let value = |axis: usize| {
                let Column { values, factor, .. } = own[axis];
                values[k] * factor.unwrap_or(from_gravity)
            };
            let seconds = if own[0].quantity.per_sample {
                1.0
            } else {
                dt_s
            };
            DVec3::from([0, 1, 2].map(value)) * seconds
        };
        ImuIncrement {
            t_s: t_s[k],
            dt_s,
            dtheta: three(&signals[3..]),
            dv: three(&signals[..3]),
        }
    };
    let samples = increments(&table, &t_s, &sample, &mut remarks)?;
    let step = median_step(&t_s);
    Ok(ImuFile {
        samples: bridged(&samples, step),
        rate_hz: 1.0 / step,
        remarks: remarks
            .into_iter()
            .map(|note| of_file(note, &table.path))
            .collect(),
    })
}

/// The k-th sample, over so many seconds.
type Sample<'a> = &'a dyn Fn(usize, f64) -> ImuIncrement;

/// The samples; those after a hole last a step like any other.
fn increments(
    table: &Table,
    t_s: &[f64],
    sample: Sample<'_>,
    remarks: &mut Vec<Note>,
) -> Result<Vec<ImuIncrement>, Error> {
    let path = &table.path;
    if t_s.len() < 3 {
        let message = format!("{} samples, but at least 3 are needed", t_s.len());
        return Err(Error::contents(path, Place::Within, message));
    }
    if let Some(k) = (1..t_s.len()).find(|k| t_s[*k] <= t_s[k - 1]) {
        return Err(time_back(path, table.line(k), t_s[k - 1], t_s[k]));
    }
    let step = median_step(t_s);
    doubt_units((path, t_s.len(), step), sample, remarks)?;
    let mut samples = Vec::with_capacity(t_s.len());
    let mut holes = Vec::new();
    for k in 0..t_s.len() {
        let since_s = if k == 0 { step } else { t_s[k] - t_s[k - 1] };
        let is_hole = since_s > GAP * step;
        let sample = sample(k, if is_hole { step } else { since_s });
        let refuse = |message: String| Error::contents(path, table.line(k), message);
        if is_hole && since_s - step > LONGEST_GAP_S + 0.5 * step {
            let message = format!(
                "no samples from {} s to {} s: {LONGEST_GAP_S} s can be bridged",
                t_s[k - 1],
                t_s[k]
            );
            return Err(
                refuse(message).or_hint("fuse the stretches before and after it one by one")
            );
        }
        let angle = sample.dtheta.length();
        if angle > MAX_ROTATION {
            let [degrees, most] = [angle, MAX_ROTATION].map(|a| a / DEG);
            let message = format!("a rotation of {degrees:.1}° in one sample, {most:.1}° at most");
            let advice =
                "is the unit right? gyro_x_deg_s is in degrees, gyro_x_rad_s in radians a second";
            return Err(refuse(message).or_hint(advice));
        }
        if is_hole {
            holes.push((k, since_s - step));
        }
        samples.push(sample);
    }
    if let Some((k, seconds)) = holes.first() {
        let (at_s, line, more) = (t_s[*k], table.line(*k), holes.len() - 1);
        remarks.push(doubt(format!(
                "samples missing: {seconds:.2} s before {at_s:.2} s (line {line}) and {more} more gaps; bridged"
            )));
    }
    Ok(samples)
}

/// Over a whole recording the specific force is gravity in the mean, and nothing turns all the time.
fn doubt_units(
    (path, count, step): (&str, usize, f64),
    sample: Sample<'_>,
    remarks: &mut Vec<Note>,
) -> Result<(), Error> {
    let mean = |of: fn(ImuIncrement) -> DVec3| {
        let lengths = (0..count).map(|k| of(sample(k, step)).length() / step);
        lengths.sum::<f64>() / count as f64
    };
    let (force, rate) = (mean(|sample| sample.dv), mean(|sample| sample.dtheta));
    if !(4.0..25.0).contains(&force) {
        check_gravity(path, force.max(0.3))?;
    }
    if rate > FAST {
        let degrees = rate / DEG;
        let text =
            format!("mean angular rate {degrees:.0} deg/s: are these degrees named radians?");
        remarks.push(doubt(text));
    }
    Ok(())
}
