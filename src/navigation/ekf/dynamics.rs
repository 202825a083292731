//! First-order dynamics of the error state, in blocks.
//!
//! Two maps compose one step. [`Sample`] holds what changes with every IMU sample: the rotation of the
//! biases into n and the specific force. `EarthTerms` holds what the Earth contributes: transport and
//! Earth rate, Coriolis, gravity gradient, the errors of the transport rate. The latter change slowly and
//! are below 1e-4 /s, so they are applied in steps of up to `EARTH_STEP_S` (the splitting is of second
//! order: 1e-5 relative in a standard deviation over an outage, tested against the matrix exponential).
//!
//! [Groves](crate::bibliography::Groves13), sec. 14.2.4, with position in metres: delta r_n =
//! ((R_N + h) δlat, (R_E + h) cos lat δlon, −δh), whose dynamics are derived in closed form.

use super::covariance::{PSI, R, V};
use crate::earth::{E2, OMEGA_IE, gravity_down, radii};
use crate::lanes::{Mat3, Real, Vec3};
use crate::strapdown::{StepTrace, Strapdown};
use glam::DVec3;

/// Longest step of the Earth terms (s).
pub(crate) const EARTH_STEP_S: f64 = 0.2;

/// A navigation error: triples [`R`], [`V`] and [`PSI`].
pub(crate) type NavError<L> = [Vec3<L>; 3];

/// A linear map of the navigation error, given the errors of the accelerometer and gyroscope biases.
pub(crate) trait ErrorMap<L> {
    /// The error after the map.
    #[must_use]
    fn apply(&self, x: NavError<L>, accel: Vec3<L>, gyro: Vec3<L>) -> NavError<L>;
}

/// The part of the transition that changes with every sample. Errors of the sample's biases are those of
/// the estimates: b_est − b.
#[derive(Debug, Clone, Copy)]
pub struct Sample<L> {
    /// C_b_n · dt (s).
    c_dt: Mat3<L>,
    /// ½ ∫ f_ib_n dt (m/s).
    half_f_dt: Vec3<L>,
    half_dt: L,
}

impl<L: Real> Sample<L> {
    /// From what the strapdown passed through.
    #[inline(always)]
    #[must_use]
    pub(crate) fn new(trace: &StepTrace<L>, dt: f64) -> Self {
        Self {
            c_dt: trace.c_b_n.scaled(L::from(dt)),
            half_f_dt: trace.dv_n * L::from(0.5),
            half_dt: L::from(0.5 * dt),
        }
    }

    /// C diag(variances) Cᵀ dt²: the noise of one sample of a sensor, in n.
    #[inline(always)]
    #[must_use]
    pub(crate) fn rotated_noise(&self, variances: DVec3) -> Mat3<L> {
        let z = L::from(0.0);
        let mut noise = Mat3([[z; 3]; 3]);
        // C Cᵀ = I: equal axes need no rotation, and the mean attitude's missing cos(θ/2) does not enter
        // either.
        if variances.x == variances.y && variances.x == variances.z {
            for i in 0..3 {
                noise.0[i][i] = self.half_dt * self.half_dt * (4.0 * variances.x);
            }
            return noise;
        }
        for i in 0..3 {
            let row = self.c_dt.0[i];
            let scaled = Vec3([
                row[0] * variances.x,
                row[1] * variances.y,
                row[2] * variances.z,
            ]);
            for j in 0..3 {
                noise.0[i][j] = scaled.dot(Vec3(self.c_dt.0[j]));
            }
        }
        noise
    }

    /// The gyroscope noise of a sample tilts the specific force of the same sample: column j of what that adds to
    /// the covariance of V and PSI, −½ \[f_n dt ×\] q_psi.
    #[inline(always)]
    #[must_use]
    pub(crate) fn tilted_noise(&self, q_psi: &Mat3<L>, j: usize) -> Vec3<L> {
        Vec3([q_psi.0[0][j], q_psi.0[1][j], q_psi.0[2][j]]).cross(self.half_f_dt)
    }
}

impl<L: Real> ErrorMap<L> for Sample<L> {
    /// Attitude first, velocity with its mean, position with the mean velocity: the second-order terms of
    /// the matrix exponential come with it.
    #[inline(always)]
    fn apply(&self, x: NavError<L>, accel: Vec3<L>, gyro: Vec3<L>) -> NavError<L> {
        // psi_n turns C_true into C_est; a bias estimated too large is taken off too much, hence the minus
        // signs.
        let psi = x[PSI] - self.c_dt * gyro;
        // ½ (psi before + psi after) × f dt: a gyroscope bias reaches v with dt²/2, exactly; r below with
        // dt³/4 instead of dt³/6.
        let v = x[V] + (x[PSI] + psi).cross(self.half_f_dt) - self.c_dt * accel;
        let r = (x[V] + v).mul_add(self.half_dt, x[R]);
        [r, v, psi]
    }
}

/// The blocks of F that the rotating, curved, heavy Earth contributes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EarthTerms<L> {
    /// ∂(dr/dt)/∂r (1/s).
    pub rr: Mat3<L>,
    /// ∂(dv/dt)/∂r (1/s²).
    pub vr: Mat3<L>,
    /// ∂(dv/dt)/∂v (1/s).
    pub vv: Mat3<L>,
    /// ∂(dpsi/dt)/∂r (rad/(m s)).
    pub psi_r: Mat3<L>,
    /// ∂(dpsi/dt)/∂v (rad/m).
    pub psi_v: Mat3<L>,
    /// ∂(dpsi/dt)/∂psi (1/s).
    pub psi_psi: Mat3<L>,
}

impl<L: Real> EarthTerms<L> {
    /// At the nominal state.
    #[inline(always)]
    #[must_use]
    pub(crate) fn at(ins: &Strapdown<L>) -> Self {
        let (z, one) = (L::from(0.0), L::from(1.0));
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

        // d/dt of (R_N + h) δlat: the slope of R_N cancels between the factor and δlat. East, the slope of
        // (R_E + h) cos lat by latitude is −(R_N + h) sin lat: hence no derivative of a radius in this block.
        let rr = Mat3([
            [-(vd / rn), z, wn],
            [we * tan, -(wn * tan * rn / re) - vd / re, we],
            [z, z, z],
        ]);
        // For r in metres: ∂/∂lat · 1/rn per metre north, −∂/∂h per metre down.
        let omega_ie = Vec3([c * OMEGA_IE, z, s * -OMEGA_IE]);
        let omega_en = Vec3([we, -wn, -(we * tan)]);
        // omega_ie_n is (cos, 0, −sin)·omega_ie; its derivative by latitude, per metre north.
        let d_ie_north = Vec3([s * -OMEGA_IE, z, c * -OMEGA_IE]) * (one / rn);
        let east = -(we * dre / re);
        let d_en_north =
            Vec3([east, wn * drn / rn, -(east * tan) - we * (tan * tan + 1.0)]) * (one / rn);
        let d_en_down = Vec3([we / re, -(wn / rn), -(we * tan / re)]);
        // omega_en_n is linear in the velocity: this is the matrix itself.
        let d_en_v = Mat3([[z, one / re, z], [-(one / rn), z, z], [z, -(tan / re), z]]);

        let coriolis = omega_ie + omega_ie + omega_en;
        let mut v_north = -(d_ie_north + d_ie_north + d_en_north).cross(ins.v_n);
        let mut v_down = -d_en_down.cross(ins.v_n);
        let (g_north, g_down) = gravity_gradient(ins, s, c);
        // Gravity by latitude is 8e-9 m/s² a metre; by height 3.1e-6 /s², what makes the vertical channel
        // unstable (570 s).
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
            psi_v: d_en_v.scaled(L::from(-1.0)),
            psi_psi: Mat3::skew(-(omega_ie + omega_en)),
        }
    }
}

/// The Earth terms over a time step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EarthStep<L> {
    /// The terms.
    pub terms: EarthTerms<L>,
    /// How long they act (s).
    pub dt: f64,
}

impl<L: Real> ErrorMap<L> for EarthStep<L> {
    #[inline(always)]
    fn apply(&self, x: NavError<L>, _accel: Vec3<L>, _gyro: Vec3<L>) -> NavError<L> {
        let (t, dt) = (&self.terms, L::from(self.dt));
        [
            // I + F dt: the next term, F² dt²/2, is (1e-4 · 0.2)²/2 = 2e-10.
            (t.rr * x[R]).mul_add(dt, x[R]),
            (t.vr * x[R] + t.vv * x[V]).mul_add(dt, x[V]),
            (t.psi_r * x[R] + t.psi_v * x[V] + t.psi_psi * x[PSI]).mul_add(dt, x[PSI]),
        ]
    }
}

/// The matrix with the given north and down columns; nothing depends on longitude.
#[inline(always)]
fn columns<L: Real>(north: Vec3<L>, down: Vec3<L>) -> Mat3<L> {
    let z = L::from(0.0);
    Mat3([
        [north[0], z, down[0]],
        [north[1], z, down[1]],
        [north[2], z, down[2]],
    ])
}

/// (∂g/∂lat, ∂g/∂(down)) of the down component, by differences of the model itself: the step is exact
/// enough (second order, 1e-9 relative) and follows whatever gravity model is in use.
#[inline(always)]
fn gravity_gradient<L: Real>(ins: &Strapdown<L>, s: L, c: L) -> (L, L) {
    // The rounding of g over this step, 1e-15/1e-5, is 1e-9 of the derivative, its truncation less. In height
    // the series is quadratic, and a central difference exact for any step.
    const STEP_RAD: f64 = 1e-5;
    const STEP_M: f64 = 100.0;
    let (model, h) = (ins.gravity(), ins.h);
    let north = gravity_down(model, s + c * STEP_RAD, h) - gravity_down(model, s - c * STEP_RAD, h);
    let down = gravity_down(model, s, h + -STEP_M) - gravity_down(model, s, h + STEP_M);
    (north * (0.5 / STEP_RAD), down * (0.5 / STEP_M))
}
