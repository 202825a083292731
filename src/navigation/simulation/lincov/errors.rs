//! The true errors of a filter as they are taken along a track.

use super::input::Sources;
use super::joint::{Gain, Inputs, Joint};
use super::mean::Mean;
use super::pass::Instant;
use super::track::{Mark, NAV, Nav, Row, Step, Track};
use super::truth::TruthSide;

/// The true errors at an instant.
#[derive(Clone)]
pub(super) struct Errors {
    joint: Joint,
    mean: Option<Mean>,
}

impl Errors {
    /// Those of the start, beside the estimates of a filter's states.
    pub(super) fn at_start(track: &Track, estimates: &Sources, truth: &TruthSide) -> Self {
        let begin = if truth.starts_off { track.start } else { [[0.0; NAV]; NAV] };
        let (joint, mean) =
            (Joint::new(begin, estimates, &truth.inertial), Mean::new(estimates, &truth.inertial));
        Self { joint, mean }
    }

    /// A stand-in where what the filter states is converted to the reported states, which needs no true errors.
    pub(super) fn none() -> Self {
        let none = Sources::default();
        Self { joint: Joint::new([[0.0; NAV]; NAV], &none, &none), mean: None }
    }

    pub(super) fn step(&mut self, step: &Step, inputs: &Inputs) {
        self.joint.step(step, inputs);
        self.mean.iter_mut().for_each(|mean| mean.step(step, inputs));
    }

    /// Corrects by a measurement with the filter's gain; returns the expected square of the innovation.
    pub(super) fn measure(&mut self, row: &Row, truth: &TruthSide, gain: &Gain) -> f64 {
        // Without its noise where the source under study is another one: covariances of independent sources
        // add.
        let y = self.joint.innovation(row, if truth.has_noise(row.what) { row.r } else { 0.0 });
        let mean = self.mean.as_ref().map_or(0.0, |mean| mean.innovation(row));
        self.joint.correct(&y, gain);
        self.mean.iter_mut().for_each(|m| m.correct(mean, gain));
        y.s + mean * mean
    }

    pub(super) fn instant(&self, mark: &Mark, believed: &[Nav; NAV]) -> Instant {
        Instant {
            after_s: mark.after_s,
            t_s: mark.t_s,
            measured: !mark.rows.is_empty(),
            fix: mark.fix,
            believed: *believed,
            covariance: self.joint.xx,
            mean: self.mean.as_ref().map_or([0.0; NAV], |mean| mean.x),
            jacobian: mark.jacobian,
        }
    }
}

/// Inputs by the number of samples of a step; few numbers occur.
pub(super) struct StepInputs<'a> {
    b: &'a Sources,
    t: &'a Sources,
    made: Vec<(u32, Inputs)>,
}

impl<'a> StepInputs<'a> {
    pub(super) const fn new(b: &'a Sources, t: &'a Sources) -> Self {
        Self { b, t, made: Vec::new() }
    }

    pub(super) fn over(&mut self, samples: u32) -> &Inputs {
        let found = self.made.iter().position(|(n, _)| *n == samples);
        let at = found.unwrap_or_else(|| {
            self.made.push((samples, Inputs::new(self.b, self.t, samples)));
            self.made.len() - 1
        });
        &self.made[at].1
    }
}
