//! What the reduction of a model to 15 states leaves of it, and what that does to the filter's own
//! standard deviations.

use super::estimate::PerState;
use crate::imu::{Channel, Sensor};
use crate::noise::reduction::{Reduced, ReductionError, carried, reduce};
use crate::noise::{Composite, Model, Process, continuous};
use crate::simulation::{CovariancePass, REPORTED};
use serde::Serialize;

/// Off by more than this in position at the end of an outage, a reduction deserves a warning.
pub const TOLERANCE: f64 = 0.05;

/// The reduction of a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReductionSummary {
    /// Longest time scale it was made for (s).
    pub window_s: f64,
    /// The six axes.
    pub axes: Vec<AxisReduction>,
    /// Standard deviations of the reduced filter over those of the full one; none where the model has no full
    /// filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<ReductionQuality>,
}

/// White noise and one Gauss-Markov bias in the place of the model of an axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisReduction {
    /// Which axis.
    pub axis: String,
    /// White variance of a sample (units²).
    pub white_sigma2: f64,
    /// Coefficient of the bias.
    pub bias_phi: f64,
    /// Its innovation variance (units²).
    pub bias_sigma2: f64,
    /// Its correlation time (s).
    pub bias_t_corr_s: f64,
    /// Its stationary standard deviation (units).
    pub bias_sigma: f64,
    /// Standard deviation at the start (units).
    pub initial_sigma: f64,
    /// Largest |ln(reduced/model)| of the wavelet variance over the scales fitted.
    pub misfit: f64,
    /// Whether quantization noise was left out.
    pub quantization_left_out: bool,
    /// Scales (s).
    pub tau_s: Vec<f64>,
    /// Haar wavelet variance of the model without quantization noise (units²).
    pub model_wv: Vec<f64>,
    /// That of the pair.
    pub reduced_wv: Vec<f64>,
}

/// Standard deviations of the reduced filter over those of the full one: 1 is perfect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReductionQuality {
    /// At the end of each outage.
    pub outage_end: Vec<PerState<f64>>,
    /// Mean over all epochs.
    pub mean: PerState<f64>,
}

impl ReductionSummary {
    /// Reduces each axis as the filter of 15 states does.
    ///
    /// # Errors
    /// As [`reduce`].
    pub fn of(model: &Model, interval_s: f64, window_s: f64) -> Result<Self, ReductionError> {
        let axis = |channel: Channel| {
            let reduced = reduce(model.axis(channel), model.rate_hz, interval_s, window_s)?;
            Ok::<_, ReductionError>(AxisReduction::new(channel, model, &reduced, window_s))
        };
        Ok(Self {
            window_s,
            axes: Channel::ALL.map(axis).into_iter().collect::<Result<_, _>>()?,
            quality: None,
        })
    }

    /// Whether the pair is the model itself: nothing was lost.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.axes.iter().all(|a| a.misfit == 0.0)
    }

    /// The largest relative difference of the horizontal position's standard deviation at the end of an
    /// outage.
    #[must_use]
    pub fn worst_position(&self) -> Option<f64> {
        let ends = &self.quality.as_ref()?.outage_end;
        ends.iter().flat_map(|e| [e.0[0], e.0[1]]).map(|r| (r - 1.0).abs()).reduce(f64::max)
    }

    /// A line a sensor, or a line an axis where they differ.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let describe = |name: &str, unit: &str, a: &AxisReduction| {
            let left_out = if a.quantization_left_out { "; quantization noise left out" } else { "" };
            format!(
                "{name} reduced to white noise {:.3e} {unit} a sample and one bias of {:.3e} {unit}, correlation time {:.0} s \
                 (wavelet variance within {:.0} %{left_out})",
                a.white_sigma2.sqrt(),
                a.bias_sigma,
                a.bias_t_corr_s,
                100.0 * a.misfit.exp_m1()
            )
        };
        let mut lines = Vec::new();
        for sensor in Sensor::ALL {
            let axes = &self.axes[3 * sensor as usize..3 * sensor as usize + 3];
            let same =
                axes.iter().all(|a| (a.white_sigma2, a.bias_phi) == (axes[0].white_sigma2, axes[0].bias_phi));
            let shown = if same { &axes[..1] } else { axes };
            let name = |a: &AxisReduction| if same { sensor.name().to_owned() } else { a.axis.clone() };
            lines.extend(shown.iter().map(|a| describe(&name(a), sensor.unit(), a)));
        }
        lines
    }
}

impl AxisReduction {
    fn new(channel: Channel, model: &Model, reduced: &Reduced, window_s: f64) -> Self {
        let noise = model.axis(channel);
        let is_quantization = |p: &&Process| matches!(p, Process::Quantization(_));
        let kept = carried(noise);
        let pair = Composite::new(vec![Process::White(reduced.white), Process::Ar1(reduced.bias)]);
        let last = (window_s * model.rate_hz).max(2.0).log2().round().min(40.0) as u32;
        let levels: Vec<u32> = (1..=last).collect();
        Self {
            axis: channel.to_string(),
            white_sigma2: reduced.white.sigma2(),
            bias_phi: reduced.bias.phi(),
            bias_sigma2: reduced.bias.sigma2(),
            bias_t_corr_s: continuous::correlation_time_s(reduced.bias.phi(), model.rate_hz),
            bias_sigma: reduced.bias.variance().sqrt(),
            initial_sigma: reduced.initial_variance.sqrt(),
            misfit: reduced.misfit,
            quantization_left_out: noise.processes.iter().any(|p| is_quantization(&p)),
            tau_s: levels.iter().map(|l| f64::from(*l).exp2() / model.rate_hz).collect(),
            model_wv: levels.iter().map(|l| kept.haar_wv(*l)).collect(),
            reduced_wv: levels.iter().map(|l| pair.haar_wv(*l)).collect(),
        }
    }
}

impl ReductionQuality {
    /// From a pass of each filter along the same plan.
    #[must_use]
    pub fn of(reduced: &CovariancePass, full: &CovariancePass) -> Self {
        let ratio = |a: &[f64; REPORTED], b: &[f64; REPORTED]| -> [f64; REPORTED] {
            std::array::from_fn(|i| a[i] / b[i])
        };
        let ratios = |a: &[[f64; REPORTED]], b: &[[f64; REPORTED]]| -> Vec<[f64; REPORTED]> {
            a.iter().zip(b).map(|(a, b)| ratio(a, b)).collect()
        };
        let all = ratios(&reduced.reports, &full.reports);
        let mean = |i: usize| all.iter().map(|r| r[i]).sum::<f64>() / all.len() as f64;
        let outage_end = ratios(&reduced.outage_ends, &full.outage_ends).into_iter().map(PerState).collect();
        Self { outage_end, mean: PerState(std::array::from_fn(mean)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Ar1, Quantization, White};

    fn model(second: f64) -> Model {
        let mut processes = vec![
            Process::White(White::new(5e-5).unwrap()),
            Process::Ar1(Ar1::new(0.9995, 2e-10).unwrap()),
            Process::Quantization(Quantization::new(1e-7).unwrap()),
        ];
        if second > 0.0 {
            processes.push(Process::Ar1(Ar1::new(0.99, second).unwrap()));
        }
        let axis = Composite::new(processes);
        Model::pooled(100.0, &axis, &axis)
    }

    #[test]
    fn a_model_that_needs_no_reduction_says_so() {
        let summary = ReductionSummary::of(&model(0.0), 1.0, 800.0).unwrap();
        assert!(summary.is_exact() && summary.axes.iter().all(|a| a.quantization_left_out));
        let a = &summary.axes[3];
        assert_eq!((a.axis.as_str(), a.model_wv == a.reduced_wv), ("gyro.x", true));
        assert!((a.bias_t_corr_s - 0.01 / 0.9995_f64.ln().abs()).abs() < 1e-6);
        assert_eq!(summary.lines().len(), 2);
    }

    /// The curves stored are those the misfit is of: its value is found again over the scales of the fit.
    #[test]
    fn the_stored_curves_have_the_misfit_that_is_stated() {
        let summary = ReductionSummary::of(&model(1e-8), 1.0, 800.0).unwrap();
        let a = &summary.axes[0];
        assert!(!summary.is_exact() && a.misfit > 0.01);
        let fitted = a.tau_s.iter().zip(a.model_wv.iter().zip(&a.reduced_wv)).filter(|(tau, _)| **tau > 1.0);
        let worst = fitted.map(|(_, (m, r))| (r / m).ln().abs()).fold(0.0, f64::max);
        assert!((worst / a.misfit - 1.0).abs() < 1e-9, "{worst} {}", a.misfit);
    }
}
