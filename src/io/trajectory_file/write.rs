//! Trajectories as CSV.

use nav_sim_navigation::frames::{RollPitchYaw, wrap_angle};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::units::DEG;
use std::fmt::Write;

/// Which instants become rows.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Rows {
    /// Evenly spaced ones, from the start (Hz).
    Rate(f64),
    /// Those the trajectory was made from.
    Knots,
}

impl Rows {
    pub(crate) fn times(self, trajectory: &Trajectory) -> Vec<f64> {
        match self {
            Self::Knots => trajectory.knots().to_vec(),
            Self::Rate(rate_hz) => {
                let start_s = trajectory.start_s();
                let steps = ((trajectory.end_s() - start_s) * rate_hz + 1e-6).floor() as u64;
                (0..=steps).map(|k| start_s + k as f64 / rate_hz).collect()
            }
        }
    }
}

/// A trajectory as CSV. Positions are written with the digits that read back to them, since accelerations are their second
/// differences; times to the nanosecond, velocities to 1e-9 m/s, angles to 1e-12 degrees.
pub(crate) fn csv(trajectory: &Trajectory, rows: Rows) -> String {
    let mut text =
        "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg\n".to_owned();
    for t_s in rows.times(trajectory) {
        let state = trajectory.state(t_s);
        let (v, rpy) = (state.v_n, RollPitchYaw::from_quat(state.q_b_n));
        let [v_n, v_e, v_d] = v.to_array().map(|v| tidy(v, 9));
        let [roll, pitch, yaw] = [rpy.roll, rpy.pitch, rpy.yaw].map(|a| tidy(a / DEG, 12));
        let (lat, lon) = (state.lat / DEG + 0.0, wrap_angle(state.lon) / DEG + 0.0);
        let (t_s, h) = (tidy(t_s, 9), state.h + 0.0);
        let _ = writeln!(
            text,
            "{t_s},{lat},{lon},{h},{v_n},{v_e},{v_d},{roll},{pitch},{yaw}"
        );
    }
    text
}

/// The nearest number of so many decimals; no negative zero.
fn tidy(x: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (x * scale).round() / scale + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_tidy() {
        let shown =
            [-0.0, 0.1 + 0.2, -1e-14, 45.000_000_000_000_01].map(|x| tidy(x, 9).to_string());
        assert_eq!(shown, ["0", "0.3", "0", "45"]);
    }
}
