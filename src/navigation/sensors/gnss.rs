//! The GNSS receiver: what it measures, how often and how well.

use super::normal;
use crate::rng::{Generator, StreamKey};
use crate::units::{Amount, Measurable};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Longest lever arm (m): no vehicle is larger.
pub const MAX_LEVER_ARM_M: f64 = 100.0;

/// GNSS fixes: rate, standard deviations (north, east, down), lever arm. The defaults are those of
/// [Minaretzis et al.](crate::bibliography::Minaretzis24), Section V: 1 Hz, position variances 4, 4 and
/// 16 m², velocity variances 0.0016, 0.0016 and 0.0036 (m/s)².
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GnssSettings {
    /// Fixes per second.
    #[schemars(with = "Measurable")]
    pub rate_hz: f64,
    /// Position standard deviations north, east, down (m).
    #[schemars(with = "[Measurable; 3]")]
    pub pos_sigma_m: [f64; 3],
    /// Velocity standard deviations north, east, down (m/s); `None` ("none" in files): no velocity.
    #[serde(
        serialize_with = "sigmas_or_none",
        deserialize_with = "parse_sigmas_or_none"
    )]
    #[schemars(with = "SigmasOrNone")]
    pub vel_sigma_m_s: Option<[f64; 3]>,
    /// Antenna position with respect to the IMU, in b: front, right, down (m).
    #[schemars(inner(range(min = -MAX_LEVER_ARM_M, max = MAX_LEVER_ARM_M)))]
    pub lever_arm_m: [f64; 3],
    /// Standard deviations of a correlated position error north, east, down (m): a Gauss-Markov process beside
    /// the white noise, in the true receiver only. The filter assumes `pos_sigma_m`, white.
    #[schemars(with = "[Amount; 3]")]
    pub correlated_pos_sigma_m: [f64; 3],
    /// Correlation time of that error (s).
    #[schemars(with = "Measurable")]
    pub correlation_time_s: f64,
}

impl Default for GnssSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            pos_sigma_m: [2.0, 2.0, 4.0],
            vel_sigma_m_s: Some([0.04, 0.04, 0.06]),
            lever_arm_m: [0.0; 3],
            correlated_pos_sigma_m: [0.0; 3],
            correlation_time_s: 100.0,
        }
    }
}

impl GnssSettings {
    /// Components of one fix: 3 (position) or 6 (and velocity).
    pub(crate) const fn components(&self) -> usize {
        if self.vel_sigma_m_s.is_some() { 6 } else { 3 }
    }
}

/// The noise of the receiver in one run: one stream a component, drawn at every epoch whether the fix is
/// used or not, so that outages change no number.
pub(crate) struct GnssNoise {
    streams: [Generator; 6],
    sigma: [f64; 6],
    correlated: [Correlated; 3],
}

/// One component of the correlated error: e_k = phi e_{k−1} + w, stationary from the first epoch.
struct Correlated {
    stream: Generator,
    phi: f64,
    sigma: f64,
    /// The error at the last epoch (m); none before the first.
    value: Option<f64>,
}

impl Correlated {
    fn next(&mut self) -> f64 {
        if self.sigma == 0.0 {
            return 0.0;
        }
        // The first value has the stationary deviation; later ones phi e + √(1 − phi²) σ w, which keeps it.
        let fresh = self.sigma * normal(&mut self.stream);
        let innovation = (1.0 - self.phi * self.phi).sqrt();
        let value = self
            .value
            .map_or(fresh, |before| self.phi * before + innovation * fresh);
        self.value = Some(value);
        value
    }
}

impl GnssNoise {
    /// The noise of run `key.run`.
    pub(crate) fn new(settings: &GnssSettings, key: StreamKey<'_>) -> Self {
        const COMPONENTS: [&str; 6] = ["pos_n", "pos_e", "pos_d", "vel_n", "vel_e", "vel_d"];
        let streams = COMPONENTS.map(|process| key.stream("gnss", process));
        let velocity = settings.vel_sigma_m_s.unwrap_or([0.0; 3]);
        let sigma = std::array::from_fn(|i| {
            if i < 3 {
                settings.pos_sigma_m[i]
            } else {
                velocity[i - 3]
            }
        });
        // From one epoch of the receiver to the next, whatever the rate of the IMU.
        let phi = (-1.0 / (settings.rate_hz * settings.correlation_time_s)).exp();
        let correlated = std::array::from_fn(|i| {
            let process = ["correlated_n", "correlated_e", "correlated_d"][i];
            let stream = key.stream("gnss", process);
            Correlated {
                stream,
                phi,
                sigma: settings.correlated_pos_sigma_m[i],
                value: None,
            }
        });
        Self {
            streams,
            sigma,
            correlated,
        }
    }

    /// Position error (m) and velocity error (m/s) of the next fix, n.
    pub(crate) fn draw(&mut self) -> (DVec3, DVec3) {
        // All six, also without a velocity: each has a stream of its own, and its deviation is then zero.
        let e: [f64; 6] = std::array::from_fn(|i| self.sigma[i] * normal(&mut self.streams[i]));
        let slow = DVec3::from_array(std::array::from_fn(|i| self.correlated[i].next()));
        (
            DVec3::new(e[0], e[1], e[2]) + slow,
            DVec3::new(e[3], e[4], e[5]),
        )
    }
}

fn sigmas_or_none<S: Serializer>(
    sigmas: &Option<[f64; 3]>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let none = SigmasOrNone::None(NoneText::None);
    sigmas
        .map_or(none, SigmasOrNone::Sigmas)
        .serialize(serializer)
}

fn parse_sigmas_or_none<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<[f64; 3]>, D::Error> {
    Ok(match SigmasOrNone::deserialize(deserializer)? {
        SigmasOrNone::Sigmas(sigmas) => Some(sigmas),
        SigmasOrNone::None(_) => None,
    })
}

/// Serialised form of the velocity's standard deviations.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected three numbers or \"none\"")]
enum SigmasOrNone {
    Sigmas(#[schemars(with = "[Measurable; 3]")] [f64; 3]),
    None(NoneText),
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum NoneText {
    None,
}

// A barometric altimeter: height with white noise, as the R package `navigation` has it.

/// `[baro]`: a barometric altimeter. Its deviation is both truth and belief; outages do not concern it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaroSettings {
    /// Heights per second.
    #[schemars(with = "Measurable")]
    pub rate_hz: f64,
    /// Standard deviation of a height (m).
    #[schemars(with = "Measurable")]
    pub sigma_m: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    #[test]
    fn velocity_may_be_none_and_survives_a_round_trip() {
        let parsed: GnssSettings = toml::from_str("vel_sigma_m_s = \"none\"").unwrap();
        assert_eq!(parsed.vel_sigma_m_s, None);
        assert_eq!(parsed.components(), 3);
        for settings in [parsed, GnssSettings::default()] {
            let text = toml::to_string(&settings).unwrap();
            assert_eq!(toml::from_str::<GnssSettings>(&text).unwrap(), settings);
        }
        let error = toml::from_str::<GnssSettings>("vel_sigma_m_s = \"nil\"").unwrap_err();
        assert!(
            error.message().contains("three numbers or \"none\""),
            "{error}"
        );
    }

    /// White and correlated error together: variance sigma² + s², covariance at lag k s² phi^k. Over n
    /// epochs the correlated part is worth n (1 − phi²)/(1 + phi²) independent ones; 5 deviations.
    #[test]
    fn the_correlated_error_has_its_variance_and_memory() {
        let settings = GnssSettings {
            pos_sigma_m: [1.0; 3],
            correlated_pos_sigma_m: [3.0, 0.0, 2.0],
            correlation_time_s: 20.0,
            ..GnssSettings::default()
        };
        let mut noise = GnssNoise::new(&settings, key(4));
        let n = 400_000;
        let errors: Vec<DVec3> = (0..n).map(|_| noise.draw().0).collect();
        let phi = (-1.0_f64 / 20.0).exp();
        let independent = n as f64 * (1.0 - phi * phi) / (1.0 + phi * phi);
        for (axis, s) in [(0, 3.0_f64), (1, 0.0), (2, 2.0)] {
            for lag in [0, 5, 20] {
                let products = errors.windows(lag + 1).map(|w| w[0][axis] * w[lag][axis]);
                let found = products.sum::<f64>() / (n - lag) as f64;
                let expected = s * s * phi.powi(lag as i32) + if lag == 0 { 1.0 } else { 0.0 };
                let deviation = (s * s + 1.0) * (2.0 / independent).sqrt();
                assert!(
                    (found - expected).abs() < 5.0 * deviation,
                    "axis {axis}, lag {lag}: {found} {expected}"
                );
            }
        }
    }
}
