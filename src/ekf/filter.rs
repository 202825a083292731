//! The filter itself: nominal state, bias estimates and covariance of eight runs.

use super::belief::{Belief, BiasGroup};
use super::covariance::{BIAS, Covariance, NAV, PSI, R, V};
use super::dynamics::{EARTH_STEP_S, EarthStep, EarthTerms, NavRows, RowMap, Sample};
use super::initial::{InitialSettings, psi_of_angles};
use crate::frames::NavState;
use crate::imu::{ImuSample, Sensor};
use crate::lanes::{Lanes, Mat3, Vec3};
use crate::strapdown::Strapdown;
use crate::units::DEG;
use glam::DVec3;
use multiversion::multiversion;
use nalgebra::Matrix3;

/// Error-state extended Kalman filter, closed loop.
#[derive(Debug, Clone)]
pub struct Ekf {
    /// The nominal navigation state.
    pub nominal: Strapdown,
    /// Estimates of the bias groups, accelerometer first (m/s², rad/s).
    pub bias: Vec<Vec3>,
    /// Covariance of the error state.
    pub p: Covariance,
    /// Block transition of the biases: coefficients and innovation variances, by group.
    phi: Vec<DVec3>,
    innovation: Vec<DVec3>,
    white: [DVec3; 2],
    /// What is believed of one sample at the belief's own rate: groups, white noise, interval (s).
    of_sample: (Vec<BiasGroup>, [DVec3; 2], f64),
    /// Accelerometer groups: blocks `BIAS..BIAS + accel_groups`; gyroscope groups follow.
    accel_groups: usize,
    dt: f64,
    /// Time since the Earth terms were last applied (s).
    earth_age: f64,
    /// Angular rate of the last sample less its bias (rad/s), for the lever arm's velocity.
    pub(super) omega_ib_b: Vec3,
    pub(super) scratch: Scratch,
}

/// Working vectors of the measurement update, one entry a state.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    pub(super) ph: Vec<Lanes>,
    pub(super) gain: Vec<Lanes>,
    pub(super) error: Vec<Lanes>,
}

impl Scratch {
    /// The estimated errors of a block.
    #[inline(always)]
    pub(super) fn of(&self, block: usize) -> Vec3 {
        Vec3([self.error[3 * block], self.error[3 * block + 1], self.error[3 * block + 2]])
    }
}

impl Ekf {
    /// A filter at its nominal start, with zero bias estimates. The attitude standard deviations, given
    /// for roll, pitch and yaw, are brought to psi_n at the attitude of `about`, the same in all lanes.
    #[must_use]
    pub fn new(nominal: Strapdown, belief: &Belief, about: &NavState, initial: &InitialSettings) -> Self {
        let mut belief = belief.clone();
        let overrides =
            [(Sensor::Accel, initial.accel_bias_sigma_m_s2), (Sensor::Gyro, initial.gyro_bias_sigma_rad_s)];
        for (sensor, sigma) in overrides {
            if let Some(sigma) = sigma {
                belief.set_initial_bias_sigma(sensor, sigma);
            }
        }
        let groups = belief.groups.concat();
        let mut p = Covariance::zeros(belief.blocks());
        let diagonal = |v: DVec3| Mat3::diagonal(Vec3::splat(v));
        let square = |sigma: [f64; 3]| diagonal(DVec3::from(sigma) * DVec3::from(sigma));
        p.set_diagonal_block(R, square(initial.pos_sigma_m));
        p.set_diagonal_block(V, square(initial.vel_sigma_m_s));
        p.set_diagonal_block(PSI, attitude_covariance(about, initial.att_sigma_deg));
        for (g, group) in groups.iter().enumerate() {
            p.set_diagonal_block(BIAS + g, diagonal(group.initial));
        }
        let dim = p.dim();
        let zeros = || vec![Lanes::ZERO; dim];
        Self {
            nominal,
            bias: vec![Vec3::ZERO; groups.len()],
            p,
            phi: groups.iter().map(|g| g.phi).collect(),
            innovation: groups.iter().map(|g| g.innovation).collect(),
            white: belief.white,
            accel_groups: belief.groups[0].len(),
            of_sample: (groups, belief.white, 1.0 / belief.rate_hz),
            dt: 1.0 / belief.rate_hz,
            earth_age: 0.0,
            omega_ib_b: Vec3::ZERO,
            scratch: Scratch { ph: zeros(), gain: zeros(), error: zeros() },
        }
    }

    /// The next samples last `dt` seconds, whatever the belief's own rate: white noise keeps its density,
    /// biases their correlation time and variance. For recorded data, whose clock is not even and whose
    /// samples are split where a fix falls between them.
    pub fn set_interval(&mut self, dt: f64) {
        let (groups, white, belief_dt) = &self.of_sample;
        let ratio = dt / belief_dt;
        for (g, group) in groups.iter().enumerate() {
            (self.phi[g], self.innovation[g]) = group.over(ratio);
        }
        self.white = white.map(|w| w / ratio);
        self.dt = dt;
    }

    /// Blocks of the accelerometer biases.
    #[inline(always)]
    pub(super) fn accel_blocks(&self) -> std::ops::Range<usize> {
        BIAS..BIAS + self.accel_groups
    }

    /// Blocks of the gyroscope biases.
    #[inline(always)]
    pub(super) fn gyro_blocks(&self) -> std::ops::Range<usize> {
        BIAS + self.accel_groups..self.p.blocks()
    }

    /// The bias estimate of a sensor: the sum of its groups.
    #[inline(always)]
    #[must_use]
    pub fn bias_of(&self, sensor: Sensor) -> Vec3 {
        let (accel, gyro) = self.bias.split_at(self.accel_groups);
        let mut sum = Vec3::ZERO;
        for bias in if sensor == Sensor::Accel { accel } else { gyro } {
            sum = sum + *bias;
        }
        sum
    }

    /// Advances by one IMU sample: mean rate (rad/s) and mean specific force (m/s²) over the interval.
    #[inline(always)]
    fn predict(&mut self, omega_ib_b: Vec3, f_ib_b: Vec3) {
        let dt = self.dt;
        self.advance_biases();
        self.omega_ib_b = omega_ib_b - self.bias_of(Sensor::Gyro);
        let f_ib_b = f_ib_b - self.bias_of(Sensor::Accel);
        let trace = self.nominal.step(self.omega_ib_b * dt, f_ib_b * dt, dt);
        let sample = Sample::new(&trace, dt);
        self.transform(&sample);
        self.add_white_noise(&sample);
        self.earth_age += dt;
        if self.earth_age + 0.5 * dt > EARTH_STEP_S {
            self.apply_earth_terms();
        }
    }

    /// b_k = phi b_{k−1} + w for estimates and covariance.
    #[inline(always)]
    fn advance_biases(&mut self) {
        let n = self.p.blocks();
        for g in 0..self.bias.len() {
            let (phi, innovation) = (self.phi[g], self.innovation[g]);
            let block = BIAS + g;
            for axis in 0..3 {
                self.bias[g][axis] = self.bias[g][axis] * phi[axis];
            }
            for i in 0..block {
                scale(self.p.upper_mut(i, block), DVec3::ONE, phi);
            }
            let diagonal = self.p.upper_mut(block, block);
            scale(diagonal, phi, phi);
            for axis in 0..3 {
                diagonal.0[axis][axis] += Lanes::splat(innovation[axis]);
            }
            for j in block + 1..n {
                scale(self.p.upper_mut(block, j), phi, DVec3::ONE);
            }
        }
    }

    /// The Earth terms over the time since they were last applied.
    #[inline(always)]
    pub(super) fn apply_earth_terms(&mut self) {
        if self.earth_age > 0.0 {
            let step = EarthStep { terms: EarthTerms::at(&self.nominal), dt: self.earth_age };
            self.earth_age = 0.0;
            self.transform(&step);
        }
    }

    /// P⁺ = A P Aᵀ for a map A of the navigation rows: by block columns, then by block rows. Loops, so that
    /// the map is compiled in two places only.
    #[inline(always)]
    fn transform(&mut self, map: &impl RowMap) {
        // Navigation rows of A P: the navigation columns apart, the bias columns in place after them.
        let mut nav = [NavRows([Mat3::ZERO; 3]); 3];
        for j in 0..self.p.blocks() {
            let x = NavRows([self.p.block(R, j), self.p.block(V, j), self.p.block(PSI, j)]);
            let rows = map.apply(&x, &self.sum(self.accel_blocks(), j), &self.sum(self.gyro_blocks(), j));
            if j < BIAS {
                nav[j] = rows;
            } else {
                for i in NAV {
                    *self.p.upper_mut(i, j) = rows.0[i];
                }
            }
        }
        // A P Aᵀ: the same map on the transposed rows of A P, of which the upper blocks are kept.
        for i in NAV {
            let row = NavRows([nav[R].0[i].transpose(), nav[V].0[i].transpose(), nav[PSI].0[i].transpose()]);
            let row = map.apply(&row, &self.sum(self.accel_blocks(), i), &self.sum(self.gyro_blocks(), i));
            self.p.set_diagonal_block(i, row.0[i]);
            for j in i + 1..BIAS {
                *self.p.upper_mut(i, j) = row.0[j].transpose();
            }
        }
    }

    /// The sum of bias blocks of column j.
    #[inline(always)]
    fn sum(&self, blocks: std::ops::Range<usize>, j: usize) -> Mat3 {
        let mut sum = self.p.block(blocks.start, j);
        for i in blocks.start + 1..blocks.end {
            sum = sum + self.p.block(i, j);
        }
        sum
    }

    /// White noise of one sample, held over dt: sigma² dt² into V and PSI, and the part of it that the
    /// sample itself carries on to R and V.
    #[inline(always)]
    fn add_white_noise(&mut self, sample: &Sample) {
        let (accel, gyro) = (sample.rotated_noise(self.white[0]), sample.rotated_noise(self.white[1]));
        let half = 0.5 * self.dt;
        let p = &mut self.p;
        *p.upper_mut(V, V) = p.block(V, V) + accel;
        *p.upper_mut(R, V) = p.block(R, V) + accel * half;
        *p.upper_mut(R, R) = p.block(R, R) + accel * (half * half);
        *p.upper_mut(PSI, PSI) = p.block(PSI, PSI) + gyro;
        *p.upper_mut(V, PSI) = p.block(V, PSI) + sample.tilted_noise(&gyro);
    }
}

/// Brings the covariance up to the time of the last sample (the Earth terms lag by up to
/// [`EARTH_STEP_S`]): to be called before it is looked at.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub fn settle(ekf: &mut Ekf) {
    ekf.apply_earth_terms();
}

/// diag(rows) m diag(columns), in place.
#[inline(always)]
fn scale(m: &mut Mat3, rows: DVec3, columns: DVec3) {
    for i in 0..3 {
        for j in 0..3 {
            m.0[i][j] = m.0[i][j] * (rows[i] * columns[j]);
        }
    }
}

/// Covariance of psi_n for standard deviations of roll, pitch and yaw (degrees).
fn attitude_covariance(state: &NavState, sigma_deg: [f64; 3]) -> Mat3 {
    let psi = psi_of_angles(state.q_b_n);
    let variances = sigma_deg.map(|s| (s * DEG).powi(2));
    let p = psi * Matrix3::from_diagonal(&variances.into()) * psi.transpose();
    Mat3(std::array::from_fn(|row| std::array::from_fn(|column| Lanes::splat(p[(row, column)]))))
}

/// Advances a filter through IMU samples: the same ideal samples for all runs plus the errors of each,
/// accelerometer (m/s²) and gyroscope (rad/s). Compiled for the vector units of the machine and
/// dispatched at run time.
///
/// # Panics
/// When samples and errors are not equally many.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub fn advance(ekf: &mut Ekf, samples: &[ImuSample], errors: &[[Vec3; 2]]) {
    assert_eq!(samples.len(), errors.len(), "one error for each sample");
    for (sample, [accel, gyro]) in samples.iter().zip(errors) {
        ekf.predict(Vec3::splat(sample.omega_ib_b) + *gyro, Vec3::splat(sample.f_ib_b) + *accel);
    }
}
