//! Measurements that a vehicle makes of itself: velocity of a point along its own axes, and yaw.
//!
//! The vehicle's axes are known in b but for small angles m (pitch and yaw): a velocity v along them as they are known
//! is v − m × v along them. The wheel reads 1 + k times the forward velocity. m and k are estimated where the belief
//! has states of them.

use super::covariance::{BIAS, PSI, V};
use super::filter::Ekf;
use super::update::{Antenna, Row};
use crate::frames::wrap_angle;
use crate::lanes::{Kernel, LANES, Lanes, Mat3, Real, Vec3, Wide, dispatch};
use crate::strapdown::Strapdown;
use glam::DVec3;

/// Velocity of a point of the vehicle along some of the vehicle's axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyVelocity {
    /// Measured velocity along forward, right, down (m/s); read where `axes` has them.
    pub(crate) value: Vec3,
    /// The axes that are measured.
    pub(crate) axes: &'static [usize],
    /// Variance of the white noise of each ((m/s)²).
    pub(crate) variance: f64,
    /// The point, from the IMU, in b (m).
    pub(crate) lever_arm_b: DVec3,
    /// The vehicle's forward, right, down in b, where m is zero.
    pub(crate) vehicle_b: [DVec3; 3],
}

/// What a scalar measurement found: estimate less measured, and the variance that the filter states of that.
pub(crate) type Innovation = [Lanes; 2];

/// Uses a velocity along the vehicle's axes; returns the innovation of each of its axes in sequence.
pub(crate) fn update_body_velocity(ekf: &mut Ekf, measured: &BodyVelocity) -> [Innovation; 3] {
    dispatch(ekf.level, UpdateVelocity { ekf, measured })
}

struct UpdateVelocity<'a> {
    ekf: &'a mut Ekf,
    measured: &'a BodyVelocity,
}

impl Kernel for UpdateVelocity<'_> {
    type Output = [Innovation; 3];
    #[inline(always)]
    fn run<W: Wide>(self) -> [Innovation; 3] {
        self.ekf.use_body_velocity::<W>(self.measured)
    }
}

/// Uses a yaw (rad) of the body, of a variance (rad²).
pub(crate) fn update_yaw(ekf: &mut Ekf, yaw: &Lanes, variance: f64) -> Innovation {
    let c = ekf.nominal.q_b_n.to_matrix();
    let mut z = Lanes::ZERO;
    for lane in 0..LANES {
        z[lane] = wrap_angle(c.0[1][0][lane].atan2(c.0[0][0][lane]) - yaw[lane]);
    }
    dispatch(
        ekf.level,
        UpdateYaw {
            ekf,
            z: &z,
            variance,
        },
    )
}

struct UpdateYaw<'a> {
    ekf: &'a mut Ekf,
    z: &'a Lanes,
    variance: f64,
}

impl Kernel for UpdateYaw<'_> {
    type Output = Innovation;
    #[inline(always)]
    fn run<W: Wide>(self) -> Innovation {
        let Self { ekf, z, variance } = self;
        let ins = ekf.nominal.load::<W>();
        ekf.apply_earth_terms(&ins);
        ekf.scratch.error.fill(Lanes::ZERO);
        let mut row = Row::default();
        row.push3(3 * PSI, yaw_row(&ins).0);
        let innovation = ekf.innovated(row.entries(), W::load(z), variance);
        ekf.correct(ins);
        innovation
    }
}

impl Ekf {
    /// The first state of wheel scale, mounting pitch and mounting yaw, where the belief has them: behind all others.
    fn vehicle(&self) -> Option<usize> {
        let last = BIAS + self.estimates.len() - 1;
        (self.belief.vehicle != DVec3::ZERO).then_some(3 * last)
    }

    /// Estimates of wheel scale (1), mounting pitch and yaw (rad), and their standard deviations, of the first lane.
    pub(crate) fn vehicle_estimates(&self) -> Option<[DVec3; 2]> {
        let first = self.vehicle()?;
        let sigma = self.p.variances(first / 3).lane(0).map(f64::sqrt);
        Some([self.estimates[first / 3 - BIAS].lane(0), sigma])
    }

    #[inline(always)]
    fn use_body_velocity<W: Wide>(&mut self, measured: &BodyVelocity) -> [Innovation; 3] {
        let ins = self.nominal.load::<W>();
        self.apply_earth_terms(&ins);
        self.scratch.error.fill(Lanes::ZERO);
        let point = Antenna::new(&ins, self.omega_ib_b.load(), measured.lever_arm_b);
        let states = self.vehicle();
        let estimates = states.map_or(Vec3::splat(DVec3::ZERO), |first| {
            self.estimates[first / 3 - BIAS].load::<W>()
        });
        let rows = BodyRows::new(&point, &ins);
        let [forward, right, down] = measured.vehicle_b.map(Vec3::<W>::splat);
        let in_b = |v: Vec3<W>| forward * v[0] + right * v[1] + down * v[2];
        let mut found = [[Lanes::ZERO; 2]; 3];
        for (found, &axis) in found.iter_mut().zip(measured.axes) {
            let along_b = in_b(along(axis, estimates));
            let [of_v, of_psi, of_gyro] = rows.along(along_b);
            let mut row = Row::default();
            row.push3(3 * V, of_v.0);
            row.push3(3 * PSI, of_psi.0);
            if measured.lever_arm_b != DVec3::ZERO {
                row.push_gyro(of_gyro.0, &self.sources());
            }
            if let Some(first) = states {
                // wheel scale, pitch, yaw: of the forward velocity, as `along` has them
                let (state, sign) = [(0, 1.0), (2, -1.0), (1, 1.0)][axis];
                row.push(first + state, forward.dot(rows.v_b) * sign);
            }
            let z = along_b.dot(rows.v_b) - W::load(&measured.value[axis]);
            *found = self.innovated(row.entries(), z, measured.variance);
        }
        self.correct(ins);
        found
    }
}

/// The axis of the vehicle in its axes as they are known, for these estimates of wheel scale, mounting pitch and yaw;
/// forward times what the wheel makes of it.
#[inline(always)]
fn along<L: Real>(axis: usize, states: Vec3<L>) -> Vec3<L> {
    let (zero, one) = (L::from(0.0), L::from(1.0));
    // v − m × v by components; in the first the velocities across are small, and so is m.
    match axis {
        0 => Vec3([states[0] + 1.0, zero, zero]),
        1 => Vec3([-states[2], one, zero]),
        _ => Vec3([states[1], zero, one]),
    }
}

/// How the velocity of a point, in b, depends on the errors of the navigation and of the gyroscope.
struct BodyRows<L> {
    c_b_n: Mat3<L>,
    /// Velocity of the point in b (m/s).
    v_b: Vec3<L>,
    /// ∂(velocity in n)/∂psi_n with the turn into b: C_est = (I + \[psi×\]) C_true, hence
    /// δ(Cᵀ u) = Cᵀ (δu + \[u×\] psi).
    of_psi: Mat3<L>,
    /// ∂(velocity in n)/∂(gyroscope's bias).
    of_gyro: Mat3<L>,
}

impl<L: Real> BodyRows<L> {
    #[inline(always)]
    fn new(point: &Antenna<L>, ins: &Strapdown<L>) -> Self {
        let c_b_n = ins.q_b_n.to_matrix();
        let u = ins.v_n + point.swing_n;
        let of_psi = point.of_psi - Mat3::skew(-u);
        Self {
            c_b_n,
            v_b: times_transposed(&c_b_n, u),
            of_psi,
            of_gyro: point.of_bias,
        }
    }

    /// Coefficients of V, PSI and the error of the gyroscope's bias in the velocity along an axis given in b.
    #[inline(always)]
    fn along(&self, axis_b: Vec3<L>) -> [Vec3<L>; 3] {
        let axis_n = self.c_b_n * axis_b;
        [
            axis_n,
            times_transposed(&self.of_psi, axis_n),
            times_transposed(&self.of_gyro, axis_n),
        ]
    }
}

/// Mᵀ v.
#[inline(always)]
fn times_transposed<L: Real>(m: &Mat3<L>, v: Vec3<L>) -> Vec3<L> {
    let rows = m.0.map(Vec3);
    rows[0] * v[0] + rows[1] * v[1] + rows[2] * v[2]
}

/// Yaw per psi_n (1): the turn of the projection of the body's axis on the horizontal.
#[inline(always)]
fn yaw_row<L: Real>(ins: &Strapdown<L>) -> Vec3<L> {
    let c = ins.q_b_n.to_matrix().0;
    let (n, e, d) = (c[0][0], c[1][0], c[2][0]);
    let slope = d / (n * n + e * e);
    Vec3([-(n * slope), -(e * slope), L::from(1.0)])
}

/// The rows of a velocity along forward, right and down about a nominal state: V, PSI and the error of the gyroscope's
/// bias behind R, twelve coefficients each.
#[must_use]
pub(crate) fn body_velocity_rows(
    ins: &Strapdown<f64>,
    omega_ib_b: DVec3,
    lever_arm_b: DVec3,
) -> [[f64; 12]; 3] {
    let point = Antenna::new(ins, Vec3::splat(omega_ib_b), lever_arm_b);
    let rows = BodyRows::new(&point, ins);
    DVec3::AXES.map(|axis| {
        let mut dense = [0.0; 12];
        for (block, coefficients) in rows.along(Vec3::splat(axis)).into_iter().enumerate() {
            dense[3 * (V + block)..3 * (V + block) + 3].copy_from_slice(&coefficients.0);
        }
        dense
    })
}

/// The row of a yaw in the same form.
#[must_use]
pub(crate) fn dense_yaw_row(ins: &Strapdown<f64>) -> [f64; 12] {
    let mut dense = [0.0; 12];
    dense[3 * PSI..3 * PSI + 3].copy_from_slice(&yaw_row(ins).0);
    dense
}
