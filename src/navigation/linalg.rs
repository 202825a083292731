//! Between glam (vectors and rotations of physics) and nalgebra (matrices of estimation).

use glam::DVec3;
use nalgebra::{DMatrix, DVector, Vector3};
use std::cmp::Ordering;

/// The larger of two numbers; NaN where either is, so that what was lost is not overlooked.
pub const fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// The order of pairs by their second number.
pub(crate) fn by_value<T>(a: &(T, f64), b: &(T, f64)) -> Ordering {
    a.1.total_cmp(&b.1)
}

/// Mean; NaN of nothing.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (count, sum) = values
        .into_iter()
        .fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x));
    sum / count
}

/// The value in the middle, in order.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// glam vector to nalgebra.
pub(crate) fn to_nalgebra(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// The regression of the error at an instant on that at the next one, for a backward smoother.
///
/// The error there is Φ times the error here plus noise. Given it, the error here is normal: its mean is
/// C = P Φᵀ (P⁻)⁻¹ times the error there, its covariance D = P − C P⁻ Cᵀ, where P is the covariance here and P⁻ that
/// predicted there ([Särkkä](crate::bibliography::Sarkka13), sec. 8.2). With the covariance P_s there, that here is
/// C P_s Cᵀ + D: a sum of what cannot be negative, unlike P + C (P_s − P⁻) Cᵀ, which it equals.
pub(crate) struct Link {
    gain: DMatrix<f64>,
    /// Lower triangle of D, column after column.
    rest: Vec<f64>,
}

impl Link {
    /// From the covariance here, the transition and the predicted covariance there, which may be singular.
    pub(crate) fn new(
        p: &DMatrix<f64>,
        transition: &DMatrix<f64>,
        predicted: &DMatrix<f64>,
    ) -> Self {
        let root = root(predicted);
        // P⁻ = L Lᵀ, W = L⁻¹ Φ P: C = (L⁻ᵀ W)ᵀ, D = P − Wᵀ W
        let mut w = transition * p;
        // The solver reports failure only for a zero on the diagonal, which `root` never leaves there.
        let _ = root.solve_lower_triangular_mut(&mut w);
        let n = p.nrows();
        let mut rest = Vec::with_capacity(n * (n + 1) / 2);
        rest.extend(lower(n).map(|(i, j)| p[(i, j)] - w.column(i).dot(&w.column(j))));
        let _ = root.tr_solve_lower_triangular_mut(&mut w);
        Self {
            gain: w.transpose(),
            rest,
        }
    }

    /// Mean and covariance of the error there become those of the error here.
    pub(crate) fn back(&self, error: &mut DVector<f64>, p: &mut DMatrix<f64>) {
        *error = &self.gain * &*error;
        // The upper triangle is copied from the lower below: the product is symmetric only to rounding, and
        // what is asymmetric would grow over the thousands of links of a backward pass.
        *p = &self.gain * &*p * self.gain.transpose();
        for ((i, j), rest) in lower(p.nrows()).zip(&self.rest) {
            p[(i, j)] += rest;
            p[(j, i)] = p[(i, j)];
        }
    }
}

/// Rows and columns of a lower triangle, column after column.
fn lower(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |j| (j..n).map(move |i| (i, j)))
}

/// The lower triangle L of a covariance P = L Lᵀ. A state that those before it determine, to rounding, has an infinite
/// pivot: what is divided by L has a zero there, and the quotient is that of a generalised inverse.
fn root(p: &DMatrix<f64>) -> DMatrix<f64> {
    let n = p.nrows();
    let mut l = DMatrix::zeros(n, n);
    for j in 0..n {
        let rest = |l: &DMatrix<f64>, i: usize| {
            p[(i, j)] - (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum::<f64>()
        };
        let pivot = rest(&l, j);
        // The pivot is what the states before leave of this variance: the rounding of n products cannot be
        // told from it.
        let is_free = pivot > n as f64 * f64::EPSILON * p[(j, j)];
        l[(j, j)] = if is_free { pivot.sqrt() } else { f64::INFINITY };
        for i in j + 1..n {
            l[(i, j)] = rest(&l, i) / l[(j, j)];
        }
    }
    l
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_of_anything_and_nan_is_nan() {
        assert_eq!((larger(1.0, 2.0), larger(2.0, 1.0)), (2.0, 2.0));
        assert!(larger(f64::NAN, 1.0).is_nan() && larger(1.0, f64::NAN).is_nan());
    }

    /// Numbers between −1/2 and 1/2 without pattern.
    fn scattered(rows: usize, columns: usize, seed: usize) -> DMatrix<f64> {
        let cube = |i: usize, j: usize| (i * 31 + j * 17 + seed * 7 + 3).pow(3) % 101;
        DMatrix::from_fn(rows, columns, |i, j| cube(i, j) as f64 / 100.0 - 0.5)
    }

    /// A linear system of six states: the fourth a constant that is not known, the fifth known exactly, the sixth the
    /// sum of the first two, so that every covariance is singular. Measurements at every second instant.
    struct System {
        first: DMatrix<f64>,
        transitions: Vec<DMatrix<f64>>,
        noise: DMatrix<f64>,
        rows: Vec<Option<DMatrix<f64>>>,
    }

    const DIM: usize = 6;
    const INSTANTS: usize = 15;
    const R: f64 = 0.04;

    fn system() -> System {
        let mut free = DMatrix::zeros(DIM, 4);
        (0..4).for_each(|i| free[(i, i)] = 1.0);
        (free[(5, 0)], free[(5, 1)]) = (1.0, 1.0);
        let transition = |k| {
            let mut of_free = scattered(4, DIM, k) * 0.6;
            (0..3).for_each(|i| of_free[(i, i)] += 1.0);
            of_free.row_mut(3).fill(0.0);
            of_free[(3, 3)] = 1.0;
            &free * of_free
        };
        let (first, mut noise) = (scattered(4, 4, 3), scattered(4, 4, 8) * 0.1);
        noise.row_mut(3).fill(0.0);
        let spread = |m: &DMatrix<f64>| &free * m * m.transpose() * free.transpose();
        let row = |k| (k % 2 == 1).then(|| scattered(1, DIM, k + 2));
        System {
            first: spread(&first) * 10.0,
            transitions: (0..INSTANTS - 1).map(transition).collect(),
            noise: spread(&noise),
            rows: (0..INSTANTS).map(row).collect(),
        }
    }

    impl System {
        /// The covariance of the states at all instants.
        fn prior(&self) -> DMatrix<f64> {
            let mut all = DMatrix::zeros(DIM * INSTANTS, DIM * INSTANTS);
            all.view_mut((0, 0), (DIM, DIM)).copy_from(&self.first);
            for (k, phi) in self.transitions.iter().enumerate() {
                let (here, next) = (DIM * k, DIM * (k + 1));
                let before = phi * all.view((here, 0), (DIM, next)).into_owned();
                let p = all.view((here, here), (DIM, DIM)).into_owned();
                all.view_mut((next, 0), (DIM, next)).copy_from(&before);
                all.view_mut((0, next), (next, DIM))
                    .copy_from(&before.transpose());
                all.view_mut((next, next), (DIM, DIM))
                    .copy_from(&(phi * p * phi.transpose() + &self.noise));
            }
            all
        }

        /// Mean and covariance at all instants given all measurements, at once.
        fn batch(&self, z: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
            let measured: Vec<usize> = (0..INSTANTS).filter(|k| self.rows[*k].is_some()).collect();
            let mut h = DMatrix::zeros(measured.len(), DIM * INSTANTS);
            for (m, &k) in measured.iter().enumerate() {
                h.view_mut((m, DIM * k), (1, DIM))
                    .copy_from(self.rows[k].as_ref().unwrap());
            }
            let z = DVector::from_iterator(measured.len(), measured.iter().map(|k| z[*k]));
            let prior = self.prior();
            let s =
                &h * &prior * h.transpose() + DMatrix::identity(measured.len(), measured.len()) * R;
            let gain = &prior * h.transpose() * s.try_inverse().unwrap();
            (&gain * z, &prior - gain * h * &prior)
        }
    }

    /// Means and covariances of the recursion are those of all instants and all measurements in one.
    #[test]
    fn the_backward_recursion_is_the_batch_solution() {
        let system = system();
        let z: Vec<f64> = (0..INSTANTS).map(|k| ((k * 13) % 7) as f64 - 3.0).collect();
        let (mut mean, mut p) = (DVector::zeros(DIM), system.first.clone());
        let mut way = Vec::new();
        for k in 0..INSTANTS {
            let predicted = mean.clone();
            if k > 0 {
                let phi = &system.transitions[k - 1];
                let next = phi * &p * phi.transpose() + &system.noise;
                let link = Link::new(&p, phi, &next);
                (mean, p) = (phi * &mean, next);
                way.push((predicted, mean.clone(), link));
            }
            if let Some(h) = &system.rows[k] {
                let gain = &p * h.transpose() / ((h * &p * h.transpose())[0] + R);
                mean += &gain * (z[k] - (h * &mean)[0]);
                p -= &gain * h * &p;
            }
        }
        let (means, covariances) = system.batch(&z);
        let scale = system.prior().diagonal().amax();
        for k in (0..INSTANTS).rev() {
            let found = means.rows(DIM * k, DIM) - &mean;
            assert!(found.amax() < 1e-9 * scale.sqrt(), "{k}: {found}");
            let found = covariances.view((DIM * k, DIM * k), (DIM, DIM)) - &p;
            assert!(found.amax() < 1e-9 * scale, "{k}: {found}");
            if let Some((here, predicted, link)) = way.pop() {
                let mut error = predicted - mean;
                link.back(&mut error, &mut p);
                mean = here - error;
            }
        }
        // the smoother must have had something to do
        assert!(covariances[(0, 0)] < 0.2 * system.first[(0, 0)]);
    }

    /// The factor of a singular matrix: the states that are left free reproduce it.
    #[test]
    fn a_state_that_others_determine_is_left_out() {
        let p = system().first;
        let root = root(&p);
        let free: Vec<usize> = (0..DIM).filter(|i| root[(*i, *i)].is_finite()).collect();
        assert_eq!(free, [0, 1, 2, 3]);
        let l = root.select_columns(&free);
        assert!((&l * l.transpose() - &p).amax() < 1e-14 * p.amax());
    }
}
