//! Motion profiles in TOML.

use super::samples::HEIGHT;
use crate::earth::MAX_LATITUDE_DEG;
use crate::formats::FileError;
use crate::formats::toml_described::{Document, Finite};
use crate::formats::toml_file::{Section, Source};
use crate::trajectory::Trajectory;
use crate::trajectory::profile::{
    self, Acceleration, Bank, Kind, Length, Place, Profile, Segment, Start, Turning, Waypoint,
};
use crate::units::{DEG, NonNegative, Positive};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use std::path::Path;

/// Ramps of accelerations and rates unless said otherwise (s).
const RAMP_S: f64 = 2.0;
/// Braking of a stop unless said otherwise (m/s²).
const DECEL: f64 = 1.5;

/// A drive by what the vehicle does: the trajectory of nav-sim run
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Motion profile")]
struct Description {
    start: Origin,
    #[serde(default)]
    vehicle: Vehicle,
    /// What the vehicle does, in order
    #[schemars(with = "Vec<SegmentDescription>", length(min = 1))]
    #[serde(rename = "segment")]
    _segment: IgnoredAny,
}

/// Where and how it starts
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Origin {
    /// Time (s; default: 0)
    #[serde(default)]
    t_s: Finite,
    /// Geodetic latitude (degrees)
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    lat_deg: Finite,
    /// Longitude (degrees)
    lon_deg: Finite,
    /// Height above the ellipsoid (m)
    #[schemars(range(min = *HEIGHT.start(), max = *HEIGHT.end()))]
    h_m: Finite,
    /// Heading from north (degrees)
    heading_deg: Finite,
    /// Speed (m/s; default: 0)
    #[serde(default)]
    #[schemars(with = "NonNegative")]
    speed_m_s: Finite,
}

/// How the vehicle moves
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Vehicle {
    /// Roll in turns: level as a land vehicle (default), or as an aircraft
    #[serde(default)]
    bank: Roll,
    /// Time over which accelerations and rates build up and fade (s; default: 2)
    #[schemars(with = "Option<Positive>")]
    ramp_s: Option<Finite>,
}

#[derive(Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Roll {
    #[default]
    None,
    Coordinated,
}

/// One segment
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[expect(dead_code, reason = "what describes files, for editors")]
struct SegmentDescription {
    #[schemars(flatten)]
    of: Of,
    #[schemars(flatten)]
    kind: Described,
}

/// What every segment may have.
#[derive(Deserialize, JsonSchema)]
struct Of {
    /// Overrides that of the vehicle (s)
    #[schemars(with = "Option<Positive>")]
    ramp_s: Option<Finite>,
}

/// The kinds of segment, each with its keys.
#[derive(JsonSchema)]
#[schemars(tag = "kind", rename_all = "lowercase")]
#[expect(dead_code, reason = "what describes files, for editors")]
enum Described {
    /// Constant speed and heading; at speed zero, standing
    Straight(Straight),
    /// Speed changes
    Accelerate(Accelerate),
    /// Heading changes
    Turn(Turn),
    /// Height changes
    Climb(Climb),
    /// Brakes if moving, then stands
    Stop(Stop),
    /// From point to point on straight legs, cutting the corners with turns
    Waypoints(Waypoints),
}

#[derive(Deserialize, JsonSchema)]
struct Straight {
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    duration_s: Option<Finite>,
    /// … distance along the path (m)
    #[schemars(with = "Option<Positive>")]
    distance_m: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
struct Climb {
    /// Height gained (m)
    height_m: Finite,
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    duration_s: Option<Finite>,
    /// … distance along the path (m)
    #[schemars(with = "Option<Positive>")]
    distance_m: Option<Finite>,
}

#[derive(Deserialize, JsonSchema)]
struct Accelerate {
    /// Final speed (m/s)
    #[schemars(with = "NonNegative")]
    to_speed_m_s: Finite,
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    duration_s: Option<Finite>,
    /// … largest acceleration (m/s²)
    #[schemars(with = "Option<Positive>")]
    accel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
struct Turn {
    /// Change of heading, positive to the right (degrees)
    angle_deg: Finite,
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    duration_s: Option<Finite>,
    /// … largest rate (degrees/s), or …
    #[schemars(with = "Option<Positive>")]
    rate_deg_s: Option<Finite>,
    /// … smallest radius (m), or …
    #[schemars(with = "Option<Positive>")]
    radius_m: Option<Finite>,
    /// … largest lateral acceleration (m/s²)
    #[schemars(with = "Option<Positive>")]
    lateral_accel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
struct Stop {
    /// Time at rest (s)
    #[schemars(with = "Positive")]
    duration_s: Finite,
    /// Largest deceleration while braking (m/s²; default: 1.5)
    #[schemars(with = "Option<Positive>")]
    decel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
struct Waypoints {
    /// The points; the path ends at the last and passes inside the others
    #[schemars(with = "Vec<Point>", length(min = 1))]
    #[serde(rename = "points")]
    _points: IgnoredAny,
    /// Largest rate of turns (degrees/s), or …
    #[schemars(with = "Option<Positive>")]
    rate_deg_s: Option<Finite>,
    /// … smallest radius (m), or …
    #[schemars(with = "Option<Positive>")]
    radius_m: Option<Finite>,
    /// … largest lateral acceleration (m/s²)
    #[schemars(with = "Option<Positive>")]
    lateral_accel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    climb_m: Finite,
}

/// A point, by latitude and longitude or by metres from the start
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Point {
    /// Geodetic latitude (degrees)
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    lat_deg: Option<Finite>,
    /// Longitude (degrees)
    lon_deg: Option<Finite>,
    /// North of the start (m)
    n_m: Option<Finite>,
    /// East of the start (m)
    e_m: Option<Finite>,
    /// Height above the ellipsoid (m; default: that before it)
    #[schemars(range(min = *HEIGHT.start(), max = *HEIGHT.end()))]
    h_m: Option<Finite>,
}

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
    fn own<T: DeserializeOwned + JsonSchema>(segment: &Section<'_>) -> Result<T, FileError> {
        segment.read_own(&["kind", "ramp_s"])
    }
    let (kind, climb) = match segment.require_str("kind")? {
        "straight" => own(segment).and_then(|own| straight(segment, &own))?,
        "accelerate" => own(segment).and_then(|own| accelerate(segment, &own))?,
        "turn" => own(segment).and_then(|own| turn(segment, &own))?,
        "climb" => own(segment).and_then(|own| climb(segment, &own))?,
        "stop" => own(segment).map(|own| stop(&own))?,
        "waypoints" => own(segment).and_then(|own| waypoints(segment, &own))?,
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

fn straight(segment: &Section<'_>, own: &Straight) -> Result<(Kind, Finite), FileError> {
    Ok((length(segment, own.duration_s, own.distance_m)?, own.climb_m))
}

fn climb(segment: &Section<'_>, own: &Climb) -> Result<(Kind, Finite), FileError> {
    Ok((length(segment, own.duration_s, own.distance_m)?, own.height_m))
}

fn accelerate(segment: &Section<'_>, own: &Accelerate) -> Result<(Kind, Finite), FileError> {
    let by = match one_of(segment, [("duration_s", own.duration_s), ("accel_m_s2", own.accel_m_s2)])? {
        ("duration_s", s) => Acceleration::Duration(s),
        (_, a) => Acceleration::Peak(a),
    };
    Ok((Kind::Accelerate { to_speed: own.to_speed_m_s.0, by }, own.climb_m))
}

fn turn(segment: &Section<'_>, own: &Turn) -> Result<(Kind, Finite), FileError> {
    let given = [
        ("duration_s", own.duration_s),
        ("rate_deg_s", own.rate_deg_s),
        ("radius_m", own.radius_m),
        ("lateral_accel_m_s2", own.lateral_accel_m_s2),
    ];
    Ok((Kind::Turn { angle: own.angle_deg.0 * DEG, by: turning(segment, given)? }, own.climb_m))
}

fn stop(own: &Stop) -> (Kind, Finite) {
    let decel = own.decel_m_s2.map_or(DECEL, |decel| decel.0);
    (Kind::Stop { duration: own.duration_s.0, decel }, own.climb_m)
}

fn waypoints(segment: &Section<'_>, own: &Waypoints) -> Result<(Kind, Finite), FileError> {
    let given = [
        ("rate_deg_s", own.rate_deg_s),
        ("radius_m", own.radius_m),
        ("lateral_accel_m_s2", own.lateral_accel_m_s2),
    ];
    let by = turning(segment, given)?;
    let points = segment.sections("points")?.iter().map(waypoint).collect::<Result<_, _>>()?;
    Ok((Kind::Waypoints { points, by }, own.climb_m))
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
