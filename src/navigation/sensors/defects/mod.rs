//! What is wrong with the true IMU beside its noise. The filter knows nothing of it but what `[initial]` lets it expect.

mod drawn;
mod felt;
mod output;

pub(crate) use drawn::Defects;
pub(crate) use felt::{Felt, Surroundings};
pub use felt::{Temperature, Vibration};
pub use output::Output;

use crate::imu::{MAX_RATE_HZ, Sensor};
use crate::units::{NonNegative, Positive, SettingError, require_non_negative, require_positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest standard deviation of an accelerometer's bias (m/s²): a gravity.
pub const MAX_BIAS_M_S2: f64 = 10.0;
/// Largest standard deviation of a gyroscope's bias (rad/s): beyond it an attitude is lost in seconds.
pub const MAX_BIAS_RAD_S: f64 = 1.0;

/// `[imu]`: the true IMU; the filter knows its rate only (what it expects is in `[initial]`). Its errors are standard
/// deviations: each run draws its own, normal and constant over the run, for every axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImuSettings {
    /// Samples per second.
    #[schemars(with = "Positive", range(max = MAX_RATE_HZ))]
    pub rate_hz: f64,
    /// Turn-on bias of the accelerometers (m/s²); without it that of the model's `[turn_on]`, or none.
    #[schemars(with = "Option<NonNegative>", range(max = MAX_BIAS_M_S2))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_on_bias_accel_m_s2: Option<f64>,
    /// Turn-on bias of the gyroscopes (rad/s); without it that of the model's `[turn_on]`, or none.
    #[schemars(with = "Option<NonNegative>", range(max = MAX_BIAS_RAD_S))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_on_bias_gyro_rad_s: Option<f64>,
    /// Scale-factor error of the accelerometers (parts per million).
    #[schemars(with = "NonNegative", range(max = MAX_SCALE_PPM))]
    pub scale_ppm_accel: f64,
    /// Scale-factor error of the gyroscopes (parts per million).
    #[schemars(with = "NonNegative", range(max = MAX_SCALE_PPM))]
    pub scale_ppm_gyro: f64,
    /// Misalignment: what each axis takes of each other axis of its sensor (rad): six independent numbers a sensor.
    #[schemars(with = "NonNegative", range(max = MAX_ANGLE_RAD))]
    pub misalignment_rad: f64,
    /// Sensitivity of the gyroscopes to specific force (rad/s per m/s²): what each axis takes of each of the three, nine
    /// independent numbers. 0.1 °/s per g are 1.78e-4.
    #[schemars(with = "NonNegative", range(max = MAX_G_SENSITIVITY))]
    #[serde(skip_serializing_if = "is_zero")]
    pub g_sensitivity_rad_s_per_m_s2: f64,
    /// What accelerometers rectify.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vibration: Option<Vibration>,
    /// Its temperature, and what that does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Temperature>,
    /// How it puts its samples out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<Output>,
}

/// An error of the true IMU of which no filter has states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Defect {
    /// What a budget calls it, behind the name of the sensor.
    pub source: &'static str,
    /// Sensors that have it.
    pub sensors: &'static [Sensor],
    /// Its key in a scenario.
    pub key: &'static str,
    /// Standard deviation.
    pub sigma: f64,
    /// Unit of the standard deviation.
    pub unit: &'static str,
}

/// Largest scale-factor error (parts per million) and misalignment (rad).
const MAX_SCALE_PPM: f64 = 1e5;
const MAX_ANGLE_RAD: f64 = 0.1;
/// Largest g-sensitivity (rad/s per m/s²): 11 °/s per g.
const MAX_G_SENSITIVITY: f64 = 0.02;

/// Accepts 0 to `most`; `mistake` is what a larger value may be.
fn at_most(key: &str, value: f64, most: f64, mistake: &str) -> Result<(), SettingError> {
    require_non_negative(key, &[value])?;
    if value <= most {
        return Ok(());
    }
    Err(SettingError::new(
        key,
        value,
        format!("at most {most} ({mistake})"),
    ))
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(sigma: &f64) -> bool {
    *sigma == 0.0
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self {
            rate_hz: 100.0,
            turn_on_bias_accel_m_s2: None,
            turn_on_bias_gyro_rad_s: None,
            scale_ppm_accel: 0.0,
            scale_ppm_gyro: 0.0,
            misalignment_rad: 0.0,
            g_sensitivity_rad_s_per_m_s2: 0.0,
            vibration: None,
            temperature: None,
            output: None,
        }
    }
}

impl ImuSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused.
    pub(crate) fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        if self.rate_hz > MAX_RATE_HZ {
            let requirement = format!("at most {MAX_RATE_HZ} samples a second");
            return Err(SettingError::new("rate_hz", self.rate_hz, requirement));
        }
        let [(accel, _), (gyro, _)] = Sensor::ALL.map(|sensor| self.deviations(sensor));
        let sensitivity = self.g_sensitivity_rad_s_per_m_s2;
        at_most(
            "turn_on_bias_accel_m_s2",
            accel,
            MAX_BIAS_M_S2,
            "mg named m/s²?",
        )?;
        at_most(
            "turn_on_bias_gyro_rad_s",
            gyro,
            MAX_BIAS_RAD_S,
            "degrees an hour named rad/s?",
        )?;
        at_most(
            "scale_ppm_accel",
            self.scale_ppm_accel,
            MAX_SCALE_PPM,
            "a tenth",
        )?;
        at_most(
            "scale_ppm_gyro",
            self.scale_ppm_gyro,
            MAX_SCALE_PPM,
            "a tenth",
        )?;
        at_most(
            "misalignment_rad",
            self.misalignment_rad,
            MAX_ANGLE_RAD,
            "degrees named radians?",
        )?;
        at_most(
            "g_sensitivity_rad_s_per_m_s2",
            sensitivity,
            MAX_G_SENSITIVITY,
            "°/s per g named rad/s per m/s²?",
        )?;
        self.vibration
            .iter()
            .try_for_each(|v| v.validate().map_err(|e| e.in_section("vibration")))?;
        self.temperature
            .iter()
            .try_for_each(|t| t.validate().map_err(|e| e.in_section("temperature")))?;
        self.output
            .iter()
            .try_for_each(|o| o.validate().map_err(|e| e.in_section("output")))
    }

    /// Standard deviations of turn-on bias (m/s² or rad/s) and scale factor (parts per million) of a sensor.
    #[must_use]
    pub fn deviations(&self, sensor: Sensor) -> (f64, f64) {
        let ppm = match sensor {
            Sensor::Accel => self.scale_ppm_accel,
            Sensor::Gyro => self.scale_ppm_gyro,
        };
        (self.turn_on_bias(sensor).unwrap_or(0.0), ppm)
    }

    /// Standard deviation of the turn-on bias of a sensor (m/s² or rad/s), where it is stated.
    #[must_use]
    pub const fn turn_on_bias(&self, sensor: Sensor) -> Option<f64> {
        match sensor {
            Sensor::Accel => self.turn_on_bias_accel_m_s2,
            Sensor::Gyro => self.turn_on_bias_gyro_rad_s,
        }
    }

    /// Its errors of which no filter has states.
    pub fn without_states(&self) -> impl Iterator<Item = Defect> + use<> {
        let rectification = self
            .vibration
            .as_ref()
            .map_or(0.0, |v| v.rectification_s2_m);
        let [accel_k, gyro_k] =
            Sensor::ALL.map(|s| self.temperature.as_ref().map_or(0.0, |t| t.sigma(s)));
        let defect = |source, sensors, key, sigma, unit| Defect {
            source,
            sensors,
            key,
            sigma,
            unit,
        };
        let (both, accel, gyro): (&[Sensor], &[Sensor], &[Sensor]) =
            (&Sensor::ALL, &[Sensor::Accel], &[Sensor::Gyro]);
        let sensitivity = self.g_sensitivity_rad_s_per_m_s2;
        let all = [
            defect(
                "misalignment",
                both,
                "imu.misalignment_rad",
                self.misalignment_rad,
                "rad",
            ),
            defect(
                "g_sensitivity",
                gyro,
                "imu.g_sensitivity_rad_s_per_m_s2",
                sensitivity,
                "rad/s per m/s²",
            ),
            defect(
                "rectification",
                accel,
                "imu.vibration.rectification_s2_m",
                rectification,
                "s²/m",
            ),
            defect(
                "temperature",
                accel,
                "imu.temperature.accel_m_s2_k",
                accel_k,
                "m/s² per K",
            ),
            defect(
                "temperature",
                gyro,
                "imu.temperature.gyro_rad_s_k",
                gyro_k,
                "rad/s per K",
            ),
        ];
        all.into_iter().filter(|defect| defect.sigma > 0.0)
    }

    /// Whether the true IMU has no error beside its noise, before its samples are put out.
    pub(crate) fn is_ideal(&self) -> bool {
        Self {
            rate_hz: self.rate_hz,
            ..Self::default()
        } == Self {
            turn_on_bias_accel_m_s2: self.turn_on_bias_accel_m_s2.filter(|sigma| *sigma > 0.0),
            turn_on_bias_gyro_rad_s: self.turn_on_bias_gyro_rad_s.filter(|sigma| *sigma > 0.0),
            output: None,
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_no_small_errors_are_refused_by_key() {
        let d = ImuSettings::default();
        assert_eq!((d.validate(), d.is_ideal()), (Ok(()), true));
        let of_bias = ImuSettings {
            turn_on_bias_accel_m_s2: Some(0.0),
            ..d.clone()
        };
        assert!(of_bias.is_ideal());
        let temperature = |profile_c: &[[f64; 2]]| {
            Some(Temperature {
                profile_c: profile_c.into(),
                accel_m_s2_k: 1e-3,
                gyro_rad_s_k: 0.0,
            })
        };
        let refused = [
            (
                ImuSettings {
                    scale_ppm_gyro: -1.0,
                    ..d.clone()
                },
                "scale_ppm_gyro",
            ),
            (
                ImuSettings {
                    scale_ppm_accel: 2e5,
                    ..d.clone()
                },
                "scale_ppm_accel",
            ),
            (
                ImuSettings {
                    misalignment_rad: 1.0,
                    ..d.clone()
                },
                "misalignment_rad",
            ),
            (
                ImuSettings {
                    turn_on_bias_gyro_rad_s: Some(f64::NAN),
                    ..d.clone()
                },
                "turn_on_bias_gyro_rad_s",
            ),
            (
                ImuSettings {
                    g_sensitivity_rad_s_per_m_s2: 2.0,
                    ..d.clone()
                },
                "g_sensitivity_rad_s_per_m_s2",
            ),
            (
                ImuSettings {
                    vibration: Some(Vibration {
                        rms_m_s2: -1.0,
                        rectification_s2_m: 1e-4,
                    }),
                    ..d.clone()
                },
                "vibration.rms_m_s2",
            ),
            (
                ImuSettings {
                    temperature: temperature(&[]),
                    ..d.clone()
                },
                "temperature.profile_c",
            ),
            (
                ImuSettings {
                    temperature: temperature(&[[5.0, 20.0], [5.0, 30.0]]),
                    ..d.clone()
                },
                "temperature.profile_c",
            ),
            (
                ImuSettings {
                    output: Some(Output {
                        range_accel_m_s2: Some(8.0),
                        ..Output::default()
                    }),
                    ..d.clone()
                },
                "output.range_accel_m_s2",
            ),
        ];
        for (settings, key) in refused {
            assert_eq!(settings.validate().unwrap_err().key, key);
        }
    }
}
