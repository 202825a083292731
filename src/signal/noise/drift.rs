//! Drift: a deterministic ramp.

use super::ParameterError;
use super::slow_ar1::half_scale;

/// Drift: X_t = slope · t, t in samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    slope: f64,
}

impl Drift {
    /// Code in model files.
    pub(crate) const CODE: &'static str = "DR";

    /// Slope (units per sample).
    ///
    /// # Errors
    /// When it is not finite.
    pub fn new(slope: f64) -> Result<Self, ParameterError> {
        if slope.is_finite() {
            Ok(Self { slope })
        } else {
            Err(ParameterError {
                process: Self::CODE,
                parameter: "slope",
                value: slope,
                domain: "a finite number",
            })
        }
    }

    /// Slope (units per sample).
    #[must_use]
    pub const fn slope(&self) -> f64 {
        self.slope
    }

    /// Haar wavelet variance at a level (units²), not centred: slope² tau²/16, tau = 2^level.
    pub(crate) fn haar_wv(&self, level: u32) -> f64 {
        self.slope * self.slope * Self::haar_shape(level)
    }

    /// Haar wavelet variance per unit of slope².
    #[must_use]
    pub fn haar_shape(level: u32) -> f64 {
        let m = half_scale(level);
        0.25 * m * m
    }
}
