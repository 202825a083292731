//! Expectations under the laws of parameters.

use crate::noise::{Law, Parameter};
use nalgebra::{DMatrix, SymmetricEigen};

/// Number of nodes by which a law is replaced: exact for polynomials of degree 95 under a beta law.
const NODES: usize = 48;
/// A normal law is cut off so many standard deviations from its centre: 1e-19 of it lies beyond.
const CUT: f64 = 9.0;

/// Values and weights (of sum 1) that stand for the law of a parameter about `centre` (the model's value).
pub(super) fn nodes(law: Law, centre: f64, parameter: Parameter) -> Vec<(f64, f64)> {
    match law {
        Law::Beta { a, b, low, width } => beta(a, b).map(|(x, w)| (low + width * x, w)).collect(),
        Law::Normal { sd } if sd > 0.0 => normal(centre, sd, parameter.domain()),
        Law::Normal { .. } => vec![(centre, 1.0)],
        Law::Lognormal { median, sd, .. } if sd > 0.0 => {
            let scaled = normal(
                parameter.scaled(median),
                sd,
                (f64::NEG_INFINITY, f64::INFINITY),
            );
            scaled
                .into_iter()
                .map(|(x, w)| (parameter.unscaled(x), w))
                .collect()
        }
        Law::Lognormal { median, .. } => vec![(median, 1.0)],
    }
}

/// A truncated normal law by Gauss-Legendre quadrature of its density.
fn normal(centre: f64, sd: f64, (low, high): (f64, f64)) -> Vec<(f64, f64)> {
    let (low, high) = (low.max(centre - CUT * sd), high.min(centre + CUT * sd));
    let density = |x: f64| (-0.5 * ((x - centre) / sd).powi(2)).exp();
    // Legendre's weight is Jacobi's with alpha = beta = 0.
    let raw = beta(1.0, 1.0).map(|(u, w)| (low + (high - low) * u, w));
    let raw: Vec<_> = raw.map(|(x, w)| (x, w * density(x))).collect();
    let total: f64 = raw.iter().map(|(_, w)| w).sum();
    // Truncation takes some of the law away: what is left is made a law again.
    raw.into_iter().map(|(x, w)| (x, w / total)).collect()
}

/// Gauss-Jacobi quadrature for B ~ Beta(a, b): the eigenvalues of the Jacobi matrix, and the squares of the
/// first components of its eigenvectors (Golub and Welsch).
fn beta(a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> {
    // Jacobi's weight on (−1, 1) is (1 − x)^alpha (1 + x)^beta, and u = (1 + x)/2 has the density
    // u^(a−1) (1 − u)^(b−1): alpha goes with b.
    let (alpha, beta) = (b - 1.0, a - 1.0);
    let sum = alpha + beta;
    let diagonal = |k: usize| {
        let s = 2.0 * k as f64 + sum;
        match k {
            // The general forms are 0/0 here for alpha + beta = 0 and, below, −1: the common factor is
            // cancelled.
            0 => (beta - alpha) / (sum + 2.0),
            _ => (beta * beta - alpha * alpha) / (s * (s + 2.0)),
        }
    };
    let squared = |k: usize| {
        let (k, s) = (k as f64, 2.0 * k as f64 + sum);
        match k {
            1.0 => 4.0 * (1.0 + alpha) * (1.0 + beta) / ((sum + 2.0).powi(2) * (sum + 3.0)),
            _ => 4.0 * k * (k + alpha) * (k + beta) * (k + sum) / (s * s * (s + 1.0) * (s - 1.0)),
        }
    };
    let matrix = DMatrix::from_fn(NODES, NODES, |i, j| match i.abs_diff(j) {
        0 => diagonal(i),
        1 => squared(i.max(j)).sqrt(),
        _ => 0.0,
    });
    let eigen = SymmetricEigen::new(matrix);
    // The law has mass 1, so the squared components are the weights as they are.
    (0..NODES).map(move |i| {
        (
            0.5 * (1.0 + eigen.eigenvalues[i]),
            eigen.eigenvectors[(0, i)].powi(2),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(law: Law, centre: f64, parameter: Parameter, f: impl Fn(f64) -> f64) -> f64 {
        nodes(law, centre, parameter)
            .into_iter()
            .map(|(x, w)| w * f(x))
            .sum()
    }

    /// E B^k = Π (a + i)/(a + b + i).
    #[test]
    fn moments_of_beta_laws() {
        for (a, b) in [(6.0, 2.0), (2.2, 6.1), (1.0, 1.0), (0.5, 0.7), (1.8, 3.5)] {
            let law = Law::Beta {
                a,
                b,
                low: 0.0,
                width: 1.0,
            };
            for k in 0..12 {
                let exact: f64 = (0..k)
                    .map(|i| (a + f64::from(i)) / (a + b + f64::from(i)))
                    .product();
                let found = mean(law, 0.0, Parameter::Sigma2, |x| x.powi(k));
                assert!(
                    (found - exact).abs() < 1e-13,
                    "{a}, {b}, {k}: {found} {exact}"
                );
            }
        }
    }

    /// Half a normal: mean √(2/π)·sd. A whole one: its moment-generating function at ½.
    #[test]
    fn moments_of_normal_laws() {
        let law = Law::Normal { sd: 2.0 };
        let half = mean(law, 0.0, Parameter::Sigma2, |x| x);
        assert!(
            (half - 2.0 * (2.0 / std::f64::consts::PI).sqrt()).abs() < 1e-11,
            "{half}"
        );
        let whole = mean(law, 3.0, Parameter::Slope, |x| (0.5 * x).exp());
        assert!((whole / 2.0_f64.exp() - 1.0).abs() < 1e-11, "{whole}");
        assert_eq!(
            nodes(Law::Normal { sd: 0.0 }, 3.0, Parameter::Sigma2),
            [(3.0, 1.0)]
        );
    }

    /// E exp(k(mu + sd Z)) = median^k exp(k² sd²/2); of phi the logarithm of 1/κ is normal, so E κ likewise.
    #[test]
    fn moments_of_lognormal_laws() {
        let law = Law::Lognormal {
            median: 3.0,
            sd: 0.5,
            ci95: None,
        };
        for k in 1..4 {
            let exact = (3.0_f64.ln() * f64::from(k) + 0.125 * f64::from(k * k)).exp();
            let found = mean(law, 1.0, Parameter::Sigma2, |x| x.powi(k));
            assert!((found / exact - 1.0).abs() < 1e-11, "{k}: {found} {exact}");
        }
        let law = Law::Lognormal {
            median: 0.9,
            sd: 0.5,
            ci95: None,
        };
        let kappa = mean(law, 0.5, Parameter::Phi, |phi| -phi.ln());
        assert!(
            (kappa / (-0.9_f64.ln() * 0.125_f64.exp()) - 1.0).abs() < 1e-11,
            "{kappa}"
        );
    }
}
