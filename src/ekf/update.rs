//! GNSS updates: position and velocity of an antenna on a lever arm, as scalars in sequence.

use super::belief::MAX_BLOCKS;
use super::covariance::{BIAS, PSI, R, V};
use super::filter::Ekf;
use crate::earth::{OMEGA_IE, radii};
use crate::lanes::{Lanes, Mat3, Quat, Real, Vec3};
use glam::DVec3;
use multiversion::multiversion;

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

/// Most entries of a measurement row: one of R or V, three of PSI, three of each gyroscope group.
const MAX_ROW: usize = 4 + 3 * MAX_BLOCKS;

impl Ekf {
    #[inline(always)]
    fn update(&mut self, fix: &Fix) -> Lanes {
        self.apply_earth_terms();
        self.scratch.error.fill(Lanes::ZERO);
        let antenna = Antenna::new(self, fix);
        let [position, velocity] = self.innovation_at(fix, &antenna);
        let mut nis = Lanes::ZERO;
        for axis in 0..3 {
            let row = antenna.position_row(axis);
            nis += self.scalar(row.entries(), position[axis], fix.pos_sigma_m[axis].powi(2));
        }
        if fix.v_n.is_some() {
            for axis in 0..3 {
                let row = antenna.velocity_row(axis, self.gyro_blocks());
                nis += self.scalar(row.entries(), velocity[axis], fix.vel_sigma_m_s[axis].powi(2));
            }
        }
        self.correct();
        nis
    }

    /// Estimated less measured position and velocity of the antenna: metres and m/s north, east, down; the
    /// velocity zero where none is measured.
    #[must_use]
    pub fn innovation(&self, fix: &Fix) -> [Vec3; 2] {
        self.innovation_at(fix, &Antenna::new(self, fix))
    }

    #[inline(always)]
    fn innovation_at(&self, fix: &Fix, antenna: &Antenna) -> [Vec3; 2] {
        let velocity = fix.v_n.map(|v_n| self.nominal.v_n + antenna.swing_n - v_n);
        [self.position_innovation(fix, antenna), velocity.unwrap_or(Vec3::ZERO)]
    }

    /// Estimated less measured antenna position, metres north, east, down.
    #[inline(always)]
    fn position_innovation(&self, fix: &Fix, antenna: &Antenna) -> Vec3 {
        let (s, c) = self.nominal.lat.sin_cos();
        let r = radii(s);
        let h = self.nominal.h;
        // longitudes may differ by a whole turn
        let turns = ((self.nominal.lon - fix.lon) * (1.0 / std::f64::consts::TAU)).map(f64::round_ties_even);
        let dlon = self.nominal.lon - fix.lon - turns * std::f64::consts::TAU;
        let imu =
            Vec3([(self.nominal.lat - fix.lat) * (r.meridian + h), dlon * (r.transverse + h) * c, fix.h - h]);
        imu + antenna.arm_n
    }

    /// One scalar: innovation z = h·error + noise of variance r; returns its NIS.
    #[inline(always)]
    fn scalar(&mut self, h: &[(usize, Lanes)], z: Lanes, r: f64) -> Lanes {
        let scratch = &mut self.scratch;
        let s = self.p.update(h, r, &mut scratch.ph, &mut scratch.gain);
        let mut innovation = z;
        for (i, c) in h {
            innovation -= *c * scratch.error[*i];
        }
        for (error, gain) in scratch.error.iter_mut().zip(&scratch.gain) {
            *error += *gain * innovation;
        }
        innovation * innovation / s
    }

    /// Takes the estimated error out of the nominal state and the biases.
    #[inline(always)]
    fn correct(&mut self) {
        let error =
            |block: usize| -> Vec3 { Vec3(std::array::from_fn(|i| self.scratch.error[3 * block + i])) };
        let (dr, dv, psi) = (error(R), error(V), error(PSI));
        let (s, c) = self.nominal.lat.sin_cos();
        let radii = radii(s);
        let nominal = &mut self.nominal;
        nominal.lon -= dr[1] / ((radii.transverse + nominal.h) * c);
        nominal.lat -= dr[0] / (radii.meridian + nominal.h);
        nominal.h += dr[2];
        nominal.v_n = nominal.v_n - dv;
        nominal.q_b_n = (Quat::from_rotation_vector(-psi) * nominal.q_b_n).renormalised();
        for (g, bias) in self.bias.iter_mut().enumerate() {
            *bias = *bias - self.scratch.of(BIAS + g);
        }
    }
}

/// Uses a fix: up to six scalar updates in sequence, then the correction of the nominal state. Returns the
/// normalised innovation squared (NIS) of the fix. Compiled for the vector units of the machine and
/// dispatched at run time.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub fn update(ekf: &mut Ekf, fix: &Fix) -> Lanes {
    ekf.update(fix)
}

/// Where the antenna is and how it moves about the IMU, and the measurement rows that follow.
struct Antenna {
    has_arm: bool,
    /// Lever arm in n (m).
    arm_n: Vec3,
    /// Velocity of the antenna about the IMU, C (omega_eb_b × l), in n (m/s).
    swing_n: Vec3,
    /// What an attitude error does to it: −\[C (omega_ib_b × l) ×\] + \[omega_ie_n ×\] \[C l ×\].
    of_psi: Mat3,
    /// What a gyroscope bias error does to it: C \[l ×\].
    of_bias: Mat3,
}

impl Antenna {
    #[inline(always)]
    fn new(ekf: &Ekf, fix: &Fix) -> Self {
        let has_arm = fix.lever_arm_b != DVec3::ZERO;
        if !has_arm {
            let (z, m) = (Vec3::ZERO, Mat3::ZERO);
            return Self { has_arm, arm_n: z, swing_n: z, of_psi: m, of_bias: m };
        }
        let c_b_n = ekf.nominal.q_b_n.to_matrix();
        let arm_b = Vec3::splat(fix.lever_arm_b);
        let arm_n = c_b_n * arm_b;
        let (s, c) = ekf.nominal.lat.sin_cos();
        let omega_ie_n = Vec3([c * OMEGA_IE, Lanes::ZERO, s * -OMEGA_IE]);
        let inertial_n = c_b_n * ekf.omega_ib_b.cross(arm_b);
        Self {
            has_arm,
            arm_n,
            swing_n: inertial_n - omega_ie_n.cross(arm_n),
            of_psi: Mat3::skew(omega_ie_n) * Mat3::skew(arm_n) - Mat3::skew(inertial_n),
            of_bias: c_b_n * Mat3::skew(arm_b),
        }
    }

    /// Position of the antenna: delta r_n − \[C l ×\] psi_n.
    #[inline(always)]
    fn position_row(&self, axis: usize) -> Row {
        let mut row = Row::new(3 * R + axis);
        if self.has_arm {
            row.push3(3 * PSI, Mat3::skew(-self.arm_n).0[axis]);
        }
        row
    }

    /// Velocity of the antenna: delta v_n + `of_psi` psi_n + C \[l ×\] delta b_g.
    #[inline(always)]
    fn velocity_row(&self, axis: usize, gyro_blocks: std::ops::Range<usize>) -> Row {
        let mut row = Row::new(3 * V + axis);
        if self.has_arm {
            row.push3(3 * PSI, self.of_psi.0[axis]);
            for block in gyro_blocks {
                row.push3(3 * block, self.of_bias.0[axis]);
            }
        }
        row
    }
}

/// One measurement row: (state, coefficient), without allocation.
struct Row {
    entries: [(usize, Lanes); MAX_ROW],
    len: usize,
}

impl Row {
    #[inline(always)]
    fn new(state: usize) -> Self {
        let mut entries = [(0, Lanes::ZERO); MAX_ROW];
        entries[0] = (state, Lanes::ONE);
        Self { entries, len: 1 }
    }

    #[inline(always)]
    fn push3(&mut self, first: usize, coefficients: [Lanes; 3]) {
        for (i, c) in coefficients.into_iter().enumerate() {
            self.entries[self.len] = (first + i, c);
            self.len += 1;
        }
    }

    #[inline(always)]
    fn entries(&self) -> &[(usize, Lanes)] {
        &self.entries[..self.len]
    }
}

impl Ekf {
    /// The six measurement rows (position, velocity) of the first lane, dense.
    #[must_use]
    pub fn measurement_rows(&self, lever_arm_b: DVec3) -> Vec<Vec<f64>> {
        let fix = Fix {
            lat: self.nominal.lat,
            lon: self.nominal.lon,
            h: self.nominal.h,
            v_n: None,
            pos_sigma_m: DVec3::ONE,
            vel_sigma_m_s: DVec3::ONE,
            lever_arm_b,
        };
        let antenna = Antenna::new(self, &fix);
        let position = (0..3).map(|axis| antenna.position_row(axis));
        let velocity = (0..3).map(|axis| antenna.velocity_row(axis, self.gyro_blocks()));
        let dense = |row: Row| {
            let mut dense = vec![0.0; self.p.dim()];
            row.entries().iter().for_each(|(i, c)| dense[*i] += c[0]);
            dense
        };
        position.chain(velocity).map(dense).collect()
    }
}
