//! The global minimum: all combinations of a grid of shapes, each with its best amplitudes, then a descent
//! from every local minimum of the grid.
//!
//! With the shapes fixed the problem is linear with non-negative amplitudes, so nothing can be missed but
//! between grid points, and the objective is smooth there: over the correlation times of 15 scales neighbours differ by 10 %
//! with one of them in the model, by 15 % with two, by 60 % with three and by a factor of 2 with four.

use super::least_squares::Weighting;
use crate::curve::sampling::Response;
use crate::minimise::{BoundedStep, Descent, MOST, Matrix, Vector, cholesky_solve};
use crate::noise::ProcessKind;
use crate::wavelet::{Curve, QuantizationResponse};
use rayon::prelude::*;
use std::cell::RefCell;

/// Largest number of points in one dimension.
const POINTS: usize = 160;

/// Effort of a search.
#[derive(Clone, Copy)]
pub(crate) struct SearchBudget {
    /// Limit of the number of combinations of the grid, where its dimensions are alike; 0: no grid where minima are known.
    combinations: usize,
    /// Largest number of local minima of the grid from which a descent starts.
    starts: usize,
    /// True if all ends are minima to rounding; else the best is one, to a small part of its standard deviations.
    is_exact: bool,
}

impl SearchBudget {
    /// For a curve of which nothing is known.
    pub(crate) const WHOLE: Self = Self {
        combinations: 6000,
        starts: 16,
        is_exact: true,
    };
    /// For a curve that resembles one already fitted: its minima are known, and another is seldom far from the grid's best.
    pub(crate) const AGAIN: Self = Self {
        combinations: 300,
        starts: 2,
        is_exact: false,
    };
    /// Descents from the known minima only.
    pub(crate) const fn within(self) -> Self {
        Self {
            combinations: 0,
            ..self
        }
    }
}

/// Result of the search.
pub(crate) struct SearchResult {
    /// The ends of all starts, best first; one at least.
    pub(crate) ends: Vec<LocalMinimum>,
    /// Combinations of shapes that were tried.
    pub(crate) combinations: usize,
}

/// Searches all coordinates, on a grid and from the `known` minima of a similar curve.
pub(crate) fn search(
    objective: &Objective,
    effort: SearchBudget,
    known: &[Vec<f64>],
) -> SearchResult {
    let dimensions: Vec<(usize, Range)> = objective.shaped().collect();
    if dimensions.is_empty() {
        let cost = objective.solve(&[], None).cost();
        let end = LocalMinimum {
            coordinates: Vec::new(),
            cost,
            termination: Termination::Linear,
        };
        return SearchResult {
            ends: vec![end],
            combinations: 1,
        };
    }
    let mut starts = known.to_vec();
    let mut tried = 0;
    if effort.combinations > 0 || known.is_empty() {
        // What the grid of a similar curve is for is the order of its combinations: the shares of quantization noise are those
        // of the best minimum known.
        let responses = match known.first() {
            Some(best) if !effort.is_exact => Some(objective.solve(best, None).responses),
            _ => None,
        };
        let grid = Grid::new(objective, &dimensions, effort.combinations, responses);
        let choices = grid.choices();
        tried = choices.len();
        // The grid first: of ends with the same cost the sort keeps that order, whatever is known.
        starts.splice(0..0, grid.starts(&choices, effort.starts));
    }
    let mut ends: Vec<LocalMinimum> = starts
        .par_iter()
        .map(|start| {
            let end = descend(objective, start, &Precision::ROUGH);
            match effort.is_exact {
                true => descend(objective, &end.coordinates, &Precision::EXACT),
                false => end,
            }
        })
        .collect();
    ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    if !effort.is_exact {
        ends[0] = descend(objective, &ends[0].coordinates, &Precision::FINE);
    }
    SearchResult {
        ends,
        combinations: tried,
    }
}

/// The grid: for each dimension its points and their columns; the inner products of all columns.
struct Grid<'a> {
    objective: &'a Objective,
    points: Vec<Vec<f64>>,
    /// True for a dimension of the same kind as the one before it: only ascending pairs are
    /// searched.
    repeats: Vec<bool>,
    /// Shapes of the components without a coordinate, then those of the points of each dimension.
    shapes: Vec<UnitVariance>,
    /// True if the columns serve for every combination.
    is_linear: bool,
    /// Inner products of the columns of all shapes, and with the target.
    gram: Vec<f64>,
    right: Vec<f64>,
}

impl<'a> Grid<'a> {
    /// `responses`: those of all combinations; none where they follow from the amplitudes of each.
    fn new(
        objective: &'a Objective,
        dimensions: &[(usize, Range)],
        combinations: usize,
        responses: Option<Vec<Response>>,
    ) -> Self {
        let count = points_per_dimension(dimensions.len(), combinations);
        let points: Vec<Vec<f64>> = dimensions.iter().map(|(_, r)| spread(*r, count)).collect();
        let repeats = (0..dimensions.len())
            .map(|d| {
                d > 0
                    && objective.components[dimensions[d].0]
                        == objective.components[dimensions[d - 1].0]
            })
            .collect();
        let fixed = (0..objective.components.len())
            .filter(|i| objective.components[*i].coordinate.is_none());
        let mut shapes: Vec<UnitVariance> = fixed.map(|i| objective.shape(i, 0.0)).collect();
        for ((owner, _), points) in dimensions.iter().zip(&points) {
            shapes.extend(points.iter().map(|u| objective.shape(*owner, *u)));
        }
        let is_linear = objective.is_linear() || responses.is_some();
        let responses = responses.unwrap_or_else(|| objective.plain_responses());
        let columns: Vec<DesignColumn> = shapes
            .iter()
            .map(|shape| objective.column(shape, &responses))
            .collect();
        let n = columns.len();
        let mut gram = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                gram[i * n + j] = dot(&columns[i].values, &columns[j].values);
                gram[j * n + i] = gram[i * n + j];
            }
        }
        let right = columns
            .iter()
            .map(|c| dot(&c.values, &objective.target))
            .collect();
        Self {
            objective,
            points,
            repeats,
            shapes,
            is_linear,
            gram,
            right,
        }
    }

    /// Least Σ residual² for a choice of points, one for each dimension.
    fn cost(&self, choice: &[usize]) -> f64 {
        let mut selected = [0; MOST];
        let fixed = self.shapes.len() - self.points.iter().map(Vec::len).sum::<usize>();
        let mut n = fixed;
        (0..fixed).for_each(|i| selected[i] = i);
        let mut offset = fixed;
        for (index, points) in choice.iter().zip(&self.points) {
            selected[n] = offset + index;
            offset += points.len();
            n += 1;
        }
        if !self.is_linear {
            let mut shapes: Vec<&UnitVariance> =
                selected[..n].iter().map(|i| &self.shapes[*i]).collect();
            // The amplitudes and their bounds are in the order of the components.
            shapes.sort_unstable_by_key(|shape| shape.component);
            return self.objective.cost_near(&shapes);
        }
        let mut problem = BoundedStep::new(n);
        for a in 0..n {
            let i = selected[a];
            for b in 0..n {
                problem.gram[a][b] = self.gram[i * self.shapes.len() + selected[b]];
            }
            problem.right[a] = self.right[i];
        }
        let x = problem.minimise_near([true; MOST]);
        let linear: f64 = (0..n).map(|i| problem.right[i] * x[i]).sum();
        let quadratic: f64 = (0..n)
            .map(|i| x[i] * (0..n).map(|j| problem.gram[i][j] * x[j]).sum::<f64>())
            .sum();
        // |b − Ax|² with |b| = 1, from inner products that are shared by all combinations.
        1.0 - 2.0 * linear + quadratic
    }

    /// The local minima of the grid, best first, so many at most.
    fn starts(&self, choices: &[Vec<usize>], most: usize) -> Vec<Vec<f64>> {
        let costs: Vec<f64> = choices
            .par_iter()
            .with_min_len(64)
            .map(|c| self.cost(c))
            .collect();
        // A choice as a number whose digits are its points from 1 on: ascending as the choices are, and its neighbours are the
        // numbers whose digits differ by at most one; those that are no choice are not found.
        let base = self.points.iter().map(Vec::len).max().unwrap_or(0) as i64 + 2;
        let key = |choice: &[usize]| choice.iter().fold(0, |key, i| key * base + *i as i64 + 1);
        let keys: Vec<i64> = choices.iter().map(|choice| key(choice)).collect();
        let further = |to: Vec<i64>| {
            to.iter()
                .flat_map(|key| [-1, 0, 1].map(|step| key * base + step))
                .collect()
        };
        let neighbours: Vec<i64> = self.points.iter().fold(vec![0], |to, _| further(to));
        let lowest_at = |key: i64, cost: f64| {
            let cost_at = |key: i64| keys.binary_search(&key).ok().map(|i| costs[i]);
            neighbours
                .iter()
                .all(|to| cost_at(key + to).is_none_or(|other| cost <= other))
        };
        let mut minima: Vec<(f64, &Vec<usize>)> = costs
            .iter()
            .copied()
            .zip(choices)
            .filter(|(cost, choice)| lowest_at(key(choice), *cost))
            .collect();
        minima.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(b.1)));
        // A flat stretch (a process without amplitude) is one minimum.
        minima.dedup_by(|b, a| (b.0 - a.0).abs() <= 1e-9 * a.0.abs());
        minima.truncate(most);
        let point = |choice: &Vec<usize>| {
            choice
                .iter()
                .zip(&self.points)
                .map(|(i, p)| p[*i])
                .collect()
        };
        minima
            .into_iter()
            .map(|(_, choice)| point(choice))
            .collect()
    }

    /// All choices of points, alike dimensions ascending.
    fn choices(&self) -> Vec<Vec<usize>> {
        let mut choices = vec![Vec::new()];
        for (points, repeats) in self.points.iter().zip(&self.repeats) {
            choices = choices
                .into_iter()
                .flat_map(|choice: Vec<usize>| {
                    // Alike processes may be exchanged, and two at one point are one: strictly ascending
                    // choices are all there are.
                    let first = if *repeats {
                        choice.last().map_or(0, |i| i + 1)
                    } else {
                        0
                    };
                    (first..points.len()).map(move |i| [choice.as_slice(), &[i]].concat())
                })
                .collect();
        }
        choices
    }
}

/// Largest number of points per dimension that keeps the combinations of dimensions of one kind at
/// `most`, and at least one more than there are dimensions. Dimensions of two kinds (an AR1 and an
/// MA1) have up to k! times as many combinations.
fn points_per_dimension(dimensions: usize, most: usize) -> usize {
    // n·(n − 1)···/k! of k alike dimensions, of which ascending choices are all there are.
    let combinations = |n: usize| (0..dimensions).fold(1, |c, k| c * (n - k) / (k + 1));
    (dimensions + 1..=POINTS)
        .take_while(|n| combinations(*n) <= most)
        .last()
        .unwrap_or(dimensions + 1)
}

fn spread(range: Range, count: usize) -> Vec<f64> {
    if range.high <= range.low {
        return vec![range.low];
    }
    let step = (range.high - range.low) / (count - 1) as f64;
    (0..count).map(|i| range.low + step * i as f64).collect()
}

// The distance between a curve and a model: Σ Omega_j (nu_j − nu_j(theta))²
// ([Guerrier](crate::bibliography::Guerrier13), eq. 6).
//
// Every process contributes an amplitude times a shape, so with the shapes fixed the model is linear. Not quite so for
// robust variances, which read quantization noise high by a factor of its share ([`crate::curve::implied()`]): there the linear
// problem is solved for the derivatives at the last solution until the shares settle. The implied curve is homogeneous in
// the amplitudes, so that its linear expansion at a solution has no constant, and where the shares have settled the
// conditions of the linear problem are those of the true one.

/// Range of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// One process of the model that is fitted. Its amplitude is the parameter in which its wavelet variance is
/// linear: sigma2, q2, gamma2, s2 or slope². Its coordinate says its shape: ln κ (κ = −ln phi or beta/f)
/// for AR1 and GM, theta for MA1.
#[derive(PartialEq)]
pub(crate) struct Component {
    pub(crate) kind: ProcessKind,
    pub(crate) coordinate: Option<Range>,
}

impl Component {
    /// Wavelet variance per unit of amplitude and its derivative with respect to the coordinate.
    fn shape(&self, u: f64, level: u32) -> (f64, f64) {
        match self.kind {
            ProcessKind::Ar1 | ProcessKind::GaussMarkov => {
                let kappa = u.exp();
                let (value, derivative) = self.kind.haar_shape_of_kappa(kappa, level);
                (value, kappa * derivative)
            }
            kind => kind.haar_shape(u, level),
        }
    }
}

/// Wavelet variance of a component per unit of its amplitude, at all levels, in the weights of the curve.
#[derive(Debug, Clone)]
pub(crate) struct UnitVariance {
    component: usize,
    values: Vec<f64>,
    /// Derivative with respect to the coordinate.
    slopes: Vec<f64>,
}

/// A column of the linear problem, at unit length.
struct DesignColumn {
    values: Vec<f64>,
    /// The length taken out.
    pub(crate) length: f64,
}

/// Solution of the linear problem: amplitudes where the shapes are given.
struct LinearBest {
    responses: Vec<Response>,
    columns: Vec<DesignColumn>,
    gram: Matrix,
    /// Amplitudes, in units of their columns' lengths.
    x: Vector,
    /// Variables that are not at a bound.
    is_free: [bool; MOST],
    residuals: Vec<f64>,
}

/// Tolerance of the shares of quantization noise.
#[derive(Clone, Copy)]
struct FixedPointTolerance {
    /// Rounds at most; each takes off two digits or so.
    rounds: usize,
    /// Largest change of a response that is left: the cost errs by its square.
    change: f64,
}

impl FixedPointTolerance {
    /// To rounding.
    const WHOLE: Self = Self {
        rounds: 16,
        change: 1e-13,
    };
    /// The cost to rounding, its derivatives to 1e-8.
    const OF_COST: Self = Self {
        rounds: 16,
        change: 1e-8,
    };
    /// Tells which of the grid's combinations are near.
    const NEARLY: Self = Self {
        rounds: 3,
        change: 1e-4,
    };
}

/// The least-squares problem: weighted curve, in units of its length.
pub(crate) struct Objective {
    levels: Vec<u32>,
    roots: Vec<f64>,
    /// Response of a robust curve to quantization noise, level by level, where the model has some; none: as it is.
    quantization: Option<Vec<Option<QuantizationResponse>>>,
    target: Vec<f64>,
    pub(crate) length: f64,
    pub(crate) components: Vec<Component>,
}

/// The best amplitudes for given coordinates.
#[derive(Debug, Clone)]
pub(crate) struct LinearSolution {
    /// Amplitudes, in the parameters' units.
    pub(crate) amplitudes: Vec<f64>,
    /// target − model, in units of the target's length.
    pub(crate) residuals: Vec<f64>,
    /// Derivative of the residuals with respect to each coordinate, the amplitudes following: Kaufman's
    /// approximation. In the order of the components that have a coordinate.
    jacobian: Vec<Vec<f64>>,
    /// Responses of the curve there.
    responses: Vec<Response>,
    /// The amplitudes that are on no bound.
    is_free: [bool; MOST],
}

impl LinearSolution {
    /// Σ residual².
    pub(crate) fn cost(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }

    /// Half its derivative with respect to a coordinate. Exact: at the best amplitudes their own
    /// derivatives do not matter.
    fn gradient(&self, coordinate: usize) -> f64 {
        dot(&self.jacobian[coordinate], &self.residuals)
    }

    /// Half the second derivatives, without those of the residuals (Gauss and Newton).
    fn curvature(&self) -> Matrix {
        let mut curvature = [[0.0; MOST]; MOST];
        for (row, a) in curvature.iter_mut().zip(&self.jacobian) {
            row.iter_mut()
                .zip(&self.jacobian)
                .for_each(|(x, b)| *x = dot(a, b));
        }
        curvature
    }
}

impl Objective {
    /// Weights where the variances are taken to be `nu`.
    pub(crate) fn new(
        curve: &Curve,
        weighting: Weighting,
        nu: &[f64],
        components: Vec<Component>,
    ) -> Self {
        let roots = weighting.roots(curve, nu);
        let target: Vec<f64> = roots.iter().zip(&curve.wv).map(|(w, nu)| w * nu).collect();
        // The unit of the objective depends on the weighting; at unit length every tolerance is relative.
        let length = dot(&target, &target).sqrt();
        let target = target.iter().map(|b| b / length).collect();
        let has_quantization = components
            .iter()
            .any(|c| c.kind == ProcessKind::Quantization);
        let responses = || {
            curve
                .levels
                .iter()
                .map(|level| curve.response(*level).copied())
                .collect()
        };
        let quantization = (has_quantization && curve.quantization.is_some()).then(responses);
        Self {
            levels: curve.levels.clone(),
            roots,
            quantization,
            target,
            length,
            components,
        }
    }

    /// Returns true if the model is linear in its amplitudes.
    const fn is_linear(&self) -> bool {
        self.quantization.is_none()
    }

    /// The components that have a coordinate.
    fn shaped(&self) -> impl Iterator<Item = (usize, Range)> + '_ {
        self.components
            .iter()
            .enumerate()
            .filter_map(|(i, c)| Some((i, c.coordinate?)))
    }

    fn shape(&self, component: usize, u: f64) -> UnitVariance {
        let process = &self.components[component];
        let weighted = |(level, root): (&u32, &f64)| {
            let (value, slope) = process.shape(u, *level);
            (root * value, root * slope)
        };
        let (values, slopes) = self.levels.iter().zip(&self.roots).map(weighted).unzip();
        UnitVariance {
            component,
            values,
            slopes,
        }
    }

    /// The column of a shape where the curve responds so, level by level.
    fn column(&self, shape: &UnitVariance, responses: &[Response]) -> DesignColumn {
        let mut values = self.read(shape.component, &shape.values, responses);
        // Unit columns: the Gram matrix has a unit diagonal, and its condition is that of the shapes, not of
        // the units.
        let length = dot(&values, &values).sqrt();
        let scale = 1.0 / length;
        values.iter_mut().for_each(|v| *v *= scale);
        DesignColumn { values, length }
    }

    /// The variance that the curve shows of a component at each level.
    fn read(&self, component: usize, levels: &[f64], responses: &[Response]) -> Vec<f64> {
        let pairs = levels.iter().zip(responses);
        match self.components[component].kind {
            ProcessKind::Quantization => pairs.map(|(x, r)| x * r.quantization).collect(),
            _ => pairs.map(|(x, r)| x * r.others).collect(),
        }
    }

    /// Responses of a curve that reads quantization noise as it is: 1 at every level.
    fn plain_responses(&self) -> Vec<Response> {
        vec![Response::PLAIN; self.levels.len()]
    }

    /// Derivatives of the implied curve with respect to the wavelet variances of the components, level by
    /// level.
    fn responses(&self, shapes: &[&UnitVariance], amplitudes: &[f64]) -> Vec<Response> {
        let Some(quantization) = &self.quantization else {
            return self.plain_responses();
        };
        let at_level = |level: usize| {
            let (mut own, mut all) = (0.0, 0.0);
            for (shape, amplitude) in shapes.iter().zip(amplitudes) {
                let nu = amplitude * shape.values[level];
                all += nu;
                if self.components[shape.component].kind == ProcessKind::Quantization {
                    own += nu;
                }
            }
            match &quantization[level] {
                Some(response) if all > 0.0 => Response::new(response, (own / all).clamp(0.0, 1.0)),
                // Of nothing nothing is a part.
                _ => Response::PLAIN,
            }
        };
        (0..self.levels.len()).map(at_level).collect()
    }

    /// The best amplitudes for the coordinates given (one for each component that has one).
    pub(crate) fn solve(
        &self,
        coordinates: &[f64],
        near: Option<&LinearSolution>,
    ) -> LinearSolution {
        self.solve_to(FixedPointTolerance::WHOLE, coordinates, near)
    }

    /// `near`: a solution nearby, from which the shares of quantization noise settle sooner.
    fn solve_to(
        &self,
        settling: FixedPointTolerance,
        coordinates: &[f64],
        near: Option<&LinearSolution>,
    ) -> LinearSolution {
        let mut next = coordinates.iter();
        let mut coordinate_of = |c: &Component| {
            c.coordinate
                .and_then(|_| next.next())
                .copied()
                .unwrap_or(0.0)
        };
        let shapes: Vec<UnitVariance> = self
            .components
            .iter()
            .enumerate()
            .map(|(i, c)| self.shape(i, coordinate_of(c)))
            .collect();
        let shapes: Vec<&UnitVariance> = shapes.iter().collect();
        let best = self.best_amplitudes(&shapes, settling, near);
        let jacobian = self
            .shaped()
            .map(|(i, _)| self.tangent(&best, shapes[i], i))
            .collect();
        let amplitudes = self.amplitudes(&best.columns, &best.x);
        LinearSolution {
            amplitudes,
            residuals: best.residuals,
            jacobian,
            responses: best.responses,
            is_free: best.is_free,
        }
    }

    /// Σ residual² for shapes of all components, in their order; the shares of quantization noise are nearly settled.
    fn cost_near(&self, shapes: &[&UnitVariance]) -> f64 {
        let residuals = self
            .best_amplitudes(shapes, FixedPointTolerance::NEARLY, None)
            .residuals;
        dot(&residuals, &residuals)
    }

    /// The best amplitudes for shapes of all components, in their order.
    fn best_amplitudes(
        &self,
        shapes: &[&UnitVariance],
        settling: FixedPointTolerance,
        near: Option<&LinearSolution>,
    ) -> LinearBest {
        let (responses, is_free) = match near {
            Some(near) => (near.responses.clone(), near.is_free),
            None => (self.plain_responses(), [true; MOST]),
        };
        let mut best = self.linear_best(shapes, responses, is_free);
        for _ in 0..if self.is_linear() { 0 } else { settling.rounds } {
            let next = self.responses(shapes, &self.amplitudes(&best.columns, &best.x));
            let change = |(a, b): (&Response, &Response)| {
                (a.others - b.others)
                    .abs()
                    .max((a.quantization - b.quantization).abs())
            };
            let largest = next
                .iter()
                .zip(&best.responses)
                .map(change)
                .fold(0.0, f64::max);
            if largest < settling.change {
                break;
            }
            best = self.linear_best(shapes, next, best.is_free);
        }
        best
    }

    /// The best amplitudes where the curve responds so; `near`: those that are perhaps on no bound.
    fn linear_best(
        &self,
        shapes: &[&UnitVariance],
        responses: Vec<Response>,
        near: [bool; MOST],
    ) -> LinearBest {
        let columns: Vec<DesignColumn> = shapes
            .iter()
            .map(|shape| self.column(shape, &responses))
            .collect();
        let problem = self.linear_problem(&columns);
        let mut x = problem.minimise_near(near);
        // An amplitude on a bound does not follow the coordinates, so its column is left out of the
        // projection.
        let mut is_free = [false; MOST];
        (0..columns.len())
            .for_each(|i| is_free[i] = x[i] > problem.lower[i] && x[i] < problem.upper[i]);
        // One refinement with the residuals themselves: the normal equations know only half the digits.
        let mut residuals = self.residuals(&columns, &x);
        if let Some(change) = project(&columns, &is_free, &problem.gram, &residuals) {
            let mut refined = x;
            refined.iter_mut().zip(change).for_each(|(x, d)| *x += d);
            let is_inside = |i: usize| !is_free[i] || refined[i] > 0.0;
            if (0..columns.len()).all(is_inside) {
                x = refined;
                residuals = self.residuals(&columns, &x);
            }
        }
        LinearBest {
            responses,
            columns,
            gram: problem.gram,
            x,
            is_free,
            residuals,
        }
    }

    /// −amplitude × the part of the slope of the i-th column that the active columns cannot follow.
    fn tangent(&self, best: &LinearBest, shape: &UnitVariance, i: usize) -> Vec<f64> {
        let slopes = self.read(i, &shape.slopes, &best.responses);
        // d(residual)/du with the amplitudes fixed, less its part within the columns, which the amplitudes take
        // up.
        let (amplitude, length) = (best.x[i], best.columns[i].length);
        let mut tangent: Vec<f64> = slopes.iter().map(|s| -amplitude * (s / length)).collect();
        if let Some(part) = project(&best.columns, &best.is_free, &best.gram, &tangent) {
            for (column, p) in best.columns.iter().zip(part) {
                tangent
                    .iter_mut()
                    .zip(&column.values)
                    .for_each(|(t, v)| *t -= p * v);
            }
        }
        tangent
    }

    /// Amplitudes in the parameters' units.
    fn amplitudes(&self, columns: &[DesignColumn], x: &Vector) -> Vec<f64> {
        x.iter()
            .zip(columns)
            .map(|(x, c)| x * self.length / c.length)
            .collect()
    }

    fn linear_problem(&self, columns: &[DesignColumn]) -> BoundedStep {
        let mut problem = BoundedStep::new(columns.len());
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                problem.gram[i][j] = dot(&a.values, &b.values);
                problem.gram[j][i] = problem.gram[i][j];
            }
            problem.right[i] = dot(&a.values, &self.target);
        }
        problem
    }

    fn residuals(&self, columns: &[DesignColumn], x: &Vector) -> Vec<f64> {
        let mut residuals = self.target.clone();
        for (column, amplitude) in columns.iter().zip(x) {
            residuals
                .iter_mut()
                .zip(&column.values)
                .for_each(|(r, v)| *r -= amplitude * v);
        }
        residuals
    }
}

/// Coefficients of the projection of `vector` on the free columns, 0 of the others; none if these depend on one another.
fn project(
    columns: &[DesignColumn],
    is_free: &[bool; MOST],
    gram: &Matrix,
    vector: &[f64],
) -> Option<Vector> {
    let (mut free, mut right, mut n) = ([0; MOST], [0.0; MOST], 0);
    for (i, column) in columns.iter().enumerate().filter(|(i, _)| is_free[*i]) {
        (free[n], right[n]) = (i, dot(&column.values, vector));
        n += 1;
    }
    let solution = cholesky_solve(|a, b| gram[free[a]][free[b]], right, n)?;
    let mut part = [0.0; MOST];
    (0..n).for_each(|k| part[free[k]] = solution[k]);
    Some(part)
}

/// In four sums, which do not wait for one another.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (chunks, others) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest = chunks.remainder().iter().zip(others.remainder());
    let mut sums = [0.0; 4];
    for (x, y) in chunks.clone().zip(others.clone()) {
        (0..4).for_each(|i| sums[i] += x[i] * y[i]);
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest.map(|(x, y)| x * y).sum::<f64>()
}

// Damped Newton steps on the coordinates, the amplitudes following (variable projection).
//
// The gradient is analytic. The first steps have Gauss and Newton's approximation of the curvature, which would creep to the
// minimum where no model fits well; the last ones the difference of gradients where that is positive definite.

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
    }, in files
);

/// Local minimum to which a start led.
pub(crate) struct LocalMinimum {
    pub(crate) coordinates: Vec<f64>,
    /// Σ residual², in units of the target's length.
    pub(crate) cost: f64,
    pub(crate) termination: Termination,
}

/// Tolerance of a descent.
struct Precision {
    /// Gain of the last step, in parts of the cost.
    enough: fn(f64) -> f64,
    settling: FixedPointTolerance,
    /// True if the curvature is the difference of gradients.
    is_newton: bool,
}

impl Precision {
    /// Within a tenth of a standard deviation of most curves.
    const ROUGH: Self = Self {
        enough: |cost| 1e-3 * cost,
        settling: FixedPointTolerance::OF_COST,
        is_newton: false,
    };
    /// Within 1e-4 of a standard deviation.
    const FINE: Self = Self {
        enough: |cost| 1e-9 * cost,
        ..Self::ROUGH
    };
    /// To rounding.
    const EXACT: Self = Self {
        enough: |cost| 1e-15 * cost,
        settling: FixedPointTolerance::WHOLE,
        is_newton: true,
    };
}

/// Descends from a start to the local minimum.
fn descend(objective: &Objective, start: &[f64], precision: &Precision) -> LocalMinimum {
    let ranges: Vec<(f64, f64)> = objective.shaped().map(|(_, r)| (r.low, r.high)).collect();
    let descent = Descent {
        ranges: &ranges,
        damping: 1e-6,
        enough: precision.enough,
    };
    let last: RefCell<Option<LinearSolution>> = RefCell::new(None);
    let found = descent.minimum(
        start,
        |u| {
            let solution = objective.solve_to(precision.settling, u, last.borrow().as_ref());
            last.replace(Some(solution.clone()));
            solution
        },
        LinearSolution::cost,
        |u, at| {
            let gradient = (0..u.len()).map(|i| at.gradient(i)).collect();
            let newton = precision.is_newton.then(|| curvature(objective, u, at));
            (gradient, newton.flatten().unwrap_or_else(|| at.curvature()))
        },
    );
    LocalMinimum {
        cost: found.value.cost(),
        termination: if found.has_converged {
            Termination::Converged
        } else {
            Termination::IterationLimit
        },
        coordinates: found.at,
    }
}

/// Step h of the central differences (natural logarithms of a correlation time, or theta): their error h² and
/// the rounding of the gradients over h are both of the order 1e-10.
const DIFFERENCE: f64 = 1e-5;

/// Half the second derivatives of the cost; none where they are not positive definite.
fn curvature(objective: &Objective, u: &[f64], at: &LinearSolution) -> Option<Matrix> {
    let n = u.len();
    let mut hessian = [[0.0; MOST]; MOST];
    for j in 0..n {
        let gradients = |sign: f64| {
            let mut there = u.to_vec();
            there[j] += sign * DIFFERENCE;
            let solution = objective.solve(&there, Some(at));
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
    cholesky_solve(|i, j| hessian[i][j], [0.0; MOST], n).map(|_| hessian)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Weighting;
    use crate::curve::implied;
    use crate::noise::{Composite, Process, ProcessKind};
    use crate::tests::exact;
    use crate::wavelet::{Curve, Tuning};

    /// White noise, a random walk and two AR1 to be fitted to a curve that is 10 % off at every scale.
    fn objective() -> Objective {
        let model = Composite::new(vec![
            Process::white(1.0).unwrap(),
            Process::random_walk(1e-7).unwrap(),
            Process::ar1(0.9, 1e-2).unwrap(),
            Process::ar1(0.999, 1e-5).unwrap(),
        ]);
        let mut curve = exact(&model, 12, |_| 50.0);
        for pair in curve.wv.chunks_exact_mut(2) {
            (pair[0], pair[1]) = (0.9 * pair[0], 1.1 * pair[1]);
        }
        let component = |process: &Process| Component {
            kind: process.kind(),
            coordinate: (process.kind() == ProcessKind::Ar1).then_some(Range {
                low: -10.0,
                high: 1.0,
            }),
        };
        let components = model.processes.iter().map(component).collect();
        Objective::new(&curve, Weighting::Edof, &curve.wv, components)
    }

    /// What the best amplitudes leave, and how that changes with a correlation time, has no part that an amplitude could take.
    #[test]
    fn residuals_and_their_derivatives_are_orthogonal_to_the_columns() {
        let objective = objective();
        let at = [-2.5, -6.5];
        let solution = objective.solve(&at, None);
        let plain = objective.plain_responses();
        assert!(
            solution.amplitudes.iter().all(|a| *a > 0.0),
            "{:?}",
            solution.amplitudes
        );
        for (component, u) in [(0, 0.0), (1, 0.0), (2, at[0]), (3, at[1])] {
            let column = objective
                .column(&objective.shape(component, u), &plain)
                .values;
            // rounding of the twelve products of numbers below 1, and of derivatives that are projected once
            assert!(dot(&solution.residuals, &column).abs() < 1e-14);
            assert!(
                solution
                    .jacobian
                    .iter()
                    .all(|tangent| dot(tangent, &column).abs() < 1e-12)
            );
        }
        assert!(
            solution.cost() > 1e-4 && solution.jacobian.iter().all(|t| dot(t, t) > 1e-9),
            "{solution:?}"
        );
    }

    /// By inner products that are shared, and by the amplitudes of each point: the same cost.
    #[test]
    fn the_grid_has_the_cost_of_each_point() {
        let objective = objective();
        let dimensions: Vec<(usize, Range)> = objective.shaped().collect();
        let grid = Grid::new(&objective, &dimensions, 60, None);
        let choices = grid.choices();
        assert_eq!((grid.points[0].len(), choices.len()), (11, 55));
        let mut costs = Vec::new();
        for choice in &choices {
            let at: Vec<f64> = choice
                .iter()
                .zip(&grid.points)
                .map(|(i, points)| points[*i])
                .collect();
            costs.push(objective.solve(&at, None).cost());
            let (found, exact) = (grid.cost(choice), costs[costs.len() - 1]);
            // 1 − 2rᵀx + xᵀGx cancels
            assert!(
                (found - exact).abs() < 1e-10,
                "{choice:?}: {found:e} {exact:e}"
            );
        }
        // it starts where no neighbour is lower
        let is_near = |a: &[usize], b: &[usize]| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1);
        let lowest = |k: usize| {
            (0..costs.len()).all(|n| !is_near(&choices[k], &choices[n]) || costs[k] <= costs[n])
        };
        let mut minima: Vec<f64> = (0..costs.len())
            .filter(|k| lowest(*k))
            .map(|k| costs[k])
            .collect();
        minima.sort_by(f64::total_cmp);
        let starts = grid.starts(&choices, 55);
        let started: Vec<f64> = starts
            .iter()
            .map(|at| objective.solve(at, None).cost())
            .collect();
        assert_eq!(started, minima);
    }

    /// A robust curve as a model implies it: its amplitudes come back, however much quantization noise there is.
    #[test]
    fn amplitudes_of_a_robust_curve_come_back() {
        for q2 in [0.01, 1.0, 100.0] {
            let model = Composite::new(vec![
                Process::white(1.0).unwrap(),
                Process::quantization(q2).unwrap(),
            ]);
            let quantization = Some(*Tuning::default().quantization());
            let mut curve = Curve {
                quantization,
                ..exact(&model, 12, |_| 50.0)
            };
            curve.wv = implied(&model, &curve);
            let component = |p: &Process| Component {
                kind: p.kind(),
                coordinate: None,
            };
            let components = model.processes.iter().map(component).collect();
            let objective = Objective::new(&curve, Weighting::Edof, &curve.wv, components);
            let solution = objective.solve(&[], None);
            let [white, quantized] = solution.amplitudes[..] else {
                panic!("{solution:?}")
            };
            assert!(
                (white - 1.0).abs() < 1e-9 && (quantized / q2 - 1.0).abs() < 1e-9,
                "{q2}: {solution:?}"
            );
        }
    }

    /// Pairs 110·109/2 = 5995 of 6000, triples 34·33·32/6 = 5984, quadruples 21·20·19·18/24 = 5985.
    #[test]
    fn the_grid_has_as_many_points_as_it_may() {
        let points = [1, 2, 3, 4].map(|dimensions| points_per_dimension(dimensions, 6000));
        assert_eq!(points, [POINTS, 110, 34, 21]);
        assert_eq!(points_per_dimension(5, 2), 6);
        let spread = |low, high| spread(Range { low, high }, 5);
        assert_eq!(spread(-1.0, 1.0), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(spread(2.0, 2.0), [2.0]);
    }
}
