//! The covariance of eight runs in 3×3 blocks.
//!
//! Blocks: [`R`] position error (m, n), [`V`] velocity error (m/s, n), [`PSI`] attitude error (rad, n),
//! then one block of three axes for each bias group, accelerometer groups first ([`BIAS`]).
//! Only the blocks on and above the diagonal are stored and computed; diagonal blocks are kept exactly
//! symmetric.

use crate::lanes::{Lanes, Mat3, Real, Vec3};

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

/// Symmetric covariance of eight runs in 3×3 blocks.
#[derive(Debug, Clone)]
pub struct Covariance {
    blocks: usize,
    /// Row-major blocks; entries below the diagonal are unused.
    p: Vec<Mat3>,
}

impl Covariance {
    /// Zero covariance of `blocks` 3×3 blocks a side.
    #[must_use]
    pub fn zeros(blocks: usize) -> Self {
        Self { blocks, p: vec![Mat3::ZERO; blocks * blocks] }
    }

    /// Blocks a side.
    #[must_use]
    pub const fn blocks(&self) -> usize {
        self.blocks
    }

    /// States: rows of the matrix.
    #[must_use]
    pub const fn dim(&self) -> usize {
        3 * self.blocks
    }

    /// Block (i, j), wherever it stands.
    #[inline(always)]
    #[must_use]
    pub fn block(&self, i: usize, j: usize) -> Mat3 {
        if i <= j { self.p[i * self.blocks + j] } else { self.p[j * self.blocks + i].transpose() }
    }

    /// Block (i, j) above the diagonal, to be changed in place.
    #[inline(always)]
    pub(crate) fn upper_mut(&mut self, i: usize, j: usize) -> &mut Mat3 {
        debug_assert!(i <= j);
        &mut self.p[i * self.blocks + j]
    }

    /// Sets a diagonal block, from its upper triangle.
    #[inline(always)]
    pub(crate) fn set_diagonal_block(&mut self, i: usize, m: Mat3) {
        let m = &m.0;
        *self.upper_mut(i, i) =
            Mat3([[m[0][0], m[0][1], m[0][2]], [m[0][1], m[1][1], m[1][2]], [m[0][2], m[1][2], m[2][2]]]);
    }

    /// Element (i, j) of the matrix.
    #[inline(always)]
    #[must_use]
    pub fn get(&self, i: usize, j: usize) -> Lanes {
        let (a, b) = (i.min(j), i.max(j));
        self.p[(a / 3) * self.blocks + b / 3].0[a % 3][b % 3]
    }

    #[inline(always)]
    fn set(&mut self, i: usize, j: usize, value: Lanes) {
        let (a, b) = (i.min(j), i.max(j));
        self.p[(a / 3) * self.blocks + b / 3].0[a % 3][b % 3] = value;
        if a / 3 == b / 3 {
            self.p[(a / 3) * self.blocks + b / 3].0[b % 3][a % 3] = value;
        }
    }

    /// The variances of a block's three states.
    #[inline(always)]
    #[must_use]
    pub fn variances(&self, block: usize) -> Vec3 {
        let m = self.block(block, block);
        Vec3([m.0[0][0], m.0[1][1], m.0[2][2]])
    }

    /// One scalar measurement z = h·x + noise of variance r, in Joseph's form
    /// ([Bar-Shalom](crate::bibliography::BarShalom01), eq. 5.2.3-17), so that the result is positive
    /// semi-definite for any r > 0. `h` lists (state, coefficient). The gain is left in `gain` (one entry
    /// a state, also used as scratch); the innovation variance is returned.
    #[inline(always)]
    pub fn update(&mut self, h: &[(usize, Lanes)], r: f64, ph: &mut [Lanes], gain: &mut [Lanes]) -> Lanes {
        let n = self.dim();
        for i in 0..n {
            ph[i] = Lanes::ZERO;
            for (m, c) in h {
                ph[i] += self.get(i, *m) * *c;
            }
        }
        let mut s = Lanes::splat(r);
        for (m, c) in h {
            s += ph[*m] * *c;
        }
        let inverse = Lanes::ONE / s;
        for i in 0..n {
            gain[i] = ph[i] * inverse;
        }
        // With M = (I − k hᵀ) P:  P⁺ = M (I − k hᵀ)ᵀ + r k kᵀ = M + (r k − M h) kᵀ.
        let h_ph = s - Lanes::splat(r);
        for i in 0..n {
            let residual = gain[i] * r - (ph[i] - gain[i] * h_ph);
            for j in i..n {
                let m = self.get(i, j) - gain[i] * ph[j];
                self.set(i, j, m + residual * gain[j]);
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
                let mut a = self.get(states[i], states[j]);
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
        nalgebra::DMatrix::from_fn(self.dim(), self.dim(), |i, j| self.get(i, j)[lane])
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
        let mut p = Covariance::zeros(blocks);
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
