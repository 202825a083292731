//! Least squares: theta = argmin Σ Omega_j (nu_j − nu_j(theta))².

use super::search::{Component, Objective, Range, SearchBudget, SearchResult, Termination, search};
use crate::curve::{CalibrationError, CalibrationFault, falling_root, implied};
use crate::model::ModelSpec;
use crate::noise::{Composite, ParameterError, ParameterRef, Process, ProcessKind};
use crate::wavelet::Curve;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::fmt::Display;

/// Fits a model to a curve. The rate (Hz) is what a GM is sampled at.
///
/// AR1 and GM processes are sought with correlation times between a sixth of a sample (phi = e^−6) and twenty times the
/// longest scale; phi is positive. A fit that ends there is reported ([`Fit::at_end`]).
///
/// # Errors
/// When the curve has fewer scales than the model parameters, or numbers that are no wavelet variances.
pub fn fit(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
) -> Result<Fit, CalibrationError> {
    let observed = |curve: &Curve| {
        let nu = curve.wv.clone();
        let weights = Weights { weighting, nu };
        fit_near(curve, spec, rate_hz, weights, SearchBudget::WHOLE, &[])
    };
    match weighting {
        Weighting::Model => {
            let curve = centred(curve);
            // The observed variances are the only ones there are before a model.
            let first = observed(&curve)?;
            let fit = settled(&curve, spec, rate_hz, first)?;
            with_lack_of_fit(&curve, spec, rate_hz, fit)
        }
        Weighting::Edof => observed(curve),
    }
}

/// The curve whose logarithm is on average that of the model's.
fn centred(curve: &Curve) -> Curve {
    let mut centred = curve.clone();
    for (wv, bias) in centred.wv.iter_mut().zip(&curve.log_bias) {
        *wv *= (-bias).exp();
    }
    centred
}

/// Fits with the variance of ln nu at which the scales are as far from the model as their number says, where chance does not
/// explain how far they are: no scale then draws the model away from the others because it is known best.
fn with_lack_of_fit(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    mut fit: Fit,
) -> Result<Fit, CalibrationError> {
    // The level of the test of a model that is right.
    let mut lack = lack_of_fit(curve, &fit, 0.975);
    for _ in 0..MOST_ROUNDS {
        let Some(variance) = lack else { break };
        let wider = curve.widened(variance);
        let weights = Weights {
            weighting: Weighting::Model,
            nu: expected(&wider, &fit),
        };
        let first = fit_near(
            &wider,
            spec,
            rate_hz,
            weights,
            SearchBudget::WHOLE,
            &fit.minima,
        )?;
        let before = fit.lack_of_fit;
        fit = Fit {
            lack_of_fit: variance,
            ..settled(&wider, spec, rate_hz, first)?
        };
        if (before / variance - 1.0).abs() < 1e-3 {
            break;
        }
        lack = lack_of_fit(curve, &fit, 0.5);
    }
    Ok(match fit.lack_of_fit > 0.0 {
        true => fit.at_own_weights(curve),
        false => fit,
    })
}

/// The variance b² with which Σ ln(nu_hat/nu)²/(2/eta + b²) is its degrees of freedom; none where the sum is below its quantile
/// without b².
fn lack_of_fit(curve: &Curve, fit: &Fit, quantile: f64) -> Option<f64> {
    let nu = expected(curve, fit);
    let scales = curve
        .levels
        .iter()
        .zip(&curve.edof)
        .zip(curve.wv.iter().zip(nu));
    let counted: Vec<(f64, f64)> = scales
        .filter(|((level, _), _)| !curve.ignored.contains(level))
        .map(|((_, edof), (wv, nu))| ((wv / nu).ln().powi(2), 2.0 / edof + curve.differing))
        .collect();
    let freedom = counted.len().checked_sub(fit.free_parameters() + 1)? as f64 + 1.0;
    let sum = |b2: f64| {
        counted
            .iter()
            .map(|(square, own)| square / (own + b2))
            .sum::<f64>()
    };
    let limit = ChiSquared::new(freedom).ok()?.inverse_cdf(quantile);
    // No b² is larger than the largest square.
    let largest = counted
        .iter()
        .map(|(square, _)| *square)
        .fold(0.0, f64::max)
        * counted.len() as f64
        / freedom;
    (sum(0.0) > limit).then(|| falling_root(|b2| sum(b2) - freedom, largest))
}

/// Largest number of repeated fits until the weights are those of the model itself.
const MOST_ROUNDS: usize = 20;
/// Rounds for a curve that resembles one already fitted, whose model is where the weights begin.
const FEW_ROUNDS: usize = 3;
/// Relative change of the implied curve below which no further fit is made.
const SETTLED: f64 = 1e-6;

/// The curve that a fit implies, where it may be divided by.
fn expected(curve: &Curve, fit: &Fit) -> Vec<f64> {
    // A model without any amplitude implies nothing.
    implied(&fit.composite, curve)
        .iter()
        .zip(&curve.wv)
        .map(|(nu, wv)| nu.max(1e-6 * wv))
        .collect()
}

/// Fits with the weights of the last result until they are those of the result itself.
fn settled(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    first: Fit,
) -> Result<Fit, CalibrationError> {
    let (mut visited, last) = reweighted(
        curve,
        spec,
        rate_hz,
        first,
        MOST_ROUNDS,
        SearchBudget::WHOLE,
    )?;
    if is_settled(curve, &last) {
        return Ok(last.at_own_weights(curve));
    }
    // The weights of each of two minima lead the search to the other: both are followed within their own basin, and the one
    // that is nearer to the curve by its own weights is taken.
    visited.push(last);
    let recent = visited.into_iter().rev().take(2);
    let within = recent.map(|fit| {
        reweighted(
            curve,
            spec,
            rate_hz,
            fit.within_its_basin(),
            MOST_ROUNDS,
            SearchBudget::WHOLE.within(),
        )
        .map(|(_, fit)| fit)
    });
    let ended = within
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .map(|fit| {
            let termination = if is_settled(curve, &fit) {
                fit.termination
            } else {
                Termination::IterationLimit
            };
            Fit {
                termination,
                ..fit.at_own_weights(curve)
            }
        });
    Ok(ended
        .min_by(|a, b| a.objective.total_cmp(&b.objective))
        .expect("two"))
}

/// Returns true if the weights of a fit reproduce themselves: they follow from its own result.
fn is_settled(curve: &Curve, fit: &Fit) -> bool {
    let nu = expected(curve, fit);
    nu.iter()
        .zip(&fit.weighted_for)
        .all(|(a, b)| (a / b - 1.0).abs() < SETTLED)
}

/// Fits with the weights of the last result; those before the last, and the last.
fn reweighted(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    first: Fit,
    rounds: usize,
    effort: SearchBudget,
) -> Result<(Vec<Fit>, Fit), CalibrationError> {
    let (mut before, mut last) = (Vec::new(), first);
    while before.len() < rounds && !is_settled(curve, &last) {
        let weights = Weights {
            weighting: Weighting::Model,
            nu: expected(curve, &last),
        };
        let next = fit_near(curve, spec, rate_hz, weights, effort, &last.minima)?;
        before.push(std::mem::replace(&mut last, next));
    }
    Ok((before, last))
}

impl Fit {
    /// Number of parameters that the curve has determined: those of a process without amplitude took nothing from it.
    pub(crate) fn free_parameters(&self) -> usize {
        let free = |(of, _): &(ParameterRef, f64)| !self.zero.contains(&of.process);
        self.composite.parameters().filter(free).count()
    }

    /// The fit with its own minimum as the only one known.
    fn within_its_basin(mut self) -> Self {
        self.minima.truncate(1);
        self
    }

    /// The fit with its objective and residuals in standard deviations of the curve where the model holds: in the weights of
    /// the fit a scale far above the model counts little, and a model would be the less rejected the more it misses.
    fn at_own_weights(self, curve: &Curve) -> Self {
        let nu = expected(curve, &self);
        let pairs = inverse_deviations(curve, &nu)
            .into_iter()
            .zip(curve.wv.iter().zip(&nu));
        let residuals: Vec<f64> = pairs.map(|(root, (wv, nu))| root * (wv - nu)).collect();
        let objective = residuals.iter().map(|r| r * r).sum();
        // Of other minima what is known is how far they are behind by the weights of the fit.
        let behind = |other: f64| objective * (other / self.objective).max(1.0);
        let runner_up = self
            .runner_up
            .map(behind)
            .filter(|other: &f64| other.is_finite());
        Self {
            objective,
            residuals,
            runner_up,
            ..self
        }
    }
}

/// Fits a curve that resembles one already fitted: a coarser grid, and the minima of that one.
pub(crate) fn refit(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
    like: &Fit,
) -> Result<Fit, CalibrationError> {
    let first = |curve: &Curve, nu: Vec<f64>| {
        let weights = Weights { weighting, nu };
        fit_near(
            curve,
            spec,
            rate_hz,
            weights,
            SearchBudget::AGAIN,
            &like.minima,
        )
    };
    if weighting == Weighting::Edof {
        return first(curve, curve.wv.clone());
    }
    let plain = centred(curve);
    let curve = plain.widened(like.lack_of_fit);
    // The model of the curve that this one resembles is known better than one draw knows itself; the weights change little:
    // the basin of the first round is that of the others.
    let first = first(&curve, expected(&curve, like))?.within_its_basin();
    let (_, last) = reweighted(
        &curve,
        spec,
        rate_hz,
        first,
        FEW_ROUNDS,
        SearchBudget::AGAIN.within(),
    )?;
    Ok(Fit {
        lack_of_fit: like.lack_of_fit,
        ..last.at_own_weights(&plain)
    })
}

/// Weights of the scales of a curve.
struct Weights {
    weighting: Weighting,
    /// Wavelet variances at which the weights are evaluated (units²).
    nu: Vec<f64>,
}

fn fit_near(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weights: Weights,
    effort: SearchBudget,
    known: &[Vec<f64>],
) -> Result<Fit, CalibrationError> {
    check(curve, spec)?;
    let components = spec
        .kinds()
        .iter()
        .map(|kind| component(*kind, curve))
        .collect();
    let Weights { weighting, nu } = weights;
    let objective = Objective::new(curve, weighting, &nu, components);
    let found = search(&objective, effort, known);
    Ok(Fit {
        weighted_for: nu,
        ..assemble(&objective, &found, rate_hz)?
    })
}

/// Error of a curve with fewer scales than parameters.
pub(crate) fn too_few_scales(
    spec: impl Display,
    parameters: usize,
    scales: usize,
) -> CalibrationError {
    let message = format!("{spec} has {parameters} parameters, the curve {scales} scales");
    CalibrationError::new(CalibrationFault::TooFewScales, message)
}

fn check(curve: &Curve, spec: &ModelSpec) -> Result<(), CalibrationError> {
    let bad = |values: &[f64], (low, high): (f64, f64)| {
        values.iter().position(|v| !(*v >= low && *v <= high))
    };
    if let Some(i) = bad(&curve.wv, Curve::WV_RANGE) {
        let (level, value) = (curve.levels[i], curve.wv[i]);
        let message =
            format!("the wavelet variance at scale 2^{level} is {value}, out of 1e-100 to 1e100");
        return Err(CalibrationError::new(
            CalibrationFault::NotPositive,
            message,
        ));
    }
    if let Some(i) = bad(&curve.edof, Curve::EDOF_RANGE) {
        let (level, value) = (curve.levels[i], curve.edof[i]);
        return Err(CalibrationError::other(format!(
            "the degrees of freedom at scale 2^{level} are {value}, out of 1e-15 to 1e15"
        )));
    }
    let (parameters, scales) = (spec.parameters(), curve.counted_levels().len());
    if scales < parameters {
        return Err(too_few_scales(spec, parameters, scales));
    }
    Ok(())
}

/// Correlation times that are sought, in longest scales and in samples: beyond these ends the wavelet variance of an AR1
/// is that of a random walk to 2 % (at the longest scale), and of white noise to 0.8 % (the first scale against the others).
const LONGEST: f64 = 20.0;
const SHORTEST: f64 = 1.0 / 6.0;

/// ln κ of the correlation times that are sought, 1/κ in samples.
pub(crate) fn correlated(curve: &Curve) -> Range {
    let longest = f64::from(curve.levels.iter().copied().max().unwrap_or(1)).exp2();
    Range {
        low: -(LONGEST * longest).ln(),
        high: -SHORTEST.ln(),
    }
}

/// A process with the widest range in which a curve can say anything of its shape.
fn component(kind: ProcessKind, curve: &Curve) -> Component {
    let coordinate = match kind {
        // Correlation times in logarithms: equal steps of ln κ change the curve about equally.
        kind if kind.is_correlated() => Some(correlated(curve)),
        ProcessKind::Ma1 => Some(Range {
            low: -1.0,
            high: 1.0,
        }),
        _ => None,
    };
    Component { kind, coordinate }
}

// From the solution of a search to the fitted model.

/// The fit that a search has found, but for its weights.
/// Error of a result outside its domain: the numbers of the curve are out of range.
pub(crate) fn outside(e: ParameterError) -> CalibrationError {
    CalibrationError::other(format!("the fit left the domain of its parameters: {e}"))
}

fn assemble(
    objective: &Objective,
    found: &SearchResult,
    rate_hz: f64,
) -> Result<Fit, CalibrationError> {
    let unit = objective.length * objective.length;
    let best = &found.ends[0];
    let solution = objective.solve(&best.coordinates, None);
    let mut terms = terms(objective, &best.coordinates, &solution.amplitudes);
    let by_time = |a: &FittedTerm, b: &FittedTerm| b.coordinate.total_cmp(&a.coordinate);
    terms.sort_by(|a, b| a.kind.cmp(&b.kind).then_with(|| by_time(a, b)));
    let processes = terms
        .iter()
        .map(|t| t.process(rate_hz))
        .collect::<Result<_, _>>()
        .map_err(outside)?;
    let composite = Composite::new(processes);
    let those =
        |test: fn(&FittedTerm) -> bool| (0..terms.len()).filter(|i| test(&terms[*i])).collect();
    // Local minima differ by far more than 1e-6 of the objective; the ε² is for a curve that the model meets
    // exactly.
    let agreeing = |cost: f64| cost <= best.cost * (1.0 + 1e-6) + f64::EPSILON * f64::EPSILON;
    Ok(Fit {
        objective: best.cost * unit,
        termination: best.termination,
        combinations: found.combinations,
        starts: found.ends.len(),
        agreeing: found.ends.iter().filter(|e| agreeing(e.cost)).count(),
        runner_up: found
            .ends
            .iter()
            .find(|e| !agreeing(e.cost))
            .map(|e| e.cost * unit),
        zero: those(|t| t.amplitude <= 0.0),
        at_end: those(|t| t.amplitude > 0.0 && t.at_end),
        minima: minima(found),
        weighted_for: Vec::new(),
        lack_of_fit: 0.0,
        residuals: solution
            .residuals
            .iter()
            .map(|r| r * objective.length)
            .collect(),
        composite,
    })
}

/// Minima that are kept.
const KEPT: usize = 4;

/// The ends that differ, best first.
fn minima(found: &SearchResult) -> Vec<Vec<f64>> {
    let mut minima: Vec<Vec<f64>> = Vec::new();
    for end in &found.ends {
        // A descent from a start 0.1 % off ends in the same minimum.
        let same = |m: &Vec<f64>| {
            m.iter()
                .zip(&end.coordinates)
                .all(|(a, b)| (a - b).abs() < 1e-3)
        };
        if minima.len() < KEPT && !minima.iter().any(same) {
            minima.push(end.coordinates.clone());
        }
    }
    minima
}

/// One process of the result.
struct FittedTerm {
    kind: ProcessKind,
    amplitude: f64,
    coordinate: f64,
    at_end: bool,
}

fn terms(objective: &Objective, coordinates: &[f64], amplitudes: &[f64]) -> Vec<FittedTerm> {
    let mut next = coordinates.iter();
    let term = |(component, amplitude): (&Component, &f64)| {
        let (coordinate, at_end) = match component.coordinate {
            None => (0.0, false),
            Some(Range { low, high }) => {
                let u = next.next().copied().unwrap_or(low);
                // 1e-6 of ln κ, or of theta: the bounded step puts a coordinate on its end but for rounding.
                (u, high > low && (u - low < 1e-6 || high - u < 1e-6))
            }
        };
        FittedTerm {
            kind: component.kind,
            amplitude: *amplitude,
            coordinate,
            at_end,
        }
    };
    objective
        .components
        .iter()
        .zip(amplitudes)
        .map(term)
        .collect()
}

impl FittedTerm {
    fn process(&self, rate_hz: f64) -> Result<Process, ParameterError> {
        let kappa = self.coordinate.exp();
        let amplitude = match self.kind.power() {
            1 => self.amplitude,
            _ => self.amplitude.sqrt(),
        };
        let shape = match self.kind {
            ProcessKind::Ar1 => (-kappa).exp(),
            ProcessKind::GaussMarkov => kappa * rate_hz,
            _ => self.coordinate,
        };
        Process::new(self.kind, shape, amplitude, rate_hz)
    }
}

// Weights of the scales in a fit.

/// Omega: the weights of the scales.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weighting {
    /// 1/(nu(theta)² (2/edof + b²)), the inverse variance of nu_hat where the model holds, times ln r/(r − 1), r = nu_hat/nu(theta):
    /// so the minimum is that of Σ (ln r)²/(2/edof + b²). b² is what recordings differ by, and what the model lacks where
    /// chance does not explain how far it is from the curve. The fit is repeated until the weights are those of its own result;
    /// a variance that is low by chance weighs no more than others, and a scale far from the model does not draw it away.
    #[default]
    Model,
    /// edof/(2 nu_hat²), the convention of the literature: what is low by chance weighs most.
    Edof,
}

nav_sim_signal::named!(
    Weighting {
        Model = "model",
        Edof = "edof",
    }, in files
);

impl Weighting {
    /// √Omega_j of each scale (1/units²), where its variance is taken to be `nu`.
    pub(crate) fn roots(self, curve: &Curve, nu: &[f64]) -> Vec<f64> {
        let plain = inverse_deviations(curve, nu);
        let scales = plain.iter().zip(nu).zip(curve.wv.iter().zip(&curve.edof));
        let root = |((plain, nu), (wv, edof)): ((&f64, &f64), (&f64, &f64))| match self {
            _ if *plain == 0.0 => 0.0,
            Self::Edof => (0.5 * edof).sqrt() / nu,
            Self::Model => plain * logarithmic(wv / nu).sqrt(),
        };
        scales.map(root).collect()
    }
}

/// ln r/(r − 1), by which the gradient of a weighted square is that of the square of a logarithm.
fn logarithmic(r: f64) -> f64 {
    let off = r - 1.0;
    // The quotient loses half its digits there; the series is off by off²/3.
    if off.abs() < 1e-8 {
        1.0 - 0.5 * off
    } else {
        r.ln() / off
    }
}

/// 1/(standard deviation of nu_hat) where the variance is `nu`, of scales that count; 0 of others.
fn inverse_deviations(curve: &Curve, nu: &[f64]) -> Vec<f64> {
    let root = |((nu, edof), level): ((&f64, &f64), &u32)| match curve.ignored.contains(level) {
        true => 0.0,
        // var nu_hat = 2 nu²/eta by its own noise; var ln nu by what recordings differ by.
        false => 1.0 / (nu * (2.0 / edof + curve.differing).sqrt()),
    };
    nu.iter()
        .zip(&curve.edof)
        .zip(&curve.levels)
        .map(root)
        .collect()
}

/// The normal score of a chi-square over its degrees of freedom (Wilson and Hilferty): of few degrees the ratio less one over
/// its deviation would never be far below zero, however improbable it is.
pub(crate) fn score(ratio: f64, edof: f64) -> f64 {
    // (chi²/eta)^(1/3) is nearly normal with mean 1 − 2/(9 eta) and variance 2/(9 eta).
    let variance = 2.0 / (9.0 * edof);
    (ratio.cbrt() - 1.0 + variance) / variance.sqrt()
}

// A model fitted to a curve.

/// A fitted model. That the iterations did not converge is reported, not an error.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The model: processes in the order of [`ProcessKind::ALL`](crate::noise::ProcessKind::ALL), alike ones by ascending correlation time.
    pub composite: Composite,
    /// Σ Omega_j (nu_j − nu_j(theta))² at theta.
    pub objective: f64,
    /// End of the iterations of the best start.
    pub termination: Termination,
    /// Combinations of shapes (correlation times) that were tried, each with its best amplitudes.
    pub combinations: usize,
    /// Local minima among them, all descended from.
    pub starts: usize,
    /// Starts that end within 1e-6 of the best objective.
    pub agreeing: usize,
    /// The next best local minimum's objective, if there is one.
    pub runner_up: Option<f64>,
    /// The processes whose amplitude is zero: not identifiable from this curve.
    pub zero: Vec<usize>,
    /// The processes whose shape lies at the end of its range: not identifiable either.
    pub at_end: Vec<usize>,
    /// √Omega_j (nu_j − nu_j(theta)) of each scale; in standard deviations when weighted by edof.
    pub residuals: Vec<f64>,
    /// Coordinates of the minima found, best first: where the search of a similar curve begins.
    pub(crate) minima: Vec<Vec<f64>>,
    /// The variances that the weights were made for.
    pub(crate) weighted_for: Vec<f64>,
    /// Variance of ln nu that the model lacks at a scale, beyond chance; 0 where chance explains how far it is from the curve.
    pub lack_of_fit: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Parameter;
    use crate::tests::*;

    #[test]
    fn what_is_no_wavelet_variance_is_refused() {
        let refused = |wv: f64, edof: f64| {
            let curve = Curve {
                wv: vec![1.0, wv, 0.25],
                edof: vec![50.0, edof, 50.0],
                levels: vec![1, 2, 3],
                ..Curve::default()
            };
            fit(&curve, &"WN".parse().unwrap(), 1.0, Weighting::Edof).unwrap_err()
        };
        for value in [-1.0, 0.0, 1e101] {
            let [variance, degrees] = [refused(value, 50.0), refused(0.5, value)];
            assert_eq!(
                (variance.cause, degrees.cause),
                (CalibrationFault::NotPositive, CalibrationFault::Other)
            );
            let place = format!("at scale 2^2 is {value}, ");
            assert!(variance.to_string().contains(&place), "{variance}");
            let place = format!("at scale 2^2 are {value}, ");
            assert!(degrees.to_string().contains(&place), "{degrees}");
        }
    }

    /// The exact curve of a process of each kind gives its parameters back.
    #[test]
    fn the_curve_of_each_kind_is_fitted_by_it() {
        for kind in ProcessKind::ALL {
            let shape = match kind.shape() {
                Some(Parameter::Beta) => 1.0,
                Some(Parameter::Phi) => 0.99,
                _ => 0.5,
            };
            let truth = Process::new(kind, shape, 0.3, 100.0).unwrap();
            let curve = exact(&Composite::new(vec![truth]), 14, |_| 50.0);
            let spec = kind.code().parse().unwrap();
            let found = fit(&curve, &spec, 100.0, Weighting::Model)
                .unwrap()
                .composite;
            let (found, values) = (found.processes[0].values(), truth.values());
            assert_relative_eq!(found[..], values[..], max_relative = 1e-6);
        }
    }

    /// An AR1 that has to stand for a random walk takes the longest correlation time that is sought, 20 times 2^12 samples, and
    /// is told to lie at the end; what is not there is told to be zero, and lies nowhere.
    #[test]
    fn a_process_at_the_end_of_its_range_is_told() {
        let fitted = |gamma2: f64| {
            let curve = exact(&white_and_walk(1.0, gamma2), 12, |_| 50.0);
            fit(&curve, &"WN+AR1".parse().unwrap(), 1.0, Weighting::Edof).unwrap()
        };
        let wandering = fitted(1e-4);
        let ar1 = wandering.composite.processes[1];
        assert_eq!(ar1.kind(), ProcessKind::Ar1);
        assert_relative_eq!(-1.0 / ar1.shape().ln(), 20.0 * 4096.0, max_relative = 1e-6);
        assert_eq!((wandering.at_end, wandering.zero), (vec![1], vec![]));
        let still = fitted(0.0);
        assert_eq!((still.at_end, still.zero), (vec![], vec![1]));
    }

    /// N2 with 8 to 30 % of noise at every scale, a third of it unknown to the degrees of freedom: on some of these curves the
    /// weights of one minimum lead to another and back. What is called converged has the weights of its own result.
    #[test]
    fn a_fit_is_called_converged_where_its_weights_are_its_own() {
        let model = Composite::new(vec![
            Process::white(1.0).unwrap(),
            Process::quantization(0.5).unwrap(),
            Process::ar1(0.9, 1e-3).unwrap(),
            Process::ar1(0.999, 1e-5).unwrap(),
            Process::random_walk(1e-8).unwrap(),
        ]);
        let mut generator = Generator::seed_from_u64(29);
        let mut unsettled = 0;
        for k in 0..30 {
            let noise = 0.08 + 0.22 * f64::from(k % 3) / 2.0;
            let mut curve = exact(&model, 14, |_| 3.0 / (noise * noise));
            let mut off = || (noise * generator.sample::<f64, _>(StandardNormal)).exp();
            curve.wv.iter_mut().for_each(|nu| *nu *= off());
            let fit = fit(&curve, &ModelSpec::n2(), 1.0, Weighting::Model).unwrap();
            let is_converged = fit.termination == Termination::Converged;
            unsettled += u32::from(!is_converged);
            assert_eq!(is_converged, is_settled(&curve, &fit), "curve {k}");
            let phi = |p: &Process| (p.kind() == ProcessKind::Ar1).then(|| p.shape());
            assert!(
                fit.composite.processes.iter().filter_map(phi).is_sorted(),
                "curve {k}"
            );
            // the best agrees with itself; another minimum is behind it
            assert!(
                (1..=fit.starts).contains(&fit.agreeing),
                "curve {k}: {}",
                fit.agreeing
            );
            let is_behind = fit.runner_up.is_none_or(|other| other > fit.objective);
            assert!(is_behind, "curve {k}: {:?}", fit.runner_up);
        }
        // Most can be followed within the basin of either minimum.
        assert!(unsettled <= 3, "{unsettled}");
    }
}

#[cfg(test)]
mod weighting_tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Two scales, of which the last does not count.
    fn curve(edof: f64) -> Curve {
        let (levels, ignored) = (vec![1, 2], vec![2]);
        Curve {
            wv: vec![6.0, 6.0],
            edof: vec![edof; 2],
            levels,
            ignored,
            differing: 0.04,
            ..Curve::default()
        }
    }

    #[test]
    fn weights_are_inverse_deviations_of_the_model() {
        let curve = curve(50.0);
        for (weighting, root) in [
            (Weighting::Model, 1.0 / (6.0 * (0.04_f64 + 0.04).sqrt())),
            (Weighting::Edof, 1.0 / (6.0 * 0.2)),
        ] {
            let roots = weighting.roots(&curve, &[6.0, 6.0]);
            assert_relative_eq!(roots[0], root, max_relative = 1e-9);
            assert_eq!(roots[1], 0.0, "{weighting:?}");
        }
    }

    /// The gradient of the weighted square, root²·(nu_hat − nu), is that of half the square of the logarithm over its variance,
    /// ln(nu_hat/nu)/(2/edof + b²), per relative change of nu.
    #[test]
    fn a_weighted_square_descends_as_the_square_of_the_logarithm() {
        let curve = curve(50.0);
        for ratio in [1e-4_f64, 0.5, 1.0 - 1e-9, 1.0, 2.0, 1e4] {
            let nu = 6.0 / ratio;
            let root = Weighting::Model.roots(&curve, &[nu, 3.0])[0];
            let expected = ratio.ln() / (2.0 / 50.0 + 0.04);
            // 6 − nu is known to 1e-15 of 6
            assert_relative_eq!(
                root * root * (6.0 - nu) * nu,
                expected,
                max_relative = 1e-6,
                epsilon = 1e-12
            );
        }
    }

    /// Of exact white noise, times 2 and a half in turn, the model is the geometric mean, and the variance that it lacks is that
    /// of the logarithms with as many degrees of freedom as there are scales, less one.
    #[test]
    fn lack_of_fit_is_the_variance_of_the_logarithms() {
        let levels: Vec<u32> = (1..=12).collect();
        let off = |level: &u32| 0.5_f64.powi(*level as i32) * [0.5, 2.0][*level as usize % 2];
        let curve = |off: &dyn Fn(&u32) -> f64| Curve {
            wv: levels.iter().map(off).collect(),
            edof: vec![1e9; 12],
            levels: levels.clone(),
            ..Curve::default()
        };
        let spec = "WN".parse().unwrap();
        let white = |fit: &Fit| fit.composite.processes[0].values()[0];
        let found = fit(&curve(&off), &spec, 1.0, Weighting::Model).unwrap();
        assert_relative_eq!(white(&found), 1.0, max_relative = 1e-6);
        let variance = 12.0 / 11.0 * 2.0_f64.ln().powi(2);
        assert_relative_eq!(found.lack_of_fit, variance, max_relative = 1e-6);
        // Off by what chance explains, it lacks nothing.
        let near =
            |level: &u32| off(level).powf(1e-5) * 0.5_f64.powf((1.0 - 1e-5) * f64::from(*level));
        let found = fit(&curve(&near), &spec, 1.0, Weighting::Model).unwrap();
        assert_eq!(found.lack_of_fit, 0.0);
    }
}
