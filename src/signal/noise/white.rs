//! White noise: independent samples.

use super::slow_ar1::half_scale;
use super::{ParameterError, non_negative};

/// White noise: independent samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct White {
    sigma2: f64,
}

impl White {
    /// Code in model files.
    pub(crate) const CODE: &'static str = "WN";

    /// Variance of a sample (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(sigma2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            sigma2: non_negative(Self::CODE, "sigma2", sigma2)?,
        })
    }

    /// Variance of a sample (units²).
    #[must_use]
    pub const fn sigma2(&self) -> f64 {
        self.sigma2
    }

    /// Haar wavelet variance at a level (units²): sigma2/tau, tau = 2^level.
    pub(crate) fn haar_wv(&self, level: u32) -> f64 {
        self.sigma2 * Self::haar_shape(level)
    }

    /// Haar wavelet variance per unit of sigma2.
    #[must_use]
    pub fn haar_shape(level: u32) -> f64 {
        0.5 / half_scale(level)
    }
}
