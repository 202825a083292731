//! What is wrong with the true IMU beside its noise: turn-on bias, scale factors, misalignment. The filter
//! knows nothing of them but what `[initial]` lets it expect.

use crate::imu::{ImuSample, MAX_RATE_HZ, Sensor};
use crate::rng::StreamKey;
use crate::units::{NonNegative, Positive, SettingError, require_non_negative, require_positive};
use glam::{DMat3, DVec3};
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest standard deviation of an accelerometer's bias (m/s²): a gravity.
pub const MAX_BIAS_M_S2: f64 = 10.0;
/// Largest standard deviation of a gyroscope's bias (rad/s): beyond it an attitude is lost in seconds.
pub const MAX_BIAS_RAD_S: f64 = 1.0;

/// `[imu]`: the true IMU; the filter knows its rate only (what it expects is in `[initial]`). Turn-on bias, scale factors and misalignment are
/// standard deviations: each run draws its own, normal and constant over the run, for every axis.
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
    #[schemars(with = "NonNegative", range(max = 1e5))]
    pub scale_ppm_accel: f64,
    /// Scale-factor error of the gyroscopes (parts per million).
    #[schemars(with = "NonNegative", range(max = 1e5))]
    pub scale_ppm_gyro: f64,
    /// Misalignment: what each axis takes of each other axis of its sensor (rad): six independent numbers a sensor.
    #[schemars(with = "NonNegative", range(max = 0.1))]
    pub misalignment_rad: f64,
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
        require_non_negative("turn_on_bias_accel_m_s2", &[accel])?;
        require_non_negative("turn_on_bias_gyro_rad_s", &[gyro])?;
        if accel > MAX_BIAS_M_S2 {
            let requirement = format!("at most {MAX_BIAS_M_S2} m/s² (mg named m/s²?)");
            return Err(SettingError::new("turn_on_bias_accel_m_s2", accel, requirement));
        }
        if gyro > MAX_BIAS_RAD_S {
            let requirement = format!("at most {MAX_BIAS_RAD_S} rad/s (degrees an hour named rad/s?)");
            return Err(SettingError::new("turn_on_bias_gyro_rad_s", gyro, requirement));
        }
        for (key, ppm) in [("scale_ppm_accel", self.scale_ppm_accel), ("scale_ppm_gyro", self.scale_ppm_gyro)]
        {
            require_non_negative(key, &[ppm])?;
            if ppm > 1e5 {
                return Err(SettingError::new(key, ppm, "at most 100000 parts per million, a tenth"));
            }
        }
        require_non_negative("misalignment_rad", &[self.misalignment_rad])?;
        if self.misalignment_rad > 0.1 {
            let requirement = "at most 0.1 rad: misalignments are small angles (degrees named radians?)";
            return Err(SettingError::new("misalignment_rad", self.misalignment_rad, requirement));
        }
        Ok(())
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

    /// Whether the true IMU has none of them.
    pub(crate) fn is_ideal(&self) -> bool {
        let [accel, gyro] = Sensor::ALL.map(|sensor| self.deviations(sensor));
        [accel.0, accel.1, gyro.0, gyro.1, self.misalignment_rad].iter().all(|x| *x == 0.0)
    }
}

/// The defects of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Defects {
    /// Turn-on bias of accelerometer and gyroscope (m/s², rad/s).
    pub bias: [DVec3; 2],
    /// Error per unit of the true sample (1, rad): scale factors on the diagonal, misalignments beside it.
    pub matrix: [DMat3; 2],
}

impl Defects {
    /// The defects of run `key.run`, drawn from their standard deviations.
    pub(crate) fn draw(settings: &ImuSettings, key: StreamKey<'_>) -> Self {
        let defects_of = |sensor: Sensor| {
            let source = format!("{}.defects", sensor.name());
            // A stream for each defect, drawn whether its deviation is zero or not: one setting changes no
            // other number.
            let normals = |process: &'static str, n: usize| -> Vec<f64> {
                let mut generator = StreamKey { source: &source, process, ..key }.generator();
                (0..n).map(|_| StandardNormal.sample(&mut generator)).collect()
            };
            let (bias_sigma, ppm) = settings.deviations(sensor);
            let bias = DVec3::from_slice(&normals("turn_on_bias", 3)) * bias_sigma;
            let mut matrix = DMat3::from_diagonal(DVec3::from_slice(&normals("scale", 3)) * (ppm * 1e-6));
            // Six numbers, not three: the axes of a triad need not be orthogonal to each other.
            let angles = normals("misalignment", 6);
            for (k, angle) in angles.iter().enumerate() {
                // row k/2 takes of the other two columns
                let (row, column) = (k / 2, (k / 2 + 1 + k % 2) % 3);
                matrix.col_mut(column)[row] = angle * settings.misalignment_rad;
            }
            (bias, matrix)
        };
        let [accel, gyro] = Sensor::ALL.map(defects_of);
        Self { bias: [accel.0, gyro.0], matrix: [accel.1, gyro.1] }
    }

    /// The error of a true sample, bias + matrix · sample: accelerometer (m/s²), gyroscope (rad/s).
    pub(crate) fn error(&self, truth: &ImuSample) -> [DVec3; 2] {
        let [accel, gyro] = self.matrix;
        [self.bias[0] + accel * truth.f_ib_b, self.bias[1] + gyro * truth.omega_ib_b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: StreamKey<'_> = StreamKey { seed: 9, scenario: "", run: 0, source: "", process: "" };

    /// Mean and variance of each element over runs: n draws of a normal deviation s have mean 0 ± s/√n and
    /// mean square s² (1 ± √(2/n)); 30 elements, 5 deviations.
    #[test]
    fn every_element_has_the_deviation_that_was_asked_for() {
        let settings = ImuSettings {
            turn_on_bias_accel_m_s2: Some(0.1),
            turn_on_bias_gyro_rad_s: Some(0.01),
            scale_ppm_accel: 500.0,
            scale_ppm_gyro: 200.0,
            misalignment_rad: 1e-3,
            ..ImuSettings::default()
        };
        let n = 4000_u32;
        let runs: Vec<Defects> =
            (0..n).map(|run| Defects::draw(&settings, StreamKey { run: run.into(), ..KEY })).collect();
        let check = |what: String, deviation: f64, of: &dyn Fn(&Defects) -> f64| {
            let mean = runs.iter().map(of).sum::<f64>() / f64::from(n);
            let square = runs.iter().map(|d| of(d).powi(2)).sum::<f64>() / f64::from(n);
            assert!(mean.abs() < 5.0 * deviation / f64::from(n).sqrt(), "{what}: mean {mean}");
            let relative = square / deviation.powi(2) - 1.0;
            assert!(relative.abs() < 5.0 * (2.0 / f64::from(n)).sqrt(), "{what}: {relative}");
        };
        for (s, bias, scale) in [(0, 0.1, 500e-6), (1, 0.01, 200e-6)] {
            for i in 0..3 {
                check(format!("bias {s} {i}"), bias, &|d| d.bias[s][i]);
                for j in 0..3 {
                    let deviation = if i == j { scale } else { 1e-3 };
                    check(format!("matrix {s} {i} {j}"), deviation, &|d| d.matrix[s].col(j)[i]);
                }
            }
        }
    }

    #[test]
    fn values_that_are_no_small_errors_are_refused_by_key() {
        let d = ImuSettings::default();
        assert_eq!((d.validate(), d.is_ideal()), (Ok(()), true));
        let refused = [
            (ImuSettings { scale_ppm_gyro: -1.0, ..d.clone() }, "scale_ppm_gyro"),
            (ImuSettings { scale_ppm_accel: 2e5, ..d.clone() }, "scale_ppm_accel"),
            (ImuSettings { misalignment_rad: 1.0, ..d.clone() }, "misalignment_rad"),
            (ImuSettings { turn_on_bias_gyro_rad_s: Some(f64::NAN), ..d.clone() }, "turn_on_bias_gyro_rad_s"),
        ];
        for (settings, key) in refused {
            assert_eq!(settings.validate().unwrap_err().key, key);
        }
    }
}
