//! Three-vectors, matrices and quaternions of lanes. Without a parameter they are in memory.

use super::elementary::sinc_cos_of_square;
use super::{Lanes, Real, Wide};
use std::ops::{Add, Index, IndexMut, Mul, Neg, Sub};

/// Three-vector of lanes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vec3<L = Lanes>(pub [L; 3]);

impl Vec3 {
    /// The zero vector.
    pub const ZERO: Self = Self([Lanes::ZERO; 3]);

    /// The vector of one lane.
    pub(crate) fn lane(&self, i: usize) -> glam::DVec3 {
        glam::DVec3::new(self.0[0][i], self.0[1][i], self.0[2][i])
    }

    /// Sets the vector of one lane.
    pub(crate) fn set_lane(&mut self, i: usize, v: glam::DVec3) {
        for k in 0..3 {
            self.0[k][i] = v[k];
        }
    }

    /// Into registers.
    #[inline(always)]
    pub(crate) fn load<W: Wide>(&self) -> Vec3<W> {
        Vec3([
            W::load(&self.0[0]),
            W::load(&self.0[1]),
            W::load(&self.0[2]),
        ])
    }

    /// From registers.
    #[inline(always)]
    pub(crate) fn store<W: Wide>(&mut self, v: Vec3<W>) {
        for i in 0..3 {
            v.0[i].store(&mut self.0[i]);
        }
    }
}

impl<L: Real> Vec3<L> {
    /// The same vector in every lane.
    #[inline(always)]
    #[must_use]
    pub fn splat(v: glam::DVec3) -> Self {
        Self([L::from(v.x), L::from(v.y), L::from(v.z)])
    }

    /// Cross product.
    #[inline(always)]
    pub(crate) fn cross(self, b: Self) -> Self {
        let (a, b) = (self.0, b.0);
        let minor = |i: usize, j: usize| a[i].mul_add(b[j], -(a[j] * b[i]));
        Self([minor(1, 2), minor(2, 0), minor(0, 1)])
    }

    /// Scalar product.
    #[inline(always)]
    pub(crate) fn dot(self, b: Self) -> L {
        dot3(&self.0, &b)
    }

    /// self · s + term.
    #[inline(always)]
    pub(crate) fn mul_add(self, s: L, term: Self) -> Self {
        let (a, t) = (self.0, term.0);
        Self([
            a[0].mul_add(s, t[0]),
            a[1].mul_add(s, t[1]),
            a[2].mul_add(s, t[2]),
        ])
    }
}

#[inline(always)]
fn dot3<L: Real>(row: &[L; 3], v: &Vec3<L>) -> L {
    row[2].mul_add(v.0[2], row[1].mul_add(v.0[1], row[0] * v.0[0]))
}

impl<L: Real> Add for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self([self.0[0] + b.0[0], self.0[1] + b.0[1], self.0[2] + b.0[2]])
    }
}

impl<L: Real> Sub for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self([self.0[0] - b.0[0], self.0[1] - b.0[1], self.0[2] - b.0[2]])
    }
}

impl<L: Real> Neg for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1], -self.0[2]])
    }
}

impl<L: Real> Mul<L> for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: L) -> Self {
        Self([self.0[0] * s, self.0[1] * s, self.0[2] * s])
    }
}

impl<L> Index<usize> for Vec3<L> {
    type Output = L;
    #[inline(always)]
    fn index(&self, i: usize) -> &L {
        &self.0[i]
    }
}

impl<L> IndexMut<usize> for Vec3<L> {
    #[inline(always)]
    fn index_mut(&mut self, i: usize) -> &mut L {
        &mut self.0[i]
    }
}

/// 3×3 matrix of lanes, `m[row][column]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mat3<L = Lanes>(pub [[L; 3]; 3]);

impl Mat3 {
    /// The matrix of one lane.
    #[must_use]
    pub fn lane(&self, lane: usize) -> nalgebra::Matrix3<f64> {
        nalgebra::Matrix3::from_fn(|i, j| self.0[i][j][lane])
    }
}

impl<L: Real> Mat3<L> {
    /// The cross-product matrix \[v×\].
    #[inline(always)]
    pub(crate) fn skew(v: Vec3<L>) -> Self {
        let z = L::from(0.0);
        Self([[z, -v[2], v[1]], [v[2], z, -v[0]], [-v[1], v[0], z]])
    }

    /// Every element times s.
    #[inline(always)]
    pub(crate) fn scaled(mut self, s: L) -> Self {
        for row in &mut self.0 {
            for value in row {
                *value = *value * s;
            }
        }
        self
    }
}

impl<L: Real> Mul for Mat3<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let column = |j: usize| self * Vec3([b.0[0][j], b.0[1][j], b.0[2][j]]);
        let [x, y, z] = [column(0).0, column(1).0, column(2).0];
        Self([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])
    }
}

impl<L: Real> Mul<Vec3<L>> for Mat3<L> {
    type Output = Vec3<L>;
    #[inline(always)]
    fn mul(self, v: Vec3<L>) -> Vec3<L> {
        Vec3([
            dot3(&self.0[0], &v),
            dot3(&self.0[1], &v),
            dot3(&self.0[2], &v),
        ])
    }
}

impl<L: Real> Sub for Mat3<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, b: Self) -> Self {
        for i in 0..3 {
            for j in 0..3 {
                self.0[i][j] -= b.0[i][j];
            }
        }
        self
    }
}

/// Unit quaternion of lanes, `[w, x, y, z]`, Hamilton product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quat<L = Lanes> {
    /// Scalar part.
    pub w: L,
    /// Vector part.
    pub v: Vec3<L>,
}

impl Quat {
    /// The rotation of one lane.
    pub(crate) fn lane(&self, i: usize) -> glam::DQuat {
        let v = self.v.lane(i);
        glam::DQuat::from_xyzw(v.x, v.y, v.z, self.w[i])
    }

    /// Sets the rotation of one lane.
    pub(crate) fn set_lane(&mut self, i: usize, q: glam::DQuat) {
        self.w[i] = q.w;
        self.v.set_lane(i, q.xyz());
    }

    /// Into registers.
    #[inline(always)]
    pub(crate) fn load<W: Wide>(&self) -> Quat<W> {
        Quat {
            w: W::load(&self.w),
            v: self.v.load(),
        }
    }

    /// From registers.
    #[inline(always)]
    pub(crate) fn store<W: Wide>(&mut self, q: Quat<W>) {
        q.w.store(&mut self.w);
        self.v.store(q.v);
    }
}

impl<L: Real> Quat<L> {
    /// The same rotation in every lane.
    #[inline(always)]
    pub(crate) fn splat(q: glam::DQuat) -> Self {
        Self {
            w: L::from(q.w),
            v: Vec3::splat(q.xyz()),
        }
    }

    /// The rotation by a rotation vector of at most π/2 radians.
    #[inline(always)]
    pub(crate) fn from_rotation_vector(phi: Vec3<L>) -> Self {
        let half = phi * L::from(0.5);
        // sin(θ/2)/(θ/2) as a series in θ²: no division by θ, and so no branch for a rotation of zero.
        let (sinc, cos) = sinc_cos_of_square(half.dot(half));
        Self {
            w: cos,
            v: half * sinc,
        }
    }

    /// One Newton step towards unit length: enough after each product of unit quaternions.
    #[inline(always)]
    pub(crate) fn renormalised(self) -> Self {
        // 1/√x ≈ (3 − x)/2 near 1: an error ε of the norm becomes 3ε²/2.
        let scale = (self.w * self.w + self.v.dot(self.v)) * -0.5 + 1.5;
        Self {
            w: self.w * scale,
            v: self.v * scale,
        }
    }

    /// The direction cosine matrix.
    #[inline(always)]
    #[must_use]
    pub fn to_matrix(&self) -> Mat3<L> {
        let (w, [x, y, z]) = (self.w, self.v.0);
        // Doubling by addition is exact, and leaves nine products.
        let (x2, y2, z2) = (x + x, y + y, z + z);
        let (xx, yy, zz) = (x * x2, y * y2, z * z2);
        let (xy, xz, yz) = (x * y2, x * z2, y * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        let one = L::from(1.0);
        Mat3([
            [one - (yy + zz), xy - wz, xz + wy],
            [xy + wz, one - (xx + zz), yz - wx],
            [xz - wy, yz + wx, one - (xx + yy)],
        ])
    }
}

impl<L: Real> Mul for Quat<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        // w_a v_b + w_b v_a + v_a × v_b.
        let v = b.v.mul_add(self.w, self.v.mul_add(b.w, self.v.cross(b.v)));
        Self {
            w: self.w.mul_add(b.w, -self.v.dot(b.v)),
            v,
        }
    }
}
