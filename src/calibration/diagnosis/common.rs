//! Outliers that all recordings hold: comparing one with the others does not show those.
//!
//! ln (classical / robust) of every signal has, when the noise is Gaussian, the mean (1/e − 1)/eta and the variance
//! (1/e − 1)·2/eta (see [`super`]); quantization noise, which the robust variance reads high, is allowed for. Looked at is the median over the signals, so that a minority makes no alarm.

use super::piece::{Piece, Test};
use crate::outcome::{Settings, tau_s};

/// Standard deviations of the median: 1 in 10⁶ by chance, at each of some ten scales.
const ALARM: f64 = 5.0;
/// Classical over robust, less one, from which it is told: less than that hardly moves a fit.
const LEAST: f64 = 0.02;
/// Standard deviation of a median of Gaussian numbers, times the root of how many: √(π/2).
const MEDIAN: f64 = 1.2533;

/// Outliers in most of the signals of a sensor.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct CommonOutliers {
    /// The scales (s) at which there are.
    pub tau_s: Vec<f64>,
    /// The one where they weigh most.
    pub most_tau_s: f64,
    /// Median of classical over robust wavelet variance, less one, there.
    pub excess: f64,
    /// The same (in the logarithm) in standard deviations.
    pub deviations: f64,
}

/// Looks at all signals of a sensor together.
pub(super) fn common(pieces: &[Piece<'_>], settings: &Settings) -> Option<CommonOutliers> {
    let (test, tuning) = (Test::Outliers, &settings.tuning);
    let mut found: Option<CommonOutliers> = None;
    for level in 0..test.levels(pieces) {
        let (mut logs, mut variance) = (Vec::new(), 0.0);
        for piece in pieces {
            for replicate in piece.replicates.iter().flatten() {
                let eta = test.edof(piece.law.edof(replicate.samples)[level], tuning.efficiency());
                let (read_high, _) = tuning.quantization().factor(piece.law.quantization[level]);
                logs.push(test.value(replicate, level) + read_high.ln() - 1.0 / eta);
                variance += 2.0 / eta;
            }
        }
        let count = logs.len() as f64;
        let centre = crate::curve::robust_scale::median(&logs);
        let deviations = centre / (MEDIAN * variance.sqrt() / count);
        let excess = centre.exp_m1();
        if !(excess.is_finite() && deviations > ALARM && excess > LEAST) {
            continue;
        }
        let scale_s = tau_s(level as u32 + 1, settings.rate_hz);
        let first = CommonOutliers { tau_s: Vec::new(), most_tau_s: scale_s, excess, deviations };
        let all = found.get_or_insert(first);
        all.tau_s.push(scale_s);
        if excess > all.excess {
            (all.most_tau_s, all.excess, all.deviations) = (scale_s, excess, deviations);
        }
    }
    found
}
