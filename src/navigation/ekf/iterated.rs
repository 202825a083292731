//! Iterated update by a fix, in an error that stays nearly normal where attitude errors are no longer small.
//!
//! A wrong attitude turns the specific force: with a constant error ψ that of the velocity is ∫ (I − exp(−ψ)) f dt = J(−ψ) ρ with
//! ρ = ψ × ∫ f dt, f as the filter has it and J the left Jacobian of SO(3) ([Solà](crate::bibliography::Sola18), eq. 145); the
//! error of position alike. That is the exponential of SE₂(3) about the estimate. (ρ, ψ) is normal while J(−ψ) ρ has
//! a mean: the shift that the first fixes after a long outage would put into the biases. So a fix is met by Gauss-Newton
//! steps in ξ = (ρ_r, ρ_v, ψ, biases), and the covariance of ξ is carried to the new estimate
//! ([Goffin et al.](crate::bibliography::Goffin24)). Between fixes nothing differs, since J(0) = I.

use super::covariance::{NAV, PSI, R, V};
use super::filter::{Ekf, settle};
use super::snapshot::apply_correction;
use super::update::{Fix, fix_rows};
use crate::imu::Sensor;
use crate::lanes::{LANES, Lanes};
use crate::strapdown::Strapdown;
use glam::DVec3;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Gauss-Newton steps at a fix.
const STEPS: usize = 4;

/// Uses a fix in all runs; returns its NIS, which is that of the first step.
pub(super) fn update(ekf: &mut Ekf, fix: &Fix) -> Lanes {
    settle(ekf);
    let before = ekf.clone();
    let variances = variances(fix);
    let mut lanes: Vec<Lane> = (0..LANES)
        .map(|lane| Lane::new(before.p.lane(lane)))
        .collect();
    let mut nis = Lanes::ZERO;
    for step in 0..STEPS {
        let innovation = ekf.innovation(fix);
        for (lane, run) in lanes.iter_mut().enumerate() {
            let z = innovation
                .iter()
                .flat_map(|v| v.lane(lane).to_array())
                .take(variances.len());
            let square = run.step(
                &rows(ekf, lane, fix, variances.len()),
                &z.collect::<Vec<_>>(),
                &variances,
            );
            if step == 0 {
                nis[lane] = square;
            }
        }
        // Every step corrects the state from which all of them began, by the whole error.
        ekf.return_to(&before, &lanes);
    }
    for (lane, run) in lanes.iter().enumerate() {
        ekf.p.set_lane(lane, &run.posterior(&variances));
    }
    // The rate of the last sample belongs to the sample, as after any other update.
    ekf.omega_ib_b = before.omega_ib_b;
    nis
}

fn variances(fix: &Fix) -> Vec<f64> {
    let velocity = fix.v_n.map(|_| fix.vel_sigma_m_s.to_array());
    let sigmas = fix
        .pos_sigma_m
        .to_array()
        .into_iter()
        .chain(velocity.into_iter().flatten());
    sigmas.map(|sigma| sigma * sigma).collect()
}

/// The measurement rows of one run at its present state, dense.
fn rows(ekf: &Ekf, lane: usize, fix: &Fix, count: usize) -> DMatrix<f64> {
    let ins = Strapdown::single(&ekf.nominal.lane(lane), ekf.nominal.gravity());
    let twelve = fix_rows(&ins, ekf.omega_ib_b.lane(lane), fix.lever_arm_b);
    let [_, gyro, unknown, gyro_unknown] = ekf.sources().starts();
    let mut h = DMatrix::zeros(count, ekf.p.dim());
    for (i, row) in twelve.iter().enumerate().take(count) {
        (0..NAV).for_each(|k| h[(i, k)] = row[k]);
        let of_rate = &row[NAV..];
        // All biases of the gyroscope act alike, its unknowns each times what it is multiplied by.
        (gyro..unknown).for_each(|k| h[(i, k)] = of_rate[k % 3]);
        for (u, regressor) in ekf.regressors[Sensor::Gyro as usize].iter().enumerate() {
            let value = regressor.value.lane(lane);
            (0..3).for_each(|k| h[(i, gyro_unknown + 3 * u + k)] = of_rate[k] * value[k]);
        }
    }
    h
}

/// One run at a fix.
struct Lane {
    /// Covariance of ξ before the fix.
    prior: DMatrix<f64>,
    xi: DVector<f64>,
    /// Coefficients of ξ in the measurements, and gain, of the last step.
    h: DMatrix<f64>,
    gain: DMatrix<f64>,
}

impl Lane {
    fn new(prior: DMatrix<f64>) -> Self {
        let n = prior.nrows();
        let none = DMatrix::zeros(0, 0);
        Self {
            prior,
            xi: DVector::zeros(n),
            h: none.clone(),
            gain: none,
        }
    }

    /// From rows and innovation at ξ to the next ξ; returns zᵀ S⁻¹ z, NaN where S is not positive definite.
    fn step(&mut self, rows: &DMatrix<f64>, z: &[f64], variances: &[f64]) -> f64 {
        self.h = rows * carried(&self.xi);
        let ph = &self.prior * self.h.transpose();
        let s = &self.h * &ph + DMatrix::from_diagonal(&DVector::from_column_slice(variances));
        // The innovation as it would be at ξ = 0 of a linear measurement.
        let z = DVector::from_column_slice(z) + &self.h * &self.xi;
        let Some(s) = s.cholesky() else {
            self.xi.fill(f64::NAN);
            return f64::NAN;
        };
        self.gain = s.solve(&ph.transpose()).transpose();
        self.xi = &self.gain * &z;
        z.dot(&s.solve(&z))
    }

    /// Covariance of the error at the new estimate, in Joseph's form ([Bar-Shalom](crate::bibliography::BarShalom01),
    /// eq. 5.2.3-17).
    fn posterior(&self, variances: &[f64]) -> DMatrix<f64> {
        if self.gain.is_empty() {
            return DMatrix::from_element(self.prior.nrows(), self.prior.nrows(), f64::NAN);
        }
        let rest = DMatrix::identity(self.xi.len(), self.xi.len()) - &self.gain * &self.h;
        let noise = &self.gain * DMatrix::from_diagonal(&DVector::from_column_slice(variances));
        let p = &rest * &self.prior * rest.transpose() + noise * self.gain.transpose();
        let g = carried(&self.xi);
        let p = &g * p * g.transpose();
        // Rounding alone makes it asymmetric; both triangles are read.
        0.5 * (&p + p.transpose())
    }

    /// The errors that ξ takes out of the state: J(−ψ) ρ for ρ.
    fn errors(&self) -> DVector<f64> {
        let mut errors = self.xi.clone();
        let j = left_jacobian(&-triple(&self.xi, PSI));
        for block in [R, V] {
            errors
                .fixed_rows_mut::<3>(3 * block)
                .copy_from(&(j * triple(&self.xi, block)));
        }
        errors
    }
}

impl Ekf {
    /// Sets state and estimates to those before the fix less the errors of each run, and the rate of the last sample to that
    /// of the new biases.
    fn return_to(&mut self, before: &Self, lanes: &[Lane]) {
        self.nominal = before.nominal;
        self.estimates.clone_from(&before.estimates);
        let [_, gyro, unknown, gyro_unknown] = self.sources().starts();
        for (lane, run) in lanes.iter().enumerate() {
            let errors = run.errors();
            self.scratch
                .error
                .iter_mut()
                .zip(&errors)
                .for_each(|(to, from)| to[lane] = *from);
            let at = |first: usize| DVec3::new(errors[first], errors[first + 1], errors[first + 2]);
            let biases: DVec3 = (gyro..unknown).step_by(3).map(at).sum();
            let regressors = self.regressors[Sensor::Gyro as usize].iter().enumerate();
            let unknowns: DVec3 = regressors
                .map(|(u, r)| at(gyro_unknown + 3 * u) * r.value.lane(lane))
                .sum();
            self.omega_ib_b
                .set_lane(lane, before.omega_ib_b.lane(lane) + biases + unknowns);
        }
        apply_correction(self);
    }
}

fn triple(x: &DVector<f64>, block: usize) -> Vector3<f64> {
    x.fixed_rows::<3>(3 * block).into()
}

/// ∂/∂ξ of the error at the estimate that ξ leads to: J(−ψ) and ∂(J(−ψ) ρ)/∂ψ for position and velocity; J(−ψ) for the attitude,
/// since exp(−ψ) exp(ψ + η) = exp(J(−ψ) η).
fn carried(xi: &DVector<f64>) -> DMatrix<f64> {
    let back = -triple(xi, PSI);
    let j = left_jacobian(&back);
    let mut g = DMatrix::identity(xi.len(), xi.len());
    for block in [R, V] {
        g.fixed_view_mut::<3, 3>(3 * block, 3 * block).copy_from(&j);
        // By the chain rule: J is of −ψ.
        g.fixed_view_mut::<3, 3>(3 * block, 3 * PSI)
            .copy_from(&-by_psi(&back, &triple(xi, block)));
    }
    g.fixed_view_mut::<3, 3>(3 * PSI, 3 * PSI).copy_from(&j);
    g
}

/// Below this angle (rad) the quotients below are their series: the next term is under 1e-9.
const SMALL: f64 = 0.05;

/// (1 − cos θ)/θ² and (θ − sin θ)/θ³, and the derivatives of both by θ over θ.
fn coefficients(theta: f64) -> [f64; 4] {
    let t2 = theta * theta;
    if theta < SMALL {
        return [
            0.5 - t2 / 24.0 + t2 * t2 / 720.0,
            1.0 / 6.0 - t2 / 120.0 + t2 * t2 / 5040.0,
            -1.0 / 12.0 + t2 / 180.0,
            -1.0 / 60.0 + t2 / 1260.0,
        ];
    }
    let (s, c) = theta.sin_cos();
    let (a, b) = ((1.0 - c) / t2, (theta - s) / (t2 * theta));
    [a, b, (s / theta - 2.0 * a) / t2, (a - 3.0 * b) / t2]
}

/// Left Jacobian of SO(3): I + a [ψ×] + b [ψ×]².
fn left_jacobian(psi: &Vector3<f64>) -> Matrix3<f64> {
    let [a, b, ..] = coefficients(psi.norm());
    let cross = psi.cross_matrix();
    Matrix3::identity() + cross * a + cross * cross * b
}

/// ∂(J(ψ) ρ)/∂ψ.
fn by_psi(psi: &Vector3<f64>, rho: &Vector3<f64>) -> Matrix3<f64> {
    let [a, b, of_a, of_b] = coefficients(psi.norm());
    let (once, twice) = (psi.cross(rho), psi.cross(&psi.cross(rho)));
    let products = rho.cross_matrix() * -a
        - (once.cross_matrix() + psi.cross_matrix() * rho.cross_matrix()) * b;
    products + (once * of_a + twice * of_b) * psi.transpose()
}

#[cfg(test)]
mod tests;
