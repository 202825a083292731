//! Iterations, driven by argmin: damped Newton steps on the coordinates, the amplitudes following (variable
//! projection). The only file that names argmin.
//!
//! The gradient is analytic. The curvature is the difference of gradients where that is positive definite,
//! else Gauss and Newton's approximation, which alone would creep where no model fits well.

use super::bounded::{Bounded, MOST, Matrix, cholesky_solve};
use super::objective::{Objective, Range, Solution, dot};
use argmin::core::{
    CostFunction, Error, Executor, IterState, Jacobian, KV, Problem, Solver, State,
    TerminationReason, TerminationStatus,
};

/// End of the iterations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// The model is linear in its parameters: no iteration needed.
    Linear,
    /// A step no longer changes anything.
    Converged,
    /// The limit of iterations was reached first.
    IterationLimit,
    /// Nothing was minimised: lines were read off.
    Regression,
}

nav_sim_signal::named!(
    Termination {
        Linear = "linear",
        Converged = "converged",
        IterationLimit = "iteration_limit",
        Regression = "regression",
    }
);

/// Local minimum to which a start led.
#[derive(Debug, Clone)]
pub(crate) struct End {
    pub(crate) coordinates: Vec<f64>,
    /// Σ residual², in units of the target's length.
    pub(crate) cost: f64,
    pub(crate) termination: Termination,
}

const MOST_ITERATIONS: u64 = 300;

/// Descends from a start to the local minimum.
pub(crate) fn descend(objective: &Objective, start: &[f64]) -> End {
    let ranges: Vec<Range> = objective.shaped().map(|(_, range)| range).collect();
    let solver = DampedNewton {
        ranges,
        damping: 1e-3,
        growth: 2.0,
    };
    let run = Executor::new(Reduced(objective), solver)
        .configure(|state| state.param(start.to_vec()).max_iters(MOST_ITERATIONS))
        .timer(false)
        .run();
    let stuck = End {
        coordinates: start.to_vec(),
        cost: objective.solve(start).cost(),
        termination: Termination::IterationLimit,
    };
    let Ok(run) = run else { return stuck };
    let state = run.state();
    let converged = matches!(
        state.get_termination_reason(),
        Some(TerminationReason::SolverConverged | TerminationReason::TargetCostReached)
    );
    match state.get_best_param() {
        None => stuck,
        Some(best) => End {
            coordinates: best.clone(),
            cost: state.get_best_cost(),
            termination: if converged {
                Termination::Converged
            } else {
                Termination::IterationLimit
            },
        },
    }
}

/// The objective as a function of the coordinates alone.
struct Reduced<'a>(&'a Objective);

impl CostFunction for Reduced<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, coordinates: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.0.solve(coordinates).cost())
    }
}

impl Jacobian for Reduced<'_> {
    type Param = Vec<f64>;
    type Jacobian = Solution;

    fn jacobian(&self, coordinates: &Vec<f64>) -> Result<Solution, Error> {
        Ok(self.0.solve(coordinates))
    }
}

/// A step this small (natural logarithms of a correlation time, or theta) is the last.
const SMALL_STEP: f64 = 1e-11;
/// No coordinate moves further in one step.
const LARGE_STEP: f64 = 2.0;
/// A damping at which no step helps.
const HOPELESS: f64 = 1e12;

struct DampedNewton {
    ranges: Vec<Range>,
    damping: f64,
    growth: f64,
}

/// Step h of the central differences (natural logarithms of a correlation time, or theta): their error h² and
/// the rounding of the gradients over h are both of the order 1e-10.
const DIFFERENCE: f64 = 1e-5;

/// Half the second derivatives of the cost.
fn curvature(objective: &Objective, u: &[f64], at: &Solution) -> Matrix {
    let n = u.len();
    let mut hessian = [[0.0; MOST]; MOST];
    for j in 0..n {
        let gradients = |sign: f64| {
            let mut there = u.to_vec();
            there[j] += sign * DIFFERENCE;
            let solution = objective.solve(&there);
            (0..n).map(|i| solution.gradient(i)).collect::<Vec<_>>()
        };
        let (up, down) = (gradients(1.0), gradients(-1.0));
        for i in 0..n {
            // `gradient` is half a derivative, so (up − down)/2h is half a second one; half of it in either
            // place makes the matrix symmetric.
            let half = 0.25 * (up[i] - down[i]) / DIFFERENCE;
            hessian[i][j] += half;
            hessian[j][i] += half;
        }
    }
    // Away from a minimum the curvature may be indefinite and point uphill; Gauss and Newton's is never.
    if cholesky_solve(|i, j| hessian[i][j], [0.0; MOST], n).is_some() {
        return hessian;
    }
    for i in 0..n {
        for j in 0..n {
            hessian[i][j] = dot(&at.jacobian[i], &at.jacobian[j]);
        }
    }
    hessian
}

type Iterate = IterState<Vec<f64>, (), Solution, (), (), f64>;

impl DampedNewton {
    /// The damped step within the ranges, and the decrease the quadratic model expects of it.
    fn step(&self, u: &[f64], at: &Solution, curvature: &Matrix) -> (Vec<f64>, f64) {
        let n = u.len();
        let mut problem = Bounded::new(n);
        problem.gram = *curvature;
        let largest = (0..n)
            .map(|i| curvature[i][i])
            .fold(f64::MIN_POSITIVE, f64::max);
        // Damped along the diagonal (Marquardt), so that the step does not depend on the units of the
        // coordinates.
        for i in 0..n {
            // A component without amplitude has no slope: it stays where it is.
            problem.gram[i][i] += self.damping * (curvature[i][i] + 1e-12 * largest);
        }
        // Shifted so that the start is 0, and scaled to a unit diagonal.
        let scale: Vec<f64> = (0..n).map(|i| problem.gram[i][i].sqrt()).collect();
        for i in 0..n {
            for j in 0..n {
                problem.gram[i][j] /= scale[i] * scale[j];
            }
            problem.right[i] = -at.gradient(i) / scale[i];
            problem.lower[i] = (self.ranges[i].low - u[i]).max(-LARGE_STEP) * scale[i];
            problem.upper[i] = (self.ranges[i].high - u[i]).min(LARGE_STEP) * scale[i];
        }
        // The bounds are part of the quadratic problem: cut off afterwards, the step of the other coordinates
        // would be wrong.
        let scaled = problem.minimise();
        let step: Vec<f64> = (0..n).map(|i| scaled[i] / scale[i]).collect();
        // Gradient and curvature are halves: the cost falls by 2g·s − s·Hs, which is g·s where Hs = g, g
        // downhill.
        (step, (0..n).map(|i| scaled[i] * problem.right[i]).sum())
    }
}

impl Solver<Reduced<'_>, Iterate> for DampedNewton {
    fn name(&self) -> &str {
        "damped Newton with variable projection"
    }

    fn init(
        &mut self,
        problem: &mut Problem<Reduced<'_>>,
        state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let solution = problem.jacobian(state.get_param().unwrap_or(&Vec::new()))?;
        Ok((state.cost(solution.cost()).jacobian(solution), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<Reduced<'_>>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let (Some(u), Some(at)) = (state.take_param(), state.take_jacobian()) else {
            return Ok((
                state.terminate_with(TerminationReason::SolverExit("no start".into())),
                None,
            ));
        };
        let curvature = problem.problem("curvature_count", |reduced| {
            Ok(curvature(reduced.0, &u, &at))
        })?;
        let (step, expected) = self.step(&u, &at, &curvature);
        let there: Vec<f64> = u.iter().zip(&step).map(|(u, s)| u + s).collect();
        let next = problem.jacobian(&there)?;
        let (before, after) = (at.cost(), next.cost());
        let small = step.iter().all(|s| s.abs() < SMALL_STEP);
        if after < before {
            self.damping = (self.damping * 0.2).max(1e-12);
            self.growth = 2.0;
            state = state.param(there).cost(after).jacobian(next);
        } else {
            // Doubling the factor with each refusal: a start far off needs few tries to become cautious
            // enough.
            self.damping *= self.growth;
            self.growth *= 2.0;
            state = state.param(u).cost(before).jacobian(at);
        }
        // No decrease that the cost could show.
        let flat = expected <= 1e-16 * before;
        if small || flat || self.damping > HOPELESS {
            state = state.terminate_with(TerminationReason::SolverConverged);
        }
        Ok((state, None))
    }

    fn terminate(&mut self, state: &Iterate) -> TerminationStatus {
        match state.get_cost() {
            cost if cost <= f64::MIN_POSITIVE => {
                TerminationStatus::Terminated(TerminationReason::TargetCostReached)
            }
            _ => TerminationStatus::NotTerminated,
        }
    }
}
