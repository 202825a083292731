//! New curves from a fit: the parametric bootstrap behind intervals, goodness of fit and full weighting.
//!
//! Each draw makes K new replicates: ln nu* of replicate i at level j is ln nu_j of the fitted model, plus a
//! difference *between* replicates (Gaussian, with the excess variance the recorded replicates show at that level
//! and their correlations between levels; a Student tail for the few they are), plus the scatter *within* a
//! recording (chi-square, from the large-sample law of the model's own wavelet variance and the length of the
//! recording; divided by the efficiency where robust). The estimator is applied to the new replicates, trim and
//! all. No signal is simulated. A curve from elsewhere scatters by its own degrees of freedom.

use super::average::{Replicate, average};
use super::pipeline::{Outcome, Settings};
use super::sampling::SamplingLaw;
use super::spread::Spread;
use crate::rng::StreamKey;
use crate::wavelet::{Curve, RobustVariance, Status};
use nalgebra::DMatrix;

/// Draws curves as the fitted model and the spread of the replicates would give them.
pub(super) struct CurveSampler<'a> {
    replicates: &'a [Replicate],
    outcome: &'a Outcome,
    law: SamplingLaw,
    /// Of replicates; none for a curve from elsewhere.
    pub(super) spread: Option<Spread>,
    /// Wavelet variance of the model, of each level of the curve.
    centre: Vec<f64>,
    /// Whether what replicates differ by has the tails of how little is known of it.
    heavy_tails: bool,
}

impl<'a> CurveSampler<'a> {
    pub(super) fn new(replicates: &'a [Replicate], outcome: &'a Outcome, settings: &Settings) -> Self {
        let model = &outcome.fit.composite;
        let levels = outcome.curve.levels.iter().copied().max().unwrap_or(1) as usize;
        let law = SamplingLaw::new(model, levels);
        let efficiency = settings.tuning.efficiency();
        let spread =
            (!replicates.is_empty()).then(|| Spread::new(replicates, outcome.estimator, &law, efficiency));
        let centre = outcome.curve.levels.iter().map(|level| model.haar_wv(*level)).collect();
        Self { replicates, outcome, law, spread, centre, heavy_tails: true }
    }

    /// The same, replicates differing by Gaussian numbers: their curves have a covariance.
    pub(super) fn gaussian(self) -> Self {
        Self { heavy_tails: false, ..self }
    }

    /// Covariance of curves, relative to that of the model.
    pub(super) fn covariance(&self, draws: usize, group: &str, settings: &Settings) -> DMatrix<f64> {
        let process = self.outcome.estimator.name();
        let draw = |run: usize| {
            let key = StreamKey { seed: 1, scenario: "covariance", run: run as u64, source: group, process };
            let curve = self.draw(&key, settings)?;
            Some(curve.wv.iter().zip(&self.centre).map(|(nu, centre)| nu / centre - 1.0).collect())
        };
        let errors: Vec<Vec<f64>> = (0..draws).filter_map(draw).collect();
        let count = errors.len() as f64;
        let levels = self.centre.len();
        let mean: Vec<f64> = (0..levels).map(|j| errors.iter().map(|e| e[j]).sum::<f64>() / count).collect();
        let product = |i: usize, j: usize| {
            errors.iter().map(|e| (e[i] - mean[i]) * (e[j] - mean[j])).sum::<f64>() / (count - 1.0)
        };
        DMatrix::from_fn(levels, levels, product)
    }

    /// A new curve of the same estimator.
    pub(super) fn draw(&self, key: &StreamKey<'_>, settings: &Settings) -> Option<Curve> {
        let mut generator = key.generator();
        let Some(spread) = &self.spread else {
            let curve = &self.outcome.curve;
            // The law knows all levels from 1; the curve may have some of them.
            let mut edof = vec![1.0; self.law.correlation.nrows()];
            curve.levels.iter().zip(&curve.edof).for_each(|(l, e)| edof[*l as usize - 1] = *e);
            let ratio = self.law.draw(&edof, &mut generator);
            let wv = curve.levels.iter().zip(&self.centre).map(|(l, nu)| nu * ratio[*l as usize - 1]);
            return Some(Curve { wv: wv.collect(), ..curve.clone() });
        };
        let between = spread.draw_between(self.heavy_tails, &mut generator);
        let drawn = self.replicates.iter().zip(&spread.edof).zip(&between);
        let replicates: Vec<Replicate> = drawn
            .map(|((replicate, edof), between)| {
                let ratios = self.law.draw(edof, &mut generator);
                let nu = self.centre.iter().zip(ratios).zip(between).map(|((nu, r), b)| nu * r * b.exp());
                like(replicate, nu.collect())
            })
            .collect();
        average(&replicates, self.outcome.estimator, settings.trim, settings.tuning.efficiency()).ok()
    }
}

/// A replicate of the same length with other variances.
pub(super) fn like(replicate: &Replicate, nu: Vec<f64>) -> Replicate {
    let robust = nu.iter().map(|value| RobustVariance { value: *value, status: Status::Ok }).collect();
    Replicate { name: String::new(), axis: replicate.axis, samples: replicate.samples, classical: nu, robust }
}
