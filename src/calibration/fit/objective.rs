//! The distance between a curve and a model: Σ Omega_j (nu_j − nu_j(theta))²
//! ([Guerrier](crate::bibliography::Guerrier13), eq. 6).
//!
//! Every process contributes an amplitude times a shape, so with the shapes fixed the model is linear. Not quite so for
//! robust variances, which read quantization noise high by a factor of its share ([`crate::curve::implied()`]): there the linear
//! problem is solved for the derivatives at the last solution until the shares settle. The implied curve is homogeneous in
//! the amplitudes, so that its linear expansion at a solution has no constant, and where the shares have settled the
//! conditions of the linear problem are those of the true one.

use super::bounded::{Bounded, MOST, Matrix, Vector, cholesky_solve};
use super::weighting::Weighting;
use crate::curve::implied::Response;
use crate::noise::{
    Ar1, Drift, FlickerNoise, GaussMarkov, Kind, Ma1, Quantization, RandomWalk, White,
};
use crate::wavelet::{Curve, QuantizationResponse};

/// Range of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// One process of the model that is fitted. Its amplitude is the parameter in which its wavelet variance is
/// linear: sigma2, q2, gamma2, s2 or slope². Its coordinate says its shape: ln κ (κ = −ln phi or beta/f)
/// for AR1 and GM, theta for MA1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Component {
    pub(crate) kind: Kind,
    pub(crate) coordinate: Option<Range>,
}

impl Component {
    /// Wavelet variance per unit of amplitude and its derivative with respect to the coordinate.
    pub(crate) fn shape(&self, u: f64, level: u32) -> (f64, f64) {
        match self.kind {
            Kind::White => (White::haar_shape(level), 0.0),
            Kind::Quantization => (Quantization::haar_shape(level), 0.0),
            Kind::Flicker => (FlickerNoise::haar_shape(level), 0.0),
            Kind::RandomWalk => (RandomWalk::haar_shape(level), 0.0),
            Kind::Drift => (Drift::haar_shape(level), 0.0),
            Kind::Ar1 => of_log(u, |kappa| Ar1::haar_shape_of_kappa(kappa, level)),
            Kind::GaussMarkov => of_log(u, |kappa| GaussMarkov::haar_shape(kappa, level)),
            Kind::Ma1 => Ma1::haar_shape(u, level),
        }
    }
}

fn of_log(u: f64, shape: impl Fn(f64) -> (f64, f64)) -> (f64, f64) {
    let kappa = u.exp();
    let (value, derivative) = shape(kappa);
    (value, derivative * kappa)
}

/// Wavelet variance of a component per unit of its amplitude, at all levels.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    pub(crate) component: usize,
    values: Vec<f64>,
    /// Derivative with respect to the coordinate.
    slopes: Vec<f64>,
}

/// A column of the linear problem, at unit length.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    pub(crate) values: Vec<f64>,
    /// The length taken out.
    pub(crate) length: f64,
}

/// Solution of the linear problem: amplitudes where the shapes are given.
struct LinearBest {
    responses: Vec<Response>,
    columns: Vec<Column>,
    gram: Matrix,
    /// Amplitudes, in units of their columns' lengths.
    x: Vector,
    /// Those on no bound.
    active: Vec<usize>,
    residuals: Vec<f64>,
}

/// Rounds at most until the shares of quantization noise have settled; each takes off two digits or so.
const SETTLED: usize = 16;
/// Changes of the response that are rounding.
const SETTLED_CHANGE: f64 = 1e-13;
/// Rounds that tell which of the grid's combinations are near.
const NEARLY_SETTLED: usize = 3;

/// The least-squares problem: weighted curve, in units of its length.
#[derive(Debug, Clone)]
pub(crate) struct Objective {
    levels: Vec<u32>,
    roots: Vec<f64>,
    /// Response of a robust curve to quantization noise, level by level, where the model has some; none: as it is.
    quantization: Option<Vec<Option<QuantizationResponse>>>,
    pub(crate) target: Vec<f64>,
    pub(crate) length: f64,
    pub(crate) components: Vec<Component>,
}

/// The best amplitudes for given coordinates.
#[derive(Debug, Clone)]
pub(crate) struct Solution {
    /// Amplitudes, in the parameters' units.
    pub(crate) amplitudes: Vec<f64>,
    /// target − model, in units of the target's length.
    pub(crate) residuals: Vec<f64>,
    /// Derivative of the residuals with respect to each coordinate, the amplitudes following: Kaufman's
    /// approximation. In the order of the components that have a coordinate.
    pub(crate) jacobian: Vec<Vec<f64>>,
}

impl Solution {
    /// Σ residual².
    pub(crate) fn cost(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }

    /// Half its derivative with respect to a coordinate. Exact: at the best amplitudes their own
    /// derivatives do not matter.
    pub(crate) fn gradient(&self, coordinate: usize) -> f64 {
        dot(&self.jacobian[coordinate], &self.residuals)
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
        let has_quantization = components.iter().any(|c| c.kind == Kind::Quantization);
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

    /// Whether the model is linear in its amplitudes.
    pub(crate) const fn is_linear(&self) -> bool {
        self.quantization.is_none()
    }

    /// The components that have a coordinate.
    pub(crate) fn shaped(&self) -> impl Iterator<Item = (usize, Range)> + '_ {
        self.components
            .iter()
            .enumerate()
            .filter_map(|(i, c)| Some((i, c.coordinate?)))
    }

    pub(crate) fn shape(&self, component: usize, u: f64) -> Shape {
        let process = &self.components[component];
        let (values, slopes) = self
            .levels
            .iter()
            .map(|level| process.shape(u, *level))
            .unzip();
        Shape {
            component,
            values,
            slopes,
        }
    }

    /// The column of a shape where the curve responds so, level by level.
    pub(crate) fn column(&self, shape: &Shape, responses: &[Response]) -> Column {
        let mut values = self.weighted(shape.component, &shape.values, responses);
        // Unit columns: the Gram matrix has a unit diagonal, and its condition is that of the shapes, not of
        // the units.
        let length = dot(&values, &values).sqrt();
        values.iter_mut().for_each(|v| *v /= length);
        Column { values, length }
    }

    /// What a component has at each level, in the weights of the curve.
    fn weighted(&self, component: usize, levels: &[f64], responses: &[Response]) -> Vec<f64> {
        let is_quantization = self.components[component].kind == Kind::Quantization;
        let weights = self.roots.iter().zip(responses).map(|(root, response)| {
            root * if is_quantization {
                response.quantization
            } else {
                response.others
            }
        });
        levels
            .iter()
            .zip(weights)
            .map(|(value, weight)| value * weight)
            .collect()
    }

    /// Responses of a curve that reads quantization noise as it is: 1 at every level.
    pub(crate) fn plain_responses(&self) -> Vec<Response> {
        vec![Response::PLAIN; self.levels.len()]
    }

    /// Derivatives of the implied curve with respect to the wavelet variances of the components, level by
    /// level.
    fn responses(&self, shapes: &[&Shape], amplitudes: &[f64]) -> Vec<Response> {
        let Some(quantization) = &self.quantization else {
            return self.plain_responses();
        };
        let at_level = |level: usize| {
            let (mut own, mut all) = (0.0, 0.0);
            for (shape, amplitude) in shapes.iter().zip(amplitudes) {
                let nu = amplitude * shape.values[level];
                all += nu;
                if self.components[shape.component].kind == Kind::Quantization {
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
    pub(crate) fn solve(&self, coordinates: &[f64]) -> Solution {
        let mut next = coordinates.iter();
        let mut coordinate_of = |c: &Component| {
            c.coordinate
                .and_then(|_| next.next())
                .copied()
                .unwrap_or(0.0)
        };
        let shapes: Vec<Shape> = self
            .components
            .iter()
            .enumerate()
            .map(|(i, c)| self.shape(i, coordinate_of(c)))
            .collect();
        let shapes: Vec<&Shape> = shapes.iter().collect();
        let best = self.best_amplitudes(&shapes, SETTLED);
        let jacobian = self
            .shaped()
            .map(|(i, _)| self.tangent(&best, shapes[i], i))
            .collect();
        let amplitudes = self.amplitudes(&best.columns, &best.x);
        Solution {
            amplitudes,
            residuals: best.residuals,
            jacobian,
        }
    }

    /// Σ residual² for shapes of all components, in their order; the shares of quantization noise are nearly settled.
    pub(crate) fn cost_near(&self, shapes: &[&Shape]) -> f64 {
        let residuals = self.best_amplitudes(shapes, NEARLY_SETTLED).residuals;
        dot(&residuals, &residuals)
    }

    /// The best amplitudes for shapes of all components, in their order, after so many rounds at most.
    fn best_amplitudes(&self, shapes: &[&Shape], rounds: usize) -> LinearBest {
        let mut best = self.linear_best(shapes, self.plain_responses());
        for _ in 0..if self.is_linear() { 0 } else { rounds } {
            let next = self.responses(shapes, &self.amplitudes(&best.columns, &best.x));
            let change = |(a, b): (&Response, &Response)| {
                (a.others - b.others)
                    .abs()
                    .max((a.quantization - b.quantization).abs())
            };
            if next
                .iter()
                .zip(&best.responses)
                .map(change)
                .fold(0.0, f64::max)
                < SETTLED_CHANGE
            {
                break;
            }
            best = self.linear_best(shapes, next);
        }
        best
    }

    /// The best amplitudes where the curve responds so.
    fn linear_best(&self, shapes: &[&Shape], responses: Vec<Response>) -> LinearBest {
        let columns: Vec<Column> = shapes
            .iter()
            .map(|shape| self.column(shape, &responses))
            .collect();
        let problem = self.linear_problem(&columns);
        let mut x = problem.minimise();
        // An amplitude on a bound does not follow the coordinates, so its column is left out of the
        // projection.
        let free = |x: &Vector, i: usize| x[i] > problem.lower[i] && x[i] < problem.upper[i];
        let active: Vec<usize> = (0..columns.len()).filter(|i| free(&x, *i)).collect();
        // One refinement with the residuals themselves: the normal equations know only half the digits.
        let mut residuals = self.residuals(&columns, &x);
        if let Some(change) = project(&columns, &active, &problem.gram, &residuals) {
            let mut refined = x;
            active
                .iter()
                .zip(change)
                .for_each(|(i, d)| refined[*i] += d);
            if active.iter().all(|i| free(&refined, *i)) {
                x = refined;
                residuals = self.residuals(&columns, &x);
            }
        }
        LinearBest {
            responses,
            columns,
            gram: problem.gram,
            x,
            active,
            residuals,
        }
    }

    /// −amplitude × the part of the slope of the i-th column that the active columns cannot follow.
    fn tangent(&self, best: &LinearBest, shape: &Shape, i: usize) -> Vec<f64> {
        let slopes = self.weighted(i, &shape.slopes, &best.responses);
        // d(residual)/du with the amplitudes fixed, less its part within the columns, which the amplitudes take
        // up.
        let (amplitude, length) = (best.x[i], best.columns[i].length);
        let mut tangent: Vec<f64> = slopes.iter().map(|s| -amplitude * (s / length)).collect();
        if let Some(part) = project(&best.columns, &best.active, &best.gram, &tangent) {
            for (&a, p) in best.active.iter().zip(part) {
                tangent
                    .iter_mut()
                    .zip(&best.columns[a].values)
                    .for_each(|(t, v)| *t -= p * v);
            }
        }
        tangent
    }

    /// Amplitudes in the parameters' units.
    fn amplitudes(&self, columns: &[Column], x: &Vector) -> Vec<f64> {
        x.iter()
            .zip(columns)
            .map(|(x, c)| x * self.length / c.length)
            .collect()
    }

    fn linear_problem(&self, columns: &[Column]) -> Bounded {
        let mut problem = Bounded::new(columns.len());
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                problem.gram[i][j] = dot(&a.values, &b.values);
                problem.gram[j][i] = problem.gram[i][j];
            }
            problem.right[i] = dot(&a.values, &self.target);
        }
        problem
    }

    fn residuals(&self, columns: &[Column], x: &Vector) -> Vec<f64> {
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

/// Coefficients of the projection of `vector` on the active columns; none if these depend on one another.
fn project(
    columns: &[Column],
    active: &[usize],
    gram: &Matrix,
    vector: &[f64],
) -> Option<Vec<f64>> {
    let mut right = [0.0; MOST];
    for (r, &i) in right.iter_mut().zip(active) {
        *r = dot(&columns[i].values, vector);
    }
    let n = active.len();
    let solution = cholesky_solve(|a, b| gram[active[a]][active[b]], right, n)?;
    Some(solution[..n].to_vec())
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
