//! Keys of a motion profile: their types, ranges and words, for the reader and for editors.

use super::super::samples::HEIGHT;
use crate::io::toml_file::Finite;
use nav_sim_navigation::earth::MAX_LATITUDE_DEG;
use nav_sim_signal::units::{NonNegative, Positive};
use schemars::JsonSchema;
use serde::Deserialize;

/// A drive by what the vehicle does: the trajectory of nav-sim run
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Motion profile")]
pub(super) struct Description {
    pub(super) start: Origin,
    #[serde(default)]
    pub(super) vehicle: Vehicle,
    /// What the vehicle does, in order
    #[schemars(length(min = 1))]
    pub(super) segment: Vec<SegmentTable>,
}

/// Where and how it starts
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Origin {
    /// Time (s; default: 0)
    #[serde(default)]
    pub(super) t_s: Finite,
    /// Geodetic latitude (degrees)
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    pub(super) lat_deg: Finite,
    /// Longitude (degrees)
    pub(super) lon_deg: Finite,
    /// Height above the ellipsoid (m)
    #[schemars(range(min = *HEIGHT.start(), max = *HEIGHT.end()))]
    pub(super) h_m: Finite,
    /// Heading from north (degrees)
    pub(super) heading_deg: Finite,
    /// Speed (m/s; default: 0)
    #[serde(default)]
    #[schemars(with = "NonNegative")]
    pub(super) speed_m_s: Finite,
}

/// How the vehicle moves
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Vehicle {
    /// Roll in turns: level as a land vehicle (default), or as an aircraft
    #[serde(default)]
    pub(super) bank: Roll,
    /// Time over which accelerations and rates build up and fade (s; default: 2)
    #[schemars(with = "Option<Positive>")]
    pub(super) ramp_s: Option<Finite>,
}

#[derive(Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Roll {
    #[default]
    None,
    Coordinated,
}

/// One segment
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct SegmentTable {
    /// Overrides that of the vehicle (s)
    #[schemars(with = "Option<Positive>")]
    pub(super) ramp_s: Option<Finite>,
    #[schemars(flatten)]
    pub(super) kind: Described,
}

/// The kinds of segment, each with its keys.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(tag = "kind")]
pub(super) enum Described {
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
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Straight {
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) duration_s: Option<Finite>,
    /// … distance along the path (m)
    #[schemars(with = "Option<Positive>")]
    pub(super) distance_m: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    pub(super) climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Climb {
    /// Height gained (m)
    pub(super) height_m: Finite,
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) duration_s: Option<Finite>,
    /// … distance along the path (m)
    #[schemars(with = "Option<Positive>")]
    pub(super) distance_m: Option<Finite>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Accelerate {
    /// Final speed (m/s)
    #[schemars(with = "NonNegative")]
    pub(super) to_speed_m_s: Finite,
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) duration_s: Option<Finite>,
    /// … largest acceleration (m/s²)
    #[schemars(with = "Option<Positive>")]
    pub(super) accel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    pub(super) climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Turn {
    /// Change of heading, positive to the right (degrees)
    pub(super) angle_deg: Finite,
    /// Duration (s), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) duration_s: Option<Finite>,
    /// … largest rate (degrees/s), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) rate_deg_s: Option<Finite>,
    /// … smallest radius (m), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) radius_m: Option<Finite>,
    /// … largest lateral acceleration (m/s²)
    #[schemars(with = "Option<Positive>")]
    pub(super) lateral_accel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    pub(super) climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Stop {
    /// Time at rest (s)
    #[schemars(with = "Positive")]
    pub(super) duration_s: Finite,
    /// Largest deceleration while braking (m/s²; default: 1.5)
    #[schemars(with = "Option<Positive>")]
    pub(super) decel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    pub(super) climb_m: Finite,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Waypoints {
    /// The points; the path ends at the last and passes inside the others
    #[schemars(length(min = 1))]
    pub(super) points: Vec<Point>,
    /// Largest rate of turns (degrees/s), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) rate_deg_s: Option<Finite>,
    /// … smallest radius (m), or …
    #[schemars(with = "Option<Positive>")]
    pub(super) radius_m: Option<Finite>,
    /// … largest lateral acceleration (m/s²)
    #[schemars(with = "Option<Positive>")]
    pub(super) lateral_accel_m_s2: Option<Finite>,
    /// Height gained (m; default: 0)
    #[serde(default)]
    pub(super) climb_m: Finite,
}

/// A point, by latitude and longitude or by metres from the start
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Point {
    /// Geodetic latitude (degrees)
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    pub(super) lat_deg: Option<Finite>,
    /// Longitude (degrees)
    pub(super) lon_deg: Option<Finite>,
    /// North of the start (m)
    pub(super) n_m: Option<Finite>,
    /// East of the start (m)
    pub(super) e_m: Option<Finite>,
    /// Height above the ellipsoid (m; default: that before it)
    #[schemars(range(min = *HEIGHT.start(), max = *HEIGHT.end()))]
    pub(super) h_m: Option<Finite>,
}
