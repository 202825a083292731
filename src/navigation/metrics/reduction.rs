//! What the reduction of a model to 15 states leaves of it, and how consistent the reduced filter is.

use super::estimate::PerState;
use crate::ekf::Belief;
use crate::ekf::belief::BiasGroup;
use crate::imu::Channel;
use crate::noise::{
    Ar1, Composite, Model, ParameterError, Process, RandomWalk, White, continuous, reduction,
};
use crate::simulation::REPORTED;
use crate::simulation::lincov::{Assessment, Consistency};
use glam::DVec3;
use serde::Serialize;

/// A ratio of RMSE to standard deviation that is further from 1 at the end of an outage deserves a warning.
pub const TOLERANCE: f64 = 0.1;

/// The reduction of a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReductionSummary {
    /// Longest time scale it was made for (s).
    pub window_s: f64,
    /// The six axes.
    pub axes: Vec<AxisReduction>,
    /// True errors of the reduced filter against its own standard deviations; none where nothing was reduced.
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
    bias_phi: f64,
    /// Its innovation variance (units²).
    bias_sigma2: f64,
    /// Its correlation time (s); infinite of a random walk.
    bias_t_corr_s: f64,
    /// Its stationary standard deviation (units); infinite of a random walk.
    pub bias_sigma: f64,
    /// Standard deviation at the start (units).
    initial_sigma: f64,
    /// Largest |ln(reduced/model)| of the wavelet variance over the scales fitted.
    pub misfit: f64,
    /// Whether quantization noise was left out.
    quantization_left_out: bool,
    /// Scales (s).
    pub tau_s: Vec<f64>,
    /// Haar wavelet variance of the model without quantization noise (units²).
    model_wv: Vec<f64>,
    /// That of the pair.
    reduced_wv: Vec<f64>,
}

/// What the covariance analysis says of the reduced filter where the model is true.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReductionQuality {
    /// True RMSE over the filter's own standard deviation at the end of each outage: above 1 it is
    /// overconfident, below 1 overcautious.
    pub outage_end: Vec<PerState<f64>>,
    /// The same, mean over all epochs after the start.
    pub mean: PerState<f64>,
    /// Expected NEES, mean over all epochs after the start; 9 is right.
    pub nees: f64,
    /// True RMSE over that of the full filter at the end of each outage; none where the model has no full filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_over_full: Option<Vec<PerState<f64>>>,
}

impl ReductionSummary {
    /// What a belief of 15 states made of a model; `interval_s` and `window_s` are the time scales it is compared
    /// over.
    ///
    /// # Errors
    /// When a parameter of the belief is outside its domain.
    pub fn of(
        model: &Model,
        belief: &Belief,
        interval_s: f64,
        window_s: f64,
    ) -> Result<Self, ParameterError> {
        let axis = |channel| AxisReduction::new(channel, model, belief, [interval_s, window_s]);
        Ok(Self {
            window_s,
            axes: Channel::ALL
                .map(axis)
                .into_iter()
                .collect::<Result<_, _>>()?,
            quality: None,
        })
    }

    /// Whether the pair is the model itself: nothing was lost.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.axes.iter().all(|a| a.misfit == 0.0)
    }
}

impl AxisReduction {
    fn new(
        channel: Channel,
        model: &Model,
        belief: &Belief,
        scales_s: [f64; 2],
    ) -> Result<Self, ParameterError> {
        let noise = model.axis(channel);
        let (sensor, i) = (channel.sensor as usize, channel.axis as usize);
        // white noise alone has no bias: the first group, if any, is then what the filter expects beside the model
        let none = BiasGroup {
            phi: DVec3::ZERO,
            ..BiasGroup::constant(0.0)
        };
        let group = belief.groups[sensor]
            .first()
            .filter(|group| !group.is_constant())
            .unwrap_or(&none);
        let white = White::new(belief.white[sensor][i])?;
        let (phi, innovation) = (group.phi[i], group.innovation[i]);
        // Of a random walk correlation time and variance have no bound; they are null in JSON.
        let (bias, bias_sigma) = if phi < 1.0 {
            let bias = Ar1::new(phi, innovation)?;
            (Process::Ar1(bias), bias.variance().sqrt())
        } else {
            (
                Process::RandomWalk(RandomWalk::new(innovation)?),
                f64::INFINITY,
            )
        };
        let is_quantization = |p: &&Process| matches!(p, Process::Quantization(_));
        // Compared with the model as a filter can carry it: quantization noise is left out on both sides.
        let kept = reduction::carried(noise);
        let pair = Composite::new(vec![Process::White(white), bias]);
        // Haar scales are 2, 4, 8 … samples: the nearest in the logarithm. 2^40 samples is beyond any record.
        let level =
            |seconds: f64| (seconds * model.rate_hz).max(2.0).log2().round().min(40.0) as u32;
        let [first, last] = scales_s.map(level);
        let distance = |l: u32| (pair.haar_wv(l) / kept.haar_wv(l)).ln().abs();
        let exact = reduction::is_exact(noise);
        let levels: Vec<u32> = (1..=last).collect();
        Ok(Self {
            axis: channel.to_string(),
            white_sigma2: white.sigma2(),
            bias_phi: phi,
            bias_sigma2: innovation,
            bias_t_corr_s: continuous::correlation_time_s(phi, model.rate_hz),
            bias_sigma,
            initial_sigma: group.initial[i].sqrt(),
            misfit: if exact {
                0.0
            } else {
                (first..=last).map(distance).fold(0.0, f64::max)
            },
            quantization_left_out: noise.processes.iter().any(|p| is_quantization(&p)),
            tau_s: levels
                .iter()
                .map(|l| f64::from(*l).exp2() / model.rate_hz)
                .collect(),
            model_wv: levels.iter().map(|l| kept.haar_wv(*l)).collect(),
            reduced_wv: levels.iter().map(|l| pair.haar_wv(*l)).collect(),
        })
    }
}

impl ReductionQuality {
    /// From a covariance analysis of the reduced filter and, where there is one, of the full filter.
    #[must_use]
    pub fn of(reduced: &Assessment, full: Option<&Assessment>) -> Self {
        // At the start the errors are those that the filter believes in, or none: that says nothing of it.
        let later: Vec<&Consistency> = reduced.reports.iter().filter(|r| r.after_s > 0.0).collect();
        let n = later.len() as f64;
        let ratios: Vec<[f64; REPORTED]> = later.iter().map(|r| r.ratio()).collect();
        let mean = |i: usize| ratios.iter().map(|r| r[i]).sum::<f64>() / n;
        let over = |(a, b): (&Consistency, &Consistency)| {
            PerState(std::array::from_fn(|i| a.rmse[i] / b.rmse[i]))
        };
        Self {
            outage_end: reduced
                .outage_ends
                .iter()
                .map(|e| PerState(e.ratio()))
                .collect(),
            mean: PerState(std::array::from_fn(mean)),
            nees: later.iter().map(|r| r.nees).sum::<f64>() / n,
            rmse_over_full: full.map(|f| {
                reduced
                    .outage_ends
                    .iter()
                    .zip(&f.outage_ends)
                    .map(over)
                    .collect()
            }),
        }
    }

    /// Reported state, outage and ratio that is further from 1 than the tolerance, the furthest of all; none where none is.
    #[must_use]
    pub fn worst(&self) -> Option<(usize, usize, f64)> {
        let ends = self.outage_end.iter().enumerate();
        let all = ends
            .flat_map(|(outage, end)| end.0.iter().enumerate().map(move |(s, r)| (s, outage, *r)));
        // By the logarithm: half and twice are equally far off.
        let worst = all.max_by(|a, b| a.2.ln().abs().total_cmp(&b.2.ln().abs()))?;
        (worst.2.ln().abs() > TOLERANCE.ln_1p()).then_some(worst)
    }

    /// Errors over those of the full filter at the ends of outages: the largest ratio of the horizontal position (north or east,
    /// whichever is larger), and that of all states with its state.
    #[must_use]
    pub fn cost(&self) -> Option<(f64, (usize, f64))> {
        let ends = || self.rmse_over_full.iter().flatten();
        let most = |state: usize| (state, ends().map(|end| end.0[state]).fold(0.0, f64::max));
        let worst = (0..REPORTED).map(most).max_by(|a, b| a.1.total_cmp(&b.1))?;
        (worst.1 > 0.0).then_some((most(0).1.max(most(1).1), worst))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ekf::{FilterStates, InitialSettings};
    use crate::noise::Quantization;

    fn summary(model: &Model) -> ReductionSummary {
        let belief = Belief::new(model, FilterStates::Reduced15, 1.0, 800.0).unwrap();
        ReductionSummary::of(model, &belief, 1.0, 800.0).unwrap()
    }

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
        let summary = summary(&model(0.0));
        assert!(summary.is_exact() && summary.axes.iter().all(|a| a.quantization_left_out));
        let a = &summary.axes[3];
        assert_eq!(
            (a.axis.as_str(), a.model_wv == a.reduced_wv),
            ("gyro.x", true)
        );
        assert!((a.bias_t_corr_s - 0.01 / 0.9995_f64.ln().abs()).abs() < 1e-6);
    }

    /// The states of a turn-on bias are no bias of the model.
    #[test]
    fn white_noise_alone_stays_without_a_bias_where_a_turn_on_bias_is_expected() {
        let axis = Composite::new(vec![Process::White(White::new(5e-5).unwrap())]);
        let model = Model::pooled(100.0, &axis, &axis);
        let initial = InitialSettings {
            accel_bias_sigma_m_s2: Some(0.1),
            gyro_bias_sigma_rad_s: Some(1e-3),
            ..InitialSettings::default()
        };
        let belief = Belief::new(&model, FilterStates::Reduced15, 1.0, 800.0)
            .unwrap()
            .with_initial(&initial);
        let summary = ReductionSummary::of(&model, &belief, 1.0, 800.0).unwrap();
        assert!(
            summary.is_exact()
                && summary
                    .axes
                    .iter()
                    .all(|a| a.bias_sigma == 0.0 && a.initial_sigma == 0.0)
        );
    }

    /// The curves stored are those the misfit is of: its value is found again over the scales of the fit.
    #[test]
    fn the_stored_curves_have_the_misfit_that_is_stated() {
        let summary = summary(&model(1e-8));
        let a = &summary.axes[0];
        assert!(!summary.is_exact() && a.misfit > 0.01);
        let fitted = a
            .tau_s
            .iter()
            .zip(a.model_wv.iter().zip(&a.reduced_wv))
            .filter(|(tau, _)| **tau > 1.0);
        let worst = fitted
            .map(|(_, (m, r))| (r / m).ln().abs())
            .fold(0.0, f64::max);
        assert!(
            (worst / a.misfit - 1.0).abs() < 1e-9,
            "{worst} {}",
            a.misfit
        );
    }

    /// At the start the errors are drawn from the filter's own belief (or are none): its ratio is 1 (or 0), whatever
    /// the filter does afterwards.
    #[test]
    fn the_start_says_nothing_of_the_filter() {
        let report = |after_s, rmse, nees| Consistency {
            after_s,
            measured: false,
            sigma: [1.0; REPORTED],
            rmse: [rmse; REPORTED],
            nees,
            divergence: 0.0,
            log_density: 0.0,
        };
        let reports = vec![
            report(0.0, 1.0, 9.0),
            report(1.0, 2.0, 36.0),
            report(2.0, 4.0, 144.0),
        ];
        let quality = ReductionQuality::of(
            &Assessment {
                reports,
                outage_ends: vec![],
            },
            None,
        );
        assert_eq!((quality.mean.0, quality.nees), ([3.0; REPORTED], 90.0));
    }

    /// The position north costs 1.9 % at the end of one outage, yaw a quarter at that of the other; the sigma of yaw is off by 1.25.
    #[test]
    fn cost_and_worst_state_of_a_reduction() {
        let mut ends = vec![PerState([1.0; REPORTED]); 2];
        (ends[0].0[0], ends[1].0[8]) = (1.019, 1.25);
        let quality = |ends: &[PerState<f64>]| ReductionQuality {
            outage_end: ends.to_vec(),
            mean: PerState([1.0; REPORTED]),
            nees: 9.0,
            rmse_over_full: Some(ends.to_vec()),
        };
        assert_eq!(quality(&ends).cost(), Some((1.019, (8, 1.25))));
        assert_eq!(quality(&ends).worst(), Some((8, 1, 1.25)));
        assert_eq!((quality(&[]).cost(), quality(&[]).worst()), (None, None));
        ends[1].0[8] = 1.0 / 1.25;
        assert_eq!(quality(&ends).worst(), Some((8, 1, 0.8)));
        ends[1].0[8] = 1.05;
        assert_eq!(quality(&ends).worst(), None);
    }
}
