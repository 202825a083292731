//! The mean of the true errors, which is the same in every run, and what else moves as a mean does.

use super::input::{SIGNALS, Source, StepOfSource};
use super::joint::Gain;
use super::sides::Sides;
use super::track::{NAV, Nav, Row, Step};

/// Mean of z = \[navigation error; bias estimates\] and of the truth's states, as [`Joint`](super::joint::Joint)
/// has their covariance; or their covariance with a variable of the past, of which later noise knows nothing.
#[derive(Debug, Clone)]
pub(super) struct Mean<'a> {
    pub(super) sides: &'a Sides,
    pub(super) x: Nav,
    pub(super) b: Vec<f64>,
    pub(super) t: Vec<f64>,
    /// Samples so far.
    pub(super) elapsed: f64,
}

impl<'a> Mean<'a> {
    /// Errors that are zero at the start; none where all states of the truth have mean zero and so has everything else.
    pub(super) fn new(sides: &'a Sides) -> Option<Self> {
        let (b, t) = (&sides.b, &sides.t);
        // A mean is rare (drifts of the truth): without one the whole propagation is spared.
        t.states.iter().any(|s| s.level != 0.0).then(|| Self {
            sides,
            x: [0.0; NAV],
            b: vec![0.0; b.states.len()],
            t: t.states.iter().map(|s| s.level).collect(),
            elapsed: 0.0,
        })
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
        add(&mut self.b, &inputs.b);
        add(&mut self.t, &inputs.t);
        self.x = step.map(&self.x, &error);
        self.elapsed += f64::from(step.samples);
    }

    /// Mean of what a row measures less what is expected.
    pub(super) fn innovation(&self, row: &Row) -> f64 {
        let of_x: f64 = self.x.iter().zip(&row.h).map(|(x, h)| x * h).sum();
        let measured = |states: &[f64], sources: &[Source]| -> f64 {
            states.iter().zip(sources).map(|(x, s)| x * row.coefficient(s, self.elapsed)).sum()
        };
        of_x + measured(&self.b, &self.sides.b.states) + measured(&self.t, &self.sides.t.states)
    }

    /// z ← z − k y.
    pub(super) fn correct(&mut self, y: f64, gain: &Gain) {
        self.x.iter_mut().zip(&gain.x).for_each(|(x, k)| *x -= k * y);
        self.b.iter_mut().zip(&gain.b).for_each(|(b, k)| *b -= k * y);
    }
}
