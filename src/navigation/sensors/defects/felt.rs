//! What an IMU feels, and errors that are proportional to it.

use super::{ImuSettings, at_most};
use crate::imu::{ImuSample, Sensor};
use crate::units::{NonNegative, SettingError, exactly, require_finite};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

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
    #[serde(deserialize_with = "pairs")]
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

/// Reads pairs, no triples.
fn pairs<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[f64; 2]>, D::Error> {
    #[derive(Deserialize)]
    struct Pair(#[serde(deserialize_with = "exactly")] [f64; 2]);
    Ok(Vec::<Pair>::deserialize(deserializer)?
        .into_iter()
        .map(|Pair(pair)| pair)
        .collect())
}

impl Vibration {
    pub(super) fn validate(&self) -> Result<(), SettingError> {
        at_most("rms_m_s2", self.rms_m_s2, MAX_VIBRATION, "mg named m/s²?")?;
        at_most(
            "rectification_s2_m",
            self.rectification_s2_m,
            MAX_RECTIFICATION,
            "mg per g² named s²/m?",
        )
    }
}

impl Temperature {
    pub(super) fn validate(&self) -> Result<(), SettingError> {
        at_most(
            "accel_m_s2_k",
            self.accel_m_s2_k,
            MAX_PER_KELVIN[0],
            "mg named m/s²?",
        )?;
        at_most(
            "gyro_rad_s_k",
            self.gyro_rad_s_k,
            MAX_PER_KELVIN[1],
            "degrees named radians?",
        )?;
        let key = "profile_c";
        require_finite(key, self.profile_c.as_flattened())?;
        if self.profile_c.len() < 2 {
            let requirement = "it must be two pairs of time (s) and temperature (°C), or more";
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

    /// Standard deviation of what a degree does to a sensor's bias (m/s² or rad/s per K).
    pub(crate) const fn sigma(&self, sensor: Sensor) -> f64 {
        match sensor {
            Sensor::Accel => self.accel_m_s2_k,
            Sensor::Gyro => self.gyro_rad_s_k,
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

/// What an error of a sensor's axis is proportional to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Felt {
    /// Nothing that changes: a bias.
    Unit,
    /// The sample of this sensor along this axis: scale factors, misalignments, g-sensitivity.
    Sample(Sensor, usize),
    /// The mean square of the specific force along this axis: rectification.
    Square(usize),
    /// Warming since the start.
    Warming,
}

/// What an IMU feels over a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Surroundings {
    /// Specific force (m/s²) and angular rate (rad/s) in b.
    pub(crate) sample: [DVec3; 2],
    /// Mean square of the specific force along each axis, with the vibration, less that of the start ((m/s²)²).
    pub(crate) square: DVec3,
    /// Temperature above that of the start (K).
    pub(crate) warming_k: f64,
}

impl Surroundings {
    /// Of a true sample at a time on the trajectory that begins with the sample `first`.
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

    /// What an error is proportional to.
    pub(crate) fn value(&self, of: Felt) -> f64 {
        match of {
            Felt::Unit => 1.0,
            Felt::Sample(sensor, axis) => self.sample[sensor as usize][axis],
            Felt::Square(axis) => self.square[axis],
            Felt::Warming => self.warming_k,
        }
    }
}

#[cfg(test)]
mod tests {
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
