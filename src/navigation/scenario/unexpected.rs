//! What is true and the filter does not expect.

use super::Scenario;
use crate::imu::Sensor;
use crate::sensors::defects::Defect;
use crate::sensors::gnss::GnssSettings;
use crate::simulation::lincov::STRAPDOWN;

impl Scenario {
    /// Whether no error of the true IMU, the receiver or the aiding is stated.
    #[must_use]
    pub fn has_no_errors(&self) -> bool {
        self.imu.is_ideal() && self.aiding.errors().is_empty() && self.unexpected().is_empty()
    }

    /// Errors that the true IMU and receiver have and the filter does not expect: its own will be larger than it says.
    #[must_use]
    pub fn unexpected(&self) -> Vec<Unexpected> {
        let mut found = Vec::new();
        for sensor in Sensor::ALL {
            let (bias, ppm) = self.imu.deviations(sensor);
            // of half of what is there, errors may be twice as large as stated
            let expected = self.initial.bias_sigma(sensor).unwrap_or(0.0);
            if expected < 0.5 * bias {
                found.push(Unexpected::TurnOnBias {
                    sensor,
                    sigma: bias,
                    expected,
                });
            }
            let by_default = self.filter.states.scale_sigma() * 1e6;
            let expected_ppm = self.initial.scale_sigma_ppm(sensor).unwrap_or(by_default);
            if expected_ppm < 0.5 * ppm {
                found.push(Unexpected::Scale {
                    sensor,
                    ppm,
                    expected_ppm,
                });
            }
        }
        found.extend(self.imu.without_states().map(Unexpected::Defect));
        let GnssSettings {
            rate_hz,
            pos_sigma_m,
            correlated_pos_sigma_m: sigma_m,
            correlation_time_s,
            ..
        } = self.gnss;
        // A filter averages the white noise of so many fixes while the correlated error stays: that is felt when it is no
        // longer small beside their mean.
        let fixes = (rate_hz * correlation_time_s).max(1.0);
        if (0..3).any(|i| sigma_m[i] > 0.5 * pos_sigma_m[i] / fixes.sqrt()) {
            found.push(Unexpected::CorrelatedPositions {
                sigma_m,
                correlation_time_s,
            });
        }
        found.extend(
            self.aiding
                .unexpected()
                .map(|(source, key)| Unexpected::Aiding { source, key }),
        );
        found
    }

    /// The integration error of the strapdown, where the largest is a tenth of sigma: a hundredth of a mean square.
    #[must_use]
    pub fn unexpected_integration(&self, over_sigma: f64) -> Option<Unexpected> {
        let rate_hz = self.imu.rate_hz;
        (over_sigma > 0.1).then_some(Unexpected::Integration {
            rate_hz,
            over_sigma,
        })
    }
}

/// An error that the true IMU or receiver has, and the filter does not expect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unexpected {
    /// A constant bias (1 σ, m/s² or rad/s), and that of which the filter has states.
    TurnOnBias {
        /// Sensor.
        sensor: Sensor,
        /// Of the true IMU.
        sigma: f64,
        /// In the filter.
        expected: f64,
    },
    /// A scale-factor error (1 σ, ppm), and that of which the filter has states.
    Scale {
        /// Sensor.
        sensor: Sensor,
        /// Of the true IMU.
        ppm: f64,
        /// In the filter.
        expected_ppm: f64,
    },
    /// An error of the true IMU of which no filter has states.
    Defect(Defect),
    /// Position errors that last, of which no filter has states.
    CorrelatedPositions {
        /// North, east, down (1 σ, m).
        sigma_m: [f64; 3],
        /// How long they last (s).
        correlation_time_s: f64,
    },
    /// An error of what the vehicle measures of itself.
    Aiding {
        /// Its name in a budget.
        source: &'static str,
        /// The key that makes a filter expect it.
        key: &'static str,
    },
    /// A strapdown that is too slow for the motion.
    Integration {
        /// Rate of the IMU (Hz).
        rate_hz: f64,
        /// Its largest error over the sigma that the filter states.
        over_sigma: f64,
    },
}

impl Unexpected {
    /// Its names among the sources of a [`Budget`](crate::metrics::Budget): their shares together are its own.
    #[must_use]
    pub fn sources(&self) -> Vec<String> {
        match self {
            Self::TurnOnBias { sensor, .. } => vec![format!("{}.turn_on_bias", sensor.name())],
            Self::Scale { sensor, .. } => vec![format!("{}.scale", sensor.name())],
            Self::Defect(defect) => defect
                .sensors
                .iter()
                .map(|s| format!("{}.{}", s.name(), defect.source))
                .collect(),
            Self::CorrelatedPositions { .. } => vec!["gnss.correlated".to_owned()],
            Self::Aiding { source, .. } => vec![(*source).to_owned()],
            Self::Integration { .. } => vec![STRAPDOWN.to_owned()],
        }
    }
}
