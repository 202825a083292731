//! Noise models: the type that calibration hands to navigation.
//!
//! A [`Process`] is one latent stochastic process; a [`Composite`] is the sum of processes that one axis
//! carries; a [`Model`] is the six axes of an IMU at a sample rate. Parameters are per sample at that rate.
//!
//! ```
//! use nav_sim_signal::noise::{Composite, Process};
//!
//! let axis = Composite::new(vec![Process::white(4e-6)?, Process::random_walk(1e-12)?]);
//! // At the scale tau = 2^10 samples: sigma2/tau + gamma2 (tau² + 2)/(12 tau).
//! let tau = 1024.0;
//! let expected = 4e-6 / tau + 1e-12 * (tau * tau + 2.0) / (12.0 * tau);
//! assert!((axis.haar_wv(10) / expected - 1.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod ar1;
pub mod continuous;
mod flicker_noise;
pub mod practical;
mod process;
pub mod reduction;

pub mod contamination;
pub mod spread;
mod synthesis;

pub use flicker_noise::{Ar1Bank, Flicker};
pub use process::{
    Composite, Parameter, ParameterError, ParameterRef, Process, ProcessKind, labels,
};
pub use spread::{
    ParameterDistribution, ReplicateError, Spread, SpreadError, Variation, VirtualImu,
};
pub use synthesis::Synthesizer;

use crate::imu::{Channel, Sensor};

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
