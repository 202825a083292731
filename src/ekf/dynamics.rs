//! First-order dynamics of the error state, in blocks.
//!
//! Two maps compose one step. [`Sample`] holds what changes with every IMU sample: the rotation of the
//! biases into n and the specific force. [`EarthTerms`] holds what the Earth contributes: transport and
//! Earth rate, Coriolis, gravity gradient, the errors of the transport rate. The latter change slowly and
//! are below 1e-4 /s, so they are applied in steps of up to [`EARTH_STEP_S`] (the splitting is of second
//! order: 1e-5 relative in a standard deviation over an outage, tested against the matrix exponential).
//!
//! [Groves](crate::bibliography::Groves13), sec. 14.2.4, with position in metres: delta r_n =
//! ((R_N + h) δlat, (R_E + h) cos lat δlon, −δh), whose dynamics are derived in closed form.

use super::covariance::{PSI, R, V};
use crate::earth::{E2, OMEGA_IE, gravity_down, radii};
use crate::lanes::{Lanes, Mat3, Real, Vec3};
use crate::strapdown::{StepTrace, Strapdown};
use glam::DVec3;

/// Longest step of the Earth terms (s).
pub const EARTH_STEP_S: f64 = 0.2;

/// Three rows of blocks of a matrix, R, V and PSI: the navigation rows of a block column of P.
#[derive(Debug, Clone, Copy)]
pub struct NavRows(pub [Mat3; 3]);

/// A linear map of the navigation error: what it does to the navigation rows of a block column, given the
/// summed accelerometer and gyroscope bias rows of the same column.
pub trait RowMap {
    /// The rows after the map.
    #[must_use]
    fn apply(&self, x: &NavRows, accel: &Mat3, gyro: &Mat3) -> NavRows;
}

/// The part of the transition that changes with every sample. Errors of the sample's biases are those of
/// the estimates: b_est − b.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// C_b_n · dt (s).
    c_dt: Mat3,
    /// ∫ f_ib_n dt (m/s).
    f_dt: Vec3,
    dt: f64,
}

impl Sample {
    /// From what the strapdown passed through.
    #[inline(always)]
    #[must_use]
    pub fn new(trace: &StepTrace, dt: f64) -> Self {
        Self { c_dt: trace.c_b_n * dt, f_dt: trace.dv_n, dt }
    }

    /// C diag(variances) Cᵀ dt²: the noise of one sample of a sensor, in n.
    #[inline(always)]
    #[must_use]
    pub fn rotated_noise(&self, variances: DVec3) -> Mat3 {
        if variances.x == variances.y && variances.x == variances.z {
            let q = Lanes::splat(variances.x * self.dt * self.dt);
            return Mat3::diagonal(Vec3([q; 3]));
        }
        let c = &self.c_dt;
        let mut scaled = *c;
        for i in 0..3 {
            for j in 0..3 {
                scaled.0[i][j] = c.0[i][j] * variances[j];
            }
        }
        scaled * c.transpose()
    }

    /// What the sample's own gyroscope noise does to the velocity of the same sample: the covariance of
    /// V and PSI it adds, −½ \[f_n dt ×\] q_psi.
    #[inline(always)]
    #[must_use]
    pub fn tilted_noise(&self, q_psi: &Mat3) -> Mat3 {
        self.cross_f(q_psi, -0.5)
    }

    /// \[f_n dt ×\] m · scale.
    #[inline(always)]
    fn cross_f(&self, m: &Mat3, scale: f64) -> Mat3 {
        let f = self.f_dt * scale;
        let mut product = Mat3::ZERO;
        for i in 0..3 {
            let (k, l) = ((i + 1) % 3, (i + 2) % 3);
            for j in 0..3 {
                product.0[i][j] = f[k] * m.0[l][j] - f[l] * m.0[k][j];
            }
        }
        product
    }
}

impl RowMap for Sample {
    /// Attitude first, velocity with its mean, position with the mean velocity: the second-order terms of
    /// the matrix exponential come with it.
    #[inline(always)]
    fn apply(&self, x: &NavRows, accel: &Mat3, gyro: &Mat3) -> NavRows {
        let x = &x.0;
        let psi = x[PSI] - self.c_dt * *gyro;
        let v = x[V] - (self.cross_f(&(x[PSI] + psi), 0.5) + self.c_dt * *accel);
        let r = x[R] + (x[V] + v) * (0.5 * self.dt);
        NavRows([r, v, psi])
    }
}

/// The blocks of F that the rotating, curved, heavy Earth contributes.
#[derive(Debug, Clone, Copy)]
pub struct EarthTerms {
    /// ∂(dr/dt)/∂r (1/s).
    pub rr: Mat3,
    /// ∂(dv/dt)/∂r (1/s²).
    pub vr: Mat3,
    /// ∂(dv/dt)/∂v (1/s).
    pub vv: Mat3,
    /// ∂(dpsi/dt)/∂r (rad/(m s)).
    pub psi_r: Mat3,
    /// ∂(dpsi/dt)/∂v (rad/m).
    pub psi_v: Mat3,
    /// ∂(dpsi/dt)/∂psi (1/s).
    pub psi_psi: Mat3,
}

impl EarthTerms {
    /// At the nominal state.
    #[inline(always)]
    #[must_use]
    pub fn at(ins: &Strapdown) -> Self {
        let z = Lanes::ZERO;
        let (s, c) = ins.lat.sin_cos();
        let radii = radii(s);
        let (rn, re) = (radii.meridian + ins.h, radii.transverse + ins.h);
        let [vn, ve, vd] = ins.v_n.0;
        let tan = s / c;
        let (wn, we) = (vn / rn, ve / re); // dlat/dt, cos(lat) dlon/dt
        // dR/dlat of both radii: 3 e² R_N s c/(1 − e² s²) and e² R_E s c/(1 − e² s²)
        let w2 = s * s * -E2 + 1.0;
        let drn = radii.meridian * s * c * (3.0 * E2) / w2;
        let dre = radii.transverse * s * c * E2 / w2;

        let rr = Mat3([[-(vd / rn), z, wn], [we * tan, -(wn * tan * rn / re) - vd / re, we], [z, z, z]]);
        // For r in metres: ∂/∂lat · 1/rn per metre north, −∂/∂h per metre down.
        let omega_ie = Vec3([c * OMEGA_IE, z, s * -OMEGA_IE]);
        let omega_en = Vec3([we, -wn, -(we * tan)]);
        let d_ie_north = Vec3([s * -OMEGA_IE, z, c * -OMEGA_IE]) * (Lanes::ONE / rn);
        let east = -(we * dre / re);
        let d_en_north =
            Vec3([east, wn * drn / rn, -(east * tan) - we * (tan * tan + 1.0)]) * (Lanes::ONE / rn);
        let d_en_down = Vec3([we / re, -(wn / rn), -(we * tan / re)]);
        let d_en_v = Mat3([[z, Lanes::ONE / re, z], [-(Lanes::ONE / rn), z, z], [z, -(tan / re), z]]);

        let coriolis = omega_ie * 2.0 + omega_en;
        let mut v_north = -(d_ie_north * 2.0 + d_en_north).cross(ins.v_n);
        let mut v_down = -d_en_down.cross(ins.v_n);
        let (g_north, g_down) = gravity_gradient(ins, s, c);
        v_north[2] += g_north / rn;
        v_down[2] += g_down;
        // ∂(−(2 w_ie + w_en) × v)/∂v = −[w×] + [v×] ∂w_en/∂v
        let vv = Mat3::skew(ins.v_n) * d_en_v - Mat3::skew(coriolis);
        // dpsi/dt = −w_in × psi − δw_in
        let (psi_north, psi_down) = (-(d_ie_north + d_en_north), -d_en_down);
        Self {
            rr,
            vr: columns(v_north, v_down),
            vv,
            psi_r: columns(psi_north, psi_down),
            psi_v: d_en_v * -1.0,
            psi_psi: Mat3::skew(-(omega_ie + omega_en)),
        }
    }
}

/// The Earth terms over a time step.
#[derive(Debug, Clone, Copy)]
pub struct EarthStep {
    /// The terms.
    pub terms: EarthTerms,
    /// How long they act (s).
    pub dt: f64,
}

impl RowMap for EarthStep {
    #[inline(always)]
    fn apply(&self, x: &NavRows, _accel: &Mat3, _gyro: &Mat3) -> NavRows {
        let (t, dt, x) = (&self.terms, self.dt, &x.0);
        NavRows([
            x[R] + t.rr * x[R] * dt,
            x[V] + (t.vr * x[R] + t.vv * x[V]) * dt,
            x[PSI] + (t.psi_r * x[R] + t.psi_v * x[V] + t.psi_psi * x[PSI]) * dt,
        ])
    }
}

/// The matrix with the given north and down columns; nothing depends on longitude.
#[inline(always)]
fn columns(north: Vec3, down: Vec3) -> Mat3 {
    let z = Lanes::ZERO;
    Mat3([[north[0], z, down[0]], [north[1], z, down[1]], [north[2], z, down[2]]])
}

/// (∂g/∂lat, ∂g/∂(down)) of the down component, by differences of the model itself: the step is exact
/// enough (second order, 1e-9 relative) and follows whatever gravity model is in use.
#[inline(always)]
fn gravity_gradient(ins: &Strapdown, s: Lanes, c: Lanes) -> (Lanes, Lanes) {
    const STEP_RAD: f64 = 1e-5;
    const STEP_M: f64 = 100.0;
    let (model, h) = (ins.gravity(), ins.h);
    let north = gravity_down(model, s + c * STEP_RAD, h) - gravity_down(model, s - c * STEP_RAD, h);
    let down = gravity_down(model, s, h - STEP_M) - gravity_down(model, s, h + STEP_M);
    (north * (0.5 / STEP_RAD), down * (0.5 / STEP_M))
}
