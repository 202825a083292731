//! Weights of the scales in a fit.

use crate::wavelet::{Curve, interval};

/// Omega: the weights of the scales.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weighting {
    /// edof/(2 nu(theta)²), the inverse variance of nu_hat where the model holds. The fit is repeated until the weights
    /// are those of its own result, which makes it the maximum-likelihood estimate of independent chi-squares; a
    /// variance that is low by chance weighs no more than others.
    #[default]
    Model,
    /// edof/(2 nu_hat²), the convention of the literature: what is low by chance weighs most.
    Edof,
    /// 1/(width of the 95 % interval)².
    Interval,
    /// 1 for every scale.
    None,
    /// The inverse of the covariance of nu_hat over all scales.
    Full,
}

nav_sim_signal::named!(
    Weighting {
        Model = "model",
        Edof = "edof",
        Interval = "ci",
        None = "none",
        Full = "full",
    }, in files
);

impl Weighting {
    /// √Omega_j of each scale (1/units²), where its variance is taken to be `nu`.
    pub(crate) fn roots(self, curve: &Curve, nu: &[f64]) -> Vec<f64> {
        let root = |((nu, edof), level): ((&f64, &f64), &u32)| match self {
            _ if curve.ignored.contains(level) => 0.0,
            // var nu_hat = 2 nu²/eta.
            Self::Model | Self::Edof | Self::Full => (0.5 * edof).sqrt() / nu,
            Self::Interval => {
                let (low, high) = interval::interval(*nu, *edof, 0.95);
                1.0 / (high - low)
            }
            Self::None => 1.0,
        };
        nu.iter().zip(&curve.edof).zip(&curve.levels).map(root).collect()
    }
}
