//! Between glam (vectors and rotations of physics) and nalgebra (matrices of estimation).

use glam::DVec3;
use nalgebra::{Matrix3, Vector3};

/// The larger of two numbers; NaN where either is, so that what was lost is not overlooked.
#[must_use]
pub const fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// glam vector to nalgebra.
#[must_use]
pub fn to_nalgebra(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// nalgebra vector to glam.
#[must_use]
pub fn to_glam(v: &Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

/// The cross-product matrix \[v×\].
#[must_use]
pub fn skew(v: DVec3) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_of_anything_and_nan_is_nan() {
        assert_eq!((larger(1.0, 2.0), larger(2.0, 1.0)), (2.0, 2.0));
        assert!(larger(f64::NAN, 1.0).is_nan() && larger(1.0, f64::NAN).is_nan());
    }

    #[test]
    fn the_cross_product_matrix_gives_the_cross_product() {
        let (v, u) = (DVec3::new(0.1, -0.2, 0.3), DVec3::new(3.0, 1.0, -2.0));
        assert_eq!(to_glam(&(skew(v) * to_nalgebra(u))), v.cross(u));
    }
}
