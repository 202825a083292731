//! From rows to a trajectory.

use super::Options;
use super::doubts;
use crate::io::fusion_files::WEEK_S;
use crate::io::table::{Column, Dictionary, Numbers, Quantity, Table, normalised};
use crate::io::{Failure as Error, Place, help};
use glam::{DQuat, DVec3};
use nav_sim_navigation::earth::{e_to_n, ecef_to_geodetic, geodetic_to_ecef};
use nav_sim_navigation::frames::{RollPitchYaw, q_e_n, wrap_angle};
use nav_sim_navigation::trajectory::{self, Trajectory, TrajectorySample};
use nav_sim_signal::units::DEG;
use std::f64::consts::TAU;

/// Longest step between rows that is not doubted (s).
const LONG_STEP_S: f64 = 1.0 + 1e-6;
/// Positions faster than this from one row to the next are no motion (m/s).
const MAX_SPEED: f64 = 8000.0;
/// Heights at which the gravity model means something (m).
const HEIGHT: std::ops::RangeInclusive<f64> = -12_000.0..=1_000_000.0;
/// Below this speed a path has no direction (m/s).
pub(super) const MOVING: f64 = 0.5;
/// A trajectory lasts a day at most (s), as motion profiles do: a wrong time stamp would ask for more memory
/// than there is.
const MAX_DURATION_S: f64 = 86_400.0;

/// Quantities of a trajectory.
static QUANTITIES: [Quantity; 16] = [
    Quantity::time(&["t", "time", "timestamp"]),
    Quantity::number("week", &["week", "gps_week"]),
    Quantity::angle("lat_deg", &["lat", "latitude"]),
    Quantity::angle("lon_deg", &["lon", "lng", "longitude"]),
    Quantity::length("h_m", &["h", "alt", "height", "altitude"]),
    N,
    E,
    D,
    D.reversed(&["u", "up"]),
    Quantity::angle("roll_deg", &["roll"]),
    Quantity::angle("pitch_deg", &["pitch"]),
    Quantity::angle("yaw_deg", &["yaw", "heading", "azimuth"]),
    Quantity::speed("v_n_m_s", &["v_n", "vn", "v_north"]).with_unit(),
    Quantity::speed("v_e_m_s", &["v_e", "ve", "v_east"]).with_unit(),
    V_D,
    V_D.reversed(&["v_u", "v_up"]),
];
const N: Quantity = Quantity::length("n_m", &["n", "north"]).with_unit();
const E: Quantity = Quantity::length("e_m", &["e", "east"]).with_unit();
const D: Quantity = Quantity::length("d_m", &["d", "down"]).with_unit();
const V_D: Quantity = Quantity::speed("v_d_m_s", &["v_d", "vd", "v_down"]).with_unit();

/// Dictionary of trajectories with such numbers.
pub(super) const fn dictionary(numbers: Numbers) -> Dictionary {
    Dictionary {
        numbers,
        ..Dictionary::new(
            &QUANTITIES,
            "a trajectory has the columns t_s, lat_deg, lon_deg, h_m (or n_m, e_m, d_m) and may have roll_deg, pitch_deg, yaw_deg",
        )
    }
}
const DEGREES: &str = "degrees: latitude within ±89.9, longitude and yaw in (−180, 180] or [0, 360), pitch within ±90";

const GEODETIC: [&str; 3] = ["lat_deg", "lon_deg", "h_m"];
const LOCAL: [&str; 3] = ["n_m", "e_m", "d_m"];
const ATTITUDE: [&str; 3] = ["roll_deg", "pitch_deg", "yaw_deg"];
const VELOCITY: [&str; 3] = ["v_n_m_s", "v_e_m_s", "v_d_m_s"];

/// Source of the attitude of rows.
#[derive(Debug, PartialEq)]
pub(super) enum Attitude {
    /// The file.
    Given,
    /// Heading and pitch follow the path.
    OfPath,
}

/// Samples of a file of any format, and the line that each comes from.
#[derive(Debug)]
pub(super) struct Rows {
    pub(super) path: String,
    /// One for each sample.
    pub(super) lines: Vec<u64>,
    pub(super) samples: Vec<TrajectorySample>,
    pub(super) attitude: Attitude,
    /// Velocities in n that the positions are compared with (m/s), one for each sample or none at all.
    pub(super) velocities: Vec<DVec3>,
    /// Whether positions are latitude and longitude, which may have been given in the wrong unit.
    pub(super) geodetic: bool,
    pub(super) doubts: Vec<String>,
}

impl Rows {
    /// Samples without velocities.
    pub(super) fn new(
        path: &str,
        lines: Vec<u64>,
        samples: Vec<TrajectorySample>,
        attitude: Attitude,
    ) -> Self {
        let (velocities, doubts) = (Vec::new(), Vec::new());
        Self {
            path: path.to_owned(),
            lines,
            samples,
            attitude,
            velocities,
            geodetic: false,
            doubts,
        }
    }

    pub(super) fn doubt(&mut self, line: Option<u64>, message: impl Into<String>) {
        let line = line.map_or(String::new(), |line| format!(", line {line}"));
        let text = format!("{}{line}: {}", self.path, message.into());
        self.doubts.push(text);
    }

    /// The trajectory through all rows, and what is doubtful about it. Every format comes through here, so that
    /// what is refused in one is refused in all.
    pub(super) fn trajectory(mut self) -> Result<(Trajectory, Vec<String>), Error> {
        self.check_heights()?;
        self.check_steps()?;
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
        let Some(bad) = self.samples.iter().position(|s| !HEIGHT.contains(&s.h)) else {
            return Ok(());
        };
        let message = format!(
            "height {:?} m is not within −12 to 1000 km",
            self.samples[bad].h
        );
        Err(self.refuse(
            bad,
            message,
            "is a value in the wrong column, or the row damaged?",
        ))
    }

    /// Rows a minute apart are no trajectory of a vehicle, their time is in milliseconds; and one time stamp
    /// that is far off makes no trajectory of years. In long steps the curve between rows is a guess.
    fn check_steps(&mut self) -> Result<(), Error> {
        let time = |i: usize| self.samples[i].t_s;
        let step = |i: &usize| time(*i) - time(*i - 1);
        let mut order: Vec<usize> = (1..self.samples.len()).collect();
        order.sort_by(|a, b| step(a).total_cmp(&step(b)));
        let (Some(middle), Some(&longest)) = (order.get(order.len() / 2), order.last()) else {
            return Ok(());
        };
        let (median_s, longest_s) = (step(middle), step(&longest));
        let (previous_s, t_s) = (time(longest - 1), time(longest));
        if median_s >= 50.0 {
            let message = format!("the rows are {median_s} s apart");
            let advice = "one row a second at least; is the time in milliseconds (t_ms)?";
            return Err(self.refuse(1, message, advice));
        }
        if time(self.samples.len() - 1) - time(0) > MAX_DURATION_S {
            let message =
                format!("time goes from {previous_s} s to {t_s} s, and may span a day at most");
            let advice = "is that time stamp damaged, on another clock, or in another unit?";
            return Err(self.refuse(longest, message, advice));
        }
        if longest_s > LONG_STEP_S.max(1.5 * median_s) {
            let text = format!("gap of {longest_s:.3} s before {t_s} s: the path in it is a guess");
            self.doubt(Some(self.lines[longest]), text);
        }
        if median_s > LONG_STEP_S {
            let text = format!("rows are {median_s} s apart: the path between is a guess");
            self.doubt(None, text);
        }
        Ok(())
    }

    fn refuse(&self, index: usize, message: String, advice: &'static str) -> Error {
        Error::contents(&self.path, self.lines[index], message).or_hint(advice)
    }

    fn check_jumps(&self) -> Result<(), Error> {
        let place = |s: &TrajectorySample| geodetic_to_ecef(s.lat, s.lon, s.h);
        for (i, pair) in self.samples.windows(2).enumerate() {
            let (metres, seconds) = (
                place(&pair[1]).distance(place(&pair[0])),
                pair[1].t_s - pair[0].t_s,
            );
            if seconds > 0.0 && metres > MAX_SPEED * seconds {
                let message = format!(
                    "position jumps by {metres:.0} m in {} s",
                    (seconds * 1e6).round() / 1e6
                );
                let advice =
                    "is a latitude swapped with a longitude, a sign lost, or a row damaged?";
                return Err(self.refuse(i + 1, message, advice));
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
            "is an angle in the wrong column or unit? A vehicle that turns so fast needs more rows"
        }
        E::TooFew { .. } => "give at least four rows, one a second or more",
        E::Latitude { .. } => {
            "latitude and longitude cannot navigate at the poles; is a column swapped?"
        }
        E::NotFinite { .. } => return Error::contents(path, line, source.to_string()),
    };
    Error::contents(path, line, source.to_string()).or_hint(advice)
}

/// The rows of a table. Cells out of range are refused, or their rows left out where not every row is needed.
pub(super) fn rows(mut table: Table, options: &Options, numbers: Numbers) -> Result<Rows, Error> {
    let has_any = |names: [&str; 3]| names.into_iter().any(|name| table.has(name));
    let is_local = has_any(LOCAL) && !table.has("lat_deg");
    let optional = [ATTITUDE, VELOCITY]
        .into_iter()
        .filter(|names| has_any(*names));
    let position = if is_local { LOCAL } else { GEODETIC };
    let needed = ["t_s"]
        .into_iter()
        .chain(position)
        .chain(optional.flatten());
    table.require(needed, &dictionary(numbers))?;
    check_units(&table)?;
    let all = table.rows();
    match numbers {
        Numbers::Finite => check_ranges(&table)?,
        _ => table.retain(|table, row| {
            table.columns.iter().all(|c| c.values[row].is_finite())
                && out_of_range(table, row).is_none()
        }),
    }
    let (attitude, velocity) = (table.all(ATTITUDE), table.all(VELOCITY));
    let [time] = table.columns(["t_s"], &dictionary(numbers))?;
    let place = table.columns(position, &dictionary(numbers))?;
    let (week, origin) = (
        table.get("week"),
        is_local.then(|| origin(&table, options)).transpose()?,
    );
    let triad = |columns: [&Column; 3], row| columns.map(|column| column.si(row));
    let sample = |row| {
        let weeks = week.map_or(0.0, |week| week.si(row) - week.si(0));
        let t_s = time.si(row) + weeks * WEEK_S;
        let [roll, pitch, yaw] = attitude.map_or([0.0; 3], |all| triad(all, row));
        let q_b_n = RollPitchYaw { roll, pitch, yaw }.to_quat();
        let [lat, lon, h] = triad(place, row);
        match origin {
            None => TrajectorySample {
                t_s,
                lat,
                lon,
                h,
                q_b_n,
            },
            Some(origin) => local(t_s, origin, [lat, lon, h].into(), q_b_n),
        }
    };
    let samples = (0..table.rows()).map(sample).collect();
    let lines = (0..table.rows()).map(|row| table.line(row)).collect();
    let attitude = attitude.map_or(Attitude::OfPath, |_| Attitude::Given);
    let mut rows = Rows::new(&table.path, lines, samples, attitude);
    rows.geodetic = !is_local;
    let velocity = velocity.into_iter();
    rows.velocities = velocity
        .flat_map(|own| (0..table.rows()).map(move |row| triad(own, row).into()))
        .collect();
    if all > rows.lines.len() {
        let left_out = all - rows.lines.len();
        let text = format!("{left_out} rows left out: values not finite, or out of range");
        rows.doubt(None, text);
    }
    if !table.ignored.is_empty() {
        rows.doubt(
            None,
            format!("columns not used: {}", table.ignored.join(", ")),
        );
    }
    for text in &table.assumptions {
        rows.doubt(None, text);
    }
    if rows.attitude == Attitude::OfPath {
        let text = "no attitude columns: heading and pitch follow the path, roll is 0";
        rows.doubt(None, text);
    }
    Ok(rows)
}

/// Refuses angles of the attitude without a unit in their names, of which none is too large for radians.
fn check_units(table: &Table) -> Result<(), Error> {
    let is_bare = |column: &&Column| {
        let name = normalised(&column.name);
        !name.ends_with("deg") && !name.ends_with("rad")
    };
    let attitude = ATTITUDE.into_iter().filter_map(|name| table.get(name));
    let bare: Vec<&Column> = attitude.filter(is_bare).collect();
    let values = bare.iter().flat_map(|column| &column.values);
    let largest = values
        .filter(|x| x.is_finite())
        .fold(0.0, |most: f64, x| most.max(x.abs()));
    if largest == 0.0 || largest > TAU {
        return Ok(()); // alike in both units, or degrees
    }
    let names: Vec<String> = bare
        .iter()
        .map(|column| column.name.to_lowercase())
        .collect();
    let names = names.join(", ");
    let message = format!("the unit of {names} is not in the name, and no value exceeds 2π");
    Err(table
        .refused(message)
        .or_hint("end the names in _deg or _rad"))
}

/// A sample given in the axes north, east, down of the origin.
pub(super) fn local(
    t_s: f64,
    [lat0, lon0, h0]: [f64; 3],
    r_n0: DVec3,
    q_b_n0: DQuat,
) -> TrajectorySample {
    let q_n0_e = q_e_n(lat0, lon0).inverse();
    let (lat, lon, h) = ecef_to_geodetic(geodetic_to_ecef(lat0, lon0, h0) + q_n0_e * r_n0);
    TrajectorySample {
        t_s,
        lat,
        lon,
        h,
        q_b_n: q_e_n(lat, lon) * q_n0_e * q_b_n0,
    }
}

/// The origin of local coordinates: the option, or the file's `# origin: lat, lon, h` line.
pub(super) fn origin(table: &Table, options: &Options) -> Result<[f64; 3], Error> {
    if let Some(origin) = options.origin {
        return Ok(origin);
    }
    let line = table.comments.iter().find_map(|c| c.strip_prefix("origin"));
    line.and_then(|line| parse_origin(line.trim_start_matches([':', '=', ' '])))
        .ok_or_else(|| {
            let message = "a trajectory in local coordinates needs an origin on the Earth";
            Error::contents(&table.path, Place::Within, message)
                .or(help::ORIGIN)
                .or(help::ORIGIN_ELSEWHERE)
                .or_hint("a first line \"# origin: LAT_DEG, LON_DEG, H_M\"")
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
fn out_of_range(table: &Table, row: usize) -> Option<(&Column, &'static str)> {
    // a heading that was unwrapped goes on below −180 and above 180: the same angle
    let ranges = [
        ("lat_deg", 90.0, 90.0, "is not a latitude"),
        ("lon_deg", 180.0, 360.0, "is not a longitude"),
        ("roll_deg", 180.0, 180.0, "is not a roll angle"),
        ("pitch_deg", 90.0, 90.0, "is not a pitch angle"),
        ("yaw_deg", 360.0, 360.0, "is not a heading"),
    ];
    ranges.into_iter().find_map(|(name, below, above, reason)| {
        let column = table.get(name)?;
        let is_within = (-below - 1e-9..=above + 1e-9).contains(&(column.si(row) / DEG));
        (!is_within).then_some((column, reason))
    })
}

fn check_ranges(table: &Table) -> Result<(), Error> {
    let mut found = (0..table.rows()).filter_map(|row| Some((row, out_of_range(table, row)?)));
    found.next().map_or(Ok(()), |(row, (column, reason))| {
        let (line, value) = (table.line(row), column.values[row].to_string());
        Err(Error::cell(&table.path, line, &column.name, value, reason).or_hint(DEGREES))
    })
}

/// Heading and pitch along the path; at rest between those before and after.
pub(super) fn follow_path(samples: &mut [TrajectorySample]) {
    let moving = |i: usize| Some((samples[i].t_s, direction(samples, i)?));
    let moving: Vec<(f64, (f64, f64))> = (0..samples.len()).filter_map(moving).collect();
    let direction_of = |k: usize| moving.get(k.min(moving.len().saturating_sub(1)));
    for sample in samples {
        let next = moving.partition_point(|(t_s, ..)| *t_s < sample.t_s);
        let from = direction_of(next.saturating_sub(1));
        let (Some(from), Some(to)) = (from, direction_of(next)) else {
            continue;
        };
        let share = match to.0 - from.0 {
            span if span > 0.0 => ((sample.t_s - from.0) / span).clamp(0.0, 1.0),
            _ => 0.0,
        };
        let ((yaw, pitch), (to_yaw, to_pitch)) = (from.1, to.1);
        sample.q_b_n = RollPitchYaw {
            roll: 0.0,
            pitch: pitch + share * (to_pitch - pitch),
            yaw: yaw + share * wrap_angle(to_yaw - yaw),
        }
        .to_quat();
    }
}

/// Heading and pitch of the parabola through a row and its neighbours (at the ends through the nearest three), if that is a
/// motion. The chord from the row before to the one after has the direction of the path halfway between them, which is not
/// that at the row where the steps are unequal.
fn direction(samples: &[TrajectorySample], i: usize) -> Option<(f64, f64)> {
    let position = |k: usize| geodetic_to_ecef(samples[k].lat, samples[k].lon, samples[k].h);
    let slope =
        |a: usize, b: usize| (position(b) - position(a)) / (samples[b].t_s - samples[a].t_s);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::table::find;

    #[test]
    fn names_of_many_tools() {
        for (name, quantity, factor) in [
            ("t_s", "t_s", 1.0),
            ("time_s", "t_s", 1.0),
            ("timestamp_ns", "t_s", 1e-9),
            ("Latitude", "lat_deg", DEG),
            ("lon_deg", "lon_deg", DEG),
            ("lat_rad", "lat_deg", 1.0),
            ("alt_m", "h_m", 1.0),
            ("height_m", "h_m", 1.0),
            ("heading_deg", "yaw_deg", DEG),
            ("roll", "roll_deg", DEG),
            ("pitch_rad", "pitch_deg", 1.0),
            ("vn_mps", "v_n_m_s", 1.0),
            ("v_d_m_s", "v_d_m_s", 1.0),
            ("v_up_m_s", "v_d_m_s", -1.0),
            ("up_m", "d_m", -1.0),
            ("e_m", "e_m", 1.0),
        ] {
            let found = find(&QUANTITIES, name).map(|(own, factor)| (own.name, factor));
            assert_eq!(found, Some((quantity, Some(factor))), "{name}");
        }
        for name in [
            "sd_roll_deg",
            "gnss",
            "e",
            "n",
            "roll_m",
            "lat_m",
            "t_deg",
            "v_n_deg",
        ] {
            assert!(find(&QUANTITIES, name).is_none(), "{name}");
        }
        let is_own =
            |own: &Quantity| find(&QUANTITIES, own.name).is_some_and(|q| q.0.name == own.name);
        assert!(
            QUANTITIES
                .iter()
                .filter(|own| own.name != "week")
                .all(is_own)
        );
    }
}
