//! Keys of a motion profile: their types, ranges and words, for the reader and for editors.

use crate::io::toml_file::{Between, Finite, NonNegative, Positive};
use nav_sim_navigation::earth::MAX_LATITUDE_DEG;
use schemars::JsonSchema;
use serde::Deserialize;

/// Heights at which the gravity model means something (m).
type Height = Between<-12_000, 1_000_000, false>;

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
    pub(super) h_m: Height,
    /// Heading from north (degrees)
    pub(super) heading_deg: Finite,
    /// Speed (m/s; default: 0)
    pub(super) speed_m_s: Option<NonNegative>,
}

/// How the vehicle moves
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Vehicle {
    /// Roll in turns: level as a land vehicle (default), or as an aircraft
    #[serde(default)]
    pub(super) bank: Roll,
    /// Time over which accelerations and rates build up and fade (s; default: 2)
    pub(super) ramp_s: Option<Positive>,
}

#[derive(Default, Deserialize, JsonSchema)]
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
    pub(super) ramp_s: Option<Positive>,
    #[schemars(flatten)]
    pub(super) kind: Described,
}

/// The kinds of segment, each with its keys.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
#[schemars(tag = "kind", !deny_unknown_fields)]
pub(super) enum Described {
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
    pub(super) h_m: Option<Height>,
}
