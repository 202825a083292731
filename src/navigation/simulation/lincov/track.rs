//! A trajectory as a linear filter sees it: maps of the navigation error, and when it is measured.

use super::super::aided::Aided;
use super::super::plan::{Event, Experiment, ExperimentError, Plan};
use super::input::{CROSSED, Outer, Source, place};
use super::joint::add_scaled;
use super::truth::defects;
use crate::closure::Bounds;
use crate::earth::ned_difference;
use crate::ekf::covariance::{PSI, R, V};
use crate::ekf::dynamics::{EARTH_STEP_S, EarthStep, EarthTerms, ErrorMap, NavError, Sample};
use crate::ekf::initial::psi_of_angles;
use crate::ekf::{body_velocity_rows, dense_yaw_row, fix_rows};
use crate::frames::{NavState, RollPitchYaw};
use crate::imu::Sensor;
use crate::lanes::{Quat, Vec3};
use crate::sensors::aiding::Aid;
use crate::sensors::defects::Surroundings;
use crate::strapdown::Strapdown;
use crate::units::DEG;
use glam::{DQuat, DVec3};
use std::ops::Range;

/// Navigation states: R, V, PSI.
pub(super) const NAV: usize = 9;
/// A navigation error, or a column of nine.
pub(super) type Nav = [f64; NAV];

/// Longest step (s): a bias is represented by its mean over the step.
pub(super) const STEP_S: f64 = 0.2;

/// What happens to the navigation error over a step: x⁺ = `m` x + `b` e, e the errors of the biases (estimate
/// less truth) of the signals, their means over the step. Columns; `b` of the signals that the track follows.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub(super) samples: u32,
    pub(super) m: [Nav; NAV],
    pub(super) b: Vec<Nav>,
    /// Covariance of the navigation error for white noise of variance 1 in each sample of a signal, by signals that are not
    /// multiplied; none where it acts through its mean over the step, as that of a bias does.
    pub(super) white: Vec<[Nav; NAV]>,
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Measured {
    /// This component of a fix's position.
    Position(usize),
    /// The velocity of a fix.
    Velocity,
    /// The height of a barometer.
    Height,
    /// What a vehicle measures of itself, along this axis.
    Aid(Aid, usize),
}

impl Measured {
    /// Kinds: fixes, heights, each aid.
    pub(super) const KINDS: usize = 2 + Aid::ALL.len();

    /// Which of them.
    pub(super) const fn kind(self) -> usize {
        match self {
            Self::Position(_) | Self::Velocity => 0,
            Self::Height => 1,
            Self::Aid(aid, _) => 2 + aid as usize,
        }
    }
}

/// A scalar measurement: nine coefficients of the navigation error, three of the gyroscope's error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub(super) h: [f64; NAV + 3],
    /// What errors of the gyroscope are proportional to.
    pub(super) felt: Surroundings,
    /// Variance of its white noise, as the filter believes.
    pub(super) r: f64,
    /// The same in truth.
    pub(super) noise: f64,
    pub(super) what: Measured,
    /// Velocity of the point of the vehicle (m/s) and acceleration (m/s²), in b.
    pub(super) motion: [DVec3; 2],
    /// Whether outages withhold it.
    pub(super) of_gnss: bool,
}

impl Row {
    /// A measurement whose true noise is as the filter believes.
    fn new(h: [f64; NAV + 3], felt: Surroundings, r: f64, what: Measured) -> Self {
        let of_gnss = matches!(what, Measured::Position(_) | Measured::Velocity);
        Self {
            h,
            felt,
            r,
            noise: r,
            what,
            motion: [DVec3::ZERO; 2],
            of_gnss,
        }
    }

    /// The coefficient of a source's state in the measurement after `elapsed` samples, beside its part through the
    /// navigation error.
    pub(super) fn coefficient(&self, source: &Source, elapsed: f64) -> f64 {
        match (source.outer, self.what) {
            (None, _) => {}
            (Some(Outer::Position(of)), Measured::Position(here)) => {
                return f64::from(u8::from(of == here));
            }
            (Some(Outer::Vehicle(part)), Measured::Aid(aid, axis)) if part.aid() == aid => {
                return part.coefficient(axis, self.motion[0], self.motion[1]);
            }
            (Some(_), _) => return 0.0,
        }
        match place(source.signal) {
            (0, ..) => 0.0,
            // The coefficient of the lever arm's velocity is per unit of the rate's error, and this is the
            // error that the source has at the instant: a bias its value, a drift its slope times its age.
            (_, axis, of) => source.share(elapsed) * (self.h[NAV + axis] * self.felt.value(of)),
        }
    }
}

/// An instant between steps.
#[derive(Debug, Clone)]
pub(super) struct Mark {
    /// Steps from the start until here.
    pub(super) steps: usize,
    /// Time from the start (s).
    pub(super) after_s: f64,
    /// Time on the trajectory (s).
    pub(super) t_s: f64,
    /// Whether a fix is used.
    pub(super) fix: bool,
    /// Scalar measurements, in sequence.
    pub(super) rows: Vec<Row>,
    pub(super) report: bool,
    /// Outages that end here, before the measurements.
    pub(super) outages: Vec<usize>,
    /// Roll, pitch, yaw errors (rad) from `psi_n` (rad), at the true attitude.
    pub(super) jacobian: [DVec3; 3],
    /// Error of the strapdown algorithm over the steps that lead here (m, m/s, rad), which no sensor makes.
    pub(super) closure: Nav,
}

/// A trajectory with its fixes, ready for any number of passes.
#[derive(Debug, Clone)]
pub struct Track {
    pub(super) steps: Vec<Step>,
    pub(super) marks: Vec<Mark>,
    pub(super) outages: usize,
    /// Covariance of the navigation error at the start, as the filter believes.
    pub(super) start: [Nav; NAV],
    /// Whether it truly starts without error.
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
        let plan = &Plan::reference(experiment)?;
        let mut line = Linearisation::new(plan, noise_hz);
        let longest = ((STEP_S * experiment.rate_hz).round() as usize).max(1);
        let (mut steps, mut marks, mut done) =
            (Vec::new(), Vec::with_capacity(plan.events.len()), 0);
        for (index, event) in plan.events.iter().enumerate() {
            let samples = event.sample - done;
            // Parts of equal length: what the noise processes do over a step is computed once for each length
            // that occurs.
            let part = samples.div_ceil(samples.div_ceil(longest).max(1)).max(1);
            for begin in (done..event.sample).step_by(part) {
                steps.push(line.step(plan, begin..event.sample.min(begin + part)));
            }
            done = event.sample;
            let ends = |(_, (_, at)): &(usize, &(f64, usize))| *at == index;
            marks.push(Mark {
                steps: steps.len(),
                after_s: event.sample as f64 / experiment.rate_hz,
                t_s: event.t_s,
                fix: event.fix,
                rows: line.rows(plan, event),
                report: event.report,
                outages: plan
                    .outages
                    .iter()
                    .enumerate()
                    .filter(ends)
                    .map(|(i, _)| i)
                    .collect(),
                jacobian: RollPitchYaw::from_quat(event.reference.q_b_n).jacobian_of_psi_n(),
                closure: line.close(&event.reference),
            });
        }
        drop_closed(&mut marks);
        let (outages, perfect) = (plan.outages.len(), experiment.initial.perfect);
        Ok(Self {
            steps,
            marks,
            outages,
            start: start(plan),
            perfect,
        })
    }

    /// The same where a filter believes the vehicle's own measurements to be so much worse; in truth they are as they were.
    #[must_use]
    pub fn with_aiding_sigmas(&self, factor: f64) -> Self {
        let mut track = self.clone();
        let rows = track.marks.iter_mut().flat_map(|mark| &mut mark.rows);
        let aids = rows.filter(|row| matches!(row.what, Measured::Aid(..)));
        aids.for_each(|row| row.r *= factor * factor);
        track
    }

    /// Whether the strapdown makes no error along it.
    pub(super) fn is_closed(&self) -> bool {
        self.marks.iter().all(|mark| mark.closure == [0.0; NAV])
    }

    /// Some marks, each with the steps that lead to it.
    pub(super) fn legs(&self, marks: Range<usize>) -> impl Iterator<Item = (&[Step], &Mark)> {
        let begin = |mark: usize| {
            mark.checked_sub(1)
                .map_or(0, |before| self.marks[before].steps)
        };
        marks.map(move |mark| {
            (
                &self.steps[begin(mark)..self.marks[mark].steps],
                &self.marks[mark],
            )
        })
    }
}

/// The reference as the strapdown passes through it.
struct Linearisation {
    ins: Strapdown<f64>,
    /// What the IMU feels over the last sample.
    felt: Surroundings,
    dt: f64,
    noise_hz: f64,
    /// Signals that are followed: those behind scale factors only where the true IMU has them.
    signals: usize,
}

impl Linearisation {
    fn new(plan: &Plan<'_>, noise_hz: f64) -> Self {
        let experiment = plan.experiment;
        let ins = Strapdown::single(&plan.start, experiment.gravity);
        let defects = Sensor::ALL
            .into_iter()
            .flat_map(|sensor| defects(experiment.defects, sensor));
        let signals = defects
            .flat_map(|s| s.side.inertial.states)
            .map(|s| s.signal + 1)
            .fold(CROSSED, usize::max);
        Self {
            ins,
            felt: Surroundings::default(),
            dt: 1.0 / experiment.rate_hz,
            noise_hz,
            signals,
        }
    }

    /// The maps of the samples one after the other, the Earth's as the filter applies them.
    fn step(&mut self, plan: &Plan<'_>, samples: Range<usize>) -> Step {
        let unit = |i: usize| std::array::from_fn(|k| if i == k { 1.0 } else { 0.0 });
        let mut step = Step {
            // Samples of the noise model's rate, which need not be the rate at which the motion is sampled.
            samples: (samples.len() as f64 * self.dt * self.noise_hz)
                .round()
                .max(1.0) as u32,
            m: std::array::from_fn(unit),
            b: vec![[0.0; NAV]; self.signals],
            white: Vec::new(),
        };
        let mut age = 0.0;
        for index in samples {
            let sample = &plan.ideal[index];
            self.felt = plan.felt(index);
            let (dtheta, dv) = (sample.omega_ib_b * self.dt, sample.f_ib_b * self.dt);
            let trace = self.ins.step(Vec3::splat(dtheta), Vec3::splat(dv), self.dt);
            step.apply(&Sample::new(&trace, self.dt), &self.felt);
            age += self.dt;
            if age + 0.5 * self.dt > EARTH_STEP_S {
                step.apply(
                    &EarthStep {
                        terms: EarthTerms::at(&self.ins),
                        dt: age,
                    },
                    &self.felt,
                );
                age = 0.0;
            }
        }
        // A measurement meets a covariance that has all of the Earth's terms, as `settle` gives it in the
        // filter.
        if age > 0.0 {
            step.apply(
                &EarthStep {
                    terms: EarthTerms::at(&self.ins),
                    dt: age,
                },
                &self.felt,
            );
        }
        step
    }

    /// Error of the strapdown since the reference was met last (m, m/s, rad), estimate less truth; it goes on from the reference.
    fn close(&mut self, reference: &NavState) -> Nav {
        let ins = &mut self.ins;
        let r = ned_difference(reference, ins.lat, ins.lon, ins.h);
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

    fn rows(&self, plan: &Plan<'_>, event: &Event) -> Vec<Row> {
        let experiment = plan.experiment;
        let (mut rows, [_, omega_ib_b]) = (Vec::new(), self.felt.sample);
        if event.fix {
            let gnss = experiment.gnss;
            let h = fix_rows(&self.ins, omega_ib_b, gnss.lever_arm_m.into());
            let sigmas = gnss
                .pos_sigma_m
                .into_iter()
                .chain(gnss.vel_sigma_m_s.into_iter().flatten());
            for (i, (h, sigma)) in h.into_iter().zip(sigmas).enumerate() {
                let what = if i < 3 {
                    Measured::Position(i)
                } else {
                    Measured::Velocity
                };
                rows.push(Row::new(h, self.felt, sigma * sigma, what));
            }
        }
        if let Some(baro) = experiment.baro.filter(|_| event.baro) {
            let mut h = [0.0; NAV + 3];
            h[3 * R + 2] = 1.0;
            let r = baro.sigma_m * baro.sigma_m;
            rows.push(Row::new(h, self.felt, r, Measured::Height));
        }
        for aided in event.aids.iter().filter(|aided| !aided.withheld) {
            self.aid(experiment, aided, &mut rows);
        }
        rows
    }
}

impl Linearisation {
    /// The rows of what the vehicle measures of itself.
    fn aid(&self, experiment: &Experiment<'_>, aided: &Aided, rows: &mut Vec<Row>) {
        let Aided { aid, v_b, a_b, .. } = *aided;
        let [r, noise] = experiment.aiding.sigmas(aid).map(|sigma| sigma * sigma);
        let row = |h, axis| Row {
            noise,
            motion: [v_b, a_b],
            of_gnss: experiment.aiding.is_of_gnss(aid),
            ..Row::new(h, self.felt, r, Measured::Aid(aid, axis))
        };
        if aid == Aid::Heading {
            rows.push(row(dense_yaw_row(&self.ins), 0));
            return;
        }
        let [_, omega_ib_b] = self.felt.sample;
        let h = body_velocity_rows(&self.ins, omega_ib_b, experiment.aiding.lever_arm_b(aid));
        rows.extend(aid.axes().iter().map(|axis| row(h[*axis], *axis)));
    }
}

/// Sets the errors of the strapdown to zero where all of them together stay below what a closure may have: beside the errors
/// of any receiver and IMU they are nothing, and a mean need not be propagated.
fn drop_closed(marks: &mut [Mark]) {
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

impl Step {
    /// The map of a sample after this one, or of the Earth, which feels no sample.
    fn apply(&mut self, map: &impl ErrorMap<f64>, felt: &Surroundings) {
        let zero = Vec3([0.0; 3]);
        for column in &mut self.m {
            *column = flat(&map.apply(triples(column), zero, zero));
        }
        for (signal, column) in self.b.iter_mut().enumerate() {
            let (sensor, axis, of) = place(signal);
            let mut input = [zero, zero];
            input[sensor].0[axis] = felt.value(of);
            *column = flat(&map.apply(triples(column), input[0], input[1]));
        }
    }
}

fn triples(x: &Nav) -> NavError<f64> {
    [R, V, PSI].map(|block| Vec3([x[3 * block], x[3 * block + 1], x[3 * block + 2]]))
}

fn flat(x: &NavError<f64>) -> Nav {
    std::array::from_fn(|i| x[i / 3][i % 3])
}

/// Covariance of the navigation error for the standard deviations of the start.
fn start(plan: &Plan<'_>) -> [Nav; NAV] {
    let initial = plan.experiment.initial;
    let psi = psi_of_angles(plan.start.q_b_n);
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
