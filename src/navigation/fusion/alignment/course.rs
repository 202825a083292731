//! The course of the vehicle from GNSS: velocities as measured, or from positions a second or more apart.

use super::between;
use crate::earth::radii;
use crate::frames::wrap_angle;
use crate::gnss::GnssFix;
use crate::imu::ImuIncrement;
use crate::units::DEG;
use glam::DVec3;

/// How far the axis of a vehicle may be from its course on a straight road (rad): slip, mounting.
const SLIP: f64 = 2.0 * DEG;
/// Distance from the axle that does not steer to the IMU (m): in a turn the course there leaves the axis.
const AXLE_M: f64 = 2.0;
/// Slowest course that is taken as a heading, and how many of its standard deviations: of what goes fast at times, as road
/// vehicles do, and of what never does, as people, carts and small robots.
const FAST: (f64, f64) = (3.0, 5.0);
pub(super) const SLOW: (f64, f64) = (0.5, 10.0);
/// What sways to the side at a walk (m/s).
const SWAY: f64 = 0.15;
/// Shortest time from one position to another that gives a velocity, and the longest (s).
const BASELINE_S: (f64, f64) = (1.0, 3.0);
/// What a vehicle may accelerate between two positions, of which their mean velocity says nothing (m/s²).
const ACCELERATION: f64 = 2.0;

/// How a drive goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fusion) enum Pace {
    Fast,
    Slow,
}

impl Pace {
    /// The speed from which a course is a heading, where velocities are known as well as `sigma` (m/s).
    pub(in crate::fusion) fn needed(self, sigma: f64) -> f64 {
        let (least, sigmas) = if self == Self::Fast { FAST } else { SLOW };
        least.max(sigmas * sigma)
    }

    /// How far the axis is from the course at such a speed (rad).
    pub(in crate::fusion) fn slip(self, speed: f64) -> f64 {
        if self == Self::Fast {
            SLIP
        } else {
            SLIP.hypot(SWAY / speed)
        }
    }
}

/// A fix with its velocity and the standard deviations of it (m/s).
#[derive(Debug, Clone, Copy)]
pub(in crate::fusion) struct Moving {
    pub(in crate::fusion) fix: GnssFix,
    pub(in crate::fusion) v_n: DVec3,
    pub(in crate::fusion) sigma_n: DVec3,
    /// Half the time between the two positions it comes from: it is as old as that (s); 0 as measured.
    pub(in crate::fusion) lag_s: f64,
    pub(in crate::fusion) pace: Pace,
}

impl Moving {
    pub(in crate::fusion) fn speed(&self) -> f64 {
        self.v_n.truncate().length()
    }

    pub(in crate::fusion) fn sigma(&self) -> f64 {
        self.sigma_n.truncate().max_element()
    }

    /// The speed from which the course of this fix is a heading (m/s).
    pub(in crate::fusion) fn needed(&self) -> f64 {
        self.pace.needed(self.sigma())
    }

    /// The direction in which it moves (rad from north).
    pub(in crate::fusion) fn course(&self) -> f64 {
        self.v_n.y.atan2(self.v_n.x)
    }

    /// Standard deviation of the vehicle's axis about the course (rad).
    pub(super) fn heading_sigma(&self, imu: &[ImuIncrement]) -> f64 {
        let sum =
            |samples: &[ImuIncrement]| samples.iter().map(|s| s.dtheta).sum::<DVec3>().length();
        let turned = sum(between(imu, self.fix.t_s - self.lag_s, self.fix.t_s));
        // the angular rate over a second around the fix
        let around = between(imu, self.fix.t_s - 0.5, self.fix.t_s + 0.5);
        let seconds: f64 = around.iter().map(|s| s.dt_s).sum();
        let rate = if seconds > 0.0 {
            sum(around) / seconds
        } else {
            0.0
        };
        // the first fast fix is one whose error makes it fast: the vehicle moves more slowly than it says
        let speed = self.speed() - 1.5 * self.sigma();
        (self.sigma() / speed)
            .hypot(self.pace.slip(speed))
            .hypot(turned)
            .hypot(rate * AXLE_M / speed)
    }
}

/// The velocities within the IMU recording.
pub(in crate::fusion) fn courses(gnss: &[GnssFix], imu: &[ImuIncrement]) -> Vec<Moving> {
    let first = imu.first().map_or(f64::INFINITY, |s| s.t_s - s.dt_s);
    let last = imu.last().map_or(f64::NEG_INFINITY, |s| s.t_s);
    let inside = |m: &Moving| m.fix.t_s >= first && m.fix.t_s < last;
    let velocity = |(i, fix): (usize, &GnssFix)| match fix.velocity {
        Some(velocity) => Some(Moving {
            fix: *fix,
            v_n: velocity.v_n(),
            sigma_n: velocity.sigma_n(),
            lag_s: 0.0,
            pace: Pace::Fast,
        }),
        None => {
            let earlier = gnss[..i].partition_point(|f| f.t_s <= fix.t_s - BASELINE_S.0 + 1e-6);
            derived(&gnss[earlier.checked_sub(1)?], fix)
        }
    };
    let mut all: Vec<Moving> = gnss
        .iter()
        .enumerate()
        .filter_map(velocity)
        .filter(inside)
        .collect();
    if first_fast(&all, f64::NEG_INFINITY).is_none() {
        all.iter_mut().for_each(|moving| moving.pace = Pace::Slow);
    }
    all
}

/// Fixes one after the other that are at least `apart_s` apart, with when their velocities were (s).
pub(in crate::fusion) fn steps(courses: &[Moving], apart_s: f64) -> Vec<[(&Moving, f64); 2]> {
    let when = |m: &Moving| m.fix.t_s - m.lag_s;
    let mut all = Vec::new();
    let mut first = 0;
    while let Some(from) = courses.get(first) {
        let later = courses[first..].partition_point(|m| when(m) < when(from) + apart_s);
        // twice at the same time, by files that a clock sets back
        let next = first + later.max(1);
        let Some(to) = courses.get(next) else { break };
        all.push([(from, when(from)), (to, when(to))]);
        first = next;
    }
    all
}

/// The first fix from `from_s` on whose course is a heading. One fix alone may be an outlier, and among
/// thousands at rest one is five standard deviations off: the next must move as well.
pub(super) fn first_fast(courses: &[Moving], from_s: f64) -> Option<usize> {
    let fast = |i: usize| {
        let supported = courses
            .get(i + 1)
            .is_none_or(|next| next.speed() >= 0.6 * next.needed());
        courses[i].fix.t_s >= from_s && courses[i].speed() >= courses[i].needed() && supported
    };
    (0..courses.len()).find(|i| fast(*i))
}

/// The fix that comes nearest to moving fast enough: when (s), its speed and standard deviation (m/s).
pub(super) fn nearest_to_fast(courses: &[Moving]) -> Option<(f64, f64, f64)> {
    let share = |m: &Moving| m.speed() / m.needed();
    let nearest = courses
        .iter()
        .max_by(|a, b| share(a).total_cmp(&share(b)))?;
    Some((nearest.fix.t_s, nearest.speed(), nearest.sigma()))
}

/// The mean velocity between two fixes; none where they are too far apart in time.
fn derived(before: &GnssFix, fix: &GnssFix) -> Option<Moving> {
    let (r, dt) = (radii(fix.lat.sin()), fix.t_s - before.t_s);
    if dt > BASELINE_S.1 {
        return None;
    }
    let north = (fix.lat - before.lat) * (r.meridian + fix.h);
    let east = wrap_angle(fix.lon - before.lon) * (r.transverse + fix.h) * fix.lat.cos();
    let v_n = DVec3::new(north, east, before.h - fix.h) / dt;
    let lag_s = 0.5 * dt;
    let variance = (fix.pos_sigma_n.powf(2.0) + before.pos_sigma_n.powf(2.0)) / (dt * dt);
    let sigma_n = (variance + DVec3::splat((ACCELERATION * lag_s).powi(2))).powf(0.5);
    Some(Moving {
        fix: *fix,
        v_n,
        sigma_n,
        lag_s,
        pace: Pace::Fast,
    })
}
