//! Motion profiles in TOML.

use super::samples::HEIGHT;
use crate::formats::FileError;
use crate::formats::toml_file::{Section, Source};
use crate::trajectory::Trajectory;
use crate::trajectory::profile::{
    self, Acceleration, Bank, Kind, Length, Place, Profile, Segment, Start, Turning, Waypoint,
};
use crate::units::DEG;
use std::path::Path;

/// Ramps of accelerations and rates unless said otherwise (s).
const RAMP_S: f64 = 2.0;
/// Braking of a stop unless said otherwise (m/s²).
const DECEL: f64 = 1.5;

pub(super) fn load(path: &Path) -> Result<Trajectory, FileError> {
    build(&Source::read(path)?)
}

pub(super) fn build(source: &Source) -> Result<Trajectory, FileError> {
    let table = source.parse()?;
    let root = source.root(&table);
    root.only(&["start", "vehicle", "segment"])?;
    let start = root.section("start")?.ok_or_else(|| root.missing("start"))?;
    let segments = if root.has("segment") {
        root.sections("segment")?
    } else {
        return Err(root.missing("segment"));
    };
    let (bank, ramp_s) = match root.section("vehicle")? {
        Some(vehicle) => read_vehicle(&vehicle)?,
        None => (Bank::None, RAMP_S),
    };
    let profile = Profile {
        start: read_start(&start)?,
        bank,
        ramp_s,
        segments: segments.iter().map(read_segment).collect::<Result<_, _>>()?,
    };
    profile.build().map_err(|e| blame(&root, &start, &segments, &e))
}

/// The refusal of a profile at the line of the key at fault.
fn blame(root: &Section<'_>, start: &Section<'_>, segments: &[Section<'_>], e: &profile::Error) -> FileError {
    let (reason, hint) = (e.problem.to_string(), e.problem.hint().map(str::to_owned));
    let key = e.problem.key();
    match e.segment.map(|i| &segments[i]) {
        Some(segment) if key == "climb_m" && segment.has("height_m") => {
            segment.refuse("height_m", reason, hint)
        }
        Some(segment) => segment.refuse(key, reason, hint),
        None if key == "segment" => root.refuse(key, reason, hint),
        None => start.refuse(key, reason, hint),
    }
}

fn read_vehicle(vehicle: &Section<'_>) -> Result<(Bank, f64), FileError> {
    vehicle.only(&["bank", "ramp_s"])?;
    let bank = match vehicle.str("bank")? {
        None | Some("none") => Bank::None,
        Some("coordinated") => Bank::Coordinated,
        Some(_) => return Err(vehicle.refuse("bank", "is not \"none\" or \"coordinated\"", None)),
    };
    let ramp_s = vehicle.f64("ramp_s")?.unwrap_or(RAMP_S);
    if ramp_s <= 0.0 {
        return Err(vehicle.refuse("ramp_s", "is not a number > 0", None));
    }
    Ok((bank, ramp_s))
}

fn read_start(start: &Section<'_>) -> Result<Start, FileError> {
    start.only(&["t_s", "lat_deg", "lon_deg", "h_m", "heading_deg", "speed_m_s"])?;
    Ok(Start {
        t_s: start.f64("t_s")?.unwrap_or(0.0),
        lat: start.require_f64("lat_deg")? * DEG,
        lon: start.require_f64("lon_deg")? * DEG,
        h: height(start)?,
        heading: start.require_f64("heading_deg")? * DEG,
        speed: start.f64("speed_m_s")?.unwrap_or(0.0),
    })
}

/// A height at which the gravity model means something.
fn height(section: &Section<'_>) -> Result<f64, FileError> {
    let h = section.require_f64("h_m")?;
    if HEIGHT.contains(&h) {
        return Ok(h);
    }
    Err(section.refuse("h_m", "is no height within −12 to 1000 km", None))
}

const KINDS: &str = "straight, accelerate, turn, climb, stop, waypoints";

fn read_segment(segment: &Section<'_>) -> Result<Segment, FileError> {
    let word = segment.require_str("kind")?;
    let Some((own, read)) = reader(word) else {
        return Err(segment.refuse("kind", "is no kind of segment", Some(format!("kinds are {KINDS}"))));
    };
    let mut legal = vec!["kind", "ramp_s", if word == "climb" { "height_m" } else { "climb_m" }];
    legal.extend(own);
    segment.only(&legal)?;
    let climb_m = match word {
        "climb" => segment.require_f64("height_m")?,
        _ => segment.f64("climb_m")?.unwrap_or(0.0),
    };
    Ok(Segment { kind: read(segment)?, climb_m, ramp_s: segment.f64("ramp_s")? })
}

type Read = fn(&Section<'_>) -> Result<Kind, FileError>;

/// The keys of a kind of segment beside the common ones, and how it is read.
fn reader(kind: &str) -> Option<(&'static [&'static str], Read)> {
    Some(match kind {
        "straight" | "climb" => (&["duration_s", "distance_m"], straight),
        "accelerate" => (&["to_speed_m_s", "duration_s", "accel_m_s2"], accelerate),
        "turn" => (&["angle_deg", "duration_s", "rate_deg_s", "radius_m", "lateral_accel_m_s2"], turn),
        "stop" => (&["duration_s", "decel_m_s2"], stop),
        "waypoints" => (&["points", "rate_deg_s", "radius_m", "lateral_accel_m_s2"], waypoints),
        _ => return None,
    })
}

fn straight(segment: &Section<'_>) -> Result<Kind, FileError> {
    Ok(Kind::Straight(match one_of(segment, &["duration_s", "distance_m"])? {
        ("duration_s", s) => Length::Duration(s),
        (_, m) => Length::Distance(m),
    }))
}

fn accelerate(segment: &Section<'_>) -> Result<Kind, FileError> {
    let by = match one_of(segment, &["duration_s", "accel_m_s2"])? {
        ("duration_s", s) => Acceleration::Duration(s),
        (_, a) => Acceleration::Peak(a),
    };
    Ok(Kind::Accelerate { to_speed: segment.require_f64("to_speed_m_s")?, by })
}

fn turn(segment: &Section<'_>) -> Result<Kind, FileError> {
    let by = turning(segment, &["duration_s", "rate_deg_s", "radius_m", "lateral_accel_m_s2"])?;
    Ok(Kind::Turn { angle: segment.require_f64("angle_deg")? * DEG, by })
}

fn stop(segment: &Section<'_>) -> Result<Kind, FileError> {
    let decel = segment.f64("decel_m_s2")?.unwrap_or(DECEL);
    Ok(Kind::Stop { duration: segment.require_f64("duration_s")?, decel })
}

fn waypoints(segment: &Section<'_>) -> Result<Kind, FileError> {
    let by = turning(segment, &["rate_deg_s", "radius_m", "lateral_accel_m_s2"])?;
    let points = segment.sections("points")?.iter().map(read_point).collect::<Result<_, _>>()?;
    Ok(Kind::Waypoints { points, by })
}

fn read_point(point: &Section<'_>) -> Result<Waypoint, FileError> {
    point.only(&["lat_deg", "lon_deg", "n_m", "e_m", "h_m"])?;
    let place = if point.has("n_m") || point.has("e_m") {
        if let Some(extra) = ["lat_deg", "lon_deg"].into_iter().find(|k| point.has(k)) {
            return Err(point.refuse(extra, "stands beside n_m, e_m", Some("give one pair of them".into())));
        }
        Place::Local { north: point.require_f64("n_m")?, east: point.require_f64("e_m")? }
    } else {
        Place::Geodetic { lat: point.require_f64("lat_deg")? * DEG, lon: point.require_f64("lon_deg")? * DEG }
    };
    Ok(Waypoint { place, h: if point.has("h_m") { Some(height(point)?) } else { None } })
}

fn turning(segment: &Section<'_>, keys: &[&'static str]) -> Result<Turning, FileError> {
    Ok(match one_of(segment, keys)? {
        ("duration_s", s) => Turning::Duration(s),
        ("rate_deg_s", rate) => Turning::Rate(rate * DEG),
        ("radius_m", m) => Turning::Radius(m),
        (_, a) => Turning::LateralAccel(a),
    })
}

/// The one key of several that is given, and its value.
fn one_of(segment: &Section<'_>, keys: &[&'static str]) -> Result<(&'static str, f64), FileError> {
    let given: Vec<&'static str> = keys.iter().copied().filter(|k| segment.has(k)).collect();
    match given[..] {
        [] => Err(segment.missing_one_of(keys)),
        [key] => Ok((key, segment.require_f64(key)?)),
        [first, second, ..] => {
            Err(segment.refuse(second, format!("stands beside {first}"), Some("give one of them".into())))
        }
    }
}
