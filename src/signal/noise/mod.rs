//! Noise models: the type that calibration hands to navigation.
//!
//! A [`Process`] is one latent stochastic process; a [`Composite`] is the sum of processes that one axis
//! carries; a [`Model`] is the six axes of an IMU at a sample rate. Parameters are per sample at that rate.
//!
//! ```
//! use nav_sim_signal::noise::{Composite, Process, RandomWalk, White};
//!
//! let (white, walk) = (White::new(4e-6)?, RandomWalk::new(1e-12)?);
//! let axis = Composite::new(vec![Process::White(white), Process::RandomWalk(walk)]);
//! // At the scale tau = 2^10 samples: sigma2/tau + gamma2 (tau² + 2)/(12 tau).
//! let tau = 1024.0;
//! let expected = 4e-6 / tau + 1e-12 * (tau * tau + 2.0) / (12.0 * tau);
//! assert!((axis.haar_wv(10) / expected - 1.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod allan;
mod ar1;
pub mod continuous;
mod flicker_noise;
mod kind;
pub mod practical;
pub mod reduction;

pub mod contamination;
pub mod spread;
mod synthesis;
mod white;

pub use ar1::{Ar1, GaussMarkov, Ma1};
pub use flicker_noise::{Flicker, FlickerNoise, Ladder};
pub use kind::{Composite, Kind, Parameter, ParameterRef, labels};
pub use spread::{Law, ReplicateError, Spread, SpreadError, Variation, VirtualImu};
pub use synthesis::Synthesizer;
pub use white::{Drift, Quantization, RandomWalk, White};

use crate::imu::{Channel, Sensor};
use crate::units::Refused;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// A parameter outside its domain.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{process}: {parameter} = {value} is not {domain}")]
pub struct ParameterError {
    /// Process code, as in model files.
    pub process: &'static str,
    /// Parameter name, as in model files.
    pub parameter: &'static str,
    /// The value refused.
    pub value: f64,
    /// What would be accepted, in words.
    pub domain: &'static str,
}

impl From<ParameterError> for Refused {
    fn from(e: ParameterError) -> Self {
        Self(e.to_string())
    }
}

/// Accepts a value that the parameter of this name may take.
fn checked(kind: Kind, parameter: &'static str, value: f64) -> Result<f64, ParameterError> {
    let (is_inside, domain) = match parameter {
        "phi" => (value.abs() < 1.0, "between −1 and 1 (exclusive)"),
        "theta" => (value.abs() <= 1.0, "between −1 and 1"),
        "beta" | "rate_hz" => (value > 0.0, "a finite number > 0"),
        "slope" => (true, "a finite number"),
        _ => (value >= 0.0, "a finite number ≥ 0"),
    };
    if is_inside && value.is_finite() {
        return Ok(value);
    }
    Err(ParameterError {
        process: kind.code(),
        parameter,
        value,
        domain,
    })
}

/// One latent process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Process {
    /// White noise, "WN".
    White(White),
    /// Quantization noise, "QN".
    Quantization(Quantization),
    /// First-order autoregressive process, "AR1".
    Ar1(Ar1),
    /// Random walk, "RW".
    RandomWalk(RandomWalk),
    /// Deterministic drift (rate ramp), "DR".
    Drift(Drift),
    /// First-order Gauss-Markov process, "GM": an AR1 in other parameters.
    GaussMarkov(GaussMarkov),
    /// First-order moving average, "MA1".
    Ma1(Ma1),
    /// Flicker noise, "FN".
    Flicker(FlickerNoise),
}

/// As in model files: its code as `type`, and its parameters.
impl Serialize for Process {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let parameters = self.parameters();
        let mut map = to.serialize_map(Some(1 + parameters.len()))?;
        map.serialize_entry("type", self.code())?;
        parameters
            .iter()
            .try_for_each(|(name, value)| map.serialize_entry(name, value))?;
        map.end()
    }
}

impl Process {
    /// Its kind.
    pub const fn kind(&self) -> Kind {
        match self {
            Self::White(_) => Kind::White,
            Self::Quantization(_) => Kind::Quantization,
            Self::Ar1(_) => Kind::Ar1,
            Self::RandomWalk(_) => Kind::RandomWalk,
            Self::Drift(_) => Kind::Drift,
            Self::GaussMarkov(_) => Kind::GaussMarkov,
            Self::Ma1(_) => Kind::Ma1,
            Self::Flicker(_) => Kind::Flicker,
        }
    }

    /// The values of its parameters, in the order of [`Kind::parameters`].
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::White(p) => vec![p.sigma2()],
            Self::Quantization(p) => vec![p.q2()],
            Self::Ar1(p) => vec![p.phi(), p.sigma2()],
            Self::RandomWalk(p) => vec![p.gamma2()],
            Self::Drift(p) => vec![p.slope()],
            Self::GaussMarkov(p) => vec![p.beta(), p.s2()],
            Self::Ma1(p) => vec![p.theta(), p.sigma2()],
            Self::Flicker(p) => vec![p.b2()],
        }
    }

    /// Theoretical Haar wavelet variance (MODWT, scale tau = 2^level samples) of the process (units²);
    /// level ≥ 1. Half the Allan variance of averages over tau/2 samples
    /// ([Guerrier](crate::bibliography::Guerrier13), [Percival](crate::bibliography::Percival95)).
    pub fn haar_wv(&self, level: u32) -> f64 {
        let (amplitude, shape, _) = self.haar_parts(level);
        amplitude * shape
    }

    /// Derivatives of [`Self::haar_wv`] with respect to the parameters, in the order of
    /// [`Self::parameters`].
    pub fn haar_wv_gradient(&self, level: u32) -> Vec<f64> {
        let (amplitude, shape, slope) = self.haar_parts(level);
        match self {
            Self::Drift(p) => vec![2.0 * p.slope() * shape],
            _ if self.kind().shape().is_some() => vec![amplitude * slope, shape],
            _ => vec![shape],
        }
    }

    /// The amplitude in which the wavelet variance is linear, the variance per unit of it, and the derivative of that with
    /// respect to the shape.
    fn haar_parts(&self, level: u32) -> (f64, f64, f64) {
        let (amplitude, (shape, slope)) = match self {
            Self::White(p) => (p.sigma2(), (White::haar_shape(level), 0.0)),
            Self::Quantization(p) => (p.q2(), (Quantization::haar_shape(level), 0.0)),
            Self::RandomWalk(p) => (p.gamma2(), (RandomWalk::haar_shape(level), 0.0)),
            Self::Flicker(p) => (p.b2(), (FlickerNoise::haar_shape(level), 0.0)),
            Self::Drift(p) => (p.slope() * p.slope(), (Drift::haar_shape(level), 0.0)),
            Self::Ar1(p) => (p.sigma2(), Ar1::haar_shape(p.phi(), level)),
            Self::Ma1(p) => (p.sigma2(), Ma1::haar_shape(p.theta(), level)),
            Self::GaussMarkov(p) => {
                let (shape, slope) = GaussMarkov::haar_shape(p.beta() / p.rate_hz(), level);
                (p.s2(), (shape, slope / p.rate_hz()))
            }
        };
        (amplitude, shape, slope)
    }
}

/// The noise of an IMU: six axes, each a sum of processes, and the sample rate the parameters belong to.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// The six axes in the order of [`Channel::ALL`].
    pub axes: [Composite; 6],
}

impl Model {
    /// A model with the same noise on the three axes of each sensor.
    pub fn pooled(rate_hz: f64, accel: &Composite, gyro: &Composite) -> Self {
        let axes = Channel::ALL.map(|c| {
            if c.sensor == Sensor::Accel {
                accel.clone()
            } else {
                gyro.clone()
            }
        });
        Self { rate_hz, axes }
    }

    /// The noise of one axis.
    pub fn axis(&self, channel: Channel) -> &Composite {
        &self.axes[channel.index()]
    }
}
