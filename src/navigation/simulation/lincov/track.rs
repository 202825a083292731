//! A trajectory as a linear filter sees it: maps of the navigation error, and when it is measured.

use super::super::plan::{Event, Experiment, ExperimentError, Plan};
use super::input::{CROSSED, SCALED, SIGNALS, Source, place};
use super::joint::add_scaled;
use crate::ekf::covariance::{PSI, R, V};
use crate::ekf::dynamics::{EARTH_STEP_S, EarthStep, EarthTerms, ErrorMap, NavError, Sample};
use crate::ekf::fix_rows;
use crate::ekf::initial::psi_of_angles;
use crate::frames::RollPitchYaw;
use crate::imu::ImuSample;
use crate::lanes::Vec3;
use crate::strapdown::Strapdown;
use crate::units::DEG;
use glam::DVec3;
use std::ops::Range;

/// Navigation states: R, V, PSI.
pub(super) const NAV: usize = 9;
/// A navigation error, or a column of nine.
pub(super) type Nav = [f64; NAV];

/// Longest step (s): a bias is represented by its mean over the step.
pub(super) const STEP_S: f64 = 0.2;

/// What happens to the navigation error over a step: x⁺ = `m` x + `b` e, e the errors of the biases (estimate
/// less truth) of the signals, their means over the step. Columns.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub(super) samples: u32,
    pub(super) m: [Nav; NAV],
    pub(super) b: [Nav; SIGNALS],
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
}

/// A scalar measurement: nine coefficients of the navigation error, three of the gyroscope's error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub(super) h: [f64; NAV + 3],
    /// The rate that scale factors and misalignments of the gyroscope multiply (rad/s).
    omega_ib_b: DVec3,
    /// Variance of its white noise.
    pub(super) r: f64,
    pub(super) what: Measured,
}

impl Row {
    /// The coefficient of a source's state in the measurement after `elapsed` samples, beside its part through the
    /// navigation error.
    pub(super) fn coefficient(&self, source: &Source, elapsed: f64) -> f64 {
        if let Some(component) = source.position {
            return f64::from(u8::from(self.what == Measured::Position(component)));
        }
        match place(source.signal) {
            (0, ..) => 0.0,
            // The coefficient of the lever arm's velocity is per unit of the rate's error, and this is the
            // error that the source has at the instant: a bias its value, a drift its slope times its age.
            (_, axis, None) => source.share(elapsed) * self.h[NAV + axis],
            (_, axis, Some(by)) => source.share(elapsed) * (self.h[NAV + axis] * self.omega_ib_b[by]),
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
    pub(super) fn of_noise_at(noise_hz: f64, experiment: &Experiment<'_>) -> Result<Self, ExperimentError> {
        let plan = &Plan::reference(experiment)?;
        let mut line = Linearisation::new(plan, noise_hz);
        let longest = ((STEP_S * experiment.rate_hz).round() as usize).max(1);
        let (mut steps, mut marks, mut done) = (Vec::new(), Vec::with_capacity(plan.events.len()), 0);
        for (index, event) in plan.events.iter().enumerate() {
            let samples = &plan.ideal[done..event.sample];
            // Parts of equal length: what the noise processes do over a step is computed once for each length
            // that occurs.
            let parts = samples.len().div_ceil(longest).max(1);
            for part in samples.chunks(samples.len().div_ceil(parts).max(1)) {
                steps.push(line.step(part));
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
                outages: plan.outages.iter().enumerate().filter(ends).map(|(i, _)| i).collect(),
                jacobian: RollPitchYaw::from_quat(event.reference.q_b_n).jacobian_of_psi_n(),
            });
        }
        let (outages, perfect) = (plan.outages.len(), experiment.initial.perfect);
        Ok(Self { steps, marks, outages, start: start(plan), perfect })
    }

    /// Some marks, each with the steps that lead to it.
    pub(super) fn legs(&self, marks: Range<usize>) -> impl Iterator<Item = (&[Step], &Mark)> {
        let begin = |mark: usize| mark.checked_sub(1).map_or(0, |before| self.marks[before].steps);
        marks.map(move |mark| (&self.steps[begin(mark)..self.marks[mark].steps], &self.marks[mark]))
    }

    /// As [`Self::merged`], with a report every ten, and white noise through its mean over a step as well: a tenth faster
    /// for the hundreds of passes of a search, and within 1e-3 in every ratio.
    #[must_use]
    pub fn coarse(&self) -> Self {
        let mut track = self.merged();
        track.steps.iter_mut().for_each(|step| step.white = Vec::new());
        let mut reports = 0;
        for mark in &mut track.marks {
            reports += usize::from(mark.report);
            // One report in ten: reports enter the cost of a search as an average, and errors change slowly.
            mark.report &= reports % 10 == 0;
        }
        track
    }

    /// The same with one step from mark to mark, at most a second: a few times faster. White noise is exact; a bias is
    /// its mean over the step, which leaves up to 1e-4 of an error after ten seconds without fixes, 1.2e-3 after five.
    #[must_use]
    pub fn merged(&self) -> Self {
        let (mut steps, mut marks, mut done) = (Vec::new(), self.marks.clone(), 0);
        for mark in &mut marks {
            // Between marks alone: no step may reach over a measurement.
            steps.extend(self.steps[done..mark.steps].iter().cloned().reduce(|a, b| a.then(&b)));
            (done, mark.steps) = (mark.steps, steps.len());
        }
        Self { steps, marks, ..self.clone() }
    }
}

/// The reference as the strapdown passes through it.
struct Linearisation {
    ins: Strapdown<f64>,
    omega_ib_b: DVec3,
    dt: f64,
    noise_hz: f64,
    /// Signals that are followed: those of misalignments only where there are any.
    signals: usize,
}

impl Linearisation {
    fn new(plan: &Plan<'_>, noise_hz: f64) -> Self {
        let experiment = plan.experiment;
        let ins = Strapdown::single(&plan.start, experiment.gravity);
        let signals = if experiment.defects.misalignment_rad > 0.0 { SIGNALS } else { CROSSED };
        Self { ins, omega_ib_b: DVec3::ZERO, dt: 1.0 / experiment.rate_hz, noise_hz, signals }
    }

    /// The maps of the samples one after the other, the Earth's as the filter applies them.
    fn step(&mut self, samples: &[ImuSample]) -> Step {
        let unit = |i: usize| std::array::from_fn(|k| if i == k { 1.0 } else { 0.0 });
        let mut step = Step {
            // Samples of the noise model's rate, which need not be the rate at which the motion is sampled.
            samples: (samples.len() as f64 * self.dt * self.noise_hz).round().max(1.0) as u32,
            m: std::array::from_fn(unit),
            b: [[0.0; NAV]; SIGNALS],
            white: Vec::new(),
        };
        let mut age = 0.0;
        for sample in samples {
            self.omega_ib_b = sample.omega_ib_b;
            let (dtheta, dv) = (sample.omega_ib_b * self.dt, sample.f_ib_b * self.dt);
            let trace = self.ins.step(Vec3::splat(dtheta), Vec3::splat(dv), self.dt);
            step.apply(&Sample::new(&trace, self.dt), sample, self.signals);
            age += self.dt;
            if age + 0.5 * self.dt > EARTH_STEP_S {
                step.apply(&EarthStep { terms: EarthTerms::at(&self.ins), dt: age }, sample, self.signals);
                age = 0.0;
            }
        }
        // A measurement meets a covariance that has all of the Earth's terms, as `settle` gives it in the
        // filter.
        if let Some(sample) = samples.last().filter(|_| age > 0.0) {
            step.apply(&EarthStep { terms: EarthTerms::at(&self.ins), dt: age }, sample, self.signals);
        }
        step
    }

    fn rows(&self, plan: &Plan<'_>, event: &Event) -> Vec<Row> {
        let experiment = plan.experiment;
        let mut rows = Vec::new();
        if event.fix {
            let gnss = experiment.gnss;
            let h = fix_rows(&self.ins, self.omega_ib_b, gnss.lever_arm_m.into());
            let sigmas = gnss.pos_sigma_m.into_iter().chain(gnss.vel_sigma_m_s.into_iter().flatten());
            for (i, (h, sigma)) in h.into_iter().zip(sigmas).enumerate() {
                let what = if i < 3 { Measured::Position(i) } else { Measured::Velocity };
                rows.push(Row { h, omega_ib_b: self.omega_ib_b, r: sigma * sigma, what });
            }
        }
        if let Some(baro) = experiment.baro.filter(|_| event.baro) {
            let mut h = [0.0; NAV + 3];
            h[3 * R + 2] = 1.0;
            let r = baro.sigma_m * baro.sigma_m;
            rows.push(Row { h, omega_ib_b: DVec3::ZERO, r, what: Measured::Height });
        }
        rows
    }
}

impl Step {
    /// This step and then another, as one.
    fn then(self, next: &Self) -> Self {
        let none = [0.0; SIGNALS];
        let mut b = self.b.map(|column| next.map(&column, &none));
        for (sum, column) in b.iter_mut().flatten().zip(next.b.iter().flatten()) {
            // The response to a constant input: that of the first part, carried through the second, and that
            // of the second.
            *sum += column;
        }
        // White noise of the two parts is independent: through the mean of a second it would move a position by
        // a quarter of T³ where it is a third.
        let mut white = self.white_noise();
        for (sum, more) in white.iter_mut().zip(next.white_noise()) {
            let carried = sum.map(|column| next.map(&column, &none));
            for (i, more) in more.iter().enumerate() {
                // Symmetric: the rows of a carried covariance are its columns.
                sum[i] = next.map(&carried.map(|column| column[i]), &none);
                add_scaled(&mut sum[i], 1.0, more);
            }
        }
        let m = self.m.map(|column| next.map(&column, &none));
        Self { samples: self.samples + next.samples, m, b, white }
    }

    /// Its `white`, whether it is there or follows from the mean over the step.
    fn white_noise(&self) -> Vec<[Nav; NAV]> {
        let of_mean = |b: &Nav| b.map(|factor| b.map(|b| b * factor / f64::from(self.samples)));
        if self.white.is_empty() {
            self.b[..SCALED].iter().map(of_mean).collect()
        } else {
            self.white.clone()
        }
    }

    /// The map of a sample after this one, or of the Earth, which feels no sample; of the first `signals` signals.
    fn apply(&mut self, map: &impl ErrorMap<f64>, sample: &ImuSample, signals: usize) {
        let zero = Vec3([0.0; 3]);
        for column in &mut self.m {
            *column = flat(&map.apply(triples(column), zero, zero));
        }
        for (signal, column) in self.b.iter_mut().enumerate().take(signals) {
            let (sensor, axis, by) = place(signal);
            let measured = [sample.f_ib_b, sample.omega_ib_b][sensor];
            let mut input = [zero, zero];
            // Unit error of the signal: 1 for a bias, the true sample for a scale factor, that of another
            // axis for a misalignment.
            input[sensor].0[axis] = by.map_or(1.0, |by| measured[by]);
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
            let angle = |k: usize| psi[(i, k)] * psi[(j, k)] * (initial.att_sigma_deg[k] * DEG).powi(2);
            p[3 * PSI + i][3 * PSI + j] = (0..3).map(angle).sum();
        }
    }
    p
}
