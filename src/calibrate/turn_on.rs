//! What the means of recordings say of a turn-on bias, as JSON.

use super::turn_on_remark;
use nav_sim_calibration::{MeansOfAxis, TURN_ON_LEVEL, TurnOnSpread};
use serde::Serialize;

/// What the means of one sensor say, by the model of one estimator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TurnOnEntry {
    /// `accel` or `gyro`.
    pub sensor: &'static str,
    /// Whose model says what the noise makes.
    pub estimator: &'static str,
    /// `seen`, `within_noise`, `moved` or `removed`.
    pub finding: &'static str,
    /// What goes into `[turn_on]`: the standard deviations of x, y, z (m/s² or rad/s).
    pub sigmas: Option<[f64; 3]>,
    /// Root mean square over the axes of the spread of the means (m/s² or rad/s).
    pub spread: f64,
    /// The same of what the fitted noise alone would make.
    pub noise: f64,
    /// Relative standard error of the spread of an axis.
    pub relative_error: f64,
    /// Probability that the fitted noise makes means scatter as much.
    pub p_noise: f64,
    /// Probability that noise which moves the recordings as much as they move makes means scatter as much.
    pub p_drift: f64,
    /// Below it both have to be for a bias to be seen.
    pub level: f64,
    /// Axis by axis.
    pub axes: Vec<MeansOfAxis>,
    /// The same in words.
    pub remark: String,
}

impl TurnOnEntry {
    /// The entry of a sensor.
    pub(crate) fn new(found: &TurnOnSpread) -> Self {
        Self {
            sensor: found.sensor.name(),
            estimator: found.estimator.name(),
            finding: found.finding.name(),
            sigmas: found.sigmas(),
            spread: found.spread(),
            noise: found.noise(),
            relative_error: found.relative_error(),
            p_noise: found.p_noise,
            p_drift: found.p_drift,
            level: TURN_ON_LEVEL,
            axes: found.axes.clone(),
            remark: turn_on_remark(found),
        }
    }
}
