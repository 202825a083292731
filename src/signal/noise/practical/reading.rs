//! The parameters of one axis, each with the averaging times that it governs.

use super::{
    Bias, Curve, CurveError, FLICKER_FLOOR, Horizon, Markov, Pair, Policy, averages, markov_of,
};
use crate::noise::Composite;

/// A minimum of the Allan deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Minimum {
    /// Averaging time (s).
    pub tau_s: f64,
    /// Allan deviation there (units).
    pub deviation: f64,
}

impl Minimum {
    /// The lowest minimum of the largest Allan deviation of some axes, strictly within one sample and `range_s`; none where it
    /// still falls, or rises from the start.
    #[must_use]
    pub fn of(axes: &[&Composite], rate_hz: f64, range_s: f64) -> Option<Self> {
        // The grid of 1/16 octave is fine enough: around its minimum N²/τ + K²τ/3 is proportional to cosh x with
        // x = ln(τ/τ₀), and √cosh(ln 2/32) exceeds 1 by 1e-4.
        let samples = averages(1.0, (range_s * rate_hz).clamp(2.0, f64::from(1_u32 << 30)));
        let variance = |m: &u32| {
            axes.iter()
                .map(|a| a.allan_variance(*m))
                .fold(0.0, f64::max)
        };
        let variances: Vec<f64> = samples.iter().map(variance).collect();
        // An end of the range is no minimum: the deviation may go on falling beyond it.
        let inner = (1..samples.len().saturating_sub(1))
            .filter(|i| variances[*i] < variances[i - 1] && variances[*i] <= variances[i + 1]);
        let lowest = inner.min_by(|a, b| variances[*a].total_cmp(&variances[*b]))?;
        Some(Self {
            tau_s: f64::from(samples[lowest]) / rate_hz,
            deviation: variances[lowest].sqrt(),
        })
    }

    /// Bias instability B = Allan deviation/0.664 (units).
    #[must_use]
    pub fn bias_instability(&self) -> f64 {
        self.deviation / FLICKER_FLOOR
    }
}

/// An AR1 or GM of the model, in continuous terms.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelatedProcess {
    /// Label within the model: "AR1_2".
    pub label: String,
    /// Standard deviation and correlation time.
    pub markov: Markov,
}

/// Practitioners' parameters of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisParameters {
    /// N and K of the policy: white noise and random walk.
    pub walk: Pair,
    /// N, sigma_b and T of the policy: white noise and a Gauss-Markov bias.
    pub markov: Pair,
    /// The lowest minimum of the Allan deviation within the range; none where it still falls, or rises from the start.
    pub minimum: Option<Minimum>,
    /// The correlated processes of the model.
    pub correlated: Vec<CorrelatedProcess>,
}

impl AxisParameters {
    /// Parameters of the largest of some axes at each averaging time. Minima are sought up to `range_s`.
    ///
    /// # Errors
    /// As [`Curve::largest`].
    pub fn of(
        axes: &[&Composite],
        rate_hz: f64,
        horizon: Horizon,
        policy: Policy,
        range_s: f64,
    ) -> Result<Self, CurveError> {
        let curve = Curve::largest(axes, rate_hz, horizon)?;
        Ok(Self {
            walk: curve.pair(policy, Bias::Walk),
            markov: curve.pair(policy, Bias::Markov),
            minimum: Minimum::of(axes, rate_hz, range_s),
            correlated: axes
                .iter()
                .take(1)
                .flat_map(|axis| correlated(axis, rate_hz))
                .collect(),
        })
    }
}

/// The AR1 and GM of an axis that have a correlation time.
pub(super) fn correlated(axis: &Composite, rate_hz: f64) -> Vec<CorrelatedProcess> {
    let labelled = axis.labels().into_iter().zip(&axis.processes);
    labelled
        .filter_map(|(label, p)| {
            Some(CorrelatedProcess {
                label,
                markov: markov_of(p, rate_hz)?,
            })
        })
        .collect()
}
