//! Drift: a deterministic ramp.

use super::ParameterError;

/// Drift: X_t = slope · t, t in samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    slope: f64,
}

impl Drift {
    /// Code in model files.
    pub const CODE: &'static str = "DR";

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
}
