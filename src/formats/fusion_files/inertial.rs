//! Recorded IMU data.

use super::{Remark, bare_columns, table, time_back};
use crate::formats::logs::LogOptions;
use crate::formats::recordings::checks::{check_gravity, gravity_factor};
use crate::formats::recordings::header::{Role, Unit};
use crate::formats::recordings::time_unit::unit_of_step;
use crate::formats::recordings::timing::median_step;
use crate::formats::recordings::{self, Raw, ReadOptions};
use crate::formats::trajectory_file::table::text;
use crate::formats::{FileError as Error, Place, logs};
use glam::DVec3;
use nav_sim_navigation::fusion::gap::{LONGEST_S, bridged};
use nav_sim_navigation::strapdown::MAX_ROTATION;
use nav_sim_signal::imu::{Axis, Channel, ImuIncrement, Sensor};
use nav_sim_signal::units::DEG;
use std::path::Path;

/// A step this many times the median one is a gap.
const GAP: f64 = 1.5;
/// Mean angular rate above which the unit is doubted (rad/s).
const FAST: f64 = 2.0;

/// A recording, ready to be fused.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ImuFile {
    /// Samples whose intervals follow one another.
    pub samples: Vec<ImuIncrement>,
    /// Samples a second, by the median step.
    pub rate_hz: f64,
    /// What is doubtful, and how the file was read.
    pub remarks: Vec<Remark>,
}

/// Six values a sample, and the time it ends.
struct Columns {
    path: String,
    t_s: Vec<f64>,
    /// In the order of [`Channel::ALL`], SI: rates, or increments.
    values: Vec<[f64; 6]>,
    /// Which of the two each sensor gives.
    increments: [bool; 2],
    lines: Vec<u64>,
    remarks: Vec<Remark>,
}

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
    let ends_in = |ending: &str| {
        path.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(ending))
    };
    let packed =
        ends_in("npy") || ends_in("parquet") || path.is_dir() || logs::kind_of(path).is_some();
    let text = if packed || names.is_some() {
        None
    } else {
        Some(text(path)?)
    };
    let columns = match text
        .as_ref()
        .and_then(|text| Some((text, bare_columns(text)?)))
    {
        Some((text, 7..=8)) => kf_gins(path, text)?,
        Some((_, columns)) => {
            let message = format!("{columns} columns without a header");
            return Err(
                Error::contents(path.display().to_string(), Place::Within, message).advice(KF_GINS),
            );
        }
        None => headed(path, names, topic)?,
    };
    columns.increments()
}

/// A text without a header.
const KF_GINS: &str = "KF-GINS: 7 columns (t_s, dtheta_x, dtheta_y, dtheta_z in rad, dv_x, dv_y, dv_z in m/s), or 8 with an odometer";

fn kf_gins(path: &Path, text: &str) -> Result<Columns, Error> {
    const NAMES: [&str; 8] = [
        "t_s",
        "dtheta_x_rad",
        "dtheta_y_rad",
        "dtheta_z_rad",
        "dv_x_m_s",
        "dv_y_m_s",
        "dv_z_m_s",
        "odometer_m_s",
    ];
    let columns = bare_columns(text).unwrap_or(7);
    let table = table(path, text, Some(&NAMES[..columns]))?;
    let odometer = if columns > 7 {
        "; the odometer's speed in column 8 is not used"
    } else {
        ""
    };
    Ok(Columns {
        path: table.path,
        t_s: table.rows.iter().map(|(_, r)| r[0]).collect(),
        values: table
            .rows
            .iter()
            .map(|(_, r)| [r[4], r[5], r[6], r[1], r[2], r[3]])
            .collect(),
        increments: [true; 2],
        lines: table.rows.iter().map(|(line, _)| *line).collect(),
        remarks: vec![Remark::note(format!(
            "no header: read as KF-GINS text, angle then velocity increments{odometer}"
        ))],
    })
}

fn headed(path: &Path, names: Option<&[String]>, topic: Option<&str>) -> Result<Columns, Error> {
    let columns = names.map(<[String]>::to_vec);
    let log = LogOptions {
        topic: topic.map(str::to_owned),
        ..LogOptions::default()
    };
    let options = ReadOptions {
        columns,
        log,
        ..ReadOptions::default()
    };
    let mut raw = recordings::load(path, &options)?;
    let shown = raw.path.clone();
    let from_gravity = gravity_factor(&raw)?;
    let mut signals = Vec::new();
    for channel in Channel::ALL {
        let (role, values) = take(
            &mut raw,
            |role| matches!(role, Role::Signal { channel: c, .. } if *c == channel),
        )
        .ok_or_else(|| {
            lacking(
                &shown,
                &format!("channel {channel} is missing; all six are needed"),
            )
        })?;
        let (factor, increment) = match role {
            Role::Signal {
                unit: Unit::Si(factor),
                ..
            } => (factor, false),
            Role::Signal {
                unit: Unit::Increment(factor),
                ..
            } => (factor, true),
            _ => (from_gravity, false),
        };
        signals.push((values, factor, increment));
    }
    let t_s = times(&mut raw)?;
    let notes = std::mem::take(&mut raw.notes);
    let assumed = notes.assumptions.into_iter().map(Remark::note);
    let remarks = assumed
        .chain(notes.warnings.into_iter().map(Remark::doubt))
        .collect();
    let sample = |k: usize| std::array::from_fn(|i| signals[i].0[k] * signals[i].1);
    Ok(Columns {
        values: (0..t_s.len()).map(sample).collect(),
        increments: [signals[0].2, signals[3].2],
        lines: (0..t_s.len()).map(|k| raw.lines.of(k)).collect(),
        remarks,
        path: shown,
        t_s,
    })
}

/// A recording without a signal or a clock that is needed.
fn lacking(path: &str, message: &str) -> Error {
    Error::contents(path, Place::Within, message).advice(
        "columns: t_s, gyro_x_rad_s … accel_z_m_s2 (rates) or t_s, dtheta_x_rad … dv_z_m_s (increments)",
    )
}

/// The first column of such a role, with its numbers.
fn take(raw: &mut Raw, is_wanted: impl Fn(&Role) -> bool) -> Option<(Role, Vec<f64>)> {
    let index = raw.columns.iter().position(|c| is_wanted(&c.role))?;
    let column = raw.columns.swap_remove(index);
    Some((column.role, column.values))
}

fn times(raw: &mut Raw) -> Result<Vec<f64>, Error> {
    let found = take(raw, |role| matches!(role, Role::Time { .. }));
    let (role, values) = found.ok_or_else(|| lacking(&raw.path, "no time column"))?;
    let unit = match role {
        Role::Time { unit_s: Some(unit) } => unit,
        _ => unit_of_step(median_step(&values)).0,
    };
    Ok(values.iter().map(|t| t * unit).collect())
}

impl Columns {
    fn increments(mut self) -> Result<ImuFile, Error> {
        if self.t_s.len() < 3 {
            let message = format!("{} samples, but at least 3 are needed", self.t_s.len());
            return Err(Error::contents(self.path, Place::Within, message));
        }
        if let Some(k) = (1..self.t_s.len()).find(|k| self.t_s[*k] <= self.t_s[k - 1]) {
            return Err(time_back(
                &self.path,
                self.lines[k],
                self.t_s[k - 1],
                self.t_s[k],
            ));
        }
        let step = median_step(&self.t_s);
        self.doubt_units(step)?;
        let mut samples = Vec::with_capacity(self.t_s.len());
        let mut holes = Vec::new();
        for k in 0..self.t_s.len() {
            let t_s = self.t_s[k];
            let since_s = if k == 0 { step } else { t_s - self.t_s[k - 1] };
            // a sample after a hole lasts a step like any other
            let is_hole = since_s > GAP * step;
            let sample = self.sample(k, if is_hole { step } else { since_s }, t_s);
            let refuse =
                |message: String| Error::contents(self.path.as_str(), self.lines[k], message);
            if is_hole && since_s - step > LONGEST_S + 0.5 * step {
                let previous_s = self.t_s[k - 1];
                let message = format!(
                    "no samples from {previous_s} s to {t_s} s: {LONGEST_S} s can be bridged"
                );
                return Err(
                    refuse(message).advice("fuse the stretches before and after it one by one")
                );
            }
            let angle = sample.dtheta.length();
            if angle > MAX_ROTATION {
                let [degrees, most] = [angle, MAX_ROTATION].map(|a| a / DEG);
                let message =
                    format!("a rotation of {degrees:.1}° in one sample, {most:.1}° at most");
                let advice = "is the unit right? gyro_x_deg_s is in degrees, gyro_x_rad_s in radians a second";
                return Err(refuse(message).advice(advice));
            }
            if is_hole {
                holes.push((k, since_s - step));
            }
            samples.push(sample);
        }
        self.tell_of_holes(&holes);
        let remarks = self
            .remarks
            .into_iter()
            .map(|r| r.of_file(&self.path))
            .collect();
        Ok(ImuFile {
            samples: bridged(&samples, step),
            rate_hz: 1.0 / step,
            remarks,
        })
    }

    fn tell_of_holes(&mut self, holes: &[(usize, f64)]) {
        let Some((k, seconds)) = holes.first() else {
            return;
        };
        let (t_s, line, more) = (self.t_s[*k], self.lines[*k], holes.len() - 1);
        self.remarks.push(Remark::doubt(format!(
            "samples missing: {seconds:.2} s before {t_s:.2} s (line {line}) and {more} more gaps; bridged"
        )));
    }

    /// Sample k over `dt` seconds that end at `t_s`.
    fn sample(&self, k: usize, dt: f64, t_s: f64) -> ImuIncrement {
        let v = &self.values[k];
        let seconds = |sensor: Sensor| {
            if self.increments[sensor as usize] {
                1.0
            } else {
                dt
            }
        };
        let triad = |sensor: Sensor| {
            let first = Channel {
                sensor,
                axis: Axis::X,
            }
            .index();
            DVec3::new(v[first], v[first + 1], v[first + 2]) * seconds(sensor)
        };
        ImuIncrement {
            t_s,
            dt_s: dt,
            dtheta: triad(Sensor::Gyro),
            dv: triad(Sensor::Accel),
        }
    }

    /// Over a whole recording the specific force is gravity in the mean, and nothing turns all the time.
    fn doubt_units(&mut self, step: f64) -> Result<(), Error> {
        let n = self.values.len() as f64;
        let mean = |sensor: Sensor| {
            let length = |k: usize| {
                let s = self.sample(k, step, 0.0);
                (if sensor == Sensor::Accel {
                    s.dv
                } else {
                    s.dtheta
                })
                .length()
                    / step
            };
            (0..self.values.len()).map(length).sum::<f64>() / n
        };
        let (force, rate) = (mean(Sensor::Accel), mean(Sensor::Gyro));
        if !(4.0..25.0).contains(&force) {
            check_gravity(&self.path, force.max(0.3))?;
        }
        if rate > FAST {
            let degrees = rate / DEG;
            let text =
                format!("mean angular rate {degrees:.0} deg/s: are these degrees named radians?");
            self.remarks.push(Remark::doubt(text));
        }
        Ok(())
    }
}
