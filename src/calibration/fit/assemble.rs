//! From the solution of a search to the fitted model.

use super::objective::{Component, Objective, Range};
use super::result::{Fit, FitError};
use super::search::Found;
use crate::model::{Limits, ModelSpec};
use crate::noise::{Composite, Kind, ParameterError, ParameterRef, Process};
use std::cmp::Ordering;

/// The fit that a search has found, but for its weights.
pub(super) fn assemble(
    objective: &Objective,
    found: &Found,
    spec: &ModelSpec,
    rate_hz: f64,
) -> Result<Fit, FitError> {
    let unit = objective.length * objective.length;
    let best = &found.ends[0];
    let solution = objective.solve(&best.coordinates);
    let mut terms = terms(objective, &best.coordinates, &solution.amplitudes);
    for (term, limits) in terms.iter_mut().zip(spec.limits()) {
        term.at_end &= limits.shape.is_none();
        term.limits = *limits;
    }
    let limited = |kind: Kind| {
        spec.kinds()
            .iter()
            .zip(spec.limits())
            .any(|(k, limits)| *k == kind && *limits != Limits::NONE)
    };
    let by_time = |a: &Term, b: &Term| match limited(a.kind) {
        true => Ordering::Equal,
        false => b.coordinate.total_cmp(&a.coordinate),
    };
    terms.sort_by(|a, b| a.kind.cmp(&b.kind).then_with(|| by_time(a, b)));
    let processes = terms
        .iter()
        .map(|t| t.process(rate_hz))
        .collect::<Result<_, _>>()?;
    let composite = Composite::new(processes);
    let those = |test: fn(&Term) -> bool| (0..terms.len()).filter(|i| test(&terms[*i])).collect();
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
        bounded: terms
            .iter()
            .enumerate()
            .flat_map(|(process, t)| t.bounded(process, rate_hz))
            .collect(),
        minima: minima(found),
        weighted_for: Vec::new(),
        mixing: None,
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
fn minima(found: &Found) -> Vec<Vec<f64>> {
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
                // 1e-6 of ln κ, or of theta: the bounded step puts a coordinate on its end but for rounding.
                (u, high > low && (u - low < 1e-6 || high - u < 1e-6))
            }
        };
        Term {
            kind: component.kind,
            amplitude: *amplitude,
            coordinate,
            at_end,
            limits: Limits::NONE,
        }
    };
    objective
        .components
        .iter()
        .zip(amplitudes)
        .map(term)
        .collect()
}

impl Term {
    fn process(&self, rate_hz: f64) -> Result<Process, ParameterError> {
        let (amplitude, shape) = self.values(rate_hz);
        let values = if self.kind.shape().is_some() {
            vec![shape, amplitude]
        } else {
            vec![amplitude]
        };
        self.kind
            .process(&values, rate_hz)
            .expect("as many values as the kind has parameters")
    }

    /// Amplitude and shape in the units of the parameters; on a bound, the bound as it was given.
    fn values(&self, rate_hz: f64) -> (f64, f64) {
        let kappa = self.coordinate.exp();
        let amplitude = if self.kind == Kind::Drift {
            self.amplitude.sqrt()
        } else {
            self.amplitude
        };
        let (shape, scale) = match self.kind {
            // Near phi = 1 what counts is 1 − phi ≈ κ: a bound of 0.99999 is met to 1e-9 of that, not of 1.
            Kind::Ar1 => ((-kappa).exp(), kappa.min(1.0)),
            Kind::GaussMarkov => (kappa * rate_hz, kappa * rate_hz),
            _ => (self.coordinate, 1.0),
        };
        let limits = self
            .limits
            .shape
            .unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        (
            at_bound(amplitude, self.limits.amplitude, amplitude),
            at_bound(shape, limits, scale),
        )
    }

    /// The parameters that lie on a bound given; those that are fixed have nowhere else to be.
    fn bounded(&self, process: usize, rate_hz: f64) -> Vec<ParameterRef> {
        let (amplitude, shape) = self.values(rate_hz);
        let is_at_end = |value: f64, (low, high): (f64, f64)| {
            low < high
                && value.abs() > 0.0
                && (value.to_bits() == low.to_bits() || value.to_bits() == high.to_bits())
        };
        let mut bounded = Vec::new();
        if is_at_end(amplitude, self.limits.amplitude) {
            bounded.push(ParameterRef {
                process,
                parameter: self.kind.amplitude(),
            });
        }
        // What is not there has its shape anywhere.
        if let (Some(parameter), Some(limits)) = (self.kind.shape(), self.limits.shape)
            && amplitude > 0.0
            && is_at_end(shape, limits)
        {
            bounded.push(ParameterRef { process, parameter });
        }
        bounded
    }
}
