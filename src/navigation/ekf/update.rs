//! GNSS updates: position and velocity of an antenna on a lever arm, as scalars in sequence.

use super::covariance::{BIAS, NAV, PSI, R, Sources, V};
use super::filter::{Ekf, apply_correction, settle};
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
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::TAU;

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
    fn scalars_of(&self, fix: &Fix) -> SmallVec<[Scalar; 6]> {
        let antenna = Antenna::new(&self.nominal, self.omega_ib_b, fix.lever_arm_b);
        let z = antenna.innovation(&self.nominal, fix);
        let sigmas = [fix.pos_sigma_m, fix.vel_sigma_m_s];
        let count = if fix.v_n.is_some() { 6 } else { 3 };
        let scalar = |i: usize| Scalar {
            row: match i {
                0..3 => antenna.position_row(i),
                _ => antenna.velocity_row(i - 3, &self.sources()),
            },
            z: z[i / 3][i % 3],
            variance: sigmas[i / 3][i % 3].powi(2),
        };
        (0..count).map(scalar).collect()
    }

    /// Estimated less measured position and velocity of the antenna: metres and m/s north, east, down; the
    /// velocity zero where none is measured.
    pub(crate) fn innovation(&self, fix: &Fix) -> [Vec3; 2] {
        Antenna::new(&self.nominal, self.omega_ib_b, fix.lever_arm_b).innovation(&self.nominal, fix)
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

    /// Takes the estimated error out of the nominal state and the biases.
    #[inline(always)]
    pub(super) fn correct<W: Wide>(&mut self, mut ins: Strapdown<W>) {
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

/// How a fix is used.
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

/// What a scalar measurement found: estimate less measured, and the variance that the filter states of that.
type Innovation = [Lanes; 2];

/// Of the scalars of a fix.
type Innovations = SmallVec<[Innovation; 6]>;

/// Normalised innovation squared.
fn nis([z, s]: Innovation) -> Lanes {
    z * z / s
}

/// A scalar measurement of eight runs.
struct Scalar {
    row: Row<Lanes>,
    /// Estimate less measured.
    z: Lanes,
    /// Variance of its white noise.
    variance: f64,
}

/// Uses scalars in sequence, then corrects the nominal state; returns the innovation of each.
fn use_scalars(ekf: &mut Ekf, scalars: &[Scalar]) -> Innovations {
    settle(ekf);
    ekf.scratch.error.fill(Lanes::ZERO);
    let found = dispatch(ekf.level, UseScalars { ekf, scalars });
    apply_correction(ekf);
    found
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
        for (scalar, [z, s]) in self.scalars.iter().zip(&mut found) {
            let (innovation, variance) = self.ekf.take::<W>(scalar);
            innovation.store(z);
            variance.store(s);
        }
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

/// Where the antenna is and how it moves about the IMU, and the measurement rows that follow.
struct Antenna<L> {
    has_arm: bool,
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
    pub(super) fn new(ins: &Strapdown<W>, omega_ib_b: Vec3<W>, lever_arm_b: DVec3) -> Self {
        let c_b_n = ins.q_b_n.to_matrix();
        let arm_b = Vec3::splat(lever_arm_b);
        let arm_n = c_b_n * arm_b;
        let (s, c) = ins.lat.sin_cos();
        let omega_ie_n = Vec3([c * OMEGA_IE, W::from(0.0), s * -OMEGA_IE]);
        let inertial_n = c_b_n * omega_ib_b.cross(arm_b);
        Self {
            has_arm: lever_arm_b != DVec3::ZERO,
            arm_n,
            swing_n: inertial_n - omega_ie_n.cross(arm_n),
            // The error of omega_ie_n by latitude is left out: 7e-5 rad/s × 1e-6 rad × metres.
            of_psi: Mat3::skew(omega_ie_n) * Mat3::skew(arm_n) - Mat3::skew(inertial_n),
            of_bias: c_b_n * Mat3::skew(arm_b),
        }
    }

    /// Position of the antenna: delta r_n − \[C l ×\] psi_n.
    fn position_row(&self, axis: usize) -> Row<W> {
        let mut row = smallvec![(3 * R + axis, W::from(1.0))];
        if self.has_arm {
            row.extend(block(PSI, Mat3::skew(-self.arm_n).0[axis]));
        }
        row
    }
}

impl Antenna<Lanes> {
    /// Velocity of the antenna: delta v_n + `of_psi` psi_n + C \[l ×\] (delta b_g + delta u ∘ regressor), u an
    /// unknown of the gyroscope.
    fn velocity_row(&self, axis: usize, sources: &Sources<'_>) -> Row<Lanes> {
        let mut row = smallvec![(3 * V + axis, Lanes::splat(1.0))];
        if self.has_arm {
            row.extend(block(PSI, self.of_psi.0[axis]));
            push_gyro(&mut row, self.of_bias.0[axis], sources);
        }
        row
    }

    /// Estimated less measured position (m) and velocity (m/s) of the antenna, north, east, down.
    fn innovation(&self, ins: &Strapdown, fix: &Fix) -> [Vec3; 2] {
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
        [
            Vec3([north, east, fix.h - ins.h]) + self.arm_n,
            velocity.unwrap_or(Vec3::ZERO),
        ]
    }
}

/// The measurement rows of a fix about a nominal state: position north, east, down, then velocity. Twelve
/// coefficients each: R, V, PSI, and the error of the gyroscope's bias.
pub(crate) fn fix_rows(
    ins: &Strapdown<f64>,
    omega_ib_b: DVec3,
    lever_arm_b: DVec3,
) -> [[f64; 12]; 6] {
    let antenna = Antenna::new(ins, Vec3::splat(omega_ib_b), lever_arm_b);
    std::array::from_fn(|i| {
        let mut dense = [0.0; 12];
        if i < 3 {
            let row = antenna.position_row(i);
            row.iter().for_each(|(state, c)| dense[*state] = *c);
        } else {
            dense[3 * V + i - 3] = 1.0;
            dense[3 * PSI..3 * BIAS].copy_from_slice(&antenna.of_psi.0[i - 3]);
            dense[3 * BIAS..].copy_from_slice(&antenna.of_bias.0[i - 3]);
        }
        dense
    })
}

/// A measurement row: states and their coefficients. Sixteen are those of an antenna beside the IMU and two groups of gyroscope biases: no allocation in the time loop.
type Row<L> = SmallVec<[(usize, L); 16]>;

/// The coefficients of the three states of a block.
fn block<L>(block: usize, coefficients: [L; 3]) -> impl Iterator<Item = (usize, L)> {
    (3 * block..).zip(coefficients)
}

/// What the error of the gyroscope's rate does, times these coefficients: its biases and its unknowns.
fn push_gyro(row: &mut Row<Lanes>, of_bias: [Lanes; 3], sources: &Sources<'_>) {
    let [_, gyro, unknown, gyro_unknown] = sources.starts();
    // The rate is that of the last sample: its biases count all alike. Its white noise times the arm
    // is left out: at 1 m it is mm/s beside the cm/s of a receiver.
    for group in gyro / 3..unknown / 3 {
        row.extend(block(group, of_bias));
    }
    for (u, regressor) in sources.regressors[Sensor::Gyro as usize].iter().enumerate() {
        let product = |axis| of_bias[axis] * regressor.value[axis];
        row.extend(block(gyro_unknown / 3 + u, [0, 1, 2].map(product)));
    }
}

impl Ekf {
    /// The six measurement rows (position, velocity) of the first lane, dense.
    pub(crate) fn measurement_rows(&self, lever_arm_b: DVec3) -> Vec<Vec<f64>> {
        let antenna = Antenna::new(&self.nominal, self.omega_ib_b, lever_arm_b);
        let position = (0..3).map(|axis| antenna.position_row(axis));
        let velocity = (0..3).map(|axis| antenna.velocity_row(axis, &self.sources()));
        let dense = |row: Row<Lanes>| {
            let mut dense = vec![0.0; self.p.dim()];
            row.iter().for_each(|(i, c)| dense[*i] += c[0]);
            dense
        };
        position.chain(velocity).map(dense).collect()
    }
}

// Measurements that a vehicle makes of itself: velocity of a point along its own axes, and yaw.
//
// The vehicle's axes are known in b but for small angles m (pitch and yaw): a velocity v along them as they are known
// is v − m × v along them. The wheel reads 1 + k times the forward velocity. m and k are estimated where the belief
// has states of them.

/// Velocity of a point of the vehicle along some of the vehicle's axes.
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
    let row = block(PSI, yaw_row(&ekf.nominal).0).collect();
    use_scalars(ekf, &[Scalar { row, z, variance }])[0]
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
            let [of_v, of_psi, of_gyro] = rows.along(along_b);
            let mut row: Row<Lanes> = block(V, of_v.0).chain(block(PSI, of_psi.0)).collect();
            if measured.lever_arm_b != DVec3::ZERO {
                push_gyro(&mut row, of_gyro.0, &self.sources());
            }
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
pub(crate) fn dense_yaw_row(ins: &Strapdown<f64>) -> [f64; 12] {
    let mut dense = [0.0; 12];
    dense[3 * PSI..3 * PSI + 3].copy_from_slice(&yaw_row(ins).0);
    dense
}

// Gating: a fix whose NIS is too large to be believed is not used.

/// The NIS above which a fix of `components` is refused: the chi-square quantile of a probability
/// ([Bar-Shalom](crate::bibliography::BarShalom01), sec. 5.4).
pub(crate) fn nis_limit(probability: f64, components: usize) -> f64 {
    ChiSquared::new(components as f64).map_or(f64::INFINITY, |chi2| chi2.inverse_cdf(probability))
}

/// Uses a fix in the runs where its NIS is at most `limit`; the others stay as they were. Returns the NIS
/// and which runs refused it. (A NIS that is not a number is not refused: such a run has diverged.)
pub(crate) fn update_within(ekf: &mut Ekf, fix: &Fix, limit: f64) -> (Lanes, [bool; LANES]) {
    // Before the copy: the age of the Earth terms is common to all lanes, and the update sets it to zero. A
    // run put back to a copy made before would never get them.
    super::settle(ekf);
    let before = ekf.clone();
    // The NIS comes out of the update itself; refusals are rare, and one lane cannot stop while seven go on.
    let nis = update(ekf, fix);
    let refused: [bool; LANES] = std::array::from_fn(|lane| nis[lane] > limit);
    for lane in (0..LANES).filter(|lane| refused[*lane]) {
        ekf.copy_lane(&before, lane);
    }
    (nis, refused)
}

impl Ekf {
    /// Takes state, biases and covariance of one run from another filter of the same form.
    fn copy_lane(&mut self, other: &Self, lane: usize) {
        let (to, from) = (&mut self.nominal, &other.nominal);
        for (to, from) in [
            (&mut to.lat, &from.lat),
            (&mut to.lon, &from.lon),
            (&mut to.h, &from.h),
        ] {
            to[lane] = from[lane];
        }
        to.v_n.set_lane(lane, from.v_n.lane(lane));
        to.q_b_n.set_lane(lane, from.q_b_n.lane(lane));
        for (to, from) in self.estimates.iter_mut().zip(&other.estimates) {
            to.set_lane(lane, from.lane(lane));
        }
        self.p.copy_lane(&other.p, lane);
    }
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
mod gate_tests {
    use super::*;
    use crate::earth::GravityModel;
    use crate::ekf::{Belief, FilterStates, InitialSettings};
    use crate::frames::NavState;
    use crate::noise::Model;
    use crate::strapdown::Strapdown;
    use glam::{DQuat, DVec3};

    #[test]
    fn the_run_that_refuses_stays_as_it_was_and_the_others_are_updated() {
        let state = NavState {
            lat: 0.8,
            lon: 0.1,
            h: 300.0,
            v_n: DVec3::ZERO,
            q_b_n: DQuat::IDENTITY,
        };
        let model = Model {
            rate_hz: 100.0,
            axes: Default::default(),
        };
        let belief = Belief::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
        let start = Strapdown::new(&state, GravityModel::Wgs84);
        let before = Ekf::new(start, &belief, &state, &InitialSettings::default());
        let mut fix = Fix {
            lat: Lanes::splat(0.8 + 3e-7),
            lon: Lanes::splat(0.1),
            h: Lanes::splat(300.0),
            v_n: None,
            pos_sigma_m: DVec3::splat(2.0),
            vel_sigma_m_s: DVec3::ONE,
            lever_arm_b: DVec3::ZERO,
        };
        fix.lat[5] += 1e-4; // 640 m
        let (mut gated, mut plain) = (before.clone(), before.clone());
        let (nis, refused) = update_within(&mut gated, &fix, nis_limit(0.999, 3));
        assert_eq!(refused, std::array::from_fn(|lane| lane == 5));
        assert!(nis[5] > 1e4 && nis[0] < 1.0);
        let _ = update(&mut plain, &fix);
        for lane in 0..LANES {
            let expected = if lane == 5 { &before } else { &plain };
            assert_eq!(
                gated.nominal.lane(lane),
                expected.nominal.lane(lane),
                "lane {lane}"
            );
            assert_eq!(gated.p.lane(lane), expected.p.lane(lane), "lane {lane}");
        }
    }

    /// 95 % and 99.9 % of chi-square with 3 and 6 degrees of freedom, as tables have them.
    #[test]
    fn limits_are_chi_square_quantiles() {
        assert!(
            (nis_limit(0.95, 3) - 7.8147).abs() < 1e-4
                && (nis_limit(0.999, 6) - 22.4577).abs() < 1e-4
        );
    }
}

#[cfg(test)]
#[path = "iterated_tests.rs"]
mod iterated_tests;
