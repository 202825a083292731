//! How an IMU puts its samples out: within a range, in steps.

use super::at_most;
use crate::imu::Sensor;
use crate::units::{NonNegative, Positive, SettingError, require_positive};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Least range of an accelerometer (m/s²): less than it is full at rest.
const LEAST_RANGE_M_S2: f64 = 10.0;
/// Largest steps (m/s², rad/s): 0.1 g and 6 °/s.
const MAX_STEPS: [f64; 2] = [1.0, 0.1];

/// `[imu.output]`: range and resolution of its samples. Only runs have them: what they do depends on what is drawn.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Largest magnitude of an accelerometer's sample (m/s²), above that of gravity: ±8 g are 78.5; without it, any.
    #[schemars(range(min = LEAST_RANGE_M_S2))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_accel_m_s2: Option<f64>,
    /// Largest magnitude of a gyroscope's sample (rad/s); without it, any.
    #[schemars(with = "Option<Positive>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_gyro_rad_s: Option<f64>,
    /// Step of an accelerometer's samples (m/s²); 0: none.
    #[schemars(with = "NonNegative", range(max = MAX_STEPS[0]))]
    pub resolution_accel_m_s2: f64,
    /// Step of a gyroscope's samples (rad/s); 0: none.
    #[schemars(with = "NonNegative", range(max = MAX_STEPS[1]))]
    pub resolution_gyro_rad_s: f64,
}

impl Output {
    pub(super) fn validate(&self) -> Result<(), SettingError> {
        let ranges = [
            ("range_accel_m_s2", self.range_accel_m_s2),
            ("range_gyro_rad_s", self.range_gyro_rad_s),
        ];
        ranges
            .iter()
            .try_for_each(|(key, range)| require_positive(key, range.as_slice()))?;
        if let Some(range) = self
            .range_accel_m_s2
            .filter(|range| *range < LEAST_RANGE_M_S2)
        {
            let requirement = format!(
                "at least {LEAST_RANGE_M_S2} m/s²: gravity is in every sample (g named m/s²?)"
            );
            return Err(SettingError::new("range_accel_m_s2", range, requirement));
        }
        at_most(
            "resolution_accel_m_s2",
            self.resolution_accel_m_s2,
            MAX_STEPS[0],
            "mg named m/s²?",
        )?;
        at_most(
            "resolution_gyro_rad_s",
            self.resolution_gyro_rad_s,
            MAX_STEPS[1],
            "degrees named radians?",
        )
    }

    /// Range and resolution of a sensor (m/s² or rad/s).
    fn of(&self, sensor: Sensor) -> (Option<f64>, f64) {
        match sensor {
            Sensor::Accel => (self.range_accel_m_s2, self.resolution_accel_m_s2),
            Sensor::Gyro => (self.range_gyro_rad_s, self.resolution_gyro_rad_s),
        }
    }

    /// What a sensor puts out for what it measures (m/s² or rad/s).
    pub(crate) fn put(&self, sensor: Sensor, value: DVec3) -> DVec3 {
        let (range, step) = self.of(sensor);
        let within = range.map_or(value, |range| {
            value.clamp(DVec3::splat(-range), DVec3::splat(range))
        });
        // A step too small for the division leaves the sample as it is.
        let steps = within / step;
        if steps.is_finite() {
            steps.round() * step
        } else {
            within
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_whole_steps_within_the_range() {
        let output = Output {
            range_accel_m_s2: Some(2.0),
            resolution_accel_m_s2: 0.5,
            resolution_gyro_rad_s: f64::MIN_POSITIVE,
            ..Output::default()
        };
        let put = |value| output.put(Sensor::Accel, value);
        assert_eq!(
            put(DVec3::new(-7.0, -0.8, 0.2)),
            DVec3::new(-2.0, -1.0, 0.0)
        );
        assert_eq!(put(DVec3::new(0.3, 3.0, 1.1)), DVec3::new(0.5, 2.0, 1.0));
        assert_eq!(
            output.put(Sensor::Gyro, DVec3::splat(300.0)),
            DVec3::splat(300.0)
        );
    }
}
