//! Proof that truth and navigation agree: the noise-free samples of a trajectory, mechanised from its exact
//! start, return to the trajectory. The difference is the error of the strapdown algorithm at that rate.

use crate::earth::{GravityModel, MAX_LATITUDE, ned_difference};
use crate::frames::NavState;
use crate::lanes::{Lanes, Vec3};
use crate::linalg::larger;
use crate::strapdown::{self, Strapdown};
use crate::trajectory::Trajectory;
use crate::trajectory::ideal_imu::ideal_imu;
use crate::units::Refused;

/// Difference between the mechanised samples and the trajectory.
#[derive(Debug, Clone, Copy, Default, serde::Serialize)]
pub struct Closure {
    /// IMU rate (Hz).
    pub rate_hz: f64,
    /// Time mechanised (s).
    pub duration_s: f64,
    /// Largest distance (m).
    pub position_m: f64,
    /// Largest horizontal distance (m).
    pub horizontal_m: f64,
    /// Largest difference of velocity (m/s).
    pub velocity_m_s: f64,
    /// Largest angle between the attitudes (rad).
    pub attitude_rad: f64,
}

/// Bounds on a closure.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct Bounds {
    /// Distance (m).
    pub position_m: f64,
    /// Velocity (m/s).
    pub velocity_m_s: f64,
    /// Angle (rad).
    pub attitude_rad: f64,
}

impl Default for Bounds {
    /// 15 cm, 1 mm/s, 1 µrad: beside metres of GNSS and inertial error, nothing. Smooth driving for 900 s at
    /// 100 Hz stays far below; shaken at 1–2 Hz the position comes to 1.4 cm.
    fn default() -> Self {
        Self {
            position_m: 0.15,
            velocity_m_s: 1e-3,
            attitude_rad: 1e-6,
        }
    }
}

impl Closure {
    /// Mechanises the ideal samples of a trajectory.
    ///
    /// # Errors
    /// An impossible rate, a rotation too fast for it, a pole.
    pub fn new(
        trajectory: &Trajectory,
        rate_hz: f64,
        gravity: GravityModel,
    ) -> Result<Self, Refused> {
        let samples = ideal_imu(trajectory, rate_hz, gravity)?;
        let dt = 1.0 / rate_hz;
        let mut ins = Strapdown::new(&trajectory.state(trajectory.start_s()), gravity);
        let duration_s = samples.len() as f64 / rate_hz;
        let mut closure = Self {
            rate_hz,
            duration_s,
            ..Self::default()
        };
        // The mean over an interval leads to its end: sample k is compared at t_{k+1}.
        for (k, sample) in samples.iter().enumerate() {
            let t_s = trajectory.start_s() + (k + 1) as f64 / rate_hz;
            let dtheta = sample.omega_ib_b * dt;
            if dtheta.length() > strapdown::MAX_ROTATION {
                let angle_deg = dtheta.length() / crate::units::DEG;
                return Err(Refused(format!(
                    "the vehicle turns {angle_deg:.0}° within one sample at {t_s} s: the rate is too low"
                )));
            }
            ins.step(Vec3::splat(dtheta), Vec3::splat(sample.f_ib_b * dt), dt);
            let truth = trajectory.state(t_s);
            if truth.lat.abs() > MAX_LATITUDE {
                return Err(Refused(format!(
                    "the trajectory comes within 0.1° of a pole at {t_s} s"
                )));
            }
            closure.widen(&truth, &ins.lane(0));
            damp(&mut ins, &truth, dt);
        }
        Ok(closure)
    }

    fn widen(&mut self, truth: &NavState, found: &NavState) {
        let apart = ned_difference(truth.place(), found.place());
        // 2 sin(θ/2) for θ: the bound is 1 µrad, and the vector part keeps digits there that 2 acos(w) would
        // lose.
        let turned = 2.0 * (truth.q_b_n.conjugate() * found.q_b_n).xyz().length();
        self.position_m = larger(self.position_m, apart.length());
        self.horizontal_m = larger(self.horizontal_m, apart.truncate().length());
        self.velocity_m_s = larger(self.velocity_m_s, (found.v_n - truth.v_n).length());
        self.attitude_rad = larger(self.attitude_rad, turned);
    }

    /// Returns true if it is within the bounds; values that are not finite are not.
    pub fn within(&self, bounds: &Bounds) -> bool {
        self.position_m <= bounds.position_m
            && self.velocity_m_s <= bounds.velocity_m_s
            && self.attitude_rad <= bounds.attitude_rad
    }
}

/// Time constant at which height and vertical velocity return to the reference (s). Left alone their errors grow by e in 400 s,
/// since gravity falls with height ([Groves](crate::bibliography::Groves13), sec. 5.7.2), rounding as much as any: after two
/// hours that is no property of the trajectory. A minute is short beside it, and long beside what a vehicle does.
const VERTICAL_S: f64 = 60.0;

/// Takes the error of the vertical channel back over one sample of `dt` seconds.
fn damp(ins: &mut Strapdown, truth: &NavState, dt: f64) {
    let kept = (-dt / VERTICAL_S).exp();
    ins.h = Lanes::splat(truth.h + kept * (ins.h[0] - truth.h));
    ins.v_n[2] = Lanes::splat(truth.v_n.z + kept * (ins.v_n[2][0] - truth.v_n.z));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    /// Ten hours of a car at 10 Hz: rounding alone would have left the ground by e^90.
    #[test]
    fn ten_hours_close() {
        let cycle = "{ kind = 'accelerate', to_speed_m_s = 15, duration_s = 20 },
            { kind = 'straight', duration_s = 820 },
            { kind = 'turn', angle_deg = 86, duration_s = 20 },
            { kind = 'accelerate', to_speed_m_s = 8, duration_s = 20 },
            { kind = 'turn', angle_deg = -80, duration_s = 20 },";
        let drive = crate::tests::drive(0.0, &cycle.repeat(40));
        let closure = Closure::new(&drive, 10.0, GravityModel::default()).unwrap();
        assert!(
            closure.duration_s >= 36_000.0 && closure.within(&Bounds::default()),
            "{closure:?}"
        );
    }

    /// A navigation that became NaN, at any epoch, is the largest error there is.
    #[test]
    fn what_is_not_finite_is_never_within_bounds() {
        let state = crate::tests::state([0.0; 3]);
        let lost = NavState {
            h: f64::NAN,
            v_n: DVec3::NAN,
            q_b_n: DQuat::NAN,
            ..state
        };
        let mut closure = Closure {
            rate_hz: 100.0,
            duration_s: 1.0,
            position_m: 0.0,
            horizontal_m: 0.0,
            velocity_m_s: 0.0,
            attitude_rad: 0.0,
        };
        closure.widen(&state, &state);
        assert!(closure.within(&Bounds::default()));
        closure.widen(&state, &lost);
        closure.widen(&state, &state);
        assert!(
            closure.position_m.is_nan()
                && closure.velocity_m_s.is_nan()
                && closure.attitude_rad.is_nan()
        );
        assert!(!closure.within(&Bounds::default()));
        assert!(!closure.within(&Bounds {
            position_m: f64::INFINITY,
            velocity_m_s: 1.0,
            attitude_rad: 1.0
        }));
    }
}
