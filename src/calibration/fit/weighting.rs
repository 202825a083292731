//! Weights of the scales in a fit.

use crate::wavelet::Curve;

/// Omega: the weights of the scales.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weighting {
    /// edof/(2 nu(theta)²), the inverse variance of nu_hat where the model holds, with edof limited by what recordings differ
    /// by. The fit is repeated until the weights are those of its own result; a variance that is low by chance weighs no more
    /// than others. A robust one that is high beyond chance weighs less with the fourth power of how high it is, so that a
    /// step or a shock at some scales does not draw the model with it.
    #[default]
    Model,
    /// edof/(2 nu_hat²), the convention of the literature: what is low by chance weighs most.
    Edof,
}

nav_sim_signal::named!(
    Weighting {
        Model = "model",
        Edof = "edof",
    }, in files
);

impl Weighting {
    /// √Omega_j of each scale (1/units²), where its variance is taken to be `nu`.
    pub(crate) fn roots(self, curve: &Curve, nu: &[f64]) -> Vec<f64> {
        // A classical variance has no protection of its own that its weight could keep.
        if self == Self::Model && curve.quantization.is_some() {
            let plain = inverse_deviations(curve, nu).into_iter();
            let scales = curve.wv.iter().zip(nu).zip(&curve.edof);
            return plain
                .zip(scales)
                .map(|(root, ((wv, nu), edof))| root * trust(wv / nu, *edof))
                .collect();
        }
        let root = |((nu, edof), level): ((&f64, &f64), &u32)| match self {
            _ if curve.ignored.contains(level) => 0.0,
            // var nu_hat = 2 nu²/eta.
            Self::Model => 1.0 / (nu * (2.0 / edof + curve.differing).sqrt()),
            Self::Edof => (0.5 * edof).sqrt() / nu,
        };
        nu.iter()
            .zip(&curve.edof)
            .zip(&curve.levels)
            .map(root)
            .collect()
    }
}

/// 1/(standard deviation of nu_hat) where the variance is `nu`, of scales that count; 0 of others.
pub(crate) fn inverse_deviations(curve: &Curve, nu: &[f64]) -> Vec<f64> {
    let root = |((nu, edof), level): ((&f64, &f64), &u32)| match curve.ignored.contains(level) {
        true => 0.0,
        // var nu_hat = 2 nu²/eta by its own noise; var ln nu by what recordings differ by.
        false => 1.0 / (nu * (2.0 / edof + curve.differing).sqrt()),
    };
    nu.iter()
        .zip(&curve.edof)
        .zip(&curve.levels)
        .map(root)
        .collect()
}

/// Factor of √Omega where a variance is so many times that of the model: 1 up to one standard deviation above it, the inverse
/// square from two on. On 120 contaminated sets of Minaretzis' Section IV this gave random walks as near as
/// [`Weighting::Edof`] does, and on clean ones a median nearer to the truth (docs/mathematics.md).
///
/// Of fewer than four degrees of freedom two standard deviations are still chance, and the last scale of a recording is all
/// that tells of its random walk: such a scale loses its weight from two to three.
fn trust(ratio: f64, edof: f64) -> f64 {
    const FEWEST: f64 = 4.0;
    let begin = if edof < FEWEST { 2.0 } else { 1.0 };
    let above = (score(ratio, edof) - begin).clamp(0.0, 1.0);
    // Smooth at either end: the derivatives of a fit with respect to its curve rest on that of the weights.
    ratio.powf(-2.0 * above * above * (3.0 - 2.0 * above))
}

/// The normal score of a chi-square over its degrees of freedom (Wilson and Hilferty): of few degrees the ratio less one over
/// its deviation would never be far below zero, however improbable it is.
pub(crate) fn score(ratio: f64, edof: f64) -> f64 {
    // (chi²/eta)^(1/3) is nearly normal with mean 1 − 2/(9 eta) and variance 2/(9 eta).
    let variance = 2.0 / (9.0 * edof);
    (ratio.cbrt() - 1.0 + variance) / variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wavelet::Tuning;
    use approx::assert_relative_eq;

    /// Variances twice the model's but for the last scale, which does not count.
    fn curve(edof: f64) -> Curve {
        let (levels, ignored) = (vec![1, 2], vec![2]);
        Curve {
            wv: vec![6.0, 6.0],
            edof: vec![edof; 2],
            levels,
            ignored,
            differing: 0.04,
            ..Curve::default()
        }
    }

    #[test]
    fn weights_are_inverse_deviations_of_the_model() {
        let curve = curve(50.0);
        for (weighting, root) in [
            (Weighting::Model, 1.0 / (3.0 * (0.04_f64 + 0.04).sqrt())),
            (Weighting::Edof, 1.0 / (3.0 * 0.2)),
        ] {
            let roots = weighting.roots(&curve, &[3.0, 3.0]);
            assert_relative_eq!(roots[0], root, max_relative = 1e-9);
            assert_eq!(roots[1], 0.0, "{weighting:?}");
        }
    }

    /// A robust variance counts less from one standard deviation above the model on (two of few degrees of freedom), and as
    /// the inverse square of the ratio one further on. At s deviations it is (1 − v + s√v)³, v = 2/(9 eta).
    #[test]
    fn a_robust_scale_that_is_too_high_loses_its_weight() {
        for (edof, begin) in [(50.0, 1.0), (3.0, 2.0)] {
            let plain = curve(edof);
            let quantization = Some(*Tuning::default().quantization());
            let robust = Curve {
                quantization,
                ..plain.clone()
            };
            for (beyond, power) in [
                (-3.0, 0.0),
                (-0.01, 0.0),
                (0.5, 1.0),
                (1.0, 2.0),
                (2.0, 2.0),
            ] {
                let v: f64 = 2.0 / (9.0 * edof);
                let ratio = (1.0 - v + (begin + beyond) * v.sqrt()).powi(3);
                let nu = [6.0 / ratio, 3.0];
                let expected = inverse_deviations(&plain, &nu)[0] / ratio.powf(power);
                assert_relative_eq!(
                    Weighting::Model.roots(&robust, &nu)[0],
                    expected,
                    max_relative = 1e-9
                );
            }
            let nu = [3.0, 3.0];
            let deviation = 3.0 * (2.0 / edof + 0.04).sqrt();
            assert_relative_eq!(
                inverse_deviations(&plain, &nu)[0],
                1.0 / deviation,
                max_relative = 1e-12
            );
            for curve in [&plain, &robust] {
                assert_eq!(
                    Weighting::Edof.roots(curve, &nu),
                    Weighting::Edof.roots(&plain, &nu)
                );
            }
        }
    }
}
