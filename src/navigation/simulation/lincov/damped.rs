//! Descent by damped Gauss-Newton steps ([Levenberg-Marquardt](crate::bibliography::More78)) with forward differences,
//! of a cost that says what it is made of.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Step of the forward differences, for variables that are logarithms of factors.
const DIFFERENCE: f64 = 0.02;
/// Longest step of a variable.
const MAX_STEP: f64 = 1.5;
/// Damping of the first step: where the cost falls by a tenth for a factor e, it still moves by as much.
const DAMPING: f64 = 0.1;
/// Factors on the damping, after a step that does not gain what it should and after one that does.
const MORE: f64 = 5.0;
const LESS: f64 = 0.2;
/// How often a step is damped further.
const TRIALS: usize = 8;

/// A value of the cost.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Value {
    pub(super) cost: f64,
    pub(super) parts: Vec<Part>,
}

/// A number that the variables change, and the second derivative of the cost with respect to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    pub(super) value: f64,
    pub(super) curvature: f64,
}

/// What is minimised, and how far.
pub(super) struct Damped<'a> {
    pub(super) value: &'a (dyn Fn(&[f64]) -> Value + Sync),
    /// Smallest and largest value of every variable.
    pub(super) bounds: (f64, f64),
    pub(super) iterations: usize,
    /// A step that gains less is the last.
    pub(super) enough: f64,
}

impl Damped<'_> {
    /// The variables of a minimum near `start`; the same on any number of threads. None where the cost of the
    /// start is not finite.
    pub(super) fn minimum(&self, start: Vec<f64>) -> Option<Vec<f64>> {
        let mut x = DVector::from_vec(start);
        let mut value = (self.value)(x.as_slice());
        let mut damping = DAMPING;
        if !value.cost.is_finite() {
            return None;
        }
        for _ in 0..self.iterations {
            let Some(model) = self.quadratic(&x, &value) else {
                break;
            };
            let Some((next, next_value)) = self.descend(&x, &value, &model, &mut damping) else {
                break;
            };
            let gain = value.cost - next_value.cost;
            (x, value) = (next, next_value);
            if gain < self.enough {
                break;
            }
        }
        Some(x.as_slice().to_vec())
    }

    fn quadratic(&self, x: &DVector<f64>, here: &Value) -> Option<Quadratic> {
        let beside = |i: usize| {
            let mut beside = x.clone();
            beside[i] += DIFFERENCE;
            (self.value)(beside.as_slice())
        };
        // One-sided: half the evaluations of central differences, each of which is a pass along the whole
        // track.
        let beside: Vec<Value> = (0..x.len()).into_par_iter().map(beside).collect();
        if beside.iter().any(|value| !value.cost.is_finite()) {
            return None;
        }
        let slope = |i: usize, k: usize| {
            let (here, there) = (here.parts[i], beside[k].parts[i]);
            here.curvature.sqrt() * (there.value - here.value) / DIFFERENCE
        };
        let jacobian = DMatrix::from_fn(here.parts.len(), x.len(), slope);
        let hessian = jacobian.tr_mul(&jacobian);
        // A forward difference is the slope half a step further on: the Hessian, which is known, takes it back.
        let gradient = DVector::from_fn(x.len(), |i, _| {
            (beside[i].cost - here.cost) / DIFFERENCE - 0.5 * DIFFERENCE * hessian[(i, i)]
        });
        Some(Quadratic { gradient, hessian })
    }

    /// The step that gains, damped until it does; none where it has nothing to gain.
    fn descend(
        &self,
        x: &DVector<f64>,
        value: &Value,
        model: &Quadratic,
        damping: &mut f64,
    ) -> Option<(DVector<f64>, Value)> {
        for _ in 0..TRIALS {
            let (step, expected) = model.step(damping)?;
            if expected < self.enough {
                return None;
            }
            let next = (x + step).map(|x| x.clamp(self.bounds.0, self.bounds.1));
            let next_value = (self.value)(next.as_slice());
            let share = (value.cost - next_value.cost) / expected;
            if share > 0.6 {
                *damping *= LESS;
            }
            if share > 0.1 {
                return Some((next, next_value));
            }
            *damping *= MORE;
        }
        None
    }
}

/// What the cost is near a point: its gradient and Gauss and Newton's Hessian Σ c ∂f ∂fᵀ of its parts f.
struct Quadratic {
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
}

impl Quadratic {
    /// The step of this damping, or of the least above it that keeps the step short, and by how much the cost should fall.
    fn step(&self, damping: &mut f64) -> Option<(DVector<f64>, f64)> {
        loop {
            let n = self.gradient.len();
            let damped = &self.hessian + DMatrix::identity(n, n) * *damping;
            let step = -damped.cholesky()?.solve(&self.gradient);
            if step.amax() <= MAX_STEP {
                let expected =
                    -(self.gradient.dot(&step) + 0.5 * step.dot(&(&self.hessian * &step)));
                return Some((step, expected));
            }
            *damping *= MORE;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A curved valley, the sum of the squares of two parts, whose minimum is 0 at (1, 1): the steps follow it there, or to
    /// the bound x = 1.5, where the lowest point is y = 2.25.
    #[test]
    fn a_curved_valley_is_followed_to_its_end_or_to_a_bound() {
        let valley = |x: &[f64]| {
            let parts = [10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]];
            Value {
                cost: parts.iter().map(|f| f * f).sum(),
                parts: parts
                    .map(|value| Part {
                        value,
                        curvature: 2.0,
                    })
                    .into(),
            }
        };
        let damped = |bounds| Damped {
            value: &valley,
            bounds,
            iterations: 60,
            enough: 1e-9,
        };
        let found = damped((-3.0, 3.0)).minimum(vec![-1.0, 0.0]).unwrap();
        assert!(
            (found[0] - 1.0).abs() < 0.02 && (found[1] - 1.0).abs() < 0.04,
            "{found:?}"
        );
        let found = damped((1.5, 3.0)).minimum(vec![2.0, 2.0]).unwrap();
        assert!(
            (found[0] - 1.5).abs() < 1e-9 && (found[1] - 2.25).abs() < 0.02,
            "{found:?}"
        );
        let nan = |_: &[f64]| Value {
            cost: f64::NAN,
            parts: Vec::new(),
        };
        let nowhere = Damped {
            value: &nan,
            bounds: (0.0, 1.0),
            iterations: 1,
            enough: 0.0,
        };
        assert_eq!(nowhere.minimum(vec![0.5]), None);
    }
}
