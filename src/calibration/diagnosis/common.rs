//! Outliers in all recordings, which comparing one recording with the others does not show.
//!
//! ln (classical / robust) of every signal has, when the noise is Gaussian, the mean (1/e − 1)/eta and the variance
//! (1/e − 1)·2/eta (see [`super`]); quantization noise, which the robust variance reads high, is allowed for. Looked at is
//! the median over the signals, so that a minority makes no alarm.
//!
//! What is allowed for is the noise of a quantizer, of uniform numbers. Where the same spectrum is of Gaussian numbers (a
//! dithered output of velocity or angle increments, the difference of white noise), the robust variance reads it as it is, and
//! the classical one seems too high by what was allowed. That is told apart: the two variances then agree.
//!
//! Where the steps of a quantiser are comparable with the noise the two variances differ without an outlier: there nothing is said
//! of outliers.

use super::piece::{Piece, Test, excess_of_classical};
use crate::curve::Replicate;
use crate::outcome::{Settings, tau_s};

/// Standard deviations of the median: by chance 3 in 10⁷, of a normal law, at each of some ten scales.
const ALARM: f64 = 5.0;
/// Classical over robust, less one, from which it is told: less than that hardly moves a fit.
const LEAST: f64 = 0.02;
/// Standard deviation of a median of many Gaussian numbers, times the root of how many: √(π/2). Of few it is less (1 of one,
/// 1.16 of three), and the alarm the rarer.
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

/// Quantization noise whose numbers are Gaussian, not a quantizer's.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct GaussianQuantization {
    /// The scales (s) at which classical and robust wavelet variance agree where a quantizer's would not.
    pub tau_s: Vec<f64>,
    /// By how much the robust wavelet variance of a quantizer's noise, which robust fits expect, would be above the classical
    /// one at most: they read the noise there as much too low.
    pub read_low: f64,
}

/// Steps of a quantiser that are comparable with the noise, by which the classical and the robust wavelet variance differ.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct CoarseSteps {
    /// The scales (s) at which they differ so.
    pub tau_s: Vec<f64>,
    /// Median of classical over robust wavelet variance, less one, where it is furthest from 0.
    pub excess: f64,
}

/// Findings that most signals of a sensor have in common.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Common {
    pub(super) outliers: Option<CommonOutliers>,
    pub(super) gaussian: Option<GaussianQuantization>,
    pub(super) steps: Option<CoarseSteps>,
}

/// The median over the signals of ln (classical / robust) at a scale, less what is expected.
struct Excess {
    tau_s: f64,
    /// Excess with the allowance for the noise of a quantizer.
    quantizer: f64,
    /// Excess as if all noise were Gaussian.
    gaussian: f64,
    /// Standard deviation of either.
    sigma: f64,
    /// Whether half of the signals or more have coarse steps there.
    is_stepped: bool,
}

impl Excess {
    fn alarms(&self, excess: f64) -> bool {
        excess.is_finite() && excess > ALARM * self.sigma && excess.exp_m1() > LEAST
    }
}

/// Looks at all signals of a sensor together.
pub(super) fn common(pieces: &[Piece<'_>], settings: &Settings) -> Common {
    let test = Test::Outliers;
    let all = (0..test.most_levels(pieces)).map(|level| excess(pieces, level, settings));
    let (stepped, fine): (Vec<Excess>, Vec<Excess>) = all.partition(|e| e.is_stepped);
    let found: Vec<Excess> = fine.into_iter().filter(|e| e.alarms(e.quantizer)).collect();
    let tau_s: Vec<f64> = found.iter().map(|e| e.tau_s).collect();
    // Outliers raise the classical variance by anything; that they make up for the allowance, no more and no less, at every
    // scale is not to be expected.
    if !found.is_empty() && found.iter().all(|e| !e.alarms(e.gaussian.abs())) {
        let read_low = found
            .iter()
            .map(|e| (e.quantizer - e.gaussian).exp_m1())
            .fold(0.0, f64::max);
        return Common {
            gaussian: Some(GaussianQuantization { tau_s, read_low }),
            ..Common::default()
        };
    }
    let most = found
        .iter()
        .max_by(|a, b| a.quantizer.total_cmp(&b.quantizer));
    let outliers = most.map(|most| CommonOutliers {
        tau_s,
        most_tau_s: most.tau_s,
        excess: most.quantizer.exp_m1(),
        deviations: most.quantizer / most.sigma,
    });
    // Outliers of the finer scales explain what the coarser steps show.
    let steps = if outliers.is_some() {
        None
    } else {
        coarse_steps(&stepped)
    };
    Common {
        outliers,
        gaussian: None,
        steps,
    }
}

fn coarse_steps(stepped: &[Excess]) -> Option<CoarseSteps> {
    let differ = stepped.iter().filter(|e| e.alarms(e.gaussian.abs()));
    let (tau_s, all): (Vec<f64>, Vec<f64>) = differ.map(|e| (e.tau_s, e.gaussian.exp_m1())).unzip();
    let excess = all.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    Some(CoarseSteps { tau_s, excess })
}

fn excess(pieces: &[Piece<'_>], level: usize, settings: &Settings) -> Excess {
    let (test, tuning) = (Test::Outliers, &settings.tuning);
    let (mut of_quantizer, mut of_gaussian, mut variance, mut stepped) =
        (Vec::new(), Vec::new(), 0.0, 0);
    for piece in pieces.iter().filter(|p| !p.drifts(level)) {
        let long_enough = |r: &&&Replicate| test.levels(piece, r) > level;
        for replicate in piece.replicates.iter().flatten().filter(long_enough) {
            let eta = test.edof(
                piece.law.edof(replicate.samples)[level],
                tuning.efficiency(),
            );
            let (read_high, _) = tuning.quantization().factor(piece.law.quantization[level]);
            // E ln(chi²/eta) ≈ −1/eta: lower for the robust variance, by (1/e − 1)/eta of the classical one,
            // which is 1/eta here. The bias of robust variances of few coefficients is left out.
            let gaussian = excess_of_classical(replicate, level) - 1.0 / eta;
            stepped += usize::from(replicate.robust[level].is_stepped());
            of_gaussian.push(gaussian);
            of_quantizer.push(gaussian + read_high.ln());
            // The standard deviation of a mean of n is √(Σ variances)/n, that of the median √(π/2) times it where the
            // variances are alike, as those of recordings of one length are.
            variance += 2.0 / eta;
        }
    }
    Excess {
        tau_s: tau_s(level as u32 + 1, settings.rate_hz),
        quantizer: crate::curve::robust_scale::median(&of_quantizer),
        gaussian: crate::curve::robust_scale::median(&of_gaussian),
        sigma: MEDIAN * variance.sqrt() / of_gaussian.len() as f64,
        is_stepped: 2 * stepped >= of_gaussian.len(),
    }
}
