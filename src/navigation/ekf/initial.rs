//! What the filter knows at the start, and how far the nominal start is drawn from the truth.

use crate::frames::RollPitchYaw;
use crate::imu::Sensor;
use crate::units::{
    NonNegative, Positive, SettingError, exactly, require_non_negative, require_positive,
};
use glam::DQuat;
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Standard deviations of the initial state. The nominal start is drawn from them, so that the filter's
/// own covariance is true at the first epoch. The defaults are a vehicle that has just been aligned with
/// the help of GNSS: position and velocity as good as one fix of the paper's receiver, half a degree of
/// roll and pitch (a consumer accelerometer's bias of 0.09 m/s² tilts a levelling by as much), two
/// degrees of heading. Biases and scale factors are not drawn from here: those of the true IMU are its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InitialSettings {
    /// Position north, east, down (m).
    #[schemars(with = "[Positive; 3]", inner(range(max = 1e5)))]
    #[serde(deserialize_with = "exactly")]
    pub pos_sigma_m: [f64; 3],
    /// Velocity north, east, down (m/s).
    #[schemars(with = "[Positive; 3]", inner(range(max = 1000.0)))]
    #[serde(deserialize_with = "exactly")]
    pub vel_sigma_m_s: [f64; 3],
    /// Roll, pitch, yaw (degrees).
    #[schemars(with = "[Positive; 3]", inner(range(max = 30.0)))]
    #[serde(deserialize_with = "exactly")]
    pub att_sigma_deg: [f64; 3],
    /// Turn-on bias of the accelerometers that the filter expects beside the model's processes (m/s²): an
    /// unknown constant, one state an axis; without it, none.
    #[schemars(with = "Option<NonNegative>", range(max = 10.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_bias_sigma_m_s2: Option<f64>,
    /// Turn-on bias of the gyroscopes that the filter expects beside the model's processes (rad/s): an unknown
    /// constant, one state an axis; without it, none.
    #[schemars(with = "Option<NonNegative>", range(max = 1.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_bias_sigma_rad_s: Option<f64>,
    /// Scale-factor error of the accelerometers that the filter expects (parts per million): an unknown
    /// constant, one state an axis; without it, 300 in the filter of 21 states and none in the others.
    #[schemars(with = "Option<NonNegative>", range(max = 1e5))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_scale_sigma_ppm: Option<f64>,
    /// Scale-factor error of the gyroscopes that the filter expects (parts per million), as that of the
    /// accelerometers.
    #[schemars(with = "Option<NonNegative>", range(max = 1e5))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_scale_sigma_ppm: Option<f64>,
    /// Start exactly at the truth; the filter's covariance stays as given above.
    pub perfect: bool,
}

impl Default for InitialSettings {
    fn default() -> Self {
        Self {
            pos_sigma_m: [2.0, 2.0, 4.0],
            vel_sigma_m_s: [0.04, 0.04, 0.06],
            att_sigma_deg: [0.5, 0.5, 2.0],
            accel_bias_sigma_m_s2: None,
            gyro_bias_sigma_rad_s: None,
            accel_scale_sigma_ppm: None,
            gyro_scale_sigma_ppm: None,
            perfect: false,
        }
    }
}

impl InitialSettings {
    /// The turn-on bias that the filter expects of a sensor (m/s² or rad/s).
    #[must_use]
    pub const fn bias_sigma(&self, sensor: Sensor) -> Option<f64> {
        match sensor {
            Sensor::Accel => self.accel_bias_sigma_m_s2,
            Sensor::Gyro => self.gyro_bias_sigma_rad_s,
        }
    }

    /// The scale-factor error that the filter expects of a sensor (parts per million).
    #[must_use]
    pub const fn scale_sigma_ppm(&self, sensor: Sensor) -> Option<f64> {
        match sensor {
            Sensor::Accel => self.accel_scale_sigma_ppm,
            Sensor::Gyro => self.gyro_scale_sigma_ppm,
        }
    }

    /// The key of [`Self::bias_sigma`].
    #[must_use]
    pub const fn bias_key(sensor: Sensor) -> &'static str {
        match sensor {
            Sensor::Accel => "accel_bias_sigma_m_s2",
            Sensor::Gyro => "gyro_bias_sigma_rad_s",
        }
    }

    /// The key of [`Self::scale_sigma_ppm`].
    #[must_use]
    pub const fn scale_key(sensor: Sensor) -> &'static str {
        match sensor {
            Sensor::Accel => "accel_scale_sigma_ppm",
            Sensor::Gyro => "gyro_scale_sigma_ppm",
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused.
    pub fn validate(&self) -> Result<(), SettingError> {
        require_positive("pos_sigma_m", &self.pos_sigma_m)?;
        require_positive("vel_sigma_m_s", &self.vel_sigma_m_s)?;
        require_positive("att_sigma_deg", &self.att_sigma_deg)?;
        // At 30° the sine is 5 % off the angle and the cosine 13 % off 1: beyond, a linear filter is a
        // different problem.
        if let Some(large) = self.att_sigma_deg.iter().find(|s| **s > 30.0) {
            let requirement = "the error-state filter is linear: at most 30 degrees";
            return Err(SettingError::new("att_sigma_deg", large, requirement));
        }
        for sensor in Sensor::ALL {
            let (key, sigma) = (Self::bias_key(sensor), self.bias_sigma(sensor));
            let limit = if sensor == Sensor::Accel { 10.0 } else { 1.0 };
            require_non_negative(key, sigma.as_slice())?;
            at_most(key, sigma.as_slice(), limit, sensor.unit())?;
            let (key, ppm) = (Self::scale_key(sensor), self.scale_sigma_ppm(sensor));
            require_non_negative(key, ppm.as_slice())?;
            at_most(key, ppm.as_slice(), 1e5, "parts per million, a tenth")?;
        }
        at_most("pos_sigma_m", &self.pos_sigma_m, 1e5, "m")?;
        at_most("vel_sigma_m_s", &self.vel_sigma_m_s, 1000.0, "m/s")
    }
}

/// A deviation so large that the linear filter means nothing with it is a slip of unit.
fn at_most(key: &str, sigmas: &[f64], limit: f64, unit: &str) -> Result<(), SettingError> {
    match sigmas.iter().find(|s| **s > limit) {
        Some(large) => {
            let requirement = format!("the error-state filter is linear: at most {limit} {unit}");
            Err(SettingError::new(key, large, requirement))
        }
        None => Ok(()),
    }
}

/// The rotation vector psi_n of small roll, pitch and yaw errors at an attitude: the inverse of
/// [`RollPitchYaw::jacobian_of_psi_n`]. At pitch ±90° roll and yaw are not separate: the errors are then
/// taken about the axes of n.
#[must_use]
pub(crate) fn psi_of_angles(q_b_n: DQuat) -> Matrix3<f64> {
    // Inverted numerically: one formula for the Jacobian, in one place.
    let j = RollPitchYaw::from_quat(q_b_n).jacobian_of_psi_n();
    Matrix3::from_fn(|row, column| j[row][column])
        .try_inverse()
        .unwrap_or_else(Matrix3::identity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_values_are_refused_by_key() {
        let d = InitialSettings::default();
        let cases = [
            (
                InitialSettings {
                    pos_sigma_m: [0.0, 1.0, 1.0],
                    ..d.clone()
                },
                "pos_sigma_m",
            ),
            (
                InitialSettings {
                    vel_sigma_m_s: [1.0, -1.0, 1.0],
                    ..d.clone()
                },
                "vel_sigma_m_s",
            ),
            (
                InitialSettings {
                    att_sigma_deg: [1.0, 1.0, 90.0],
                    ..d.clone()
                },
                "att_sigma_deg",
            ),
            (
                InitialSettings {
                    gyro_bias_sigma_rad_s: Some(-1.0),
                    ..d.clone()
                },
                "gyro_bias_sigma_rad_s",
            ),
            (
                InitialSettings {
                    gyro_scale_sigma_ppm: Some(2e5),
                    ..d.clone()
                },
                "gyro_scale_sigma_ppm",
            ),
            (
                InitialSettings {
                    accel_scale_sigma_ppm: Some(-1.0),
                    ..d.clone()
                },
                "accel_scale_sigma_ppm",
            ),
        ];
        for (settings, key) in cases {
            assert_eq!(settings.validate().unwrap_err().key, key);
        }
        assert_eq!(d.validate(), Ok(()));
    }
}
