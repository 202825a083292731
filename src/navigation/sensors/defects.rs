//! Errors of the true IMU beside its noise. The filter knows only as much of them as `[initial]`
//! states.

use super::normal;
use crate::imu::{ImuSample, MAX_RATE_HZ, Sensor};
use crate::rng::StreamKey;
use crate::units::{NonNegative, Positive, SettingError};
use glam::{DMat3, DVec3};
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
    pub turn_on_bias_accel_m_s2: Option<f64>,
    /// Turn-on bias of the gyroscopes (rad/s); without it that of the model's `[turn_on]`, or none.
    #[schemars(with = "Option<NonNegative>", range(max = MAX_BIAS_RAD_S))]
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
    /// Vibration rectified by the accelerometers.
    pub vibration: Option<Vibration>,
    /// Its temperature, and what that does.
    pub temperature: Option<Temperature>,
}

/// Largest scale-factor error (parts per million) and misalignment (rad).
const MAX_SCALE_PPM: f64 = 1e5;
const MAX_ANGLE_RAD: f64 = 0.1;
/// Largest g-sensitivity (rad/s per m/s²): 11 °/s per g.
const MAX_G_SENSITIVITY: f64 = 0.02;

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
        }
    }
}

impl ImuSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused.
    pub(crate) fn validate(&self) -> Result<(), SettingError> {
        super::check_bounds(self)?;
        self.temperature
            .iter()
            .try_for_each(|t| t.validate().map_err(|e| e.in_section("temperature")))
    }

    /// Standard deviations of turn-on bias (m/s² or rad/s) and scale factor (parts per million) of a sensor.
    pub fn deviations(&self, sensor: Sensor) -> (f64, f64) {
        let ppm = [self.scale_ppm_accel, self.scale_ppm_gyro][sensor as usize];
        (self.turn_on_bias(sensor).unwrap_or(0.0), ppm)
    }

    /// Standard deviation of the turn-on bias of a sensor (m/s² or rad/s), where it is stated.
    pub const fn turn_on_bias(&self, sensor: Sensor) -> Option<f64> {
        [self.turn_on_bias_accel_m_s2, self.turn_on_bias_gyro_rad_s][sensor as usize]
    }

    /// Standard deviation of what the accelerometers rectify (s²/m).
    pub(crate) fn rectification_s2_m(&self) -> f64 {
        let vibration = self.vibration.as_ref();
        vibration.map_or(0.0, |v| v.rectification_s2_m)
    }

    /// Standard deviation of what a degree does to a sensor's bias (m/s² or rad/s per K).
    pub(crate) fn per_kelvin(&self, sensor: Sensor) -> f64 {
        let temperature = self.temperature.as_ref();
        temperature.map_or(0.0, |t| [t.accel_m_s2_k, t.gyro_rad_s_k][sensor as usize])
    }

    /// Its errors of which no filter has states: the sensor if it is one alone, key, standard deviation, and unit of that.
    pub fn without_states(
        &self,
    ) -> impl Iterator<Item = (Option<Sensor>, &'static str, f64, &'static str)> + use<> {
        let rectification = self.rectification_s2_m();
        let [accel_k, gyro_k] = Sensor::ALL.map(|sensor| self.per_kelvin(sensor));
        let (accel, gyro) = (Some(Sensor::Accel), Some(Sensor::Gyro));
        let sensitivity = self.g_sensitivity_rad_s_per_m_s2;
        let all = [
            (None, "misalignment_rad", self.misalignment_rad, "rad"),
            (
                gyro,
                "g_sensitivity_rad_s_per_m_s2",
                sensitivity,
                "rad/s per m/s²",
            ),
            (accel, "vibration.rectification_s2_m", rectification, "s²/m"),
            (accel, "temperature.accel_m_s2_k", accel_k, "m/s² per K"),
            (gyro, "temperature.gyro_rad_s_k", gyro_k, "rad/s per K"),
        ];
        all.into_iter().filter(|(_, _, sigma, _)| *sigma > 0.0)
    }

    /// Returns true if the IMU has no error beside its noise.
    pub(crate) fn is_ideal(&self) -> bool {
        Self {
            rate_hz: self.rate_hz,
            ..Self::default()
        } == Self {
            turn_on_bias_accel_m_s2: self.turn_on_bias_accel_m_s2.filter(|sigma| *sigma > 0.0),
            turn_on_bias_gyro_rad_s: self.turn_on_bias_gyro_rad_s.filter(|sigma| *sigma > 0.0),
            ..self.clone()
        }
    }
}

// The defects of one run.

/// The defects of one run.
pub(crate) struct Defects {
    /// Turn-on bias of accelerometer and gyroscope (m/s², rad/s).
    pub bias: [DVec3; 2],
    /// Error per unit of the true sample (1, rad): scale factors on the diagonal, misalignments beside it.
    pub matrix: [DMat3; 2],
    /// Error of the gyroscopes per unit of specific force (rad/s per m/s²).
    pub g_sensitivity: DMat3,
    /// Error of the accelerometers per square of specific force (s²/m).
    pub rectification: DVec3,
    /// Change of the biases with temperature (m/s², rad/s per K).
    per_kelvin: [DVec3; 2],
}

impl Defects {
    /// The defects of run `key.run`, drawn from their standard deviations.
    pub(crate) fn draw(settings: &ImuSettings, key: StreamKey<'_>) -> Self {
        // A stream for each defect, drawn whether its deviation is zero or not: one setting changes no other number.
        let normals = |sensor: Sensor, process: &'static str, n: usize| -> Vec<f64> {
            let source = format!("{}.defects", sensor.name());
            let mut generator = key.stream(&source, process);
            (0..n).map(|_| normal(&mut generator)).collect()
        };
        let triad = |sensor: Sensor, process| DVec3::from_slice(&normals(sensor, process, 3));
        let matrix = |sensor: Sensor| {
            let (_, ppm) = settings.deviations(sensor);
            let mut matrix = DMat3::from_diagonal(triad(sensor, "scale") * (ppm * 1e-6));
            // Six numbers, not three: the axes of a triad need not be orthogonal to each other.
            let angles = normals(sensor, "misalignment", 6);
            for (k, angle) in angles.iter().enumerate() {
                // row k/2 takes of the other two columns
                let (row, column) = (k / 2, (k / 2 + 1 + k % 2) % 3);
                matrix.col_mut(column)[row] = angle * settings.misalignment_rad;
            }
            matrix
        };
        let sensitivity = DMat3::from_cols_slice(&normals(Sensor::Gyro, "g_sensitivity", 9));
        Self {
            bias: Sensor::ALL.map(|s| triad(s, "turn_on_bias") * settings.deviations(s).0),
            matrix: Sensor::ALL.map(matrix),
            g_sensitivity: sensitivity * settings.g_sensitivity_rad_s_per_m_s2,
            rectification: triad(Sensor::Accel, "rectification") * settings.rectification_s2_m(),
            per_kelvin: Sensor::ALL.map(|s| triad(s, "temperature") * settings.per_kelvin(s)),
        }
    }

    /// The error of a sample where this is felt: accelerometer (m/s²), gyroscope (rad/s).
    pub(crate) fn error(&self, error_inputs: &ErrorInputs) -> [DVec3; 2] {
        let [force, rate] = error_inputs.sample;
        let [accel, gyro] =
            [0, 1].map(|s| self.bias[s] + self.per_kelvin[s] * error_inputs.warming_k);
        [
            accel + self.matrix[0] * force + self.rectification * error_inputs.square,
            gyro + self.matrix[1] * rate + self.g_sensitivity * force,
        ]
    }
}

// What an IMU feels, and errors that are proportional to it.

/// `[imu.vibration]`: accelerometers that are not linear rectify what shakes them (g² term; IEEE Std 1293): a bias of
/// `rectification_s2_m` times the mean square of the specific force along the axis, less that of the start, which is
/// turn-on bias.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vibration {
    /// Vibration along each axis that the trajectory does not have, from the start to the end (root mean square, m/s²).
    #[schemars(with = "NonNegative", range(max = MAX_VIBRATION))]
    #[serde(default)]
    pub rms_m_s2: f64,
    /// Error per square of the specific force (1 σ, m/s² per (m/s²)²), each axis its own: 1 mg per g² is 1.02e-4.
    #[schemars(with = "NonNegative", range(max = MAX_RECTIFICATION))]
    pub rectification_s2_m: f64,
}

/// Largest vibration (m/s²): 100 g.
const MAX_VIBRATION: f64 = 1000.0;
/// Largest change of a bias with temperature (m/s² and rad/s per K): 10 mg, and 0.06 °/s.
const MAX_PER_KELVIN: [f64; 2] = [0.1, 1e-3];
/// Largest rectification (s²/m): a tenth of the specific force at g.
const MAX_RECTIFICATION: f64 = 0.01;

/// `[imu.temperature]`: the IMU warms or cools along the trajectory, and its biases with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    /// Time on the trajectory (s) and temperature (°C), one pair after the other: straight between them, constant before and
    /// after. What the IMU has at the first of them is its turn-on bias.
    pub profile_c: Vec<[f64; 2]>,
    /// Change of each accelerometer's bias (1 σ, m/s² per K).
    #[schemars(with = "NonNegative", range(max = MAX_PER_KELVIN[0]))]
    #[serde(default)]
    pub accel_m_s2_k: f64,
    /// Change of each gyroscope's bias (1 σ, rad/s per K): 0.005 °/s per K are 8.73e-5.
    #[schemars(with = "NonNegative", range(max = MAX_PER_KELVIN[1]))]
    #[serde(default)]
    pub gyro_rad_s_k: f64,
}

impl Temperature {
    fn validate(&self) -> Result<(), SettingError> {
        let key = "profile_c";
        if self.profile_c.len() < 2 {
            let requirement = "expected two pairs of time (s) and temperature (°C), or more";
            return Err(SettingError::new(
                key,
                format!("{:?}", self.profile_c),
                requirement,
            ));
        }
        match self
            .profile_c
            .windows(2)
            .find(|pair| pair[1][0] <= pair[0][0])
        {
            Some(pair) => Err(SettingError::new(
                key,
                format!("{pair:?}"),
                "its times must increase",
            )),
            None => Ok(()),
        }
    }

    /// An IMU that feels temperature so many times as much.
    pub(crate) const fn multiply(&mut self, factor: f64) {
        self.accel_m_s2_k *= factor;
        self.gyro_rad_s_k *= factor;
    }

    /// Temperature above that of the profile's first point (K).
    fn warming_k(&self, t_s: f64) -> f64 {
        let profile = &self.profile_c;
        let after = profile.partition_point(|[t, _]| *t <= t_s);
        let c = match (
            after.checked_sub(1).map(|before| profile[before]),
            profile.get(after),
        ) {
            (Some([t0, c0]), Some([t1, c1])) => c0 + (c1 - c0) * (t_s - t0) / (t1 - t0),
            (Some([_, c]), None) => c,
            (None, _) => profile[0][1],
        };
        c - profile[0][1]
    }
}

/// Quantity to which an error of a sensor's axis is proportional.
pub(crate) enum ErrorInput {
    /// Nothing that changes: a bias.
    Unit,
    /// The sample of this sensor along this axis: scale factors, misalignments, g-sensitivity.
    Sample(Sensor, usize),
    /// The mean square of the specific force along this axis: rectification.
    Square(usize),
    /// Warming since the start.
    Warming,
}

/// Motion and temperature of the IMU over a sample.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ErrorInputs {
    /// Specific force (m/s²) and angular rate (rad/s) in b.
    pub sample: [DVec3; 2],
    /// Mean square of the specific force along each axis, with the vibration, less that of the start ((m/s²)²).
    square: DVec3,
    /// Temperature above that of the start (K).
    warming_k: f64,
}

impl ErrorInputs {
    /// Environment of a true sample at a time; the trajectory begins with the sample `first`.
    pub(crate) fn at(
        settings: &ImuSettings,
        sample: &ImuSample,
        t_s: f64,
        first: &ImuSample,
    ) -> Self {
        let (f, f_0) = (sample.f_ib_b, first.f_ib_b);
        let vibration = settings.vibration.as_ref().map_or(0.0, |v| v.rms_m_s2);
        Self {
            sample: Sensor::ALL.map(|sensor| sample.of(sensor)),
            square: f * f - f_0 * f_0 + DVec3::splat(vibration * vibration),
            warming_k: settings
                .temperature
                .as_ref()
                .map_or(0.0, |t| t.warming_k(t_s)),
        }
    }

    /// Value of the quantity to which an error is proportional.
    pub(crate) fn value(&self, of: ErrorInput) -> f64 {
        match of {
            ErrorInput::Unit => 1.0,
            ErrorInput::Sample(sensor, axis) => self.sample[sensor as usize][axis],
            ErrorInput::Square(axis) => self.square[axis],
            ErrorInput::Warming => self.warming_k,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_on_bias_of_zero_is_no_defect() {
        let mut settings = ImuSettings::default();
        assert_eq!((settings.validate(), settings.is_ideal()), (Ok(()), true));
        settings.turn_on_bias_accel_m_s2 = Some(0.0);
        assert!(settings.is_ideal());
    }
}

#[cfg(test)]
mod drawn_tests {
    use super::{Temperature, Vibration, *};
    use crate::tests::key;

    /// Mean and variance of each element over runs: n draws of a normal deviation s have mean 0 ± s/√n and
    /// mean square s² (1 ± √(2/n)); 48 elements, 5 deviations.
    #[test]
    fn every_element_has_the_deviation_that_was_asked_for() {
        let settings = ImuSettings {
            turn_on_bias_accel_m_s2: Some(0.1),
            turn_on_bias_gyro_rad_s: Some(0.01),
            scale_ppm_accel: 500.0,
            scale_ppm_gyro: 200.0,
            misalignment_rad: 1e-3,
            g_sensitivity_rad_s_per_m_s2: 2e-4,
            vibration: Some(Vibration {
                rms_m_s2: 0.0,
                rectification_s2_m: 3e-4,
            }),
            temperature: Some(Temperature {
                profile_c: vec![[0.0, 20.0]],
                accel_m_s2_k: 1e-3,
                gyro_rad_s_k: 1e-5,
            }),
            ..ImuSettings::default()
        };
        let n = 4000_u32;
        let draw = |run: u32| Defects::draw(&settings, key(run.into()));
        let runs: Vec<Defects> = (0..n).map(draw).collect();
        let check = |what: String, deviation: f64, of: &dyn Fn(&Defects) -> f64| {
            let mean = runs.iter().map(of).sum::<f64>() / f64::from(n);
            let square = runs.iter().map(|d| of(d).powi(2)).sum::<f64>() / f64::from(n);
            assert!(
                mean.abs() < 5.0 * deviation / f64::from(n).sqrt(),
                "{what}: mean {mean}"
            );
            let relative = square / deviation.powi(2) - 1.0;
            assert!(
                relative.abs() < 5.0 * (2.0 / f64::from(n)).sqrt(),
                "{what}: {relative}"
            );
        };
        for i in 0..3 {
            check(format!("rectification {i}"), 3e-4, &|d| d.rectification[i]);
            for j in 0..3 {
                check(format!("g-sensitivity {i} {j}"), 2e-4, &|d| {
                    d.g_sensitivity.col(j)[i]
                });
            }
        }
        for (s, bias, scale, kelvin) in [(0, 0.1, 500e-6, 1e-3), (1, 0.01, 200e-6, 1e-5)] {
            for i in 0..3 {
                check(format!("temperature {s} {i}"), kelvin, &|d| {
                    d.per_kelvin[s][i]
                });
                check(format!("bias {s} {i}"), bias, &|d| d.bias[s][i]);
                for j in 0..3 {
                    let deviation = if i == j { scale } else { 1e-3 };
                    check(format!("matrix {s} {i} {j}"), deviation, &|d| {
                        d.matrix[s].col(j)[i]
                    });
                }
            }
        }
    }
}

#[cfg(test)]
mod felt_tests {
    use super::*;

    /// 20 °C until 100 s, 45 °C from 200 s: half way 12.5 K; before, on and after the points.
    #[test]
    fn a_profile_is_straight_between_its_points_and_constant_outside() {
        let profile_c = vec![[100.0, 20.0], [200.0, 45.0], [300.0, 45.0], [301.0, 10.0]];
        let temperature = Temperature {
            profile_c,
            accel_m_s2_k: 0.0,
            gyro_rad_s_k: 0.0,
        };
        let warming =
            [0.0, 100.0, 150.0, 200.0, 250.0, 300.5, 1e9].map(|t_s| temperature.warming_k(t_s));
        assert_eq!(warming, [0.0, 0.0, 12.5, 25.0, 25.0, 7.5, -10.0]);
    }
}
