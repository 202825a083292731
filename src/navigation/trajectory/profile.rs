//! Motion profiles: a start and segments (straight, accelerate, turn, climb, stop, waypoints) become a
//! trajectory with continuous acceleration and angular rate.
//!
//! Heading, speed and slope are closed-form functions of time within a segment; latitude and longitude are
//! integrated on the ellipsoid (Runge-Kutta of fourth order, 0.02 s), then splined.
//!
//! ```
//! use nav_sim_navigation::earth::radii;
//! use nav_sim_navigation::trajectory::profile::{Bank, SegmentKind, Length, Profile, Segment, ProfileStart};
//!
//! let start = ProfileStart { t_s: 0.0, lat: 0.9, lon: 0.2, h: 0.0, heading: 0.0, speed: 20.0 };
//! let north = Segment { kind: SegmentKind::Straight(Length::Duration(60.0)), climb_m: 0.0, ramp_s: None };
//! let drive = Profile { start, bank: Bank::None, ramp_s: 2.0, segments: vec![north] }.build()?;
//! let arc_m = (drive.state(60.0).lat - start.lat) * radii(start.lat.sin()).meridian;
//! // 60 s at 20 m/s; the radius changes by 1e-6 on the way.
//! assert!((arc_m - 1200.0).abs() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::{Trajectory, TrajectorySample};
use crate::earth::{MAX_LATITUDE_DEG, moved, radii};
use crate::frames::{RollPitchYaw, wrap_angle};
use crate::units::{DEG, NonNegative, Positive, STANDARD_GRAVITY};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

/// A motion profile.
#[derive(Debug, Clone)]
pub struct Profile {
    /// Initial state.
    pub start: ProfileStart,
    /// Roll angle in turns.
    pub bank: Bank,
    /// Time over which accelerations and rates build up and fade (s), unless a segment says otherwise or
    /// is shorter than twice that.
    pub ramp_s: f64,
    /// Segments, in order.
    pub segments: Vec<Segment>,
}

/// Reads an angle, which is in degrees in files (rad).
fn degrees<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(f64::deserialize(deserializer)? * DEG)
}

/// The start of a profile (angles in rad; in files degrees).
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProfileStart {
    /// Time (s).
    #[serde(default)]
    pub t_s: f64,
    /// Geodetic latitude.
    #[serde(rename = "lat_deg", deserialize_with = "degrees")]
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    pub lat: f64,
    /// Longitude.
    #[serde(rename = "lon_deg", deserialize_with = "degrees")]
    #[schemars(range(min = -360, max = 360))]
    pub lon: f64,
    /// Height above the ellipsoid (m).
    #[serde(rename = "h_m")]
    #[schemars(range(min = -12_000, max = 1_000_000))]
    pub h: f64,
    /// Heading from north.
    #[serde(rename = "heading_deg", deserialize_with = "degrees")]
    #[schemars(range(min = -360, max = 360))]
    pub heading: f64,
    /// Speed (m/s).
    #[serde(rename = "speed_m_s", default)]
    #[schemars(with = "NonNegative")]
    pub speed: f64,
}

/// Roll in turns.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Bank {
    /// Stays level across, as a land vehicle.
    #[default]
    None,
    /// Banks so that the specific force stays in the plane of symmetry, as an aircraft:
    /// tan(roll) = v · heading rate / g.
    Coordinated,
}

/// One segment.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Segment {
    /// Kind of motion.
    #[serde(flatten)]
    pub kind: SegmentKind,
    /// Height gained over the segment (m), negative downwards.
    #[serde(default)]
    pub climb_m: f64,
    /// Time over which accelerations and rates build up and fade (s), in the place of that of the vehicle.
    #[schemars(with = "Option<Positive>")]
    pub ramp_s: Option<f64>,
}

/// Motion in a segment (angles in rad; in files degrees).
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum SegmentKind {
    /// Constant speed and heading; at speed zero, standing.
    Straight(Length),
    /// Speed changes.
    Accelerate {
        /// Final speed (m/s).
        #[serde(rename = "to_speed_m_s")]
        #[schemars(with = "NonNegative")]
        to_speed: f64,
        /// Acceleration or duration.
        #[serde(flatten)]
        by: Acceleration,
    },
    /// Heading changes.
    Turn {
        /// By how much, positive to the right.
        #[serde(rename = "angle_deg", deserialize_with = "degrees")]
        angle: f64,
        /// Turn rate, radius or duration.
        #[serde(flatten)]
        by: Turning,
    },
    /// Height changes.
    Climb {
        /// Height gained (m).
        height_m: f64,
        /// Duration or distance.
        #[serde(flatten)]
        by: Length,
    },
    /// Brakes if moving, then stands.
    Stop {
        /// Time at rest (s).
        #[serde(rename = "duration_s")]
        #[schemars(with = "Positive")]
        duration: f64,
        /// Largest deceleration while braking (m/s²).
        #[serde(rename = "decel_m_s2", default = "braking")]
        #[schemars(with = "Positive")]
        decel: f64,
    },
    /// From point to point on straight legs, cutting the corners with turns.
    Waypoints {
        /// The points; the path ends at the last and passes inside the others.
        #[schemars(length(min = 1))]
        points: Vec<Waypoint>,
        /// Rate or radius of the turns.
        #[serde(flatten)]
        by: Turning,
    },
}

/// Deceleration of a stop unless said otherwise (m/s²).
const fn braking() -> f64 {
    1.5
}

/// Length of a straight.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
pub enum Length {
    /// In time (s).
    #[serde(rename = "duration_s")]
    Duration(#[schemars(with = "Positive")] f64),
    /// Along the path (m).
    #[serde(rename = "distance_m")]
    Distance(#[schemars(with = "Positive")] f64),
}

/// Rate of a speed change.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
pub enum Acceleration {
    /// Within a time (s).
    #[serde(rename = "duration_s")]
    Duration(#[schemars(with = "Positive")] f64),
    /// With this largest acceleration (m/s²).
    #[serde(rename = "accel_m_s2")]
    Peak(#[schemars(with = "Positive")] f64),
}

/// Rate of a heading change.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
pub enum Turning {
    /// Within a time (s).
    #[serde(rename = "duration_s")]
    Duration(#[schemars(with = "Positive")] f64),
    /// With this largest rate (rad/s; in files degrees/s).
    #[serde(rename = "rate_deg_s", deserialize_with = "degrees")]
    Rate(#[schemars(with = "Positive")] f64),
    /// With this smallest radius (m).
    #[serde(rename = "radius_m")]
    Radius(#[schemars(with = "Positive")] f64),
    /// With this largest lateral acceleration (m/s²).
    #[serde(rename = "lateral_accel_m_s2")]
    LateralAccel(#[schemars(with = "Positive")] f64),
}

impl Profile {
    /// The trajectory of the profile.
    ///
    /// # Errors
    /// The first value outside its domain, or segment that cannot be followed.
    pub fn build(&self) -> Result<Trajectory, ProfileError> {
        let at_start = |problem| ProfileError {
            segment: None,
            problem,
        };
        domain(
            "lat_deg",
            "a latitude within ±89.9°",
            self.start.lat.abs() <= crate::earth::MAX_LATITUDE,
        )
        .map_err(at_start)?;
        domain(
            "segment",
            "a list of at least one segment",
            !self.segments.is_empty(),
        )
        .map_err(at_start)?;
        let mut path = Path::new(self);
        for (index, segment) in self.segments.iter().enumerate() {
            path.follow(segment).map_err(|problem| ProfileError {
                segment: Some(index),
                problem,
            })?;
        }
        let no_trajectory = |e: super::TrajectoryError| {
            let problem = Problem::new("segment", format!("gives no trajectory: {e}"));
            at_start(match e {
                super::TrajectoryError::Rotation { .. } => {
                    problem.advise("give the turn more time")
                }
                _ => problem,
            })
        };
        Trajectory::from_samples(&path.samples).map_err(no_trajectory)
    }
}

// What is wrong with a profile.

/// A profile that cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}: \"{}\" {problem}", place(*segment), problem.key)]
pub struct ProfileError {
    /// Index of the segment, counted from 0; none for the profile's own keys and its start.
    pub segment: Option<usize>,
    /// The problem.
    pub problem: Problem,
}

fn place(segment: Option<usize>) -> String {
    segment.map_or("start".to_owned(), |i| format!("segment {}", i + 1))
}

/// The fault of a profile; `text` continues `"key"`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{text}")]
pub struct Problem {
    /// The key in profile files that is to blame.
    pub key: &'static str,
    text: String,
    /// Advice, where the text does not say what to do.
    pub advice: Option<&'static str>,
}

impl Problem {
    fn new(key: &'static str, text: impl Into<String>) -> Self {
        Self {
            key,
            text: text.into(),
            advice: None,
        }
    }

    fn advise(self, advice: &'static str) -> Self {
        Self {
            advice: Some(advice),
            ..self
        }
    }

    /// Something that only a moving vehicle can do.
    fn at_rest(key: &'static str) -> Self {
        Self::new(key, "needs a moving vehicle, which stands still here")
            .advise("put an accelerate segment before it, or give the start a speed_m_s")
    }
}

/// Advice for waypoints that cannot be turned to.
const NEARER: &str = "turn tighter, go slower, or move the point away";

// From segments to samples.

/// Time between samples of the path (s), at most.
const STEP_S: f64 = 0.02;
/// Steepest path (rad).
const MAX_SLOPE: f64 = 60.0 * DEG;
/// Longest path (s): a day.
const MAX_DURATION_S: f64 = 86_400.0;

fn domain(key: &'static str, domain: &'static str, holds: bool) -> Result<(), Problem> {
    if holds {
        Ok(())
    } else {
        Err(Problem::new(key, format!("is not {domain}")))
    }
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
        let ProfileStart {
            t_s,
            lat,
            lon,
            h,
            heading,
            speed,
        } = profile.start;
        let mut path = Self {
            profile,
            t_s,
            lat,
            lon,
            h,
            heading,
            speed,
            samples: Vec::new(),
        };
        let still = MotionInstant {
            horizontal: speed,
            heading,
            heading_rate: 0.0,
            slope: 0.0,
            h,
        };
        path.sample(t_s, &still);
        path
    }

    fn follow(&mut self, segment: &Segment) -> Result<(), Problem> {
        let ramp_s = segment.ramp_s.unwrap_or(self.profile.ramp_s);
        let climb = segment.climb_m;
        // a piece is known by its duration, whatever says how long it is
        let length_key = match &segment.kind {
            SegmentKind::Straight(Length::Distance(_))
            | SegmentKind::Climb {
                by: Length::Distance(_),
                ..
            } => "distance_m",
            SegmentKind::Accelerate {
                by: Acceleration::Peak(_),
                ..
            } => "accel_m_s2",
            SegmentKind::Turn { by, .. } | SegmentKind::Waypoints { by, .. } => match by {
                Turning::Duration(_) => "duration_s",
                Turning::Rate(_) => "rate_deg_s",
                Turning::Radius(_) => "radius_m",
                Turning::LateralAccel(_) => "lateral_accel_m_s2",
            },
            _ => "duration_s",
        };
        let named = |problem: Problem| match problem.key {
            "duration_s" => Problem {
                key: length_key,
                ..problem
            },
            _ => problem,
        };
        let followed = match &segment.kind {
            SegmentKind::Straight(length) => self.straight(*length, climb, ramp_s),
            SegmentKind::Climb { height_m, by } => self.straight(*by, climb + height_m, ramp_s),
            SegmentKind::Accelerate { to_speed, by } => {
                self.accelerate(*to_speed, *by, climb, ramp_s)
            }
            SegmentKind::Turn { angle, by } => {
                let duration = self.turn_duration(*angle, *by, ramp_s)?;
                self.push([duration, ramp_s], 0.0, *angle, climb)
            }
            SegmentKind::Stop { duration, decel } => {
                if self.speed > 0.0 {
                    self.accelerate(0.0, Acceleration::Peak(*decel), 0.0, ramp_s)?;
                }
                self.straight(Length::Duration(*duration), climb, ramp_s)
            }
            SegmentKind::Waypoints { points, by } => self.waypoints(points, *by, climb, ramp_s),
        };
        followed.map_err(named)
    }

    fn straight(&mut self, length: Length, climb: f64, ramp_s: f64) -> Result<(), Problem> {
        let duration = match length {
            Length::Duration(s) => s,
            Length::Distance(m) => m / self.moving("distance_m")?,
        };
        self.push([duration, ramp_s], 0.0, 0.0, climb)
    }

    fn accelerate(
        &mut self,
        to: f64,
        by: Acceleration,
        climb: f64,
        ramp_s: f64,
    ) -> Result<(), Problem> {
        let change = to - self.speed;
        let duration = match by {
            Acceleration::Duration(s) => s,
            Acceleration::Peak(a) => {
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
            Turning::Duration(s) => return Ok(s),
            Turning::Rate(rate) => rate,
            Turning::Radius(m) => self.moving("radius_m")? / m,
            Turning::LateralAccel(a) => a / self.moving("lateral_accel_m_s2")?,
        };
        Ok(duration_of(angle, rate, ramp_s))
    }

    fn moving(&self, key: &'static str) -> Result<f64, Problem> {
        if self.speed > 0.0 {
            Ok(self.speed)
        } else {
            Err(Problem::at_rest(key))
        }
    }

    /// The piece that continues the path for a duration with a ramp (s).
    fn piece(
        &self,
        [duration, ramp_s]: [f64; 2],
        speed: f64,
        heading: f64,
        climb: f64,
    ) -> MotionPiece {
        let shape = RampShape::new(ramp_s / duration);
        let (speed, heading) = ([self.speed, speed], [self.heading, heading]);
        MotionPiece {
            duration,
            shape,
            speed,
            heading,
            height: [self.h, climb],
        }
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
            return Err(Problem::at_rest("climb_m"));
        }
        if piece.steepest() > MAX_SLOPE.sin() {
            let length_m = piece.length();
            let text = format!(
                "is too steep: {climb} m over {length_m:.1} m of path climbs more than 60°"
            );
            return Err(
                Problem::new("climb_m", text).advise("climb over a longer path, or for longer")
            );
        }
        let total_s = self.t_s + duration - self.profile.start.t_s;
        if total_s > MAX_DURATION_S {
            let text = format!("makes the trajectory {total_s:.3e} s long: over a day");
            return Err(Problem::new("duration_s", text));
        }
        self.integrate(&piece);
        Ok(())
    }

    fn integrate(&mut self, piece: &MotionPiece) {
        // A whole number of steps, so that the end of the piece, where the fourth derivative of the speed may
        // jump, is a sample.
        let n = (piece.duration / STEP_S - 1e-9).ceil().max(1.0);
        let dt = piece.duration / n;
        for k in 0..n as usize {
            let x = |part: f64| (k as f64 + part) / n;
            // Speed, heading and height are known in closed form: of the Runge-Kutta stages only the latitude
            // is a guess, and nothing depends on the longitude.
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
        // From the closed form, not from the sums of steps: no error builds up over the segments.
        (self.h, self.heading) = (end.h, end.heading);
        self.speed += piece.speed[1];
    }

    fn sample(&mut self, t_s: f64, motion: &MotionInstant) {
        let roll = match self.profile.bank {
            Bank::None => 0.0,
            // Level turn: the lateral specific force v·ψ̇ and gravity combine along the down axis of the
            // body.
            Bank::Coordinated => {
                (motion.horizontal * motion.heading_rate / STANDARD_GRAVITY).atan()
            }
        };
        let q_b_n = RollPitchYaw {
            roll,
            pitch: motion.slope,
            yaw: motion.heading,
        }
        .to_quat();
        self.samples.push(TrajectorySample {
            t_s,
            lat: self.lat,
            lon: self.lon,
            h: motion.h,
            q_b_n,
        });
    }
}

/// Duration of a change with a given peak rate: change/rate plus one ramp, or two ramps when it is short.
fn duration_of(change: f64, rate: f64, ramp_s: f64) -> f64 {
    let plateau = (change / rate).abs();
    // peak = change/(duration − ramp) where ramp ≤ duration/2; a shorter change is all ramp, peak
    // 2·change/duration.
    plateau + ramp_s.min(plateau)
}

/// Rates of latitude and longitude (rad/s), [Groves](crate::bibliography::Groves13) eq. 2.111.
fn rates(lat: f64, motion: &MotionInstant) -> [f64; 2] {
    let ((sin_lat, cos_lat), (sin_psi, cos_psi)) = (lat.sin_cos(), motion.heading.sin_cos());
    let r = radii(sin_lat);
    let (north, east) = (motion.horizontal * cos_psi, motion.horizontal * sin_psi);
    [
        north / (r.meridian + motion.h),
        east / ((r.transverse + motion.h) * cos_lat),
    ]
}

// One smooth stretch of motion: speed, heading and height go from one value to another with bell- or
// table-shaped rates, so that acceleration and angular rate are continuous.

/// The shape of a change from 0 to 1 over x in [0, 1]: its rate rises over a share `ramp` of the time as a
/// quintic smooth step, stays, and falls likewise. Value, rate, and the rate's first two derivatives are
/// continuous; outside [0, 1] nothing changes.
#[derive(Clone, Copy)]
struct RampShape {
    /// Share of the whole that each ramp takes, in (0, 1/2].
    ramp: f64,
}

impl RampShape {
    fn new(ramp: f64) -> Self {
        Self {
            ramp: ramp.min(0.5),
        }
    }

    /// Largest rate; reached in the middle.
    fn peak(self) -> f64 {
        1.0 / (1.0 - self.ramp)
    }

    /// Rate of change at x.
    fn rate(self, x: f64) -> f64 {
        let y = (x.min(1.0 - x) / self.ramp).clamp(0.0, 1.0);
        // 10y³ − 15y⁴ + 6y⁵: first and second derivative are zero at both ends.
        self.peak() * y * y * y * (10.0 + y * (6.0 * y - 15.0))
    }

    /// The change so far: the integral of the rate.
    fn value(self, x: f64) -> f64 {
        if x > 0.5 {
            // The rate is symmetric about the middle: one formula for both ramps, and exactly 1 at the end.
            return 1.0 - self.value(1.0 - x);
        }
        let y = (x / self.ramp).clamp(0.0, 1.0);
        let ramped = self.ramp * y.powi(4) * (2.5 + y * (y - 3.0));
        self.peak() * (ramped + (x - self.ramp).max(0.0))
    }

    /// The integral of the change so far.
    fn integral(self, x: f64) -> f64 {
        if x > 0.5 {
            return x - 0.5 + self.integral(1.0 - x); // from value(x) = 1 − value(1 − x)
        }
        let y = (x / self.ramp).clamp(0.0, 1.0);
        let ramped = self.ramp * self.ramp * y.powi(5) * (0.5 + y * (y / 7.0 - 0.5));
        let past = (x - self.ramp).max(0.0);
        self.peak() * (ramped + past * (0.5 * self.ramp + 0.5 * past))
    }
}

/// A stretch of motion: everything as a function of the share x of its duration.
struct MotionPiece {
    /// Duration (s).
    duration: f64,
    shape: RampShape,
    /// Speed along the path at the start, and its change (m/s).
    speed: [f64; 2],
    /// Heading at the start, and its change (rad).
    heading: [f64; 2],
    /// Height at the start, and its change (m).
    height: [f64; 2],
}

/// The motion at an instant.
#[derive(Clone, Copy, PartialEq)]
struct MotionInstant {
    /// Horizontal speed (m/s).
    horizontal: f64,
    /// Heading (rad) and its rate (rad/s).
    heading: f64,
    heading_rate: f64,
    /// Angle of the path above the horizon (rad).
    slope: f64,
    /// Height (m).
    h: f64,
}

impl MotionPiece {
    /// Length of the path (m): the mean of a symmetric change is half of it.
    fn length(&self) -> f64 {
        self.duration * (self.speed[0] + 0.5 * self.speed[1])
    }

    /// Sine of the steepest slope; the height changes with the path, not with time, so that a vehicle that
    /// starts or stops on a hill follows the road.
    fn steepest(&self) -> f64 {
        if self.height[1] == 0.0 {
            0.0
        } else {
            (self.height[1] / self.length()).abs() * self.shape.peak()
        }
    }

    fn at(&self, x: f64) -> MotionInstant {
        let speed = self.speed[0] + self.speed[1] * self.shape.value(x);
        let (mut sin_slope, mut h) = (0.0, self.height[0]);
        if self.height[1] != 0.0 {
            let path = self.duration * (self.speed[0] * x + self.speed[1] * self.shape.integral(x));
            let share = path / self.length();
            sin_slope = self.height[1] / self.length() * self.shape.rate(share);
            h += self.height[1] * self.shape.value(share);
        }
        MotionInstant {
            // Speed is along the path; what climbs does not go forwards.
            horizontal: speed * (1.0 - sin_slope * sin_slope).sqrt(),
            heading: self.heading[0] + self.heading[1] * self.shape.value(x),
            heading_rate: self.heading[1] * self.shape.rate(x) / self.duration,
            slope: sin_slope.asin(),
            h,
        }
    }
}

// Straight legs between points, corners cut by smooth turns.

/// The sharpest corner (rad): beyond it the turn would begin far before the corner.
const MAX_CORNER: f64 = 150.0 * DEG;

/// A point to pass.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Waypoint {
    /// Where.
    #[serde(flatten)]
    pub place: HorizontalPosition,
    /// Height above the ellipsoid (m), if it is to change.
    #[serde(rename = "h_m")]
    #[schemars(range(min = -12_000, max = 1_000_000))]
    pub h: Option<f64>,
}

/// A horizontal position.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum HorizontalPosition {
    /// Latitude and longitude (rad; in files degrees).
    Geodetic {
        /// Geodetic latitude.
        #[serde(rename = "lat_deg", deserialize_with = "degrees")]
        #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
        lat: f64,
        /// Longitude.
        #[serde(rename = "lon_deg", deserialize_with = "degrees")]
        #[schemars(range(min = -360, max = 360))]
        lon: f64,
    },
    /// North and east of the profile's start (m), curvilinear.
    Local {
        /// North (m).
        #[serde(rename = "n_m")]
        north: f64,
        /// East (m).
        #[serde(rename = "e_m")]
        east: f64,
    },
}

impl Path<'_> {
    fn waypoints(
        &mut self,
        points: &[Waypoint],
        by: Turning,
        climb: f64,
        ramp_s: f64,
    ) -> Result<(), Problem> {
        domain("points", "a list of at least one point", !points.is_empty())?;
        domain(
            "climb_m",
            "for waypoints: give the points \"h_m\"",
            climb == 0.0,
        )?;
        self.moving("points")?;
        let targets = points
            .iter()
            .map(|p| self.target(p))
            .collect::<Result<Vec<_>, _>>()?;
        for (i, &target) in targets.iter().enumerate() {
            let number = i + 1;
            self.turn_towards(target, by, ramp_s, number)?;
            let (_, distance) = self.course([self.lat, self.lon], target);
            let lead = match targets.get(i + 1) {
                Some(&next) => self.lead(target, next, by, ramp_s, number)?,
                None => 0.0,
            };
            if distance <= lead {
                let text = format!(
                    "has waypoint {number} too near: {distance:.1} m away, the turns take {lead:.1} m"
                );
                return Err(Problem::new("points", text).advise(NEARER));
            }
            let climb = points[i].h.map_or(0.0, |h| h - self.h);
            let length = self.path_length(distance - lead, climb, ramp_s);
            self.straight(Length::Distance(length), climb, ramp_s)?;
        }
        Ok(())
    }

    /// Latitude and longitude of a waypoint (rad).
    fn target(&self, point: &Waypoint) -> Result<[f64; 2], Problem> {
        let start = &self.profile.start;
        let [lat, lon, _] = match point.place {
            HorizontalPosition::Geodetic { lat, lon } => [lat, lon, start.h],
            HorizontalPosition::Local { north, east } => {
                let by_n = DVec3::new(north, east, 0.0);
                moved([start.lat, start.lon, start.h], by_n)
            }
        };
        let finite = lon.is_finite() && point.h.is_none_or(f64::is_finite);
        domain(
            "points",
            "a list of points within ±89.9°",
            finite && lat.abs() <= crate::earth::MAX_LATITUDE,
        )?;
        Ok([lat, lon])
    }

    /// Heading (rad) and length (m) of the loxodrome between two places, by the middle latitude: exact to
    /// the third order in distance over Earth radius (1 mm at 10 km).
    fn course(&self, from: [f64; 2], to: [f64; 2]) -> (f64, f64) {
        let middle = 0.5 * (from[0] + to[0]);
        let r = radii(middle.sin());
        let north = (to[0] - from[0]) * (r.meridian + self.h);
        let east = wrap_angle(to[1] - from[1]) * (r.transverse + self.h) * middle.cos();
        (east.atan2(north), north.hypot(east))
    }

    /// Length of the path (m) that covers a horizontal distance while it climbs.
    fn path_length(&self, distance: f64, climb: f64, ramp_s: f64) -> f64 {
        let mut length = distance.hypot(climb);
        for _ in 0..50 {
            let duration = length / self.speed;
            let piece = self.piece([duration, ramp_s], 0.0, 0.0, climb);
            if piece.steepest() > MAX_SLOPE.sin() {
                break; // refused when the path is to take it
            }
            // The horizontal distance grows almost as the path does: the iteration contracts unless the slope
            // nears its limit.
            let correction = distance - duration * mean(|x| piece.at(x).horizontal);
            length += correction;
            if correction.abs() < 1e-9 * distance {
                break;
            }
        }
        length
    }

    /// A turn that cuts a corner: length of the straight line from its begin to its end, which goes in the direction of half
    /// the turn, and length from its begin to the corner and from there to its end (m).
    fn corner(&self, angle: f64, by: Turning, ramp_s: f64) -> Result<[f64; 2], Problem> {
        let duration = self.turn_duration(angle, by, ramp_s)?;
        let piece = self.piece([duration, ramp_s], 0.0, angle, 0.0);
        let half = self.heading + 0.5 * angle;
        // By symmetry the path of a turn ends in the direction of half its angle; only the part of the
        // velocity along it counts.
        let chord = self.speed * duration * mean(|x| (piece.at(x).heading - half).cos());
        // Chord and both leads are an isosceles triangle with the angle of the turn outside at the corner.
        Ok([chord, 0.5 * chord / (0.5 * angle).cos()])
    }

    /// Distance before the corner at `target` at which the turn to `next` begins (m).
    fn lead(
        &self,
        target: [f64; 2],
        next: [f64; 2],
        by: Turning,
        ramp_s: f64,
        number: usize,
    ) -> Result<f64, Problem> {
        let angle = wrap_angle(self.course(target, next).0 - self.heading);
        if angle.abs() > MAX_CORNER {
            let angle_deg = angle.abs() / DEG;
            let text =
                format!("turns back by {angle_deg:.0}° at waypoint {number}: more than 150°");
            return Err(Problem::new("points", text).advise("turn back over two points"));
        }
        if angle.abs() < 1e-9 {
            Ok(0.0)
        } else {
            Ok(self.corner(angle, by, ramp_s)?[1])
        }
    }

    /// Turns so that the heading after the turn points from there to the target: secant steps on the angle.
    fn turn_towards(
        &mut self,
        target: [f64; 2],
        by: Turning,
        ramp_s: f64,
        number: usize,
    ) -> Result<(), Problem> {
        let mut angle = wrap_angle(self.course([self.lat, self.lon], target).0 - self.heading);
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..50 {
            if angle.abs() < 1e-9 {
                return Ok(());
            }
            let miss = self.miss(angle, target, by, ramp_s)?;
            if miss.abs() < 1e-11 {
                let duration = self.turn_duration(angle, by, ramp_s)?;
                return self.push([duration, ramp_s], 0.0, angle, 0.0);
            }
            // Turning by more leaves as much less to turn, but for the displacement during the turn.
            let slope = before.map_or(-1.0, |(a, m)| (miss - m) / (angle - a));
            before = Some((angle, miss));
            // At most a radian at once: near the turning circle the slope nearly vanishes, and a secant would
            // leap.
            angle -= (miss / slope).clamp(-1.0, 1.0);
        }
        let text = format!("has waypoint {number} inside the turning circle");
        Err(Problem::new("points", text).advise(NEARER))
    }

    /// Angle that remains to the target after a turn by `angle` (rad).
    fn miss(&self, angle: f64, target: [f64; 2], by: Turning, ramp_s: f64) -> Result<f64, Problem> {
        let [chord, _] = self.corner(angle, by, ramp_s)?;
        let (sin_psi, cos_psi) = (self.heading + 0.5 * angle).sin_cos();
        // Flat over the chord of a turn: hundreds of metres over the radius of the Earth, second order 1e-8
        // of it.
        let by_n = DVec3::new(chord * cos_psi, chord * sin_psi, 0.0);
        let [lat, lon, _] = moved([self.lat, self.lon, self.h], by_n);
        let course = self.course([lat, lon], target).0;
        Ok(wrap_angle(course - self.heading - angle))
    }
}

/// The mean of a smooth function over [0, 1], by Simpson's rule.
fn mean(f: impl Fn(f64) -> f64) -> f64 {
    let n = 200;
    let weight = |k: usize| {
        if k == 0 || k == n {
            1.0
        } else {
            2.0 + 2.0 * (k % 2) as f64
        }
    };
    (0..=n)
        .map(|k| weight(k) * f(k as f64 / n as f64))
        .sum::<f64>()
        / (3.0 * n as f64)
}

#[cfg(test)]
#[path = "profile_tests.rs"]
mod profile_tests;

#[cfg(test)]
mod piece_tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn rate_value_and_integral_are_derivatives_of_one_another() {
        for ramp in [0.05, 0.3, 0.5] {
            let s = RampShape::new(ramp);
            assert_eq!(
                (s.value(0.0), s.value(1.0), s.integral(0.0)),
                (0.0, 1.0, 0.0)
            );
            assert!(
                (s.integral(1.0) - 0.5).abs() < 1e-15 && (s.rate(0.5) - s.peak()).abs() < 1e-15
            );
            for k in 1..200 {
                let (x, step) = (f64::from(k) / 200.0, 1e-5);
                let slope = |f: &dyn Fn(f64) -> f64| (f(x + step) - f(x - step)) / (2.0 * step);
                assert!(
                    (slope(&|x| s.value(x)) - s.rate(x)).abs() < 1e-6,
                    "{ramp} {x}"
                );
                assert!(
                    (slope(&|x| s.integral(x)) - s.value(x)).abs() < 1e-9,
                    "{ramp} {x}"
                );
            }
        }
    }

    #[test]
    fn height_follows_the_path_also_from_rest() {
        let shape = RampShape::new(0.25);
        let piece = MotionPiece {
            duration: 10.0,
            shape,
            speed: [0.0, 8.0],
            heading: [0.0; 2],
            height: [100.0, 3.0],
        };
        let step = 1e-4;
        for k in 1..100 {
            let x = f64::from(k) / 100.0;
            let [before, now, after] = [x - step, x, x + step].map(|x| piece.at(x));
            let vertical = (after.h - before.h) / (2.0 * step * piece.duration);
            assert_abs_diff_eq!(now.slope.tan() * now.horizontal, vertical, epsilon = 1e-6);
        }
        assert_eq!(piece.at(0.0).slope, 0.0);
        assert!((piece.at(1.0).h - 103.0).abs() < 1e-12 && (piece.length() - 40.0).abs() < 1e-12);
    }
}
