//! Coarse alignment: where a recording that says nothing of its start begins to be navigated.
//!
//! Heading is the course of the first fix that moves fast enough. Roll and pitch come from levelling
//! ([Groves](crate::bibliography::Groves13), sec. 5.6.1) in the last static window before it, carried on
//! with the gyroscopes; where there is none, from the mean specific force while it moves and the change of
//! the GNSS velocity.

use super::{Recorded, Settings, Start};
use crate::earth::{gravity_down, radii};
use crate::ekf::InitialSettings;
use crate::frames::{NavState, RollPitchYaw, wrap_angle};
use crate::gnss::GnssFix;
use crate::imu::ImuIncrement;
use crate::units::DEG;
use glam::{DQuat, DVec3};

/// Slowest course that is taken as a heading (m/s).
pub const MIN_SPEED: f64 = 3.0;
/// How far the axis of a vehicle may be from its course (rad): slip, mounting.
const SLIP: f64 = 2.0 * DEG;
/// Length of a static window (s).
const STILL_S: f64 = 2.0;
/// How long it takes from the first acceleration to a speed that GNSS shows (s).
const DEPARTURE_S: f64 = 3.0;
/// How long the gyroscopes carry a levelling on (s).
const MAX_AGE_S: f64 = 60.0;
/// Length of the window in motion (s).
const MOVING_S: f64 = 5.0;
/// Shortest time from one position to another that gives a velocity, and the longest (s).
const BASELINE_S: (f64, f64) = (1.0, 3.0);
/// What a vehicle may accelerate between two positions, of which their mean velocity says nothing (m/s²).
const ACCELERATION: f64 = 2.0;
/// Spread of specific force (m/s²) and mean angular rate (rad/s) above which nothing is static.
const STILL: (f64, f64) = (0.5, 0.03);

/// Standard deviations of the biases, which spoil a levelling: m/s², rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasSigma {
    /// Accelerometer (m/s²).
    pub accel: f64,
    /// Gyroscope (rad/s).
    pub gyro: f64,
}

/// Why a recording cannot be aligned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AlignmentError {
    /// It never moves fast enough.
    #[error(
        "no fix within the IMU recording moves at {needed:.1} m/s or more (the fastest: {fastest:.2} m/s): \
         its course would be no heading"
    )]
    NoCourse {
        /// Fastest fix (m/s).
        fastest: f64,
        /// What its velocity needs to be a heading: five of its standard deviations (m/s).
        needed: f64,
    },
    /// No specific force to level with.
    #[error("no IMU samples after the first moving fix at {t_s} s to level with")]
    NoSamples {
        /// The fix (s).
        t_s: f64,
    },
}

/// A fix with its velocity and the standard deviations of it (m/s).
#[derive(Debug, Clone, Copy)]
struct Moving {
    fix: GnssFix,
    v_n: DVec3,
    sigma_n: DVec3,
    /// Half the time between the two positions it comes from: it is as old as that (s); 0 as measured.
    lag_s: f64,
}

impl Moving {
    fn speed(&self) -> f64 {
        self.v_n.truncate().length()
    }

    fn sigma(&self) -> f64 {
        self.sigma_n.truncate().max_element()
    }
}

/// The start of a recording.
///
/// # Errors
/// When it never moves, or there is nothing to level with.
pub fn coarse(
    recorded: &Recorded<'_>,
    settings: &Settings,
    bias: BiasSigma,
) -> Result<Start, AlignmentError> {
    let velocities = velocities(recorded.gnss);
    let first = recorded.imu.first().map_or(f64::INFINITY, |s| s.t_s - s.dt_s);
    let last = recorded.imu.last().map_or(f64::NEG_INFINITY, |s| s.t_s);
    let inside: Vec<Moving> =
        velocities.into_iter().filter(|m| m.fix.t_s >= first && m.fix.t_s < last).collect();
    let needed = |m: &Moving| MIN_SPEED.max(5.0 * m.sigma());
    let Some(at) = inside.iter().position(|m| m.speed() >= needed(m)) else {
        let fastest = inside.iter().map(Moving::speed).fold(0.0, f64::max);
        let needed = inside.iter().map(needed).fold(f64::INFINITY, f64::min);
        return Err(AlignmentError::NoCourse {
            fastest,
            needed: if needed.is_finite() { needed } else { MIN_SPEED },
        });
    };
    let moving = inside[at];
    let g = gravity_down(settings.gravity, moving.fix.lat.sin(), moving.fix.h);
    let level = still(recorded, settings, &inside[..at], &moving, g)
        .map_or_else(|| in_motion(recorded, settings, &inside[at..], g), Ok)?;
    let turned = turned(recorded, &moving);
    Ok(start(&moving, &level, settings, bias, (g, turned)))
}

/// How far the vehicle turned since the instant that its velocity is of (rad).
fn turned(recorded: &Recorded<'_>, moving: &Moving) -> f64 {
    let since = between(recorded.imu, moving.fix.t_s - moving.lag_s, moving.fix.t_s);
    since.iter().map(|s| s.dtheta).sum::<DVec3>().length()
}

/// Roll and pitch at the first moving fix.
struct Level {
    roll: f64,
    pitch: f64,
    /// Heading less course: 0, or half a turn when the vehicle went backwards.
    reversed: bool,
    /// Time the gyroscopes carried it on (s), and its own standard deviation beside the biases (rad).
    age_s: f64,
    sigma: f64,
    how: String,
}

fn start(
    moving: &Moving,
    level: &Level,
    settings: &Settings,
    bias: BiasSigma,
    (g, turned): (f64, f64),
) -> Start {
    let (fix, v_n, speed) = (moving.fix, moving.v_n, moving.speed());
    let course = v_n.y.atan2(v_n.x);
    let yaw = if level.reversed { wrap_angle(course + std::f64::consts::PI) } else { course };
    let q_b_n = RollPitchYaw { roll: level.roll, pitch: level.pitch, yaw }.to_quat();
    let arm_n = q_b_n * settings.lever_arm_b;
    let r = radii(fix.lat.sin());
    let state = NavState {
        lat: fix.lat - arm_n.x / (r.meridian + fix.h),
        lon: fix.lon - arm_n.y / ((r.transverse + fix.h) * fix.lat.cos()),
        h: fix.h + arm_n.z,
        v_n,
        q_b_n,
    };
    let tilt = (bias.accel / g).hypot(bias.gyro * level.age_s).hypot(level.sigma).hypot(0.3 * DEG);
    let heading = (moving.sigma() / speed).hypot(SLIP).hypot(turned);
    let degrees = |angle: f64| (angle / DEG).min(30.0);
    let sigma = InitialSettings {
        pos_sigma_m: fix.pos_sigma_n.to_array(),
        vel_sigma_m_s: moving.sigma_n.to_array(),
        att_sigma_deg: [degrees(tilt), degrees(tilt), degrees(heading)],
        ..InitialSettings::default()
    };
    let tilts = format!(
        "roll {:.2}°, pitch {:.2}° ± {:.2}° {}",
        level.roll / DEG,
        level.pitch / DEG,
        tilt / DEG,
        level.how
    );
    let back = if level.reversed { ", reversing" } else { "" };
    let headings = format!(
        "heading {:.1}° ± {:.1}° from the course of the fix at {} s ({speed:.1} m/s{back})",
        yaw / DEG,
        heading / DEG,
        fix.t_s
    );
    let how = vec![tilts, headings, "biases start at zero".to_owned()];
    Start { t_s: fix.t_s, state, sigma, how }
}

/// Velocities as measured, or from the position of a fix a second or more before.
fn velocities(gnss: &[GnssFix]) -> Vec<Moving> {
    let of = |(i, fix): (usize, &GnssFix)| match fix.velocity {
        Some((v_n, sigma_n)) => Some(Moving { fix: *fix, v_n, sigma_n, lag_s: 0.0 }),
        None => {
            let earlier = gnss[..i].partition_point(|f| f.t_s <= fix.t_s - BASELINE_S.0 + 1e-6);
            derived(&gnss[earlier.checked_sub(1)?], fix)
        }
    };
    gnss.iter().enumerate().filter_map(of).collect()
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
    Some(Moving { fix: *fix, v_n, sigma_n, lag_s })
}

/// Samples whose interval ends in (from, to].
fn between(imu: &[ImuIncrement], from: f64, to: f64) -> &[ImuIncrement] {
    let first = imu.partition_point(|s| s.t_s <= from + 1e-9);
    let end = imu.partition_point(|s| s.t_s <= to + 1e-9);
    &imu[first..end.max(first)]
}

/// Mean of f in the vehicle's axes, its spread, and the mean angular rate.
fn mean(samples: &[ImuIncrement], q_s_b: DQuat) -> (DVec3, f64, f64) {
    let seconds: f64 = samples.iter().map(|s| s.dt_s).sum();
    let f = samples.iter().map(|s| s.dv).sum::<DVec3>() / seconds;
    let omega = samples.iter().map(|s| s.dtheta).sum::<DVec3>() / seconds;
    let spread = samples.iter().map(|s| (s.dv / s.dt_s - f).length_squared()).sum::<f64>();
    (q_s_b * f, (spread / samples.len() as f64).sqrt(), omega.length())
}

/// Levelling in the last static window before `to_s`, carried on by the gyroscopes.
fn still(
    recorded: &Recorded<'_>,
    settings: &Settings,
    before: &[Moving],
    moving: &Moving,
    g: f64,
) -> Option<Level> {
    let (to_s, measured) = (moving.fix.t_s, moving.fix.velocity.is_some());
    let slow = |t: f64| {
        let near = before.iter().min_by(|a, b| (a.fix.t_s - t).abs().total_cmp(&(b.fix.t_s - t).abs()));
        near.is_some_and(|m| m.speed() < 0.3_f64.max(3.0 * m.sigma()))
    };
    let steps = (0..).map(|k| to_s - 0.25 * f64::from(k)).take_while(|end| to_s - end <= MAX_AGE_S);
    let window = |end: f64| {
        let samples = between(recorded.imu, end - STILL_S, end);
        let seconds: f64 = samples.iter().map(|s| s.dt_s).sum();
        let (from, to) = (end - STILL_S, end + DEPARTURE_S);
        let stands = if measured { [from, end, to].into_iter().all(slow) } else { stays(before, from, to) };
        (seconds > 0.8 * STILL_S && stands).then(|| (end, mean(samples, settings.q_s_b)))
    };
    let calm = |(_, (f, spread, omega)): &(f64, (DVec3, f64, f64))| {
        *spread < STILL.0 && *omega < STILL.1 && (f.length() - g).abs() < 0.5
    };
    let agrees = |at: &(f64, (DVec3, f64, f64))| {
        let carried = carry(recorded, settings, *at, to_s, g);
        // positions alone are slow to tell rest from acceleration: what the IMU gained on the way must be
        // the speed that GNSS then shows
        let tolerance = 3.0 * moving.sigma();
        let gained = carried.1.truncate().length();
        let plausible = measured || (gained - moving.speed()).abs() < tolerance && carried.2 > 0.0;
        plausible.then_some((at.0, at.1.1, carried))
    };
    let (end, spread, (q, _, forward)) = steps.filter_map(window).filter(calm).find_map(|at| agrees(&at))?;
    let now = RollPitchYaw::from_quat(q);
    let age_s = to_s - end;
    // the tilt that this comparison, or what stayed in place, leaves possible
    let unseen = if measured { 0.0 } else { moving.sigma() / (age_s * g) };
    Some(Level {
        roll: now.roll,
        pitch: now.pitch,
        reversed: measured && forward < -0.5 * MIN_SPEED && age_s < 20.0,
        age_s,
        sigma: (spread / g / 10.0).hypot(unseen),
        how: format!("from levelling at rest until {end:.2} s, carried on by the gyroscopes"),
    })
}

/// Whether the fixes in a stretch of time stay in one place, as far as they are good to: within four
/// standard deviations of the first.
fn stays(fixes: &[Moving], from: f64, to: f64) -> bool {
    let within: Vec<&GnssFix> =
        fixes.iter().map(|m| &m.fix).filter(|f| (from..=to).contains(&f.t_s)).collect();
    let Some((first, rest)) = within.split_first() else { return false };
    let r = radii(first.lat.sin());
    let near = |f: &&GnssFix| {
        let north = (f.lat - first.lat) * (r.meridian + first.h);
        let east = wrap_angle(f.lon - first.lon) * (r.transverse + first.h) * first.lat.cos();
        let sigma = f.pos_sigma_n.truncate().length().hypot(first.pos_sigma_n.truncate().length());
        north.hypot(east) < 0.5_f64.max(4.0 / std::f64::consts::SQRT_2 * sigma)
    };
    rest.len() >= 2 && rest.iter().all(near)
}

/// A levelling at rest carried on with the gyroscopes: the attitude from level axes whose first is the
/// heading of the body then, the velocity gained in them, and that along the vehicle (m/s).
fn carry(
    recorded: &Recorded<'_>,
    settings: &Settings,
    (end, (f, _, _)): (f64, (DVec3, f64, f64)),
    to_s: f64,
    g: f64,
) -> (DQuat, DVec3, f64) {
    let (roll, pitch) = level(f, DVec3::Z * -g);
    // from the level frame of heading 0 to the body, and what the vehicle gained in speed on the way
    let mut q = RollPitchYaw { roll, pitch, yaw: 0.0 }.to_quat();
    let (mut gained, mut forward) = (DVec3::ZERO, 0.0);
    for s in between(recorded.imu, end, to_s) {
        let gain = q * (settings.q_s_b * s.dv) + DVec3::Z * g * s.dt_s;
        gained += gain;
        forward += (q.inverse() * gain).x;
        q = (q * DQuat::from_scaled_axis(settings.q_s_b * s.dtheta)).normalize();
    }
    (q, gained, forward)
}

/// Levelling while it moves: the mean specific force after the fix is the change of the GNSS velocity
/// less gravity.
fn in_motion(
    recorded: &Recorded<'_>,
    settings: &Settings,
    after: &[Moving],
    g: f64,
) -> Result<Level, AlignmentError> {
    let from = after[0];
    let to =
        after.iter().take_while(|m| m.fix.t_s <= from.fix.t_s + MOVING_S).last().copied().unwrap_or(from);
    let samples = between(recorded.imu, from.fix.t_s, to.fix.t_s);
    let seconds = to.fix.t_s - from.fix.t_s;
    if samples.is_empty() || seconds <= 0.0 {
        return Err(AlignmentError::NoSamples { t_s: from.fix.t_s });
    }
    let (mut q, mut dv) = (DQuat::IDENTITY, DVec3::ZERO); // from the body now to the body at the start
    for s in samples {
        let half = DQuat::from_scaled_axis(settings.q_s_b * s.dtheta * 0.5);
        dv += q * half * (settings.q_s_b * s.dv);
        q = (q * half * half).normalize();
    }
    let f_n = (to.v_n - from.v_n) / seconds - DVec3::Z * g;
    let course = from.v_n.y.atan2(from.v_n.x);
    let (roll, pitch) = level(dv / seconds, DQuat::from_rotation_z(-course) * f_n);
    Ok(Level {
        roll,
        pitch,
        reversed: false,
        age_s: 0.5 * seconds,
        sigma: from.sigma().hypot(to.sigma()) / (seconds * g),
        how: format!("from accelerations over the {seconds:.1} s after it (no static window before)"),
    })
}

/// Roll and pitch that take a specific force in b to the same one in level axes of the right heading:
/// f_h = R_y(pitch) R_x(roll) f_b, upright.
fn level(f_b: DVec3, f_h: DVec3) -> (f64, f64) {
    // After the roll, y is as it is in the level axes: ρ sin(delta − roll) = f_h.y with f_z < 0.
    let (rho, delta) = (f_b.y.hypot(f_b.z), f_b.y.atan2(f_b.z));
    let roll = wrap_angle(delta - std::f64::consts::PI + (f_h.y / rho).clamp(-1.0, 1.0).asin());
    let v = DQuat::from_rotation_x(roll) * f_b;
    let pitch = (v.z * f_h.x - v.x * f_h.z).atan2(v.x * f_h.x + v.z * f_h.z);
    (roll, pitch)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The two angles that made the specific force come out again, at rest and while turning and braking.
    #[test]
    fn levelling_inverts_the_attitude() {
        for (roll, pitch) in [(0.0, 0.0), (0.3, -0.4), (-1.0, 0.7)] {
            for a_h in [DVec3::ZERO, DVec3::new(2.0, -3.0, 0.5)] {
                let f_h = a_h - DVec3::Z * 9.81;
                let f_b = RollPitchYaw { roll, pitch, yaw: 0.0 }.to_quat().inverse() * f_h;
                let (r, p) = level(f_b, f_h);
                assert!((r - roll).abs() < 1e-12 && (p - pitch).abs() < 1e-12, "{roll} {pitch}: {r} {p}");
            }
        }
    }
}
