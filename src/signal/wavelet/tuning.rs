//! Tuning of the robust wavelet variance: Tukey's biweight constant for a wanted efficiency.
//!
//! chi(r) = r²(1 − (r/c)²)⁴ on |r| ≤ c. With Z standard normal: a = E chi(Z), M = E\[Z² chi(Z)\] − a,
//! Q = E chi(Z)² − a², efficiency = M²/(2Q) ([Mondal and Percival](crate::bibliography::MondalPercival12)).

use super::{QuantizationResponse, WaveletError};
use statrs::function::erf::erf;
use std::f64::consts::{PI, SQRT_2};

/// Rule by which the constant follows from the efficiency.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Convention {
    /// From the definition.
    #[default]
    Exact,
    /// As the R packages wv, gmwm and simts compute it: the last but one term of Q has the wrong sign, so
    /// that their "0.6" is c = 4.973 and an efficiency of 0.727. To reproduce their numbers.
    Wv,
}

crate::named!(Convention { Exact = "exact", Wv = "wv" }, in files);

/// From this c on the efficiency grows with c.
const BRANCH: f64 = 2.6;

/// The constants of the robust estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuning {
    efficiency: f64,
    c: f64,
    a: f64,
    quantization: QuantizationResponse,
}

impl Default for Tuning {
    fn default() -> Self {
        Self::new(Self::DEFAULT_EFFICIENCY, Convention::Exact).expect("an efficiency in the range")
    }
}

impl Tuning {
    /// The usual efficiency: for the same scatter a record must be 1/0.6 times as long as with the classical variance, and
    /// up to 26 % of gross outliers leave the equation a root.
    pub const DEFAULT_EFFICIENCY: f64 = 0.6;
    /// Efficiencies that are taken, of c = 3.5 to 11.8. Below, more than two thirds of a record would be given away; above,
    /// hardly an outlier would be rejected.
    pub const EFFICIENCIES: (f64, f64) = (0.3, 0.99);

    /// For a wanted efficiency at the Gaussian model, 0.3 to 0.99.
    ///
    /// # Errors
    /// When the efficiency is out of this range.
    pub fn new(efficiency: f64, convention: Convention) -> Result<Self, WaveletError> {
        if !(Self::EFFICIENCIES.0..=Self::EFFICIENCIES.1).contains(&efficiency) {
            return Err(WaveletError::Efficiency(efficiency));
        }
        // The efficiency is 0.014 at c = 2.6 and 0.9999 at c = 40: the range asked for lies between.
        let (mut low, mut high) = (BRANCH, 40.0);
        // Halved until no number lies between.
        while let middle = 0.5 * (low + high)
            && low < middle
            && middle < high
        {
            if Moments::new(middle).efficiency(convention) < efficiency {
                low = middle;
            } else {
                high = middle;
            }
        }
        let moments = Moments::new(high);
        // The true efficiency, also under the convention of R: the degrees of freedom follow from it, not
        // from the label.
        let (efficiency, a) = (moments.efficiency(Convention::Exact), moments.chi());
        Ok(Self {
            efficiency,
            c: high,
            a,
            quantization: QuantizationResponse::new(high, a),
        })
    }

    /// Rejection point: coefficients beyond c standard deviations have no influence.
    #[must_use]
    pub const fn c(&self) -> f64 {
        self.c
    }

    /// E chi(Z), the consistency constant.
    #[must_use]
    pub const fn a(&self) -> f64 {
        self.a
    }

    /// Relative bias of the variance of few Gaussian coefficients times its degrees of freedom (it reads
    /// high): 0.295 at efficiency 0.6, 0 for the classical variance. To second order in the estimating
    /// equation it is 1 + 2 cov(chi, chi')/var chi − E chi''/E chi', derivatives with respect to ln s of
    /// chi(W/√s).
    #[must_use]
    pub fn bias(&self) -> f64 {
        Moments::new(self.c).bias()
    }

    /// Response of the robust wavelet variance to quantization noise.
    #[must_use]
    pub const fn quantization(&self) -> &QuantizationResponse {
        &self.quantization
    }

    /// True efficiency at the Gaussian model, whatever the convention says it is.
    #[must_use]
    pub const fn efficiency(&self) -> f64 {
        self.efficiency
    }
}

/// E\[Z^2k; |Z| ≤ c\], k = 0 … 10.
struct Moments {
    c: f64,
    even: [f64; 11],
}

impl Moments {
    fn new(c: f64) -> Self {
        let mut even = [erf(c / SQRT_2); 11];
        // By parts: E[Z^2k; |Z| ≤ c] = (2k − 1) E[Z^(2k−2); |Z| ≤ c] − 2 c^(2k−1) φ(c).
        let mut boundary = 2.0 * c * (-0.5 * c * c).exp() / (2.0 * PI).sqrt();
        for k in 1..=10 {
            even[k] = f64::from(2 * k as u8 - 1) * even[k - 1] - boundary;
            boundary *= c * c;
        }
        Self { c, even }
    }

    /// E\[Z^2p (1 − Z²/c²)^n\].
    fn bump(&self, p: usize, n: usize) -> f64 {
        // Binomial theorem: the sum of (n choose i)(−1)^i c^(−2i) E[Z^(2p+2i)].
        let (mut binomial, mut power, mut sum) = (1.0, 1.0, 0.0);
        for i in 0..=n {
            sum += binomial * power * self.even[p + i];
            binomial *= -((n - i) as f64) / (i + 1) as f64;
            power /= self.c * self.c;
        }
        sum
    }

    fn chi(&self) -> f64 {
        self.bump(1, 4)
    }

    fn bias(&self) -> f64 {
        let c2 = self.c * self.c;
        // chi = r² y⁴, chi' = −r² y⁴ + 4 r⁴ y³/c², chi'' = r² y⁴ − 12 r⁴ y³/c² + 12 r⁶ y²/c⁴ with y = 1 − r²/c².
        let first = 4.0 * self.bump(2, 3) / c2 - self.chi();
        let second = self.chi() - 12.0 * self.bump(2, 3) / c2 + 12.0 * self.bump(3, 2) / (c2 * c2);
        let variance = self.bump(2, 8) - self.chi() * self.chi();
        // chi·chi' = 4 r⁶ y⁷/c² − r⁴ y⁸.
        let covariance = 4.0 * self.bump(3, 7) / c2 - self.bump(2, 8) - self.chi() * first;
        // E δ of δ = ln(nu_hat/nu), times eta, is the rest; the 1 is that of E(e^δ − 1) = E δ + var(δ)/2 with
        // var δ = 2/eta.
        1.0 + 2.0 * covariance / variance - second / first
    }

    fn efficiency(&self, convention: Convention) -> f64 {
        let a = self.chi();
        let m = self.bump(2, 4) - a;
        let slip = match convention {
            Convention::Exact => 0.0,
            // The term of Q in Z^18 is −8 E[Z^18]/c^14; theirs has a plus, 16 of it too much.
            Convention::Wv => 16.0 * self.even[9] / self.c.powi(14),
        };
        let q = self.bump(2, 8) - a * a + slip;
        m * m / (2.0 * q)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Published by the R package wv, as its source computes them.
    #[test]
    fn the_convention_of_wv_reproduces_its_constants() {
        let t = Tuning::new(0.6, Convention::Wv).unwrap();
        assert_relative_eq!(t.c(), 4.973362, max_relative = 1e-6);
        assert_relative_eq!(t.a(), 0.636724, max_relative = 1e-6);
        assert_relative_eq!(t.efficiency(), 0.727, max_relative = 1e-3);
    }

    #[test]
    fn efficiencies_without_a_constant_are_refused() {
        for efficiency in [f64::NAN, 0.0, 0.29, 0.995, 1.0, 60.0] {
            assert!(
                Tuning::new(efficiency, Convention::Exact).is_err(),
                "{efficiency}"
            );
        }
        for efficiency in [0.3, 0.99] {
            let t = Tuning::new(efficiency, Convention::Exact).unwrap();
            assert_relative_eq!(t.efficiency(), efficiency, max_relative = 1e-12);
        }
    }
}
