//! First-order moving average: X_t = W_t + theta W_{t−1}.

use super::slow_ar1::half_scale;
use super::{ParameterError, non_negative};

/// First-order moving average, invertible: |theta| ≤ 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ma1 {
    theta: f64,
    sigma2: f64,
}

impl Ma1 {
    /// Code in model files.
    pub(crate) const CODE: &'static str = "MA1";

    /// From the coefficient (dimensionless) and the innovation variance (units²).
    ///
    /// # Errors
    /// When |theta| > 1, the variance is negative, or either is not finite.
    pub fn new(theta: f64, sigma2: f64) -> Result<Self, ParameterError> {
        if !(theta.is_finite() && theta.abs() <= 1.0) {
            return Err(ParameterError {
                process: Self::CODE,
                parameter: "theta",
                value: theta,
                domain: "between −1 and 1",
            });
        }
        Ok(Self {
            theta,
            sigma2: non_negative(Self::CODE, "sigma2", sigma2)?,
        })
    }

    /// Coefficient.
    #[must_use]
    pub const fn theta(&self) -> f64 {
        self.theta
    }

    /// Innovation variance (units²).
    #[must_use]
    pub const fn sigma2(&self) -> f64 {
        self.sigma2
    }

    /// Haar wavelet variance at a level (units²): sigma2 [m(1 + theta)² − 3 theta]/(2m²), m = 2^(level−1).
    #[must_use]
    pub fn haar_wv(&self, level: u32) -> f64 {
        self.sigma2 * Self::haar_shape(self.theta, level).0
    }

    /// Haar wavelet variance per unit of sigma2, and its derivative with respect to theta.
    #[must_use]
    pub fn haar_shape(theta: f64, level: u32) -> (f64, f64) {
        let m = half_scale(level);
        let sum = 1.0 + theta;
        (
            (m * sum * sum - 3.0 * theta) / (2.0 * m * m),
            (2.0 * m * sum - 3.0) / (2.0 * m * m),
        )
    }
}
