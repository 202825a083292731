//! The lane type: eight independent `f64` that advance together, and the small vectors made of it.
//!
//! Eight Monte-Carlo runs share one instruction stream. [`Lanes`] is how they stand in memory; in the
//! kernels of noise and filter they are registers of the machine ([`Wide`]), chosen at run time by [`dispatch`],
//! so a plain `cargo build --release` reaches the vector units. The formulas are written once, over
//! [`Real`]: the Earth model for a scalar (trajectories), strapdown and covariance for any width.
//!
//! `[f64; 8]` alone is not enough: LLVM splits it into eight scalars and restores vector instructions only in part,
//! with shuffles between (seen in the profile).

use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, Neg, Sub, SubAssign};
pub use wide::{Bits, Kernel, Level, Wide, dispatch};

mod wide;

/// Runs in one batch.
pub const LANES: usize = 8;

/// Real scalar of a formula: `f64`, or eight of them in lanes.
pub trait Real:
    Copy
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Mul<f64, Output = Self>
    + Add<f64, Output = Self>
    + AddAssign
    + SubAssign
{
    /// Square root.
    fn sqrt(self) -> Self;
    /// self · factor + term: fused where the machine has it, so results differ by rounding between
    /// machines, never between runs on one.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// Sine and cosine of an angle in radians, |x| ≤ 2^20.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        sin_cos(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }
    #[inline(always)]
    // The library's for a scalar: it is correct for angles of any size, and branches cost a single number
    // nothing.
    fn sin_cos(self) -> (Self, Self) {
        self.sin_cos()
    }
}

/// Eight independent values, one for each run of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// All lanes zero.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// One value in every lane.
    #[inline(always)]
    pub const fn splat(value: f64) -> Self {
        Self([value; LANES])
    }
}

impl From<f64> for Lanes {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Self::splat(value)
    }
}

impl Index<usize> for Lanes {
    type Output = f64;
    #[inline(always)]
    fn index(&self, lane: usize) -> &f64 {
        &self.0[lane]
    }
}

impl IndexMut<usize> for Lanes {
    #[inline(always)]
    fn index_mut(&mut self, lane: usize) -> &mut f64 {
        &mut self.0[lane]
    }
}

macro_rules! lane_operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $method(self, other: Lanes) -> Lanes {
                let mut result = self;
                for i in 0..LANES {
                    result.0[i] = self.0[i] $op other.0[i];
                }
                result
            }
        }
    };
}
lane_operator!(Add, add, +);
lane_operator!(Sub, sub, -);
lane_operator!(Mul, mul, *);
lane_operator!(Div, div, /);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self * -1.0
    }
}

/// Implements the operators that follow from the four operations and `From<f64>`.
macro_rules! derived_operators {
    ($type:ty) => {
        impl std::ops::Mul<f64> for $type {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: f64) -> Self {
                self * Self::from(other)
            }
        }
        impl std::ops::Add<f64> for $type {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: f64) -> Self {
                self + Self::from(other)
            }
        }
        impl std::ops::AddAssign for $type {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl std::ops::SubAssign for $type {
            #[inline(always)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
pub(crate) use derived_operators;
derived_operators!(Lanes);

impl Real for Lanes {
    #[inline(always)]
    fn sqrt(self) -> Self {
        let mut result = self;
        for i in 0..LANES {
            result.0[i] = self.0[i].sqrt();
        }
        result
    }
    #[inline(always)]
    // Not f64::mul_add: without a fused instruction that would be a call into a library for every product.
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }
}

// Functions that the vector units do not have, for any number of lanes.

/// Sine and cosine, |x| ≤ 2^20: Cody-Waite reduction by π/2 in three parts, then the Taylor series on
/// [−π/4, π/4] to rounding. Without branches and comparisons, so that it is the same text for every width;
/// within 2 ulp of the scalar functions (tested).
#[inline(always)]
fn sin_cos<L: Real>(angle: L) -> (L, L) {
    // π/2 = P1 + P2 + P3, each with enough trailing zeros that k·P is exact for |k| < 2^20 (fdlibm).
    const P1: f64 = 1.570_796_326_734_125_6;
    const P2: f64 = 6.077_100_506_303_966e-11;
    const P3: f64 = 2.022_266_248_795_951e-21;
    // The nearest multiple of π/2, so that |x| ≤ π/4 but for rounding: the reduction needs no comparison.
    let k = rounded(angle * std::f64::consts::FRAC_2_PI);
    // From the largest part to the smallest: the first difference is exact, and what it cancels the next two
    // restore.
    let x = angle - k * P1 - k * P2 - k * P3;
    let (s, c) = sin_cos_kernel(x);
    // q = k mod 4 in {−2, −1, 0, 1, 2}; sin and cos of q·π/2 are polynomials in it, exact on these five
    let q = k - rounded(k * 0.25) * 4.0;
    let q2 = q * q;
    // Lagrange polynomials through the five points: a table look-up would need lanes to take different
    // branches.
    let sin_q = q * (q2 * -1.0 + 4.0) * (1.0 / 3.0);
    let cos_q = q2 * (q2 - L::from(7.0)) * (1.0 / 6.0) + 1.0;
    (s * cos_q + c * sin_q, c * cos_q - s * sin_q)
}

/// The nearest integer, |x| < 2^51: adding and subtracting 1.5·2^52 leaves no room for a fraction.
#[inline(always)]
pub fn rounded<L: Real>(x: L) -> L {
    const ROUND: f64 = 6_755_399_441_055_744.0;
    // The compiler may not simplify this: floating-point addition is not associative in Rust.
    (x + ROUND) - L::from(ROUND)
}

/// sin and cos by Taylor series, exact to rounding for |x| ≤ π/4.
#[inline(always)]
fn sin_cos_kernel<L: Real>(x: L) -> (L, L) {
    let (sinc, cos) = sinc_cos_of_square(x * x);
    (x * sinc, cos)
}

/// (sin x / x, cos x) as functions of x², exact to rounding for |x| ≤ π/4.
#[inline(always)]
pub fn sinc_cos_of_square<L: Real>(x2: L) -> (L, L) {
    // (−1)^k/(2k + 1)! and below (−1)^k/(2k)!: at π/4 the first terms left out are 1e-19 and 3e-21.
    const SINC: [f64; 9] = [
        1.0 / 355_687_428_096_000.0,
        -1.0 / 1_307_674_368_000.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 39_916_800.0,
        1.0 / 362_880.0,
        -1.0 / 5040.0,
        1.0 / 120.0,
        -1.0 / 6.0,
        1.0,
    ];
    const COS: [f64; 10] = [
        -1.0 / 6_402_373_705_728_000.0,
        1.0 / 20_922_789_888_000.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 479_001_600.0,
        -1.0 / 3_628_800.0,
        1.0 / 40_320.0,
        -1.0 / 720.0,
        1.0 / 24.0,
        -0.5,
        1.0,
    ];
    (horner(&SINC, x2), horner(&COS, x2))
}

/// The polynomial with the given coefficients, highest power first.
#[inline(always)]
pub fn horner<L: Real, const N: usize>(coefficients: &[f64; N], x: L) -> L {
    let mut sum = L::from(coefficients[0]);
    for i in 1..N {
        sum = sum.mul_add(x, L::from(coefficients[i]));
    }
    sum
}

// Three-vectors, matrices and quaternions of lanes. Without a parameter they are in memory.

/// Three-vector of lanes.
#[derive(Debug, Clone, Copy)]
pub struct Vec3<L = Lanes>(pub [L; 3]);

impl Vec3 {
    /// The zero vector.
    pub const ZERO: Self = Self([Lanes::ZERO; 3]);

    /// The vector of one lane.
    pub fn lane(&self, i: usize) -> glam::DVec3 {
        glam::DVec3::new(self.0[0][i], self.0[1][i], self.0[2][i])
    }

    /// Sets the vector of one lane.
    pub fn set_lane(&mut self, i: usize, v: glam::DVec3) {
        for k in 0..3 {
            self.0[k][i] = v[k];
        }
    }

    /// Into registers.
    #[inline(always)]
    pub fn load<W: Wide>(&self) -> Vec3<W> {
        Vec3([
            W::load(&self.0[0]),
            W::load(&self.0[1]),
            W::load(&self.0[2]),
        ])
    }

    /// From registers.
    #[inline(always)]
    pub fn store<W: Wide>(&mut self, v: Vec3<W>) {
        for i in 0..3 {
            v.0[i].store(&mut self.0[i]);
        }
    }
}

impl<L: Real> Vec3<L> {
    /// One vector in every lane.
    #[inline(always)]
    pub fn splat(v: glam::DVec3) -> Self {
        Self([L::from(v.x), L::from(v.y), L::from(v.z)])
    }

    /// Cross product.
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        let (a, b) = (self.0, b.0);
        let minor = |i: usize, j: usize| a[i].mul_add(b[j], -(a[j] * b[i]));
        Self([minor(1, 2), minor(2, 0), minor(0, 1)])
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, b: Self) -> L {
        dot3(&self.0, &b)
    }

    /// self · s + term.
    #[inline(always)]
    pub fn mul_add(self, s: L, term: Self) -> Self {
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

macro_rules! vector_operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl<L: Real> $trait for Vec3<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, b: Self) -> Self {
                Self([self.0[0] $op b.0[0], self.0[1] $op b.0[1], self.0[2] $op b.0[2]])
            }
        }
    };
}
vector_operator!(Add, add, +);
vector_operator!(Sub, sub, -);

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
#[derive(Debug, Clone, Copy)]
pub struct Mat3<L = Lanes>(pub [[L; 3]; 3]);

impl Mat3 {
    /// The matrix of one lane.
    pub fn lane(&self, lane: usize) -> nalgebra::Matrix3<f64> {
        nalgebra::Matrix3::from_fn(|i, j| self.0[i][j][lane])
    }
}

impl<L: Real> Mat3<L> {
    /// The cross-product matrix \[v×\].
    #[inline(always)]
    pub fn skew(v: Vec3<L>) -> Self {
        let z = L::from(0.0);
        Self([[z, -v[2], v[1]], [v[2], z, -v[0]], [-v[1], v[0], z]])
    }

    /// Every element times s.
    #[inline(always)]
    pub fn scaled(mut self, s: L) -> Self {
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
#[derive(Debug, Clone, Copy)]
pub struct Quat<L = Lanes> {
    /// Scalar part.
    pub w: L,
    /// Vector part.
    pub v: Vec3<L>,
}

impl Quat {
    /// The rotation of one lane.
    pub fn lane(&self, i: usize) -> glam::DQuat {
        let v = self.v.lane(i);
        glam::DQuat::from_xyzw(v.x, v.y, v.z, self.w[i])
    }

    /// Sets the rotation of one lane.
    pub fn set_lane(&mut self, i: usize, q: glam::DQuat) {
        self.w[i] = q.w;
        self.v.set_lane(i, q.xyz());
    }

    /// Into registers.
    #[inline(always)]
    pub fn load<W: Wide>(&self) -> Quat<W> {
        Quat {
            w: W::load(&self.w),
            v: self.v.load(),
        }
    }

    /// From registers.
    #[inline(always)]
    pub fn store<W: Wide>(&mut self, q: Quat<W>) {
        q.w.store(&mut self.w);
        self.v.store(q.v);
    }
}

impl<L: Real> Quat<L> {
    /// One rotation in every lane.
    #[inline(always)]
    pub fn splat(q: glam::DQuat) -> Self {
        Self {
            w: L::from(q.w),
            v: Vec3::splat(q.xyz()),
        }
    }

    /// The rotation by a rotation vector of at most π/2 radians.
    #[inline(always)]
    pub fn from_rotation_vector(phi: Vec3<L>) -> Self {
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
    pub fn renormalised(self) -> Self {
        // 1/√x ≈ (3 − x)/2 near 1: an error ε of the norm becomes 3ε²/2.
        let scale = (self.w * self.w + self.v.dot(self.v)) * -0.5 + 1.5;
        Self {
            w: self.w * scale,
            v: self.v * scale,
        }
    }

    /// The direction cosine matrix.
    #[inline(always)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use glam::{DMat3, DQuat, DVec3};

    #[test]
    fn sin_cos_is_within_two_ulp_of_the_scalar_functions() {
        let mut worst = 0.0_f64;
        for k in -40_000..40_000 {
            let x = f64::from(k) * 1.7e-3 + 1e-7;
            let (s, c) = Lanes::splat(x).sin_cos();
            let (es, ec) = x.sin_cos();
            worst = worst.max((s[0] - es).abs()).max((c[0] - ec).abs());
        }
        assert!(worst <= 2.0 * f64::EPSILON, "worst difference {worst:e}");
    }

    #[test]
    fn quaternion_algebra_agrees_with_glam() {
        let phi = DVec3::new(0.3, -0.5, 0.2);
        let q = Quat::from_rotation_vector(Vec3::splat(phi));
        let p = Quat::splat(DQuat::from_axis_angle(DVec3::new(0.6, 0.0, -0.8), 2.5));
        let expected = DQuat::from_scaled_axis(phi) * p.lane(3);
        assert!((q * p).lane(3).abs_diff_eq(expected, 1e-15));
        let m = (q * p).to_matrix();
        let e = DMat3::from_quat(expected);
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            assert_abs_diff_eq!(m.0[i][j][5], e.col(j)[i], epsilon = 1e-15);
        }
    }
}
