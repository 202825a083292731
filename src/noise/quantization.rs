//! Quantization noise: X_t = √(12 Q²) (U_t − U_{t−1}), U uniform on (0, 1); variance 2 Q².

use super::{ParameterError, non_negative};

/// Quantization noise: X_t = √(12 Q²) (U_t − U_{t−1}), U uniform on (0, 1); variance 2 Q².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantization {
    q2: f64,
}

impl Quantization {
    /// Code in model files.
    pub const CODE: &'static str = "QN";

    /// Q² (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(q2: f64) -> Result<Self, ParameterError> {
        Ok(Self { q2: non_negative(Self::CODE, "q2", q2)? })
    }

    /// Q² (units²).
    #[must_use]
    pub const fn q2(&self) -> f64 {
        self.q2
    }
}
