//! Unknown constants of a sensor that act on its samples multiplied by something known: the regressor. The
//! error of a sample is their product, axis by axis; a bias is the case whose regressor is 1.

use super::covariance::BIAS;
use super::filter::Ekf;
use crate::imu::Sensor;
use crate::lanes::{Lanes, Real, Vec3, Wide};
use glam::DVec3;

/// What the constant is, and so what it is multiplied by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum UnknownKind {
    /// The slope of a drift (units per sample of the model), times the samples since the filter's start: a
    /// known magnitude of unknown sign has the same second moments as a normal slope of that deviation.
    Drift,
    /// A scale-factor error (1), times the sample itself: f_ib_b or omega_ib_b.
    ScaleFactor,
}

/// An unknown constant on each axis of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknown {
    /// Its kind.
    pub kind: UnknownKind,
    /// Its standard deviations on the three axes (units per sample, or 1).
    pub sigma: DVec3,
}

/// What an unknown constant is multiplied by in the last sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Regressor {
    pub(super) kind: UnknownKind,
    pub(super) value: Vec3,
}

impl Regressor {
    /// The regressor of an unknown before the first sample: zero.
    pub(super) const fn of(unknown: &Unknown) -> Self {
        Self {
            kind: unknown.kind,
            value: Vec3::ZERO,
        }
    }
}

/// Most kinds of unknowns of a sensor.
pub(super) const KINDS: usize = 2;

/// A block of three states and what each of them is multiplied by.
type Term = (usize, Vec3);

impl Ekf {
    /// The bias estimate of a sensor (m/s² or rad/s): the sum of its groups and its drift.
    #[inline(always)]
    #[must_use]
    pub(crate) fn bias_of<W: Wide>(&self, sensor: Sensor) -> Vec3<W> {
        let mut sum = self.bias_sum::<W>(sensor);
        if let Some((block, factor)) = self.drift_term(sensor) {
            let (slope, age) = (self.estimates[block - BIAS].load::<W>(), factor.load::<W>());
            for axis in 0..3 {
                sum[axis] = slope[axis].mul_add(age[axis], sum[axis]);
            }
        }
        sum
    }

    /// Standard deviations of that estimate on the three axes (m/s² or rad/s).
    #[must_use]
    pub(crate) fn bias_sigma(&self, sensor: Sensor) -> Vec3 {
        let sources = self.sources();
        let [accel, gyro] = sources.biases;
        let blocks = if sensor == Sensor::Accel {
            0..accel
        } else {
            accel..accel + gyro
        };
        let one = Vec3::splat(DVec3::ONE);
        let groups = blocks.map(move |g| (BIAS + g, one));
        self.deviation(groups.chain(self.drift_term(sensor)))
    }

    /// Standard deviations of the estimated scale-factor error of a sensor (1); none where the filter has no state for it.
    #[must_use]
    pub fn scale_sigma(&self, sensor: Sensor) -> Option<Vec3> {
        let block = self.unknown_block(sensor, UnknownKind::ScaleFactor)?;
        Some(self.deviation(std::iter::once((block, Vec3::splat(DVec3::ONE)))))
    }

    /// The block of an unknown of a sensor, if there is one.
    fn unknown_block(&self, sensor: Sensor, kind: UnknownKind) -> Option<usize> {
        let sources = self.sources();
        let u = sources.regressors[sensor as usize]
            .iter()
            .position(|r| r.kind == kind)?;
        Some(BIAS + sources.unknowns(sensor) + u)
    }

    /// The slope of a sensor's drift and the age of the last sample.
    fn drift_term(&self, sensor: Sensor) -> Option<Term> {
        let drift = self.sources().regressors[sensor as usize]
            .iter()
            .find(|r| r.kind == UnknownKind::Drift)?;
        Some((self.unknown_block(sensor, UnknownKind::Drift)?, drift.value))
    }

    /// Standard deviations of the sum of the terms on the three axes.
    fn deviation(&self, terms: impl Iterator<Item = Term> + Clone) -> Vec3 {
        let variance = |axis: usize| {
            // Var(Σ c_a x_a) with all covariances: after some fixes the groups of an axis are strongly
            // anti-correlated (the sum is observed, not its parts), and a sum of variances would be too large
            // many times over.
            let pairs = terms
                .clone()
                .flat_map(|a| terms.clone().map(move |b| (a, b)));
            pairs.fold(Lanes::ZERO, |sum, ((a, of_a), (b, of_b))| {
                sum + self.p.get::<Lanes>(3 * a + axis, 3 * b + axis) * of_a[axis] * of_b[axis]
            })
        };
        Vec3([0, 1, 2].map(|axis| variance(axis).sqrt()))
    }
}
