//! Roll and pitch at a fix: from gravity in a static window before it, or from the specific force in motion
//! and the change of the GNSS velocity.

use super::course::Moving;
use super::{BiasSigma, between, carried};
use crate::earth::{gravity_down, radii};
use crate::ekf::Belief;
use crate::frames::{RollPitchYaw, wrap_angle};
use crate::fusion::{Levelling, Recorded, Settings};
use crate::gnss::GnssFix;
use crate::imu::{ImuIncrement, Sensor};
use glam::{DQuat, DVec3};

/// Lengths of static windows (s). A long one leaves less acceleration that GNSS does not see.
const STILL_S: [f64; 4] = [2.0, 4.0, 8.0, 16.0];
/// How long it takes from the first acceleration to a speed that GNSS shows (s).
const DEPARTURE_S: f64 = 3.0;
/// How long the gyroscopes carry a levelling on (s).
const MAX_AGE_S: f64 = 60.0;
/// Length of the window in motion (s).
const MOVING_S: f64 = 5.0;
/// Spread of specific force (m/s²) and mean angular rate (rad/s) above which nothing is static.
const STILL: (f64, f64) = (0.5, 0.03);
/// How many times the spread of the quietest window a static one may have: engines idle, roads shake more.
const QUIET: f64 = 3.0;

/// What levelling needs to know.
pub(super) struct Scene<'a> {
    recorded: Recorded<'a>,
    settings: &'a Settings,
    bias: BiasSigma,
    g: f64,
}

/// Roll and pitch at the first moving fix.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    pub(super) roll: f64,
    pub(super) pitch: f64,
    /// Standard deviation of both (rad).
    pub(super) sigma: f64,
    pub(super) from: Levelling,
}

/// Statistics of a window in the vehicle's axes.
struct Window {
    end_s: f64,
    seconds: f64,
    /// Mean specific force (m/s²) and angular rate (rad/s).
    f: DVec3,
    omega: DVec3,
    /// Standard deviation of the specific force of a sample (m/s²) and of its rate (rad/s).
    spread: (f64, f64),
}

fn window(samples: &[ImuIncrement], q_s_b: DQuat) -> Window {
    let seconds: f64 = samples.iter().map(|s| s.dt_s).sum();
    let f = samples.iter().map(|s| s.dv).sum::<DVec3>() / seconds;
    let omega = samples.iter().map(|s| s.dtheta).sum::<DVec3>() / seconds;
    let n = samples.len() as f64;
    let force = samples
        .iter()
        .map(|s| (s.dv / s.dt_s - f).length_squared())
        .sum::<f64>();
    let rate = samples
        .iter()
        .map(|s| (s.dtheta / s.dt_s - omega).length_squared())
        .sum::<f64>();
    let end_s = samples.last().map_or(f64::NAN, |s| s.t_s);
    let spread = ((force / n).sqrt(), (rate / n).sqrt());
    Window {
        end_s,
        seconds,
        f: q_s_b * f,
        omega: q_s_b * omega,
        spread,
    }
}

/// True where the specific force is spread too much for anything that stands: vibrations at rest are less.
#[must_use]
pub fn moves(imu: &[ImuIncrement]) -> bool {
    window(imu, DQuat::IDENTITY).spread.0 >= STILL.0
}

impl<'a> Scene<'a> {
    /// About a fix.
    pub(super) fn new(
        recorded: &Recorded<'a>,
        settings: &'a Settings,
        belief: &Belief,
        fix: &GnssFix,
    ) -> Self {
        let sigma = |sensor| belief.initial_bias_sigma(sensor);
        let bias = BiasSigma {
            accel: sigma(Sensor::Accel),
            gyro: sigma(Sensor::Gyro),
        };
        Self {
            recorded: *recorded,
            settings,
            bias,
            g: gravity_down(settings.gravity, fix.lat.sin(), fix.h),
        }
    }

    /// The tilt's standard deviation with the biases and a levelling of age `age_s` (rad).
    fn tilt_sigma(&self, age_s: f64, own: f64) -> f64 {
        (self.bias.accel / self.g)
            .hypot(self.bias.gyro * age_s)
            .hypot(own)
            .hypot(0.3 * crate::units::DEG)
    }

    /// Levelling in the static window that says most of the attitude at the fix, carried on by the gyroscopes.
    ///
    /// A window is judged by its own standard deviation: what GNSS lets the vehicle accelerate unseen falls with
    /// its length, the drift of the gyroscopes grows with its age.
    pub(super) fn at_rest(&self, before: &[Moving], moving: &Moving) -> Option<Level> {
        let to_s = moving.fix.t_s;
        let ends = (0..)
            .map(|k| to_s - 0.25 * f64::from(k))
            .take_while(|end| to_s - end <= MAX_AGE_S);
        let windows: Vec<Window> = ends
            .flat_map(|end| STILL_S.map(|length| self.calm(end, length)))
            .flatten()
            .collect();
        let quietest = windows
            .iter()
            .map(|w| w.spread.0)
            .fold(f64::INFINITY, f64::min);
        windows
            .iter()
            .filter(|w| w.spread.0 <= QUIET * quietest)
            .filter_map(|w| self.carried(w, before, moving))
            .min_by(|a, b| a.sigma.total_cmp(&b.sigma))
    }

    /// The window, when the IMU sees nothing happen in it.
    fn calm(&self, end_s: f64, length_s: f64) -> Option<Window> {
        let samples = between(self.recorded.imu, end_s - length_s, end_s);
        let q_s_b = self.settings.q_s_b;
        let (first, second) = samples.split_at(samples.len() / 2);
        let (whole, first, second) = (
            window(samples, q_s_b),
            window(first, q_s_b),
            window(second, q_s_b),
        );
        let (force, rate) = whole.spread;
        // constant, as gravity and biases are; the spread's share is for vibrations, which average out slowly
        let constant = first.f.distance(second.f) < 0.1 + force / 4.0
            && first.omega.distance(second.omega) < 0.01 + rate / 4.0;
        let gravity = (whole.f.length() - self.g).abs() < 0.5_f64.max(4.0 * self.bias.accel);
        let turning = whole.omega.length() > STILL.1.max(4.0 * self.bias.gyro);
        let calm =
            whole.seconds > 0.8 * length_s && force < STILL.0 && constant && gravity && !turning;
        calm.then_some(whole)
    }

    /// The levelling of a window at the time of the fix, unless GNSS contradicts its standing still.
    fn carried(&self, w: &Window, before: &[Moving], moving: &Moving) -> Option<Level> {
        let (from, departed) = (w.end_s - w.seconds, w.end_s + DEPARTURE_S);
        let age_s = moving.fix.t_s - w.end_s;
        let (q, gained) = self.carry(w, moving.fix.t_s);
        let unseen = if moving.fix.velocity.is_some() {
            let seen: Vec<&Moving> = before
                .iter()
                .filter(|m| (from..=departed).contains(&m.fix.t_s))
                .collect();
            slow(&seen)
                .then(|| std::f64::consts::SQRT_2 * seen[0].sigma() / (w.seconds * self.g))?
        } else {
            // positions alone are slow to tell rest from acceleration: what the IMU gained on the way must be
            // the speed that GNSS then shows
            let agrees = (gained.truncate().length() - moving.speed()).abs() < 3.0 * moving.sigma();
            (stays(before, from, departed) && agrees).then(|| moving.sigma() / (age_s * self.g))?
        };
        let now = RollPitchYaw::from_quat(q);
        let own = (w.spread.0 / self.g / 10.0).hypot(unseen);
        let from = Levelling::AtRest(w.end_s);
        Some(Level {
            roll: now.roll,
            pitch: now.pitch,
            sigma: self.tilt_sigma(age_s, own),
            from,
        })
    }

    /// A levelling at rest carried on with the gyroscopes: the attitude from level axes whose first is the
    /// heading of the body then, and the velocity gained in them.
    fn carry(&self, w: &Window, to_s: f64) -> (DQuat, DVec3) {
        let (roll, pitch) = level(w.f, DVec3::Z * -self.g);
        let (mut q, mut gained) = (
            RollPitchYaw {
                roll,
                pitch,
                yaw: 0.0,
            }
            .to_quat(),
            DVec3::ZERO,
        );
        for s in between(self.recorded.imu, w.end_s, to_s) {
            gained += q * (self.settings.q_s_b * s.dv) + DVec3::Z * self.g * s.dt_s;
            q = (q * DQuat::from_scaled_axis(self.settings.q_s_b * s.dtheta)).normalize();
        }
        (q, gained)
    }

    /// Levelling while it moves: the mean specific force after the fix is the change of the GNSS velocity
    /// less gravity, in the axes of this heading.
    pub(super) fn in_motion(
        &self,
        after: &[Moving],
        heading: f64,
        heading_sigma: f64,
    ) -> Option<Level> {
        let from = after.first()?;
        let near = after
            .iter()
            .take_while(|m| m.fix.t_s <= from.fix.t_s + MOVING_S)
            .count();
        // with fixes far apart, the next one
        let to = after.get(near.max(2) - 1)?;
        let (from_s, to_s) = (from.fix.t_s - from.lag_s, to.fix.t_s - to.lag_s);
        let (samples, seconds) = (between(self.recorded.imu, from_s, to_s), to_s - from_s);
        if samples.is_empty() || seconds > MAX_AGE_S / 2.0 {
            return None;
        }
        let dv = self.settings.q_s_b * carried(samples).1;
        let a_n = (to.v_n - from.v_n) / seconds;
        let (roll, pitch) = level(
            dv / seconds,
            DQuat::from_rotation_z(-heading) * (a_n - DVec3::Z * self.g),
        );
        let velocities = from.sigma().hypot(to.sigma()) / (seconds * self.g);
        let own = velocities.hypot(heading_sigma * a_n.truncate().length() / self.g);
        let sigma = self.tilt_sigma(0.5 * seconds, own);
        Some(Level {
            roll,
            pitch,
            sigma,
            from: Levelling::InMotion(seconds),
        })
    }
}

/// Whether velocities are those of rest, each and on average, as far as they are good to.
fn slow(seen: &[&Moving]) -> bool {
    let n = seen.len() as f64;
    let mean = seen
        .iter()
        .map(|m| m.v_n.truncate())
        .sum::<glam::DVec2>()
        .length()
        / n;
    let sigma = (seen.iter().map(|m| m.sigma().powi(2)).sum::<f64>()).sqrt() / n;
    let each = |m: &&Moving| m.speed() < 0.3_f64.max(4.0 * m.sigma());
    !seen.is_empty() && seen.iter().all(each) && mean < 0.2_f64.max(4.0 * sigma)
}

/// Whether the fixes in a stretch of time stay in one place, as far as they are good to: within four
/// standard deviations of the first.
fn stays(fixes: &[Moving], from: f64, to: f64) -> bool {
    let within: Vec<&GnssFix> = fixes
        .iter()
        .map(|m| &m.fix)
        .filter(|f| (from..=to).contains(&f.t_s))
        .collect();
    let Some((first, rest)) = within.split_first() else {
        return false;
    };
    let r = radii(first.lat.sin());
    let near = |f: &&GnssFix| {
        let north = (f.lat - first.lat) * (r.meridian + first.h);
        let east = wrap_angle(f.lon - first.lon) * (r.transverse + first.h) * first.lat.cos();
        let sigma = f
            .pos_sigma_n
            .truncate()
            .length()
            .hypot(first.pos_sigma_n.truncate().length());
        north.hypot(east) < 0.5_f64.max(4.0 / std::f64::consts::SQRT_2 * sigma)
    };
    rest.len() >= 2 && rest.iter().all(near)
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
                let f_b = RollPitchYaw {
                    roll,
                    pitch,
                    yaw: 0.0,
                }
                .to_quat()
                .inverse()
                    * f_h;
                let (r, p) = level(f_b, f_h);
                assert!(
                    (r - roll).abs() < 1e-12 && (p - pitch).abs() < 1e-12,
                    "{roll} {pitch}: {r} {p}"
                );
            }
        }
    }
}
