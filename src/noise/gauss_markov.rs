//! First-order Gauss-Markov process: an AR1 described in continuous time.

use super::{Ar1, ParameterError, non_negative};

/// Gauss-Markov process: autocovariance s2·exp(−beta·|t|); sampled, an AR1 with phi = exp(−beta/f).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussMarkov {
    beta: f64,
    s2: f64,
    ar1: Ar1,
}

impl GaussMarkov {
    /// Code in model files.
    pub const CODE: &'static str = "GM";

    /// From the inverse correlation time beta (1/s), the stationary variance s2 (units²) and the rate (Hz).
    ///
    /// # Errors
    /// When beta or the rate is not positive, the variance is negative, or one is not finite.
    pub fn new(beta: f64, s2: f64, rate_hz: f64) -> Result<Self, ParameterError> {
        let positive = |parameter, value: f64| {
            if value.is_finite() && value > 0.0 {
                Ok(value)
            } else {
                Err(ParameterError { process: Self::CODE, parameter, value, domain: "a finite number > 0" })
            }
        };
        let x = positive("beta", beta)? / positive("rate_hz", rate_hz)?;
        let s2 = non_negative(Self::CODE, "s2", s2)?;
        let ar1 = Ar1::new((-x).exp(), s2 * -(-2.0 * x).exp_m1())?;
        Ok(Self { beta, s2, ar1 })
    }

    /// Inverse correlation time (1/s).
    #[must_use]
    pub const fn beta(&self) -> f64 {
        self.beta
    }

    /// Stationary variance (units²).
    #[must_use]
    pub const fn s2(&self) -> f64 {
        self.s2
    }

    /// The AR1 it is when sampled.
    #[must_use]
    pub const fn ar1(&self) -> Ar1 {
        self.ar1
    }
}
