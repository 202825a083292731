//! The states beside the navigation error, and what they do over the steps of a track.

use super::input::{SIGNALS, Sources, StepOfSource};
use super::track::{Step, Track};
use crate::simulation::BIASES;

/// The states `b` of a filter and `t` of the truth, as [`Joint`](super::joint::Joint) has them.
#[derive(Debug)]
pub(super) struct Sides {
    pub(super) b: Sources,
    pub(super) t: Sources,
    /// Signals that they reach: most have neither scale factors nor what comes after them.
    pub(super) signals: usize,
    /// By the number of samples of a step; few numbers occur.
    inputs: Vec<(u32, Inputs)>,
}

impl Sides {
    /// A filter as it sees itself along a track: its biases are what makes its errors.
    pub(super) fn of_filter(believed: Sources, track: &Track) -> Self {
        Self::new(believed, Sources::default(), track)
    }

    /// The estimates of a filter, and what truly makes its errors.
    pub(super) fn of_errors(believed: &Sources, truth: &Sources, track: &Track) -> Self {
        Self::new(believed.estimates(), truth.clone(), track)
    }

    fn new(b: Sources, t: Sources, track: &Track) -> Self {
        let mut inputs: Vec<(u32, Inputs)> = Vec::new();
        for step in &track.steps {
            if inputs.iter().all(|(samples, _)| *samples != step.samples) {
                inputs.push((step.samples, Inputs::new(&b, &t, step.samples)));
            }
        }
        let signals = b
            .states
            .iter()
            .chain(&t.states)
            .map(|s| s.signal + 1)
            .max()
            .unwrap_or(0);
        // What a track does not follow would be left out in silence.
        debug_assert!(track.steps.iter().all(|step| signals <= step.b.len()));
        Self {
            b,
            t,
            signals,
            inputs,
        }
    }

    /// What they do over a step of the track.
    pub(super) fn over(&self, step: &Step) -> &Inputs {
        let found = self
            .inputs
            .iter()
            .find(|(samples, _)| *samples == step.samples);
        &found.expect("every length of the track is there").1
    }
}

/// What sources do over steps of one length.
#[derive(Debug, Clone)]
pub(super) struct Inputs {
    pub(super) b: Vec<StepOfSource>,
    pub(super) t: Vec<StepOfSource>,
    /// Variance of the white noise of a sample (units²).
    pub(super) white: [f64; BIASES],
    /// Variance of the part of a signal's mean over the step that is new in it: of white noise and states, of states
    /// alone (units²).
    pub(super) q_mean: [[f64; SIGNALS]; 2],
}

impl Inputs {
    /// The steps of the filter's states `b` and of the states `t` of the truth; white noise belongs to the side that
    /// makes the errors.
    fn new(b: &Sources, t: &Sources, samples: u32) -> Self {
        let steps_of = |s: &Sources| -> Vec<StepOfSource> {
            s.states.iter().map(|x| x.over(samples)).collect()
        };
        let (bs, ts) = (steps_of(b), steps_of(t));
        let white: [f64; BIASES] = std::array::from_fn(|i| b.white[i] + t.white[i]);
        let mut q_mean = [[0.0; SIGNALS]; 2];
        q_mean[0]
            .iter_mut()
            .zip(white)
            .for_each(|(q, white)| *q = white / f64::from(samples));
        for source in bs.iter().chain(&ts) {
            q_mean
                .iter_mut()
                .for_each(|q| q[source.signal] += source.q_mean);
        }
        Self {
            b: bs,
            t: ts,
            white,
            q_mean,
        }
    }
}
