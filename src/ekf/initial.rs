//! What the filter knows at the start, and how far the nominal start is drawn from the truth.

use crate::frames::RollPitchYaw;
use crate::units::{SettingError, require_non_negative, require_positive};
use glam::DQuat;
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the noise model becomes states of the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "WrittenStates")]
#[schemars(!try_from)]
pub enum FilterStates {
    /// 15 states: one first-order Gauss-Markov bias an axis, the reduction of the model.
    #[default]
    #[serde(rename = "15")]
    Reduced15,
    /// One state for each AR1 and random walk of each axis.
    #[serde(rename = "full")]
    Full,
}

/// As people write it: `"15"`, `15` or `"full"`.
#[derive(Deserialize)]
#[serde(untagged, expecting = "\"15\" or \"full\"")]
enum WrittenStates {
    Number(u64),
    Word(String),
}

impl TryFrom<WrittenStates> for FilterStates {
    type Error = &'static str;

    fn try_from(written: WrittenStates) -> Result<Self, Self::Error> {
        match written {
            WrittenStates::Number(15) => Ok(Self::Reduced15),
            WrittenStates::Word(word) if word == "15" => Ok(Self::Reduced15),
            WrittenStates::Word(word) if word == "full" => Ok(Self::Full),
            _ => Err("expected \"15\" or \"full\""),
        }
    }
}

/// Standard deviations of the initial state. The nominal start is drawn from them, so that the filter's
/// own covariance is true at the first epoch. The defaults are a vehicle that has just been aligned with
/// the help of GNSS: position and velocity as good as one fix of the paper's receiver, half a degree of
/// roll and pitch (a consumer accelerometer's bias of 0.09 m/s² tilts a levelling by as much), two
/// degrees of heading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InitialSettings {
    /// Position north, east, down (m).
    pub pos_sigma_m: [f64; 3],
    /// Velocity north, east, down (m/s).
    pub vel_sigma_m_s: [f64; 3],
    /// Roll, pitch, yaw (degrees).
    pub att_sigma_deg: [f64; 3],
    /// Accelerometer bias (m/s²); without it, the stationary deviation of the model's AR1 processes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_bias_sigma_m_s2: Option<f64>,
    /// Gyroscope bias (rad/s); without it, the stationary deviation of the model's AR1 processes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_bias_sigma_rad_s: Option<f64>,
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
            perfect: false,
        }
    }
}

impl InitialSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused.
    pub fn validate(&self) -> Result<(), SettingError> {
        require_positive("pos_sigma_m", &self.pos_sigma_m)?;
        require_positive("vel_sigma_m_s", &self.vel_sigma_m_s)?;
        require_positive("att_sigma_deg", &self.att_sigma_deg)?;
        if let Some(large) = self.att_sigma_deg.iter().find(|s| **s > 30.0) {
            let requirement = "the error-state filter is linear: at most 30 degrees";
            return Err(SettingError::new("att_sigma_deg", large, requirement));
        }
        require_non_negative("accel_bias_sigma_m_s2", self.accel_bias_sigma_m_s2.as_slice())?;
        require_non_negative("gyro_bias_sigma_rad_s", self.gyro_bias_sigma_rad_s.as_slice())?;
        at_most("pos_sigma_m", &self.pos_sigma_m, 1e5, "m")?;
        at_most("vel_sigma_m_s", &self.vel_sigma_m_s, 1000.0, "m/s")?;
        at_most("accel_bias_sigma_m_s2", self.accel_bias_sigma_m_s2.as_slice(), 10.0, "m/s²")?;
        at_most("gyro_bias_sigma_rad_s", self.gyro_bias_sigma_rad_s.as_slice(), 1.0, "rad/s")
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
pub fn psi_of_angles(q_b_n: DQuat) -> Matrix3<f64> {
    let j = RollPitchYaw::from_quat(q_b_n).jacobian_of_psi_n();
    Matrix3::from_fn(|row, column| j[row][column]).try_inverse().unwrap_or_else(Matrix3::identity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_values_are_refused_by_key() {
        let d = InitialSettings::default();
        let cases = [
            (InitialSettings { pos_sigma_m: [0.0, 1.0, 1.0], ..d.clone() }, "pos_sigma_m"),
            (InitialSettings { vel_sigma_m_s: [1.0, -1.0, 1.0], ..d.clone() }, "vel_sigma_m_s"),
            (InitialSettings { att_sigma_deg: [1.0, 1.0, 90.0], ..d.clone() }, "att_sigma_deg"),
            (InitialSettings { gyro_bias_sigma_rad_s: Some(-1.0), ..d.clone() }, "gyro_bias_sigma_rad_s"),
        ];
        for (settings, key) in cases {
            assert_eq!(settings.validate().unwrap_err().key, key);
        }
        assert_eq!(d.validate(), Ok(()));
    }
}
