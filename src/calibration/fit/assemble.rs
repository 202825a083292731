//! From the solution of a search to the fitted model.

use super::objective::{Component, Objective, Range};
use super::result::{Fit, FitError};
use super::search::Found;
use crate::noise::{Composite, Kind, ParameterError, Process};

/// The fit that a search has found, but for its weights.
pub(super) fn assemble(
    objective: &Objective,
    found: &Found,
    rate_hz: f64,
) -> Result<Fit, FitError> {
    let unit = objective.length * objective.length;
    let best = &found.ends[0];
    let solution = objective.solve(&best.coordinates);
    let mut terms = terms(objective, &best.coordinates, &solution.amplitudes);
    let by_time = |a: &Term, b: &Term| b.coordinate.total_cmp(&a.coordinate);
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
        minima: minima(found),
        weighted_for: Vec::new(),
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
                // 1e-6 of ln κ, or of theta: the bounded step puts a coordinate on its end but for rounding.
                (u, high > low && (u - low < 1e-6 || high - u < 1e-6))
            }
        };
        Term {
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

impl Term {
    fn process(&self, rate_hz: f64) -> Result<Process, ParameterError> {
        let kappa = self.coordinate.exp();
        let amplitude = if self.kind == Kind::Drift {
            self.amplitude.sqrt()
        } else {
            self.amplitude
        };
        let shape = match self.kind {
            Kind::Ar1 => (-kappa).exp(),
            Kind::GaussMarkov => kappa * rate_hz,
            _ => self.coordinate,
        };
        let values = if self.kind.shape().is_some() {
            vec![shape, amplitude]
        } else {
            vec![amplitude]
        };
        self.kind
            .process(&values, rate_hz)
            .expect("as many values as the kind has parameters")
    }
}
