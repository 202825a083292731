//! Motion profiles: a start and segments (straight, accelerate, turn, climb, stop, waypoints) become a
//! trajectory with continuous acceleration and angular rate.
//!
//! Heading, speed and slope are closed-form functions of time within a segment; latitude and longitude are
//! integrated on the ellipsoid (Runge-Kutta of fourth order, 0.02 s), then splined.

mod piece;
mod waypoints;

use super::{Trajectory, TrajectorySample};
use crate::earth::radii;
use crate::frames::RollPitchYaw;
use crate::units::{DEG, STANDARD_GRAVITY};
pub(super) use piece::Shape;
use piece::{Motion, Piece};

pub use waypoints::{Place, Waypoint};

/// Time between samples of the path (s), at most.
const STEP_S: f64 = 0.02;
/// Steepest path (rad).
const MAX_SLOPE: f64 = 60.0 * DEG;

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

/// A profile that cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}: \"{}\" {problem}", place(*segment), problem.key())]
pub struct Error {
    /// Which segment, counted from 0; none for the profile's own keys and its start.
    pub segment: Option<usize>,
    /// What is wrong.
    pub problem: Problem,
}

fn place(segment: Option<usize>) -> String {
    segment.map_or("start".to_owned(), |i| format!("segment {}", i + 1))
}

/// What is wrong with a profile; the texts continue `"key" = value`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// A value outside its domain.
    #[error("is not {domain}")]
    Domain {
        /// Key in profile files.
        key: &'static str,
        /// What would be accepted.
        domain: &'static str,
    },
    /// Something that only a moving vehicle can do.
    #[error("needs a moving vehicle, but it stands still here")]
    AtRest {
        /// Key in profile files.
        key: &'static str,
    },
    /// Too much height for the path.
    #[error("is too steep: {climb_m} m over {length_m:.1} m of path climbs more than 60°")]
    TooSteep {
        /// Height gained (m).
        climb_m: f64,
        /// Length of the path (m).
        length_m: f64,
    },
    /// A waypoint nearer than the turns before and after it need.
    #[error("has waypoint {number} too near: {leg_m:.1} m away, the turns take {needed_m:.1} m")]
    TooNear {
        /// Which waypoint, from 1.
        number: usize,
        /// Distance left to it (m).
        leg_m: f64,
        /// Distance the turn needs (m).
        needed_m: f64,
    },
    /// A waypoint inside the turning circle.
    #[error("has waypoint {number} inside the turning circle")]
    Unreachable {
        /// Which waypoint, from 1.
        number: usize,
    },
    /// A corner that turns back.
    #[error("turns back by {angle_deg:.0}° at waypoint {number}: more than 150°")]
    TurnsBack {
        /// Which waypoint, from 1.
        number: usize,
        /// The corner (deg).
        angle_deg: f64,
    },
    /// The path leaves the region of latitude and longitude, or turns too fast to sample.
    #[error("gives no trajectory: {0}")]
    Samples(super::Error),
}

impl Problem {
    /// The key in profile files that is to blame.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Domain { key, .. } | Self::AtRest { key } => key,
            Self::TooSteep { .. } => "climb_m",
            Self::TooNear { .. } | Self::Unreachable { .. } | Self::TurnsBack { .. } => "points",
            Self::Samples(_) => "segment",
        }
    }

    /// What to do about it, where that is not plain.
    #[must_use]
    pub const fn hint(&self) -> Option<&'static str> {
        Some(match self {
            Self::AtRest { .. } => "put an accelerate segment before it, or give the start a speed_m_s",
            Self::TooSteep { .. } => "climb over a longer path, or for longer",
            Self::TooNear { .. } | Self::Unreachable { .. } => {
                "turn tighter, go slower, or move the point away"
            }
            Self::TurnsBack { .. } => "turn back over two points",
            Self::Samples(super::Error::Rotation { .. }) => "give the turn more time",
            Self::Domain { .. } | Self::Samples(_) => return None,
        })
    }
}

impl Profile {
    /// The trajectory of the profile.
    ///
    /// # Errors
    /// The first value outside its domain, or segment that cannot be followed.
    pub fn build(&self) -> Result<Trajectory, Error> {
        let at_start = |problem| Error { segment: None, problem };
        self.check_start().map_err(at_start)?;
        let mut path = Path::new(self);
        for (index, segment) in self.segments.iter().enumerate() {
            path.follow(segment).map_err(|problem| Error { segment: Some(index), problem })?;
        }
        Trajectory::from_samples(&path.samples).map_err(|e| at_start(Problem::Samples(e)))
    }

    fn check_start(&self) -> Result<(), Problem> {
        let s = &self.start;
        for (key, value) in [("t_s", s.t_s), ("lon_deg", s.lon), ("h_m", s.h), ("heading_deg", s.heading)] {
            domain(key, "a finite number", value.is_finite())?;
        }
        domain("lat_deg", "a latitude within ±89.9°", s.lat.abs() <= crate::earth::MAX_LATITUDE)?;
        domain("speed_m_s", "a speed ≥ 0", s.speed.is_finite() && s.speed >= 0.0)?;
        positive("ramp_s", self.ramp_s)?;
        domain("segment", "a list of at least one segment", !self.segments.is_empty())
    }
}

fn domain(key: &'static str, domain: &'static str, holds: bool) -> Result<(), Problem> {
    if holds { Ok(()) } else { Err(Problem::Domain { key, domain }) }
}

fn positive(key: &'static str, value: f64) -> Result<(), Problem> {
    domain(key, "a finite number > 0", value.is_finite() && value > 0.0)
}

/// The path so far.
struct Path<'a> {
    profile: &'a Profile,
    t_s: f64,
    lat: f64,
    lon: f64,
    h: f64,
    heading: f64,
    speed: f64,
    samples: Vec<TrajectorySample>,
}

impl<'a> Path<'a> {
    fn new(profile: &'a Profile) -> Self {
        let Start { t_s, lat, lon, h, heading, speed } = profile.start;
        let mut path = Self { profile, t_s, lat, lon, h, heading, speed, samples: Vec::new() };
        let still = Motion { horizontal: speed, heading, heading_rate: 0.0, slope: 0.0, h };
        path.sample(t_s, &still);
        path
    }

    fn follow(&mut self, segment: &Segment) -> Result<(), Problem> {
        domain("climb_m", "a finite number", segment.climb_m.is_finite())?;
        let ramp_s = segment.ramp_s.unwrap_or(self.profile.ramp_s);
        positive("ramp_s", ramp_s)?;
        let climb = segment.climb_m;
        match &segment.kind {
            Kind::Straight(length) => self.straight(*length, climb, ramp_s),
            Kind::Accelerate { to_speed, by } => self.accelerate(*to_speed, *by, climb, ramp_s),
            Kind::Turn { angle, by } => {
                domain("angle_deg", "a finite number", angle.is_finite())?;
                let duration = self.turn_duration(*angle, *by, ramp_s)?;
                self.push([duration, ramp_s], 0.0, *angle, climb)
            }
            Kind::Stop { duration, decel } => {
                if self.speed > 0.0 {
                    positive("decel_m_s2", *decel)?;
                    self.accelerate(0.0, Acceleration::Peak(*decel), 0.0, ramp_s)?;
                }
                self.straight(Length::Duration(*duration), climb, ramp_s)
            }
            Kind::Waypoints { points, by } => self.waypoints(points, *by, climb, ramp_s),
        }
    }

    fn straight(&mut self, length: Length, climb: f64, ramp_s: f64) -> Result<(), Problem> {
        let duration = match length {
            Length::Duration(s) => {
                positive("duration_s", s)?;
                s
            }
            Length::Distance(m) => {
                positive("distance_m", m)?;
                m / self.moving("distance_m")?
            }
        };
        self.push([duration, ramp_s], 0.0, 0.0, climb)
    }

    fn accelerate(&mut self, to: f64, by: Acceleration, climb: f64, ramp_s: f64) -> Result<(), Problem> {
        domain("to_speed_m_s", "a speed ≥ 0", to.is_finite() && to >= 0.0)?;
        let change = to - self.speed;
        let duration = match by {
            Acceleration::Duration(s) => {
                positive("duration_s", s)?;
                s
            }
            Acceleration::Peak(a) => {
                positive("accel_m_s2", a)?;
                domain("to_speed_m_s", "another speed than before", change != 0.0)?;
                duration_of(change, a, ramp_s)
            }
        };
        self.push([duration, ramp_s], change, 0.0, climb)?;
        self.speed = to; // exactly
        Ok(())
    }

    /// Duration of a turn at the present speed (s).
    fn turn_duration(&self, angle: f64, by: Turning, ramp_s: f64) -> Result<f64, Problem> {
        domain("angle_deg", "an angle other than 0", angle != 0.0)?;
        let rate = match by {
            Turning::Duration(s) => {
                positive("duration_s", s)?;
                return Ok(s);
            }
            Turning::Rate(rate) => {
                positive("rate_deg_s", rate)?;
                rate
            }
            Turning::Radius(m) => {
                positive("radius_m", m)?;
                self.moving("radius_m")? / m
            }
            Turning::LateralAccel(a) => {
                positive("lateral_accel_m_s2", a)?;
                a / self.moving("lateral_accel_m_s2")?
            }
        };
        Ok(duration_of(angle, rate, ramp_s))
    }

    fn moving(&self, key: &'static str) -> Result<f64, Problem> {
        if self.speed > 0.0 { Ok(self.speed) } else { Err(Problem::AtRest { key }) }
    }

    /// The piece that continues the path for a duration with a ramp (s).
    fn piece(&self, [duration, ramp_s]: [f64; 2], speed: f64, heading: f64, climb: f64) -> Piece {
        let shape = Shape::new(ramp_s / duration);
        let (speed, heading) = ([self.speed, speed], [self.heading, heading]);
        Piece { duration, shape, speed, heading, height: [self.h, climb] }
    }

    /// Adds a piece of the given duration and ramp (s), changing speed, heading and height.
    fn push(
        &mut self,
        [duration, ramp_s]: [f64; 2],
        speed: f64,
        heading: f64,
        climb: f64,
    ) -> Result<(), Problem> {
        let piece = self.piece([duration, ramp_s], speed, heading, climb);
        if climb != 0.0 && piece.length() <= 0.0 {
            return Err(Problem::AtRest { key: "climb_m" });
        }
        if piece.steepest() > MAX_SLOPE.sin() {
            return Err(Problem::TooSteep { climb_m: climb, length_m: piece.length() });
        }
        self.integrate(&piece);
        Ok(())
    }

    fn integrate(&mut self, piece: &Piece) {
        let n = (piece.duration / STEP_S - 1e-9).ceil().max(1.0);
        let dt = piece.duration / n;
        for k in 0..n as usize {
            let x = |part: f64| (k as f64 + part) / n;
            let [from, middle, to] = [piece.at(x(0.0)), piece.at(x(0.5)), piece.at(x(1.0))];
            let k1 = rates(self.lat, &from);
            let k2 = rates(self.lat + 0.5 * dt * k1[0], &middle);
            let k3 = rates(self.lat + 0.5 * dt * k2[0], &middle);
            let k4 = rates(self.lat + dt * k3[0], &to);
            let step = |i: usize| dt / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            (self.lat, self.lon) = (self.lat + step(0), self.lon + step(1));
            self.sample(self.t_s + piece.duration * x(1.0), &to);
        }
        let end = piece.at(1.0);
        self.t_s = (1e9 * (self.t_s + piece.duration)).round() / 1e9; // sums of decimals stay decimals
        (self.h, self.heading) = (end.h, end.heading);
        self.speed += piece.speed[1];
    }

    fn sample(&mut self, t_s: f64, motion: &Motion) {
        let roll = match self.profile.bank {
            Bank::None => 0.0,
            Bank::Coordinated => (motion.horizontal * motion.heading_rate / STANDARD_GRAVITY).atan(),
        };
        let q_b_n = RollPitchYaw { roll, pitch: motion.slope, yaw: motion.heading }.to_quat();
        self.samples.push(TrajectorySample { t_s, lat: self.lat, lon: self.lon, h: motion.h, q_b_n });
    }
}

/// Duration of a change with a given peak rate: change/rate plus one ramp, or two ramps when it is short.
fn duration_of(change: f64, rate: f64, ramp_s: f64) -> f64 {
    let plateau = (change / rate).abs();
    plateau + ramp_s.min(plateau)
}

/// Rates of latitude and longitude (rad/s), [Groves](crate::bibliography::Groves13) eq. 2.111.
fn rates(lat: f64, motion: &Motion) -> [f64; 2] {
    let ((sin_lat, cos_lat), (sin_psi, cos_psi)) = (lat.sin_cos(), motion.heading.sin_cos());
    let r = radii(sin_lat);
    let (north, east) = (motion.horizontal * cos_psi, motion.horizontal * sin_psi);
    [north / (r.meridian + motion.h), east / ((r.transverse + motion.h) * cos_lat)]
}

#[cfg(test)]
mod tests;
