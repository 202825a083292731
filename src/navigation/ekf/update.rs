//! GNSS updates: position and velocity of an antenna on a lever arm, as scalars in sequence.

use super::covariance::{BIAS, NAV, PSI, R, V};
use super::filter::{Ekf, apply_pending_earth_step};
use crate::earth::{OMEGA_IE, radii};
use crate::frames::wrap_angle;
use crate::imu::Sensor;
use crate::lanes::{Kernel, LANES, Lanes, Mat3, Quat, Real, Vec3, Wide, dispatch, rounded};
use crate::strapdown::Strapdown;
use glam::DVec3;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smallvec::{SmallVec, smallvec};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A fix for each of eight runs; the standard deviations are the filter's belief and the same for all.
#[derive(Debug, Clone, Copy)]
pub struct Fix {
    /// Latitude of the antenna (rad).
    pub lat: Lanes,
    /// Longitude (rad).
    pub lon: Lanes,
    /// Height (m).
    pub h: Lanes,
    /// Velocity of the antenna in n (m/s), if measured.
    pub v_n: Option<Vec3>,
    /// Standard deviations of the position north, east, down (m).
    pub pos_sigma_m: DVec3,
    /// Standard deviations of the velocity (m/s); read only when there is a velocity.
    pub vel_sigma_m_s: DVec3,
    /// Antenna from IMU, in b (m).
    pub lever_arm_b: DVec3,
}

impl Ekf {
    /// The scalars of a fix: position, then velocity where it is measured.
    pub(super) fn scalars_of(&self, fix: &Fix) -> SmallVec<[Scalar; 6]> {
        let antenna = Antenna::new(&self.nominal, self.omega_ib_b, fix.lever_arm_b);
        let (position, velocity) = antenna.innovation(&self.nominal, fix);
        let z = [Some(position), velocity].into_iter().flatten();
        let sigmas = [fix.pos_sigma_m, fix.vel_sigma_m_s].map(|s| s.to_array());
        let rows = antenna.rows().into_iter().zip(sigmas.into_iter().flatten());
        rows.zip(z.flat_map(|z| z.0))
            .map(|((h, sigma), z)| Scalar {
                row: self.row(&h),
                z,
                variance: sigma * sigma,
            })
            .collect()
    }

    /// Estimated less measured position and velocity of the antenna in the first lane (m and m/s, north, east, down), and
    /// their covariance.
    pub(crate) fn innovation(&self, fix: &Fix) -> (DVector<f64>, DMatrix<f64>) {
        let (h, z, noise) = dense(&self.scalars_of(fix), 0, self.p.dim());
        (z, &h * self.p.lane(0) * h.transpose() + noise)
    }

    /// The states that a measurement depends on, and their coefficients.
    fn row(&self, h: &Coefficients<Lanes>) -> SparseRow {
        let sources = self.sources();
        let [_, gyro, unknown, gyro_unknown] = sources.starts();
        // The rate is that of the last sample: its biases count all alike. Its white noise times the arm
        // is left out: at 1 m it is mm/s beside the cm/s of a receiver.
        let biases = (gyro..unknown).map(|state| (state, h[NAV + state % 3]));
        let unknowns = sources.regressors[1]
            .iter()
            .zip((gyro_unknown..).step_by(3));
        let unknowns = unknowns.flat_map(|(regressor, first)| {
            (0..3).map(move |k| (first + k, h[NAV + k] * regressor.value[k]))
        });
        let all = h[..NAV].iter().copied().enumerate();
        let all = all.chain(biases).chain(unknowns);
        all.filter(|(_, coefficient)| *coefficient != Lanes::ZERO)
            .collect()
    }

    /// One scalar; returns the innovation and its variance.
    #[inline(always)]
    fn take<W: Wide>(&mut self, scalar: &Scalar) -> (W, W) {
        let (h, scratch) = (&scalar.row, &mut self.scratch);
        let s: W = self
            .p
            .update(h, scalar.variance, &mut scratch.ph, &mut scratch.gain);
        // What the scalars before have already explained. The nominal state moves only after the last one, so
        // all six are linearised at the same state, and their order changes nothing but rounding.
        let mut innovation = W::load(&scalar.z);
        for (i, c) in h {
            innovation -= W::load(c) * W::load(&scratch.error[*i]);
        }
        for (error, gain) in scratch.error.iter_mut().zip(&scratch.gain) {
            W::load(gain)
                .mul_add(innovation, W::load(error))
                .store(error);
        }
        (innovation, s)
    }

    /// One scalar by the row and the gain along the reference. A row about the run's own estimate does not go with that
    /// covariance: it would turn what is well known along the reference into directions in which nothing is known.
    #[inline(always)]
    fn take_shared<W: Wide>(&mut self, scalar: &Scalar, shared: &SharedUpdate) -> (W, W) {
        let error = &mut self.scratch.error;
        let mut innovation = W::load(&scalar.z);
        for (i, c) in &shared.row {
            innovation -= W::load(&error[*i]) * *c;
        }
        for (error, gain) in error.iter_mut().zip(&shared.gain) {
            innovation
                .mul_add(W::from(*gain), W::load(error))
                .store(error);
        }
        (innovation, W::from(shared.variance))
    }

    /// Takes the estimated error out of the nominal state and the biases.
    #[inline(always)]
    fn correct<W: Wide>(&mut self, mut ins: Strapdown<W>) {
        let (dr, dv, psi) = (
            self.scratch.of::<W>(R),
            self.scratch.of(V),
            self.scratch.of(PSI),
        );
        let (s, c) = ins.lat.sin_cos();
        let radii = radii(s);
        // The order matters: longitude and latitude take the metres back with the radii, height and latitude
        // at which they were made.
        ins.lon -= dr[1] / ((radii.transverse + ins.h) * c);
        ins.lat -= dr[0] / (radii.meridian + ins.h);
        ins.h += dr[2];
        ins.v_n = ins.v_n - dv;
        // C_est = (I + [psi×]) C_true: the correction is the inverse rotation, on the side of n. As an exact
        // rotation, not I − [psi×], it stays valid for the large first corrections of an alignment.
        ins.q_b_n = (Quat::from_rotation_vector(-psi) * ins.q_b_n).renormalised();
        self.nominal.store(&ins);
        for (g, estimate) in self.estimates.iter_mut().enumerate() {
            estimate.store(estimate.load::<W>() - self.scratch.of(BIAS + g));
        }
    }
}

/// A scalar update along the reference, for all runs.
#[derive(Debug, Clone)]
pub(crate) struct SharedUpdate {
    /// States that the measurement depends on, and their coefficients.
    pub row: Vec<(usize, f64)>,
    /// One entry a state.
    pub gain: Box<[f64]>,
    /// The variance of the innovation.
    pub variance: f64,
}

/// Source of a filter's gains.
#[derive(Debug, Clone, Default)]
pub(crate) enum GainSource {
    /// Its own covariance.
    #[default]
    Own,
    /// Updates for the next scalars, of which so many are used; no covariance is propagated.
    Given(Arc<[SharedUpdate]>, usize),
}

/// Measurement update with a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FixUpdate {
    /// Linearised once, at the state before the fix.
    #[default]
    Ekf,
    /// Four Gauss-Newton steps in an error that stays nearly normal at tilts of degrees: after long outages.
    Iterated,
}

/// Uses a fix: up to six scalar updates in sequence, then the correction of the nominal state. Returns the
/// normalised innovation squared (NIS) of the fix.
pub fn update(ekf: &mut Ekf, fix: &Fix) -> Lanes {
    match ekf.fix_update {
        FixUpdate::Ekf => {
            let scalars = ekf.scalars_of(fix);
            // The density of six innovations is a product of conditional ones: the squares of the sequence sum
            // to zᵀ S⁻¹ z.
            let squares = use_scalars(ekf, &scalars).into_iter().map(nis);
            squares.fold(Lanes::ZERO, |sum, square| sum + square)
        }
        FixUpdate::Iterated => update_iterated(ekf, fix),
    }
}

/// Innovation of a scalar measurement (estimate minus measured) and its variance by the filter.
type Innovation = [Lanes; 2];

/// Innovations of the components of a fix.
type Innovations = SmallVec<[Innovation; 6]>;

/// Normalised innovation squared.
fn nis([z, s]: Innovation) -> Lanes {
    z * z / s
}

/// A scalar measurement of eight runs.
pub(super) struct Scalar {
    row: SparseRow,
    /// Estimate less measured.
    z: Lanes,
    /// Variance of its white noise.
    variance: f64,
}

/// Uses scalars in sequence, then corrects the nominal state; returns the innovation of each.
fn use_scalars(ekf: &mut Ekf, scalars: &[Scalar]) -> Innovations {
    apply_pending_earth_step(ekf);
    ekf.scratch.error.fill(Lanes::ZERO);
    dispatch(ekf.level, UseScalars { ekf, scalars })
}

/// Takes the estimated errors out of the state and the estimates of all lanes.
pub(super) fn apply_correction(ekf: &mut Ekf) {
    let scalars = &[];
    let _ = dispatch(ekf.level, UseScalars { ekf, scalars });
}

struct UseScalars<'a> {
    ekf: &'a mut Ekf,
    scalars: &'a [Scalar],
}

impl Kernel for UseScalars<'_> {
    type Output = Innovations;
    #[inline(always)]
    fn run<W: Wide>(self) -> Innovations {
        let mut found = Innovations::from_elem([Lanes::ZERO; 2], self.scalars.len());
        let given = match &mut self.ekf.gains {
            GainSource::Given(updates, used) => {
                let first = *used;
                *used += self.scalars.len();
                Some((updates.clone(), first))
            }
            _ => None,
        };
        for (i, (scalar, [z, s])) in self.scalars.iter().zip(&mut found).enumerate() {
            let (innovation, variance) = match &given {
                Some((updates, first)) => self.ekf.take_shared::<W>(scalar, &updates[first + i]),
                None => self.ekf.take::<W>(scalar),
            };
            innovation.store(z);
            variance.store(s);
        }
        self.ekf.correct(self.ekf.nominal.load::<W>());
        found
    }
}

/// Uses a height above the ellipsoid (m), measured at the IMU with a standard deviation. Returns its NIS.
pub(crate) fn update_height(ekf: &mut Ekf, h: &Lanes, sigma_m: f64) -> Lanes {
    // the third component of the position error is down: estimated less measured
    let height = Scalar {
        row: smallvec![(3 * R + 2, Lanes::splat(1.0))],
        z: *h - ekf.nominal.h,
        variance: sigma_m * sigma_m,
    };
    nis(use_scalars(ekf, &[height])[0])
}

/// Position and velocity of the antenna with respect to the IMU, and the measurement rows that
/// follow.
struct Antenna<L> {
    /// Lever arm in n (m).
    arm_n: Vec3<L>,
    /// Velocity of the antenna about the IMU, C (omega_eb_b × l), in n (m/s).
    swing_n: Vec3<L>,
    /// Change of that velocity per attitude error psi_n (m/s per rad):
    /// −\[C (omega_ib_b × l) ×\] + \[omega_ie_n ×\] \[C l ×\].
    of_psi: Mat3<L>,
    /// Change of that velocity per error of the gyroscope's bias (m): C \[l ×\].
    of_bias: Mat3<L>,
}

impl<W: Real> Antenna<W> {
    #[inline(always)]
    fn new(ins: &Strapdown<W>, omega_ib_b: Vec3<W>, lever_arm_b: DVec3) -> Self {
        let c_b_n = ins.q_b_n.to_matrix();
        let arm_b = Vec3::splat(lever_arm_b);
        let arm_n = c_b_n * arm_b;
        let (s, c) = ins.lat.sin_cos();
        let omega_ie_n = Vec3([c * OMEGA_IE, W::from(0.0), s * -OMEGA_IE]);
        let inertial_n = c_b_n * omega_ib_b.cross(arm_b);
        Self {
            arm_n,
            swing_n: inertial_n - omega_ie_n.cross(arm_n),
            // The error of omega_ie_n by latitude is left out: 7e-5 rad/s × 1e-6 rad × metres.
            of_psi: Mat3::skew(omega_ie_n) * Mat3::skew(arm_n) - Mat3::skew(inertial_n),
            of_bias: c_b_n * Mat3::skew(arm_b),
        }
    }

    /// Position of the antenna north, east, down, delta r_n − \[C l ×\] psi_n, then its velocity: delta v_n + `of_psi` psi_n +
    /// C \[l ×\] times the error of the rate.
    fn rows(&self) -> [Coefficients<W>; 6] {
        let (zero, of_psi) = (Vec3::splat(DVec3::ZERO), Mat3::skew(-self.arm_n));
        std::array::from_fn(|i| {
            let (axis, unit) = (i % 3, Vec3::splat(DVec3::AXES[i % 3]));
            let [position, velocity, rate] =
                [&of_psi, &self.of_psi, &self.of_bias].map(|m| Vec3(m.0[axis]));
            joined(match i {
                0..3 => [unit, zero, position, zero],
                _ => [zero, unit, velocity, rate],
            })
        })
    }
}

impl Antenna<Lanes> {
    /// Estimated less measured position (m) and velocity (m/s) of the antenna, north, east, down.
    fn innovation(&self, ins: &Strapdown, fix: &Fix) -> (Vec3, Option<Vec3>) {
        let (s, c) = ins.lat.sin_cos();
        let r = radii(s);
        // longitudes may differ by whole turns
        let dlon = ins.lon - fix.lon;
        let dlon = dlon - rounded(dlon * (1.0 / TAU)) * TAU;
        let (north, east) = (
            (ins.lat - fix.lat) * (r.meridian + ins.h),
            dlon * (r.transverse + ins.h) * c,
        );
        let velocity = fix.v_n.map(|v_n| ins.v_n + self.swing_n - v_n);
        (Vec3([north, east, fix.h - ins.h]) + self.arm_n, velocity)
    }
}

/// Coefficients of a measurement: errors of position, velocity and attitude, and of the gyroscope's rate.
type Coefficients<L> = [L; NAV + 3];

#[inline(always)]
fn joined<L: Copy>(blocks: [Vec3<L>; 4]) -> Coefficients<L> {
    std::array::from_fn(|i| blocks[i / 3][i % 3])
}

/// The measurement rows of a fix about a nominal state: position north, east, down, then velocity.
pub(crate) fn fix_rows(
    ins: &Strapdown<f64>,
    omega_ib_b: DVec3,
    lever_arm_b: DVec3,
) -> [Coefficients<f64>; 6] {
    Antenna::new(ins, Vec3::splat(omega_ib_b), lever_arm_b).rows()
}

/// A measurement row: states and their coefficients, on the stack for an antenna on a lever arm and two groups of biases.
type SparseRow = SmallVec<[(usize, Lanes); 16]>;

/// Rows, innovations and covariance of the noise of scalars in one run.
pub(super) fn dense(
    scalars: &[Scalar],
    lane: usize,
    states: usize,
) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
    let mut h = DMatrix::zeros(scalars.len(), states);
    for (i, scalar) in scalars.iter().enumerate() {
        scalar.row.iter().for_each(|(k, c)| h[(i, *k)] = c[lane]);
    }
    let of = |value: &dyn Fn(&Scalar) -> f64| {
        DVector::from_iterator(scalars.len(), scalars.iter().map(value))
    };
    let noise = DMatrix::from_diagonal(&of(&|s| s.variance));
    (h, of(&|s| s.z[lane]), noise)
}

// Measurements that a vehicle makes of itself: velocity of a point along its own axes, and yaw.
//
// The vehicle's axes are known in b but for small angles m (pitch and yaw): a velocity v along them as they are known
// is v − m × v along them. The wheel reads 1 + k times the forward velocity. m and k are estimated where the belief
// has states of them.

/// Velocity of a point of the vehicle along some of the vehicle's axes.
pub(crate) struct BodyVelocity {
    /// Measured velocity along forward, right, down (m/s); read where `axes` has them.
    pub value: Vec3,
    /// The axes that are measured.
    pub axes: &'static [usize],
    /// Variance of the white noise of each ((m/s)²).
    pub variance: f64,
    /// The point, from the IMU, in b (m).
    pub lever_arm_b: DVec3,
    /// The vehicle's forward, right, down in b, where m is zero.
    pub vehicle_b: [DVec3; 3],
}

/// Uses a velocity along the vehicle's axes; returns the innovation of each of its axes in sequence.
pub(crate) fn update_body_velocity(ekf: &mut Ekf, measured: &BodyVelocity) -> Innovations {
    let scalars = ekf.scalars_of_velocity(measured);
    use_scalars(ekf, &scalars)
}

/// Uses a yaw (rad) of the body, of a variance (rad²).
pub(crate) fn update_yaw(ekf: &mut Ekf, yaw: &Lanes, variance: f64) -> Innovation {
    let c = ekf.nominal.q_b_n.to_matrix();
    let mut z = Lanes::ZERO;
    for lane in 0..LANES {
        z[lane] = wrap_angle(c.0[1][0][lane].atan2(c.0[0][0][lane]) - yaw[lane]);
    }
    let row = ekf.row(&yaw_row(&ekf.nominal));
    use_scalars(ekf, &[Scalar { row, z, variance }])[0]
}

impl Ekf {
    /// The first state of wheel scale, mounting pitch and mounting yaw, where the belief has them: behind all others.
    fn vehicle(&self) -> Option<usize> {
        let last = BIAS + self.estimates.len() - 1;
        (self.filter_model.vehicle != DVec3::ZERO).then_some(3 * last)
    }

    /// Estimates of wheel scale (1), mounting pitch and yaw (rad), and their standard deviations, of the first lane.
    pub(crate) fn vehicle_estimates(&self) -> Option<[DVec3; 2]> {
        let first = self.vehicle()?;
        let sigma = self.p.variances(first / 3).lane(0).map(f64::sqrt);
        Some([self.estimates[first / 3 - BIAS].lane(0), sigma])
    }

    fn scalars_of_velocity(&self, measured: &BodyVelocity) -> SmallVec<[Scalar; 6]> {
        let ins = &self.nominal;
        let point = Antenna::new(ins, self.omega_ib_b, measured.lever_arm_b);
        let states = self.vehicle();
        let estimates = states.map_or(Vec3::ZERO, |first| self.estimates[first / 3 - BIAS]);
        let rows = BodyRows::new(&point, ins);
        let [forward, right, down] = measured.vehicle_b.map(Vec3::<Lanes>::splat);
        let scalar = |&axis: &usize| {
            let v = along(axis, estimates);
            let along_b = forward * v[0] + right * v[1] + down * v[2];
            let mut row = self.row(&rows.along(along_b));
            if let Some(first) = states {
                // wheel scale, pitch, yaw: of the forward velocity, as `along` has them
                let (state, sign) = [(0, 1.0), (2, -1.0), (1, 1.0)][axis];
                row.push((first + state, forward.dot(rows.v_b) * sign));
            }
            Scalar {
                row,
                z: along_b.dot(rows.v_b) - measured.value[axis],
                variance: measured.variance,
            }
        };
        measured.axes.iter().map(scalar).collect()
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

/// Derivative of the velocity of a point, in b, with respect to the errors of navigation and
/// gyroscope.
struct BodyRows<L> {
    c_b_n: Mat3<L>,
    /// Velocity of the point in b (m/s).
    v_b: Vec3<L>,
    /// ∂(velocity in n)/∂psi_n with the turn into b: C_est = (I + \[psi×\]) C_true, hence
    /// δ(Cᵀ u) = Cᵀ (δu + \[u×\] psi).
    of_psi: Mat3<L>,
    /// ∂(velocity in n)/∂(gyroscope's bias).
    of_bias: Mat3<L>,
}

impl<L: Real> BodyRows<L> {
    #[inline(always)]
    fn new(point: &Antenna<L>, ins: &Strapdown<L>) -> Self {
        let c_b_n = ins.q_b_n.to_matrix();
        let u = ins.v_n + point.swing_n;
        Self {
            c_b_n,
            v_b: times_transposed(&c_b_n, u),
            of_psi: point.of_psi - Mat3::skew(-u),
            of_bias: point.of_bias,
        }
    }

    /// Coefficients of the velocity along an axis given in b.
    #[inline(always)]
    fn along(&self, axis_b: Vec3<L>) -> Coefficients<L> {
        let axis_n = self.c_b_n * axis_b;
        joined([
            Vec3::splat(DVec3::ZERO),
            axis_n,
            times_transposed(&self.of_psi, axis_n),
            times_transposed(&self.of_bias, axis_n),
        ])
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
pub(crate) fn yaw_row<L: Real>(ins: &Strapdown<L>) -> Coefficients<L> {
    let c = ins.q_b_n.to_matrix().0;
    let (n, e, d) = (c[0][0], c[1][0], c[2][0]);
    let slope = d / (n * n + e * e);
    let zero = Vec3::splat(DVec3::ZERO);
    let of_psi = Vec3([-(n * slope), -(e * slope), L::from(1.0)]);
    joined([zero, zero, of_psi, zero])
}

/// The rows of a velocity along forward, right and down about a nominal state.
pub(crate) fn body_velocity_rows(
    ins: &Strapdown<f64>,
    omega_ib_b: DVec3,
    lever_arm_b: DVec3,
) -> [Coefficients<f64>; 3] {
    let point = Antenna::new(ins, Vec3::splat(omega_ib_b), lever_arm_b);
    let rows = BodyRows::new(&point, ins);
    DVec3::AXES.map(|axis| rows.along(Vec3::splat(axis)))
}

// Iterated update by a fix, in an error that stays nearly normal where attitude errors are no longer small.
//
// A wrong attitude turns the specific force: with a constant error ψ that of the velocity is ∫ (I − exp(−ψ)) f dt = J(−ψ) ρ with
// ρ = ψ × ∫ f dt, f as the filter has it and J the left Jacobian of SO(3) ([Solà](crate::bibliography::Sola18), eq. 145); the
// error of position alike. That is the exponential of SE₂(3) about the estimate. (ρ, ψ) is normal while J(−ψ) ρ has
// a mean: the shift that the first fixes after a long outage would put into the biases. So a fix is met by Gauss-Newton
// steps in ξ = (ρ_r, ρ_v, ψ, biases), and the covariance of ξ is carried to the new estimate
// ([Goffin et al.](crate::bibliography::Goffin24)). Between fixes nothing differs, since J(0) = I.

/// Gauss-Newton steps at a fix.
const STEPS: usize = 4;

/// Uses a fix in all runs; returns its NIS, which is that of the first step.
fn update_iterated(ekf: &mut Ekf, fix: &Fix) -> Lanes {
    apply_pending_earth_step(ekf);
    let before = ekf.clone();
    let mut lanes: Vec<Lane> = (0..LANES)
        .map(|lane| Lane::new(before.p.lane(lane)))
        .collect();
    let mut nis = Lanes::ZERO;
    for step in 0..STEPS {
        let scalars = ekf.scalars_of(fix);
        for (lane, run) in lanes.iter_mut().enumerate() {
            let square = run.step(dense(&scalars, lane, ekf.p.dim()));
            if step == 0 {
                nis[lane] = square;
            }
        }
        // Every step corrects the state from which all of them began, by the whole error.
        ekf.return_to(&before, &lanes);
    }
    for (lane, run) in lanes.iter().enumerate() {
        ekf.p.set_lane(lane, &run.posterior());
    }
    // The rate of the last sample belongs to the sample, as after any other update.
    ekf.omega_ib_b = before.omega_ib_b;
    nis
}

/// One run at a fix.
struct Lane {
    /// Covariance of ξ before the fix.
    prior: DMatrix<f64>,
    xi: DVector<f64>,
    /// Coefficients of ξ in the measurements, covariance of their noise, and gain, of the last step.
    h: DMatrix<f64>,
    noise: DMatrix<f64>,
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
            noise: none.clone(),
            gain: none,
        }
    }

    /// From rows and innovation at ξ to the next ξ; returns zᵀ S⁻¹ z, NaN where S is not positive definite.
    fn step(&mut self, (rows, z, noise): (DMatrix<f64>, DVector<f64>, DMatrix<f64>)) -> f64 {
        self.h = rows * carried(&self.xi);
        let ph = &self.prior * self.h.transpose();
        let s = &self.h * &ph + &noise;
        self.noise = noise;
        // The innovation as it would be at ξ = 0 of a linear measurement.
        let z = z + &self.h * &self.xi;
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
    fn posterior(&self) -> DMatrix<f64> {
        if self.gain.is_empty() {
            return DMatrix::from_element(self.prior.nrows(), self.prior.nrows(), f64::NAN);
        }
        let rest = DMatrix::identity(self.xi.len(), self.xi.len()) - &self.gain * &self.h;
        let noise = &self.gain * &self.noise * self.gain.transpose();
        let p = &rest * &self.prior * rest.transpose() + noise;
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
#[path = "iterated_tests.rs"]
mod iterated_tests;
