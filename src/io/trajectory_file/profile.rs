//! Motion profiles in TOML.

use crate::io::file_kind::FileKind;
use crate::io::toml_file::{Between, Finite, NonNegative, Positive, Source};
use crate::io::{Failure, file_kind};
use nav_sim_navigation::earth::MAX_LATITUDE_DEG;
use nav_sim_navigation::trajectory::profile::{
    Acceleration, Bank, Kind, Length, Place, Profile, Segment, Start, Turning, Waypoint,
};
use nav_sim_navigation::trajectory::{Trajectory, profile};
use nav_sim_signal::units::DEG;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::Path;

/// Ramps of accelerations and rates unless said otherwise (s).
const RAMP_S: f64 = 2.0;
/// Braking of a stop unless said otherwise (m/s²).
const DECEL: f64 = 1.5;

/// The JSON schema of such a file.
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(Description).to_value()
}

pub(super) fn load(path: &Path) -> Result<Trajectory, Failure> {
    build(&Source::read(path)?).map_err(|e| match file_kind::of(path) {
        Ok(FileKind::Model) => e.hint("this is a noise model: are the arguments in another order?"),
        _ => e,
    })
}

pub(super) fn build(source: &Source) -> Result<Trajectory, Failure> {
    let Description {
        start,
        vehicle,
        segment,
    } = source.get()?;
    let read = |(i, table)| {
        let path = path_of(i);
        read_segment(&Keys { source, path }, table)
    };
    let profile = Profile {
        start: Start {
            t_s: start.t_s.0,
            lat: start.lat_deg.0 * DEG,
            lon: start.lon_deg.0 * DEG,
            h: start.h_m.0,
            heading: start.heading_deg.0 * DEG,
            speed: start.speed_m_s.map_or(0.0, |speed| speed.0),
        },
        bank: match vehicle.bank {
            Roll::None => Bank::None,
            Roll::Coordinated => Bank::Coordinated,
        },
        ramp_s: vehicle.ramp_s.map_or(RAMP_S, |ramp| ramp.0),
        segments: (0..).zip(&segment).map(read).collect::<Result<_, _>>()?,
    };
    profile.build().map_err(|e| blame(source, &segment, &e))
}

fn path_of(segment: usize) -> String {
    format!("segment[{}]", segment + 1)
}

/// The refusal of a profile at the line of the key at fault.
fn blame(source: &Source, segments: &[SegmentTable], e: &profile::Error) -> Failure {
    let key = e.problem.key;
    let path = match e.segment {
        Some(i) if key == "climb_m" && matches!(segments[i].kind, Described::Climb { .. }) => {
            format!("{}.height_m", path_of(i))
        }
        Some(i) => format!("{}.{key}", path_of(i)),
        None if key == "segment" => key.to_owned(),
        None => format!("start.{key}"),
    };
    source
        .refused(&path, e.problem.to_string())
        .or_hint_if(e.problem.advice.map(str::to_owned))
}

/// The keys of a table.
struct Keys<'a> {
    source: &'a Source,
    path: String,
}

impl Keys<'_> {
    fn path(&self, key: &str) -> String {
        format!("{}.{key}", self.path)
    }

    /// What the one key of several that is given means.
    fn one_of<T, const N: usize>(&self, keys: [Meant<T>; N]) -> Result<T, Failure> {
        let mut given = keys
            .iter()
            .filter_map(|(key, value, meant)| Some((key, meant((*value)?.0))));
        match (given.next(), given.next()) {
            (None, _) => Err(self.source.missing(&self.path, &keys.map(|(key, ..)| key))),
            (Some((_, only)), None) => Ok(only),
            (Some((first, _)), Some((second, _))) => {
                let refusal = self
                    .source
                    .refused(&self.path(second), format!("stands beside {first}"));
                Err(refusal.or_hint("give one of them"))
            }
        }
    }

    fn straight(
        &self,
        duration: Option<Positive>,
        distance: Option<Positive>,
    ) -> Result<Kind, Failure> {
        let length = self.one_of([
            ("duration_s", duration, Length::Duration),
            ("distance_m", distance, Length::Distance),
        ])?;
        Ok(Kind::Straight(length))
    }
}

/// A key, its value, and what that means.
type Meant<T> = (&'static str, Option<Positive>, fn(f64) -> T);

fn turnings(
    rate: Option<Positive>,
    radius: Option<Positive>,
    accel: Option<Positive>,
) -> [Meant<Turning>; 3] {
    [
        ("rate_deg_s", rate, |rate| Turning::Rate(rate * DEG)),
        ("radius_m", radius, Turning::Radius),
        ("lateral_accel_m_s2", accel, Turning::LateralAccel),
    ]
}

fn read_segment(keys: &Keys<'_>, table: &SegmentTable) -> Result<Segment, Failure> {
    let (kind, climb) = match &table.kind {
        Described::Straight {
            duration_s,
            distance_m,
            climb_m,
        } => (keys.straight(*duration_s, *distance_m)?, climb_m),
        Described::Climb {
            height_m,
            duration_s,
            distance_m,
        } => (keys.straight(*duration_s, *distance_m)?, height_m),
        Described::Accelerate {
            to_speed_m_s,
            duration_s,
            accel_m_s2,
            climb_m,
        } => {
            let by = keys.one_of([
                ("duration_s", *duration_s, Acceleration::Duration),
                ("accel_m_s2", *accel_m_s2, Acceleration::Peak),
            ])?;
            let to_speed = to_speed_m_s.0;
            (Kind::Accelerate { to_speed, by }, climb_m)
        }
        Described::Turn {
            angle_deg,
            duration_s,
            rate_deg_s,
            radius_m,
            lateral_accel_m_s2,
            climb_m,
        } => {
            let [rate, radius, accel] = turnings(*rate_deg_s, *radius_m, *lateral_accel_m_s2);
            let duration: Meant<_> = ("duration_s", *duration_s, Turning::Duration);
            let by = keys.one_of([duration, rate, radius, accel])?;
            let angle = angle_deg.0 * DEG;
            (Kind::Turn { angle, by }, climb_m)
        }
        Described::Stop {
            duration_s,
            decel_m_s2,
            climb_m,
        } => {
            let decel = decel_m_s2.map_or(DECEL, |decel| decel.0);
            let duration = duration_s.0;
            (Kind::Stop { duration, decel }, climb_m)
        }
        Described::Waypoints {
            points,
            rate_deg_s,
            radius_m,
            lateral_accel_m_s2,
            climb_m,
        } => {
            let by = keys.one_of(turnings(*rate_deg_s, *radius_m, *lateral_accel_m_s2))?;
            let point = |(i, point)| {
                let (source, path) = (keys.source, keys.path(&format!("points[{i}]")));
                waypoint(&Keys { source, path }, point)
            };
            let points = (1..).zip(points).map(point).collect::<Result<_, _>>()?;
            (Kind::Waypoints { points, by }, climb_m)
        }
    };
    Ok(Segment {
        kind,
        climb_m: climb.0,
        ramp_s: table.ramp_s.map(|ramp| ramp.0),
    })
}

fn waypoint(keys: &Keys<'_>, point: &Point) -> Result<Waypoint, Failure> {
    let place = match [point.n_m, point.e_m, point.lat_deg, point.lon_deg] {
        [Some(north), Some(east), None, None] => Place::Local {
            north: north.0,
            east: east.0,
        },
        [None, None, Some(lat), Some(lon)] => Place::Geodetic {
            lat: lat.0 * DEG,
            lon: lon.0 * DEG,
        },
        _ => {
            let refusal = keys.source.refused(&keys.path, "is not a point");
            return Err(refusal.or_hint("give n_m and e_m, or lat_deg and lon_deg"));
        }
    };
    let h = point.h_m.map(|h| h.0);
    Ok(Waypoint { place, h })
}

// Keys of a motion profile: their types, ranges and words, for the reader and for editors.

/// Heights at which the gravity model means something (m).
type Height = Between<-12_000, 1_000_000, false>;

/// A drive by what the vehicle does: the trajectory of nav-sim run
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Motion profile")]
struct Description {
    start: Origin,
    #[serde(default)]
    vehicle: Vehicle,
    /// What the vehicle does, in order
    #[schemars(length(min = 1))]
    segment: Vec<SegmentTable>,
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
    h_m: Height,
    /// Heading from north (degrees)
    heading_deg: Finite,
    /// Speed (m/s; default: 0)
    speed_m_s: Option<NonNegative>,
}

/// How the vehicle moves
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Vehicle {
    /// Roll in turns: level as a land vehicle (default), or as an aircraft
    #[serde(default)]
    bank: Roll,
    /// Time over which accelerations and rates build up and fade (s; default: 2)
    ramp_s: Option<Positive>,
}

#[derive(Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Roll {
    #[default]
    None,
    Coordinated,
}

/// One segment
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct SegmentTable {
    /// Overrides that of the vehicle (s)
    ramp_s: Option<Positive>,
    #[schemars(flatten)]
    kind: Described,
}

/// The kinds of segment, each with its keys.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
#[schemars(tag = "kind", !deny_unknown_fields)]
enum Described {
    /// Constant speed and heading; at speed zero, standing
    Straight {
        /// Duration (s), or …
        duration_s: Option<Positive>,
        /// … distance along the path (m)
        distance_m: Option<Positive>,
        /// Height gained (m; default: 0)
        #[serde(default)]
        climb_m: Finite,
    },
    /// Speed changes
    Accelerate {
        /// Final speed (m/s)
        to_speed_m_s: NonNegative,
        /// Duration (s), or …
        duration_s: Option<Positive>,
        /// … largest acceleration (m/s²)
        accel_m_s2: Option<Positive>,
        /// Height gained (m; default: 0)
        #[serde(default)]
        climb_m: Finite,
    },
    /// Heading changes
    Turn {
        /// Change of heading, positive to the right (degrees)
        angle_deg: Finite,
        /// Duration (s), or …
        duration_s: Option<Positive>,
        /// … largest rate (degrees/s), or …
        rate_deg_s: Option<Positive>,
        /// … smallest radius (m), or …
        radius_m: Option<Positive>,
        /// … largest lateral acceleration (m/s²)
        lateral_accel_m_s2: Option<Positive>,
        /// Height gained (m; default: 0)
        #[serde(default)]
        climb_m: Finite,
    },
    /// Height changes
    Climb {
        /// Height gained (m)
        height_m: Finite,
        /// Duration (s), or …
        duration_s: Option<Positive>,
        /// … distance along the path (m)
        distance_m: Option<Positive>,
    },
    /// Brakes if moving, then stands
    Stop {
        /// Time at rest (s)
        duration_s: Positive,
        /// Largest deceleration while braking (m/s²; default: 1.5)
        decel_m_s2: Option<Positive>,
        /// Height gained (m; default: 0)
        #[serde(default)]
        climb_m: Finite,
    },
    /// From point to point on straight legs, cutting the corners with turns
    Waypoints {
        /// The points; the path ends at the last and passes inside the others
        #[schemars(length(min = 1))]
        points: Vec<Point>,
        /// Largest rate of turns (degrees/s), or …
        rate_deg_s: Option<Positive>,
        /// … smallest radius (m), or …
        radius_m: Option<Positive>,
        /// … largest lateral acceleration (m/s²)
        lateral_accel_m_s2: Option<Positive>,
        /// Height gained (m; default: 0)
        #[serde(default)]
        climb_m: Finite,
    },
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
    h_m: Option<Height>,
}
