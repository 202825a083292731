//! Influence of a curve on its fit: the derivatives of the parameters with respect to the wavelet variances.
//!
//! A fit solves g(theta, nu) = Jᵀ(theta) Omega (nu − nu(theta)) = 0, J the derivatives of the model's wavelet variance and
//! Omega the weights, which depend on theta or on nu as [`Weighting`] says. By the implicit function theorem d theta /
//! d nu = −(∂g/∂theta)⁻¹ ∂g/∂nu, the influence function of an M-estimator
//! ([Guerrier](crate::bibliography::Guerrier13)), with the part of the residuals that the Gauss-Newton approximation
//! leaves out. A parameter that stands at a bound, or whose process has no amplitude, stays where it is.

use crate::curve::Estimator;
use crate::curve::implied::{implied, implied_gradients};
use crate::fit::Weighting;
use crate::noise::{Composite, Parameter, ParameterRef};
use crate::outcome::{Outcome, Settings};
use crate::wavelet::Curve;
use nalgebra::{DMatrix, DVector};

/// The parameters of a fit that follow the curve.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveInfluence {
    /// The parameters.
    pub parameters: Vec<ParameterRef>,
    /// A natural step of each, in its units: 1 − |phi| of a coefficient, the parameter itself of any other.
    pub units: Vec<f64>,
    /// d theta_m / d ln nu_j over that step, parameter by parameter (rows), scale by scale.
    pub passed_on: DMatrix<f64>,
}

/// Step of the differences, relative: the error of a central difference is its square.
const STEP: f64 = 1e-4;

impl CurveInfluence {
    /// Influence on a least-squares fit; none for slopes (AVLR), for weights by the full covariance, which is
    /// drawn, and for a fit without a parameter that moves.
    #[must_use]
    pub fn of(outcome: &Outcome, settings: &Settings) -> Option<Self> {
        let fit = &outcome.fit;
        if outcome.estimator == Estimator::Avlr || fit.mixing.is_some() {
            return None;
        }
        let all = fit.composite.parameters().enumerate();
        let moving: Vec<(usize, (ParameterRef, f64))> =
            all.filter(|(_, (of, _))| outcome.moves(*of)).collect();
        if moving.is_empty() {
            return None;
        }
        let unit = |(_, (of, value)): &(usize, (ParameterRef, f64))| match of.parameter {
            // A step relative to phi itself would leave the stationary range where 1 − phi is below it.
            Parameter::Phi | Parameter::Theta => 1.0 - value.abs(),
            _ => *value,
        };
        let units: Vec<f64> = moving.iter().map(unit).collect();
        let columns = moving.iter().map(|(i, _)| *i).collect();
        let equation = Equation {
            columns,
            units: units.clone(),
            weighting: settings.weighting,
        };
        let curve = &outcome.curve;
        let parameters: Vec<ParameterRef> = moving.iter().map(|(_, (of, _))| *of).collect();
        let steps = Self {
            parameters,
            units,
            passed_on: DMatrix::zeros(0, 0),
        };
        let Self { parameters, .. } = &steps;
        let moved = |m: usize, by: f64| steps.moved(&fit.composite, m, by, settings.rate_hz);
        let mut by_parameter = DMatrix::zeros(parameters.len(), parameters.len());
        for m in 0..parameters.len() {
            let (up, down) = (moved(m, STEP)?, moved(m, -STEP)?);
            let slope = (equation.value(&up, curve) - equation.value(&down, curve)) / (2.0 * STEP);
            by_parameter.set_column(m, &slope);
        }
        let mut by_curve = DMatrix::zeros(parameters.len(), curve.wv.len());
        for j in 0..curve.wv.len() {
            let scaled = |by: f64| {
                let mut moved = curve.clone();
                // A relative step, so that the derivative is with respect to ln nu_j.
                moved.wv[j] *= 1.0 + by;
                equation.value(&fit.composite, &moved)
            };
            by_curve.set_column(j, &((scaled(STEP) - scaled(-STEP)) / (2.0 * STEP)));
        }
        // Implicit function theorem: (∂g/∂theta) dtheta = −(∂g/∂nu) dnu.
        let passed_on = by_parameter.lu().solve(&-by_curve)?;
        Some(Self { passed_on, ..steps })
    }

    /// A composite whose `m`-th moving parameter is moved by so many of its natural steps; none outside its domain.
    #[must_use]
    pub fn moved(
        &self,
        composite: &Composite,
        m: usize,
        by: f64,
        rate_hz: f64,
    ) -> Option<Composite> {
        let of = self.parameters[m];
        let (_, value) = composite.parameters().find(|(other, _)| *other == of)?;
        let mut changed = composite.clone();
        let process = &mut changed.processes[of.process];
        *process = process
            .with_parameter(of.parameter.name(), value + by * self.units[m], rate_hz)?
            .ok()?;
        Some(changed)
    }
}

/// The estimating equation g(theta, nu) = 0 of a fit.
struct Equation {
    /// The parameters that move, among all of the model.
    columns: Vec<usize>,
    units: Vec<f64>,
    weighting: Weighting,
}

impl Equation {
    fn value(&self, model: &Composite, curve: &Curve) -> DVector<f64> {
        let (nu, gradients) = (implied(model, curve), implied_gradients(model, curve));
        // the weights of a fit that has settled are those of its own curve
        let weighted_for = if self.weighting == Weighting::Model {
            &nu
        } else {
            &curve.wv
        };
        let roots = self.weighting.roots(curve, weighted_for);
        let residual = |j: usize| roots[j] * roots[j] * (curve.wv[j] - nu[j]);
        let of_parameter = |m: usize| {
            let column = self.columns[m];
            (0..nu.len())
                .map(|j| self.units[m] * gradients[j][column] * residual(j))
                .sum()
        };
        DVector::from_iterator(
            self.columns.len(),
            (0..self.columns.len()).map(of_parameter),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ModelChoice;
    use crate::curve::{Group, Scope};
    use crate::imu::Sensor;
    use crate::noise::{Ar1, Process, RandomWalk, White};
    use crate::pipeline::fit_curve;

    /// The fit of a curve that no model describes exactly, and of the same with one scale 0.1 % up and down.
    #[test]
    fn derivatives_are_those_of_fits_to_changed_curves() {
        let model = Composite::new(vec![
            Process::White(White::new(1.0).unwrap()),
            Process::Ar1(Ar1::new(0.98, 1e-3).unwrap()),
            Process::RandomWalk(RandomWalk::new(1e-5).unwrap()),
        ]);
        let levels: Vec<u32> = (1..=14).collect();
        let wobble = |level: u32| 1.0 + 0.02 * (f64::from(level * level % 7) - 3.0);
        let curve = Curve {
            wv: levels
                .iter()
                .map(|l| model.haar_wv(*l) * wobble(*l))
                .collect(),
            edof: levels.iter().map(|l| f64::from(1 << (15 - l))).collect(),
            levels,
            ..Curve::default()
        };
        let group = Group {
            scope: Scope {
                sensor: Sensor::Gyro,
                axis: None,
            },
            replicates: Vec::new(),
        };
        // a Gauss-Markov process is an AR1 whose shape is an inverse time
        for (weighting, spec) in [
            (Weighting::Model, "N1"),
            (Weighting::Edof, "N1"),
            (Weighting::Model, "WN+GM+RW"),
        ] {
            let model = ModelChoice::Given(spec.parse().unwrap());
            let settings = Settings {
                model,
                weighting,
                ..Settings::default()
            };
            let fitted =
                |curve: Curve| fit_curve(&group, Estimator::Awv, curve, &settings).unwrap();
            let outcome = fitted(curve.clone());
            let influence = CurveInfluence::of(&outcome, &settings).unwrap();
            assert_eq!(influence.parameters.len(), 4);
            for j in 0..curve.wv.len() {
                let refitted = |by: f64| {
                    let mut moved = curve.clone();
                    moved.wv[j] *= 1.0 + by;
                    fitted(moved)
                        .fit
                        .composite
                        .parameters()
                        .map(|(_, v)| v)
                        .collect::<Vec<f64>>()
                };
                let (up, down) = (refitted(1e-3), refitted(-1e-3));
                for m in 0..4 {
                    let brute = (up[m] - down[m]) / 2e-3 / influence.units[m];
                    let exact = influence.passed_on[(m, j)];
                    // fits end within 1e-7 of the parameters that are sought
                    assert!(
                        (brute - exact).abs() < 2e-3 * exact.abs() + 1e-3,
                        "{weighting} {j} {m}: {brute} {exact}"
                    );
                }
            }
        }
    }
}
