//! From the rows of a table to a trajectory.

use super::columns::{Columns, Quantity};
use super::table::Table;
use super::{Options, TrajectoryFileError as Error, Warning};
use crate::earth::{e_to_n, ecef_to_geodetic, geodetic_to_ecef};
use crate::frames::{RollPitchYaw, q_e_n, wrap_angle};
use crate::trajectory::plausibility::VelocityMisfit;
use crate::trajectory::{Trajectory, TrajectorySample};
use crate::units::DEG;
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

use Quantity::{D, E, H, Lat, Lon, N, Pitch, Roll, Time, Vd, Ve, Vn, Yaw};

/// Positions faster than this from one row to the next are no motion (m/s).
const MAX_SPEED: f64 = 8000.0;
/// Heights that are not doubted (m).
const PLAUSIBLE_HEIGHT: std::ops::RangeInclusive<f64> = -500.0..=100_000.0;
/// Heights at which the gravity model means something (m).
pub(super) const HEIGHT: std::ops::RangeInclusive<f64> = -12_000.0..=1_000_000.0;
/// Below this speed a path has no direction (m/s).
const MOVING: f64 = 0.5;
/// Longest step between rows that is not doubted (s).
const LONG_STEP_S: f64 = 1.0 + 1e-6;

/// The trajectory of a table, and what is doubtful about it.
pub(super) fn trajectory(table: &Table, options: &Options) -> Result<(Trajectory, Vec<Warning>), Error> {
    let columns = Columns::of(table)?;
    check_ranges(table, &columns)?;
    let mut doubts = Doubts { path: &table.path, found: Vec::new() };
    doubts.ignored(&columns.ignored);
    let mut samples = samples(table, &columns, options)?;
    check_heights(table, &columns, &samples)?;
    check_steps(table, &columns, &samples)?;
    doubts.steps(&samples, table);
    doubts.heights(&samples, table);
    check_jumps(table, &samples)?;
    if columns.has(Yaw) {
        let trajectory = build(table, &samples)?;
        doubts.radians(&trajectory, table, &columns);
    } else {
        follow_path(table, &mut samples)?;
        doubts.add(None, "no attitude columns: heading and pitch follow the path, roll is 0".into());
    }
    let trajectory = build(table, &samples)?;
    doubts.velocities(&trajectory, table, &columns);
    Ok((trajectory, doubts.found))
}

fn samples(table: &Table, columns: &Columns, options: &Options) -> Result<Vec<TrajectorySample>, Error> {
    let origin = if columns.has(Lat) { None } else { Some(origin(table, options)?) };
    let at = |(_, row): &(u64, Vec<f64>)| {
        let value = |q| columns.value(q, row);
        let attitude = RollPitchYaw { roll: value(Roll), pitch: value(Pitch), yaw: value(Yaw) }.to_quat();
        match origin {
            None => TrajectorySample {
                t_s: value(Time),
                lat: value(Lat),
                lon: value(Lon),
                h: value(H),
                q_b_n: attitude,
            },
            Some(origin) => local(value(Time), origin, DVec3::new(value(N), value(E), value(D)), attitude),
        }
    };
    Ok(table.rows.iter().map(at).collect())
}

/// A sample given in the axes north, east, down of the origin.
pub(super) fn local(t_s: f64, [lat0, lon0, h0]: [f64; 3], r_n0: DVec3, q_b_n0: DQuat) -> TrajectorySample {
    let q_n0_e = q_e_n(lat0, lon0).inverse();
    let (lat, lon, h) = ecef_to_geodetic(geodetic_to_ecef(lat0, lon0, h0) + q_n0_e * r_n0);
    TrajectorySample { t_s, lat, lon, h, q_b_n: q_e_n(lat, lon) * q_n0_e * q_b_n0 }
}

/// The origin of local coordinates: the option, or the file's `# origin: lat, lon, h` line.
pub(super) fn origin(table: &Table, options: &Options) -> Result<[f64; 3], Error> {
    if let Some(origin) = options.origin {
        return Ok(origin);
    }
    let line = table.comments.iter().find_map(|c| c.strip_prefix("origin"));
    let numbers: Option<Vec<f64>> = line.and_then(|l| {
        l.trim_start_matches([':', '=', ' ']).split(',').map(|x| x.trim().parse().ok()).collect()
    });
    match numbers.as_deref() {
        Some(&[lat, lon, h]) if lat.abs() <= 89.9 && lon.abs() <= 360.0 && h.is_finite() => {
            Ok([lat * DEG, lon * DEG, h])
        }
        _ => Err(Error::NoOrigin { path: table.path.clone(), what: "a trajectory in local coordinates" }),
    }
}

/// The trajectory through samples that are rows of a table.
pub(super) fn build(table: &Table, samples: &[TrajectorySample]) -> Result<Trajectory, Error> {
    Trajectory::from_samples(samples).map_err(|source| {
        let index = source.index().unwrap_or(table.rows.len() - 1);
        Error::Samples { path: table.path.clone(), line: table.rows[index].0, source }
    })
}

fn check_ranges(table: &Table, columns: &Columns) -> Result<(), Error> {
    let ranges = [
        (Lat, -90.0, 90.0, "is not a latitude"),
        (Lon, -180.0, 360.0, "is not a longitude"),
        (Roll, -180.0, 180.0, "is not a roll angle"),
        (Pitch, -90.0, 90.0, "is not a pitch angle"),
        (Yaw, -180.0, 360.0, "is not a heading"),
    ];
    for (line, row) in &table.rows {
        for (quantity, low, high, reason) in ranges {
            let angle = columns.value(quantity, row) / DEG;
            if !(low - 1e-9..=high + 1e-9).contains(&angle) {
                let index = columns.index(quantity);
                return Err(table.cell(*line, index, &row[index].to_string(), reason));
            }
        }
    }
    Ok(())
}

/// Heights below the deepest trench and beyond a low orbit are no heights in metres.
fn check_heights(table: &Table, columns: &Columns, samples: &[TrajectorySample]) -> Result<(), Error> {
    let Some(i) = samples.iter().position(|s| !HEIGHT.contains(&s.h)) else { return Ok(()) };
    let column = columns.index(if columns.has(Lat) { H } else { D });
    let (line, row) = &table.rows[i];
    Err(table.cell(*line, column, &row[column].to_string(), "is no height within −12 to 1000 km"))
}

/// Rows a minute apart are no trajectory of a vehicle: their time is in milliseconds.
fn check_steps(table: &Table, columns: &Columns, samples: &[TrajectorySample]) -> Result<(), Error> {
    let mut steps: Vec<f64> = samples.windows(2).map(|w| w[1].t_s - w[0].t_s).collect();
    steps.sort_by(f64::total_cmp);
    let Some(&median) = steps.get(steps.len() / 2) else { return Ok(()) };
    if median < 50.0 {
        return Ok(());
    }
    let (index, (line, row)) = (columns.index(Time), &table.rows[1]);
    let reason = "is in seconds, and rows are a minute or more apart: is it in milliseconds (t_ms)?";
    Err(table.cell(*line, index, &row[index].to_string(), reason))
}

fn check_jumps(table: &Table, samples: &[TrajectorySample]) -> Result<(), Error> {
    let place = |s: &TrajectorySample| geodetic_to_ecef(s.lat, s.lon, s.h);
    for (pair, (line, _)) in samples.windows(2).zip(&table.rows[1..]) {
        let (metres, seconds) = (place(&pair[1]).distance(place(&pair[0])), pair[1].t_s - pair[0].t_s);
        if seconds > 0.0 && metres > MAX_SPEED * seconds {
            return Err(Error::Jump { path: table.path.clone(), line: *line, metres, seconds });
        }
    }
    Ok(())
}

/// Heading and pitch along the path; at rest between those before and after.
pub(super) fn follow_path(table: &Table, samples: &mut [TrajectorySample]) -> Result<(), Error> {
    build(table, samples)?; // times increase, positions are on the Earth
    let directions: Vec<Option<(f64, f64)>> = (0..samples.len()).map(|i| direction(samples, i)).collect();
    let moving: Vec<usize> = (0..samples.len()).filter(|&i| directions[i].is_some()).collect();
    for i in 0..samples.len() {
        let next = moving.partition_point(|&k| k < i);
        let after = moving.get(next).copied();
        let before = if after == Some(i) { after } else { next.checked_sub(1).map(|k| moving[k]) };
        let share = match (before, after) {
            (Some(a), Some(b)) if b > a => {
                (samples[i].t_s - samples[a].t_s) / (samples[b].t_s - samples[a].t_s)
            }
            _ => 0.0,
        };
        let at = |k: Option<usize>| k.and_then(|k| directions[k]);
        let from = at(before).or(at(after)).unwrap_or_default();
        let to = at(after).unwrap_or(from);
        let yaw = from.0 + share * wrap_angle(to.0 - from.0);
        let pitch = from.1 + share * (to.1 - from.1);
        samples[i].q_b_n = RollPitchYaw { roll: 0.0, pitch, yaw }.to_quat();
    }
    Ok(())
}

/// Heading and pitch of the chord from the sample before to the one after, if that is a motion.
fn direction(samples: &[TrajectorySample], i: usize) -> Option<(f64, f64)> {
    let (a, b) = (&samples[i.saturating_sub(1)], &samples[(i + 1).min(samples.len() - 1)]);
    let chord = geodetic_to_ecef(b.lat, b.lon, b.h) - geodetic_to_ecef(a.lat, a.lon, a.h);
    let v = e_to_n(samples[i].lat, samples[i].lon, chord) / (b.t_s - a.t_s);
    (v.length() > MOVING).then(|| (v.y.atan2(v.x), (-v.z).atan2(v.x.hypot(v.y))))
}

/// What is doubtful about a file.
pub(super) struct Doubts<'a> {
    pub(super) path: &'a str,
    pub(super) found: Vec<Warning>,
}

impl Doubts<'_> {
    pub(super) fn add(&mut self, line: Option<u64>, message: String) {
        self.found.push(Warning { path: self.path.to_owned(), line, message });
    }

    fn ignored(&mut self, columns: &[String]) {
        if !columns.is_empty() {
            self.add(None, format!("columns not used: {}", columns.join(", ")));
        }
    }

    /// Long steps, where the curve between rows is a guess, and gaps.
    pub(super) fn steps(&mut self, samples: &[TrajectorySample], table: &Table) {
        let time = |i: usize| samples[i].t_s;
        let mut steps: Vec<(f64, usize)> = (1..samples.len()).map(|i| (time(i) - time(i - 1), i)).collect();
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(&(median, _)) = steps.get(steps.len() / 2) else { return };
        let gaps = steps.iter().filter(|(s, _)| *s > LONG_STEP_S.max(1.5 * median)).count();
        if median > LONG_STEP_S {
            self.add(
                None,
                format!("rows are {median} s apart: less than one a second, the path between is a guess"),
            );
        }
        if let Some(&(step, i)) = steps.last().filter(|_| gaps > 0) {
            let more = if gaps > 1 { format!(" ({gaps} such gaps)") } else { String::new() };
            let line = Some(table.rows[i].0);
            self.add(
                line,
                format!("gap of {step:.3} s before {} s{more}: the path in it is a guess", time(i)),
            );
        }
    }

    /// Heights where no vehicle of these goes: a wrong unit, a wrong sign, a depth.
    fn heights(&mut self, samples: &[TrajectorySample], table: &Table) {
        if let Some(i) = samples.iter().position(|s| !PLAUSIBLE_HEIGHT.contains(&s.h)) {
            let (line, h) = (Some(table.rows[i].0), samples[i].h);
            self.add(line, format!("height {h} m: in metres above the ellipsoid, up?"));
        }
    }

    /// Degrees that look like radians: all within ±π, and the path says so where there is one.
    fn radians(&mut self, trajectory: &Trajectory, table: &Table, columns: &Columns) {
        let small = |q: Quantity, limit: f64| {
            let mut values = table.rows.iter().map(|(_, row)| columns.value(q, row).abs() / DEG);
            values.all(|v| v <= limit + 1e-6)
        };
        let zero = [Roll, Pitch, Yaw].into_iter().all(|q| small(q, 0.0));
        if !zero && small(Roll, PI) && small(Pitch, 0.5 * PI) && small(Yaw, 2.0 * PI) {
            let (mut as_degrees, mut as_radians, mut moving) = (0.0, 0.0, 0);
            for (_, row) in &table.rows {
                let v = trajectory.state(columns.value(Time, row)).v_n;
                if v.x.hypot(v.y) > MOVING {
                    let (track, yaw) = (v.y.atan2(v.x), columns.value(Yaw, row));
                    as_degrees += wrap_angle(track - yaw).abs();
                    as_radians += wrap_angle(track - yaw / DEG).abs();
                    moving += 1;
                }
            }
            if moving == 0 || 2.0 * as_radians < as_degrees {
                let says = if moving == 0 { "" } else { ", and the path agrees with radians" };
                let list = "roll_deg, pitch_deg and yaw_deg never exceed π";
                self.add(
                    None,
                    format!("{list}{says}: radians? Then name the columns roll_rad, pitch_rad, yaw_rad"),
                );
            }
        }
        if columns.has(Lat) && small(Lat, 0.5 * PI) && small(Lon, 2.0 * PI) {
            let list = "lat_deg and lon_deg never exceed π";
            self.add(None, format!("{list}: radians? Then name the columns lat_rad, lon_rad"));
        }
    }

    fn velocities(&mut self, trajectory: &Trajectory, table: &Table, columns: &Columns) {
        if !columns.has(Vn) {
            return;
        }
        let given = |(_, row): &(u64, Vec<f64>)| {
            let value = |q| columns.value(q, row);
            (value(Time), DVec3::new(value(Vn), value(Ve), value(Vd)))
        };
        let given: Vec<_> = table.rows.iter().map(given).collect();
        if let Some(misfit) = VelocityMisfit::new(trajectory, &given).filter(VelocityMisfit::contradicts) {
            let line = given.iter().position(|(t, _)| *t == misfit.worst_s).map(|i| table.rows[i].0);
            self.add(line, format!("{misfit}; the positions are used"));
        }
    }
}
