//! The states that make inertial errors, and what they do over a step of many samples.

use crate::ekf::belief::BiasGroup;
use crate::ekf::{Belief, UnknownKind};
use crate::imu::{Channel, Sensor};
use crate::noise::{Ladder, Model, Process};
use crate::sensors::aiding::{AidPart, Law};
use crate::sensors::defects::Felt;
use crate::simulation::BIASES;

/// Signals: errors of an axis in proportion to what the IMU feels. Most filters and IMUs have the first of them alone.
pub(super) const SIGNALS: usize = 42;
/// The first that is multiplied by its own sample, what a scale factor adds.
pub(super) const SCALED: usize = 6;
/// The first that is multiplied by the sample of another axis, what a misalignment adds.
pub(super) const CROSSED: usize = 12;
/// The first of a gyroscope that is multiplied by a specific force.
pub(super) const PUSHED: usize = 24;
/// The first of an accelerometer that is multiplied by its own square.
pub(super) const RECTIFIED: usize = 33;
/// The first that is multiplied by the warming.
pub(super) const WARMED: usize = 36;

/// Where a signal acts: sensor, axis, and what it is multiplied by.
pub(super) const fn place(signal: usize) -> (usize, usize, Felt) {
    match signal {
        0..SCALED => (signal / 3, signal % 3, Felt::Unit),
        SCALED..CROSSED => {
            let sensor = signal % SCALED / 3;
            (
                sensor,
                signal % 3,
                Felt::Sample(Sensor::ALL[sensor], signal % 3),
            )
        }
        CROSSED..PUSHED => {
            let (sensor, pair) = ((signal - CROSSED) / 6, (signal - CROSSED) % 6);
            (
                sensor,
                pair / 2,
                Felt::Sample(Sensor::ALL[sensor], (pair / 2 + 1 + pair % 2) % 3),
            )
        }
        PUSHED..RECTIFIED => {
            let pair = signal - PUSHED;
            (
                Sensor::Gyro as usize,
                pair / 3,
                Felt::Sample(Sensor::Accel, pair % 3),
            )
        }
        RECTIFIED..WARMED => (
            Sensor::Accel as usize,
            signal - RECTIFIED,
            Felt::Square(signal - RECTIFIED),
        ),
        _ => ((signal - WARMED) / 3, (signal - WARMED) % 3, Felt::Warming),
    }
}

/// All kinds of unknowns.
const UNKNOWNS: [UnknownKind; 2] = [UnknownKind::Drift, UnknownKind::ScaleFactor];

/// A state behind one signal, in the form that every process of the catalogue has at the sample rate:
/// the error of a sample is `before`·s + `after`·s⁺ + `fresh`·w, and s⁺ = `decay`·s + `drive`·w with w white
/// of variance 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Source {
    /// Which signal it is part of.
    pub(super) signal: usize,
    before: f64,
    after: f64,
    fresh: f64,
    decay: f64,
    drive: f64,
    /// Growth of `after` with every sample: a ramp is its slope times the samples so far.
    ramp: f64,
    /// Variance of s at the start.
    pub(super) initial: f64,
    /// Mean of s at the start.
    pub(super) level: f64,
    /// The measurement that it is part of; such a source is no inertial error.
    pub(super) outer: Option<Outer>,
}

/// An error of measurements that lasts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Outer {
    /// Of a component of a fix's position.
    Position(usize),
    /// Of what a vehicle measures of itself.
    Vehicle(AidPart),
}

/// A source that makes no error.
const NONE: Source = Source {
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

/// What a source does over a step: the mean of its samples' errors is `mean`·s + w₁, and s⁺ = `decay`·s + w₂.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StepOfSource {
    pub(super) signal: usize,
    pub(super) mean: f64,
    /// Growth of `mean` with every sample before the step.
    pub(super) ramp: f64,
    pub(super) decay: f64,
    /// Variance of w₁.
    pub(super) q_mean: f64,
    /// Covariance of w₁ and w₂.
    pub(super) q_cross: f64,
    /// Variance of w₂.
    pub(super) q_state: f64,
}

impl Source {
    fn bias(signal: usize, phi: f64, innovation: f64, initial: f64) -> Self {
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
        Self::bias(signal, 1.0, 0.0, sigma * sigma)
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
            outer: Some(Outer::Position(component)),
            ..NONE
        }
    }

    /// An error of what a vehicle measures of itself, at an IMU of this rate.
    pub(super) fn of_vehicle(part: AidPart, law: Law, imu_hz: f64) -> Self {
        let outer = Some(Outer::Vehicle(part));
        match law {
            // The states of the truth are negated, and so is a mean.
            Law::Known(value) => Self {
                level: -value,
                outer,
                ..NONE
            },
            Law::Constant(sigma) => Self {
                initial: sigma * sigma,
                outer,
                ..NONE
            },
            Law::GaussMarkov { sigma, time_s } => {
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

    /// What the source does over a step of `samples` samples, exactly.
    pub(super) fn over(&self, samples: u32) -> StepOfSource {
        let n = f64::from(samples);
        let mut step = StepOfSource {
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
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sources {
    pub(super) states: Vec<Source>,
    pub(super) white: [f64; BIASES],
}

impl Default for Sources {
    fn default() -> Self {
        Self {
            states: Vec::new(),
            white: [0.0; BIASES],
        }
    }
}

impl Sources {
    /// Adds those of another, independent.
    pub(super) fn extend(&mut self, other: &Self) {
        self.states.extend_from_slice(&other.states);
        self.white
            .iter_mut()
            .zip(&other.white)
            .for_each(|(white, more)| *white += more);
    }

    /// What a filter estimates of them: nothing at the start, and nothing drives its estimates but corrections.
    pub(super) fn estimates(&self) -> Self {
        Self {
            states: self.states.iter().map(Source::estimate).collect(),
            ..Self::default()
        }
    }

    /// Those a filter believes in: one for each bias state.
    pub(super) fn of_belief(belief: &Belief) -> Self {
        let mut states = Vec::new();
        for sensor in Sensor::ALL {
            states.extend(
                belief.groups[sensor as usize]
                    .iter()
                    .flat_map(|g| Self::of_group(sensor, g)),
            );
        }
        let [accel, gyro] = belief.white.map(|w| w.to_array());
        let mut white = [0.0; BIASES];
        white[..3].copy_from_slice(&accel);
        white[3..].copy_from_slice(&gyro);
        states.extend(Self::multiplied(belief, &UNKNOWNS));
        states.extend(Self::of_vehicle(belief));
        Self { states, white }
    }

    /// The bias states of a group.
    pub(super) fn of_group(sensor: Sensor, group: &BiasGroup) -> Vec<Source> {
        let state = |axis: usize| {
            let (phi, q, initial) = (group.phi[axis], group.innovation[axis], group.initial[axis]);
            (initial != 0.0 || q != 0.0)
                .then(|| Source::bias(3 * sensor as usize + axis, phi, q, initial))
        };
        (0..3).filter_map(state).collect()
    }

    /// Unknown constants of a belief that are multiplied.
    pub(super) fn multiplied(belief: &Belief, kinds: &[UnknownKind]) -> Vec<Source> {
        let mut states = Vec::new();
        for (sensor, axis) in Sensor::ALL
            .into_iter()
            .flat_map(|s| (0..3).map(move |i| (s, i)))
        {
            let signal = 3 * sensor as usize + axis;
            for unknown in belief
                .unknowns(sensor)
                .iter()
                .filter(|u| kinds.contains(&u.kind))
            {
                let sigma = unknown.sigma[axis];
                states.extend((sigma > 0.0).then(|| match unknown.kind {
                    UnknownKind::Drift => Source::ramp(signal, sigma),
                    UnknownKind::ScaleFactor => Source::constant(SCALED + signal, sigma),
                }));
            }
        }
        states
    }

    /// Wheel scale and mounting of a vehicle, as a filter believes in them.
    pub(super) fn of_vehicle(belief: &Belief) -> Vec<Source> {
        let parts = [
            AidPart::WheelScale,
            AidPart::MountingPitch,
            AidPart::MountingYaw,
        ];
        let states = parts
            .into_iter()
            .zip(belief.vehicle.to_array())
            .filter(|(_, sigma)| *sigma > 0.0);
        states
            .map(|(part, sigma)| Source::of_vehicle(part, Law::Constant(sigma), belief.rate_hz))
            .collect()
    }

    /// What a belief expects beside its noise model, as it expects it: turn-on biases and scale factors.
    pub(super) fn beside_model(belief: &Belief) -> Vec<Source> {
        let mut states = Self::multiplied(belief, &[UnknownKind::ScaleFactor]);
        states.extend(Self::of_vehicle(belief));
        for sensor in Sensor::ALL {
            for group in belief.groups[sensor as usize]
                .iter()
                .filter(|g| g.is_constant())
            {
                let constant =
                    |axis| Source::bias(3 * sensor as usize + axis, 1.0, 0.0, group.initial[axis]);
                states.extend((0..3).map(constant).filter(|s| s.initial > 0.0));
            }
        }
        states
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
        let state = match process {
            Process::Flicker(p) => {
                p.parts(Ladder::FINE)
                    .iter()
                    .for_each(|part| self.add(signal, part));
                return;
            }
            Process::White(p) => {
                self.white[signal] += p.sigma2();
                return;
            }
            // U_k − U_{k−1}: the last U is a state, because the sum over a step telescopes. As white noise it
            // would grow.
            Process::Quantization(p) => Source::memory(signal, p.q2().sqrt(), 1.0, -1.0),
            Process::Ma1(p) => Source::memory(signal, p.sigma2().sqrt(), 1.0, p.theta()),
            Process::Ar1(p) => Source::bias(signal, p.phi(), p.sigma2(), p.variance()),
            Process::GaussMarkov(p) => {
                Source::bias(signal, p.ar1().phi(), p.ar1().sigma2(), p.s2())
            }
            Process::RandomWalk(p) => Source::bias(signal, 1.0, p.gamma2(), 0.0),
            Process::Drift(p) => Source::ramp(signal, p.slope()),
        };
        self.states.push(state);
    }
}
