//! The mean of the true errors, which is the same in every run.

use super::column::Column;
use super::input::{SIGNALS, StepOfSource};
use super::joint::Gain;
use super::sides::Sides;
use super::track::{NAV, Step};

/// Mean of z and of the truth's states, as [`Joint`](super::joint::Joint) has their covariance.
#[derive(Debug, Clone)]
pub(super) struct Mean<'a> {
    sides: &'a Sides,
    pub(super) values: Column,
    /// Samples so far.
    elapsed: f64,
}

impl<'a> Mean<'a> {
    /// Errors that are zero at the start.
    pub(super) fn new(sides: &'a Sides) -> Self {
        let (b, t) = (&sides.b, &sides.t);
        let values = Column {
            x: [0.0; NAV],
            b: vec![0.0; b.states.len()],
            t: t.states.iter().map(|s| s.level).collect(),
        };
        Self {
            sides,
            values,
            elapsed: 0.0,
        }
    }

    /// Over one step.
    pub(super) fn step(&mut self, step: &Step) {
        let (inputs, elapsed) = (self.sides.over(step), self.elapsed);
        let mut error = [0.0; SIGNALS];
        let mut add = |states: &mut [f64], steps: &[StepOfSource]| {
            for (state, s) in states.iter_mut().zip(steps) {
                // With the state at the beginning of the step, as in the covariance; it decays afterwards.
                error[s.signal] += (s.mean + s.ramp * elapsed) * *state;
                *state *= s.decay;
            }
        };
        add(&mut self.values.b, &inputs.b);
        add(&mut self.values.t, &inputs.t);
        self.values.x = step.map(&self.values.x, &error);
        self.elapsed += f64::from(step.samples);
    }

    /// z ← z − k y for an innovation whose mean is y.
    pub(super) fn correct(&mut self, y: f64, gain: &Gain) {
        self.values
            .x
            .iter_mut()
            .zip(&gain.x)
            .for_each(|(x, k)| *x -= k * y);
        self.values
            .b
            .iter_mut()
            .zip(&gain.b)
            .for_each(|(b, k)| *b -= k * y);
    }
}
