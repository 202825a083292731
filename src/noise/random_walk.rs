//! Random walk: the running sum of white increments.

use super::{ParameterError, non_negative};

/// Random walk: the running sum of white increments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomWalk {
    gamma2: f64,
}

impl RandomWalk {
    /// Code in model files.
    pub const CODE: &'static str = "RW";

    /// Variance of an increment (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(gamma2: f64) -> Result<Self, ParameterError> {
        Ok(Self { gamma2: non_negative(Self::CODE, "gamma2", gamma2)? })
    }

    /// Variance of an increment (units²).
    #[must_use]
    pub const fn gamma2(&self) -> f64 {
        self.gamma2
    }
}
