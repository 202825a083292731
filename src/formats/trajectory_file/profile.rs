//! Motion profiles in TOML.

mod description;

use super::samples::HEIGHT;
use crate::formats::FileError;
use crate::formats::toml_described::{Document, Finite};
use crate::formats::toml_file::{Section, Source};
use description::{Accelerate, Climb, Description, Of, Point, Roll, Stop, Straight, Turn, Waypoints};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::profile::{
    self, Acceleration, Bank, Kind, Length, Place, Profile, Segment, Start, Turning, Waypoint,
};
use nav_sim_signal::units::DEG;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Ramps of accelerations and rates unless said otherwise (s).
const RAMP_S: f64 = 2.0;
/// Braking of a stop unless said otherwise (m/s²).
const DECEL: f64 = 1.5;

/// The JSON schema of such a file.
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(Description).to_value()
}

pub(super) fn load(path: &Path) -> Result<Trajectory, FileError> {
    build(&Source::read(path)?)
}

pub(super) fn build(source: &Source) -> Result<Trajectory, FileError> {
    let document = Document::parse(source)?;
    let Description { start, vehicle, .. } = document.read()?;
    let root = document.root();
    let segments = root.sections("segment")?;
    let origin = root.section("start")?.unwrap_or_else(|| root.clone());
    let ramp_s = vehicle.ramp_s.map_or(RAMP_S, |ramp| ramp.0);
    if ramp_s <= 0.0 {
        let section = root.section("vehicle")?.unwrap_or_else(|| root.clone());
        return Err(section.refuse("ramp_s", "is not a number > 0", None));
    }
    let profile = Profile {
        start: Start {
            t_s: start.t_s.0,
            lat: start.lat_deg.0 * DEG,
            lon: start.lon_deg.0 * DEG,
            h: height(&origin, start.h_m)?,
            heading: start.heading_deg.0 * DEG,
            speed: start.speed_m_s.0,
        },
        bank: match vehicle.bank {
            Roll::None => Bank::None,
            Roll::Coordinated => Bank::Coordinated,
        },
        ramp_s,
        segments: segments.iter().map(read_segment).collect::<Result<_, _>>()?,
    };
    profile.build().map_err(|e| blame(&root, &origin, &segments, &e))
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

/// A height at which the gravity model means something.
fn height(section: &Section<'_>, h_m: Finite) -> Result<f64, FileError> {
    if HEIGHT.contains(&h_m.0) {
        return Ok(h_m.0);
    }
    Err(section.refuse("h_m", "is no height within −12 to 1000 km", None))
}

const KINDS: &str = "straight, accelerate, turn, climb, stop, waypoints";

fn read_segment(segment: &Section<'_>) -> Result<Segment, FileError> {
    fn keys_of<T: DeserializeOwned + JsonSchema>(segment: &Section<'_>) -> Result<T, FileError> {
        segment.read_own(&["kind", "ramp_s"])
    }
    let (kind, climb) = match segment.require_str("kind")? {
        "straight" => keys_of(segment).and_then(|keys| straight(segment, &keys))?,
        "accelerate" => keys_of(segment).and_then(|keys| accelerate(segment, &keys))?,
        "turn" => keys_of(segment).and_then(|keys| turn(segment, &keys))?,
        "climb" => keys_of(segment).and_then(|keys| climb(segment, &keys))?,
        "stop" => keys_of(segment).map(|keys| stop(&keys))?,
        "waypoints" => keys_of(segment).and_then(|keys| waypoints(segment, &keys))?,
        _ => return Err(segment.refuse("kind", "is no kind of segment", Some(format!("kinds are {KINDS}")))),
    };
    let Of { ramp_s } = segment.read()?;
    Ok(Segment { kind, climb_m: climb.0, ramp_s: ramp_s.map(|ramp| ramp.0) })
}

fn length(
    segment: &Section<'_>,
    duration: Option<Finite>,
    distance: Option<Finite>,
) -> Result<Kind, FileError> {
    Ok(Kind::Straight(match one_of(segment, [("duration_s", duration), ("distance_m", distance)])? {
        ("duration_s", s) => Length::Duration(s),
        (_, m) => Length::Distance(m),
    }))
}

fn straight(segment: &Section<'_>, description: &Straight) -> Result<(Kind, Finite), FileError> {
    Ok((length(segment, description.duration_s, description.distance_m)?, description.climb_m))
}

fn climb(segment: &Section<'_>, description: &Climb) -> Result<(Kind, Finite), FileError> {
    Ok((length(segment, description.duration_s, description.distance_m)?, description.height_m))
}

fn accelerate(segment: &Section<'_>, description: &Accelerate) -> Result<(Kind, Finite), FileError> {
    let by = match one_of(
        segment,
        [("duration_s", description.duration_s), ("accel_m_s2", description.accel_m_s2)],
    )? {
        ("duration_s", s) => Acceleration::Duration(s),
        (_, a) => Acceleration::Peak(a),
    };
    Ok((Kind::Accelerate { to_speed: description.to_speed_m_s.0, by }, description.climb_m))
}

fn turn(segment: &Section<'_>, description: &Turn) -> Result<(Kind, Finite), FileError> {
    let given = [
        ("duration_s", description.duration_s),
        ("rate_deg_s", description.rate_deg_s),
        ("radius_m", description.radius_m),
        ("lateral_accel_m_s2", description.lateral_accel_m_s2),
    ];
    Ok((
        Kind::Turn { angle: description.angle_deg.0 * DEG, by: turning(segment, given)? },
        description.climb_m,
    ))
}

fn stop(description: &Stop) -> (Kind, Finite) {
    let decel = description.decel_m_s2.map_or(DECEL, |decel| decel.0);
    (Kind::Stop { duration: description.duration_s.0, decel }, description.climb_m)
}

fn waypoints(segment: &Section<'_>, description: &Waypoints) -> Result<(Kind, Finite), FileError> {
    let given = [
        ("rate_deg_s", description.rate_deg_s),
        ("radius_m", description.radius_m),
        ("lateral_accel_m_s2", description.lateral_accel_m_s2),
    ];
    let by = turning(segment, given)?;
    let points = segment.sections("points")?.iter().map(waypoint).collect::<Result<_, _>>()?;
    Ok((Kind::Waypoints { points, by }, description.climb_m))
}

fn waypoint(section: &Section<'_>) -> Result<Waypoint, FileError> {
    let point: Point = section.read()?;
    let pair = |keys: [&str; 2], values: [Option<Finite>; 2]| match values {
        [Some(first), Some(second)] => Ok((first.0, second.0)),
        [None, _] => Err(section.missing(keys[0])),
        [_, None] => Err(section.missing(keys[1])),
    };
    let is_local = point.n_m.or(point.e_m).is_some();
    let place = if is_local {
        if let Some(extra) = ["lat_deg", "lon_deg"].into_iter().find(|k| section.has(k)) {
            return Err(section.refuse(
                extra,
                "stands beside n_m, e_m",
                Some("give one pair of them".into()),
            ));
        }
        let (north, east) = pair(["n_m", "e_m"], [point.n_m, point.e_m])?;
        Place::Local { north, east }
    } else {
        let (lat, lon) = pair(["lat_deg", "lon_deg"], [point.lat_deg, point.lon_deg])?;
        Place::Geodetic { lat: lat * DEG, lon: lon * DEG }
    };
    Ok(Waypoint { place, h: point.h_m.map(|h| height(section, h)).transpose()? })
}

fn turning<const N: usize>(
    segment: &Section<'_>,
    given: [(&'static str, Option<Finite>); N],
) -> Result<Turning, FileError> {
    Ok(match one_of(segment, given)? {
        ("duration_s", s) => Turning::Duration(s),
        ("rate_deg_s", rate) => Turning::Rate(rate * DEG),
        ("radius_m", m) => Turning::Radius(m),
        (_, a) => Turning::LateralAccel(a),
    })
}

/// The one key of several that is given, and its value.
fn one_of<const N: usize>(
    segment: &Section<'_>,
    keys: [(&'static str, Option<Finite>); N],
) -> Result<(&'static str, f64), FileError> {
    let mut given = keys.iter().filter_map(|(key, value)| value.map(|value| (*key, value.0)));
    match (given.next(), given.next()) {
        (None, _) => Err(segment.missing_one_of(&keys.map(|(key, _)| key))),
        (Some(only), None) => Ok(only),
        (Some((first, _)), Some((second, _))) => {
            Err(segment.refuse(second, format!("stands beside {first}"), Some("give one of them".into())))
        }
    }
}
