//! The lane type: eight independent `f64` that advance together, and the small vectors made of it.
//!
//! Eight Monte-Carlo runs share one instruction stream. [`Lanes`] is how they stand in memory; in the
//! kernels of the filter they are registers of the machine ([`Wide`]), chosen at run time by `dispatch`,
//! so a plain `cargo build --release` reaches the vector units. The formulas are written once, over
//! [`Real`]: the Earth model for a scalar (trajectories), strapdown and covariance for any width.
//!
//! `[f64; 8]` alone is not enough: LLVM splits it into eight scalars and restores vector instructions only in part,
//! with shuffles between (seen in the profile).

mod elementary;
mod space;
mod wide;

pub(crate) use elementary::rounded;
pub use space::{Mat3, Quat, Vec3};
pub(crate) use wide::{Kernel, dispatch};
pub use wide::{Level, Wide};

use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, Neg, Sub, SubAssign};

/// Runs in one batch.
pub const LANES: usize = 8;

/// What a formula may ask of a number: `f64`, or eight of them.
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
        elementary::sin_cos(self)
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
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// All lanes zero.
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    /// The same value in every lane.
    #[inline(always)]
    #[must_use]
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

/// What follows from the four operations and `From<f64>`.
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
