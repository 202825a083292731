//! The defects of one run.

use super::{ImuSettings, Surroundings};
use crate::imu::Sensor;
use crate::rng::StreamKey;
use glam::{DMat3, DVec3};
use rand_distr::{Distribution, StandardNormal};

/// The defects of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
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
            let mut generator = StreamKey {
                source: &source,
                process,
                ..key
            }
            .generator();
            (0..n)
                .map(|_| StandardNormal.sample(&mut generator))
                .collect()
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
        let rectification = settings
            .vibration
            .as_ref()
            .map_or(0.0, |v| v.rectification_s2_m);
        let per_kelvin = |sensor| {
            settings
                .temperature
                .as_ref()
                .map_or(0.0, |t| t.sigma(sensor))
        };
        let sensitivity = DMat3::from_cols_slice(&normals(Sensor::Gyro, "g_sensitivity", 9));
        Self {
            bias: Sensor::ALL.map(|s| triad(s, "turn_on_bias") * settings.deviations(s).0),
            matrix: Sensor::ALL.map(matrix),
            g_sensitivity: sensitivity * settings.g_sensitivity_rad_s_per_m_s2,
            rectification: triad(Sensor::Accel, "rectification") * rectification,
            per_kelvin: Sensor::ALL.map(|s| triad(s, "temperature") * per_kelvin(s)),
        }
    }

    /// The error of a sample where this is felt: accelerometer (m/s²), gyroscope (rad/s).
    pub(crate) fn error(&self, felt: &Surroundings) -> [DVec3; 2] {
        let [force, rate] = felt.sample;
        let [accel, gyro] = [0, 1].map(|s| self.bias[s] + self.per_kelvin[s] * felt.warming_k);
        [
            accel + self.matrix[0] * force + self.rectification * felt.square,
            gyro + self.matrix[1] * rate + self.g_sensitivity * force,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Temperature, Vibration};
    use super::*;

    const KEY: StreamKey<'_> = StreamKey {
        seed: 9,
        scenario: "",
        run: 0,
        source: "",
        process: "",
    };

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
        let runs: Vec<Defects> = (0..n)
            .map(|run| {
                Defects::draw(
                    &settings,
                    StreamKey {
                        run: run.into(),
                        ..KEY
                    },
                )
            })
            .collect();
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
