//! The covariance of eight runs.
//!
//! States by threes: [`R`] position error (m, n), [`V`] velocity error (m/s, n), `PSI` attitude error
//! (rad, n), then one triple of axes for each bias group, accelerometer groups first (`BIAS`), and for each
//! unknown constant that acts multiplied, in the same order, and at last wheel scale and mounting of a vehicle.
//!
//! The lower triangle is the matrix. Inside the square of the navigation states and inside that of the
//! biases the upper triangle repeats it, so that a column can be read as a row.

use super::belief::{Belief, BiasGroup, MAX_BLOCKS};
use super::dynamics::{ErrorMap, NavError};
use super::unknowns::Regressor;
use crate::imu::Sensor;
use crate::lanes::{LANES, Lanes, Mat3, Real, Vec3, Wide};
use glam::DVec3;
use std::ops::Range;

/// Position error block (m, n).
pub const R: usize = 0;
/// Velocity error block (m/s, n).
pub const V: usize = 1;
/// Attitude error block (rad, n).
pub(crate) const PSI: usize = 2;
/// First bias block.
pub(crate) const BIAS: usize = 3;
/// Navigation states.
pub(super) const NAV: usize = 3 * BIAS;

/// Symmetric covariance of eight runs.
#[derive(Debug, Clone)]
pub struct Covariance {
    dim: usize,
    /// Row-major.
    p: Vec<Lanes>,
    /// Scratch: columns of A P, navigation rows.
    columns: [[Lanes; NAV]; NAV],
}

/// Steps of biases that stay as they are: phi = 1, no innovation.
const CONSTANT_BIASES: [BiasGroup; 2 * MAX_BLOCKS + 1] =
    [BiasGroup::constant(0.0); 2 * MAX_BLOCKS + 1];

/// The blocks behind the navigation's: what makes the errors of a sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sources<'a> {
    /// The step of each block: biases of the accelerometer, of the gyroscope, unknowns of both, and what the vehicle's
    /// own measurements have, which moves nothing.
    pub(super) steps: &'a [BiasGroup],
    /// Bias groups of each sensor.
    pub(super) biases: [usize; 2],
    /// What the unknowns of each sensor are multiplied by.
    pub(super) regressors: [&'a [Regressor]; 2],
}

impl<'a> Sources<'a> {
    #[inline(always)]
    pub(super) fn new(
        belief: &Belief,
        steps: &'a [BiasGroup],
        regressors: &'a [Vec<Regressor>; 2],
    ) -> Self {
        let [accel, gyro] = &belief.groups;
        Self {
            steps,
            biases: [accel.len(), gyro.len()],
            regressors: [&regressors[0], &regressors[1]],
        }
    }

    /// The first unknown of a sensor among the blocks.
    #[inline(always)]
    pub(super) fn unknowns(&self, sensor: Sensor) -> usize {
        let before = if sensor == Sensor::Accel {
            0
        } else {
            self.regressors[0].len()
        };
        self.biases[0] + self.biases[1] + before
    }

    /// The same blocks with transition 1 and no noise: for a map between samples, which moves no bias.
    pub(super) fn still(self) -> Self {
        Self {
            steps: &CONSTANT_BIASES[..self.steps.len()],
            ..self
        }
    }

    /// First states of: accelerometer biases, gyroscope biases, accelerometer unknowns, gyroscope unknowns.
    #[inline(always)]
    pub(super) fn starts(&self) -> [usize; 4] {
        let gyro = NAV + 3 * self.biases[0];
        let unknown = gyro + 3 * self.biases[1];
        [NAV, gyro, unknown, unknown + 3 * self.regressors[0].len()]
    }
}

impl Covariance {
    /// Zero covariance of `dim` states.
    #[must_use]
    pub(crate) fn zeros(dim: usize) -> Self {
        Self {
            dim,
            p: vec![Lanes::ZERO; dim * dim],
            columns: [[Lanes::ZERO; NAV]; NAV],
        }
    }

    /// States: rows of the matrix.
    #[must_use]
    pub(crate) const fn dim(&self) -> usize {
        self.dim
    }

    /// Element (i, j) of the matrix.
    #[inline(always)]
    #[must_use]
    pub(crate) fn get<W: Wide>(&self, i: usize, j: usize) -> W {
        W::load(&self.p[i.max(j) * self.dim + i.min(j)])
    }

    #[inline(always)]
    fn set<W: Wide>(&mut self, i: usize, j: usize, value: W) {
        value.store(&mut self.p[i * self.dim + j]);
        value.store(&mut self.p[j * self.dim + i]);
    }

    /// Adds to an element of the navigation square and its mirror image.
    #[inline(always)]
    pub(super) fn add<W: Wide>(&mut self, i: usize, j: usize, value: W) {
        self.set(i, j, self.get::<W>(i, j) + value);
    }

    /// Adds to a diagonal block of three states.
    #[inline(always)]
    pub(super) fn add_diagonal_block<W: Wide>(&mut self, block: usize, m: &Mat3<W>) {
        for i in 0..3 {
            for j in i..3 {
                self.add(3 * block + i, 3 * block + j, m.0[i][j]);
            }
        }
    }

    /// Takes the matrix of one lane from another covariance of the same size.
    pub(super) fn copy_lane(&mut self, other: &Self, lane: usize) {
        for (to, from) in self.p.iter_mut().zip(&other.p) {
            to[lane] = from[lane];
        }
    }

    /// Sets the matrix of one lane to a symmetric one.
    pub(super) fn set_lane(&mut self, lane: usize, matrix: &nalgebra::DMatrix<f64>) {
        self.p
            .iter_mut()
            .zip(matrix.iter())
            .for_each(|(to, from)| to[lane] = *from);
    }

    /// P⁺ = A P Aᵀ + Q for a map A of the navigation error and the transition of the biases; the biases
    /// take their step first: `b_k = phi b_{k−1} + w`, and the map uses `b_k`.
    #[inline(always)]
    pub(super) fn step<W: Wide>(&mut self, map: &impl ErrorMap<W>, sources: &Sources<'_>) {
        self.step_biases::<W>(sources.steps);
        let n = self.dim;
        // A P, the navigation columns apart: they are read again below.
        for j in 0..NAV {
            let [accel, gyro] = self.column_errors(j, sources);
            let after = map.apply(load_error(&self.p[j * n..]), accel, gyro);
            store_error(&mut self.columns[j], &after);
        }
        // Columns of the biases: among themselves they have taken their step, with the navigation not yet.
        for j in NAV..n {
            let phi = W::from(sources.steps[j / 3 - BIAS].phi[j % 3]);
            let (nav, rest) = self.p[j * n..(j + 1) * n].split_at_mut(NAV);
            let [accel, gyro] = row_errors(rest, sources);
            let x = load_error::<W>(nav);
            let x = [x[R] * phi, x[V] * phi, x[PSI] * phi];
            store_error(nav, &map.apply(x, accel, gyro));
        }
        // (A P) Aᵀ: the same map on the rows of A P. Cross terms have taken their step by now: no second phi.
        let still = sources.still();
        for i in 0..NAV {
            let mut row = [Lanes::ZERO; NAV];
            for (element, column) in row.iter_mut().zip(&self.columns) {
                // Transposed while copying: row i of A P is column i of P Aᵀ, to which the same map applies.
                *element = column[i];
            }
            // Row i of A P in the columns of the biases, read from below the diagonal.
            let [accel, gyro] = self.column_errors(i, &still);
            let after = map.apply(load_error(&row), accel, gyro);
            store_error(&mut self.p[i * n..], &after);
        }
        self.mirror_navigation();
    }

    /// The errors of the sample of each sensor in column j of the navigation, every bias after its step.
    #[inline(always)]
    fn column_errors<W: Wide>(&self, j: usize, sources: &Sources<'_>) -> [Vec3<W>; 2] {
        let [accel, gyro, accel_unknown, gyro_unknown] = sources.starts();
        let of_accel = self.bias_sum(accel..gyro, j, sources.steps);
        let of_gyro = self.bias_sum(gyro..accel_unknown, j, sources.steps);
        [
            self.add_unknowns(of_accel, accel_unknown, j, sources.regressors[0]),
            self.add_unknowns(of_gyro, gyro_unknown, j, sources.regressors[1]),
        ]
    }

    /// The sum of triples of biases in column j of the navigation, each after its step.
    #[inline(always)]
    fn bias_sum<W: Wide>(&self, states: Range<usize>, j: usize, biases: &[BiasGroup]) -> Vec3<W> {
        let mut sum = [W::from(0.0); 3];
        for m in states.step_by(3) {
            let phi = biases[m / 3 - BIAS].phi;
            for axis in 0..3 {
                let element = W::load(&self.p[(m + axis) * self.dim + j]);
                sum[axis] = element.mul_add(W::from(phi[axis]), sum[axis]);
            }
        }
        Vec3(sum)
    }

    /// Adds the unknowns from state `first` on in column j of the navigation, each times its regressor.
    #[inline(always)]
    fn add_unknowns<W: Wide>(
        &self,
        mut sum: Vec3<W>,
        first: usize,
        j: usize,
        regressors: &[Regressor],
    ) -> Vec3<W> {
        for (u, regressor) in regressors.iter().enumerate() {
            for axis in 0..3 {
                let element = W::load(&self.p[(first + 3 * u + axis) * self.dim + j]);
                sum[axis] = element.mul_add(W::load(&regressor.value[axis]), sum[axis]);
            }
        }
        sum
    }

    /// The square of the biases: Phi P Phiᵀ + Q.
    #[inline(always)]
    fn step_biases<W: Wide>(&mut self, biases: &[BiasGroup]) {
        for i in NAV..self.dim {
            let BiasGroup {
                phi, innovation, ..
            } = biases[i / 3 - BIAS];
            let row = &mut self.p[i * self.dim..(i + 1) * self.dim];
            for (g, triple) in row[NAV..].as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let factor = biases[g].phi * phi[i % 3];
                for axis in 0..3 {
                    (W::load(&triple[axis]) * factor[axis]).store(&mut triple[axis]);
                }
            }
            (W::load(&row[i]) + innovation[i % 3]).store(&mut row[i]);
        }
    }

    /// Copies the upper triangle of the navigation square to the lower.
    #[inline(always)]
    fn mirror_navigation(&mut self) {
        for i in 0..NAV {
            for j in i + 1..NAV {
                self.p[j * self.dim + i] = self.p[i * self.dim + j];
            }
        }
    }

    /// The variances of a block's three states.
    #[must_use]
    pub(crate) fn variances(&self, block: usize) -> Vec3 {
        Vec3([0, 1, 2].map(|i| self.get(3 * block + i, 3 * block + i)))
    }

    /// One scalar measurement z = h·x + noise of variance r, in Joseph's form
    /// ([Bar-Shalom](crate::bibliography::BarShalom01), eq. 5.2.3-17), so that the result is positive
    /// semi-definite for any r > 0. `h` lists (state, coefficient). The gain is left in `gain` (one entry
    /// a state, also used as scratch); the innovation variance is returned.
    #[inline(always)]
    pub(super) fn update<W: Wide>(
        &mut self,
        h: &[(usize, W)],
        r: f64,
        ph: &mut [Lanes],
        gain: &mut [Lanes],
    ) -> W {
        let n = self.dim;
        for i in 0..n {
            let mut sum = W::from(0.0);
            for (m, c) in h {
                sum = self.get::<W>(i, *m).mul_add(*c, sum);
            }
            sum.store(&mut ph[i]);
        }
        let mut h_ph = W::from(0.0);
        for (m, c) in h {
            h_ph = W::load(&ph[*m]).mul_add(*c, h_ph);
        }
        let s = h_ph + r;
        let inverse = W::from(1.0) / s;
        for i in 0..n {
            (W::load(&ph[i]) * inverse).store(&mut gain[i]);
        }
        // With M = (I − k hᵀ) P:  P⁺ = M (I − k hᵀ)ᵀ + r k kᵀ = M + (r k − M h) kᵀ.
        for i in 0..n {
            let (ph_i, gain_i) = (W::load(&ph[i]), W::load(&gain[i]));
            // r k − M h vanishes for the optimal gain but for rounding. With it the error of P⁺ is of second
            // order in that of k, without it of first, and P may become indefinite.
            let residual = gain_i * r - (ph_i - gain_i * h_ph);
            for j in 0..=i {
                // Each element is read once, before it is written: in place, without a copy of P.
                let m = (-gain_i).mul_add(W::load(&ph[j]), self.get(i, j));
                self.set(i, j, residual.mul_add(W::load(&gain[j]), m));
            }
        }
        s
    }

    /// xᵀ P⁻¹ x over the states listed, by Cholesky; NaN where the covariance is not positive definite.
    #[inline(always)]
    #[must_use]
    pub(crate) fn normalised_square<const N: usize>(
        &self,
        states: [usize; N],
        x: [Lanes; N],
    ) -> Lanes {
        self.whitened(states, x).0
    }

    /// Logarithm of the normal density of mean zero and this covariance at `x` (nats; the units of the density are
    /// those of the states, inverse).
    #[must_use]
    pub(crate) fn log_density<const N: usize>(&self, states: [usize; N], x: [Lanes; N]) -> Lanes {
        let (square, root_of_det) = self.whitened(states, x);
        let constant = N as f64 * std::f64::consts::TAU.ln();
        let mut density = Lanes::ZERO;
        for lane in 0..LANES {
            density[lane] = -0.5 * (square[lane] + 2.0 * root_of_det[lane].ln() + constant);
        }
        density
    }

    /// The square of `L⁻¹ x` and the determinant of L, where P = L Lᵀ over these states.
    fn whitened<const N: usize>(&self, states: [usize; N], x: [Lanes; N]) -> (Lanes, Lanes) {
        let mut l = [[Lanes::ZERO; N]; N];
        let mut y = x;
        let (mut sum, mut det) = (Lanes::ZERO, Lanes::splat(1.0));
        for i in 0..N {
            for j in 0..=i {
                // A negative pivot gives a NaN on purpose: such a run has diverged and is to be seen.
                let mut a: Lanes = self.get(states[i], states[j]);
                for k in 0..j {
                    a -= l[i][k] * l[j][k];
                }
                l[i][j] = if i == j { a.sqrt() } else { a / l[j][j] };
            }
            for k in 0..i {
                let product = l[i][k] * y[k];
                y[i] -= product;
            }
            y[i] = y[i] / l[i][i];
            sum += y[i] * y[i];
            det = det * l[i][i];
        }
        (sum, det)
    }

    /// The matrix of one lane.
    #[must_use]
    pub fn lane(&self, lane: usize) -> nalgebra::DMatrix<f64> {
        nalgebra::DMatrix::from_fn(self.dim(), self.dim(), |i, j| self.get::<Lanes>(i, j)[lane])
    }
}

/// The first nine lanes of a row as a navigation error.
#[inline(always)]
pub(super) fn load_error<W: Wide>(row: &[Lanes]) -> NavError<W> {
    let row = &row[..NAV];
    [
        load_triple(&row[..3]),
        load_triple(&row[3..6]),
        load_triple(&row[6..]),
    ]
}

#[inline(always)]
pub(super) fn store_error<W: Wide>(row: &mut [Lanes], x: &NavError<W>) {
    let row = &mut row[..NAV];
    for k in 0..NAV {
        x[k / 3][k % 3].store(&mut row[k]);
    }
}

#[inline(always)]
fn load_triple<W: Wide>(triple: &[Lanes]) -> Vec3<W> {
    Vec3([
        W::load(&triple[0]),
        W::load(&triple[1]),
        W::load(&triple[2]),
    ])
}

/// The sum of the triples of a row.
#[inline(always)]
fn sum_triples<W: Wide>(row: &[Lanes]) -> Vec3<W> {
    let mut sum = Vec3::splat(DVec3::ZERO);
    for triple in row.as_chunks::<3>().0 {
        sum = sum + load_triple(triple);
    }
    sum
}

/// The errors of the sample of each sensor in the row of a state behind the navigation's.
#[inline(always)]
pub(super) fn row_errors<W: Wide>(row: &[Lanes], sources: &Sources<'_>) -> [Vec3<W>; 2] {
    let (accel, rest) = row.split_at(3 * sources.biases[0]);
    let (gyro, rest) = rest.split_at(3 * sources.biases[1]);
    let [of_accel, of_gyro] = sources.regressors;
    let (accel_unknowns, gyro_unknowns) = rest.split_at(3 * of_accel.len());
    [
        add_products(sum_triples(accel), accel_unknowns, of_accel),
        add_products(sum_triples(gyro), gyro_unknowns, of_gyro),
    ]
}

/// Adds the triples of a row, each times its regressor.
#[inline(always)]
fn add_products<W: Wide>(mut sum: Vec3<W>, row: &[Lanes], regressors: &[Regressor]) -> Vec3<W> {
    for (triple, regressor) in row.as_chunks::<3>().0.iter().zip(regressors) {
        for axis in 0..3 {
            sum[axis] = W::load(&triple[axis]).mul_add(W::load(&regressor.value[axis]), sum[axis]);
        }
    }
    sum
}

#[cfg(test)]
mod tests;
