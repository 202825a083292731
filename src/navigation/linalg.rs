//! Between glam (vectors and rotations of physics) and nalgebra (matrices of estimation).

use glam::DVec3;
use nalgebra::Vector3;

/// The larger of two numbers; NaN where either is, so that what was lost is not overlooked.
#[must_use]
pub const fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// glam vector to nalgebra.
#[must_use]
pub(crate) fn to_nalgebra(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// nalgebra vector to glam.
#[must_use]
pub(crate) fn to_glam(v: &Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
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
    fn vectors_go_there_and_back() {
        let v = DVec3::new(0.1, -0.2, 0.3);
        assert_eq!(to_glam(&to_nalgebra(v)), v);
    }
}
