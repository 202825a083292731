//! Motion given as commands on attitude and body velocity, as gnss-ins-sim defines it.

use super::TrajectorySample;
use super::profile::Shape;
use crate::earth::radii;
use crate::frames::RollPitchYaw;
use glam::DVec3;

/// Time between samples (s), at most.
const STEP_S: f64 = 0.02;
/// Time over which a change builds up and fades (s), if the command lasts that long.
const RAMP_S: f64 = 1.0;

/// Changes of Euler angles and body velocity within a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command {
    /// Duration (s).
    pub duration_s: f64,
    /// Changes of roll, pitch, yaw (rad).
    pub rpy: DVec3,
    /// Change of the velocity with respect to the Earth, in b (m/s).
    pub v_b: DVec3,
}

/// A start and what follows.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyMotion {
    /// Latitude, longitude (rad), height (m).
    pub start: [f64; 3],
    /// Roll, pitch, yaw at the start (rad).
    pub rpy: DVec3,
    /// Velocity with respect to the Earth at the start, in b (m/s).
    pub v_b: DVec3,
    /// What follows, in order.
    pub commands: Vec<Command>,
}

impl BodyMotion {
    /// Samples every 0.02 s. Changes are smoothed so that acceleration and angular rate are continuous; each
    /// command still reaches its end in its time.
    #[must_use]
    pub fn samples(&self) -> Vec<TrajectorySample> {
        let (mut t_s, mut place, mut rpy, mut v_b) = (0.0, self.start, self.rpy, self.v_b);
        let mut samples = vec![sample(t_s, place, rpy)];
        for command in &self.commands {
            let shape = Shape::new(RAMP_S / command.duration_s);
            // A whole number of steps in every command, so that its end is a sample; the slack keeps 1 s at
            // fifty steps.
            let n = (command.duration_s / STEP_S - 1e-9).ceil().max(1.0);
            let dt = command.duration_s / n;
            let rates = |place: [f64; 3], x: f64| {
                let share = shape.value(x);
                rates(place, rpy + command.rpy * share, v_b + command.v_b * share)
            };
            for k in 0..n as usize {
                let x = |part: f64| (k as f64 + part) / n;
                // Runge-Kutta of fourth order.
                let k1 = rates(place, x(0.0));
                let k2 = rates(moved(place, k1, 0.5 * dt), x(0.5));
                let k3 = rates(moved(place, k2, 0.5 * dt), x(0.5));
                let k4 = rates(moved(place, k3, dt), x(1.0));
                let mean: [f64; 3] =
                    std::array::from_fn(|i| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0);
                place = moved(place, mean, dt);
                let share = shape.value(x(1.0));
                samples.push(sample(
                    t_s + command.duration_s * x(1.0),
                    place,
                    rpy + command.rpy * share,
                ));
            }
            // Rounded to a nanosecond: the sum of many decimal durations stays the decimal that a user would
            // type.
            t_s = (1e9 * (t_s + command.duration_s)).round() / 1e9;
            rpy += command.rpy;
            v_b += command.v_b;
        }
        samples
    }
}

fn sample(t_s: f64, [lat, lon, h]: [f64; 3], rpy: DVec3) -> TrajectorySample {
    TrajectorySample {
        t_s,
        lat,
        lon,
        h,
        q_b_n: attitude(rpy).to_quat(),
    }
}

fn attitude(rpy: DVec3) -> RollPitchYaw {
    RollPitchYaw {
        roll: rpy.x,
        pitch: rpy.y,
        yaw: rpy.z,
    }
}

/// Rates of latitude, longitude (rad/s) and height (m/s), [Groves](crate::bibliography::Groves13) eq. 2.111.
fn rates([lat, _, h]: [f64; 3], rpy: DVec3, v_b: DVec3) -> [f64; 3] {
    let v_n = attitude(rpy).to_quat() * v_b;
    let (sin_lat, cos_lat) = lat.sin_cos();
    let r = radii(sin_lat);
    [
        v_n.x / (r.meridian + h),
        v_n.y / ((r.transverse + h) * cos_lat),
        -v_n.z,
    ]
}

fn moved(place: [f64; 3], rates: [f64; 3], dt: f64) -> [f64; 3] {
    std::array::from_fn(|i| place[i] + dt * rates[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::Trajectory;
    use crate::units::DEG;

    /// 10 s speeding up to 10 m/s, 9 s turning right by 90°, 5 s climbing (negative down) at 2 m/s.
    #[test]
    fn commands_reach_their_ends_in_their_time() {
        let command = |duration_s, yaw_deg: f64, v_b| Command {
            duration_s,
            rpy: DVec3::Z * yaw_deg * DEG,
            v_b,
        };
        let motion = BodyMotion {
            start: [-0.5, 2.0, 100.0],
            rpy: DVec3::ZERO,
            v_b: DVec3::ZERO,
            commands: vec![
                command(10.0, 0.0, DVec3::X * 10.0),
                command(9.0, 90.0, DVec3::ZERO),
                command(4.0, 0.0, DVec3::Z * -2.0),
                command(5.0, 0.0, DVec3::ZERO),
            ],
        };
        let t = Trajectory::from_samples(&motion.samples()).unwrap();
        assert_eq!(t.end_s(), 28.0);
        assert!((t.state(10.0).v_n - DVec3::X * 10.0).length() < 1e-5);
        assert!((t.state(19.0).v_n - DVec3::Y * 10.0).length() < 1e-5);
        assert!((t.state(25.0).v_n - DVec3::new(0.0, 10.0, -2.0)).length() < 1e-5);
        // 4 s of a change that is symmetric in time: half its speed in the mean; then 5 s of all of it.
        assert!(
            (t.state(28.0).h - (100.0 + 4.0 + 10.0)).abs() < 1e-6,
            "{}",
            t.state(28.0).h
        );
        assert!((RollPitchYaw::from_quat(t.state(19.0).q_b_n).yaw - 90.0 * DEG).abs() < 1e-9);
    }
}
