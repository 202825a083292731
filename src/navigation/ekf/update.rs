//! GNSS updates: position and velocity of an antenna on a lever arm, as scalars in sequence.

use super::aiding::Innovation;
use super::belief::MAX_BLOCKS;
use super::covariance::{BIAS, PSI, R, Sources, V};
use super::filter::Ekf;
use super::iterated;
use crate::earth::{OMEGA_IE, radii};
use crate::imu::Sensor;
use crate::lanes::{Kernel, Lanes, Mat3, Quat, Real, Vec3, Wide, dispatch, rounded};
use crate::strapdown::Strapdown;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
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

/// Most entries of a measurement row: three of V and PSI, three of each gyroscope block, one of the vehicle's.
const MAX_ROW: usize = 7 + 3 * MAX_BLOCKS;

impl Ekf {
    #[inline(always)]
    fn use_fix<W: Wide>(&mut self, fix: &Fix) -> W {
        let ins = self.nominal.load::<W>();
        self.apply_earth_terms(&ins);
        self.scratch.error.fill(Lanes::ZERO);
        let antenna = Antenna::new(&ins, self.omega_ib_b.load(), fix.lever_arm_b);
        let [position, velocity] = antenna.innovation(&ins, fix);
        let mut nis = W::from(0.0);
        for axis in 0..3 {
            let row = antenna.position_row(axis);
            // The density of six innovations is a product of conditional ones: the squares of the sequence
            // sum to zᵀ S⁻¹ z.
            nis += self.scalar(row.entries(), position[axis], fix.pos_sigma_m[axis].powi(2));
        }
        if fix.v_n.is_some() {
            for axis in 0..3 {
                let row = antenna.velocity_row(axis, &self.sources());
                nis += self.scalar(
                    row.entries(),
                    velocity[axis],
                    fix.vel_sigma_m_s[axis].powi(2),
                );
            }
        }
        self.correct(ins);
        nis
    }

    #[inline(always)]
    fn use_height<W: Wide>(&mut self, h: W, sigma_m: f64) -> W {
        let ins = self.nominal.load::<W>();
        self.apply_earth_terms(&ins);
        self.scratch.error.fill(Lanes::ZERO);
        // the third component of the position error is down: estimated less measured
        let nis = self.scalar(&[(3 * R + 2, W::from(1.0))], h - ins.h, sigma_m * sigma_m);
        self.correct(ins);
        nis
    }

    /// Estimated less measured position and velocity of the antenna: metres and m/s north, east, down; the
    /// velocity zero where none is measured.
    #[must_use]
    pub(crate) fn innovation(&self, fix: &Fix) -> [Vec3; 2] {
        Antenna::new(&self.nominal, self.omega_ib_b, fix.lever_arm_b).innovation(&self.nominal, fix)
    }

    /// One scalar: innovation z = h·error + noise of variance r; returns its NIS.
    #[inline(always)]
    fn scalar<W: Wide>(&mut self, h: &[(usize, W)], z: W, r: f64) -> W {
        let (innovation, s) = self.take(h, z, r);
        innovation * innovation / s
    }

    /// The same; returns the innovation and its variance.
    #[inline(always)]
    pub(super) fn innovated<W: Wide>(&mut self, h: &[(usize, W)], z: W, r: f64) -> Innovation {
        let (innovation, s) = self.take(h, z, r);
        let mut found = [Lanes::ZERO; 2];
        innovation.store(&mut found[0]);
        s.store(&mut found[1]);
        found
    }

    #[inline(always)]
    fn take<W: Wide>(&mut self, h: &[(usize, W)], z: W, r: f64) -> (W, W) {
        let scratch = &mut self.scratch;
        let s = self.p.update(h, r, &mut scratch.ph, &mut scratch.gain);
        // What the scalars before have already explained. The nominal state moves only after the last one, so
        // all six are linearised at the same state, and their order changes nothing but rounding.
        let mut innovation = z;
        for (i, c) in h {
            innovation -= *c * W::load(&scratch.error[*i]);
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
        FixUpdate::Ekf => dispatch(ekf.level, Update { ekf, fix }),
        FixUpdate::Iterated => iterated::update(ekf, fix),
    }
}

struct Update<'a> {
    ekf: &'a mut Ekf,
    fix: &'a Fix,
}

impl Kernel for Update<'_> {
    type Output = Lanes;
    #[inline(always)]
    fn run<W: Wide>(self) -> Lanes {
        let mut nis = Lanes::ZERO;
        self.ekf.use_fix::<W>(self.fix).store(&mut nis);
        nis
    }
}

/// Uses a height above the ellipsoid (m), measured at the IMU with a standard deviation. Returns its NIS.
pub(crate) fn update_height(ekf: &mut Ekf, h: &Lanes, sigma_m: f64) -> Lanes {
    dispatch(ekf.level, UpdateHeight { ekf, h, sigma_m })
}

struct UpdateHeight<'a> {
    ekf: &'a mut Ekf,
    h: &'a Lanes,
    sigma_m: f64,
}

impl Kernel for UpdateHeight<'_> {
    type Output = Lanes;
    #[inline(always)]
    fn run<W: Wide>(self) -> Lanes {
        let mut nis = Lanes::ZERO;
        self.ekf
            .use_height(W::load(self.h), self.sigma_m)
            .store(&mut nis);
        nis
    }
}

/// Where the antenna is and how it moves about the IMU, and the measurement rows that follow.
pub(super) struct Antenna<L> {
    has_arm: bool,
    /// Lever arm in n (m).
    arm_n: Vec3<L>,
    /// Velocity of the antenna about the IMU, C (omega_eb_b × l), in n (m/s).
    pub(super) swing_n: Vec3<L>,
    /// Change of that velocity per attitude error psi_n (m/s per rad):
    /// −\[C (omega_ib_b × l) ×\] + \[omega_ie_n ×\] \[C l ×\].
    pub(super) of_psi: Mat3<L>,
    /// Change of that velocity per error of the gyroscope's bias (m): C \[l ×\].
    pub(super) of_bias: Mat3<L>,
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
    #[inline(always)]
    fn position_row(&self, axis: usize) -> Row<W> {
        let mut row = Row::new(3 * R + axis);
        if self.has_arm {
            row.push3(3 * PSI, Mat3::skew(-self.arm_n).0[axis]);
        }
        row
    }
}

impl<W: Wide> Antenna<W> {
    /// Velocity of the antenna: delta v_n + `of_psi` psi_n + C \[l ×\] (delta b_g + delta u ∘ regressor), u an
    /// unknown of the gyroscope.
    #[inline(always)]
    fn velocity_row(&self, axis: usize, sources: &Sources<'_>) -> Row<W> {
        let mut row = Row::new(3 * V + axis);
        if self.has_arm {
            row.push3(3 * PSI, self.of_psi.0[axis]);
            row.push_gyro(self.of_bias.0[axis], sources);
        }
        row
    }

    /// Estimated less measured position (m) and velocity (m/s) of the antenna, north, east, down.
    #[inline(always)]
    fn innovation(&self, ins: &Strapdown<W>, fix: &Fix) -> [Vec3<W>; 2] {
        let (s, c) = ins.lat.sin_cos();
        let r = radii(s);
        let (lat, lon, h) = (W::load(&fix.lat), W::load(&fix.lon), W::load(&fix.h));
        // longitudes may differ by whole turns
        let dlon = ins.lon - lon;
        let dlon = dlon - rounded(dlon * (1.0 / TAU)) * TAU;
        let (north, east) = (
            (ins.lat - lat) * (r.meridian + ins.h),
            dlon * (r.transverse + ins.h) * c,
        );
        let velocity = fix.v_n.map(|v_n| ins.v_n + self.swing_n - v_n.load());
        [
            Vec3([north, east, h - ins.h]) + self.arm_n,
            velocity.unwrap_or(Vec3::splat(DVec3::ZERO)),
        ]
    }
}

/// The measurement rows of a fix about a nominal state: position north, east, down, then velocity. Twelve
/// coefficients each: R, V, PSI, and the error of the gyroscope's bias.
#[must_use]
pub(crate) fn fix_rows(
    ins: &Strapdown<f64>,
    omega_ib_b: DVec3,
    lever_arm_b: DVec3,
) -> [[f64; 12]; 6] {
    let antenna = Antenna::new(ins, Vec3::splat(omega_ib_b), lever_arm_b);
    std::array::from_fn(|i| {
        let mut row = if i < 3 {
            antenna.position_row(i)
        } else {
            Row::new(3 * V + i - 3)
        };
        if i >= 3 {
            row.push3(3 * PSI, antenna.of_psi.0[i - 3]);
            row.push3(3 * BIAS, antenna.of_bias.0[i - 3]);
        }
        let mut dense = [0.0; 12];
        row.entries()
            .iter()
            .for_each(|(state, coefficient)| dense[*state] += coefficient);
        dense
    })
}

/// One measurement row: (state, coefficient), without allocation.
pub(super) struct Row<L> {
    entries: [(usize, L); MAX_ROW],
    len: usize,
}

impl<L: Real> Default for Row<L> {
    #[inline(always)]
    fn default() -> Self {
        Self {
            entries: [(0, L::from(0.0)); MAX_ROW],
            len: 0,
        }
    }
}

impl<L: Real> Row<L> {
    #[inline(always)]
    fn new(state: usize) -> Self {
        let mut row = Self::default();
        row.push(state, L::from(1.0));
        row
    }

    #[inline(always)]
    pub(super) fn push(&mut self, state: usize, coefficient: L) {
        self.entries[self.len] = (state, coefficient);
        self.len += 1;
    }

    #[inline(always)]
    pub(super) fn push3(&mut self, first: usize, coefficients: [L; 3]) {
        coefficients
            .into_iter()
            .enumerate()
            .for_each(|(i, c)| self.push(first + i, c));
    }

    #[inline(always)]
    pub(super) fn entries(&self) -> &[(usize, L)] {
        &self.entries[..self.len]
    }
}

impl<W: Wide> Row<W> {
    /// What the error of the gyroscope's rate does, times these coefficients: its biases and its unknowns.
    #[inline(always)]
    pub(super) fn push_gyro(&mut self, of_bias: [W; 3], sources: &Sources<'_>) {
        let [_, gyro, unknown, gyro_unknown] = sources.starts();
        // The rate is that of the last sample: its biases count all alike. Its white noise times the arm
        // is left out: at 1 m it is mm/s beside the cm/s of a receiver.
        for first in (gyro..unknown).step_by(3) {
            self.push3(first, of_bias);
        }
        for (u, regressor) in sources.regressors[Sensor::Gyro as usize].iter().enumerate() {
            let Vec3([x, y, z]) = regressor.value.load::<W>();
            self.push3(
                gyro_unknown + 3 * u,
                [of_bias[0] * x, of_bias[1] * y, of_bias[2] * z],
            );
        }
    }
}

impl Ekf {
    /// The six measurement rows (position, velocity) of the first lane, dense.
    #[must_use]
    pub(crate) fn measurement_rows(&self, lever_arm_b: DVec3) -> Vec<Vec<f64>> {
        let antenna = Antenna::new(&self.nominal, self.omega_ib_b, lever_arm_b);
        let position = (0..3).map(|axis| antenna.position_row(axis));
        let velocity = (0..3).map(|axis| antenna.velocity_row(axis, &self.sources()));
        let dense = |row: Row<Lanes>| {
            let mut dense = vec![0.0; self.p.dim()];
            row.entries().iter().for_each(|(i, c)| dense[*i] += c[0]);
            dense
        };
        position.chain(velocity).map(dense).collect()
    }
}
