//! What the parameters of recordings differ by: the law of each from recording to recording.
//!
//! The model is fitted to every replicate alone. Its parameters, on the scale of [`Parameter::scaled`], are y_i = mean of the
//! axis + between_i + noise_i. The variance of the noise is that of fits to curves drawn by the large-sample law for the
//! replicate's length; the variance between is what brings Q = Σ (y_i − mean)²/(between² + noise_i) to its degrees of freedom
//! ([Paule and Mandel](crate::bibliography::PauleMandel82)). Its interval holds the values at which Q lies between the quantiles
//! of its chi-square law ([Viechtbauer](crate::bibliography::Viechtbauer07)): exact for normal y. A parameter whose interval
//! reaches 0 has no law.
//!
//! Axes of one recording may share what recordings differ by. Q then has fewer degrees of freedom than it has residuals: with A axes
//! of correlation r their number over 1 + (A − 1) r², by the variance of a sum of A correlated chi-squares.

use super::bootstrap::CurveSampler;
use super::intervals::{TAIL, matched, quantile};
use super::spread::{clipped, origins, share_of_freedom, small_sample};
use crate::curve::{Estimator, Group, Replicate, average, falling_root};
use crate::fit::Fit;
use crate::noise::{Parameter, ParameterRef, Process};
use crate::outcome::{Bootstrap, Outcome, ParameterInterval, ParameterSpread, Settings};
use crate::rng::StreamKey;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};
use std::collections::BTreeMap;

/// Recordings from which on a spread is told.
const LEAST: usize = 3;

/// The laws of the parameters that are known to differ. `intervals`: of the parameters of the outcome.
pub(crate) fn parameter_spreads(
    group: &Group,
    outcome: &Outcome,
    intervals: &[ParameterInterval],
    settings: &Settings,
    bootstrap: Bootstrap,
) -> Vec<ParameterSpread> {
    if group.recordings() < LEAST {
        return Vec::new();
    }
    let single = SingleFits {
        outcome,
        settings,
        bootstrap,
        group: &group.scope.name(),
    };
    let fits: Vec<Option<Fit>> = group
        .replicates
        .par_iter()
        .map(|r| single.fitted(r))
        .collect();
    let Some(fits) = fits.into_iter().collect::<Option<Vec<Fit>>>() else {
        return Vec::new();
    };
    let mut drawn = BTreeMap::new();
    for replicate in &group.replicates {
        drawn
            .entry(replicate.samples)
            .or_insert_with(|| single.drawn(replicate));
    }
    let told = intervals
        .iter()
        .filter(|i| i.absent.is_none() && i.of.parameter != Parameter::Theta);
    let spread = |interval: &ParameterInterval| {
        let of = interval.of;
        let values = single.scaled(&fits, of);
        let noise: BTreeMap<usize, f64> = drawn
            .iter()
            .map(|(samples, fits)| Some((*samples, variance(&single.scaled(fits, of))?)))
            .collect::<Option<_>>()?;
        let noise = group.replicates.iter().map(|r| noise[&r.samples]).collect();
        let values = values.into_iter().collect::<Option<_>>()?;
        Differences::new(&group.replicates, values, noise, outcome.estimator).spread(of)
    };
    told.filter_map(spread).collect()
}

/// Fits to one replicate at a time.
struct SingleFits<'a> {
    outcome: &'a Outcome,
    settings: &'a Settings,
    bootstrap: Bootstrap,
    group: &'a str,
}

impl SingleFits<'_> {
    /// The model of a replicate alone.
    fn fitted(&self, replicate: &Replicate) -> Option<Fit> {
        let settings = self.settings;
        let mut curve = average(
            std::slice::from_ref(replicate),
            self.outcome.estimator,
            settings.trim,
            &settings.tuning,
        )
        .ok()?;
        // Scales that are no part of the fit to all are no part of it either.
        curve.classical.clone_from(&self.outcome.curve.classical);
        curve.ignored.clone_from(&self.outcome.curve.ignored);
        self.outcome.estimate_again(&curve, settings).ok()
    }

    /// The models of as many curves as the bootstrap draws, of replicates as long of the model fitted to all.
    fn drawn(&self, replicate: &Replicate) -> Vec<Fit> {
        let Outcome {
            estimator,
            curve,
            fit,
            ..
        } = self.outcome;
        let alone = std::slice::from_ref(replicate);
        let sampler = CurveSampler::new(alone, *estimator, curve, &fit.composite, self.settings);
        let draw = |run: usize| {
            let key = StreamKey {
                seed: self.bootstrap.seed,
                scenario: "recording",
                run: run as u64,
                source: self.group,
                process: estimator.name(),
            };
            let mut curve = sampler.draw(&key, self.settings)?;
            curve.differing = 0.0;
            self.outcome.estimate_again(&curve, self.settings).ok()
        };
        (0..self.bootstrap.draws)
            .into_par_iter()
            .filter_map(draw)
            .collect()
    }

    /// A parameter of fits, scaled; none where its process is not there.
    fn scaled(&self, fits: &[Fit], of: ParameterRef) -> Vec<Option<f64>> {
        let of_fit = |fit: &Fit| {
            let processes = matched(&self.outcome.fit, fit);
            let process: &Process = processes[of.process]?;
            let at = process
                .kind()
                .parameters()
                .iter()
                .position(|p| *p == of.parameter)?;
            Some(of.parameter.scaled(process.values()[at])).filter(|scaled| scaled.is_finite())
        };
        fits.iter().map(of_fit).collect()
    }
}

/// Variance of the scaled parameters of draws by their quantiles a standard deviation from the middle; none where the process
/// vanishes in more of them than an interval leaves out.
fn variance(drawn: &[Option<f64>]) -> Option<f64> {
    let mut there: Vec<f64> = drawn.iter().copied().flatten().collect();
    if (there.len() as f64) < (1.0 - TAIL) * drawn.len() as f64 || there.len() < 2 {
        return None;
    }
    there.sort_by(f64::total_cmp);
    // Φ(±1)
    let half = 0.5 * (quantile(&there, 0.841_344_746) - quantile(&there, 0.158_655_254));
    Some(half * half).filter(|variance| *variance > 0.0)
}

/// A scaled parameter of every replicate.
struct Differences {
    /// By axis: the recordings, the values, and the variances of their noise.
    axes: Vec<OfAxis>,
    is_clipped: bool,
    share_of_freedom: f64,
}

#[derive(Default)]
struct OfAxis {
    recordings: Vec<usize>,
    values: Vec<f64>,
    noise: Vec<f64>,
}

impl OfAxis {
    /// Values (clipped, if asked for) and weights where recordings differ by this variance.
    fn weighted(&self, between: f64, is_clipped: bool) -> (Vec<f64>, Vec<f64>) {
        let weights: Vec<f64> = self
            .noise
            .iter()
            .map(|noise| 1.0 / (noise + between))
            .collect();
        let values = if is_clipped {
            clipped(&self.values, &weights)
        } else {
            self.values.clone()
        };
        (values, weights)
    }

    /// Residuals in standard deviations, from the mean of the axis.
    fn residuals(&self, between: f64, is_clipped: bool) -> Vec<f64> {
        let (values, weights) = self.weighted(between, is_clipped);
        let mean = weighted_mean(&values, &weights);
        let correction = if is_clipped {
            small_sample(values.len()).sqrt()
        } else {
            1.0
        };
        values
            .iter()
            .zip(weights)
            .map(|(x, w)| correction * (x - mean) * w.sqrt())
            .collect()
    }
}

fn weighted_mean(values: &[f64], weights: &[f64]) -> f64 {
    let sum: f64 = values.iter().zip(weights).map(|(x, w)| x * w).sum();
    sum / weights.iter().sum::<f64>()
}

impl Differences {
    fn new(
        replicates: &[Replicate],
        values: Vec<f64>,
        noise: Vec<f64>,
        estimator: Estimator,
    ) -> Self {
        let origins = origins(replicates);
        let count = origins.iter().map(|o| o.position + 1).max().unwrap_or(0);
        let mut axes: Vec<OfAxis> = (0..count).map(|_| OfAxis::default()).collect();
        for ((origin, value), noise) in origins.iter().zip(values).zip(noise) {
            let axis = &mut axes[origin.position];
            axis.recordings.push(origin.recording);
            axis.values.push(value);
            axis.noise.push(noise);
        }
        axes.retain(|axis| axis.values.len() > 1);
        Self {
            axes,
            is_clipped: estimator == Estimator::DrAwv,
            share_of_freedom: share_of_freedom(estimator),
        }
    }

    /// Q where recordings differ by this standard deviation.
    fn square(&self, between: f64) -> f64 {
        let of_axis = |axis: &OfAxis| -> f64 {
            axis.residuals(between * between, self.is_clipped)
                .iter()
                .map(|z| z * z)
                .sum()
        };
        self.axes.iter().map(of_axis).sum()
    }

    /// The law of the parameter; none where it may be without spread.
    fn spread(&self, of: ParameterRef) -> Option<ParameterSpread> {
        let residuals = self
            .axes
            .iter()
            .map(|axis| axis.values.len() - 1)
            .sum::<usize>() as f64;
        if residuals < (LEAST - 1) as f64 {
            return None;
        }
        let root =
            |target: f64| falling_root(|between| self.square(between) - target, self.range());
        let sd = root(residuals);
        let squared_correlation = self.squared_correlation(sd);
        let others = self.axes.len() as f64 - 1.0;
        let freedom = self.share_of_freedom * residuals / (1.0 + others * squared_correlation);
        let (chi, student) = (
            ChiSquared::new(freedom).ok()?,
            StudentsT::new(0.0, 1.0, freedom).ok()?,
        );
        let end = |p: f64| root(chi.inverse_cdf(p) * residuals / freedom);
        let sd_ci95 = [end(1.0 - TAIL), end(TAIL)];
        if sd_ci95[0] <= 0.0 {
            return None;
        }
        let (mut values, mut weights) = (Vec::new(), Vec::new());
        for axis in &self.axes {
            let (own, own_weights) = axis.weighted(sd * sd, self.is_clipped);
            values.extend(own);
            weights.extend(own_weights);
        }
        let mean = weighted_mean(&values, &weights);
        let shared = 1.0 + others * squared_correlation.sqrt();
        let half = student.inverse_cdf(1.0 - TAIL) * (shared / weights.iter().sum::<f64>()).sqrt();
        let mut median_ci95 = [mean - half, mean + half].map(|end| of.parameter.unscaled(end));
        median_ci95.sort_by(f64::total_cmp);
        Some(ParameterSpread {
            of,
            median: of.parameter.unscaled(mean),
            median_ci95,
            sd,
            sd_ci95,
        })
    }

    /// A standard deviation that no root exceeds: with it Q is below the least quantile that is asked for.
    fn range(&self) -> f64 {
        let all = || self.axes.iter().flat_map(|axis| &axis.values);
        let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(*x), h.max(*x))
        });
        // Q ≤ n (range/between)²; the quantile 0.025 of one degree of freedom is 1e-3.
        (high - low) * (1e3 * all().count() as f64).sqrt()
    }

    /// Mean square of the correlations of the axes over the recordings.
    fn squared_correlation(&self, between: f64) -> f64 {
        let residuals: Vec<Vec<f64>> = self
            .axes
            .iter()
            .map(|axis| axis.residuals(between * between, self.is_clipped))
            .collect();
        let mut squares = Vec::new();
        for a in 0..self.axes.len() {
            for b in 0..a {
                let pairs = self.axes[a]
                    .recordings
                    .iter()
                    .zip(&residuals[a])
                    .filter_map(|(recording, x)| {
                        let at = self.axes[b]
                            .recordings
                            .iter()
                            .position(|other| other == recording)?;
                        Some((*x, residuals[b][at]))
                    });
                let (xy, xx, yy) = pairs.fold((0.0, 0.0, 0.0), |(xy, xx, yy), (x, y)| {
                    (xy + x * y, xx + x * x, yy + y * y)
                });
                squares.push(if xy == 0.0 { 0.0 } else { xy * xy / (xx * yy) });
            }
        }
        squares.iter().sum::<f64>() / (squares.len() as f64).max(1.0)
    }
}

#[cfg(test)]
mod tests;
