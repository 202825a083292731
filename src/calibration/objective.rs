//! The distance between a curve and a model: Σ Omega_j (nu_j − nu_j(theta))²
//! ([Guerrier](crate::bibliography::Guerrier13), eq. 6).
//!
//! Every process contributes an amplitude times a shape, so with the shapes fixed the model is linear.

use super::bounded::{Bounded, MOST, Matrix, Vector, cholesky_solve};
use super::spec::Kind;
use crate::noise::{Ar1, Drift, GaussMarkov, Ma1, Quantization, RandomWalk, White};
use crate::wavelet::{Curve, interval};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Omega: what a scale counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Weighting {
    /// edof/(2 nu²), the inverse variance of nu_hat.
    Edof,
    /// 1/(width of the 95 % interval)².
    Interval,
    /// 1 for every scale.
    None,
    /// The inverse of the covariance of nu_hat over all scales.
    Full,
}

impl Weighting {
    /// √Omega_j of each scale (1/units²).
    pub(super) fn roots(self, curve: &Curve) -> Vec<f64> {
        let root = |(nu, edof): (&f64, &f64)| match self {
            Self::Edof | Self::Full => (0.5 * edof).sqrt() / nu,
            Self::Interval => {
                let (low, high) = interval::interval(*nu, *edof, 0.95);
                1.0 / (high - low)
            }
            Self::None => 1.0,
        };
        curve.wv.iter().zip(&curve.edof).map(root).collect()
    }
}

/// Range of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub(super) low: f64,
    pub(super) high: f64,
}

/// One process of the model that is fitted. Its amplitude is the parameter in which its wavelet variance is
/// linear: sigma2, q2, gamma2, s2 or slope². Its coordinate says its shape: ln κ (κ = −ln phi or beta/f)
/// for AR1 and GM, theta for MA1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Component {
    pub(super) kind: Kind,
    pub(super) amplitude: Range,
    pub(super) coordinate: Option<Range>,
}

impl Component {
    /// Wavelet variance per unit of amplitude and its derivative with respect to the coordinate.
    pub(super) fn shape(&self, u: f64, level: u32) -> (f64, f64) {
        match self.kind {
            Kind::White => (White::haar_shape(level), 0.0),
            Kind::Quantization => (Quantization::haar_shape(level), 0.0),
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

/// A column of the linear problem, at unit length.
#[derive(Debug, Clone)]
pub(super) struct Column {
    pub(super) values: Vec<f64>,
    /// Derivative with respect to the coordinate, divided by the same length.
    pub(super) slopes: Vec<f64>,
    /// The length taken out.
    pub(super) length: f64,
}

/// The least-squares problem: weighted curve, in units of its length.
#[derive(Debug, Clone)]
pub(super) struct Objective {
    levels: Vec<u32>,
    roots: Vec<f64>,
    /// What mixes the scales so that their errors are uncorrelated, once they are relative to the curve.
    mixing: Option<Arc<DMatrix<f64>>>,
    pub(super) target: Vec<f64>,
    pub(super) length: f64,
    pub(super) components: Vec<Component>,
}

/// The best amplitudes for given coordinates.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    /// Amplitudes, in the parameters' units.
    pub(super) amplitudes: Vec<f64>,
    /// target − model, in units of the target's length.
    pub(super) residuals: Vec<f64>,
    /// Derivative of the residuals with respect to each coordinate, the amplitudes following: Kaufman's
    /// approximation. In the order of the components that have a coordinate.
    pub(super) jacobian: Vec<Vec<f64>>,
}

impl Solution {
    /// Σ residual².
    pub(super) fn cost(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }

    /// Half its derivative with respect to a coordinate. Exact: at the best amplitudes their own
    /// derivatives do not matter.
    pub(super) fn gradient(&self, coordinate: usize) -> f64 {
        dot(&self.jacobian[coordinate], &self.residuals)
    }
}

impl Objective {
    /// With a mixing matrix it is applied to nu_j(theta)/nu_j, and the weighting does not matter.
    pub(super) fn new(
        curve: &Curve,
        weighting: Weighting,
        mixing: Option<Arc<DMatrix<f64>>>,
        components: Vec<Component>,
    ) -> Self {
        let roots = match mixing {
            Some(_) => curve.wv.iter().map(|nu| 1.0 / nu).collect(),
            None => weighting.roots(curve),
        };
        let target: Vec<f64> = roots.iter().zip(&curve.wv).map(|(w, nu)| w * nu).collect();
        let target = mixed(mixing.as_deref(), target);
        let length = dot(&target, &target).sqrt();
        let target = target.iter().map(|b| b / length).collect();
        Self { levels: curve.levels.clone(), roots, mixing, target, length, components }
    }

    /// The components that have a coordinate.
    pub(super) fn shaped(&self) -> impl Iterator<Item = (usize, Range)> + '_ {
        self.components.iter().enumerate().filter_map(|(i, c)| Some((i, c.coordinate?)))
    }

    pub(super) fn column(&self, component: usize, u: f64) -> Column {
        let component = &self.components[component];
        let weighted = |(level, root): (&u32, &f64)| {
            let (value, slope) = component.shape(u, *level);
            (value * root, slope * root)
        };
        let (values, slopes): (Vec<f64>, Vec<f64>) =
            self.levels.iter().zip(&self.roots).map(weighted).unzip();
        let mut values = mixed(self.mixing.as_deref(), values);
        let mut slopes = mixed(self.mixing.as_deref(), slopes);
        let length = dot(&values, &values).sqrt();
        values.iter_mut().chain(&mut slopes).for_each(|v| *v /= length);
        Column { values, slopes, length }
    }

    /// The bounds of an amplitude in units in which its column has unit length.
    pub(super) fn scaled_bounds(&self, component: usize, length: f64) -> (f64, f64) {
        let Range { low, high } = self.components[component].amplitude;
        (low * length / self.length, high * length / self.length)
    }

    /// The best amplitudes for the coordinates given (one for each component that has one).
    pub(super) fn solve(&self, coordinates: &[f64]) -> Solution {
        let mut next = coordinates.iter();
        let columns: Vec<Column> = (0..self.components.len())
            .map(|i| {
                let shaped = self.components[i].coordinate.is_some();
                self.column(i, if shaped { next.next().copied().unwrap_or(0.0) } else { 0.0 })
            })
            .collect();
        let problem = self.linear_problem(&columns);
        let mut x = problem.minimise();
        let free = |x: &Vector, i: usize| x[i] > problem.lower[i] && x[i] < problem.upper[i];
        let active: Vec<usize> = (0..columns.len()).filter(|i| free(&x, *i)).collect();
        // One refinement with the residuals themselves: the normal equations know only half the digits.
        let mut residuals = self.residuals(&columns, &x);
        if let Some(change) = project(&columns, &active, &problem.gram, &residuals) {
            let mut refined = x;
            active.iter().zip(change).for_each(|(i, d)| refined[*i] += d);
            if active.iter().all(|i| free(&refined, *i)) {
                x = refined;
                residuals = self.residuals(&columns, &x);
            }
        }
        let jacobian =
            self.shaped().map(|(i, _)| tangent(&columns, &active, &problem.gram, i, x[i])).collect();
        let unit = |(x, c): (&f64, &Column)| x * self.length / c.length;
        let amplitudes = x.iter().zip(&columns).map(unit).collect();
        Solution { amplitudes, residuals, jacobian }
    }

    fn linear_problem(&self, columns: &[Column]) -> Bounded {
        let mut problem = Bounded::new(columns.len());
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                problem.gram[i][j] = dot(&a.values, &b.values);
                problem.gram[j][i] = problem.gram[i][j];
            }
            problem.right[i] = dot(&a.values, &self.target);
            (problem.lower[i], problem.upper[i]) = self.scaled_bounds(i, a.length);
        }
        problem
    }

    fn residuals(&self, columns: &[Column], x: &Vector) -> Vec<f64> {
        let mut residuals = self.target.clone();
        for (column, amplitude) in columns.iter().zip(x) {
            residuals.iter_mut().zip(&column.values).for_each(|(r, v)| *r -= amplitude * v);
        }
        residuals
    }
}

/// Coefficients of the projection of `vector` on the active columns.
fn project(columns: &[Column], active: &[usize], gram: &Matrix, vector: &[f64]) -> Option<Vec<f64>> {
    let mut right = [0.0; MOST];
    for (r, &i) in right.iter_mut().zip(active) {
        *r = dot(&columns[i].values, vector);
    }
    let n = active.len();
    let solution = cholesky_solve(|a, b| gram[active[a]][active[b]], right, n)?;
    Some(solution[..n].to_vec())
}

/// −amplitude × the part of a column's slope that the active columns cannot follow.
fn tangent(columns: &[Column], active: &[usize], gram: &Matrix, i: usize, amplitude: f64) -> Vec<f64> {
    let slopes = &columns[i].slopes;
    let mut tangent: Vec<f64> = slopes.iter().map(|s| -amplitude * s).collect();
    if let Some(part) = project(columns, active, gram, &tangent) {
        for (&a, p) in active.iter().zip(part) {
            tangent.iter_mut().zip(&columns[a].values).for_each(|(t, v)| *t -= p * v);
        }
    }
    tangent
}

fn mixed(mixing: Option<&DMatrix<f64>>, values: Vec<f64>) -> Vec<f64> {
    let Some(mixing) = mixing else { return values };
    (0..values.len()).map(|i| (0..values.len()).map(|j| mixing[(i, j)] * values[j]).sum()).collect()
}

/// What makes errors of this covariance uncorrelated and of unit variance: the inverse of its Cholesky factor; where
/// rounding leaves no positive definite matrix, of its diagonal alone.
pub(super) fn whitening(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let inverse = covariance.clone().cholesky().and_then(|c| c.l().try_inverse());
    inverse.unwrap_or_else(|| {
        let root = |i: usize| 1.0 / covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| if i == j { root(i) } else { 0.0 })
    })
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
