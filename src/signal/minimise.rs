//! Minimisation within bounds: least squares by active sets, and damped Newton steps
//! ([Levenberg-Marquardt](crate::bibliography::More78)).

use argmin::core::{
    CostFunction, Error, Executor, IterState, KV, Problem, Solver, State, TerminationReason,
};
use argmin::solver::brent::BrentOpt;

/// A step this small (natural logarithms, or numbers of the order of 1) is the last.
const SMALL_STEP: f64 = 1e-11;
/// No variable moves further in one step.
const LARGE_STEP: f64 = 1.5;
/// Factors on the damping, after a step that does not gain what it should and after one that does.
const MORE: f64 = 5.0;
const LESS: f64 = 0.2;
const MOST_ITERATIONS: u64 = 300;

/// Bounds, damping and stopping rule of a descent.
#[derive(Debug, Clone, Copy)]
pub struct Descent<'a> {
    /// Smallest and largest value of each variable.
    pub ranges: &'a [(f64, f64)],
    /// Damping of the first step, in units of the curvature.
    pub damping: f64,
    /// A step that should gain less, or gains less, is the last; by the cost.
    pub enough: fn(f64) -> f64,
}

/// Local minimum to which a start led.
#[derive(Debug, Clone)]
pub struct Minimum<V> {
    /// The variables.
    pub at: Vec<f64>,
    /// Value of the objective there.
    pub value: V,
    /// True if the last step changed nothing to the stopping tolerance.
    pub has_converged: bool,
}

impl Descent<'_> {
    /// Descends from a start to a local minimum of a cost. `quadratic`: half the gradient of the cost, and half its second
    /// derivatives or Gauss and Newton's approximation of them.
    pub fn minimum<V>(
        self,
        start: &[f64],
        evaluate: impl Fn(&[f64]) -> V,
        cost: impl Fn(&V) -> f64,
        quadratic: impl Fn(&[f64], &V) -> (Vec<f64>, Matrix),
    ) -> Minimum<V> {
        let solver = DampedNewton {
            descent: self,
            cost,
            quadratic,
            at: start.to_vec(),
            value: evaluate(start),
            model: None,
        };
        let run = Executor::new(evaluate, solver)
            .configure(|state: Iterate| state.param(start.to_vec()).max_iters(MOST_ITERATIONS))
            .timer(false)
            .run()
            .expect("steps");
        let reason = run.state.get_termination_reason();
        Minimum {
            at: run.solver.at,
            value: run.solver.value,
            has_converged: reason == Some(&TerminationReason::SolverConverged),
        }
    }
}

/// Damped Newton steps, whose iterations argmin drives.
struct DampedNewton<'a, V, C, Q> {
    descent: Descent<'a>,
    cost: C,
    quadratic: Q,
    at: Vec<f64>,
    value: V,
    /// Gradient and curvature there, after a step that was refused.
    model: Option<(Vec<f64>, Matrix)>,
}

type Iterate = IterState<Vec<f64>, (), (), (), (), f64>;

impl<V, E, C, Q> Solver<E, Iterate> for DampedNewton<'_, V, C, Q>
where
    E: Fn(&[f64]) -> V,
    C: Fn(&V) -> f64,
    Q: Fn(&[f64], &V) -> (Vec<f64>, Matrix),
{
    fn name(&self) -> &str {
        "damped Newton"
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<E>,
        state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let before = (self.cost)(&self.value);
        let model = self.model.take();
        let model = model.unwrap_or_else(|| (self.quadratic)(&self.at, &self.value));
        let (step, expected) = loop {
            let found = self.descent.step(&self.at, &model);
            if !found.0.iter().any(|s| s.abs() > LARGE_STEP) {
                break found;
            }
            self.descent.damping *= MORE;
        };
        let enough = (self.descent.enough)(before);
        // A gain that is not a number is none.
        let mut goes_on = expected > enough && step.iter().any(|s| s.abs() >= SMALL_STEP);
        if goes_on {
            let there: Vec<f64> = self.at.iter().zip(&step).map(|(x, s)| x + s).collect();
            let next = problem.problem("evaluations", |evaluate| Ok(evaluate(&there)))?;
            let gain = before - (self.cost)(&next);
            if gain > 0.6 * expected {
                self.descent.damping *= LESS;
            }
            if gain > 0.1 * expected {
                (self.at, self.value) = (there, next);
                goes_on = gain >= enough;
            } else {
                self.descent.damping *= MORE;
                self.model = Some(model);
            }
        }
        let state = match goes_on {
            true => state,
            false => state.terminate_with(TerminationReason::SolverConverged),
        };
        Ok((state, None))
    }
}

impl Descent<'_> {
    /// The damped step within the ranges, and the decrease that the quadratic model expects of it.
    fn step(&self, at: &[f64], (gradient, curvature): &(Vec<f64>, Matrix)) -> (Vec<f64>, f64) {
        let n = at.len();
        let mut problem = BoundedStep::new(n);
        // Shifted so that the start is 0, and scaled to a unit diagonal.
        let scale: Vec<f64> = (0..n)
            .map(|i| (curvature[i][i] + self.damping).sqrt())
            .collect();
        for i in 0..n {
            for j in 0..n {
                let damping = if i == j { self.damping } else { 0.0 };
                problem.gram[i][j] = (curvature[i][j] + damping) / (scale[i] * scale[j]);
            }
            let (low, high) = self.ranges[i];
            problem.right[i] = -gradient[i] / scale[i];
            problem.lower[i] = (low - at[i]) * scale[i];
            problem.upper[i] = (high - at[i]) * scale[i];
        }
        // The bounds are part of the quadratic problem: cut off afterwards, the step of the other variables would be
        // wrong.
        let scaled = problem.minimise();
        let step: Vec<f64> = (0..n).map(|i| scaled[i] / scale[i]).collect();
        let slope = |i: usize| {
            let bent: f64 = (0..n).map(|j| curvature[i][j] * step[j]).sum();
            -(2.0 * gradient[i] + bent) * step[i]
        };
        let expected = (0..n).map(slope).sum();
        (step, expected)
    }
}

/// The minimum of a smooth function of one variable between two points, by parabolas ([`BrentOpt`]).
pub fn line_minimum(low: f64, high: f64, tolerance: f64, f: impl Fn(f64) -> f64) -> f64 {
    struct Line<F>(F);
    impl<F: Fn(f64) -> f64> CostFunction for Line<F> {
        type Param = f64;
        type Output = f64;
        fn cost(&self, x: &f64) -> Result<f64, Error> {
            Ok(self.0(*x))
        }
    }
    // A relative tolerance of 0: beside 0 it would be none, and the variables here are of the order of 1.
    let run = Executor::new(
        Line(f),
        BrentOpt::new(low, high).set_tolerance(0.0, tolerance),
    )
    .configure(|state| state.max_iters(MOST_ITERATIONS))
    .timer(false)
    .run()
    .expect("steps");
    let best = run.state.get_best_param();
    best.copied().unwrap_or(0.5 * (low + high))
}

/// Largest positive number at which `holds` is still true, to a relative tolerance.
pub fn bisection(mut low: f64, mut high: f64, tolerance: f64, holds: impl Fn(f64) -> bool) -> f64 {
    while high - low > tolerance * high {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

// Least squares with bounds, from the normal equations: minimises ½·xᵀGx − rᵀx over lower ≤ x ≤ upper.
//
// The active-set method of [Lawson and Hanson](crate::bibliography::LawsonHanson74) (NNLS, chapter 23),
// with upper bounds treated like lower ones. Columns are expected at unit length, so that G has a unit
// diagonal and tolerances mean the same for every parameter.

/// Largest number of parameters.
pub const MOST: usize = 12;

/// A small symmetric matrix; rows and columns beyond the problem's size are not read.
pub type Matrix = [[f64; MOST]; MOST];
/// A small vector.
pub type Vector = [f64; MOST];

/// A bounded quadratic problem of size `n`.
#[derive(Debug, Clone, Copy)]
pub struct BoundedStep {
    /// Variables.
    pub n: usize,
    /// G.
    pub gram: Matrix,
    /// r.
    pub right: Vector,
    /// Lower bounds, finite.
    pub lower: Vector,
    /// Upper bounds.
    pub upper: Vector,
}

/// Place of a parameter: between its bounds, or on one.
#[derive(Clone, Copy, PartialEq)]
enum BoundState {
    Free,
    Lower,
    Upper,
}

/// A gradient component below this is rounding (target and columns have unit length).
const FLAT: f64 = 1e-15;
/// A pivot below this share of the diagonal element means that the column depends on those before it.
const DEPENDENT: f64 = 1e-13;

impl BoundedStep {
    /// All zero: bounds 0 … ∞.
    pub const fn new(n: usize) -> Self {
        let zero = [0.0; MOST];
        Self {
            n,
            gram: [zero; MOST],
            right: zero,
            lower: zero,
            upper: [f64::INFINITY; MOST],
        }
    }

    /// The minimiser. Lower bounds are finite.
    pub fn minimise(&self) -> Vector {
        self.minimise_near([false; MOST])
    }

    /// Minimises sooner where the parameters between their bounds are those of `is_free`, the others on their lower ones.
    pub fn minimise_near(&self, is_free: [bool; MOST]) -> Vector {
        let mut x = self.lower;
        let mut places = [BoundState::Lower; MOST];
        let near = is_free.map(|free| {
            if free {
                BoundState::Free
            } else {
                BoundState::Lower
            }
        });
        let is_inside = |goal: &Vector| {
            (0..self.n).all(|i| goal[i] >= self.lower[i] && goal[i] <= self.upper[i])
        };
        if is_free[..self.n].contains(&true)
            && let Some(goal) = self.solve_free(&x, &near).filter(is_inside)
        {
            (x, places) = (goal, near);
        }
        let mut refused = [false; MOST];
        // Each pass lowers the objective strictly, so no set of free parameters comes twice; the limit
        // guards against rounding.
        for _ in 0..20 * self.n {
            let Some(entering) = self.steepest(&x, &places, &refused) else {
                break;
            };
            let before = places[entering];
            places[entering] = BoundState::Free;
            if self.descend(&mut x, &mut places, entering) {
                refused = [false; MOST];
            } else {
                // The column depends on the free ones or cannot leave its bound: it is tried again only after
                // another step.
                places[entering] = before;
                refused[entering] = true;
            }
        }
        x
    }

    /// −gradient.
    fn downhill(&self, x: &Vector, i: usize) -> f64 {
        self.right[i] - (0..self.n).map(|j| self.gram[i][j] * x[j]).sum::<f64>()
    }

    /// The bound parameter that most wants to leave its bound.
    fn steepest(
        &self,
        x: &Vector,
        places: &[BoundState; MOST],
        refused: &[bool; MOST],
    ) -> Option<usize> {
        let mut best = (FLAT, None);
        for i in (0..self.n).filter(|i| !refused[*i]) {
            let w = self.downhill(x, i);
            let pull = match places[i] {
                BoundState::Lower if self.upper[i] > self.lower[i] => w,
                BoundState::Upper => -w,
                _ => continue,
            };
            if pull > best.0 {
                best = (pull, Some(i));
            }
        }
        best.1
    }

    /// Moves to the minimum over the free parameters, binding those that meet a bound on the way; false if
    /// the one that enters cannot move.
    fn descend(&self, x: &mut Vector, places: &mut [BoundState; MOST], entering: usize) -> bool {
        let start = x[entering];
        loop {
            // Only the first solution can fail: afterwards the free columns get fewer, and those left are
            // independent.
            let Some(goal) = self.solve_free(x, places) else {
                return false;
            };
            let mut blocking = (1.0, None);
            for i in (0..self.n).filter(|i| places[*i] == BoundState::Free) {
                let step = goal[i] - x[i];
                let room = if step < 0.0 {
                    self.lower[i] - x[i]
                } else {
                    self.upper[i] - x[i]
                };
                // The part of the way to the minimum at which this parameter meets its bound; the nearest of
                // all stops the step.
                if step.abs() > room.abs() && room / step < blocking.0 {
                    let place = if step < 0.0 {
                        BoundState::Lower
                    } else {
                        BoundState::Upper
                    };
                    blocking = ((room / step).max(0.0), Some((i, place)));
                }
            }
            for i in (0..self.n).filter(|i| places[*i] == BoundState::Free) {
                x[i] += blocking.0 * (goal[i] - x[i]);
            }
            let Some((i, place)) = blocking.1 else {
                return true;
            };
            // The bound itself: the sum above meets it to rounding only.
            x[i] = if place == BoundState::Lower {
                self.lower[i]
            } else {
                self.upper[i]
            };
            places[i] = place;
            if i == entering && (x[i] - start).abs() <= 0.0 {
                return false;
            }
        }
    }

    /// The unconstrained minimum over the free parameters, the others kept; none if G is singular there.
    fn solve_free(&self, x: &Vector, places: &[BoundState; MOST]) -> Option<Vector> {
        let mut free = [0; MOST];
        let mut count = 0;
        for i in (0..self.n).filter(|i| places[*i] == BoundState::Free) {
            free[count] = i;
            count += 1;
        }
        let free = &free[..count];
        let mut right = [0.0; MOST];
        for (a, &i) in free.iter().enumerate() {
            let bound = (0..self.n).filter(|j| places[*j] != BoundState::Free);
            right[a] = self.right[i] - bound.map(|j| self.gram[i][j] * x[j]).sum::<f64>();
        }
        let solution = cholesky_solve(|a, b| self.gram[free[a]][free[b]], right, count)?;
        let mut goal = *x;
        for (a, &i) in free.iter().enumerate() {
            goal[i] = solution[a];
        }
        Some(goal)
    }
}

/// Solves A·x = b, A symmetric of size n; none if it is not positive definite to working precision.
pub fn cholesky_solve(a: impl Fn(usize, usize) -> f64, mut b: Vector, n: usize) -> Option<Vector> {
    let mut l = [[0.0; MOST]; MOST];
    for i in 0..n {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            if i == j {
                // The squared part of the column that is independent of those before it. Its rounding error
                // is 1e-16 of the whole.
                let pivot = a(i, i) - dot;
                if pivot <= DEPENDENT * a(i, i) {
                    return None;
                }
                l[i][i] = pivot.sqrt();
            } else {
                l[i][j] = (a(i, j) - dot) / l[j][j];
            }
        }
    }
    for i in 0..n {
        b[i] = (b[i] - (0..i).map(|k| l[i][k] * b[k]).sum::<f64>()) / l[i][i];
    }
    for i in (0..n).rev() {
        b[i] = (b[i] - (i + 1..n).map(|k| l[k][i] * b[k]).sum::<f64>()) / l[i][i];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Generator;
    use approx::assert_abs_diff_eq;
    use rand::{RngExt, SeedableRng};

    fn objective(p: &BoundedStep, x: &Vector) -> f64 {
        let quadratic: f64 = (0..p.n)
            .flat_map(|i| (0..p.n).map(move |j| (i, j)))
            .map(|(i, j)| x[i] * p.gram[i][j] * x[j])
            .sum();
        0.5 * quadratic - (0..p.n).map(|i| p.right[i] * x[i]).sum::<f64>()
    }

    /// Random problems against the conditions that characterise the minimum (Karush-Kuhn-Tucker).
    #[test]
    fn the_minimum_satisfies_its_conditions() {
        let mut generator = Generator::seed_from_u64(11);
        for case in 0..500 {
            let n = 1 + case % 7;
            let mut p = BoundedStep::new(n);
            let columns: Vec<Vec<f64>> = (0..n)
                .map(|_| {
                    (0..n + 3)
                        .map(|_| generator.random_range(-0.2..1.0))
                        .collect()
                })
                .collect();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            for i in 0..n {
                for j in 0..n {
                    p.gram[i][j] = dot(&columns[i], &columns[j]);
                }
                p.right[i] = generator.random_range(-1.0..1.0);
                p.lower[i] = generator.random_range(-0.3..0.1);
                if case % 2 == 0 {
                    p.upper[i] = p.lower[i] + generator.random_range(0.0..0.5);
                }
            }
            let x = p.minimise();
            for i in 0..n {
                let w = p.downhill(&x, i);
                assert!(x[i] >= p.lower[i] && x[i] <= p.upper[i]);
                if x[i] > p.lower[i] + 1e-12 {
                    assert!(w > -1e-9, "case {case}: {w}");
                }
                if x[i] < p.upper[i] - 1e-12 {
                    assert!(w < 1e-9, "case {case}: {w}");
                }
            }
            let mut corner = p.lower;
            corner[0] = 0.5 * (p.lower[0] + p.upper[0].min(1.0));
            assert!(objective(&p, &x) <= objective(&p, &corner) + 1e-12);
        }
    }

    #[test]
    fn equal_columns_do_not_hang_and_do_not_blow_up() {
        let mut p = BoundedStep::new(3);
        p.gram = [[1.0; MOST]; MOST];
        p.right = [1.0; MOST];
        let x = p.minimise();
        assert_abs_diff_eq!(x[0] + x[1] + x[2], 1.0, epsilon = 1e-12);
    }
}
