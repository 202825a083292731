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
        "no fix within the IMU recording moves at {MIN_SPEED} m/s or more (the fastest: {fastest:.2} m/s): \
         its course would be no heading"
    )]
    NoCourse {
        /// Fastest fix (m/s).
        fastest: f64,
    },
    /// No specific force to level with.
    #[error("no IMU samples after the first moving fix at {t_s} s to level with")]
    NoSamples {
        /// The fix (s).
        t_s: f64,
    },
}

/// A fix with its velocity, and the standard deviation of its horizontal part (m/s).
#[derive(Debug, Clone, Copy)]
struct Moving {
    fix: GnssFix,
    v_n: DVec3,
    sigma: f64,
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
    let speed = |m: &Moving| m.v_n.truncate().length();
    let found = inside.iter().position(|m| speed(m) >= MIN_SPEED.max(5.0 * m.sigma));
    let Some(at) = found else {
        return Err(AlignmentError::NoCourse { fastest: inside.iter().map(speed).fold(0.0, f64::max) });
    };
    let moving = inside[at];
    let g = gravity_down(settings.gravity, moving.fix.lat.sin(), moving.fix.h);
    let level = still(recorded, settings, &inside[..at], moving.fix.t_s, g)
        .map_or_else(|| in_motion(recorded, settings, &inside[at..], g), Ok)?;
    Ok(start(&moving, &level, settings, bias, g))
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

fn start(moving: &Moving, level: &Level, settings: &Settings, bias: BiasSigma, g: f64) -> Start {
    let (fix, v_n) = (moving.fix, moving.v_n);
    let speed = v_n.truncate().length();
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
    let heading = (moving.sigma / speed).hypot(SLIP);
    let degrees = |angle: f64| (angle / DEG).min(30.0);
    let vel_sigma = fix.velocity.map_or(DVec3::splat(moving.sigma), |(_, sigma)| sigma);
    let sigma = InitialSettings {
        pos_sigma_m: fix.pos_sigma_n.to_array(),
        vel_sigma_m_s: vel_sigma.to_array(),
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

/// Velocities as measured, or from the position of the fix before.
fn velocities(gnss: &[GnssFix]) -> Vec<Moving> {
    let pairs = gnss.iter().zip(std::iter::once(None).chain(gnss.iter().map(Some)));
    let of = |(fix, before): (&GnssFix, Option<&GnssFix>)| {
        if let Some((v_n, sigma)) = fix.velocity {
            return Some(Moving { fix: *fix, v_n, sigma: sigma.truncate().max_element() });
        }
        let before = before?;
        let (r, dt) = (radii(fix.lat.sin()), fix.t_s - before.t_s);
        let dlon = wrap_angle(fix.lon - before.lon);
        let north = (fix.lat - before.lat) * (r.meridian + fix.h);
        let east = dlon * (r.transverse + fix.h) * fix.lat.cos();
        let variance = fix.pos_sigma_n.powf(2.0) + before.pos_sigma_n.powf(2.0);
        let sigma = variance.truncate().max_element().sqrt() / dt;
        Some(Moving { fix: *fix, v_n: DVec3::new(north, east, before.h - fix.h) / dt, sigma })
    };
    pairs.filter_map(of).collect()
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
    to_s: f64,
    g: f64,
) -> Option<Level> {
    let slow = |t: f64| {
        let near = before.iter().min_by(|a, b| (a.fix.t_s - t).abs().total_cmp(&(b.fix.t_s - t).abs()));
        near.is_some_and(|m| m.v_n.truncate().length() < 0.3_f64.max(3.0 * m.sigma))
    };
    let steps = (0..).map(|k| to_s - 0.25 * f64::from(k)).take_while(|end| to_s - end <= MAX_AGE_S);
    let window = |end: f64| {
        let samples = between(recorded.imu, end - STILL_S, end);
        let seconds: f64 = samples.iter().map(|s| s.dt_s).sum();
        let stands = [end - STILL_S, end, end + DEPARTURE_S].into_iter().all(slow);
        (seconds > 0.8 * STILL_S && stands).then(|| (end, mean(samples, settings.q_s_b)))
    };
    let calm = |(_, (f, spread, omega)): &(f64, (DVec3, f64, f64))| {
        *spread < STILL.0 && *omega < STILL.1 && (f.length() - g).abs() < 0.5
    };
    let (end, (f, spread, _)) = steps.filter_map(window).find(calm)?;
    let (roll, pitch) = level(f, DVec3::Z * -g);
    // from the level frame of heading 0 to the body, and what the vehicle gained in speed on the way
    let mut q = RollPitchYaw { roll, pitch, yaw: 0.0 }.to_quat();
    let mut gained = 0.0;
    for s in between(recorded.imu, end, to_s) {
        gained += (settings.q_s_b * s.dv).x + (q.inverse() * DVec3::Z).x * g * s.dt_s;
        q = (q * DQuat::from_scaled_axis(settings.q_s_b * s.dtheta)).normalize();
    }
    let now = RollPitchYaw::from_quat(q);
    Some(Level {
        roll: now.roll,
        pitch: now.pitch,
        reversed: gained < -0.5 * MIN_SPEED && to_s - end < 20.0,
        age_s: to_s - end,
        sigma: spread / g / 10.0,
        how: format!("from levelling at rest until {end:.2} s, carried on by the gyroscopes"),
    })
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
        sigma: from.sigma.hypot(to.sigma) / (seconds * g),
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
