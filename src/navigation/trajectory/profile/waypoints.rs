//! Straight legs between points, corners cut by smooth turns.

use super::path::{MAX_SLOPE, Path, domain};
use super::{Length, Problem, Turning};
use crate::earth::radii;
use crate::frames::wrap_angle;
use crate::units::DEG;

/// The sharpest corner (rad): beyond it the turn would begin far before the corner.
const MAX_CORNER: f64 = 150.0 * DEG;

/// A point to pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Where.
    pub place: Place,
    /// Height above the ellipsoid (m), if it is to change.
    pub h: Option<f64>,
}

/// A horizontal position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// Latitude and longitude (rad).
    Geodetic {
        /// Geodetic latitude (rad).
        lat: f64,
        /// Longitude (rad).
        lon: f64,
    },
    /// North and east of the profile's start (m), curvilinear.
    Local {
        /// North (m).
        north: f64,
        /// East (m).
        east: f64,
    },
}

/// The geometry of a turn that cuts a corner.
struct Corner {
    /// Length of the straight line from its begin to its end (m), in the direction of half the turn.
    chord: f64,
    /// From its begin to the corner it cuts, and from there to its end (m).
    lead: f64,
}

impl Path<'_> {
    pub(super) fn waypoints(
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
                return Err(Problem::TooNear {
                    number,
                    leg_m: distance,
                    needed_m: lead,
                });
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
        let r = radii(start.lat.sin());
        let [lat, lon] = match point.place {
            Place::Geodetic { lat, lon } => [lat, lon],
            Place::Local { north, east } => [
                start.lat + north / (r.meridian + start.h),
                start.lon + east / ((r.transverse + start.h) * start.lat.cos()),
            ],
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

    fn corner(&self, angle: f64, by: Turning, ramp_s: f64) -> Result<Corner, Problem> {
        let duration = self.turn_duration(angle, by, ramp_s)?;
        let piece = self.piece([duration, ramp_s], 0.0, angle, 0.0);
        let half = self.heading + 0.5 * angle;
        // By symmetry the path of a turn ends in the direction of half its angle; only the part of the
        // velocity along it counts.
        let chord = self.speed * duration * mean(|x| (piece.at(x).heading - half).cos());
        // Chord and both leads are an isosceles triangle with the angle of the turn outside at the corner.
        Ok(Corner {
            chord,
            lead: 0.5 * chord / (0.5 * angle).cos(),
        })
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
            return Err(Problem::TurnsBack {
                number,
                angle_deg: angle.abs() / DEG,
            });
        }
        if angle.abs() < 1e-9 {
            Ok(0.0)
        } else {
            Ok(self.corner(angle, by, ramp_s)?.lead)
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
        Err(Problem::Unreachable { number })
    }

    /// What is left to turn (rad) to the target after a turn by an angle.
    fn miss(&self, angle: f64, target: [f64; 2], by: Turning, ramp_s: f64) -> Result<f64, Problem> {
        let corner = self.corner(angle, by, ramp_s)?;
        let r = radii(self.lat.sin());
        let (sin_psi, cos_psi) = (self.heading + 0.5 * angle).sin_cos();
        // Flat over the chord of a turn: hundreds of metres over the radius of the Earth, second order 1e-8
        // of it.
        let after = [
            self.lat + corner.chord * cos_psi / (r.meridian + self.h),
            self.lon + corner.chord * sin_psi / ((r.transverse + self.h) * self.lat.cos()),
        ];
        Ok(wrap_angle(
            self.course(after, target).0 - self.heading - angle,
        ))
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
