//! The lane type: eight independent `f64` that advance together, and the small vectors made of it.
//!
//! Eight Monte-Carlo runs share one instruction stream. The operators are plain loops over `[f64; 8]`,
//! inlined into kernels that are compiled several times (portable, AVX2 + FMA, AVX-512) and dispatched at
//! run time, so a plain `cargo build --release` reaches the vector units of the machine. The hot paths
//! use explicit loops, not `array::from_fn` or closures: those are not always inlined, and what is not
//! inlined is not compiled for the wider units (a factor of ten, seen in the profile).
//!
//! [`Real`] is what a formula may ask of a number, so that the Earth model is written once for a scalar
//! (trajectories) and for lanes (the filter).

use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, Neg, Sub, SubAssign};

/// Runs in one batch.
pub const LANES: usize = 8;

/// What a formula may ask of a number: `f64` or [`Lanes`].
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
{
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Sine and cosine of an angle in radians, |x| ≤ 2^20.
    #[must_use]
    fn sin_cos(self) -> (Self, Self);
}

impl Real for f64 {
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        self.sin_cos()
    }
}

/// Eight independent values, one for each run of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// All lanes zero.
    pub const ZERO: Self = Self([0.0; LANES]);
    /// All lanes one.
    pub const ONE: Self = Self([1.0; LANES]);

    /// The same value in every lane.
    #[inline(always)]
    #[must_use]
    pub const fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    /// A value computed for each lane.
    #[inline(always)]
    #[must_use]
    pub fn from_fn(f: impl FnMut(usize) -> f64) -> Self {
        Self(std::array::from_fn(f))
    }

    /// Applies a function to every lane.
    #[inline(always)]
    #[must_use]
    pub fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut result = self;
        for value in &mut result.0 {
            *value = f(*value);
        }
        result
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
        impl $trait<f64> for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $method(self, other: f64) -> Lanes {
                let mut result = self;
                for i in 0..LANES {
                    result.0[i] = self.0[i] $op other;
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
        let mut result = self;
        for i in 0..LANES {
            result.0[i] = -self.0[i];
        }
        result
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Lanes {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Real for Lanes {
    #[inline(always)]
    fn sqrt(self) -> Self {
        let mut result = self;
        for i in 0..LANES {
            result.0[i] = self.0[i].sqrt();
        }
        result
    }

    /// Cody-Waite reduction by π/2 in three parts, then the Taylor series on [−π/4, π/4] to rounding.
    /// Branch-free, so that it vectorises; within 2 ulp of the scalar functions (tested).
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        // π/2 = P1 + P2 + P3, each with enough trailing zeros that k·P is exact for |k| < 2^20 (fdlibm).
        const P1: f64 = 1.570_796_326_734_125_6;
        const P2: f64 = 6.077_100_506_303_966e-11;
        const P3: f64 = 2.022_266_248_795_951e-21;
        // Adding and subtracting 1.5·2^52 rounds to the nearest integer.
        const ROUND: f64 = 6_755_399_441_055_744.0;
        let k = (self * std::f64::consts::FRAC_2_PI + ROUND) - ROUND;
        let x = self - k * P1 - k * P2 - k * P3;
        let (s, c) = sin_cos_kernel(x);
        // quadrant = k mod 4 in {−2, −1, 0, 1, 2}, without integers
        let quadrant = k - ((k * 0.25 + ROUND) - ROUND) * 4.0;
        let mut sin = Self::ZERO;
        let mut cos = Self::ZERO;
        for i in 0..LANES {
            let (swap, q) = (quadrant[i].abs() == 1.0, quadrant[i]);
            let (a, b) = if swap { (c[i], s[i]) } else { (s[i], c[i]) };
            sin[i] = if q == -1.0 || q.abs() == 2.0 { -a } else { a };
            cos[i] = if q == 1.0 || q.abs() == 2.0 { -b } else { b };
        }
        (sin, cos)
    }
}

/// sin and cos by Taylor series, exact to rounding for |x| ≤ π/4.
#[inline(always)]
fn sin_cos_kernel(x: Lanes) -> (Lanes, Lanes) {
    let (sinc, cos) = sinc_cos_of_square(x * x);
    (x * sinc, cos)
}

/// (sin x / x, cos x) as functions of x², exact to rounding for |x| ≤ π/4.
#[inline(always)]
#[must_use]
pub fn sinc_cos_of_square(x2: Lanes) -> (Lanes, Lanes) {
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
fn horner<const N: usize>(coefficients: &[f64; N], x: Lanes) -> Lanes {
    let mut sum = Lanes::splat(coefficients[0]);
    for i in 1..N {
        sum = sum * x + coefficients[i];
    }
    sum
}

/// Three-vector of lanes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vec3(pub [Lanes; 3]);

impl Vec3 {
    /// The zero vector.
    pub const ZERO: Self = Self([Lanes::ZERO; 3]);

    /// The same vector in every lane.
    #[inline(always)]
    #[must_use]
    pub fn splat(v: glam::DVec3) -> Self {
        Self([Lanes::splat(v.x), Lanes::splat(v.y), Lanes::splat(v.z)])
    }

    /// The vector of one lane.
    #[must_use]
    pub fn lane(&self, i: usize) -> glam::DVec3 {
        glam::DVec3::new(self.0[0][i], self.0[1][i], self.0[2][i])
    }

    /// Sets the vector of one lane.
    pub fn set_lane(&mut self, i: usize, v: glam::DVec3) {
        for k in 0..3 {
            self.0[k][i] = v[k];
        }
    }

    /// Cross product.
    #[inline(always)]
    #[must_use]
    pub fn cross(self, b: Self) -> Self {
        let (a, b) = (self.0, b.0);
        Self([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    }

    /// Scalar product.
    #[inline(always)]
    #[must_use]
    pub fn dot(self, b: Self) -> Lanes {
        self.0[0] * b.0[0] + self.0[1] * b.0[1] + self.0[2] * b.0[2]
    }
}

impl Add for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self([self.0[0] + b.0[0], self.0[1] + b.0[1], self.0[2] + b.0[2]])
    }
}

impl Sub for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self([self.0[0] - b.0[0], self.0[1] - b.0[1], self.0[2] - b.0[2]])
    }
}

impl Neg for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1], -self.0[2]])
    }
}

impl Mul<Lanes> for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: Lanes) -> Self {
        Self([self.0[0] * s, self.0[1] * s, self.0[2] * s])
    }
}

impl Mul<f64> for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f64) -> Self {
        Self([self.0[0] * s, self.0[1] * s, self.0[2] * s])
    }
}

impl Index<usize> for Vec3 {
    type Output = Lanes;
    #[inline(always)]
    fn index(&self, i: usize) -> &Lanes {
        &self.0[i]
    }
}

impl IndexMut<usize> for Vec3 {
    #[inline(always)]
    fn index_mut(&mut self, i: usize) -> &mut Lanes {
        &mut self.0[i]
    }
}

/// 3×3 matrix of lanes, `m[row][column]`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mat3(pub [[Lanes; 3]; 3]);

impl Mat3 {
    /// The zero matrix.
    pub const ZERO: Self = Self([[Lanes::ZERO; 3]; 3]);

    /// The matrix with the given diagonal.
    #[inline(always)]
    #[must_use]
    pub fn diagonal(d: Vec3) -> Self {
        let mut m = Self::ZERO;
        for i in 0..3 {
            m.0[i][i] = d[i];
        }
        m
    }

    /// The cross-product matrix \[v×\].
    #[inline(always)]
    #[must_use]
    pub fn skew(v: Vec3) -> Self {
        let z = Lanes::ZERO;
        Self([[z, -v[2], v[1]], [v[2], z, -v[0]], [-v[1], v[0], z]])
    }

    /// Transpose.
    #[inline(always)]
    #[must_use]
    pub fn transpose(&self) -> Self {
        let m = &self.0;
        Self([[m[0][0], m[1][0], m[2][0]], [m[0][1], m[1][1], m[2][1]], [m[0][2], m[1][2], m[2][2]]])
    }

    /// The matrix of one lane.
    #[must_use]
    pub fn lane(&self, lane: usize) -> nalgebra::Matrix3<f64> {
        nalgebra::Matrix3::from_fn(|i, j| self.0[i][j][lane])
    }
}

impl Mul for Mat3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let mut product = Self::ZERO;
        for i in 0..3 {
            for j in 0..3 {
                product.0[i][j] =
                    self.0[i][0] * b.0[0][j] + self.0[i][1] * b.0[1][j] + self.0[i][2] * b.0[2][j];
            }
        }
        product
    }
}

impl Mul<Vec3> for Mat3 {
    type Output = Vec3;
    #[inline(always)]
    fn mul(self, v: Vec3) -> Vec3 {
        let m = &self.0;
        Vec3([
            m[0][0] * v[0] + m[0][1] * v[1] + m[0][2] * v[2],
            m[1][0] * v[0] + m[1][1] * v[1] + m[1][2] * v[2],
            m[2][0] * v[0] + m[2][1] * v[1] + m[2][2] * v[2],
        ])
    }
}

impl Mul<f64> for Mat3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f64) -> Self {
        let mut result = self;
        for i in 0..3 {
            for j in 0..3 {
                result.0[i][j] = self.0[i][j] * s;
            }
        }
        result
    }
}

impl Add for Mat3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        let mut result = self;
        for i in 0..3 {
            for j in 0..3 {
                result.0[i][j] = self.0[i][j] + b.0[i][j];
            }
        }
        result
    }
}

impl Sub for Mat3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        let mut result = self;
        for i in 0..3 {
            for j in 0..3 {
                result.0[i][j] = self.0[i][j] - b.0[i][j];
            }
        }
        result
    }
}

/// Unit quaternion of lanes, `[w, x, y, z]`, Hamilton product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quat {
    /// Scalar part.
    pub w: Lanes,
    /// Vector part.
    pub v: Vec3,
}

impl Quat {
    /// The same rotation in every lane.
    #[must_use]
    pub fn splat(q: glam::DQuat) -> Self {
        Self { w: Lanes::splat(q.w), v: Vec3::splat(q.xyz()) }
    }

    /// The rotation of one lane.
    #[must_use]
    pub fn lane(&self, i: usize) -> glam::DQuat {
        let v = self.v.lane(i);
        glam::DQuat::from_xyzw(v.x, v.y, v.z, self.w[i])
    }

    /// Sets the rotation of one lane.
    pub fn set_lane(&mut self, i: usize, q: glam::DQuat) {
        self.w[i] = q.w;
        self.v.set_lane(i, q.xyz());
    }

    /// The rotation by a rotation vector of at most π/2 radians.
    #[inline(always)]
    #[must_use]
    pub fn from_rotation_vector(phi: Vec3) -> Self {
        let half = phi * 0.5;
        let (sinc, cos) = sinc_cos_of_square(half.dot(half));
        Self { w: cos, v: half * sinc }
    }

    /// One Newton step towards unit length: enough after each product of unit quaternions.
    #[inline(always)]
    #[must_use]
    pub fn renormalised(self) -> Self {
        let scale = (self.w * self.w + self.v.dot(self.v)) * -0.5 + 1.5;
        Self { w: self.w * scale, v: self.v * scale }
    }

    /// The direction cosine matrix.
    #[inline(always)]
    #[must_use]
    pub fn to_matrix(&self) -> Mat3 {
        let (w, [x, y, z]) = (self.w, self.v.0);
        let (x2, y2, z2) = (x + x, y + y, z + z);
        let (xx, yy, zz) = (x * x2, y * y2, z * z2);
        let (xy, xz, yz) = (x * y2, x * z2, y * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        let one = Lanes::ONE;
        Mat3([
            [one - (yy + zz), xy - wz, xz + wy],
            [xy + wz, one - (xx + zz), yz - wx],
            [xz - wy, yz + wx, one - (xx + yy)],
        ])
    }
}

impl Mul for Quat {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self { w: self.w * b.w - self.v.dot(b.v), v: b.v * self.w + self.v * b.w + self.v.cross(b.v) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
            assert!((m.0[i][j][5] - e.col(j)[i]).abs() < 1e-15);
        }
    }
}
