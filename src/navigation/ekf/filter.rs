//! The filter itself: nominal state, bias estimates and covariance of eight runs.

use super::belief::{Belief, BiasGroup};
use super::covariance::{BIAS, Covariance, PSI, R, Sources, V};
use super::dynamics::{EARTH_STEP_S, EarthStep, EarthTerms, Sample};
use super::initial::{InitialSettings, psi_of_angles};
use super::transition::Transition;
use super::unknowns::{Regressor, UnknownKind};
use super::update::FixUpdate;
use crate::frames::NavState;
use crate::imu::{ImuSample, Sensor};
use crate::lanes::{Kernel, Lanes, Level, Mat3, Vec3, Wide, dispatch};
use crate::strapdown::Strapdown;
use crate::units::DEG;
use glam::DVec3;
use nalgebra::Matrix3;

/// Error-state extended Kalman filter, closed loop.
#[derive(Debug, Clone)]
pub struct Ekf {
    /// The nominal navigation state.
    pub nominal: Strapdown,
    /// Estimates of the blocks behind the navigation's: bias groups, accelerometer first (m/s², rad/s), then
    /// the unknowns of both sensors (scale factors, slopes of drifts), then those of the vehicle.
    pub(super) estimates: Vec<Vec3>,
    /// Covariance of the error state.
    pub p: Covariance,
    /// What is believed of a sample at the belief's own rate.
    pub(super) belief: Belief,
    /// The same of a sample of `dt` seconds: the step of each block behind the navigation's, white variances.
    pub(super) steps: Vec<BiasGroup>,
    white: [DVec3; 2],
    /// What the unknowns of each sensor are multiplied by in the last sample.
    pub(super) regressors: [Vec<Regressor>; 2],
    dt: f64,
    /// Samples of the belief's rate since the start.
    age: f64,
    /// Time since the Earth terms were last applied (s).
    pub(super) earth_age: f64,
    /// Angular rate of the last sample less its bias (rad/s), for the lever arm's velocity.
    pub(super) omega_ib_b: Vec3,
    /// The transition since it was last looked at, where a smoother needs it.
    pub(super) transition: Option<Transition>,
    pub(super) scratch: Scratch,
    pub(super) level: Level,
    pub(super) fix_update: FixUpdate,
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
    pub(super) fn of<W: Wide>(&self, block: usize) -> Vec3<W> {
        let triple = &self.error[3 * block..];
        Vec3([
            W::load(&triple[0]),
            W::load(&triple[1]),
            W::load(&triple[2]),
        ])
    }
}

impl Ekf {
    /// A filter at its nominal start, with zero estimates of biases and unknowns, whose deviations are those
    /// of the belief. The attitude standard deviations, given for roll, pitch and yaw, are brought to psi_n at
    /// the attitude of `about`, the same in all lanes.
    #[must_use]
    pub fn new(
        nominal: Strapdown,
        belief: &Belief,
        about: &NavState,
        initial: &InitialSettings,
    ) -> Self {
        let unknowns = belief.unknowns.iter().flatten();
        let constant = unknowns.map(|u| BiasGroup {
            initial: u.sigma * u.sigma,
            ..BiasGroup::constant(0.0)
        });
        let vehicle = (belief.vehicle != DVec3::ZERO).then(|| BiasGroup {
            initial: belief.vehicle * belief.vehicle,
            ..BiasGroup::constant(0.0)
        });
        let steps: Vec<BiasGroup> = belief
            .groups
            .iter()
            .flatten()
            .copied()
            .chain(constant)
            .chain(vehicle)
            .collect();
        let mut p = Covariance::zeros(3 * belief.blocks());
        let square = |sigma: [f64; 3]| Matrix3::from_diagonal(&sigma.map(|s| s * s).into());
        add_block(&mut p, R, &square(initial.pos_sigma_m));
        add_block(&mut p, V, &square(initial.vel_sigma_m_s));
        // Rows and columns of psi_n are correlated where pitch or roll are not zero: a full block, not a
        // diagonal.
        add_block(
            &mut p,
            PSI,
            &attitude_covariance(about, initial.att_sigma_deg),
        );
        for (g, step) in steps.iter().enumerate() {
            add_block(
                &mut p,
                BIAS + g,
                &Matrix3::from_diagonal(&step.initial.to_array().into()),
            );
        }
        let dim = p.dim();
        let zeros = || vec![Lanes::ZERO; dim];
        Self {
            nominal,
            estimates: vec![Vec3::ZERO; steps.len()],
            p,
            steps,
            white: belief.white,
            regressors: belief
                .unknowns
                .each_ref()
                .map(|u| u.iter().map(Regressor::of).collect()),
            dt: 1.0 / belief.rate_hz,
            age: 0.0,
            belief: belief.clone(),
            earth_age: 0.0,
            omega_ib_b: Vec3::ZERO,
            transition: None,
            scratch: Scratch {
                ph: zeros(),
                gain: zeros(),
                error: zeros(),
            },
            level: Level::best(),
            fix_update: FixUpdate::default(),
        }
    }

    /// The same filter with another update by fixes.
    #[must_use]
    pub(crate) fn with_update(self, fix_update: FixUpdate) -> Self {
        Self { fix_update, ..self }
    }

    /// The same filter with other vector units, for comparison; portable where the machine lacks them.
    #[must_use]
    pub fn at_level(self, level: Level) -> Self {
        Self { level, ..self }
    }

    /// The next samples last `dt` seconds, whatever the belief's own rate: white noise keeps its density,
    /// biases their correlation time and variance. For recorded data, whose clock is not even and whose
    /// samples are split where a fix falls between them.
    pub(crate) fn set_interval(&mut self, dt: f64) {
        let ratio = dt * self.belief.rate_hz;
        // The zip ends with the bias groups: the unknown constants behind them have no step that depends on
        // dt.
        for (step, believed) in self
            .steps
            .iter_mut()
            .zip(self.belief.groups.iter().flatten())
        {
            *step = believed.over(ratio);
        }
        // A mean over `ratio` samples: the variance of white noise falls as the interval grows, its density
        // stays.
        self.white = self.belief.white.map(|w| w / ratio);
        self.dt = dt;
    }

    /// Adds to the white variances of a sample, accelerometer ((m/s²)²) and gyroscope ((rad/s)²), until the next
    /// [`set_interval`](Self::set_interval): for samples that were not measured.
    pub(crate) fn add_white(&mut self, variances: [DVec3; 2]) {
        for (white, more) in self.white.iter_mut().zip(variances) {
            *white += more;
        }
    }

    /// The blocks behind the navigation's.
    #[inline(always)]
    pub(super) fn sources(&self) -> Sources<'_> {
        Sources::new(&self.belief, &self.steps, &self.regressors)
    }

    /// A sample less its estimated errors; it becomes the regressor of its scale factor. The sensor reads
    /// (1 + s) ∘ sample + biases + slope · `age`, the number of the sample since the start.
    #[inline(always)]
    fn corrected<W: Wide>(&mut self, sensor: Sensor, mut sample: Vec3<W>, age: f64) -> Vec3<W> {
        sample = sample - self.bias_sum(sensor);
        let first = self.sources().unknowns(sensor);
        // in the order of their kinds: drifts, which add to the sample as biases do, before scale factors
        for (regressor, estimate) in self.regressors[sensor as usize]
            .iter_mut()
            .zip(&self.estimates[first..])
        {
            let estimate = estimate.load();
            if regressor.kind == UnknownKind::Drift {
                let age = Vec3::splat(DVec3::splat(age));
                sample = sample - times(estimate, age);
                regressor.value.store(age);
            } else {
                for axis in 0..3 {
                    sample[axis] = sample[axis] / (estimate[axis] + 1.0);
                }
                // ∂/∂s of (y − b)/(1 + s) is −sample/(1 + s); the factor 1/(1 + s) is left out: 300 ppm of a
                // coefficient.
                regressor.value.store(sample);
            }
        }
        sample
    }

    /// The sum of the bias groups of a sensor.
    #[inline(always)]
    pub(super) fn bias_sum<W: Wide>(&self, sensor: Sensor) -> Vec3<W> {
        let [accel, gyro] = self.belief.groups.each_ref().map(Vec::len);
        let of_sensor = if sensor == Sensor::Accel {
            0..accel
        } else {
            accel..accel + gyro
        };
        let mut sum = Vec3::splat(DVec3::ZERO);
        for bias in &self.estimates[of_sensor] {
            sum = sum + bias.load();
        }
        sum
    }

    /// Advances by one IMU sample: mean rate (rad/s) and mean specific force (m/s²) over the interval.
    #[inline(always)]
    fn predict<W: Wide>(&mut self, ins: &mut Strapdown<W>, omega_ib_b: Vec3<W>, f_ib_b: Vec3<W>) {
        let dt = self.dt;
        // The estimates obey the model between fixes: those of a Gauss-Markov bias decay towards zero.
        for (estimate, step) in self.estimates.iter_mut().zip(&self.steps) {
            for axis in 0..3 {
                (W::load(&estimate[axis]) * step.phi[axis]).store(&mut estimate[axis]);
            }
        }
        // the drift is that of the interval's middle, counted so that whole samples are 1, 2, 3, …
        let samples = dt * self.belief.rate_hz;
        let age = self.age + 0.5 * (samples + 1.0);
        self.age += samples;
        let omega_ib_b = self.corrected(Sensor::Gyro, omega_ib_b, age);
        let f_ib_b = self.corrected(Sensor::Accel, f_ib_b, age);
        self.omega_ib_b.store(omega_ib_b);
        let seconds = W::from(dt);
        // The nominal state first: the map is linearised about the interval it has just passed through.
        let sample = Sample::new(&ins.step(omega_ib_b * seconds, f_ib_b * seconds, dt), dt);
        let sources = Sources::new(&self.belief, &self.steps, &self.regressors);
        self.p.step(&sample, &sources);
        if let Some(transition) = &mut self.transition {
            transition.step(&sample, &sources);
        }
        // After the map: this noise belongs to the sample itself and is not propagated by it, except within
        // it.
        self.add_white_noise(&sample);
        self.earth_age += dt;
        // At the sample nearest to the step: a comparison without slack would hang on the last bit of a sum
        // of 0.01 s.
        if self.earth_age + 0.5 * dt > EARTH_STEP_S {
            self.apply_earth_terms(ins);
        }
    }

    /// The Earth terms over the time since they were last applied.
    #[inline(always)]
    pub(super) fn apply_earth_terms<W: Wide>(&mut self, ins: &Strapdown<W>) {
        if self.earth_age > 0.0 {
            let step = EarthStep {
                terms: EarthTerms::at(ins),
                dt: self.earth_age,
            };
            self.earth_age = 0.0;
            let sources = Sources::new(&self.belief, &self.steps, &self.regressors).still();
            self.p.step(&step, &sources);
            if let Some(transition) = &mut self.transition {
                transition.step(&step, &sources);
            }
        }
    }

    /// White noise of one sample, held over dt: sigma² dt² into V and PSI, and the part of it that the
    /// sample itself carries on to R and V.
    #[inline(always)]
    fn add_white_noise<W: Wide>(&mut self, sample: &Sample<W>) {
        // The gyroscope's own part in V × V, (g dt/2)² sigma_g² dt², is left out: 2.5e-3 sigma_g² at 100 Hz,
        // far below sigma_a² of any IMU (both in SI).
        let (accel, gyro) = (
            sample.rotated_noise(self.white[0]),
            sample.rotated_noise(self.white[1]),
        );
        let half = W::from(0.5 * self.dt);
        let to_position = accel.scaled(half);
        self.p.add_diagonal_block(V, &accel);
        self.p.add_diagonal_block(R, &to_position.scaled(half));
        self.p.add_diagonal_block(PSI, &gyro);
        for j in 0..3 {
            let tilted = sample.tilted_noise(&gyro, j);
            for i in 0..3 {
                self.p.add(3 * R + i, 3 * V + j, to_position.0[i][j]);
                self.p.add(3 * V + i, 3 * PSI + j, tilted[i]);
            }
        }
    }
}

/// The product axis by axis.
#[inline(always)]
fn times<W: Wide>(a: Vec3<W>, b: Vec3<W>) -> Vec3<W> {
    Vec3([a[0] * b[0], a[1] * b[1], a[2] * b[2]])
}

/// Adds the same block to the diagonal of all lanes.
fn add_block(p: &mut Covariance, block: usize, m: &Matrix3<f64>) {
    p.add_diagonal_block(
        block,
        &Mat3([0, 1, 2].map(|i| [0, 1, 2].map(|j| Lanes::splat(m[(i, j)])))),
    );
}

/// Covariance of psi_n for standard deviations of roll, pitch and yaw (degrees).
fn attitude_covariance(state: &NavState, sigma_deg: [f64; 3]) -> Matrix3<f64> {
    let psi = psi_of_angles(state.q_b_n);
    let variances = sigma_deg.map(|s| (s * DEG).powi(2));
    psi * Matrix3::from_diagonal(&variances.into()) * psi.transpose()
}

/// Brings the covariance up to the time of the last sample (the Earth terms lag by up to
/// `EARTH_STEP_S`): to be called before it is looked at.
pub fn settle(ekf: &mut Ekf) {
    dispatch(ekf.level, Settle(ekf));
}

struct Settle<'a>(&'a mut Ekf);

impl Kernel for Settle<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        let ins = self.0.nominal.load::<W>();
        self.0.apply_earth_terms(&ins);
    }
}

/// Advances a filter through IMU samples: the same ideal samples for all runs plus the errors of each,
/// accelerometer (m/s²) and gyroscope (rad/s).
///
/// # Panics
/// When samples and errors are not equally many.
pub fn advance(ekf: &mut Ekf, samples: &[ImuSample], errors: &[[Vec3; 2]]) {
    assert_eq!(samples.len(), errors.len(), "one error for each sample");
    dispatch(
        ekf.level,
        Advance {
            ekf,
            samples,
            errors,
        },
    );
}

struct Advance<'a> {
    ekf: &'a mut Ekf,
    samples: &'a [ImuSample],
    errors: &'a [[Vec3; 2]],
}

impl Kernel for Advance<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        let mut ins = self.ekf.nominal.load::<W>();
        for (sample, [accel, gyro]) in self.samples.iter().zip(self.errors) {
            // Runs differ by their errors only; the ideal samples are read once for eight.
            let omega_ib_b = Vec3::splat(sample.omega_ib_b) + gyro.load();
            let f_ib_b = Vec3::splat(sample.f_ib_b) + accel.load();
            self.ekf.predict(&mut ins, omega_ib_b, f_ib_b);
        }
        self.ekf.nominal.store(&ins);
    }
}
