//! A trajectory as a linear filter sees it: maps of the navigation error, and when it is measured.

use super::pass::add_scaled;
use super::truth::defects;
use crate::closure::Bounds;
use crate::earth::ned_difference;
use crate::ekf::covariance::{
    EARTH_STEP_S, EarthStep, EarthTerms, ErrorMap, NavError, PSI, R, Sample, V,
};
use crate::ekf::filter_model::{BiasGroup, psi_of_angles};
use crate::ekf::{CoefficientKind, FilterModel, body_velocity_rows, fix_rows, yaw_row};
use crate::frames::{NavState, RollPitchYaw};
use crate::imu::{Channel, ImuSample, Sensor};
use crate::lanes::{Kernel, LANES, Lanes, Level, Mat3, Quat, Vec3, Wide, dispatch};
use crate::noise::{Ar1Bank, Model, Process, ProcessKind};
use crate::sensors::aiding::{Aid, AidPart, ErrorProcess};
use crate::sensors::defects::{ErrorInput, ErrorInputs};
use crate::sensors::outage::Outage;
use crate::simulation::BIASES;
use crate::simulation::plan::{
    Event, Experiment, ExperimentError, TrueAid, check_rotation, error_inputs, schedule,
};
use crate::strapdown::{StepTrace, Strapdown};
use crate::trajectory::ideal_imu::IdealSamples;
use crate::units::DEG;
use glam::{DQuat, DVec3};
use std::iter::Peekable;
use std::ops::Range;
use std::sync::Arc;

/// Navigation states: R, V, PSI.
pub(super) const NAV: usize = 9;
/// A navigation error, or a column of nine.
pub(super) type Nav = [f64; NAV];

/// Longest step (s): a bias is represented by its mean over the step.
const STEP_S: f64 = 0.2;

/// Propagation of the navigation error over a step: x⁺ = `m` x + `b` e, with e the mean errors of
/// the biases (estimate minus truth) of the signals over the step. Columns; `b` of the signals that
/// the track follows.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub samples: u32,
    pub m: [Nav; NAV],
    pub b: Vec<Nav>,
    /// Covariance of the navigation error for white noise of variance 1 in each sample of a signal, by signals that are not
    /// multiplied; none where it acts through its mean over the step, as that of a bias does.
    pub white: Vec<[Nav; NAV]>,
}

/// Measured quantity.
#[derive(Debug, Clone, Copy)]
pub(super) enum MeasurementKind {
    /// This component of a fix's position.
    Position(usize),
    /// The velocity of a fix.
    Velocity,
    /// The height of a barometer.
    Height,
    /// Aiding measurement of the vehicle, along this axis.
    Aid(Aid, usize),
}

impl MeasurementKind {
    /// Kinds: positions and velocities of fixes, heights, each aid.
    pub(super) const KINDS: usize = 3 + Aid::ALL.len();

    /// Index among the kinds.
    pub(super) const fn kind(self) -> usize {
        match self {
            Self::Position(_) => 0,
            Self::Velocity => 1,
            Self::Height => 2,
            Self::Aid(aid, _) => 3 + aid as usize,
        }
    }

    pub(super) const fn is_of_fix(self) -> bool {
        self.kind() < 2
    }
}

/// A scalar measurement: nine coefficients of the navigation error, three of the gyroscope's error.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScalarMeasurement {
    pub h: [f64; NAV + 3],
    /// Motion and temperature to which errors of the gyroscope are proportional.
    error_inputs: ErrorInputs,
    /// Variance of its white noise, as in the filter's model.
    pub r: f64,
    /// Variance of its true white noise.
    pub noise: f64,
    pub what: MeasurementKind,
    /// Velocity of the point of the vehicle (m/s) and acceleration (m/s²), in b.
    motion: [DVec3; 2],
    /// True if outages withhold it.
    pub of_gnss: bool,
}

impl ScalarMeasurement {
    /// A measurement whose true noise is as in the filter's model.
    fn new(h: [f64; NAV + 3], error_inputs: ErrorInputs, r: f64, what: MeasurementKind) -> Self {
        Self {
            h,
            error_inputs,
            r,
            noise: r,
            what,
            motion: [DVec3::ZERO; 2],
            of_gnss: what.is_of_fix(),
        }
    }

    /// True if a state of these sides may have a coefficient of its own.
    pub(super) fn is_of_states(&self, sides: &AugmentedStates) -> bool {
        sides.have_outer || self.h[NAV..].iter().any(|h| *h != 0.0)
    }

    /// The coefficient of a source's state in the measurement after `elapsed` samples, beside its part through the
    /// navigation error.
    pub(super) fn coefficient(&self, source: &ErrorSourceState, elapsed: f64) -> f64 {
        match (source.outer, self.what) {
            (None, _) => {}
            (Some(MeasurementError::Position(of)), MeasurementKind::Position(here)) => {
                return f64::from(u8::from(of == here));
            }
            (Some(MeasurementError::Vehicle(part)), MeasurementKind::Aid(aid, axis))
                if part.aid() == aid =>
            {
                return part.coefficient(axis, self.motion[0], self.motion[1]);
            }
            (Some(_), _) => return 0.0,
        }
        match place(source.signal) {
            (0, ..) => 0.0,
            // The coefficient of the lever arm's velocity is per unit of the rate's error, and this is the
            // error that the source has at the instant: a bias its value, a drift its slope times its age.
            (_, axis, of) => {
                source.share(elapsed) * (self.h[NAV + axis] * self.error_inputs.value(of))
            }
        }
    }
}

/// An instant between steps.
#[derive(Debug, Clone)]
pub(super) struct TrackEpoch {
    /// Steps from the start until here.
    steps: usize,
    /// Time from the start (s).
    pub after_s: f64,
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// True if a fix is used.
    pub fix: bool,
    /// Scalar measurements, in sequence: the same in each copy of a track.
    pub rows: Arc<[ScalarMeasurement]>,
    pub report: bool,
    /// Outages that end here, before the measurements.
    pub outages: Vec<usize>,
    /// Roll, pitch, yaw errors (rad) from `psi_n` (rad), at the true attitude.
    pub jacobian: [DVec3; 3],
    /// Error of the strapdown algorithm over the steps that lead here (m, m/s, rad), which no sensor makes.
    pub closure: Nav,
}

/// A trajectory with its fixes, ready for any number of passes.
#[derive(Debug, Clone)]
pub struct Track {
    /// Outages change no step: tracks that differ in them alone share these.
    steps: Arc<Vec<Step>>,
    /// Steps of [`LONG_STEP_S`] by the mark at which each begins, with the mark at which it ends.
    long: Arc<Vec<Option<(usize, Step)>>>,
    pub(super) marks: Vec<TrackEpoch>,
    pub(super) outages: usize,
    /// Covariance of the navigation error at the start, as in the filter's model.
    pub(super) start: [Nav; NAV],
    /// True if it starts without error.
    pub(super) perfect: bool,
}

impl Track {
    /// Linearises along the reference of an experiment. Of its truth, beliefs and random numbers it takes nothing;
    /// the models that are assessed along it must belong to its rate.
    ///
    /// # Errors
    /// When trajectory, rates and fixes do not fit together.
    pub fn along(experiment: &Experiment<'_>) -> Result<Self, ExperimentError> {
        Self::of_noise_at(experiment.rate_hz, experiment)
    }

    /// For models of another rate than that at which the motion is sampled (Hz).
    pub(super) fn of_noise_at(
        noise_hz: f64,
        experiment: &Experiment<'_>,
    ) -> Result<Self, ExperimentError> {
        let clear = &Experiment {
            outages: &[],
            ..experiment.clone()
        };
        let Experiment {
            trajectory,
            rate_hz,
            gravity,
            ..
        } = *experiment;
        let samples = IdealSamples::new(trajectory, rate_hz, gravity)?;
        let events = schedule(clear, samples.len())?;
        let start = trajectory.state(trajectory.start_s());
        let mut line = Linearisation::new(clear, samples, &start, noise_hz);
        let longest = ((STEP_S * experiment.rate_hz).round() as usize).max(1);
        let (mut steps, mut marks, mut done) = (Vec::new(), Vec::with_capacity(events.len()), 0);
        for event in &events {
            let samples = event.sample - done;
            // Parts of equal length: what the noise processes do over a step is computed once for each length
            // that occurs.
            let part = samples.div_ceil(samples.div_ceil(longest).max(1)).max(1);
            for begin in (done..event.sample).step_by(part) {
                steps.push(line.step(begin..event.sample.min(begin + part))?);
            }
            done = event.sample;
            marks.push(TrackEpoch {
                steps: steps.len(),
                after_s: event.sample as f64 / experiment.rate_hz,
                t_s: event.t_s,
                fix: event.fix,
                rows: line.rows(event).into(),
                report: event.report,
                outages: Vec::new(),
                jacobian: RollPitchYaw::from_quat(event.reference.q_b_n).jacobian_of_psi_n(),
                closure: line.close(&event.reference),
            });
        }
        drop_closed(&mut marks);
        let track = Self {
            steps: Arc::new(steps),
            long: Arc::default(),
            marks,
            outages: 0,
            start: covariance_of_start(experiment, &start),
            perfect: experiment.initial.perfect,
        };
        Ok(track.with_outages(experiment.outages))
    }

    /// Copy of a track without outages, with these.
    pub fn with_outages(&self, outages: &[Outage]) -> Self {
        debug_assert_eq!(self.outages, 0, "the track has outages already");
        let mut track = self.clone();
        track.outages = outages.len();
        for mark in &mut track.marks {
            if Outage::any_withholds(outages, mark.t_s) {
                mark.fix = false;
                let goes_on = |row: &&ScalarMeasurement| !row.of_gnss;
                mark.rows = mark.rows.iter().filter(goes_on).copied().collect();
            }
        }
        for (i, outage) in outages.iter().enumerate() {
            let end = outage.end_among(track.marks.iter().map(|mark| (mark.t_s, mark.fix)));
            track.marks[end].outages.push(i);
        }
        track
    }

    /// Copy in which the filter inflates the sigmas of the aiding measurements by `factor`; their true noise is
    /// unchanged.
    pub fn with_aiding_sigmas(&self, factor: f64) -> Self {
        let mut track = self.clone();
        let believed = |row: &ScalarMeasurement| match row.what {
            MeasurementKind::Aid(..) => ScalarMeasurement {
                r: row.r * factor * factor,
                ..*row
            },
            _ => *row,
        };
        for mark in &mut track.marks {
            mark.rows = mark.rows.iter().map(believed).collect();
        }
        track
    }

    /// Returns true if the strapdown makes no error along it.
    pub(super) fn is_closed(&self) -> bool {
        self.marks.iter().all(|mark| mark.closure == [0.0; NAV])
    }

    /// Some marks, each with the steps that lead to it.
    pub(super) fn legs(&self, marks: Range<usize>) -> impl Iterator<Item = (&[Step], &TrackEpoch)> {
        marks.map(|mark| (self.leg(mark), &self.marks[mark]))
    }

    /// The steps that lead to a mark.
    pub(super) fn leg(&self, mark: usize) -> &[Step] {
        let before = mark.checked_sub(1);
        let begin = before.map_or(0, |before| self.marks[before].steps);
        &self.steps[begin..self.marks[mark].steps]
    }
}

/// State of the linearisation along the reference.
struct Linearisation<'a> {
    experiment: &'a Experiment<'a>,
    /// The ideal IMU, and its first sample.
    samples: Peekable<IdealSamples<'a>>,
    first: ImuSample,
    ins: Strapdown<f64>,
    /// Motion and temperature of the IMU over the last sample.
    error_inputs: ErrorInputs,
    dt: f64,
    noise_hz: f64,
    level: Level,
    /// Signals that are followed: those behind scale factors only where the true IMU has them.
    signals: usize,
}

impl<'a> Linearisation<'a> {
    fn new(
        experiment: &'a Experiment<'a>,
        samples: IdealSamples<'a>,
        start: &NavState,
        noise_hz: f64,
    ) -> Self {
        let ins = Strapdown::<f64>::new(start, experiment.gravity);
        let mut samples = samples.peekable();
        let first = samples.peek().copied().unwrap_or_default();
        let defects = Sensor::ALL
            .into_iter()
            .flat_map(|sensor| defects(experiment.defects, sensor));
        let signals = defects
            .flat_map(|s| s.side.inertial.states)
            .map(|s| s.signal + 1)
            .fold(CROSS_COUPLING, usize::max);
        Self {
            experiment,
            samples,
            first,
            ins,
            error_inputs: ErrorInputs::default(),
            dt: 1.0 / experiment.rate_hz,
            noise_hz,
            level: Level::best(),
            signals,
        }
    }

    /// The maps of the samples one after the other, the Earth's as the filter applies them.
    fn step(&mut self, samples: Range<usize>) -> Result<Step, ExperimentError> {
        // Samples of the noise model's rate, which need not be the rate at which the motion is sampled.
        let count = samples.len() as f64 * self.dt * self.noise_hz;
        let mut columns = Columns::new(self.signals);
        let (mut age, last) = (0.0, samples.end - 1);
        // The range first: `zip` would take a sample before it sees that there is no further index.
        for (index, sample) in samples.zip(&mut self.samples) {
            check_rotation(self.experiment, index, &sample)?;
            self.error_inputs = error_inputs(self.experiment, index, &sample, &self.first);
            columns.set_error_inputs(&self.error_inputs);
            let (dtheta, dv) = (sample.omega_ib_b * self.dt, sample.f_ib_b * self.dt);
            let trace = self.ins.step(Vec3::splat(dtheta), Vec3::splat(dv), self.dt);
            age += self.dt;
            // A measurement meets a covariance that has all of the Earth's terms, as `apply_pending_earth_step` gives it in the
            // filter.
            let is_settled = index == last || age + 0.5 * self.dt > EARTH_STEP_S;
            let earth = is_settled.then(|| EarthStep {
                terms: EarthTerms::at(&self.ins),
                dt: age,
            });
            let maps = Maps {
                columns: &mut columns,
                trace: &trace,
                dt: self.dt,
                earth: earth.as_ref(),
            };
            dispatch(self.level, maps);
            if is_settled {
                age = 0.0;
            }
        }
        let (m, b) = columns.into_maps();
        Ok(Step {
            samples: count.round().max(1.0) as u32,
            m,
            b,
            white: Vec::new(),
        })
    }

    /// Error of the strapdown since the reference was met last (m, m/s, rad), estimate less truth; it goes on from the reference.
    fn close(&mut self, reference: &NavState) -> Nav {
        let ins = &mut self.ins;
        let r = ned_difference(reference.place(), [ins.lat, ins.lon, ins.h]);
        let v: [f64; 3] = std::array::from_fn(|i| ins.v_n[i] - reference.v_n[i]);
        let q = &ins.q_b_n;
        let found = DQuat::from_xyzw(q.v[0], q.v[1], q.v[2], q.w).normalize();
        let turned = found * reference.q_b_n.conjugate();
        // found = exp(psi_n) · reference, and q and −q are the same rotation
        let psi = turned.xyz() * 2.0_f64.copysign(turned.w);
        // The sample before and its Coriolis term stay: coning and sculling are of two samples.
        (ins.lat, ins.lon, ins.h) = (reference.lat, reference.lon, reference.h);
        (ins.v_n, ins.q_b_n) = (Vec3::splat(reference.v_n), Quat::splat(reference.q_b_n));
        flat(&[r.to_array(), v, psi.to_array()].map(Vec3))
    }

    fn rows(&self, event: &Event) -> Vec<ScalarMeasurement> {
        let experiment = self.experiment;
        let (mut rows, [_, omega_ib_b]) = (Vec::new(), self.error_inputs.sample);
        if event.fix {
            let gnss = experiment.gnss;
            let h = fix_rows(&self.ins, omega_ib_b, gnss.lever_arm_m.into());
            let sigmas = gnss
                .pos_sigma_m
                .into_iter()
                .chain(gnss.vel_sigma_m_s.into_iter().flatten());
            for (i, (h, sigma)) in h.into_iter().zip(sigmas).enumerate() {
                let what = if i < 3 {
                    MeasurementKind::Position(i)
                } else {
                    MeasurementKind::Velocity
                };
                rows.push(ScalarMeasurement::new(
                    h,
                    self.error_inputs,
                    sigma * sigma,
                    what,
                ));
            }
        }
        if let Some(baro) = experiment.baro.filter(|_| event.baro) {
            let mut h = [0.0; NAV + 3];
            h[3 * R + 2] = 1.0;
            let r = baro.sigma_m * baro.sigma_m;
            rows.push(ScalarMeasurement::new(
                h,
                self.error_inputs,
                r,
                MeasurementKind::Height,
            ));
        }
        for aided in event.aids.iter().filter(|aided| !aided.withheld) {
            self.aid(aided, &mut rows);
        }
        rows
    }

    /// The rows of what the vehicle measures of itself.
    fn aid(&self, aided: &TrueAid, rows: &mut Vec<ScalarMeasurement>) {
        let experiment = self.experiment;
        let TrueAid { aid, v_b, a_b, .. } = *aided;
        let [r, noise] = experiment.aiding.sigmas(aid).map(|sigma| sigma * sigma);
        let row = |h, axis| ScalarMeasurement {
            noise,
            motion: [v_b, a_b],
            of_gnss: experiment.aiding.is_of_gnss(aid),
            ..ScalarMeasurement::new(h, self.error_inputs, r, MeasurementKind::Aid(aid, axis))
        };
        if aid == Aid::Heading {
            rows.push(row(yaw_row(&self.ins), 0));
            return;
        }
        let [_, omega_ib_b] = self.error_inputs.sample;
        let h = body_velocity_rows(&self.ins, omega_ib_b, experiment.aiding.lever_arm_b(aid));
        rows.extend(aid.axes().iter().map(|axis| row(h[*axis], *axis)));
    }
}

/// Sets the errors of the strapdown to zero where all of them together stay below what a closure may have: beside the errors
/// of any receiver and IMU they are nothing, and a mean need not be propagated.
fn drop_closed(marks: &mut [TrackEpoch]) {
    let bounds = Bounds::default();
    let mut sum = [0.0; NAV];
    marks
        .iter()
        .for_each(|mark| add_scaled(&mut sum, 1.0, &mark.closure));
    let length = |block: usize| {
        sum[3 * block..3 * block + 3]
            .iter()
            .map(|x| x * x)
            .sum::<f64>()
            .sqrt()
    };
    let is_closed = length(R) <= bounds.position_m
        && length(V) <= bounds.velocity_m_s
        && length(PSI) <= bounds.attitude_rad;
    if is_closed {
        marks.iter_mut().for_each(|mark| mark.closure = [0.0; NAV]);
    }
}

/// The maps of a step while it is made: columns of M, then of B, eight to a register.
struct Columns {
    x: Vec<[Lanes; NAV]>,
    /// The error of accelerometer and gyroscope in each of them.
    inputs: Vec<[Vec3; 2]>,
    signals: usize,
}

impl Columns {
    fn new(signals: usize) -> Self {
        let count = (NAV + signals).div_ceil(LANES);
        let mut x = vec![[Lanes::ZERO; NAV]; count];
        for i in 0..NAV {
            x[i / LANES][i][i % LANES] = 1.0;
        }
        let mut columns = Self {
            x,
            inputs: vec![[Vec3::ZERO; 2]; count],
            signals,
        };
        (0..signals).for_each(|signal| columns.set_input(signal, 1.0));
        columns
    }

    /// Sets the factors of the signals.
    fn set_error_inputs(&mut self, error_inputs: &ErrorInputs) {
        for signal in SCALE_FACTOR..self.signals {
            let (.., of) = place(signal);
            self.set_input(signal, error_inputs.value(of));
        }
    }

    fn set_input(&mut self, signal: usize, value: f64) {
        let ((sensor, axis, _), column) = (place(signal), NAV + signal);
        self.inputs[column / LANES][sensor][axis][column % LANES] = value;
    }

    /// M and B.
    fn into_maps(self) -> ([Nav; NAV], Vec<Nav>) {
        let column = |c: usize| self.x[c / LANES].map(|row| row[c % LANES]);
        (
            std::array::from_fn(column),
            (NAV..NAV + self.signals).map(column).collect(),
        )
    }
}

/// The map of a sample after those before, and that of the Earth, which feels no sample.
struct Maps<'a> {
    columns: &'a mut Columns,
    trace: &'a StepTrace<f64>,
    dt: f64,
    earth: Option<&'a EarthStep<f64>>,
}

impl Kernel for Maps<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let trace = StepTrace {
            c_b_n: wide::<W>(&self.trace.c_b_n),
            dv_n: Vec3([
                W::from(self.trace.dv_n[0]),
                W::from(self.trace.dv_n[1]),
                W::from(self.trace.dv_n[2]),
            ]),
        };
        let sample = Sample::new(&trace, self.dt);
        for (x, [accel, gyro]) in self.columns.x.iter_mut().zip(&self.columns.inputs) {
            let after = sample.apply(loaded(x), accel.load(), gyro.load());
            stored(x, &after);
        }
        let Some(earth) = self.earth else { return };
        let terms = &earth.terms;
        let earth = EarthStep {
            terms: EarthTerms {
                rr: wide(&terms.rr),
                vr: wide(&terms.vr),
                vv: wide(&terms.vv),
                psi_r: wide(&terms.psi_r),
                psi_v: wide(&terms.psi_v),
                psi_psi: wide(&terms.psi_psi),
            },
            dt: earth.dt,
        };
        let zero = Vec3([W::from(0.0); 3]);
        for x in &mut self.columns.x {
            let after = earth.apply(loaded(x), zero, zero);
            stored(x, &after);
        }
    }
}

/// A matrix in every lane.
#[inline(always)]
fn wide<W: Wide>(m: &Mat3<f64>) -> Mat3<W> {
    let mut wide = Mat3([[W::from(0.0); 3]; 3]);
    for i in 0..3 {
        for j in 0..3 {
            wide.0[i][j] = W::from(m.0[i][j]);
        }
    }
    wide
}

#[inline(always)]
fn loaded<W: Wide>(x: &[Lanes; NAV]) -> NavError<W> {
    let mut error = [Vec3([W::from(0.0); 3]); 3];
    for block in [R, V, PSI] {
        for axis in 0..3 {
            error[block][axis] = W::load(&x[3 * block + axis]);
        }
    }
    error
}

#[inline(always)]
fn stored<W: Wide>(x: &mut [Lanes; NAV], error: &NavError<W>) {
    for block in [R, V, PSI] {
        for axis in 0..3 {
            error[block][axis].store(&mut x[3 * block + axis]);
        }
    }
}

fn flat(x: &NavError<f64>) -> Nav {
    std::array::from_fn(|i| x[i / 3][i % 3])
}

/// Covariance of the navigation error for the standard deviations of the start.
fn covariance_of_start(experiment: &Experiment<'_>, start: &NavState) -> [Nav; NAV] {
    let initial = experiment.initial;
    let psi = psi_of_angles(start.q_b_n);
    let mut p = [[0.0; NAV]; NAV];
    for i in 0..3 {
        p[3 * R + i][3 * R + i] = initial.pos_sigma_m[i].powi(2);
        p[3 * V + i][3 * V + i] = initial.vel_sigma_m_s[i].powi(2);
        for j in 0..3 {
            // J diag(σ²) Jᵀ with J from roll, pitch, yaw to psi_n.
            let angle =
                |k: usize| psi[(i, k)] * psi[(j, k)] * (initial.att_sigma_deg[k] * DEG).powi(2);
            p[3 * PSI + i][3 * PSI + j] = (0..3).map(angle).sum();
        }
    }
    p
}

// Tracks of fewer and longer steps, for the many passes of a search.

/// Longest step of an outline (s): with fixes, and without.
const OUTLINE_STEP_S: [f64; 2] = [2.0, 5.0];
/// Length of a drive from which these steps grow (s), and how far: each of the search's hundreds of passes would cost as much
/// more as the drive is longer, and the search finds its belief as well by longer steps.
const OUTLINE_DRIVE_S: f64 = 900.0;
const MOST_STRETCH: f64 = 5.0;
/// Time between two reports of an outline (s).
const REPORT_S: f64 = 10.0;

impl Track {
    /// Merges like [`Self::merged`], with a report every ten, and white noise through its mean over
    /// a step as well: a tenth faster for the hundreds of passes of a search, and within 1e-3 in
    /// every ratio.
    pub fn coarse(&self) -> Self {
        let mut track = self.with_legs(Step::joined);
        let mut reports = 0;
        for mark in &mut track.marks {
            reports += usize::from(mark.report);
            // One report in ten: reports enter the cost of a search as an average, and errors change slowly.
            mark.report &= reports % 10 == 0;
        }
        track
    }

    /// The track with one step from mark to mark, at most a second: a few times faster. White noise is exact; a bias is
    /// its mean over the step, which leaves up to 1e-4 of an error after ten seconds without fixes, 1.2e-3 after five.
    pub fn merged(&self) -> Self {
        self.with_legs(|leg| Step {
            white: Step::white_noise(leg),
            ..Step::joined(leg)
        })
    }

    /// The track with a step of five seconds wherever one of these outages has lasted for a minute: a bias is its mean over the
    /// step, which leaves up to 7e-4 of an attitude error where it changes within one, in turns.
    pub(crate) fn merged_for(&self, outages: &[Outage]) -> Self {
        let step_from = |begin: usize| {
            let from = &self.marks[begin];
            let end_s = from.after_s + LONG_STEP_S;
            let is_end = |mark: &TrackEpoch| (mark.after_s - end_s).abs() < SLACK_S;
            let is_long = |outage: &Outage| outage.takes_long_step(from.t_s);
            let end = outages.iter().any(is_long).then_some(begin + 1)?;
            let end = end + self.marks[end..].iter().position(is_end)?;
            let leg = &self.steps[from.steps..self.marks[end].steps];
            let white = Step::white_noise(leg);
            Some((
                end,
                Step {
                    white,
                    ..Step::joined(leg)
                },
            ))
        };
        // Errors of the strapdown at the marks in between would be lost.
        let begins = if self.is_closed() {
            0..self.marks.len()
        } else {
            0..0
        };
        Self {
            long: Arc::new(begins.map(step_from).collect()),
            ..self.merged()
        }
    }

    /// The steps that lead from the mark before `next` through an outage without measurements, and the mark at which they end,
    /// before `end`.
    pub(super) fn through(&self, outage: &Outage, next: usize, end: usize) -> (&[Step], usize) {
        let before = next
            .checked_sub(1)
            .filter(|at| outage.takes_long_step(self.marks[*at].t_s));
        let long = before.and_then(|at| self.long.get(at)?.as_ref());
        match long.filter(|(last, _)| *last < end) {
            Some((last, step)) => (std::slice::from_ref(step), *last),
            None => (self.leg(next), next),
        }
    }

    /// One step from mark to mark.
    fn with_legs(&self, joined: impl Fn(&[Step]) -> Step) -> Self {
        let (mut steps, mut marks, mut done) = (Vec::new(), self.marks.clone(), 0);
        for mark in &mut marks {
            // Between marks alone: no step may reach over a measurement.
            let leg = &self.steps[done..mark.steps];
            match leg {
                [] => {}
                [one] => steps.push(one.clone()),
                leg => steps.push(joined(leg)),
            }
            (done, mark.steps) = (mark.steps, steps.len());
        }
        Self {
            steps: Arc::new(steps),
            long: Arc::default(),
            marks,
            ..*self
        }
    }

    /// The drive in half of the steps or fewer: what the search for a reduction passes along. Several fixes are one of their
    /// mean at the last of them.
    pub(super) fn outline(&self) -> Self {
        let last_fixes = self.last_fixes();
        let drive_s = self.marks.last().map_or(0.0, |mark| mark.after_s);
        let stretch = (drive_s / OUTLINE_DRIVE_S).clamp(1.0, MOST_STRETCH);
        let (mut steps, mut marks) = (Vec::new(), Vec::new());
        let (mut report_s, mut begin_s, mut before_s) = (f64::NEG_INFINITY, 0.0, 0.0);
        // What becomes one step, and one measurement of each kind: the last of this many, with the mean of their noise.
        let mut step: Option<Step> = None;
        let mut measured: [(Vec<ScalarMeasurement>, f64); MeasurementKind::KINDS] =
            Default::default();
        for (i, (leg, mark)) in self.legs(0..self.marks.len()).enumerate() {
            if step.is_none() {
                begin_s = before_s;
            }
            before_s = mark.after_s;
            let all = step.into_iter().chain(leg.iter().cloned());
            step = all.reduce(|a, b| a.of_means(&b));
            for (kind, (rows, count)) in measured.iter_mut().enumerate() {
                let own = mark.rows.iter().filter(|row| row.what.kind() == kind);
                let own: Vec<ScalarMeasurement> = own.copied().collect();
                if !own.is_empty() {
                    (*rows, *count) = (own, *count + 1.0);
                }
            }
            let longest_s = stretch * OUTLINE_STEP_S[usize::from(measured[0].1 == 0.0)] + SLACK_S;
            let next = self.marks.get(i + 1).filter(|next| next.outages.is_empty());
            // An outage begins with its first missing fix and ends with the first fix after it, no step later.
            let is_bound = !mark.outages.is_empty() || last_fixes.contains(&i);
            if !is_bound && next.is_some_and(|next| next.after_s - begin_s <= longest_s) {
                continue;
            }
            steps.extend(step.take());
            let report = mark.after_s - report_s >= REPORT_S - SLACK_S;
            report_s = if report { mark.after_s } else { report_s };
            let mean = |(rows, count): (Vec<ScalarMeasurement>, f64)| {
                rows.into_iter().map(move |row| ScalarMeasurement {
                    r: row.r / count,
                    noise: row.noise / count,
                    ..row
                })
            };
            marks.push(TrackEpoch {
                steps: steps.len(),
                rows: std::mem::take(&mut measured)
                    .into_iter()
                    .flat_map(mean)
                    .collect(),
                report,
                ..mark.clone()
            });
        }
        Self {
            steps: Arc::new(steps),
            long: Arc::default(),
            marks,
            ..*self
        }
    }

    /// Marks whose fix is followed by a gap.
    fn last_fixes(&self) -> Vec<usize> {
        let fixes: Vec<usize> = (0..self.marks.len())
            .filter(|i| self.marks[*i].fix)
            .collect();
        let gap_s = |pair: &[usize]| self.marks[pair[1]].after_s - self.marks[pair[0]].after_s;
        let interval_s = fixes.windows(2).map(gap_s).fold(f64::INFINITY, f64::min);
        fixes
            .windows(2)
            .filter(|pair| gap_s(pair) > 1.5 * interval_s)
            .map(|pair| pair[0])
            .collect()
    }
}

/// Times of marks are sums of samples: this much apart they are the same (s).
const SLACK_S: f64 = 1e-6;
/// Step through an outage that has lasted for [`LONG_AFTER_S`] (s).
const LONG_STEP_S: f64 = 5.0;
const LONG_AFTER_S: f64 = 60.0;

impl Outage {
    fn takes_long_step(&self, from_s: f64) -> bool {
        (self.start_s + LONG_AFTER_S - SLACK_S..=self.end_s - LONG_STEP_S + SLACK_S)
            .contains(&from_s)
    }
}

impl Step {
    /// Steps one after the other as one, white noise through its mean over it.
    fn joined(leg: &[Self]) -> Self {
        let mut steps = leg.iter().cloned();
        let joined = steps.by_ref().reduce(|step, next| step.of_means(&next));
        joined.expect("steps")
    }

    /// Covariances for unit white noise in each sample over steps that have none of their own: through the mean of all it
    /// would move a position by a quarter of T³ where it is a third.
    fn white_noise(leg: &[Self]) -> Vec<[Nav; NAV]> {
        let mut white = vec![[[0.0; NAV]; NAV]; BIASES];
        let none = [0.0; SIGNALS];
        // From the last step to the first: what comes after a step, as one map.
        let mut after: Option<Self> = None;
        for step in leg.iter().rev() {
            let variance = 1.0 / f64::from(step.samples);
            for (sum, b) in white.iter_mut().zip(&step.b) {
                let b = after.as_ref().map_or(*b, |after| after.map(b, &none));
                for (column, factor) in sum.iter_mut().zip(&b) {
                    add_scaled(column, factor * variance, &b);
                }
            }
            after = Some(match after {
                None => Self {
                    b: Vec::new(),
                    ..step.clone()
                },
                Some(after) => Self {
                    m: step.m.map(|column| after.map(&column, &none)),
                    ..after
                },
            });
        }
        white
    }

    /// The step with white noise through its mean over the step, as that of a bias.
    fn of_means(&self, next: &Self) -> Self {
        let none = [0.0; SIGNALS];
        let mut b: Vec<Nav> = self
            .b
            .iter()
            .map(|column| next.map(column, &none))
            .collect();
        for (sum, column) in b.iter_mut().flatten().zip(next.b.iter().flatten()) {
            // The response to a constant input: that of the first part, carried through the second, and that
            // of the second.
            *sum += column;
        }
        let m = self.m.map(|column| next.map(&column, &none));
        Self {
            samples: self.samples + next.samples,
            m,
            b,
            white: Vec::new(),
        }
    }
}

// The states that make inertial errors, and what they do over a step of many samples.

/// Signals: errors of an axis in proportion to what the IMU feels. Most filters and IMUs have the first of them alone.
pub(super) const SIGNALS: usize = 42;
/// The first that is multiplied by its own sample, what a scale factor adds.
pub(super) const SCALE_FACTOR: usize = 6;
/// The first that is multiplied by the sample of another axis, what a misalignment adds.
pub(super) const CROSS_COUPLING: usize = 12;
/// The first of a gyroscope that is multiplied by a specific force.
pub(super) const G_SENSITIVITY: usize = 24;
/// The first of an accelerometer that is multiplied by its own square.
pub(super) const RECTIFICATION: usize = 33;
/// The first that is multiplied by the warming.
pub(super) const TEMPERATURE: usize = 36;

/// Sensor and axis of a signal, and the quantity that multiplies it.
const fn place(signal: usize) -> (usize, usize, ErrorInput) {
    match signal {
        0..SCALE_FACTOR => (signal / 3, signal % 3, ErrorInput::Unit),
        SCALE_FACTOR..CROSS_COUPLING => {
            let sensor = signal % SCALE_FACTOR / 3;
            (
                sensor,
                signal % 3,
                ErrorInput::Sample(Sensor::ALL[sensor], signal % 3),
            )
        }
        CROSS_COUPLING..G_SENSITIVITY => {
            let (sensor, pair) = ((signal - CROSS_COUPLING) / 6, (signal - CROSS_COUPLING) % 6);
            (
                sensor,
                pair / 2,
                ErrorInput::Sample(Sensor::ALL[sensor], (pair / 2 + 1 + pair % 2) % 3),
            )
        }
        G_SENSITIVITY..RECTIFICATION => {
            let pair = signal - G_SENSITIVITY;
            (
                Sensor::Gyro as usize,
                pair / 3,
                ErrorInput::Sample(Sensor::Accel, pair % 3),
            )
        }
        RECTIFICATION..TEMPERATURE => (
            Sensor::Accel as usize,
            signal - RECTIFICATION,
            ErrorInput::Square(signal - RECTIFICATION),
        ),
        _ => (
            (signal - TEMPERATURE) / 3,
            (signal - TEMPERATURE) % 3,
            ErrorInput::Warming,
        ),
    }
}

/// A state behind one signal, in the form that every process of the catalogue has at the sample rate:
/// the error of a sample is `before`·s + `after`·s⁺ + `fresh`·w, and s⁺ = `decay`·s + `drive`·w with w white
/// of variance 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct ErrorSourceState {
    /// Signal that it is part of.
    pub signal: usize,
    before: f64,
    after: f64,
    fresh: f64,
    decay: f64,
    drive: f64,
    /// Growth of `after` with every sample: a ramp is its slope times the samples so far.
    ramp: f64,
    /// Variance of s at the start.
    pub initial: f64,
    /// Mean of s at the start.
    pub level: f64,
    /// The measurement that it is part of; such a source is no inertial error.
    pub outer: Option<MeasurementError>,
}

/// An error of measurements that lasts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum MeasurementError {
    /// Error of a component of a fix's position.
    Position(usize),
    /// Error of an aiding measurement.
    Vehicle(AidPart),
}

/// A source that makes no error.
const NONE: ErrorSourceState = ErrorSourceState {
    signal: 0,
    before: 0.0,
    after: 0.0,
    fresh: 0.0,
    decay: 1.0,
    drive: 0.0,
    ramp: 0.0,
    initial: 0.0,
    level: 0.0,
    outer: None,
};

/// Propagation of a source over a step: the mean of its samples' errors is `mean`·s + w₁, and s⁺ =
/// `decay`·s + w₂.
pub(super) struct SourceStep {
    pub signal: usize,
    mean: f64,
    /// Growth of `mean` with every sample before the step.
    ramp: f64,
    pub decay: f64,
    /// Variance of w₁.
    q_mean: f64,
    /// Covariance of w₁ and w₂.
    pub q_cross: f64,
    /// Variance of w₂.
    pub q_state: f64,
}

impl SourceStep {
    /// `mean` after this many samples.
    #[inline(always)]
    pub(super) fn mean_after(&self, elapsed: f64) -> f64 {
        self.mean + self.ramp * elapsed
    }
}

impl ErrorSourceState {
    fn bias(signal: usize, [phi, innovation, initial]: [f64; 3]) -> Self {
        Self {
            signal,
            after: 1.0,
            decay: phi,
            drive: innovation.sqrt(),
            initial,
            ..NONE
        }
    }

    /// An unknown constant of a standard deviation.
    pub(super) fn constant(signal: usize, sigma: f64) -> Self {
        Self::bias(signal, [1.0, 0.0, sigma * sigma])
    }

    /// A state that is nothing but the last innovation of standard deviation `sigma`: the error of a sample
    /// is `fresh`·w + `before`·(the w of the sample before).
    fn memory(signal: usize, sigma: f64, fresh: f64, before: f64) -> Self {
        // `before` multiplies the state, which carries sigma itself; `fresh` multiplies w of variance 1.
        let (before, fresh) = (before, fresh * sigma);
        Self {
            signal,
            before,
            fresh,
            decay: 0.0,
            drive: sigma,
            initial: sigma * sigma,
            ..NONE
        }
    }

    /// A constant slope, known to nobody: its mean square is what second moments see of it.
    const fn ramp(signal: usize, slope: f64) -> Self {
        Self {
            signal,
            ramp: 1.0,
            initial: slope * slope,
            ..NONE
        }
    }

    /// A slope that is the same in every run. The states of the truth are negated, and so is its mean.
    pub(super) fn drift(signal: usize, slope: f64) -> Self {
        // No variance: a deterministic slope enters the mean alone.
        Self {
            initial: 0.0,
            level: -slope,
            ..Self::ramp(signal, slope)
        }
    }

    /// A correlated error of a component of a fix's position: stationary, of standard deviation `sigma`, with
    /// the coefficient `phi` from sample to sample.
    pub(super) fn of_position(component: usize, phi: f64, sigma: f64) -> Self {
        let drive = sigma * (1.0 - phi * phi).sqrt();
        Self {
            decay: phi,
            drive,
            initial: sigma * sigma,
            outer: Some(MeasurementError::Position(component)),
            ..NONE
        }
    }

    /// An error of what a vehicle measures of itself, at an IMU of this rate.
    pub(super) fn of_vehicle(part: AidPart, law: ErrorProcess, imu_hz: f64) -> Self {
        let outer = Some(MeasurementError::Vehicle(part));
        match law {
            // The states of the truth are negated, and so is a mean.
            ErrorProcess::Known(value) => Self {
                level: -value,
                outer,
                ..NONE
            },
            ErrorProcess::Constant(sigma) => Self {
                initial: sigma * sigma,
                outer,
                ..NONE
            },
            ErrorProcess::GaussMarkov { sigma, time_s } => {
                let phi = (-1.0 / (imu_hz * time_s)).exp();
                Self {
                    outer,
                    ..Self::of_position(0, phi, sigma)
                }
            }
        }
    }

    /// Error that is there after `samples` samples per unit of the state: biases count and drifts at their age, noise
    /// of single samples does not.
    pub(super) fn share(&self, samples: f64) -> f64 {
        self.after + self.ramp * samples
    }

    /// Propagates the source over a step of `samples` samples, exactly.
    fn over(&self, samples: u32) -> SourceStep {
        let n = f64::from(samples);
        let mut step = SourceStep {
            signal: self.signal,
            mean: 0.0,
            ramp: self.ramp,
            decay: 1.0,
            q_mean: 0.0,
            q_cross: 0.0,
            q_state: 0.0,
        };
        // backwards: what a unit of s before the remaining samples adds to their sum, and leaves of itself
        for _ in 0..samples {
            // The w of this sample: in its own error by `fresh` and `after`·`drive`, in all later ones
            // through the state.
            let in_sum = self.fresh + self.drive * (self.after + step.mean);
            let in_state = self.drive * step.decay;
            step.q_mean += in_sum * in_sum;
            step.q_cross += in_sum * in_state;
            step.q_state += in_state * in_state;
            step.mean = self.before + self.decay * (self.after + step.mean);
            step.decay *= self.decay;
        }
        // The ramp counts samples 1 … n of the step, whose mean is (n + 1)/2.
        step.mean = step.mean / n + self.ramp * 0.5 * (n + 1.0);
        step.q_mean /= n * n;
        step.q_cross /= n;
        step
    }

    /// Without what drives it: a filter's estimate of the state, which starts at zero.
    const fn estimate(&self) -> Self {
        Self {
            drive: 0.0,
            fresh: 0.0,
            initial: 0.0,
            ..*self
        }
    }
}

/// The errors of an IMU: sources, and white noise of a sample on each signal.
#[derive(Debug, Clone)]
pub(super) struct ErrorSources {
    pub states: Vec<ErrorSourceState>,
    pub white: [f64; BIASES],
}

impl Default for ErrorSources {
    fn default() -> Self {
        Self {
            states: Vec::new(),
            white: [0.0; BIASES],
        }
    }
}

impl ErrorSources {
    /// Adds those of another, independent.
    pub(super) fn extend(&mut self, other: &Self) {
        self.states.extend_from_slice(&other.states);
        self.white
            .iter_mut()
            .zip(&other.white)
            .for_each(|(white, more)| *white += more);
    }

    /// Estimates of them by a filter: zero at the start, driven by corrections only.
    fn estimates(&self) -> Self {
        Self {
            states: self.states.iter().map(ErrorSourceState::estimate).collect(),
            ..Self::default()
        }
    }

    /// Sources in a filter's model: one for each of its states behind the navigation's, in their order.
    pub(super) fn of_belief(filter_model: &FilterModel) -> Self {
        let of_sensor = |sensor: Sensor| {
            let groups = filter_model.groups[sensor as usize].iter();
            groups.flat_map(move |group| Self::of_group(sensor, group))
        };
        let states = Sensor::ALL.into_iter().flat_map(of_sensor);
        let states = states.chain(Self::multiplied(filter_model));
        Self {
            states: states.chain(Self::of_vehicle(filter_model)).collect(),
            white: std::array::from_fn(|i| filter_model.white[i / 3][i % 3]),
        }
    }

    /// The bias states of a group.
    fn of_group(sensor: Sensor, group: &BiasGroup) -> [ErrorSourceState; 3] {
        std::array::from_fn(|axis| {
            let state = [group.phi[axis], group.innovation[axis], group.initial[axis]];
            ErrorSourceState::bias(3 * sensor as usize + axis, state)
        })
    }

    /// Unknown constants of a belief that are multiplied.
    fn multiplied(filter_model: &FilterModel) -> impl Iterator<Item = ErrorSourceState> {
        let unknowns = Sensor::ALL.into_iter().flat_map(|sensor| {
            filter_model
                .unknowns(sensor)
                .iter()
                .map(move |u| (sensor, u))
        });
        unknowns.flat_map(|(sensor, unknown)| {
            (0..3).map(move |axis| {
                let (signal, sigma) = (3 * sensor as usize + axis, unknown.sigma[axis]);
                match unknown.kind {
                    CoefficientKind::Drift => ErrorSourceState::ramp(signal, sigma),
                    CoefficientKind::ScaleFactor => {
                        ErrorSourceState::constant(SCALE_FACTOR + signal, sigma)
                    }
                }
            })
        })
    }

    /// Wheel scale and mounting of a vehicle, as in a filter's model.
    fn of_vehicle(filter_model: &FilterModel) -> impl Iterator<Item = ErrorSourceState> {
        let parts = [
            AidPart::WheelScale,
            AidPart::MountingPitch,
            AidPart::MountingYaw,
        ];
        let sigmas = (filter_model.vehicle != DVec3::ZERO).then_some(filter_model.vehicle);
        let states = parts
            .into_iter()
            .zip(sigmas.into_iter().flat_map(|s| s.to_array()));
        states.map(|(part, sigma)| {
            let constant = ErrorProcess::Constant(sigma);
            ErrorSourceState::of_vehicle(part, constant, filter_model.rate_hz)
        })
    }

    /// Turn-on biases and scale factors that a belief has beside its noise model, as sources.
    pub(super) fn beside_model(filter_model: &FilterModel) -> Vec<ErrorSourceState> {
        let constants = Sensor::ALL.into_iter().flat_map(|sensor| {
            let groups = filter_model.groups[sensor as usize].iter();
            groups
                .filter(|group| group.is_constant())
                .flat_map(move |group| Self::of_group(sensor, group))
        });
        let states = Self::multiplied(filter_model)
            .chain(Self::of_vehicle(filter_model))
            .chain(constants);
        // drifts are of the noise model
        states
            .filter(|source| source.ramp == 0.0 && source.initial > 0.0)
            .collect()
    }

    /// The sources of a noise model, each process exactly.
    pub(super) fn of_model(model: &Model) -> Self {
        let mut sources = Self::default();
        for channel in Channel::ALL {
            for process in &model.axis(channel).processes {
                sources.add(channel.index(), process);
            }
        }
        sources
    }

    pub(super) fn add(&mut self, signal: usize, process: &Process) {
        for part in process.parts(Ar1Bank::FINE) {
            match part.kind() {
                ProcessKind::White => self.white[signal] += part.amplitude(),
                ProcessKind::Drift => self
                    .states
                    .push(ErrorSourceState::ramp(signal, part.amplitude())),
                _ => {
                    // U_k − U_{k−1}: the last U is a state, because the sum over a step telescopes. As white noise it
                    // would grow.
                    let memory = part.moving_average().map(|[theta, variance]| {
                        ErrorSourceState::memory(signal, variance.sqrt(), 1.0, theta)
                    });
                    let bias = part
                        .recursion()
                        .map(|state| ErrorSourceState::bias(signal, state));
                    self.states.extend(memory.or(bias));
                }
            }
        }
    }
}

// The states beside the navigation error, and what they do over the steps of a track.

/// The states `b` of a filter and `t` of the truth, as `JointCovariance` has them.
pub(super) struct AugmentedStates {
    pub states: Vec<ErrorSourceState>,
    /// Number of the states `b`, which come first.
    pub estimated: usize,
    /// Signals that they reach: most have neither scale factors nor what comes after them.
    pub signals: usize,
    /// True if some of them are errors of measurements.
    have_outer: bool,
    /// By the number of samples of a step; few numbers occur.
    inputs: Vec<(u32, Inputs)>,
}

impl AugmentedStates {
    /// A filter as it sees itself along a track: its biases are what makes its errors.
    pub(super) fn of_filter(believed: ErrorSources, track: &Track) -> Self {
        let estimated = believed.states.len();
        Self::new(believed, estimated, track)
    }

    /// The estimates of a filter, and what truly makes its errors.
    pub(super) fn of_errors(believed: &ErrorSources, truth: &ErrorSources, track: &Track) -> Self {
        let mut sources = believed.estimates();
        let estimated = sources.states.len();
        sources.extend(truth);
        Self::new(sources, estimated, track)
    }

    fn new(sources: ErrorSources, estimated: usize, track: &Track) -> Self {
        let of_white = sources.white.iter().rposition(|white| *white != 0.0);
        let signals = sources.states.iter().map(|s| s.signal).chain(of_white);
        let signals = signals.map(|last| last + 1).max().unwrap_or(0);
        let mut inputs: Vec<(u32, Inputs)> = Vec::new();
        let long = track.long.iter().flatten().map(|(_, step)| step);
        for step in track.steps.iter().chain(long) {
            if inputs.iter().all(|(samples, _)| *samples != step.samples) {
                let own = Inputs::new(&sources, step.samples, signals);
                inputs.push((step.samples, own));
            }
        }
        // What a track does not follow would be left out in silence.
        debug_assert!(track.steps.iter().all(|step| signals <= step.b.len()));
        Self {
            have_outer: sources.states.iter().any(|s| s.outer.is_some()),
            states: sources.states,
            estimated,
            signals,
            inputs,
        }
    }

    /// Lanes of a row with a number for each state.
    pub(super) const fn width(&self) -> usize {
        self.states.len().div_ceil(LANES)
    }

    /// Lanes of a row with a number for each navigation state and each signal.
    pub(super) const fn tail(&self) -> usize {
        (NAV + self.signals).div_ceil(LANES)
    }

    /// Propagation over a step of the track.
    pub(super) fn over(&self, step: &Step) -> &Inputs {
        let found = self
            .inputs
            .iter()
            .find(|(samples, _)| *samples == step.samples);
        &found.expect("lengths").1
    }
}

/// Propagation of sources over steps of one length.
pub(super) struct Inputs {
    pub sources: Vec<SourceStep>,
    /// Their decays.
    pub decay: Vec<Lanes>,
    /// A row for each signal: `q_cross` of its states.
    pub q_cross: Vec<Lanes>,
    /// Variance of the white noise of a sample (units²).
    pub white: [f64; BIASES],
    /// Variance of the part of a signal's mean over the step that is new in it: of white noise and states, of states
    /// alone (units²).
    pub q_mean: [[f64; SIGNALS]; 2],
}

impl Inputs {
    fn new(all: &ErrorSources, samples: u32, signals: usize) -> Self {
        let sources: Vec<SourceStep> = all.states.iter().map(|x| x.over(samples)).collect();
        let white = all.white;
        let mut q_mean = [[0.0; SIGNALS]; 2];
        q_mean[0]
            .iter_mut()
            .zip(white)
            .for_each(|(q, white)| *q = white / f64::from(samples));
        for source in &sources {
            q_mean
                .iter_mut()
                .for_each(|q| q[source.signal] += source.q_mean);
        }
        let width = sources.len().div_ceil(LANES);
        let mut decay = vec![Lanes::ZERO; width];
        let mut q_cross = vec![Lanes::ZERO; signals * width];
        for (j, source) in sources.iter().enumerate() {
            decay[j / LANES][j % LANES] = source.decay;
            q_cross[source.signal * width + j / LANES][j % LANES] = source.q_cross;
        }
        Self {
            sources,
            decay,
            q_cross,
            white,
            q_mean,
        }
    }
}

#[cfg(test)]
mod outline_tests {
    use crate::scenario::Scenario;
    use crate::tests::*;
    use crate::trajectory::profile::{Bank, Length, Profile, ProfileStart, Segment, SegmentKind};

    /// A step covers two seconds or five, and every outage begins and ends where it did.
    #[test]
    fn an_outline_is_half_of_the_drive() {
        let outline = |duration_s: f64| {
            let north = Segment {
                kind: SegmentKind::Straight(Length::Duration(duration_s)),
                climb_m: 0.0,
                ramp_s: None,
            };
            let start = ProfileStart {
                t_s: 0.0,
                lat: 0.9,
                lon: 0.2,
                h: 0.0,
                heading: 0.0,
                speed: 20.0,
            };
            let drive = Profile {
                start,
                bank: Bank::None,
                ramp_s: 2.0,
                segments: vec![north],
            }
            .build()
            .unwrap();
            let mut scenario = Scenario::default();
            scenario.imu.rate_hz = 10.0;
            let silent = Model {
                rate_hz: 10.0,
                axes: Default::default(),
            };
            let outages = [Outage {
                start_s: 600.0,
                end_s: 663.0,
            }];
            let track = scenario.track(&drive, &silent, &outages).unwrap().outline();
            let end = track
                .marks
                .iter()
                .position(|mark| !mark.outages.is_empty())
                .unwrap();
            let [.., last_fix, _] = track.marks[..end]
                .iter()
                .filter(|m| !m.rows.is_empty() || m.after_s > 600.0)
                .collect::<Vec<_>>()[..]
            else {
                panic!()
            };
            assert_eq!(track.marks[end].after_s, 663.0);
            assert!(last_fix.after_s > 600.0 && last_fix.rows.is_empty());
            assert!(
                track
                    .marks
                    .iter()
                    .any(|mark| mark.after_s == 599.0 && !mark.rows.is_empty())
            );
            track.steps.len()
        };
        assert!(outline(1200.0) < 620 && outline(3600.0) < 1820);
    }
}
