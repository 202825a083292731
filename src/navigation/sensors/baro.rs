//! A barometric altimeter: height with white noise, as the R package `navigation` has it.

use crate::rng::{Generator, StreamKey};
use crate::units::{Positive, SettingError, require_positive};
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[baro]`: a barometric altimeter. Its deviation is both truth and belief; outages do not concern it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaroSettings {
    /// Heights per second.
    #[schemars(with = "Positive")]
    pub rate_hz: f64,
    /// Standard deviation of a height (m).
    #[schemars(with = "Positive")]
    pub sigma_m: f64,
}

impl BaroSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused.
    pub(crate) fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_hz", &[self.rate_hz])?;
        require_positive("sigma_m", &[self.sigma_m])
    }
}

/// The noise of the altimeter in one run.
#[derive(Debug, Clone)]
pub(crate) struct BaroNoise {
    stream: Generator,
    sigma_m: f64,
}

impl BaroNoise {
    /// The noise of run `key.run`.
    pub(crate) fn new(settings: &BaroSettings, key: StreamKey<'_>) -> Self {
        let stream = StreamKey {
            source: "baro",
            process: "height",
            ..key
        }
        .generator();
        Self {
            stream,
            sigma_m: settings.sigma_m,
        }
    }

    /// The error of the next height (m).
    pub(crate) fn draw(&mut self) -> f64 {
        let normal: f64 = StandardNormal.sample(&mut self.stream);
        self.sigma_m * normal
    }
}
