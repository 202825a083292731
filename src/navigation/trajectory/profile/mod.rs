//! Motion profiles: a start and segments (straight, accelerate, turn, climb, stop, waypoints) become a
//! trajectory with continuous acceleration and angular rate.
//!
//! Heading, speed and slope are closed-form functions of time within a segment; latitude and longitude are
//! integrated on the ellipsoid (Runge-Kutta of fourth order, 0.02 s), then splined.
//!
//! ```
//! use nav_sim_navigation::earth::radii;
//! use nav_sim_navigation::trajectory::profile::{Bank, Kind, Length, Profile, Segment, Start};
//!
//! let start = Start { t_s: 0.0, lat: 0.9, lon: 0.2, h: 0.0, heading: 0.0, speed: 20.0 };
//! let north = Segment { kind: Kind::Straight(Length::Duration(60.0)), climb_m: 0.0, ramp_s: None };
//! let drive = Profile { start, bank: Bank::None, ramp_s: 2.0, segments: vec![north] }.build()?;
//! let arc_m = (drive.state(60.0).lat - start.lat) * radii(start.lat.sin()).meridian;
//! // 60 s at 20 m/s; the radius changes by 1e-6 on the way.
//! assert!((arc_m - 1200.0).abs() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod path;
mod piece;
mod waypoints;

use super::Trajectory;
use path::{Path, domain, positive};

pub use error::{Error, Problem};
pub use waypoints::{Place, Waypoint};

/// A motion profile.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Where and how it starts.
    pub start: Start,
    /// What the vehicle does with its roll angle.
    pub bank: Bank,
    /// Time over which accelerations and rates build up and fade (s), unless a segment says otherwise or
    /// is shorter than twice that.
    pub ramp_s: f64,
    /// What it does, in order.
    pub segments: Vec<Segment>,
}

/// The start of a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Time (s).
    pub t_s: f64,
    /// Geodetic latitude (rad).
    pub lat: f64,
    /// Longitude (rad).
    pub lon: f64,
    /// Height above the ellipsoid (m).
    pub h: f64,
    /// Heading from north (rad).
    pub heading: f64,
    /// Speed (m/s).
    pub speed: f64,
}

/// Roll in turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Bank {
    /// Stays level across, as a land vehicle.
    #[default]
    None,
    /// Banks so that the specific force stays in the plane of symmetry, as an aircraft:
    /// tan(roll) = v · heading rate / g.
    Coordinated,
}

/// One segment.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// What happens.
    pub kind: Kind,
    /// Height gained over the segment (m), negative downwards.
    pub climb_m: f64,
    /// Overrides [`Profile::ramp_s`].
    pub ramp_s: Option<f64>,
}

/// What happens in a segment.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Constant speed and heading; at speed zero, standing.
    Straight(Length),
    /// Speed changes.
    Accelerate {
        /// Final speed (m/s).
        to_speed: f64,
        /// How fast.
        by: Acceleration,
    },
    /// Heading changes.
    Turn {
        /// By how much (rad), positive to the right.
        angle: f64,
        /// How fast.
        by: Turning,
    },
    /// Brakes if moving, then stands.
    Stop {
        /// Time at rest (s).
        duration: f64,
        /// Largest deceleration while braking (m/s²).
        decel: f64,
    },
    /// From point to point on straight legs, cutting the corners with turns.
    Waypoints {
        /// The points; the path ends at the last and passes inside the others.
        points: Vec<Waypoint>,
        /// How fast the turns are.
        by: Turning,
    },
}

/// How long a straight is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Length {
    /// In time (s).
    Duration(f64),
    /// Along the path (m).
    Distance(f64),
}

/// How fast speed changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Acceleration {
    /// Within a time (s).
    Duration(f64),
    /// With this largest acceleration (m/s²).
    Peak(f64),
}

/// How fast heading changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Turning {
    /// Within a time (s).
    Duration(f64),
    /// With this largest rate (rad/s).
    Rate(f64),
    /// With this smallest radius (m).
    Radius(f64),
    /// With this largest lateral acceleration (m/s²).
    LateralAccel(f64),
}

impl Profile {
    /// The trajectory of the profile.
    ///
    /// # Errors
    /// The first value outside its domain, or segment that cannot be followed.
    pub fn build(&self) -> Result<Trajectory, Error> {
        let at_start = |problem| Error {
            segment: None,
            problem,
        };
        self.check_start().map_err(at_start)?;
        let mut path = Path::new(self);
        for (index, segment) in self.segments.iter().enumerate() {
            path.follow(segment).map_err(|problem| Error {
                segment: Some(index),
                problem,
            })?;
        }
        Trajectory::from_samples(&path.samples).map_err(|e| at_start(Problem::Samples(e)))
    }

    fn check_start(&self) -> Result<(), Problem> {
        let s = &self.start;
        for (key, value) in [
            ("t_s", s.t_s),
            ("lon_deg", s.lon),
            ("h_m", s.h),
            ("heading_deg", s.heading),
        ] {
            domain(key, "a finite number", value.is_finite())?;
        }
        domain(
            "lat_deg",
            "a latitude within ±89.9°",
            s.lat.abs() <= crate::earth::MAX_LATITUDE,
        )?;
        domain(
            "speed_m_s",
            "a speed ≥ 0",
            s.speed.is_finite() && s.speed >= 0.0,
        )?;
        positive("ramp_s", self.ramp_s)?;
        domain(
            "segment",
            "a list of at least one segment",
            !self.segments.is_empty(),
        )
    }
}

#[cfg(test)]
mod tests;
