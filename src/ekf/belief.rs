//! What the filter believes of the inertial noise: a noise model in the form of filter states.

use super::initial::FilterStates;
use crate::imu::{Channel, Sensor};
use crate::noise::{Composite, Model, Process, reduction};
use glam::DVec3;

/// Most bias states an axis.
pub const MAX_GROUPS: usize = 8;
/// Most bias groups of a sensor: those of the model and an unknown constant.
pub(super) const MAX_BLOCKS: usize = MAX_GROUPS + 1;

/// A model that cannot be made into filter states.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BeliefError {
    /// A process that has no stochastic state.
    #[error("{channel}: a drift (DR) has no state in the full filter; use the reduced one (15 states)")]
    Drift {
        /// The axis that carries it.
        channel: Channel,
    },
    /// More bias states than the filter carries.
    #[error("{channel}: more than {MAX_GROUPS} correlated processes; use the reduced filter (15 states)")]
    TooManyStates {
        /// The axis that carries them.
        channel: Channel,
    },
    /// Reduction failed.
    #[error("{channel}: {source}")]
    Reduction {
        /// The axis.
        channel: Channel,
        /// Why.
        source: reduction::ReductionError,
    },
}

/// One bias state an axis of one sensor: b_{k+1} = phi b_k + w.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BiasGroup {
    /// Coefficients of the three axes.
    pub phi: DVec3,
    /// Innovation variances (units² per sample).
    pub innovation: DVec3,
    /// Initial variances (units²).
    pub initial: DVec3,
}

impl BiasGroup {
    /// A constant that is not known: the same for all time, with this standard deviation on each axis.
    #[must_use]
    pub const fn constant(sigma: f64) -> Self {
        Self { phi: DVec3::ONE, innovation: DVec3::ZERO, initial: DVec3::splat(sigma * sigma) }
    }

    /// The same bias with a step of `ratio` samples, which need not be whole: a Gauss-Markov process keeps its
    /// correlation time and variance, a random walk its growth. A coefficient ≤ 0 belongs to no process in
    /// continuous time and is left as it is.
    #[must_use]
    pub fn over(&self, ratio: f64) -> Self {
        let axis = |i: usize| match self.phi[i] {
            phi if phi >= 1.0 => (phi, self.innovation[i] * ratio),
            phi if phi > 0.0 => {
                let kappa = -(phi - 1.0).ln_1p();
                let share = (-2.0 * kappa * ratio).exp_m1() / (-2.0 * kappa).exp_m1();
                ((-kappa * ratio).exp(), self.innovation[i] * share)
            }
            phi => (phi, self.innovation[i]),
        };
        let [x, y, z] = [0, 1, 2].map(axis);
        Self { phi: DVec3::new(x.0, y.0, z.0), innovation: DVec3::new(x.1, y.1, z.1), ..*self }
    }
}

/// What the filter believes: white noise of a sample and bias states, for each sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Belief {
    /// Rate the parameters belong to (Hz).
    pub rate_hz: f64,
    /// White variance of a sample on the three axes, accelerometer ((m/s²)²) and gyroscope ((rad/s)²).
    pub white: [DVec3; 2],
    /// Bias groups of the accelerometer and of the gyroscope, at least one each.
    pub groups: [Vec<BiasGroup>; 2],
    /// Stochastic states carried, navigation included (15 for the reduced filter).
    pub states: usize,
}

impl Belief {
    /// The filter's states for a model.
    ///
    /// The reduction is made for a GNSS interval and a longest time scale (s; [`reduction::window_s`]). Quantization noise is left out of the filter: its integral is bounded, so
    /// it is not white noise to a filter that integrates.
    ///
    /// # Errors
    /// When a process has no state in the full filter, or the reduction fails.
    pub fn new(
        model: &Model,
        states: FilterStates,
        interval_s: f64,
        window_s: f64,
    ) -> Result<Self, BeliefError> {
        let mut belief =
            Self { rate_hz: model.rate_hz, white: [DVec3::ZERO; 2], groups: [vec![], vec![]], states: 9 };
        for channel in Channel::ALL {
            let axis = match states {
                FilterStates::Full => AxisBelief::full(model.axis(channel), channel)?,
                FilterStates::Reduced15 => AxisBelief::reduced(model, channel, interval_s, window_s)?,
            };
            if axis.biases.len() > MAX_GROUPS {
                return Err(BeliefError::TooManyStates { channel });
            }
            belief.add(channel, &axis);
        }
        for groups in &mut belief.groups {
            if groups.is_empty() {
                groups.push(BiasGroup::default());
            }
        }
        Ok(belief)
    }

    fn add(&mut self, channel: Channel, axis: &AxisBelief) {
        let (sensor, i) = (channel.sensor as usize, channel.axis as usize);
        self.white[sensor][i] = axis.white;
        self.states += axis.biases.len();
        for (g, bias) in axis.biases.iter().enumerate() {
            if self.groups[sensor].len() == g {
                self.groups[sensor].push(BiasGroup::default());
            }
            let group = &mut self.groups[sensor][g];
            (group.phi[i], group.innovation[i], group.initial[i]) = (bias.phi, bias.innovation, bias.initial);
        }
    }

    /// Blocks of the covariance: R, V, PSI and the bias groups.
    #[must_use]
    pub fn blocks(&self) -> usize {
        3 + self.groups[0].len() + self.groups[1].len()
    }

    /// Adds an unknown constant to the biases of a sensor (a turn-on bias); nothing where sigma is 0.
    pub fn add_constant(&mut self, sensor: Sensor, sigma: f64) {
        if sigma > 0.0 {
            self.groups[sensor as usize].push(BiasGroup::constant(sigma));
            self.states += 3;
        }
    }

    /// Standard deviation of the biases of a sensor at the start: the largest of the three axes.
    #[must_use]
    pub fn initial_bias_sigma(&self, sensor: Sensor) -> f64 {
        self.groups[sensor as usize].iter().map(|g| g.initial).sum::<DVec3>().max_element().sqrt()
    }

    /// Replaces the initial variance of the first bias group of a sensor by sigma² on each axis.
    pub fn set_initial_bias_sigma(&mut self, sensor: Sensor, sigma: f64) {
        if let Some(group) = self.groups[sensor as usize].first_mut() {
            group.initial = DVec3::splat(sigma * sigma);
        }
    }
}

struct BiasState {
    phi: f64,
    innovation: f64,
    initial: f64,
}

struct AxisBelief {
    white: f64,
    biases: Vec<BiasState>,
}

impl AxisBelief {
    fn full(noise: &Composite, channel: Channel) -> Result<Self, BeliefError> {
        let mut axis = Self { white: 0.0, biases: vec![] };
        for process in &noise.processes {
            match process {
                Process::White(p) => axis.white += p.sigma2(),
                // its long-run variance: what a filter that integrates feels
                Process::Ma1(p) => axis.white += (1.0 + p.theta()).powi(2) * p.sigma2(),
                Process::Quantization(_) => {}
                Process::Ar1(p) => axis.push(p.phi(), p.sigma2(), p.variance()),
                Process::GaussMarkov(p) => axis.push(p.ar1().phi(), p.ar1().sigma2(), p.s2()),
                Process::RandomWalk(p) => axis.push(1.0, p.gamma2(), 0.0),
                Process::Drift(_) => return Err(BeliefError::Drift { channel }),
            }
        }
        Ok(axis)
    }

    fn reduced(model: &Model, channel: Channel, interval_s: f64, window_s: f64) -> Result<Self, BeliefError> {
        let reduced = reduction::reduce(model.axis(channel), model.rate_hz, interval_s, window_s)
            .map_err(|source| BeliefError::Reduction { channel, source })?;
        let mut axis = Self { white: reduced.white.sigma2(), biases: vec![] };
        axis.push(reduced.bias.phi(), reduced.bias.sigma2(), reduced.initial_variance);
        Ok(axis)
    }

    fn push(&mut self, phi: f64, innovation: f64, initial: f64) {
        self.biases.push(BiasState { phi, innovation, initial });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two steps of half a sample and of one and a half are two whole ones: b_{k+1} = phi b_k + w twice.
    #[test]
    fn parts_of_a_sample_compose() {
        let phi = DVec3::new(0.9, 1.0, 0.0);
        let group = BiasGroup { phi, innovation: DVec3::new(0.2, 0.3, 0.4), initial: DVec3::ONE };
        let (a, b) = (group.over(0.5), group.over(1.5));
        for i in 0..2 {
            let (phi, q) = (a.phi[i] * b.phi[i], b.phi[i].powi(2) * a.innovation[i] + b.innovation[i]);
            let whole = (phi_squared(group.phi[i]), (1.0 + phi_squared(group.phi[i])) * group.innovation[i]);
            assert!((phi - whole.0).abs() < 1e-14 && (q - whole.1).abs() < 1e-14, "axis {i}");
        }
        assert_eq!((a.phi.z, a.innovation.z), (0.0, 0.4));
    }

    fn phi_squared(phi: f64) -> f64 {
        phi * phi
    }
}
