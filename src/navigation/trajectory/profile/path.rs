//! From segments to samples.

use super::piece::{Motion, Piece, Shape};
use super::{Acceleration, Bank, Kind, Length, Problem, Profile, Segment, Start, Turning};
use crate::earth::radii;
use crate::frames::RollPitchYaw;
use crate::trajectory::TrajectorySample;
use crate::units::{DEG, STANDARD_GRAVITY};

/// Time between samples of the path (s), at most.
const STEP_S: f64 = 0.02;
/// Steepest path (rad).
pub(super) const MAX_SLOPE: f64 = 60.0 * DEG;
/// Longest path (s): a day.
const MAX_DURATION_S: f64 = 86_400.0;

pub(super) fn domain(key: &'static str, domain: &'static str, holds: bool) -> Result<(), Problem> {
    if holds {
        Ok(())
    } else {
        Err(Problem::Domain { key, domain })
    }
}

pub(super) fn positive(key: &'static str, value: f64) -> Result<(), Problem> {
    domain(key, "a finite number > 0", value.is_finite() && value > 0.0)
}

/// The path so far.
pub(super) struct Path<'a> {
    pub(super) profile: &'a Profile,
    pub(super) t_s: f64,
    pub(super) lat: f64,
    pub(super) lon: f64,
    pub(super) h: f64,
    pub(super) heading: f64,
    pub(super) speed: f64,
    pub(super) samples: Vec<TrajectorySample>,
}

impl<'a> Path<'a> {
    pub(super) fn new(profile: &'a Profile) -> Self {
        let Start {
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
        let still = Motion {
            horizontal: speed,
            heading,
            heading_rate: 0.0,
            slope: 0.0,
            h,
        };
        path.sample(t_s, &still);
        path
    }

    pub(super) fn follow(&mut self, segment: &Segment) -> Result<(), Problem> {
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

    pub(super) fn straight(
        &mut self,
        length: Length,
        climb: f64,
        ramp_s: f64,
    ) -> Result<(), Problem> {
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

    fn accelerate(
        &mut self,
        to: f64,
        by: Acceleration,
        climb: f64,
        ramp_s: f64,
    ) -> Result<(), Problem> {
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
    pub(super) fn turn_duration(
        &self,
        angle: f64,
        by: Turning,
        ramp_s: f64,
    ) -> Result<f64, Problem> {
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

    pub(super) fn moving(&self, key: &'static str) -> Result<f64, Problem> {
        if self.speed > 0.0 {
            Ok(self.speed)
        } else {
            Err(Problem::AtRest { key })
        }
    }

    /// The piece that continues the path for a duration with a ramp (s).
    pub(super) fn piece(
        &self,
        [duration, ramp_s]: [f64; 2],
        speed: f64,
        heading: f64,
        climb: f64,
    ) -> Piece {
        let shape = Shape::new(ramp_s / duration);
        let (speed, heading) = ([self.speed, speed], [self.heading, heading]);
        Piece {
            duration,
            shape,
            speed,
            heading,
            height: [self.h, climb],
        }
    }

    /// Adds a piece of the given duration and ramp (s), changing speed, heading and height.
    pub(super) fn push(
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
            return Err(Problem::TooSteep {
                climb_m: climb,
                length_m: piece.length(),
            });
        }
        let total_s = self.t_s + duration - self.profile.start.t_s;
        if total_s > MAX_DURATION_S {
            return Err(Problem::TooLong { total_s });
        }
        self.integrate(&piece);
        Ok(())
    }

    fn integrate(&mut self, piece: &Piece) {
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

    fn sample(&mut self, t_s: f64, motion: &Motion) {
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
fn rates(lat: f64, motion: &Motion) -> [f64; 2] {
    let ((sin_lat, cos_lat), (sin_psi, cos_psi)) = (lat.sin_cos(), motion.heading.sin_cos());
    let r = radii(sin_lat);
    let (north, east) = (motion.horizontal * cos_psi, motion.horizontal * sin_psi);
    [
        north / (r.meridian + motion.h),
        east / ((r.transverse + motion.h) * cos_lat),
    ]
}
