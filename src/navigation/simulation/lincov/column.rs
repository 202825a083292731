//! One number for each state: a mean, covariances with something, or the coefficients of a linear form.

use super::input::{Source, Sources, StepOfSource};
use super::sides::Sides;
use super::track::{Nav, Row, Step};
use crate::ekf::covariance::{PSI, V};

/// A number for each state of z = \[navigation error `x`; bias states `b`\] and for each state `t` of the truth, as
/// [`Joint`](super::joint::Joint) has them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub(super) x: Nav,
    pub(super) b: Vec<f64>,
    pub(super) t: Vec<f64>,
}

impl Column {
    /// One of the navigation errors, as a linear form.
    pub(super) fn state(state: usize, sides: &Sides) -> Self {
        let none = |sources: &Sources| vec![0.0; sources.states.len()];
        let x = std::array::from_fn(|i| if i == state { 1.0 } else { 0.0 });
        Self { x, b: none(&sides.b), t: none(&sides.t) }
    }

    /// What a row measures, as a linear form after `elapsed` samples.
    pub(super) fn measured(row: &Row, sides: &Sides, elapsed: f64) -> Self {
        let coefficients =
            |sources: &[Source]| sources.iter().map(|source| row.coefficient(source, elapsed)).collect();
        let x = std::array::from_fn(|i| row.h[i]);
        Self { x, b: coefficients(&sides.b.states), t: coefficients(&sides.t.states) }
    }

    /// The error of the specific force along an axis of n (m/s for a sample) that attitude error and biases at the beginning of a step
    /// make over it, as a linear form.
    pub(super) fn force_error(axis: usize, step: &Step, sides: &Sides, elapsed: f64) -> Self {
        let (inputs, velocity, share) = (sides.over(step), 3 * V + axis, 1.0 / f64::from(step.samples));
        let through = |s: &StepOfSource| share * (s.mean + s.ramp * elapsed) * step.b[s.signal][velocity];
        Self {
            x: std::array::from_fn(|i| if i / 3 == PSI { share * step.m[i][velocity] } else { 0.0 }),
            b: inputs.b.iter().map(through).collect(),
            t: inputs.t.iter().map(through).collect(),
        }
    }

    /// The value of a linear form.
    pub(super) fn dot(&self, other: &Self) -> f64 {
        let sum = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        sum(&self.x, &other.x) + sum(&self.b, &other.b) + sum(&self.t, &other.t)
    }
}
