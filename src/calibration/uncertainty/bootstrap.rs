//! New curves from a fit: the parametric bootstrap behind intervals, goodness of fit and full weighting.
//!
//! Each draw makes K new replicates. Their ln nu at all levels have the variances and the correlations that the
//! recorded ones show (Gaussian scores; chi-square in shape, so that the mean of nu is that of the fitted model): what
//! replicates differ by and the scatter within each are in these together, so that nothing is assumed of either, and what
//! few replicates leave unknown is Student's t ([`Spread::student`]). The draws for full weighting, which needs more
//! than the rank of K replicates, and those of a single recording have the scatter *within* a recording of the
//! large-sample law (of the model's own wavelet variance and the length; divided by the efficiency where robust) and,
//! *between* replicates, the excess over it. Robust variances of few coefficients read high, in a draw as in a recording.
//! The estimator is applied to the new replicates, trim and all. No signal is simulated. A curve from elsewhere
//! scatters by its own degrees of freedom.

use super::spread::Spread;
use crate::curve::sampling::SamplingLaw;
use crate::curve::{Estimator, Group, Replicate, average, implied};
use crate::noise::Composite;
use crate::outcome::{Outcome, Settings};
use crate::rng::{Generator, StreamKey};
use crate::wavelet::{Curve, RobustVariance, Status};
use nalgebra::DMatrix;

/// Sources of scatter in the draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scattering {
    /// Recordings differ, and each scatters for its length.
    All,
    /// Recordings differ, each of them endless.
    BetweenRecordings,
}

/// Largest relative bias of a robust variance, beyond which its expansion fails: the most that was measured
/// (docs/limits.md: 21 % with two lengths of the scale in the record).
const LARGEST_BIAS: f64 = 0.2;

/// Draws curves as a fitted model and the spread of the replicates would give them.
pub(crate) struct CurveSampler<'a> {
    replicates: &'a [Replicate],
    estimator: Estimator,
    /// The curve that was fitted.
    curve: &'a Curve,
    pub(crate) law: SamplingLaw,
    /// Spread of the replicates; none for a curve from elsewhere.
    pub(crate) spread: Option<Spread>,
    /// The curve that the model implies.
    centre: Vec<f64>,
    /// Relative bias of a robust variance times its degrees of freedom
    /// ([`Tuning::bias`](crate::wavelet::Tuning::bias)).
    bias_times_edof: f64,
}

impl<'a> CurveSampler<'a> {
    pub(crate) fn new(
        replicates: &'a [Replicate],
        estimator: Estimator,
        curve: &'a Curve,
        model: &Composite,
        settings: &Settings,
    ) -> Self {
        let levels = curve.levels.iter().copied().max().unwrap_or(1) as usize;
        let law = SamplingLaw::new(model, levels);
        let spread = (!replicates.is_empty())
            .then(|| Spread::new(replicates, estimator, &law, &settings.tuning));
        let centre = implied(model, curve);
        Self {
            replicates,
            estimator,
            curve,
            law,
            spread,
            centre,
            bias_times_edof: settings.tuning.bias(),
        }
    }

    /// A sampler of the curves that the fit of an outcome would give.
    pub(crate) fn of_outcome(group: &'a Group, outcome: &'a Outcome, settings: &Settings) -> Self {
        let Outcome {
            estimator,
            curve,
            fit,
            ..
        } = outcome;
        Self::new(
            &group.replicates,
            *estimator,
            curve,
            &fit.composite,
            settings,
        )
    }

    /// Covariance of curves as recorded, relative to the model: of no greater rank than replicates give.
    pub(crate) fn covariance_as_recorded(
        &self,
        draws: usize,
        group: &str,
        settings: &Settings,
    ) -> DMatrix<f64> {
        let process = self.estimator.name();
        // Relative to the model: absolute values differ by powers of ten from level to level.
        let error = |run: usize| {
            let key = StreamKey {
                seed: 1,
                scenario: "covariance",
                run: run as u64,
                source: group,
                process,
            };
            let curve = self.draw_as_recorded(&key, settings)?;
            Some(
                curve
                    .wv
                    .iter()
                    .zip(&self.centre)
                    .map(|(nu, centre)| nu / centre - 1.0)
                    .collect(),
            )
        };
        let errors: Vec<Vec<f64>> = (0..draws).filter_map(error).collect();
        let count = errors.len() as f64;
        let levels = self.centre.len();
        let mean: Vec<f64> = (0..levels)
            .map(|j| errors.iter().map(|e| e[j]).sum::<f64>() / count)
            .collect();
        let product = |i: usize, j: usize| {
            errors
                .iter()
                .map(|e| (e[i] - mean[i]) * (e[j] - mean[j]))
                .sum::<f64>()
                / (count - 1.0)
        };
        DMatrix::from_fn(levels, levels, product)
    }

    /// A new curve of the same estimator, of replicates that scatter as the recorded ones do.
    pub(crate) fn draw_as_recorded(
        &self,
        key: &StreamKey<'_>,
        settings: &Settings,
    ) -> Option<Curve> {
        match &self.spread {
            Some(spread) if self.replicates.len() > 1 => {
                self.curve(spread.draw(&mut key.generator()), settings)
            }
            _ => self.draw(key, settings),
        }
    }

    /// A new curve of the same estimator, of replicates that scatter by the law and by what they differ beyond it.
    pub(crate) fn draw(&self, key: &StreamKey<'_>, settings: &Settings) -> Option<Curve> {
        let mut generator = key.generator();
        match &self.spread {
            Some(spread) => self.curve(self.random_effects(spread, &mut generator), settings),
            None => Some(self.elsewhere(&mut generator)),
        }
    }

    /// A new curve of the same estimator, of replicates that differ by `between` (`[replicate][level]`, over the model)
    /// and, unless they are endless, scatter by the law.
    pub(crate) fn draw_with(
        &self,
        key: &StreamKey<'_>,
        between: &[Vec<f64>],
        scattering: Scattering,
        settings: &Settings,
    ) -> Option<Curve> {
        let mut generator = key.generator();
        let ratios_of_recording = |(edof, between): (&Vec<f64>, &Vec<f64>)| match scattering {
            Scattering::All => {
                let within = self.law.draw(edof, &mut generator);
                within
                    .into_iter()
                    .zip(between)
                    .map(|(ratio, b)| ratio * b)
                    .collect()
            }
            Scattering::BetweenRecordings => between.clone(),
        };
        let ratios = self
            .spread
            .as_ref()?
            .edof
            .iter()
            .zip(between)
            .map(ratios_of_recording)
            .collect();
        self.curve(ratios, settings)
    }

    /// nu*/nu of new replicates: what they differ by, and the scatter of each.
    fn random_effects(&self, spread: &Spread, generator: &mut Generator) -> Vec<Vec<f64>> {
        let between = spread.draw_between(generator);
        let ratios_of_recording = |(edof, between): (&Vec<f64>, Vec<f64>)| {
            let within = self.law.draw(edof, generator);
            within
                .into_iter()
                .zip(between)
                .map(|(ratio, b)| ratio * b.exp())
                .collect()
        };
        spread
            .edof
            .iter()
            .zip(between)
            .map(ratios_of_recording)
            .collect()
    }

    /// The estimator's curve of replicates of which nu*/nu is given.
    fn curve(&self, ratios: Vec<Vec<f64>>, settings: &Settings) -> Option<Curve> {
        let edof = self.spread.iter().flat_map(|s| &s.edof);
        let drawn_replicate = |((replicate, ratios), edof): ((&Replicate, Vec<f64>), &Vec<f64>)| {
            let levels = self
                .centre
                .iter()
                .zip(ratios)
                .zip(edof)
                .take(replicate.levels())
                .enumerate();
            // The law gives ratios whose mean is 1; robust variances of few coefficients read high, and so
            // must those drawn.
            let bias = |j: usize, edof: f64| {
                if replicate.is_robust(self.estimator, j) {
                    self.bias(edof)
                } else {
                    0.0
                }
            };
            like(
                replicate,
                levels
                    .map(|(j, ((nu, ratio), edof))| nu * ratio * (1.0 + bias(j, *edof)))
                    .collect(),
            )
        };
        let replicates: Vec<Replicate> = self
            .replicates
            .iter()
            .zip(ratios)
            .zip(edof)
            .map(drawn_replicate)
            .collect();
        let curve = average(&replicates, self.estimator, settings.trim, &settings.tuning).ok()?;
        // The draws have a root everywhere; what the fit left out, it leaves out of every draw.
        let Curve {
            differing,
            classical,
            ignored,
            ..
        } = self.curve.clone();
        Some(Curve {
            differing,
            classical,
            ignored,
            ..curve
        })
    }

    /// Relative bias of a robust variance with so many degrees of freedom.
    fn bias(&self, edof: f64) -> f64 {
        (self.bias_times_edof / edof).min(LARGEST_BIAS)
    }

    /// A curve from elsewhere, which scatters by its degrees of freedom.
    fn elsewhere(&self, generator: &mut Generator) -> Curve {
        let curve = self.curve;
        // The law knows all levels from 1; the curve may have some of them.
        let mut edof = vec![1.0; self.law.correlation.nrows()];
        curve
            .levels
            .iter()
            .zip(&curve.edof)
            .for_each(|(l, e)| edof[*l as usize - 1] = *e);
        let ratio = self.law.draw(&edof, generator);
        let wv = curve
            .levels
            .iter()
            .zip(&self.centre)
            .map(|(l, nu)| nu * ratio[*l as usize - 1]);
        Curve {
            wv: wv.collect(),
            ..curve.clone()
        }
    }
}

/// A replicate of the same length with other variances, classical where that replicate's are.
pub(crate) fn like(replicate: &Replicate, nu: Vec<f64>) -> Replicate {
    let status = |j: usize| match replicate.robust.get(j).map(|robust| robust.status) {
        Some(Status::Coarse) => Status::Coarse,
        _ => Status::Ok,
    };
    let robust = nu
        .iter()
        .enumerate()
        .map(|(j, nu)| RobustVariance {
            value: *nu,
            status: status(j),
            zeros: 0.0,
        })
        .collect();
    Replicate {
        name: String::new(),
        axis: replicate.axis,
        samples: replicate.samples,
        coverage: replicate.coverage.clone(),
        classical: nu,
        robust,
        trend: f64::NAN,
        mean: f64::NAN,
    }
}
