//! The global minimum: all combinations of a grid of shapes, each with its best amplitudes, then a descent
//! from every local minimum of the grid.
//!
//! With the shapes fixed the problem is linear with non-negative amplitudes, so nothing can be missed but
//! between grid points, and the objective is smooth there: over the correlation times of 15 scales neighbours differ by 10 %
//! with one of them in the model, by 15 % with two, by 60 % with three and by a factor of 2 with four.

use super::bounded::{Bounded, MOST};
use super::objective::{Column, Objective, Range, Shape, dot};
use super::optimise::{End, Termination, descend};
use rayon::prelude::*;

/// Largest number of points in one dimension.
const POINTS: usize = 160;

/// Effort of a search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Limit of the number of combinations of the grid, where its dimensions are alike; 0: no grid where minima are known.
    combinations: usize,
    /// Largest number of local minima of the grid from which a descent starts.
    starts: usize,
}

impl Effort {
    /// For a curve of which nothing is known.
    pub(crate) const WHOLE: Self = Self {
        combinations: 6000,
        starts: 16,
    };
    /// For a curve that resembles one already fitted: its minima are known, and another is seldom far from the grid's best.
    pub(crate) const AGAIN: Self = Self {
        combinations: 300,
        starts: 2,
    };
    /// Descents from the known minima only.
    pub(crate) const WITHIN: Self = Self {
        combinations: 0,
        starts: 1,
    };
}

/// Result of the search.
#[derive(Debug)]
pub(crate) struct Found {
    /// The ends of all starts, best first; one at least.
    pub(crate) ends: Vec<End>,
    /// Combinations of shapes that were tried.
    pub(crate) combinations: usize,
}

/// Searches all coordinates, on a grid and from the `known` minima of a similar curve.
pub(crate) fn search(objective: &Objective, effort: Effort, known: &[Vec<f64>]) -> Found {
    let dimensions: Vec<(usize, Range)> = objective.shaped().collect();
    if dimensions.is_empty() {
        let cost = objective.solve(&[]).cost();
        let end = End {
            coordinates: Vec::new(),
            cost,
            termination: Termination::Linear,
        };
        return Found {
            ends: vec![end],
            combinations: 1,
        };
    }
    let mut starts = known.to_vec();
    let mut tried = 0;
    if effort.combinations > 0 || known.is_empty() {
        let grid = Grid::new(objective, &dimensions, effort.combinations);
        let choices = grid.choices();
        tried = choices.len();
        // The grid first: of ends with the same cost the sort keeps that order, whatever is known.
        starts.splice(0..0, grid.starts(&choices, effort.starts));
    }
    let mut ends: Vec<End> = starts
        .par_iter()
        .map(|start| descend(objective, start))
        .collect();
    ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    Found {
        ends,
        combinations: tried,
    }
}

/// The grid: for each dimension its points and their columns; the inner products of all columns.
struct Grid<'a> {
    objective: &'a Objective,
    points: Vec<Vec<f64>>,
    /// Whether a dimension is alike the one before it, so that only ascending pairs are needed.
    repeats: Vec<bool>,
    /// Shapes of the components without a coordinate, then those of the points of each dimension.
    shapes: Vec<Shape>,
    /// Their columns.
    columns: Vec<Column>,
    gram: Vec<f64>,
    right: Vec<f64>,
}

impl<'a> Grid<'a> {
    fn new(objective: &'a Objective, dimensions: &[(usize, Range)], combinations: usize) -> Self {
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
        let mut shapes: Vec<Shape> = fixed.map(|i| objective.shape(i, 0.0)).collect();
        for ((owner, _), points) in dimensions.iter().zip(&points) {
            shapes.extend(points.iter().map(|u| objective.shape(*owner, *u)));
        }
        let plain = objective.plain_responses();
        let columns: Vec<Column> = shapes
            .iter()
            .map(|shape| objective.column(shape, &plain))
            .collect();
        let n = columns.len();
        let gram = (0..n * n)
            .map(|k| dot(&columns[k / n].values, &columns[k % n].values))
            .collect();
        let right = columns
            .iter()
            .map(|c| dot(&c.values, &objective.target))
            .collect();
        Self {
            objective,
            points,
            repeats,
            shapes,
            columns,
            gram,
            right,
        }
    }

    /// Least Σ residual² for a choice of points, one for each dimension.
    fn cost(&self, choice: &[usize]) -> f64 {
        let mut selected = [0; MOST];
        let fixed = self.columns.len() - self.points.iter().map(Vec::len).sum::<usize>();
        let mut n = fixed;
        (0..fixed).for_each(|i| selected[i] = i);
        let mut offset = fixed;
        for (index, points) in choice.iter().zip(&self.points) {
            selected[n] = offset + index;
            offset += points.len();
            n += 1;
        }
        if !self.objective.is_linear() {
            let mut shapes: Vec<&Shape> = selected[..n].iter().map(|i| &self.shapes[*i]).collect();
            // The amplitudes and their bounds are in the order of the components.
            shapes.sort_unstable_by_key(|shape| shape.component);
            return self.objective.cost_near(&shapes);
        }
        let mut problem = Bounded::new(n);
        for a in 0..n {
            let i = selected[a];
            for b in 0..n {
                problem.gram[a][b] = self.gram[i * self.columns.len() + selected[b]];
            }
            problem.right[a] = self.right[i];
        }
        let x = problem.minimise();
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

/// As many points as leave the number of combinations of alike dimensions at `most`, at least one more than there are
/// dimensions. Unlike dimensions (an AR1 and an MA1) have up to k! times as many combinations.
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

#[cfg(test)]
mod tests {
    use super::super::objective::Component;
    use super::super::weighting::Weighting;
    use super::*;
    use crate::curve::implied;
    use crate::noise::{Ar1, Composite, Kind, Process, Quantization, RandomWalk, White};
    use crate::wavelet::{Curve, Tuning};

    /// White noise, a random walk and two AR1 to be fitted to a curve that is 10 % off at every scale.
    fn objective() -> Objective {
        let model = Composite::new(vec![
            Process::White(White::new(1.0).unwrap()),
            Process::RandomWalk(RandomWalk::new(1e-7).unwrap()),
            Process::Ar1(Ar1::new(0.9, 1e-2).unwrap()),
            Process::Ar1(Ar1::new(0.999, 1e-5).unwrap()),
        ]);
        let levels: Vec<u32> = (1..=12).collect();
        let off =
            |level: &u32| model.haar_wv(*level) * if level.is_multiple_of(2) { 1.1 } else { 0.9 };
        let curve = Curve {
            wv: levels.iter().map(off).collect(),
            edof: vec![50.0; 12],
            levels: levels.clone(),
            ..Curve::default()
        };
        let component = |process: &Process| Component {
            kind: process.kind(),
            coordinate: (process.kind() == Kind::Ar1).then_some(Range {
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
        let solution = objective.solve(&at);
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
        let grid = Grid::new(&objective, &dimensions, 60);
        let choices = grid.choices();
        assert_eq!((grid.points[0].len(), choices.len()), (11, 55));
        let mut costs = Vec::new();
        for choice in &choices {
            let at: Vec<f64> = choice
                .iter()
                .zip(&grid.points)
                .map(|(i, points)| points[*i])
                .collect();
            costs.push(objective.solve(&at).cost());
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
        let started: Vec<f64> = grid
            .starts(&choices, 55)
            .iter()
            .map(|at| objective.solve(at).cost())
            .collect();
        assert_eq!(started, minima);
    }

    /// A robust curve as a model implies it: its amplitudes come back, however much quantization noise there is.
    #[test]
    fn amplitudes_of_a_robust_curve_come_back() {
        for q2 in [0.01, 1.0, 100.0] {
            let model = Composite::new(vec![
                Process::White(White::new(1.0).unwrap()),
                Process::Quantization(Quantization::new(q2).unwrap()),
            ]);
            let quantization = Some(*Tuning::default().quantization());
            let levels: Vec<u32> = (1..=12).collect();
            let curve = Curve {
                edof: vec![50.0; 12],
                levels,
                quantization,
                ..Curve::default()
            };
            let curve = Curve {
                wv: implied(&model, &curve),
                ..curve
            };
            let component = |p: &Process| Component {
                kind: p.kind(),
                coordinate: None,
            };
            let components = model.processes.iter().map(component).collect();
            let objective = Objective::new(&curve, Weighting::Edof, &curve.wv, components);
            let solution = objective.solve(&[]);
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
        assert_eq!(
            spread(
                Range {
                    low: -1.0,
                    high: 1.0
                },
                5
            ),
            [-1.0, -0.5, 0.0, 0.5, 1.0]
        );
        assert_eq!(
            spread(
                Range {
                    low: 2.0,
                    high: 2.0
                },
                5
            ),
            [2.0]
        );
    }
}
