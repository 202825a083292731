//! Where consistency statistics of a correct filter lie: NEES and NIS means, coverage.

use serde::Serialize;
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF, Normal};

/// Where a statistic of a correct filter lies, 95 % unless said otherwise (discrete ones: at least).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// 2.5 % (or what was asked for) lie below.
    pub lower: f64,
    /// As many lie above.
    pub upper: f64,
}

impl Band {
    const NONE: Self = Self {
        lower: f64::NAN,
        upper: f64::NAN,
    };

    /// Whether a value lies in the band, its ends included.
    pub(crate) fn contains(&self, value: f64) -> bool {
        self.lower <= value && value <= self.upper
    }
}

/// The band of the mean of `count` independent chi-square statistics of `dof` degrees of freedom:
/// χ²(count·dof)/count ([Bar-Shalom et al.](crate::bibliography::BarShalom01), sec. 5.4).
#[must_use]
pub fn chi_square_band(dof: usize, count: f64) -> Band {
    chi_square_interval(dof, count, 0.025)
}

/// The same with probability `tail` on each side. `count` need not be whole: so many independent values the
/// mean is worth.
pub(crate) fn chi_square_interval(dof: usize, count: f64, tail: f64) -> Band {
    if dof == 0 || count.is_nan() || count <= 0.0 {
        return Band::NONE;
    }
    // The sum of independent chi-square variables is one of the sum of their degrees of freedom.
    let total = dof as f64 * count;
    let mean_at = |p: f64| chi_square_quantile(total, p) / count;
    Band {
        lower: mean_at(tail),
        upper: mean_at(1.0 - tail),
    }
}

/// Exact to rounding up to 10⁵ degrees of freedom; above, by Wilson and Hilferty's cube root of a normal,
/// whose relative error there is below 1e-8 at 2.5 % and below 1e-6 at 1e-4.
fn chi_square_quantile(dof: f64, p: f64) -> f64 {
    if dof > 1e5 {
        let c = 2.0 / (9.0 * dof);
        let z = Normal::new(0.0, 1.0).map_or(f64::NAN, |normal| normal.inverse_cdf(p));
        // (χ²/dof)^(1/3) is nearly normal with mean 1 − 2/(9 dof) and variance 2/(9 dof).
        return dof * (1.0 - c + z * c.sqrt()).powi(3);
    }
    ChiSquared::new(dof).map_or(f64::NAN, |chi_square| chi_square.inverse_cdf(p))
}

/// The band of the share of `count` independent runs that a region of probability `level` covers.
pub(crate) fn coverage_band(level: f64, count: f64) -> Band {
    let whole = count as u64;
    match Binomial::new(level, whole) {
        Ok(binomial) if whole > 0 => {
            // The binomial law is discrete: the smallest count that reaches p, so that the band holds 95 % or
            // more.
            let quantile = |p: f64| binomial.inverse_cdf(p) as f64 / whole as f64;
            Band {
                lower: quantile(0.025),
                upper: quantile(0.975),
            }
        }
        _ => Band::NONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles from tables: χ²(9): 2.7004, 19.0228; χ²(900): 818.756, 985.032.
    #[test]
    fn chi_square_bands_agree_with_tables() {
        let one = chi_square_band(9, 1.0);
        assert!(
            (one.lower - 2.700_39).abs() < 1e-5 && (one.upper - 19.022_77).abs() < 1e-5,
            "{one:?}"
        );
        let hundred = chi_square_band(9, 100.0);
        let (lower, upper) = (8.187_56, 9.850_32);
        assert!(
            (hundred.lower - lower).abs() < 1e-4 && (hundred.upper - upper).abs() < 1e-4,
            "{hundred:?}"
        );
    }

    #[test]
    fn the_approximation_for_many_degrees_of_freedom_joins_the_exact_quantile() {
        for (p, bound) in [(1e-4, 1e-6), (0.025, 1e-8), (0.975, 1e-8), (0.9999, 1e-6)] {
            let exact = ChiSquared::new(1.01e5).unwrap().inverse_cdf(p);
            let error = (chi_square_quantile(1.01e5, p) / exact - 1.0).abs();
            assert!(error < bound, "{error:e} at {p}");
        }
    }

    /// Binomial(100, 0.95): P(X ≤ 89) = 1.1 %, P(X ≤ 90) = 2.8 %, P(X ≤ 98) = 96.3 %, P(X ≤ 99) = 99.4 %.
    #[test]
    fn coverage_band_agrees_with_binomial_tables() {
        assert_eq!(
            coverage_band(0.95, 100.0),
            Band {
                lower: 0.90,
                upper: 0.99
            }
        );
        assert!(coverage_band(0.95, 0.0).lower.is_nan());
    }
}
