//! The covariance of eight runs.
//!
//! States by threes: [`R`] position error (m, n), [`V`] velocity error (m/s, n), [`PSI`] attitude error
//! (rad, n), then one triple of axes for each bias group, accelerometer groups first ([`BIAS`]). Only
//! the upper triangle is stored, so the matrix is symmetric by construction.

use crate::lanes::{Lanes, Mat3, Real, Vec3, Wide};

/// Position error block (m, n).
pub const R: usize = 0;
/// Velocity error block (m/s, n).
pub const V: usize = 1;
/// Attitude error block (rad, n).
pub const PSI: usize = 2;
/// First bias block.
pub const BIAS: usize = 3;
/// The navigation blocks.
pub const NAV: [usize; 3] = [R, V, PSI];

/// Symmetric covariance of eight runs.
#[derive(Debug, Clone)]
pub struct Covariance {
    dim: usize,
    /// Row-major; what is below the diagonal is unused.
    p: Vec<Lanes>,
}

impl Covariance {
    /// Zero covariance of `dim` states.
    #[must_use]
    pub fn zeros(dim: usize) -> Self {
        Self { dim, p: vec![Lanes::ZERO; dim * dim] }
    }

    /// States: rows of the matrix.
    #[must_use]
    pub const fn dim(&self) -> usize {
        self.dim
    }

    #[inline(always)]
    fn index(&self, i: usize, j: usize) -> usize {
        if i <= j { i * self.dim + j } else { j * self.dim + i }
    }

    /// Element (i, j) of the matrix.
    #[inline(always)]
    #[must_use]
    pub fn get<W: Wide>(&self, i: usize, j: usize) -> W {
        W::load(&self.p[self.index(i, j)])
    }

    #[inline(always)]
    pub(super) fn set<W: Wide>(&mut self, i: usize, j: usize, value: W) {
        let index = self.index(i, j);
        value.store(&mut self.p[index]);
    }

    #[inline(always)]
    pub(super) fn add<W: Wide>(&mut self, i: usize, j: usize, value: W) {
        self.set(i, j, self.get::<W>(i, j) + value);
    }

    /// Elements (i, j), (i + 1, j), (i + 2, j).
    #[inline(always)]
    #[must_use]
    pub fn triple<W: Wide>(&self, i: usize, j: usize) -> Vec3<W> {
        Vec3([self.get(i, j), self.get(i + 1, j), self.get(i + 2, j)])
    }

    /// Adds to the upper triangle of a diagonal block of three states.
    #[inline(always)]
    pub(super) fn add_diagonal_block<W: Wide>(&mut self, block: usize, m: &Mat3<W>) {
        for i in 0..3 {
            for j in i..3 {
                self.add(3 * block + i, 3 * block + j, m.0[i][j]);
            }
        }
    }

    /// The variances of a block's three states.
    #[must_use]
    pub fn variances(&self, block: usize) -> Vec3 {
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
            let residual = gain_i * r - (ph_i - gain_i * h_ph);
            for j in i..n {
                let m = (-gain_i).mul_add(W::load(&ph[j]), self.get(i, j));
                self.set(i, j, residual.mul_add(W::load(&gain[j]), m));
            }
        }
        s
    }

    /// xᵀ P⁻¹ x over the states listed, by Cholesky; NaN where the covariance is not positive definite.
    #[inline(always)]
    #[must_use]
    pub fn normalised_square<const N: usize>(&self, states: [usize; N], x: [Lanes; N]) -> Lanes {
        let mut l = [[Lanes::ZERO; N]; N];
        let mut y = x;
        let mut sum = Lanes::ZERO;
        for i in 0..N {
            for j in 0..=i {
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
        }
        sum
    }

    /// The matrix of one lane.
    #[must_use]
    pub fn lane(&self, lane: usize) -> nalgebra::DMatrix<f64> {
        nalgebra::DMatrix::from_fn(self.dim(), self.dim(), |i, j| self.get::<Lanes>(i, j)[lane])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A covariance with the same positive definite matrix in all lanes, and that matrix.
    fn example(blocks: usize) -> (Covariance, DMatrix<f64>) {
        let n = 3 * blocks;
        let a = DMatrix::from_fn(n, n, |i, j| ((i * 7 + j * 3) % 11) as f64 / 11.0 - 0.4);
        let m = &a * a.transpose() + DMatrix::identity(n, n) * 0.1;
        let mut p = Covariance::zeros(n);
        for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
            p.set(i, j, Lanes::splat(m[(i, j)]));
        }
        (p, m)
    }

    #[test]
    fn scalar_update_agrees_with_the_dense_kalman_update() {
        let (mut p, m) = example(5);
        let mut h = DVector::zeros(15);
        (h[1], h[7], h[13]) = (1.0, -0.3, 2.0);
        let (mut ph, mut gain) = (vec![Lanes::ZERO; 15], vec![Lanes::ZERO; 15]);
        let sparse: Vec<_> = [1, 7, 13].map(|i| (i, Lanes::splat(h[i]))).to_vec();
        let s = p.update(&sparse, 0.25, &mut ph, &mut gain);
        let expected_s = (h.transpose() * &m * &h)[0] + 0.25;
        let k = &m * &h / expected_s;
        let expected = &m - &k * h.transpose() * &m;
        assert!((s[3] - expected_s).abs() < 1e-13);
        assert!((p.lane(2) - expected).abs().max() < 1e-13);
    }

    #[test]
    fn normalised_square_agrees_with_the_inverse() {
        let (p, m) = example(3);
        let x: [Lanes; 9] = std::array::from_fn(|i| Lanes::splat(0.1 * i as f64 - 0.3));
        let v = DVector::from_fn(9, |i, _| 0.1 * i as f64 - 0.3);
        let expected = (v.transpose() * m.try_inverse().unwrap() * v)[0];
        let got = p.normalised_square(std::array::from_fn(|i| i), x)[6];
        assert!((got / expected - 1.0).abs() < 1e-10, "{got} against {expected}");
    }
}
