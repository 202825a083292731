//! Frames, attitude angles and the navigation state.
//!
//! n = North-East-Down at the vehicle, b = front-right-down, e = Earth-centred Earth-fixed.
//! `q_b_n` takes a vector written in b and returns it in n. Euler angles are ZYX: yaw about down, then
//! pitch, then roll ([Groves](crate::bibliography::Groves13), sec. 2.2).
//!
//! ```
//! use glam::DVec3;
//! use nav_sim_navigation::frames::RollPitchYaw;
//!
//! let heading_east = RollPitchYaw { roll: 0.0, pitch: 0.0, yaw: 90_f64.to_radians() };
//! let front_n = heading_east.to_quat() * DVec3::X;
//! assert!((front_n - DVec3::Y).length() < 1e-15);
//! ```

use glam::{DQuat, DVec3, EulerRot};

/// Position, velocity and attitude at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavState {
    /// Geodetic latitude (rad).
    pub lat: f64,
    /// Longitude (rad), in (−π, π].
    pub lon: f64,
    /// Height above the WGS-84 ellipsoid (m).
    pub h: f64,
    /// Velocity with respect to the Earth in n (m/s).
    pub v_n: DVec3,
    /// Attitude: takes b, returns n.
    pub q_b_n: DQuat,
}

impl NavState {
    /// Latitude, longitude (rad) and height (m).
    pub const fn place(&self) -> [f64; 3] {
        [self.lat, self.lon, self.h]
    }
}

/// Roll, pitch and yaw.
#[derive(Debug, Clone, Copy)]
pub struct RollPitchYaw {
    /// Roll, in (−π, π] (rad).
    pub roll: f64,
    /// Pitch, in [−π/2, π/2] (rad).
    pub pitch: f64,
    /// Yaw (heading from north), in (−π, π] (rad).
    pub yaw: f64,
}

impl RollPitchYaw {
    /// The attitude quaternion q_b_n.
    pub fn to_quat(self) -> DQuat {
        DQuat::from_euler(EulerRot::ZYX, self.yaw, self.pitch, self.roll)
    }

    /// The angles of an attitude q_b_n. At pitch = ±π/2 roll and yaw are not unique; one pair is given.
    pub fn from_quat(q_b_n: DQuat) -> Self {
        let (yaw, pitch, roll) = q_b_n.to_euler(EulerRot::ZYX);
        Self { roll, pitch, yaw }
    }

    /// The Jacobian ∂(roll, pitch, yaw)/∂psi_n, rows in that order, for C_est = (I + \[psi_n×\]) C_true.
    /// Grows as 1/cos(pitch).
    pub fn jacobian_of_psi_n(&self) -> [DVec3; 3] {
        // psi_n = roll · x_b + pitch · (−sin yaw, cos yaw, 0) + yaw · (0, 0, 1), the axes of the three turns
        // in n, solved for the angles.
        let (sy, cy) = self.yaw.sin_cos();
        let (tp, cp) = (self.pitch.tan(), self.pitch.cos());
        [
            DVec3::new(cy / cp, sy / cp, 0.0),
            DVec3::new(-sy, cy, 0.0),
            DVec3::new(cy * tp, sy * tp, 1.0),
        ]
    }
}

/// The rotation from e to n at a latitude and longitude (rad): takes e, returns n.
pub fn q_e_n(lat: f64, lon: f64) -> DQuat {
    // From n to e: a turn by the longitude about the axis of the Earth, then by −lat − 90° about the new y
    // axis, east. Asked for is its inverse.
    (DQuat::from_rotation_z(lon) * DQuat::from_rotation_y(-lat - std::f64::consts::FRAC_PI_2))
        .inverse()
}

/// Wraps an angle to (−π, π]; one that is there already comes back as it is, to the last bit.
pub fn wrap_angle(angle: f64) -> f64 {
    if angle.abs() < std::f64::consts::PI {
        return angle;
    }
    let wrapped = angle.rem_euclid(std::f64::consts::TAU);
    if wrapped > std::f64::consts::PI {
        wrapped - std::f64::consts::TAU
    } else {
        wrapped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    #[test]
    fn euler_angles_rotate_in_the_order_yaw_pitch_roll() {
        // Nose north-east and 30° up: the front axis in n is (cos45 cos30, sin45 cos30, −sin30).
        let q = RollPitchYaw {
            roll: 0.4,
            pitch: 30.0 * DEG,
            yaw: 45.0 * DEG,
        }
        .to_quat();
        let (s, c) = (45.0 * DEG).sin_cos();
        let expected = DVec3::new(c * 0.75_f64.sqrt(), s * 0.75_f64.sqrt(), -0.5);
        assert!((q * DVec3::X).abs_diff_eq(expected, 1e-15));
        let back = RollPitchYaw::from_quat(q);
        assert!((back.roll - 0.4).abs() < 1e-15 && (back.yaw - 45.0 * DEG).abs() < 1e-15);
    }

    #[test]
    fn n_axes_in_e_point_north_east_and_down() {
        let q = q_e_n(0.0, 0.0); // on the equator at Greenwich: down = −x, east = y, north = z
        assert!((q * DVec3::Z).abs_diff_eq(DVec3::X, 1e-15));
        assert!((q * DVec3::Y).abs_diff_eq(DVec3::Y, 1e-15));
        assert!((q * DVec3::X).abs_diff_eq(-DVec3::Z, 1e-15));
    }

    #[test]
    fn euler_jacobian_agrees_with_central_differences() {
        let a = RollPitchYaw {
            roll: 0.7,
            pitch: -0.9,
            yaw: 2.4,
        };
        let jacobian = a.jacobian_of_psi_n();
        let angles =
            |psi: DVec3| RollPitchYaw::from_quat(DQuat::from_scaled_axis(psi) * a.to_quat());
        for (k, axis) in DVec3::AXES.into_iter().enumerate() {
            let (p, m) = (angles(axis * 1e-6), angles(axis * -1e-6));
            for (row, (p, m)) in [(p.roll, m.roll), (p.pitch, m.pitch), (p.yaw, m.yaw)]
                .into_iter()
                .enumerate()
            {
                assert_abs_diff_eq!((p - m) / 2e-6, jacobian[row][k], epsilon = 1e-9);
            }
        }
    }
}
