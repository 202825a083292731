//! Random walk: the running sum of white increments.

use super::slow_ar1::half_scale;
use super::{ParameterError, non_negative};

/// Random walk: the running sum of white increments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomWalk {
    gamma2: f64,
}

impl RandomWalk {
    /// Code in model files.
    pub(crate) const CODE: &'static str = "RW";

    /// Variance of an increment (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(gamma2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            gamma2: non_negative(Self::CODE, "gamma2", gamma2)?,
        })
    }

    /// Variance of an increment (units²).
    #[must_use]
    pub const fn gamma2(&self) -> f64 {
        self.gamma2
    }

    /// Haar wavelet variance at a level (units²): gamma2 (tau² + 2)/(12 tau), tau = 2^level.
    pub(crate) fn haar_wv(&self, level: u32) -> f64 {
        self.gamma2 * Self::haar_shape(level)
    }

    /// Haar wavelet variance per unit of gamma2.
    #[must_use]
    pub fn haar_shape(level: u32) -> f64 {
        let tau = 2.0 * half_scale(level);
        (tau * tau + 2.0) / (12.0 * tau)
    }
}
