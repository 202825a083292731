//! Accuracy of estimates: bias, spread and RMSE about the target over many sets.

use crate::curve::robust_scale::{MAD_TO_DEVIATION, median};
use crate::rng::StreamKey;
use rand::RngExt;

/// Resamples of the bootstrap: a standard error is then known to 1/√(2·1000) = 2 %.
const RESAMPLES: usize = 1000;

/// Errors of one estimator in one parameter, relative to the target.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Accuracy {
    /// Median of the relative errors.
    pub bias: f64,
    /// Standard error of the bias over draws of the sets.
    pub bias_se: f64,
    /// 1.4826·MAD of the relative errors.
    pub spread: f64,
    /// √(bias² + spread²) ([Minaretzis](crate::bibliography::Minaretzis24), eq. 15).
    pub rmse: f64,
    /// Standard error of the RMSE.
    pub rmse_se: f64,
    /// The RMSE of each resample of the sets; the n-th of every estimator is of the same sets.
    #[serde(skip)]
    pub resampled: Vec<f64>,
}

impl Accuracy {
    /// The ratio of this RMSE to another's on the same sets, and its standard error.
    #[must_use]
    pub fn ratio_to(&self, other: &Self) -> (f64, f64) {
        let ratios: Vec<f64> = self
            .resampled
            .iter()
            .zip(&other.resampled)
            .map(|(a, b)| a / b)
            .collect();
        // The deviation of the ratios themselves: the errors of two estimators on one set are correlated, and
        // most of that cancels.
        let error = if self.rmse_se.is_nan() {
            f64::NAN
        } else {
            standard_deviation(&ratios)
        };
        (self.rmse / other.rmse, error)
    }
}

/// The accuracy of estimates of a parameter whose target is `target`; NaN without estimates.
///
/// Monte-Carlo errors are standard deviations over a bootstrap of the sets. The same seed and number of
/// sets resample the same sets, so that comparisons of estimators are paired.
#[must_use]
pub fn accuracy(estimates: &[f64], target: f64, seed: u64) -> Accuracy {
    let errors: Vec<f64> = estimates.iter().map(|e| (e - target) / target).collect();
    let (bias, spread) = centre_and_spread(&mut errors.clone());
    let key = StreamKey {
        seed,
        scenario: "accuracy",
        run: 0,
        source: "bootstrap",
        process: "",
    };
    let mut generator = key.generator();
    let mut resample = vec![0.0; errors.len()];
    let mut draw = || {
        // The key has no estimator in it: the n-th resample is of the same sets for all of them, and their
        // ratio is paired.
        resample.fill_with(|| errors[generator.random_range(0..errors.len())]);
        centre_and_spread(&mut resample)
    };
    let resampled: Vec<(f64, f64)> = (0..RESAMPLES).map(|_| draw()).collect();
    let biases: Vec<f64> = resampled.iter().map(|(bias, _)| *bias).collect();
    let rmses: Vec<f64> = resampled
        .iter()
        .map(|(bias, spread)| bias.hypot(*spread))
        .collect();
    // A single set says nothing of how sets differ.
    let error = |x: &[f64]| {
        if estimates.len() > 1 {
            standard_deviation(x)
        } else {
            f64::NAN
        }
    };
    Accuracy {
        bias,
        spread,
        rmse: bias.hypot(spread),
        bias_se: error(&biases),
        rmse_se: error(&rmses),
        resampled: rmses,
    }
}

/// Median and 1.4826·MAD; the order of the numbers is lost.
fn centre_and_spread(x: &mut [f64]) -> (f64, f64) {
    let centre = median(x);
    x.iter_mut().for_each(|v| *v = (*v - centre).abs());
    (centre, MAD_TO_DEVIATION * median(x))
}

fn standard_deviation(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    (x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::StandardNormal;

    fn normals(run: u64, n: usize) -> Vec<f64> {
        let key = StreamKey {
            seed: 1,
            scenario: "",
            run,
            source: "test",
            process: "",
        };
        let mut g = key.generator();
        (0..n).map(|_| g.sample(StandardNormal)).collect()
    }

    /// By hand: errors −0.1, 0, 0.1, 0.2, 9 of target 2: median 0.1, absolute deviations 0.2, 0.1, 0, 0.1, 8.9.
    #[test]
    fn equation_15_by_hand() {
        let a = accuracy(&[1.8, 2.0, 2.2, 2.4, 20.0], 2.0, 1);
        assert!((a.bias - 0.1).abs() < 1e-15 && (a.spread - 0.1 * MAD_TO_DEVIATION).abs() < 1e-15);
        assert!((a.rmse - 0.1 * (1.0 + MAD_TO_DEVIATION * MAD_TO_DEVIATION).sqrt()).abs() < 1e-15);
        let even = accuracy(&[1.0, 2.0, 3.0, 6.0], 1.0, 1);
        assert!((even.bias - 1.5).abs() < 1e-15, "{}", even.bias);
    }

    /// The standard error agrees with the scatter of the RMSE over 400 studies of 200 sets: its own
    /// relative scatter is about 0.15 (as observed here), that of the mean of 400 below 0.01, that of a
    /// standard deviation of 400 numbers 1/√800 = 0.035; five of them, and 0.05 for the bootstrap of a
    /// median, which overstates in small samples.
    #[test]
    fn standard_errors_are_those_of_repeated_studies() {
        let studies: Vec<Accuracy> = (0..400)
            .map(|run| {
                let estimates: Vec<f64> = normals(run, 200).into_iter().map(|z| 10.0 + z).collect();
                accuracy(&estimates, 9.0, run)
            })
            .collect();
        let scatter = |f: fn(&Accuracy) -> f64| {
            standard_deviation(&studies.iter().map(f).collect::<Vec<_>>())
        };
        let mean = |f: fn(&Accuracy) -> f64| studies.iter().map(f).sum::<f64>() / 400.0;
        for (said, seen) in [
            (mean(|a| a.rmse_se), scatter(|a| a.rmse)),
            (mean(|a| a.bias_se), scatter(|a| a.bias)),
        ] {
            assert!(
                (said / seen - 1.0).abs() < 5.0 * 0.035 + 0.05,
                "{said} {seen}"
            );
        }
    }

    #[test]
    fn ratios_are_paired() {
        let x = normals(0, 100);
        let twice: Vec<f64> = x.iter().map(|z| 2.0 * z + 1.0).collect();
        let once: Vec<f64> = x.iter().map(|z| z + 1.0).collect();
        let (ratio, se) = accuracy(&twice, 1.0, 3).ratio_to(&accuracy(&once, 1.0, 3));
        assert!((ratio - 2.0).abs() < 1e-12 && se < 1e-12);
    }

    #[test]
    fn no_estimates_no_numbers() {
        assert!(accuracy(&[], 1.0, 1).rmse.is_nan());
    }
}
