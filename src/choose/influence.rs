//! Which scales of which sensor decide the error at the end of an outage, and what each recording adds to it.
//!
//! d ln(error) / d ln(nu_j): the fit passes a change of a wavelet variance on to its parameters
//! ([`CurveInfluence`]), covariance analysis passes these on to the horizontal RMSE of the filter that knows the model.
//! What a recording does follows to first order from what its presence does to every scale of the curve.

use super::drive::{ChoiceError, Drive};
use super::laboratory::Laboratory;
use nav_sim_calibration::{
    CurveInfluence, Estimator, Group, Outcome, Settings, average, model_of, put, tau_s,
};
use nav_sim_navigation::simulation::lincov::assess;
use nav_sim_signal::noise::Model;
use rayon::prelude::*;
use serde::Serialize;

/// What decides the error.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Influence {
    /// Scale by scale, of each model (a sensor, or an axis of it).
    pub scales: Vec<ScaleInfluence>,
    /// Recording by recording, for the three averages.
    pub recordings: Vec<RecordingInfluence>,
}

/// One scale of one curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScaleInfluence {
    /// The sensor, or the axis: `gyro`, `accel.x`.
    pub signals: String,
    /// The scale (s).
    pub tau_s: f64,
    /// How much the horizontal RMSE at the ends of outages grows with the wavelet variance there: % for 1 %.
    pub on_error: f64,
}

/// What one recording adds to the error that the model of all expects (%), to first order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordingInfluence {
    /// The recording.
    pub recording: String,
    /// With the average of classical variances.
    pub awv_pct: f64,
    /// With that of robust ones.
    pub sr_awv_pct: f64,
    /// With the trimmed one.
    pub dr_awv_pct: f64,
}

/// Step of the differences in a parameter, in its natural unit.
const STEP: f64 = 1e-3;

impl Drive {
    /// What decides the error of the filter of all states that knows a model: that of the fits of `outcomes`, one of each group.
    /// A fit without derivatives (AVLR, full covariance) has no influence.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn influence(
        &self,
        laboratory: &Laboratory,
        groups: &[Group],
        outcomes: &[Outcome],
        settings: &Settings,
    ) -> Result<Influence, ChoiceError> {
        let model = model_of(outcomes, settings.rate_hz);
        let mut scales = Vec::new();
        let mut by_group: Vec<(&Group, Vec<f64>)> = Vec::new();
        for (group, outcome) in groups.iter().zip(outcomes) {
            let Some(influence) = CurveInfluence::of(outcome, settings) else {
                continue;
            };
            let on_error = self.on_error(&model, outcome, &influence, settings)?;
            let levels = outcome.curve.levels.iter().zip(&on_error);
            scales.extend(levels.map(|(level, on_error)| ScaleInfluence {
                signals: outcome.scope.name(),
                tau_s: tau_s(*level, settings.rate_hz),
                on_error: *on_error,
            }));
            by_group.push((group, on_error));
        }
        let recording = |k: usize| {
            let adds = |estimator| {
                let of_group = |(group, on_error): &(&Group, Vec<f64>)| {
                    added(laboratory, k, group, on_error, estimator, settings)
                };
                let ln: f64 = by_group.iter().map(of_group).sum();
                100.0 * ln.exp_m1()
            };
            RecordingInfluence {
                recording: laboratory.units()[k].name.clone(),
                awv_pct: adds(Estimator::Awv),
                sr_awv_pct: adds(Estimator::SrAwv),
                dr_awv_pct: adds(Estimator::DrAwv),
            }
        };
        Ok(Influence {
            scales,
            recordings: (0..laboratory.units().len()).map(recording).collect(),
        })
    }

    /// d ln(error) / d ln(nu_j), scale by scale of one fit.
    fn on_error(
        &self,
        model: &Model,
        outcome: &Outcome,
        influence: &CurveInfluence,
        settings: &Settings,
    ) -> Result<Vec<f64>, ChoiceError> {
        let slope = |m: usize| {
            let log_rmse = |by: f64| {
                let moved = influence.moved(&outcome.fit.composite, m, by, settings.rate_hz);
                let composite =
                    moved.expect("a thousandth of the way to the end of its domain is within it");
                let mut changed = model.clone();
                put(&composite, outcome.scope, &mut changed);
                self.horizontal_rmse(&changed).map(f64::ln)
            };
            Ok::<f64, ChoiceError>((log_rmse(STEP)? - log_rmse(-STEP)?) / (2.0 * STEP))
        };
        let slopes: Vec<f64> = (0..influence.parameters.len())
            .into_par_iter()
            .map(slope)
            .collect::<Result<_, _>>()?;
        let along = |j: usize| {
            slopes
                .iter()
                .enumerate()
                .map(|(m, s)| s * influence.passed_on[(m, j)])
                .sum()
        };
        Ok((0..outcome.curve.levels.len()).map(along).collect())
    }

    /// Horizontal RMSE at the ends of the outages (m), root mean square, of the filter of all states that knows the model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn horizontal_rmse(&self, model: &Model) -> Result<f64, ChoiceError> {
        let belief = self.full_belief(model)?;
        let ends = assess(self.track(), &belief, model).outage_ends;
        let squares: f64 = ends
            .iter()
            .map(|end| end.rmse[0].powi(2) + end.rmse[1].powi(2))
            .sum();
        Ok((squares / ends.len() as f64).sqrt())
    }
}

/// ln of what a recording's presence in the average does to the error: Σ (d ln error / d ln nu_j) Δ ln nu_j.
fn added(
    laboratory: &Laboratory,
    k: usize,
    group: &Group,
    on_error: &[f64],
    estimator: Estimator,
    settings: &Settings,
) -> f64 {
    let names: Vec<&str> = laboratory.units()[k]
        .replicates
        .iter()
        .map(|(_, r)| r.name.as_str())
        .collect();
    let others: Vec<_> = group
        .replicates
        .iter()
        .filter(|r| !names.contains(&r.name.as_str()))
        .cloned()
        .collect();
    let curve =
        |replicates: &[_]| average(replicates, estimator, settings.trim, &settings.tuning).ok();
    let (Some(all), Some(without)) = (curve(&group.replicates), curve(&others)) else {
        return f64::NAN;
    };
    let ratios = all
        .wv
        .iter()
        .zip(&without.wv)
        .map(|(with, without)| (with / without).ln());
    // a scale without a robust variance counts nothing
    on_error
        .iter()
        .zip(ratios)
        .map(|(i, ln)| i * ln)
        .filter(|x| x.is_finite())
        .sum()
}
