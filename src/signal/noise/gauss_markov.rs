//! First-order Gauss-Markov process: an AR1 described in continuous time.

use super::ar1::fast_shape;
use super::slow_ar1::{Slow, half_scale};
use super::{Ar1, ParameterError, non_negative};
use std::f64::consts::LN_2;

/// Gauss-Markov process: autocovariance s2·exp(−beta·|t|); sampled, an AR1 with phi = exp(−beta/f).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussMarkov {
    beta: f64,
    s2: f64,
    rate_hz: f64,
    ar1: Ar1,
}

impl GaussMarkov {
    /// Code in model files.
    pub(crate) const CODE: &'static str = "GM";
    /// Largest Allan deviation over standard deviation, reached with averages of [`Self::ALLAN_PEAK_AT`]
    /// correlation times: with averages of x correlation times the Allan variance is
    /// s2·(2/x)·[1 − (3 − 4e^(−x) + e^(−2x))/(2x)].
    pub(crate) const ALLAN_PEAK: f64 = 0.617_364_283_144_441_3;
    /// Averaging time of the largest Allan deviation (correlation times).
    pub(crate) const ALLAN_PEAK_AT: f64 = 1.892_617_8;

    /// From the inverse correlation time beta (1/s), the stationary variance s2 (units²) and the rate (Hz).
    ///
    /// # Errors
    /// When beta or the rate is not positive, the variance is negative, or one is not finite.
    pub fn new(beta: f64, s2: f64, rate_hz: f64) -> Result<Self, ParameterError> {
        let positive = |parameter, value: f64| {
            if value.is_finite() && value > 0.0 {
                Ok(value)
            } else {
                Err(ParameterError {
                    process: Self::CODE,
                    parameter,
                    value,
                    domain: "a finite number > 0",
                })
            }
        };
        let x = positive("beta", beta)? / positive("rate_hz", rate_hz)?;
        let s2 = non_negative(Self::CODE, "s2", s2)?;
        // sigma2 = s2 (1 − phi²) by expm1: of a slow process phi² is next to 1 and the difference would lose
        // its digits.
        let ar1 = Ar1::new((-x).exp(), s2 * -(-2.0 * x).exp_m1())?;
        Ok(Self {
            beta,
            s2,
            rate_hz,
            ar1,
        })
    }

    /// Inverse correlation time (1/s).
    #[must_use]
    pub const fn beta(&self) -> f64 {
        self.beta
    }

    /// Sample rate (Hz).
    #[must_use]
    pub const fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Stationary variance (units²).
    #[must_use]
    pub const fn s2(&self) -> f64 {
        self.s2
    }

    /// The same process sampled: an AR1 with phi = e^(−beta/f) and sigma2 = s2 (1 − phi²).
    #[must_use]
    pub const fn ar1(&self) -> Ar1 {
        self.ar1
    }

    /// Haar wavelet variance at a level (units²), scale tau = 2^level samples.
    pub(crate) fn haar_wv(&self, level: u32) -> f64 {
        self.s2 * Self::haar_shape(self.beta / self.rate_hz, level).0
    }

    /// Haar wavelet variance per unit of s2, and its derivative with respect to kappa = beta/f, the inverse
    /// correlation time in samples.
    #[must_use]
    pub fn haar_shape(kappa: f64, level: u32) -> (f64, f64) {
        let m = half_scale(level);
        if kappa < LN_2 {
            let bracket = Slow::new(kappa).bracket(m);
            let value = 2.0 * kappa * bracket.value;
            (value, 2.0 * bracket.value + value * bracket.log_derivative)
        } else {
            let phi = (-kappa).exp();
            // phi ≤ ½: nothing cancels in the form of phi. d/dκ = −phi d/dphi, and 1 − phi² is sigma2/s2.
            let variance = (1.0 - phi) * (1.0 + phi);
            let (value, derivative) = fast_shape(phi, m);
            (
                value * variance,
                -phi * (derivative * variance - 2.0 * phi * value),
            )
        }
    }
}
