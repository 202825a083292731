//! A model fitted to a curve: theta = argmin Σ Omega_j (nu_j − nu_j(theta))².

use super::objective::{Component, Objective, Range, Weighting};
use super::optimise::Termination;
use super::search::{COMBINATIONS, Found, search};
use super::spec::{Kind, ModelSpec};
use crate::noise::{
    Ar1, Composite, Drift, GaussMarkov, Ma1, ParameterError, Process, Quantization, RandomWalk, White,
};
use crate::wavelet::Curve;

/// A fitted model. That the iterations did not converge is told, not an error.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The model: processes in the order of [`Kind::ALL`], alike ones by ascending correlation time.
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
    /// √Omega_j (nu_j − nu_j(theta)) of each scale; in standard deviations when weighted by edof.
    pub residuals: Vec<f64>,
    /// Coordinates of the minima found, best first: where the search of a similar curve begins.
    pub(super) minima: Vec<Vec<f64>>,
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
    #[error("the wavelet variance at scale 2^{level} is {value}: it must be a finite number > 0")]
    NotPositive {
        /// Level.
        level: u32,
        /// The value.
        value: f64,
    },
    /// Degrees of freedom that weigh nothing.
    #[error("the degrees of freedom at scale 2^{level} are {value}: they must be a finite number > 0")]
    NoWeight {
        /// Level.
        level: u32,
        /// The value.
        value: f64,
    },
    /// A result outside its domain: the numbers of the curve are out of range.
    #[error("the fit left the domain of its parameters: {0}")]
    Domain(#[from] ParameterError),
}

/// Fits a model to a curve. The rate (Hz) is what a GM is sampled at.
///
/// AR1 and GM processes are sought with correlation times between a sixth of a sample and twenty times the
/// longest scale; phi is positive.
///
/// # Errors
/// When the curve has fewer scales than the model parameters, or numbers that are no wavelet variances.
pub fn fit(curve: &Curve, spec: &ModelSpec, rate_hz: f64, weighting: Weighting) -> Result<Fit, FitError> {
    fit_near(curve, spec, rate_hz, weighting, COMBINATIONS, &[])
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
    fit_near(curve, spec, rate_hz, weighting, FEW, &like.minima)
}

fn fit_near(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
    combinations: usize,
    known: &[Vec<f64>],
) -> Result<Fit, FitError> {
    check(curve, spec)?;
    let components = spec.kinds().iter().map(|kind| component(*kind, curve)).collect();
    let objective = Objective::new(curve, weighting, components);
    let found = search(&objective, combinations, known);
    assemble(&objective, &found, rate_hz)
}

fn check(curve: &Curve, spec: &ModelSpec) -> Result<(), FitError> {
    let bad = |values: &[f64]| values.iter().position(|v| !(v.is_finite() && *v > 0.0));
    if let Some(i) = bad(&curve.wv) {
        return Err(FitError::NotPositive { level: curve.levels[i], value: curve.wv[i] });
    }
    if let Some(i) = bad(&curve.edof) {
        return Err(FitError::NoWeight { level: curve.levels[i], value: curve.edof[i] });
    }
    let (parameters, scales) = (spec.parameters(), curve.levels.len());
    if scales < parameters {
        return Err(FitError::TooFewScales { spec: spec.to_string(), parameters, scales });
    }
    Ok(())
}

/// The widest ranges in which a curve can say anything.
fn component(kind: Kind, curve: &Curve) -> Component {
    let longest = f64::from(curve.levels.iter().copied().max().unwrap_or(1)).exp2();
    let coordinate = match kind {
        Kind::Ar1 | Kind::GaussMarkov => Some(Range { low: -(20.0 * longest).ln(), high: 6.0_f64.ln() }),
        Kind::Ma1 => Some(Range { low: -1.0, high: 1.0 }),
        _ => None,
    };
    Component { kind, amplitude: Range { low: 0.0, high: f64::INFINITY }, coordinate }
}

fn assemble(objective: &Objective, found: &Found, rate_hz: f64) -> Result<Fit, FitError> {
    let unit = objective.length * objective.length;
    let best = &found.best;
    let solution = objective.solve(&best.coordinates);
    let mut terms = terms(objective, &best.coordinates, &solution.amplitudes);
    terms.sort_by(|a, b| a.kind.cmp(&b.kind).then(b.coordinate.total_cmp(&a.coordinate)));
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
        minima: minima(found),
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

/// One process of the result.
struct Term {
    kind: Kind,
    amplitude: f64,
    coordinate: f64,
    at_end: bool,
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
        Term { kind: component.kind, amplitude: *amplitude, coordinate, at_end }
    };
    objective.components.iter().zip(amplitudes).map(term).collect()
}

impl Term {
    fn process(&self, rate_hz: f64) -> Result<Process, ParameterError> {
        let (amplitude, kappa) = (self.amplitude, self.coordinate.exp());
        Ok(match self.kind {
            Kind::White => Process::White(White::new(amplitude)?),
            Kind::Quantization => Process::Quantization(Quantization::new(amplitude)?),
            Kind::Ar1 => Process::Ar1(Ar1::new((-kappa).exp(), amplitude)?),
            Kind::GaussMarkov => Process::GaussMarkov(GaussMarkov::new(kappa * rate_hz, amplitude, rate_hz)?),
            Kind::Ma1 => Process::Ma1(Ma1::new(self.coordinate, amplitude)?),
            Kind::RandomWalk => Process::RandomWalk(RandomWalk::new(amplitude)?),
            Kind::Drift => Process::Drift(Drift::new(amplitude.sqrt())?),
        })
    }
}
