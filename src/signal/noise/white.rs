//! White noise: independent samples.

use super::ar1::half_scale;
use super::{Kind, ParameterError, checked};

/// White noise: independent samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct White {
    sigma2: f64,
}

impl White {
    /// Variance of a sample (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(sigma2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            sigma2: checked(Kind::White, "sigma2", sigma2)?,
        })
    }

    /// Variance of a sample (units²).
    pub const fn sigma2(&self) -> f64 {
        self.sigma2
    }

    /// Haar wavelet variance per unit of sigma2.
    pub fn haar_shape(level: u32) -> f64 {
        0.5 / half_scale(level)
    }
}

// Quantization noise: X_t = √(12 Q²) (U_t − U_{t−1}), U uniform on (0, 1); variance 2 Q².

/// Quantization noise: X_t = √(12 Q²) (U_t − U_{t−1}), U uniform on (0, 1); variance 2 Q².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantization {
    q2: f64,
}

impl Quantization {
    /// Q² (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(q2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            q2: checked(Kind::Quantization, "q2", q2)?,
        })
    }

    /// Q² (units²).
    pub const fn q2(&self) -> f64 {
        self.q2
    }

    /// Haar wavelet variance per unit of Q².
    pub fn haar_shape(level: u32) -> f64 {
        let m = half_scale(level);
        1.5 / (m * m)
    }
}

// Random walk: the running sum of white increments.

/// Random walk: the running sum of white increments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomWalk {
    gamma2: f64,
}

impl RandomWalk {
    /// Variance of an increment (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(gamma2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            gamma2: checked(Kind::RandomWalk, "gamma2", gamma2)?,
        })
    }

    /// Variance of an increment (units²).
    pub const fn gamma2(&self) -> f64 {
        self.gamma2
    }

    /// Haar wavelet variance per unit of gamma2.
    pub fn haar_shape(level: u32) -> f64 {
        let tau = 2.0 * half_scale(level);
        (tau * tau + 2.0) / (12.0 * tau)
    }
}

// Drift: a deterministic ramp.

/// Drift: X_t = slope · t, t in samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    slope: f64,
}

impl Drift {
    /// Slope (units per sample).
    ///
    /// # Errors
    /// When it is not finite.
    pub fn new(slope: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            slope: checked(Kind::Drift, "slope", slope)?,
        })
    }

    /// Slope (units per sample).
    pub const fn slope(&self) -> f64 {
        self.slope
    }

    /// Haar wavelet variance per unit of slope².
    pub fn haar_shape(level: u32) -> f64 {
        let m = half_scale(level);
        0.25 * m * m
    }
}
