//! The filter itself: nominal state, bias estimates and covariance of eight runs.

use super::covariance::{
    BIAS, BiasBlocks, Covariance, EARTH_STEP_S, EarthStep, EarthTerms, PSI, R, Sample, Transition,
    V, load_triple,
};
use super::filter_model::{BiasGroup, FilterModel, InitialSettings, psi_of_angles};
use super::update::{FixUpdate, GainSource};
use crate::frames::NavState;
use crate::imu::{ImuSample, Sensor};
use crate::lanes::{Kernel, Lanes, Level, Mat3, Real, Vec3, Wide, dispatch};
use crate::strapdown::Strapdown;
use crate::units::DEG;
use glam::DVec3;
use nalgebra::{DMatrix, DVector, Matrix3};
use std::ops::Range;

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
    /// Noise model at the filter's own rate.
    pub(super) filter_model: FilterModel,
    /// The same of a sample of `dt` seconds: the step of each block behind the navigation's, white variances.
    pub(super) steps: Vec<BiasGroup>,
    white: [DVec3; 2],
    /// Factors on the unknowns of each sensor in the last sample.
    pub(super) regressors: [Vec<Regressor>; 2],
    dt: f64,
    /// Samples of the belief's rate since the start.
    age: f64,
    /// Time since the Earth terms were last applied (s).
    earth_age: f64,
    /// Angular rate of the last sample less its bias (rad/s), for the lever arm's velocity.
    pub(super) omega_ib_b: Vec3,
    /// The transition since it was last examined, where a smoother needs it.
    pub(super) transition: Option<Transition>,
    pub(super) scratch: Scratch,
    pub(super) level: Level,
    pub(super) fix_update: FixUpdate,
    pub(crate) gains: GainSource,
}

/// Working vectors of the measurement update, one entry a state.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    pub ph: Vec<Lanes>,
    pub gain: Vec<Lanes>,
    pub error: Vec<Lanes>,
}

impl Scratch {
    /// The estimated errors of a block.
    #[inline(always)]
    pub(super) fn of<W: Wide>(&self, block: usize) -> Vec3<W> {
        load_triple(&self.error[3 * block..])
    }
}

impl Ekf {
    /// A filter at its nominal start, with zero estimates of biases and unknowns, whose deviations are those
    /// of the belief. The attitude standard deviations, given for roll, pitch and yaw, are brought to psi_n at
    /// the attitude of `about`, the same in all lanes.
    pub fn new(
        nominal: Strapdown,
        filter_model: &FilterModel,
        about: &NavState,
        initial: &InitialSettings,
    ) -> Self {
        let unknowns = filter_model.unknowns.iter().flatten();
        let constant = unknowns.map(|u| BiasGroup {
            initial: u.sigma * u.sigma,
            ..BiasGroup::constant(0.0)
        });
        let vehicle = (filter_model.vehicle != DVec3::ZERO).then(|| BiasGroup {
            initial: filter_model.vehicle * filter_model.vehicle,
            ..BiasGroup::constant(0.0)
        });
        let steps: Vec<BiasGroup> = filter_model
            .groups
            .iter()
            .flatten()
            .copied()
            .chain(constant)
            .chain(vehicle)
            .collect();
        let mut p = Covariance::zeros(3 * filter_model.blocks());
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
            white: filter_model.white,
            regressors: filter_model
                .unknowns
                .each_ref()
                .map(|u| u.iter().map(Regressor::of).collect()),
            dt: 1.0 / filter_model.rate_hz,
            age: 0.0,
            filter_model: filter_model.clone(),
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
            gains: GainSource::Own,
        }
    }

    /// The filter with another update by fixes.
    pub(crate) fn with_update(self, fix_update: FixUpdate) -> Self {
        Self { fix_update, ..self }
    }

    /// The filter with other vector units, for comparison; portable where the machine lacks them.
    pub fn at_level(self, level: Level) -> Self {
        Self { level, ..self }
    }

    /// The next samples last `dt` seconds, whatever the belief's own rate: white noise keeps its density,
    /// biases their correlation time and variance. For recorded data, whose clock is not even and whose
    /// samples are split where a fix falls between them.
    pub(crate) fn set_interval(&mut self, dt: f64) {
        let ratio = dt * self.filter_model.rate_hz;
        // The zip ends with the bias groups: the unknown constants behind them have no step that depends on
        // dt.
        for (step, believed) in self
            .steps
            .iter_mut()
            .zip(self.filter_model.groups.iter().flatten())
        {
            *step = believed.over(ratio);
        }
        // A mean over `ratio` samples: the variance of white noise falls as the interval grows, its density
        // stays.
        self.white = self.filter_model.white.map(|w| w / ratio);
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
    pub(super) fn sources(&self) -> BiasBlocks<'_> {
        BiasBlocks::new(&self.filter_model, &self.steps, &self.regressors)
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
            if regressor.kind == CoefficientKind::Drift {
                sample = sample - estimate * W::from(age);
                regressor.value = Vec3::splat(DVec3::splat(age));
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

    /// The bias groups of a sensor among the blocks behind the navigation's.
    #[inline(always)]
    fn bias_blocks(&self, sensor: Sensor) -> Range<usize> {
        let [accel, gyro] = self.filter_model.groups.each_ref().map(Vec::len);
        match sensor {
            Sensor::Accel => 0..accel,
            Sensor::Gyro => accel..accel + gyro,
        }
    }

    /// The sum of the bias groups of a sensor.
    #[inline(always)]
    fn bias_sum<W: Wide>(&self, sensor: Sensor) -> Vec3<W> {
        let mut sum = Vec3::splat(DVec3::ZERO);
        for bias in &self.estimates[self.bias_blocks(sensor)] {
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
        let samples = dt * self.filter_model.rate_hz;
        let age = self.age + 0.5 * (samples + 1.0);
        self.age += samples;
        let omega_ib_b = self.corrected(Sensor::Gyro, omega_ib_b, age);
        let f_ib_b = self.corrected(Sensor::Accel, f_ib_b, age);
        self.omega_ib_b.store(omega_ib_b);
        let seconds = W::from(dt);
        // The nominal state first: the map is linearised about the interval it has just passed through.
        let passed = ins.step(omega_ib_b * seconds, f_ib_b * seconds, dt);
        if matches!(self.gains, GainSource::Given(..)) {
            return;
        }
        let sample = Sample::new(&passed, dt);
        let sources = BiasBlocks::new(&self.filter_model, &self.steps, &self.regressors);
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
            // A kernel of its own, once in many samples: inlined here it takes the compiler long.
            self.nominal.store(ins);
            apply_pending_earth_step(self);
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

/// Applies the Earth-rate terms not yet propagated (they lag by up to `EARTH_STEP_S`). Call before reading the
/// covariance.
pub fn apply_pending_earth_step(ekf: &mut Ekf) {
    dispatch(ekf.level, ApplyEarthStep(ekf));
}

struct ApplyEarthStep<'a>(&'a mut Ekf);

impl Kernel for ApplyEarthStep<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        let ekf = self.0;
        if ekf.earth_age > 0.0 {
            let step = EarthStep {
                terms: EarthTerms::at(&ekf.nominal.load::<W>()),
                dt: ekf.earth_age,
            };
            ekf.earth_age = 0.0;
            let sources = BiasBlocks::new(&ekf.filter_model, &ekf.steps, &ekf.regressors)
                .with_identity_transition();
            ekf.p.step(&step, &sources);
            if let Some(transition) = &mut ekf.transition {
                transition.step(&step, &sources);
            }
        }
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

// One run of the filter at an instant, to be returned to.

/// Nominal state and estimates of the first lane, without their covariance.
pub(crate) struct Snapshot {
    nominal: NavState,
    /// Estimates of biases and unknowns, then what the unknowns are multiplied by.
    triples: Vec<DVec3>,
}

impl Ekf {
    /// The first lane as it is.
    pub(crate) fn snapshot(&self) -> Snapshot {
        // The regressors too: the bias of a drift is slope times the age of the sample, and that is of the
        // past here.
        let regressors = self.regressors.iter().flatten().map(|r| &r.value);
        let triples = self
            .estimates
            .iter()
            .chain(regressors)
            .map(|triple| triple.lane(0))
            .collect();
        Snapshot {
            nominal: self.nominal.lane(0),
            triples,
        }
    }

    /// Sets the first lane to a snapshot less an estimated error, whose covariance is `p`. The other lanes, and what the
    /// next sample needs of the ones before, are left as they are: the filter is then to be examined only.
    pub(crate) fn show(&mut self, snapshot: &Snapshot, error: &DVector<f64>, p: &DMatrix<f64>) {
        self.nominal.set_lane(0, &snapshot.nominal);
        let regressors = self.regressors.iter_mut().flatten().map(|r| &mut r.value);
        let triples = self.estimates.iter_mut().chain(regressors);
        triples
            .zip(&snapshot.triples)
            .for_each(|(to, from)| to.set_lane(0, *from));
        self.p.set_lane(0, p);
        // `p` is that of the snapshot's instant: an age left over would add the Earth terms of another
        // interval.
        self.earth_age = 0.0;
        for (to, from) in self.scratch.error.iter_mut().zip(error.iter()) {
            *to = Lanes::ZERO;
            // The other lanes get no correction: zero moves them nowhere.
            to[0] = *from;
        }
        super::update::apply_correction(self);
    }

    /// Correction of the state of the first lane by the last update.
    pub(crate) fn correction(&self) -> DVector<f64> {
        DVector::from_iterator(
            self.p.dim(),
            self.scratch.error.iter().map(|error| error[0]),
        )
    }
}

// Unknown constants of a sensor that act on its samples multiplied by something known: the regressor. The
// error of a sample is their product, axis by axis; a bias is the case whose regressor is 1.

/// Kind of an unknown constant, which determines its factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CoefficientKind {
    /// The slope of a drift (units per sample of the model), times the samples since the filter's start: a
    /// known magnitude of unknown sign has the same second moments as a normal slope of that deviation.
    Drift,
    /// A scale-factor error (1), times the sample itself: f_ib_b or omega_ib_b.
    ScaleFactor,
}

/// An unknown constant on each axis of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorCoefficient {
    /// Its kind.
    pub kind: CoefficientKind,
    /// Its standard deviations on the three axes (units per sample, or 1).
    pub sigma: DVec3,
}

/// Factor on an unknown constant in the last sample.
#[derive(Debug, Clone)]
pub(super) struct Regressor {
    kind: CoefficientKind,
    pub value: Vec3,
}

impl Regressor {
    /// The regressor of an unknown before the first sample: zero.
    const fn of(unknown: &ErrorCoefficient) -> Self {
        Self {
            kind: unknown.kind,
            value: Vec3::ZERO,
        }
    }
}

/// Most kinds of unknowns of a sensor.
pub(super) const KINDS: usize = 2;

/// A block of three states and what each of them is multiplied by.
type Term = (usize, Vec3);

impl Ekf {
    /// The bias estimate of a sensor (m/s² or rad/s): the sum of its groups and its drift.
    #[inline(always)]
    pub(crate) fn bias_of<W: Wide>(&self, sensor: Sensor) -> Vec3<W> {
        let mut sum = self.bias_sum::<W>(sensor);
        if let Some((block, factor)) = self.drift_term(sensor) {
            let (slope, age) = (self.estimates[block - BIAS].load::<W>(), factor.load::<W>());
            for axis in 0..3 {
                sum[axis] = slope[axis].mul_add(age[axis], sum[axis]);
            }
        }
        sum
    }

    /// Standard deviations of that estimate on the three axes (m/s² or rad/s).
    pub(crate) fn bias_sigma(&self, sensor: Sensor) -> Vec3 {
        let one = Vec3::splat(DVec3::ONE);
        let groups = self.bias_blocks(sensor).map(|g| (BIAS + g, one));
        let terms = groups.chain(self.drift_term(sensor));
        let variance = |axis: usize| {
            // Var(Σ c_a x_a) with all covariances: after some fixes the groups of an axis are strongly
            // anti-correlated (the sum is observed, not its parts), and a sum of variances would be too large
            // many times over.
            let of_term = |a: Term| terms.clone().map(move |b| (a, b));
            let pairs = terms.clone().flat_map(of_term);
            pairs.fold(Lanes::ZERO, |sum, ((a, of_a), (b, of_b))| {
                sum + self.p.get::<Lanes>(3 * a + axis, 3 * b + axis) * of_a[axis] * of_b[axis]
            })
        };
        Vec3([0, 1, 2].map(|axis| variance(axis).sqrt()))
    }

    /// The slope of a sensor's drift and the age of the last sample.
    fn drift_term(&self, sensor: Sensor) -> Option<Term> {
        let sources = self.sources();
        // in the order of their kinds: a drift is the first
        let first = sources.regressors[sensor as usize].first()?;
        let is_drift = first.kind == CoefficientKind::Drift;
        is_drift.then(|| (BIAS + sources.unknowns(sensor), first.value))
    }
}
