//! The blocks of the covariance against dense products.

use super::*;
use crate::tests::*;
use nalgebra::DVector;

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
    let s: Lanes = p.update(&sparse, 0.25, &mut ph, &mut gain);
    let expected_s = (h.transpose() * &m * &h)[0] + 0.25;
    let k = &m * &h / expected_s;
    let expected = &m - &k * h.transpose() * &m;
    assert_abs_diff_eq!(s[3], expected_s, epsilon = 1e-13);
    assert!((p.lane(2) - expected).abs().max() < 1e-13);
}

/// ln N(x; 0, P) = −½ (xᵀ P⁻¹ x + ln det 2πP).
#[test]
fn normalised_square_and_log_density_agree_with_inverse_and_determinant() {
    let (p, m) = example(3);
    let v = DVector::from_fn(9, |i, _| 0.1 * i as f64 - 0.3);
    let index: [usize; 9] = std::array::from_fn(|i| i);
    let x = index.map(|i| Lanes::splat(v[i]));
    let square: f64 = (v.transpose() * m.clone().try_inverse().unwrap() * &v)[0];
    let density = -0.5 * (square + (m * std::f64::consts::TAU).determinant().ln());
    // the condition of the matrix, below 1e4, times rounding of 1e-16 in each of 9³ products
    assert_relative_eq!(
        p.normalised_square(index, x)[6],
        square,
        max_relative = 1e-10
    );
    assert_relative_eq!(p.log_density(index, x)[6], density, max_relative = 1e-10);
}
