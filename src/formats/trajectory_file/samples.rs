//! From rows to a trajectory.

use super::columns::{Columns, Quantity};
use super::doubts;
use super::table::{Numbers, Table};
use super::velocities::Velocities;
use super::{Options, Warning};
use crate::formats::{FileError as Error, Place, Setting};
use glam::{DQuat, DVec3};
use nav_sim_navigation::earth::{e_to_n, ecef_to_geodetic, geodetic_to_ecef};
use nav_sim_navigation::frames::{RollPitchYaw, q_e_n, wrap_angle};
use nav_sim_navigation::trajectory::{self, Trajectory, TrajectorySample};
use nav_sim_signal::units::DEG;

use Quantity::{D, E, H, Lat, Lon, N, Pitch, Roll, Time, Vd, Ve, Vn, Yaw};

/// Positions faster than this from one row to the next are no motion (m/s).
const MAX_SPEED: f64 = 8000.0;
/// Heights at which the gravity model means something (m).
pub(super) const HEIGHT: std::ops::RangeInclusive<f64> = -12_000.0..=1_000_000.0;
/// Below this speed a path has no direction (m/s).
pub(super) const MOVING: f64 = 0.5;
/// A trajectory lasts a day at most (s), as motion profiles do: a wrong time stamp would ask for more memory
/// than there is.
const MAX_DURATION_S: f64 = 86_400.0;

/// Where the attitude of rows comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Attitude {
    /// The file.
    Given,
    /// Heading and pitch follow the path.
    OfPath,
}

/// What a file of any format holds: samples, and the line that each comes from.
#[derive(Debug)]
pub(super) struct Rows {
    pub(super) path: String,
    /// One for each sample.
    pub(super) lines: Vec<u64>,
    pub(super) samples: Vec<TrajectorySample>,
    pub(super) attitude: Attitude,
    /// What the positions are compared with.
    pub(super) velocities: Velocities,
    /// Whether positions are latitude and longitude, which may have been given in the wrong unit.
    pub(super) geodetic: bool,
    /// What is doubtful.
    pub(super) doubts: Vec<Warning>,
}

impl Rows {
    pub(super) fn doubt(&mut self, line: Option<u64>, message: impl Into<String>) {
        self.doubts.push(Warning { path: self.path.clone(), line, message: message.into() });
    }

    /// The trajectory through all rows, and what is doubtful about it. Every format comes through here, so that
    /// what is refused in one is refused in all.
    pub(super) fn trajectory(mut self) -> Result<(Trajectory, Vec<Warning>), Error> {
        self.check_heights()?;
        self.check_steps()?;
        doubts::steps(&mut self);
        doubts::heights(&mut self);
        self.check_jumps()?;
        if self.attitude == Attitude::OfPath {
            self.through(&self.samples)?; // times increase, positions are on the Earth
            follow_path(&mut self.samples);
        }
        let trajectory = self.through(&self.samples)?;
        doubts::of_trajectory(&mut self, &trajectory);
        Ok((trajectory, self.doubts))
    }

    fn through(&self, samples: &[TrajectorySample]) -> Result<Trajectory, Error> {
        Trajectory::from_samples(samples).map_err(|source| {
            let index = source.index().unwrap_or(self.lines.len().saturating_sub(1));
            let line = self.lines.get(index).copied().unwrap_or(1);
            no_trajectory(&self.path, line, &source)
        })
    }

    /// Heights below the deepest trench and beyond a low orbit are no heights in metres; neither is what is
    /// not finite.
    fn check_heights(&self) -> Result<(), Error> {
        let bad = self.samples.iter().zip(&self.lines).find(|(s, _)| !HEIGHT.contains(&s.h));
        let Some((sample, line)) = bad else { return Ok(()) };
        let message = format!("height {:?} m is not within −12 to 1000 km", sample.h);
        Err(Error::contents(self.path.as_str(), *line, message)
            .advice("is a value in the wrong column, or the row damaged?"))
    }

    /// Rows a minute apart are no trajectory of a vehicle, their time is in milliseconds; and one time stamp
    /// that is far off makes no trajectory of years.
    fn check_steps(&self) -> Result<(), Error> {
        let step = |i: usize| self.samples[i].t_s - self.samples[i - 1].t_s;
        let mut order: Vec<usize> = (1..self.samples.len()).collect();
        order.sort_by(|a, b| step(*a).total_cmp(&step(*b)));
        let (Some(&middle), Some(&longest)) = (order.get(order.len() / 2), order.last()) else {
            return Ok(());
        };
        if step(middle) >= 50.0 {
            let message = format!("the rows are {} s apart", step(middle));
            return Err(Error::contents(self.path.as_str(), self.lines[1], message)
                .advice("give at least one row a second; is the time in milliseconds (t_ms)?"));
        }
        let duration_s = self.samples[self.samples.len() - 1].t_s - self.samples[0].t_s;
        if duration_s <= MAX_DURATION_S {
            return Ok(());
        }
        let (previous_s, t_s) = (self.samples[longest - 1].t_s, self.samples[longest].t_s);
        let message =
            format!("time goes from {previous_s} s to {t_s} s: the rows cover {duration_s} s, a day at most");
        Err(Error::contents(self.path.as_str(), self.lines[longest], message).advice(
            "is that time stamp damaged, on another clock, or in another unit? Split what lasts longer than a day",
        ))
    }

    fn check_jumps(&self) -> Result<(), Error> {
        let place = |s: &TrajectorySample| geodetic_to_ecef(s.lat, s.lon, s.h);
        for (pair, line) in self.samples.windows(2).zip(&self.lines[1..]) {
            let (metres, seconds) = (place(&pair[1]).distance(place(&pair[0])), pair[1].t_s - pair[0].t_s);
            if seconds > 0.0 && metres > MAX_SPEED * seconds {
                let seconds = (seconds * 1e6).round() / 1e6;
                let message = format!("position jumps by {metres:.0} m in {seconds} s");
                return Err(Error::contents(self.path.as_str(), *line, message)
                    .advice("is a latitude swapped with a longitude, a sign lost, or a row damaged?"));
            }
        }
        Ok(())
    }
}

/// Rows that no trajectory goes through.
pub(super) fn no_trajectory(path: &str, line: u64, source: &trajectory::Error) -> Error {
    use trajectory::Error as E;
    let advice = match source {
        E::Time { .. } => {
            "remove repeated rows, sort by time, or split the file where the clock was set back"
        }
        E::Rotation { .. } => {
            "is an angle in the wrong column or unit? If the vehicle does turn this fast, give more rows a second"
        }
        E::TooFew { .. } => "give at least four rows, one a second or more",
        E::Latitude { .. } => "latitude and longitude cannot navigate at the poles; is a column swapped?",
        _ => return Error::contents(path, line, source.to_string()),
    };
    Error::contents(path, line, source.to_string()).advice(advice)
}

/// The rows of a table. Cells out of range are refused, or their rows left out where not every row is needed.
pub(super) fn rows(mut table: Table, options: &Options, numbers: Numbers) -> Result<Rows, Error> {
    let columns = Columns::of(&table)?;
    let all = table.rows.len();
    match numbers {
        Numbers::Finite => check_ranges(&table, &columns)?,
        Numbers::Any | Numbers::UpTo(_) => table
            .rows
            .retain(|row| row.1.iter().all(|x| x.is_finite()) && out_of_range(row, &columns).is_none()),
    }
    let mut rows = Rows {
        lines: table.rows.iter().map(|(line, _)| *line).collect(),
        samples: samples(&table, &columns, options)?,
        attitude: if columns.has(Yaw) { Attitude::Given } else { Attitude::OfPath },
        velocities: velocities(&table, &columns),
        geodetic: columns.has(Lat),
        doubts: Vec::new(),
        path: table.path,
    };
    if all > rows.lines.len() {
        rows.doubt(
            None,
            format!("{} rows left out: values not finite, or out of range", all - rows.lines.len()),
        );
    }
    if !columns.ignored.is_empty() {
        rows.doubt(None, format!("columns not used: {}", columns.ignored.join(", ")));
    }
    if rows.attitude == Attitude::OfPath {
        rows.doubt(None, "no attitude columns: heading and pitch follow the path, roll is 0");
    }
    Ok(rows)
}

fn velocities(table: &Table, columns: &Columns) -> Velocities {
    if !columns.has(Vn) {
        return Velocities::default();
    }
    let given = |(_, row): &(u64, Vec<f64>)| DVec3::from([Vn, Ve, Vd].map(|q| columns.value(q, row)));
    Velocities {
        given: table.rows.iter().map(given).collect(),
        columns: [Vn, Ve, Vd].map(|q| table.columns[columns.index(q)].clone()),
        is_up: columns.is_turned(Vd),
    }
}

fn samples(table: &Table, columns: &Columns, options: &Options) -> Result<Vec<TrajectorySample>, Error> {
    let origin = if columns.has(Lat) { None } else { Some(origin(table, options)?) };
    let sample_of_row = |(_, row): &(u64, Vec<f64>)| {
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
    Ok(table.rows.iter().map(sample_of_row).collect())
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
    line.and_then(|line| parse_origin(line.trim_start_matches([':', '=', ' ']))).ok_or_else(|| {
        let message = "a trajectory in local coordinates needs an origin on the Earth";
        Error::contents(table.path.as_str(), Place::Within, message)
            .setting(Setting::Origin)
            .advice("a first line \"# origin: LAT_DEG, LON_DEG, H_M\"")
    })
}

/// An origin as it is written, `LAT_DEG,LON_DEG,H_M`: latitude, longitude (rad), height (m).
pub(crate) fn parse_origin(text: &str) -> Option<[f64; 3]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
    match numbers?[..] {
        [lat, lon, h] if lat.abs() <= 89.9 && lon.abs() <= 360.0 && h.is_finite() => {
            Some([lat * DEG, lon * DEG, h])
        }
        _ => None,
    }
}

/// The first value of a row that is out of its range: of which column, and why.
fn out_of_range((_, row): &(u64, Vec<f64>), columns: &Columns) -> Option<(usize, &'static str)> {
    // a heading that was unwrapped goes on below −180 and above 180: the same angle
    let ranges = [
        (Lat, 90.0, 90.0, "is not a latitude"),
        (Lon, 180.0, 360.0, "is not a longitude"),
        (Roll, 180.0, 180.0, "is not a roll angle"),
        (Pitch, 90.0, 90.0, "is not a pitch angle"),
        (Yaw, 360.0, 360.0, "is not a heading"),
    ];
    let outside = |(quantity, below, above, _): &(Quantity, f64, f64, &str)| {
        !(-below - 1e-9..=above + 1e-9).contains(&(columns.value(*quantity, row) / DEG))
    };
    ranges
        .iter()
        .find(|range| outside(range))
        .map(|(quantity, .., reason)| (columns.index(*quantity), *reason))
}

fn check_ranges(table: &Table, columns: &Columns) -> Result<(), Error> {
    let found = table.rows.iter().find_map(|row| Some((row, out_of_range(row, columns)?)));
    let Some(((line, row), (index, reason))) = found else { return Ok(()) };
    Err(table.cell(*line, index, &row[index].to_string(), reason))
}

/// Heading and pitch along the path; at rest between those before and after.
pub(super) fn follow_path(samples: &mut [TrajectorySample]) {
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
        let direction_of = |k: Option<usize>| k.and_then(|k| directions[k]);
        let from = direction_of(before).or(direction_of(after)).unwrap_or_default();
        let to = direction_of(after).unwrap_or(from);
        let yaw = from.0 + share * wrap_angle(to.0 - from.0);
        let pitch = from.1 + share * (to.1 - from.1);
        samples[i].q_b_n = RollPitchYaw { roll: 0.0, pitch, yaw }.to_quat();
    }
}

/// Heading and pitch of the parabola through a row and its neighbours (at the ends through the nearest three), if that is a
/// motion. The chord from the row before to the one after has the direction of the path halfway between them, which is not
/// that at the row where the steps are unequal.
fn direction(samples: &[TrajectorySample], i: usize) -> Option<(f64, f64)> {
    let position = |k: usize| geodetic_to_ecef(samples[k].lat, samples[k].lon, samples[k].h);
    let slope = |a: usize, b: usize| (position(b) - position(a)) / (samples[b].t_s - samples[a].t_s);
    let velocity = if samples.len() < 3 {
        slope(0, samples.len() - 1)
    } else {
        // Of the parabola through three rows the slope between two is that at their middle, and linear in time.
        let middle = i.clamp(1, samples.len() - 2);
        let [before, at, after] = [middle - 1, middle, middle + 1].map(|k| samples[k].t_s);
        let (first, second) = (slope(middle - 1, middle), slope(middle, middle + 1));
        let share = (2.0 * samples[i].t_s - before - at) / (after - before);
        first.lerp(second, share)
    };
    let v = e_to_n(samples[i].lat, samples[i].lon, velocity);
    (v.length() > MOVING).then(|| (v.y.atan2(v.x), (-v.z).atan2(v.x.hypot(v.y))))
}
