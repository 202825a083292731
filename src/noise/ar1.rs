//! First-order autoregressive process: X_t = phi X_{t−1} + W_t, W white with variance sigma2.

use super::{ParameterError, non_negative};

/// First-order autoregressive process, stationary: |phi| < 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ar1 {
    phi: f64,
    sigma2: f64,
}

impl Ar1 {
    /// Code in model files.
    pub const CODE: &'static str = "AR1";

    /// From the coefficient (dimensionless) and the innovation variance (units²).
    ///
    /// # Errors
    /// When |phi| ≥ 1, the variance is negative, or either is not finite.
    pub fn new(phi: f64, sigma2: f64) -> Result<Self, ParameterError> {
        if !(phi.is_finite() && phi.abs() < 1.0) {
            return Err(ParameterError {
                process: Self::CODE,
                parameter: "phi",
                value: phi,
                domain: "between −1 and 1 (exclusive)",
            });
        }
        Ok(Self { phi, sigma2: non_negative(Self::CODE, "sigma2", sigma2)? })
    }

    /// Coefficient.
    #[must_use]
    pub const fn phi(&self) -> f64 {
        self.phi
    }

    /// Innovation variance (units²).
    #[must_use]
    pub const fn sigma2(&self) -> f64 {
        self.sigma2
    }

    /// Stationary variance sigma2/(1 − phi²) (units²).
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.sigma2 / ((1.0 - self.phi) * (1.0 + self.phi))
    }
}
