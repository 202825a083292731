//! The settings of each kind of aiding: what a filter believes, and what is true.

use crate::sensors::gnss::{MAX_LEVER_ARM_M, require_lever_arm};
use crate::units::{
    NonNegative, Positive, SettingError, exactly, require_non_negative, require_positive,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[aiding.nhc]`: lateral and vertical velocity of a point of the vehicle are zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NhcSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (m/s).
    #[schemars(with = "Positive")]
    pub sigma_m_s: f64,
    /// The point that moves neither sideways nor up, with respect to the IMU: front, right, down (m).
    #[schemars(inner(range(min = -MAX_LEVER_ARM_M, max = MAX_LEVER_ARM_M)))]
    #[serde(deserialize_with = "exactly")]
    pub lever_arm_m: [f64; 3],
    /// Pitch and yaw of the vehicle's axes in those of the IMU, as the filter expects them (1 σ, degrees): two states;
    /// 0: none.
    #[schemars(with = "NonNegative")]
    pub mounting_sigma_deg: f64,
    /// What is truly wrong with it.
    pub truth: NhcErrors,
}

/// `[aiding.nhc.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NhcErrors {
    /// White noise of one measurement (m/s); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_sigma_m_s: Option<f64>,
    /// Pitch and yaw of the vehicle's axes in those of the IMU (1 σ, degrees), constant in a run.
    #[schemars(with = "NonNegative")]
    pub mounting_sigma_deg: f64,
    /// Sideslip angle per lateral acceleration (rad s²/m), the same in every run.
    #[schemars(with = "NonNegative")]
    pub sideslip_s2_m: f64,
    /// Lateral and vertical velocity of the body on its suspension (1 σ, m/s), a Gauss-Markov process.
    #[schemars(with = "NonNegative")]
    pub walk_sigma_m_s: f64,
    /// Correlation time of that velocity (s).
    #[schemars(with = "Positive")]
    pub correlation_time_s: f64,
}

/// `[aiding.odometer]`: forward velocity of a point of the vehicle, by a wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometerSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (m/s).
    #[schemars(with = "Positive")]
    pub sigma_m_s: f64,
    /// The wheel, or the middle of its axle, with respect to the IMU: front, right, down (m).
    #[schemars(inner(range(min = -MAX_LEVER_ARM_M, max = MAX_LEVER_ARM_M)))]
    #[serde(deserialize_with = "exactly")]
    pub lever_arm_m: [f64; 3],
    /// Scale factor of the wheel, as the filter expects it (1 σ): a state; 0: none.
    #[schemars(with = "NonNegative")]
    pub scale_sigma: f64,
    /// What is truly wrong with it.
    pub truth: OdometerErrors,
}

/// `[aiding.odometer.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometerErrors {
    /// White noise of one measurement (m/s); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_sigma_m_s: Option<f64>,
    /// Scale-factor error (1 σ), constant in a run: the tyre.
    #[schemars(with = "NonNegative")]
    pub scale_sigma: f64,
    /// Slip of the wheel: share of the speed per forward acceleration (s²/m), the same in every run.
    #[schemars(with = "NonNegative")]
    pub slip_s2_m: f64,
}

/// `[aiding.zupt]`: the velocity is zero, wherever the reference stands (below 0.01 m/s and 0.01 deg/s).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZuptSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (m/s).
    #[schemars(with = "Positive")]
    pub sigma_m_s: f64,
    /// What is truly wrong with it.
    pub truth: ZuptErrors,
}

/// `[aiding.zupt.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZuptErrors {
    /// White noise of one measurement (m/s); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_sigma_m_s: Option<f64>,
    /// Forward velocity that is taken for standstill (1 σ, m/s), a Gauss-Markov process.
    #[schemars(with = "NonNegative")]
    pub walk_sigma_m_s: f64,
    /// Correlation time of that velocity (s).
    #[schemars(with = "Positive")]
    pub correlation_time_s: f64,
}

/// `[aiding.heading]`: yaw of the vehicle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeadingSettings {
    /// Measurements per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of one measurement, white, as the filter believes (degrees).
    #[schemars(with = "Positive")]
    pub sigma_deg: f64,
    /// What measures it.
    pub source: HeadingSource,
    /// What is truly wrong with it.
    pub truth: HeadingErrors,
}

/// What measures a heading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingSource {
    /// A compass, which outages of GNSS do not concern.
    #[default]
    Compass,
    /// Two antennas of GNSS: no heading in its outages.
    Antennas,
}

/// `[aiding.heading.truth]`: without it, the white noise is as the filter believes, and there is nothing else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeadingErrors {
    /// White noise of one measurement (degrees); unless given, what the filter believes.
    #[schemars(with = "Option<NonNegative>")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_sigma_deg: Option<f64>,
    /// Offset (1 σ, degrees), constant in a run.
    #[schemars(with = "NonNegative")]
    pub offset_sigma_deg: f64,
    /// Error that lasts (1 σ, degrees), a Gauss-Markov process: iron about a compass.
    #[schemars(with = "NonNegative")]
    pub walk_sigma_deg: f64,
    /// Correlation time of that error (s).
    #[schemars(with = "Positive")]
    pub correlation_time_s: f64,
}

impl Default for NhcSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            // Sideslip and suspension last: 0.1 is overconfident by a third with those of a car.
            sigma_m_s: 0.2,
            lever_arm_m: [0.0; 3],
            mounting_sigma_deg: 0.0,
            truth: NhcErrors::default(),
        }
    }
}

impl Default for NhcErrors {
    fn default() -> Self {
        Self {
            noise_sigma_m_s: None,
            mounting_sigma_deg: 0.0,
            sideslip_s2_m: 0.0,
            walk_sigma_m_s: 0.0,
            correlation_time_s: 1.0,
        }
    }
}

impl Default for OdometerSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            sigma_m_s: 0.05,
            lever_arm_m: [0.0; 3],
            scale_sigma: 0.0,
            truth: OdometerErrors::default(),
        }
    }
}

impl Default for ZuptSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            sigma_m_s: 0.02,
            truth: ZuptErrors::default(),
        }
    }
}

impl Default for ZuptErrors {
    fn default() -> Self {
        Self {
            noise_sigma_m_s: None,
            walk_sigma_m_s: 0.0,
            correlation_time_s: 10.0,
        }
    }
}

impl Default for HeadingSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            sigma_deg: 0.5,
            source: HeadingSource::default(),
            truth: HeadingErrors::default(),
        }
    }
}

impl Default for HeadingErrors {
    fn default() -> Self {
        Self {
            noise_sigma_deg: None,
            offset_sigma_deg: 0.0,
            walk_sigma_deg: 0.0,
            correlation_time_s: 60.0,
        }
    }
}

/// Standard deviations that are 0 or more, by their keys.
fn deviations(all: &[(&str, f64)]) -> Result<(), SettingError> {
    all.iter()
        .try_for_each(|(key, sigma)| require_non_negative(key, &[*sigma]))
}

impl NhcSettings {
    pub(super) fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_m_s", &[self.sigma_m_s])?;
        require_lever_arm(&self.lever_arm_m)?;
        deviations(&[("mounting_sigma_deg", self.mounting_sigma_deg)])?;
        let NhcErrors {
            noise_sigma_m_s,
            mounting_sigma_deg,
            sideslip_s2_m,
            walk_sigma_m_s,
            correlation_time_s,
        } = self.truth;
        let all = [
            ("noise_sigma_m_s", noise_sigma_m_s.unwrap_or(0.0)),
            ("mounting_sigma_deg", mounting_sigma_deg),
            ("sideslip_s2_m", sideslip_s2_m),
            ("walk_sigma_m_s", walk_sigma_m_s),
        ];
        deviations(&all)
            .and_then(|()| require_positive("correlation_time_s", &[correlation_time_s]))
            .map_err(|e| e.in_section("truth"))
    }
}

impl OdometerSettings {
    pub(super) fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_m_s", &[self.sigma_m_s])?;
        require_lever_arm(&self.lever_arm_m)?;
        deviations(&[("scale_sigma", self.scale_sigma)])?;
        let OdometerErrors {
            noise_sigma_m_s,
            scale_sigma,
            slip_s2_m,
        } = self.truth;
        let all = [
            ("noise_sigma_m_s", noise_sigma_m_s.unwrap_or(0.0)),
            ("scale_sigma", scale_sigma),
            ("slip_s2_m", slip_s2_m),
        ];
        deviations(&all).map_err(|e| e.in_section("truth"))
    }
}

impl ZuptSettings {
    pub(super) fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_m_s", &[self.sigma_m_s])?;
        let ZuptErrors {
            noise_sigma_m_s,
            walk_sigma_m_s,
            correlation_time_s,
        } = self.truth;
        deviations(&[
            ("noise_sigma_m_s", noise_sigma_m_s.unwrap_or(0.0)),
            ("walk_sigma_m_s", walk_sigma_m_s),
        ])
        .and_then(|()| require_positive("correlation_time_s", &[correlation_time_s]))
        .map_err(|e| e.in_section("truth"))
    }
}

impl HeadingSettings {
    pub(super) fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_deg", &[self.sigma_deg])?;
        let HeadingErrors {
            noise_sigma_deg,
            offset_sigma_deg,
            walk_sigma_deg,
            correlation_time_s,
        } = self.truth;
        let noise = noise_sigma_deg.unwrap_or(0.0);
        deviations(&[
            ("noise_sigma_deg", noise),
            ("offset_sigma_deg", offset_sigma_deg),
            ("walk_sigma_deg", walk_sigma_deg),
        ])
        .and_then(|()| require_positive("correlation_time_s", &[correlation_time_s]))
        .map_err(|e| e.in_section("truth"))
    }
}
