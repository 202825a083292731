//! Quantization noise: X_t = √(12 Q²) (U_t − U_{t−1}), U uniform on (0, 1); variance 2 Q².

use super::slow_ar1::half_scale;
use super::{ParameterError, non_negative};

/// Quantization noise: X_t = √(12 Q²) (U_t − U_{t−1}), U uniform on (0, 1); variance 2 Q².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantization {
    q2: f64,
}

impl Quantization {
    /// Code in model files.
    pub(crate) const CODE: &'static str = "QN";

    /// Q² (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(q2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            q2: non_negative(Self::CODE, "q2", q2)?,
        })
    }

    /// Q² (units²).
    #[must_use]
    pub const fn q2(&self) -> f64 {
        self.q2
    }

    /// Haar wavelet variance at a level (units²): 6 Q²/tau², tau = 2^level.
    pub(crate) fn haar_wv(&self, level: u32) -> f64 {
        self.q2 * Self::haar_shape(level)
    }

    /// Haar wavelet variance per unit of Q².
    #[must_use]
    pub fn haar_shape(level: u32) -> f64 {
        let m = half_scale(level);
        1.5 / (m * m)
    }
}
