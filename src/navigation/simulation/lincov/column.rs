//! One number for each state: a mean, covariances with something, or the coefficients of a linear form.

use super::input::Source;
use super::sides::Sides;
use super::track::{Nav, Row};

/// A number for each state of z = \[navigation error `x`; bias states `b`\] and for each state `t` of the truth, as
/// [`Joint`](super::joint::Joint) has them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub(super) x: Nav,
    pub(super) b: Vec<f64>,
    pub(super) t: Vec<f64>,
}

impl Column {
    /// What a row measures, as a linear form after `elapsed` samples.
    pub(super) fn measured(row: &Row, sides: &Sides, elapsed: f64) -> Self {
        let coefficients = |sources: &[Source]| {
            sources
                .iter()
                .map(|source| row.coefficient(source, elapsed))
                .collect()
        };
        let x = std::array::from_fn(|i| row.h[i]);
        Self {
            x,
            b: coefficients(&sides.b.states),
            t: coefficients(&sides.t.states),
        }
    }

    /// The value of a linear form.
    pub(super) fn dot(&self, other: &Self) -> f64 {
        let sum = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        sum(&self.x, &other.x) + sum(&self.b, &other.b) + sum(&self.t, &other.t)
    }
}
