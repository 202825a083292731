//! A model fitted to a curve: theta = argmin Σ Omega_j (nu_j − nu_j(theta))².

use super::implied::implied;
use super::limits::Limits;
use super::objective::{Component, Objective, Range, Weighting, whitening};
use super::optimise::Termination;
use super::sampling::SamplingLaw;
use super::search::{COMBINATIONS, Found, search};
use super::spec::{Kind, ModelSpec};
use crate::noise::{
    Ar1, Composite, Drift, GaussMarkov, Ma1, ParameterError, Process, Quantization, RandomWalk, White,
};
use crate::wavelet::Curve;
use nalgebra::DMatrix;
use std::cmp::Ordering;
use std::sync::Arc;

/// A fitted model. That the iterations did not converge is told, not an error.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The model: processes in the order of [`Kind::ALL`], alike ones by ascending correlation time (or in the
    /// order of their limits, if they have any).
    pub composite: Composite,
    /// Σ Omega_j (nu_j − nu_j(theta))² at theta.
    pub objective: f64,
    /// How the iterations of the best start ended.
    pub termination: Termination,
    /// Combinations of shapes (correlation times) that were tried, each with its best amplitudes.
    pub combinations: usize,
    /// Local minima among them, all descended from.
    pub starts: usize,
    /// Starts that end within 1e-6 of the best objective.
    pub agreeing: usize,
    /// The next best local minimum's objective, if there is one.
    pub runner_up: Option<f64>,
    /// Labels of the processes whose amplitude is zero: not identifiable from this curve.
    pub zero: Vec<String>,
    /// Labels of the processes whose shape lies at the end of its range: not identifiable either.
    pub at_end: Vec<String>,
    /// Parameters on a bound that was given (not fixed), such as `AR1_1 phi = 0.99`.
    pub bounded: Vec<String>,
    /// √Omega_j (nu_j − nu_j(theta)) of each scale; in standard deviations when weighted by edof. With the full
    /// covariance the scales are mixed so that these are uncorrelated.
    pub residuals: Vec<f64>,
    /// Coordinates of the minima found, best first: where the search of a similar curve begins.
    pub(super) minima: Vec<Vec<f64>>,
    /// The variances that the weights were made for.
    pub(super) weighted_for: Vec<f64>,
    /// What the scales were mixed with, with the full covariance.
    pub(super) mixing: Option<Arc<DMatrix<f64>>>,
}

/// Why a curve has no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Fewer scales than parameters.
    #[error("{spec} has {parameters} parameters, the curve {scales} scales")]
    TooFewScales {
        /// The model.
        spec: String,
        /// Its free parameters.
        parameters: usize,
        /// Scales of the curve.
        scales: usize,
    },
    /// A wavelet variance that is not positive has no logarithm, no weight, no meaning.
    #[error("the wavelet variance at scale 2^{level} is {value}: it must be a number from 1e-100 to 1e100")]
    NotPositive {
        /// Level.
        level: u32,
        /// The value.
        value: f64,
    },
    /// Degrees of freedom that weigh nothing.
    #[error(
        "the degrees of freedom at scale 2^{level} are {value}: they must be a number from 1e-15 to 1e15"
    )]
    NoWeight {
        /// Level.
        level: u32,
        /// The value.
        value: f64,
    },
    /// Nothing to be read off.
    #[error("{process} has no slope of its own in the Allan deviation: avlr cannot tell it")]
    NoSlope {
        /// Code of the process.
        process: &'static str,
    },
    /// A result outside its domain: the numbers of the curve are out of range.
    #[error("the fit left the domain of its parameters: {0}")]
    Domain(#[from] ParameterError),
}

/// Fits a model to a curve. The rate (Hz) is what a GM is sampled at.
///
/// AR1 and GM processes are sought with correlation times between a sixth of a sample (phi = e^−6) and twenty times the
/// longest scale; phi is positive. A fit that ends there is told ([`Fit::at_end`]); limits that are given reach further.
///
/// # Errors
/// When the curve has fewer scales than the model parameters, or numbers that are no wavelet variances.
pub fn fit(curve: &Curve, spec: &ModelSpec, rate_hz: f64, weighting: Weighting) -> Result<Fit, FitError> {
    let observed = Weights { weighting, nu: curve.wv.clone(), mixing: None };
    let first = fit_near(curve, spec, rate_hz, observed, COMBINATIONS, &[])?;
    match weighting {
        Weighting::Model => reweighted(curve, spec, rate_hz, first, MOST_ROUNDS, COMBINATIONS),
        Weighting::Full => {
            fit_with_covariance(curve, spec, rate_hz, &covariance(curve, &first), expected(curve, &first))
        }
        Weighting::Edof | Weighting::Interval | Weighting::None => Ok(first),
    }
}

/// Fits again at most, until the weights are those of the model itself.
const MOST_ROUNDS: usize = 20;
/// The same of a curve that resembles one already fitted, whose model is where the weights begin.
const FEW_ROUNDS: usize = 3;
/// Changes of the implied curve, relative, that are not worth another fit.
const SETTLED: f64 = 1e-6;

/// The curve that a fit implies, where it may be divided by.
pub(super) fn expected(curve: &Curve, fit: &Fit) -> Vec<f64> {
    // A model without any amplitude implies nothing.
    implied(&fit.composite, curve).iter().zip(&curve.wv).map(|(nu, wv)| nu.max(1e-6 * wv)).collect()
}

/// Fits with the weights of the last result.
fn reweighted(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    first: Fit,
    rounds: usize,
    combinations: usize,
) -> Result<Fit, FitError> {
    let mut last = first;
    for _ in 0..rounds {
        let nu = expected(curve, &last);
        let change = nu.iter().zip(&last.weighted_for).map(|(a, b)| (a / b - 1.0).abs());
        if change.fold(0.0, f64::max) < SETTLED {
            break;
        }
        let weights = Weights { weighting: Weighting::Model, nu, mixing: None };
        last = fit_near(curve, spec, rate_hz, weights, combinations, &last.minima)?;
    }
    Ok(last)
}

/// Relative covariance of a curve of independent degrees of freedom, by the large-sample law of a model
/// ([`SamplingLaw`]).
fn covariance(curve: &Curve, fit: &Fit) -> DMatrix<f64> {
    let levels = curve.levels.iter().copied().max().unwrap_or(1) as usize;
    let law = SamplingLaw::new(&fit.composite, levels);
    let at = |i: usize| curve.levels[i] as usize - 1;
    let deviation = |i: usize| (2.0 / curve.edof[i]).sqrt();
    let n = curve.levels.len();
    DMatrix::from_fn(n, n, |i, j| law.correlation[(at(i), at(j))] * deviation(i) * deviation(j))
}

/// The fit weighted by the inverse of a covariance of the curve relative to `nu`.
///
/// # Errors
/// As [`fit`].
pub(super) fn fit_with_covariance(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    covariance: &DMatrix<f64>,
    nu: Vec<f64>,
) -> Result<Fit, FitError> {
    let mixing = Some(Arc::new(whitening(covariance)));
    fit_near(curve, spec, rate_hz, Weights { weighting: Weighting::Full, nu, mixing }, COMBINATIONS, &[])
}

/// Combinations tried for a curve that resembles one already fitted.
const FEW: usize = 300;

/// The same for a curve that resembles one already fitted: a coarser grid, and the minima of that one.
pub(super) fn refit(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
    like: &Fit,
) -> Result<Fit, FitError> {
    let nu = match weighting {
        Weighting::Model | Weighting::Full => expected(curve, like),
        Weighting::Edof | Weighting::Interval | Weighting::None => curve.wv.clone(),
    };
    let weights = Weights { weighting, nu, mixing: like.mixing.clone() };
    let first = fit_near(curve, spec, rate_hz, weights, FEW, &like.minima)?;
    match weighting {
        Weighting::Model => reweighted(curve, spec, rate_hz, first, FEW_ROUNDS, NO_GRID),
        _ => Ok(first),
    }
}

/// Descents from the known minima only.
const NO_GRID: usize = 0;

/// What the scales of a curve count.
struct Weights {
    weighting: Weighting,
    /// The variances it is made for.
    nu: Vec<f64>,
    mixing: Option<Arc<DMatrix<f64>>>,
}

fn fit_near(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weights: Weights,
    combinations: usize,
    known: &[Vec<f64>],
) -> Result<Fit, FitError> {
    check(curve, spec)?;
    let limited = spec.kinds().iter().zip(spec.limits());
    let components = limited.map(|(kind, limits)| component(*kind, *limits, curve, rate_hz)).collect();
    let Weights { weighting, nu, mixing } = weights;
    let objective = Objective::new(curve, weighting, &nu, mixing.clone(), components);
    let found = search(&objective, combinations, known);
    Ok(Fit { mixing, weighted_for: nu, ..assemble(&objective, &found, spec, rate_hz)? })
}

fn check(curve: &Curve, spec: &ModelSpec) -> Result<(), FitError> {
    let bad =
        |values: &[f64], (low, high): (f64, f64)| values.iter().position(|v| !(*v >= low && *v <= high));
    if let Some(i) = bad(&curve.wv, Curve::WV_RANGE) {
        return Err(FitError::NotPositive { level: curve.levels[i], value: curve.wv[i] });
    }
    if let Some(i) = bad(&curve.edof, Curve::EDOF_RANGE) {
        return Err(FitError::NoWeight { level: curve.levels[i], value: curve.edof[i] });
    }
    let (parameters, scales) = (spec.parameters(), curve.levels.len() - curve.ignored.len());
    if scales < parameters {
        return Err(FitError::TooFewScales { spec: spec.to_string(), parameters, scales });
    }
    Ok(())
}

/// Correlation times that are sought, in longest scales and in samples: beyond these ends the wavelet variance of an AR1
/// is that of a random walk to 2 % (at the longest scale), and of white noise to 0.8 % (the first scale against the others).
const LONGEST: f64 = 20.0;
const SHORTEST: f64 = 1.0 / 6.0;

/// ln κ of the correlation times that are sought, 1/κ in samples.
pub(super) fn correlated(curve: &Curve) -> Range {
    let longest = f64::from(curve.levels.iter().copied().max().unwrap_or(1)).exp2();
    Range { low: -(LONGEST * longest).ln(), high: -SHORTEST.ln() }
}

/// The widest ranges in which a curve can say anything, less what the limits leave out.
fn component(kind: Kind, limits: Limits, curve: &Curve, rate_hz: f64) -> Component {
    let correlated = correlated(curve);
    // Coordinates of the limits: ln κ, which falls as phi rises.
    let coordinate = match (kind, limits.shape) {
        (Kind::Ar1, Some((low, high))) => {
            let kappa = |phi: f64| (-phi.ln()).ln();
            Some(within(correlated, (low > 0.0).then(|| kappa(low)), (high < 1.0).then(|| kappa(high))))
        }
        (Kind::GaussMarkov, Some((low, high))) => {
            let kappa = |beta: f64| (beta / rate_hz).ln();
            Some(within(correlated, high.is_finite().then(|| kappa(high)), (low > 0.0).then(|| kappa(low))))
        }
        (Kind::Ar1 | Kind::GaussMarkov, None) => Some(correlated),
        (Kind::Ma1, shape) => {
            let (low, high) = shape.unwrap_or((-1.0, 1.0));
            Some(Range { low: low.max(-1.0), high: high.min(1.0) })
        }
        _ => None,
    };
    let (low, high) = limits.amplitude;
    let amplitude = match kind {
        Kind::Drift => Range { low: low * low, high: high * high },
        _ => Range { low, high },
    };
    Component { kind, amplitude, coordinate }
}

/// A range with its ends replaced where they are limited; what is given counts, even beyond the range.
fn within(range: Range, high: Option<f64>, low: Option<f64>) -> Range {
    let high = high.unwrap_or(range.high);
    let low = low.unwrap_or_else(|| range.low.min(high));
    Range { low, high: high.max(low) }
}

fn assemble(objective: &Objective, found: &Found, spec: &ModelSpec, rate_hz: f64) -> Result<Fit, FitError> {
    let unit = objective.length * objective.length;
    let best = &found.best;
    let solution = objective.solve(&best.coordinates);
    let mut terms = terms(objective, &best.coordinates, &solution.amplitudes);
    for (term, limits) in terms.iter_mut().zip(spec.limits()) {
        term.at_end &= limits.shape.is_none();
        term.limits = *limits;
    }
    let limited = |kind: Kind| {
        spec.kinds().iter().zip(spec.limits()).any(|(k, limits)| *k == kind && *limits != Limits::NONE)
    };
    let by_time = |a: &Term, b: &Term| match limited(a.kind) {
        true => Ordering::Equal,
        false => b.coordinate.total_cmp(&a.coordinate),
    };
    terms.sort_by(|a, b| a.kind.cmp(&b.kind).then_with(|| by_time(a, b)));
    let processes = terms.iter().map(|t| t.process(rate_hz)).collect::<Result<_, _>>()?;
    let composite = Composite::new(processes);
    let labels = composite.labels();
    let labelled = |test: fn(&Term) -> bool| {
        terms.iter().zip(&labels).filter(|(t, _)| test(t)).map(|(_, label)| label.clone()).collect()
    };
    let agreeing = |cost: f64| cost <= best.cost * (1.0 + 1e-6) + f64::EPSILON * f64::EPSILON;
    Ok(Fit {
        objective: best.cost * unit,
        termination: best.termination,
        combinations: found.combinations,
        starts: found.ends.len(),
        agreeing: found.ends.iter().filter(|e| agreeing(e.cost)).count(),
        runner_up: found.ends.iter().find(|e| !agreeing(e.cost)).map(|e| e.cost * unit),
        zero: labelled(|t| t.amplitude <= 0.0),
        at_end: labelled(|t| t.amplitude > 0.0 && t.at_end),
        bounded: terms.iter().zip(&labels).flat_map(|(t, label)| t.bounded(label, rate_hz)).collect(),
        minima: minima(found),
        weighted_for: Vec::new(),
        mixing: None,
        residuals: solution.residuals.iter().map(|r| r * objective.length).collect(),
        composite,
    })
}

/// Minima that are kept.
const KEPT: usize = 4;

/// The ends that differ, best first.
fn minima(found: &Found) -> Vec<Vec<f64>> {
    let mut minima: Vec<Vec<f64>> = Vec::new();
    for end in &found.ends {
        let same = |m: &Vec<f64>| m.iter().zip(&end.coordinates).all(|(a, b)| (a - b).abs() < 1e-3);
        if minima.len() < KEPT && !minima.iter().any(same) {
            minima.push(end.coordinates.clone());
        }
    }
    minima
}

/// A value, or the bound that it is but for rounding.
fn at_bound(value: f64, (low, high): (f64, f64), scale: f64) -> f64 {
    let near = |bound: &f64| (value - bound).abs() <= 1e-9 * scale;
    [low, high].into_iter().find(near).unwrap_or(value)
}

/// One process of the result.
struct Term {
    kind: Kind,
    amplitude: f64,
    coordinate: f64,
    at_end: bool,
    limits: Limits,
}

fn terms(objective: &Objective, coordinates: &[f64], amplitudes: &[f64]) -> Vec<Term> {
    let mut next = coordinates.iter();
    let term = |(component, amplitude): (&Component, &f64)| {
        let (coordinate, at_end) = match component.coordinate {
            None => (0.0, false),
            Some(Range { low, high }) => {
                let u = next.next().copied().unwrap_or(low);
                (u, high > low && (u - low < 1e-6 || high - u < 1e-6))
            }
        };
        Term { kind: component.kind, amplitude: *amplitude, coordinate, at_end, limits: Limits::NONE }
    };
    objective.components.iter().zip(amplitudes).map(term).collect()
}

impl Term {
    fn process(&self, rate_hz: f64) -> Result<Process, ParameterError> {
        let (amplitude, shape) = self.values(rate_hz);
        Ok(match self.kind {
            Kind::White => Process::White(White::new(amplitude)?),
            Kind::Quantization => Process::Quantization(Quantization::new(amplitude)?),
            Kind::Ar1 => Process::Ar1(Ar1::new(shape, amplitude)?),
            Kind::GaussMarkov => Process::GaussMarkov(GaussMarkov::new(shape, amplitude, rate_hz)?),
            Kind::Ma1 => Process::Ma1(Ma1::new(shape, amplitude)?),
            Kind::RandomWalk => Process::RandomWalk(RandomWalk::new(amplitude)?),
            Kind::Drift => Process::Drift(Drift::new(amplitude)?),
        })
    }

    /// Amplitude and shape in the units of the parameters; on a bound, the bound as it was given.
    fn values(&self, rate_hz: f64) -> (f64, f64) {
        let kappa = self.coordinate.exp();
        let amplitude = if self.kind == Kind::Drift { self.amplitude.sqrt() } else { self.amplitude };
        let (shape, scale) = match self.kind {
            Kind::Ar1 => ((-kappa).exp(), kappa.min(1.0)),
            Kind::GaussMarkov => (kappa * rate_hz, kappa * rate_hz),
            _ => (self.coordinate, 1.0),
        };
        let limits = self.limits.shape.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        (at_bound(amplitude, self.limits.amplitude, amplitude), at_bound(shape, limits, scale))
    }

    /// The parameters that lie on a bound given, in words; those that are fixed have nowhere else to be.
    fn bounded(&self, label: &str, rate_hz: f64) -> Vec<String> {
        let (amplitude, shape) = self.values(rate_hz);
        let on = |value: f64, (low, high): (f64, f64)| {
            low < high
                && value.abs() > 0.0
                && (value.to_bits() == low.to_bits() || value.to_bits() == high.to_bits())
        };
        let mut bounded = Vec::new();
        if on(amplitude, self.limits.amplitude) {
            bounded.push(format!("{label} {} = {amplitude}", self.kind.amplitude_name()));
        }
        // What is not there has its shape anywhere.
        if let (Some(name), Some(limits)) = (self.kind.shape_name(), self.limits.shape)
            && amplitude > 0.0
            && on(shape, limits)
        {
            bounded.push(format!("{label} {name} = {shape}"));
        }
        bounded
    }
}
