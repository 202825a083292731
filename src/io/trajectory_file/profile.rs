//! Motion profiles in TOML.

mod description;

use super::samples::HEIGHT;
use crate::io::Failure;
use crate::io::file_kind::{self, FileKind};
use crate::io::toml_file::{Finite, Source};
use description::{Described, Description, Point, Roll, SegmentTable};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::profile::{
    self, Acceleration, Bank, Kind, Length, Place, Profile, Segment, Start, Turning, Waypoint,
};
use nav_sim_signal::units::DEG;
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
    let ramp_s = vehicle.ramp_s.map_or(RAMP_S, |ramp| ramp.0);
    if ramp_s <= 0.0 {
        return Err(source.refused("vehicle.ramp_s", "is not a number > 0"));
    }
    let read = |(i, table): (usize, &SegmentTable)| {
        read_segment(
            &Keys {
                source,
                path: path_of(i),
            },
            table,
        )
    };
    let profile = Profile {
        start: Start {
            t_s: start.t_s.0,
            lat: start.lat_deg.0 * DEG,
            lon: start.lon_deg.0 * DEG,
            h: height(source, "start.h_m", start.h_m)?,
            heading: start.heading_deg.0 * DEG,
            speed: start.speed_m_s.0,
        },
        bank: match vehicle.bank {
            Roll::None => Bank::None,
            Roll::Coordinated => Bank::Coordinated,
        },
        ramp_s,
        segments: segment
            .iter()
            .enumerate()
            .map(read)
            .collect::<Result<_, _>>()?,
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
        Some(i) if key == "climb_m" && matches!(segments[i].kind, Described::Climb(_)) => {
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

/// A height at which the gravity model means something.
fn height(source: &Source, key: &str, h_m: Finite) -> Result<f64, Failure> {
    if HEIGHT.contains(&h_m.0) {
        return Ok(h_m.0);
    }
    Err(source.refused(key, "is no height within −12 to 1000 km"))
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

    /// The one key of several that is given, and its value.
    fn one_of<const N: usize>(
        &self,
        keys: [(&'static str, Option<Finite>); N],
    ) -> Result<(&'static str, f64), Failure> {
        let mut given = keys
            .iter()
            .filter_map(|(key, value)| value.map(|value| (*key, value.0)));
        match (given.next(), given.next()) {
            (None, _) => Err(self.source.missing(&self.path, &keys.map(|(key, _)| key))),
            (Some(only), None) => Ok(only),
            (Some((first, _)), Some((second, _))) => {
                let refusal = self
                    .source
                    .refused(&self.path(second), format!("stands beside {first}"));
                Err(refusal.or_hint("give one of them"))
            }
        }
    }

    fn length(&self, duration: Option<Finite>, distance: Option<Finite>) -> Result<Kind, Failure> {
        Ok(Kind::Straight(
            match self.one_of([("duration_s", duration), ("distance_m", distance)])? {
                ("duration_s", s) => Length::Duration(s),
                (_, m) => Length::Distance(m),
            },
        ))
    }

    fn turning<const N: usize>(
        &self,
        given: [(&'static str, Option<Finite>); N],
    ) -> Result<Turning, Failure> {
        Ok(match self.one_of(given)? {
            ("duration_s", s) => Turning::Duration(s),
            ("rate_deg_s", rate) => Turning::Rate(rate * DEG),
            ("radius_m", m) => Turning::Radius(m),
            (_, a) => Turning::LateralAccel(a),
        })
    }
}

fn read_segment(keys: &Keys<'_>, table: &SegmentTable) -> Result<Segment, Failure> {
    let (kind, climb) = match &table.kind {
        Described::Straight(own) => (keys.length(own.duration_s, own.distance_m)?, own.climb_m),
        Described::Climb(own) => (keys.length(own.duration_s, own.distance_m)?, own.height_m),
        Described::Accelerate(own) => {
            let by = match keys.one_of([
                ("duration_s", own.duration_s),
                ("accel_m_s2", own.accel_m_s2),
            ])? {
                ("duration_s", s) => Acceleration::Duration(s),
                (_, a) => Acceleration::Peak(a),
            };
            (
                Kind::Accelerate {
                    to_speed: own.to_speed_m_s.0,
                    by,
                },
                own.climb_m,
            )
        }
        Described::Turn(own) => {
            let by = keys.turning([
                ("duration_s", own.duration_s),
                ("rate_deg_s", own.rate_deg_s),
                ("radius_m", own.radius_m),
                ("lateral_accel_m_s2", own.lateral_accel_m_s2),
            ])?;
            (
                Kind::Turn {
                    angle: own.angle_deg.0 * DEG,
                    by,
                },
                own.climb_m,
            )
        }
        Described::Stop(own) => {
            let decel = own.decel_m_s2.map_or(DECEL, |decel| decel.0);
            (
                Kind::Stop {
                    duration: own.duration_s.0,
                    decel,
                },
                own.climb_m,
            )
        }
        Described::Waypoints(own) => {
            let by = keys.turning([
                ("rate_deg_s", own.rate_deg_s),
                ("radius_m", own.radius_m),
                ("lateral_accel_m_s2", own.lateral_accel_m_s2),
            ])?;
            let point = |(i, point)| {
                let path = keys.path(&format!("points[{i}]"));
                waypoint(
                    &Keys {
                        source: keys.source,
                        path,
                    },
                    point,
                )
            };
            let points = (1..)
                .zip(&own.points)
                .map(point)
                .collect::<Result<_, _>>()?;
            (Kind::Waypoints { points, by }, own.climb_m)
        }
    };
    Ok(Segment {
        kind,
        climb_m: climb.0,
        ramp_s: table.ramp_s.map(|ramp| ramp.0),
    })
}

fn waypoint(keys: &Keys<'_>, point: &Point) -> Result<Waypoint, Failure> {
    let pair = |names: [&str; 2], values: [Option<Finite>; 2]| match values {
        [Some(first), Some(second)] => Ok((first.0, second.0)),
        [None, _] => Err(keys.source.missing(&keys.path, &names[..1])),
        [_, None] => Err(keys.source.missing(&keys.path, &names[1..])),
    };
    let place = if point.n_m.or(point.e_m).is_some() {
        let geodetic = [("lat_deg", point.lat_deg), ("lon_deg", point.lon_deg)];
        if let Some((extra, _)) = geodetic.into_iter().find(|(_, value)| value.is_some()) {
            let refusal = keys
                .source
                .refused(&keys.path(extra), "stands beside n_m, e_m");
            return Err(refusal.or_hint("give one pair of them"));
        }
        let (north, east) = pair(["n_m", "e_m"], [point.n_m, point.e_m])?;
        Place::Local { north, east }
    } else {
        let (lat, lon) = pair(["lat_deg", "lon_deg"], [point.lat_deg, point.lon_deg])?;
        Place::Geodetic {
            lat: lat * DEG,
            lon: lon * DEG,
        }
    };
    let h = point
        .h_m
        .map(|h| height(keys.source, &keys.path("h_m"), h))
        .transpose()?;
    Ok(Waypoint { place, h })
}
