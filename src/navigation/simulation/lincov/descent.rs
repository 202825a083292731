//! Descent of a smooth function of a few variables within bounds: quasi-Newton (BFGS) with forward differences.

use rayon::prelude::*;

/// Step of the forward differences. Their optimum lies half of it off, which is far below what matters where the
/// variables are logarithms of factors.
const DIFFERENCE: f64 = 0.02;
/// Longest step of a variable.
const MAX_STEP: f64 = 1.0;
/// How often a step is shortened, and to what share.
const TRIALS: usize = 6;
const SHORTER: f64 = 0.4;

type Square = Vec<Vec<f64>>;

/// What is minimised, and how far.
pub(super) struct Descent<'a> {
    pub(super) cost: &'a (dyn Fn(&[f64]) -> f64 + Sync),
    /// Smallest and largest value of every variable.
    pub(super) bounds: (f64, f64),
    pub(super) iterations: usize,
    /// A step that gains less is the last.
    pub(super) enough: f64,
}

impl Descent<'_> {
    /// The variables of a minimum near `start`; the same on any number of threads. None where the cost of the
    /// start is not finite.
    pub(super) fn minimum(&self, start: Vec<f64>) -> Option<Vec<f64>> {
        let mut x = start;
        let mut cost = (self.cost)(&x);
        if !cost.is_finite() {
            return None;
        }
        let mut gradient = self.gradient(&x, cost);
        let mut inverse = diagonal(x.len(), 2.0);
        for _ in 0..self.iterations {
            let step = self.direction(&x, &gradient, &inverse);
            let Some((next, next_cost)) = self.descend(&x, cost, &step, dot(&gradient, &step))
            else {
                break;
            };
            let next_gradient = self.gradient(&next, next_cost);
            update(
                &mut inverse,
                &difference(&next, &x),
                &difference(&next_gradient, &gradient),
            );
            let gain = cost - next_cost;
            (x, cost, gradient) = (next, next_cost, next_gradient);
            if gain < self.enough {
                break;
            }
        }
        Some(x)
    }

    fn gradient(&self, x: &[f64], cost: f64) -> Vec<f64> {
        let slope = |i: usize| {
            let mut beside = x.to_vec();
            beside[i] += DIFFERENCE;
            ((self.cost)(&beside) - cost) / DIFFERENCE
        };
        // One-sided: half the evaluations of central differences, each of which is a pass along the whole
        // track.
        (0..x.len()).into_par_iter().map(slope).collect()
    }

    /// The quasi-Newton step among the variables that no bound holds.
    fn direction(&self, x: &[f64], gradient: &[f64], inverse: &Square) -> Vec<f64> {
        let (low, high) = self.bounds;
        // At a bound with the descent pointing outwards: such a variable would only shorten the step of the
        // others.
        let held: Vec<bool> = x
            .iter()
            .zip(gradient)
            .map(|(x, g)| (*x <= low && *g > 0.0) || (*x >= high && *g < 0.0))
            .collect();
        let free = |v: &[f64]| -> Vec<f64> {
            v.iter()
                .zip(&held)
                .map(|(v, held)| if *held { 0.0 } else { *v })
                .collect()
        };
        let g = free(gradient);
        let downhill: Vec<f64> = inverse.iter().map(|row| -dot(row, &g)).collect();
        let mut step = free(&downhill);
        let largest = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        if largest > MAX_STEP {
            // All shortened alike, which keeps the direction: no factor changes by more than e in one step.
            step.iter_mut().for_each(|s| *s *= MAX_STEP / largest);
        }
        step
    }

    /// Shortens the step until it gains.
    fn descend(&self, x: &[f64], cost: f64, step: &[f64], slope: f64) -> Option<(Vec<f64>, f64)> {
        let mut share = 1.0;
        for _ in 0..TRIALS {
            let moved = |(x, s): (&f64, &f64)| (x + share * s).clamp(self.bounds.0, self.bounds.1);
            let next: Vec<f64> = x.iter().zip(step).map(moved).collect();
            let next_cost = (self.cost)(&next);
            // Armijo's condition with the customary 1e-4: any decrease in proportion to the step will do.
            if next_cost < cost + 1e-4 * share * slope {
                return Some((next, next_cost));
            }
            share *= SHORTER;
        }
        None
    }
}

/// The inverse of the Hessian after a step `s` that changed the gradient by `y`. Where the function is not convex
/// along the step it stays.
fn update(inverse: &mut Square, s: &[f64], y: &[f64]) {
    let sy = dot(s, y);
    // sᵀ y > 0 is what keeps the inverse Hessian positive definite, and so the next direction downhill.
    if sy <= 1e-12 {
        return;
    }
    // BFGS: H⁺ = (I − ρ s yᵀ) H (I − ρ y sᵀ) + ρ s sᵀ.
    let rho = 1.0 / sy;
    let mut left = diagonal(s.len(), 1.0);
    for (row, s) in left.iter_mut().zip(s) {
        row.iter_mut().zip(y).for_each(|(l, y)| *l -= s * y * rho);
    }
    let half: Square = left
        .iter()
        .map(|row| (0..s.len()).map(|j| column(inverse, j, row)).collect())
        .collect();
    for (i, row) in inverse.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = dot(&half[i], &left[j]) + s[i] * s[j] * rho;
        }
    }
}

fn diagonal(n: usize, value: f64) -> Square {
    (0..n)
        .map(|i| (0..n).map(|j| if i == j { value } else { 0.0 }).collect())
        .collect()
}

/// A row times a column of a matrix.
fn column(matrix: &Square, j: usize, row: &[f64]) -> f64 {
    row.iter().zip(matrix).map(|(r, m)| r * m[j]).sum()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A curved valley whose minimum is (1, 1). There its Hessian is [6, −2; −2, 1]: forward differences of 0.02 are off
    /// by half of that times its diagonal, (0.06, 0.01), so they vanish (0.04, 0.09) below the minimum. Where a bound
    /// cuts it off at x = 1.5 the lowest point is y = 2.25, less 0.01.
    #[test]
    fn a_curved_valley_is_followed_to_its_end_or_to_a_bound() {
        let valley = |x: &[f64]| 0.5 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2);
        let descent = |bounds| Descent {
            cost: &valley,
            bounds,
            iterations: 60,
            enough: 1e-9,
        };
        let found = descent((-3.0, 3.0)).minimum(vec![-1.0, 0.0]).unwrap();
        assert!(
            (found[0] - 0.96).abs() < 0.01 && (found[1] - 0.91).abs() < 0.01,
            "{found:?}"
        );
        let found = descent((1.5, 3.0)).minimum(vec![2.0, 2.0]).unwrap();
        assert!(
            (found[0] - 1.5).abs() < 1e-9 && (found[1] - 2.24).abs() < 0.01,
            "{found:?}"
        );
        let nowhere = Descent {
            cost: &|_| f64::NAN,
            bounds: (0.0, 1.0),
            iterations: 1,
            enough: 0.0,
        };
        assert_eq!(nowhere.minimum(vec![0.5]), None);
    }
}
