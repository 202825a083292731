//! How far a given IMU is from its limits, and what one without errors would leave.

use super::{Course, ImuParameters, Limit, Worst};
use crate::ekf::BeliefError;
use crate::noise::Model;
use crate::scenario::Scenario;

/// How an IMU stands to its limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Margins {
    /// The hardest limit.
    pub worst: Worst,
    /// The same for an IMU without errors: what GNSS and start leave.
    pub without_imu: Worst,
}

/// Correlation time of the biases of an IMU that has next to none (s): any would do.
const SLOW_S: f64 = 300.0;

impl Margins {
    /// The margins of the filter that knows the model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn of(
        course: &Course<'_>,
        scenario: &Scenario,
        model: &Model,
        limits: &[Limit],
    ) -> Result<Self, BeliefError> {
        let perfect = ImuParameters::perfect(SLOW_S).model(model.rate_hz);
        Ok(Self {
            worst: course.worst(scenario, model, limits)?,
            without_imu: course.worst(&without_imu_errors(scenario), &perfect, limits)?,
        })
    }

    /// Whether the limits are kept.
    #[must_use]
    pub fn met(&self) -> bool {
        self.worst.margin() >= 0.0
    }

    /// Whether any IMU keeps the limits.
    #[must_use]
    pub fn an_imu_helps(&self) -> bool {
        self.without_imu.margin() >= 0.0
    }
}

/// A scenario whose IMU has no constant errors, and whose filter knows it.
fn without_imu_errors(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    let (imu, initial) = (&mut scenario.imu, &mut scenario.initial);
    for sigma in [
        &mut imu.turn_on_bias_accel_m_s2,
        &mut imu.turn_on_bias_gyro_rad_s,
        &mut initial.accel_bias_sigma_m_s2,
        &mut initial.gyro_bias_sigma_rad_s,
        &mut initial.accel_scale_sigma_ppm,
        &mut initial.gyro_scale_sigma_ppm,
    ] {
        *sigma = sigma.map(|_| 0.0);
    }
    for size in [
        &mut imu.scale_ppm_accel,
        &mut imu.scale_ppm_gyro,
        &mut imu.misalignment_rad,
        &mut imu.g_sensitivity_rad_s_per_m_s2,
    ] {
        *size = 0.0;
    }
    imu.vibration
        .iter_mut()
        .for_each(|v| v.rectification_s2_m = 0.0);
    imu.temperature.iter_mut().for_each(|t| t.multiply(0.0));
    scenario
}
