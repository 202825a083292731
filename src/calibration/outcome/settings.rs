//! What is asked of a calibration.

use crate::curve::{Estimator, Scope, Trim};
use crate::fit::Weighting;
use crate::imu::{Axis, Sensor};
use crate::model::{LimitError, ModelSpec};
use crate::wavelet::Tuning;

/// How to calibrate.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Which curves to fit.
    pub estimators: Vec<Estimator>,
    /// What the model is made of.
    pub model: ModelChoice,
    /// Where its parameters may be, the more special after the more general.
    pub limits: Vec<ParameterLimit>,
    /// What DR-AWV drops.
    pub trim: Trim,
    /// The tuning the robust wavelet variances were made with.
    pub tuning: Tuning,
    /// What a scale counts.
    pub weighting: Weighting,
    /// Sample rate (Hz).
    pub rate_hz: f64,
}

/// Who says what the model is made of.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelChoice {
    /// The user.
    Given(ModelSpec),
    /// The curves.
    Auto,
}

impl std::fmt::Display for ModelChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given(spec) => spec.fmt(f),
            Self::Auto => f.write_str("auto"),
        }
    }
}

/// Where one parameter may be.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterLimit {
    /// The sensor, or both.
    pub sensor: Option<Sensor>,
    /// The axis, or all.
    pub axis: Option<Axis>,
    /// Label of the process.
    pub process: String,
    /// Name of the parameter.
    pub parameter: String,
    /// Lower bound (units of the parameter).
    pub low: Option<f64>,
    /// Upper bound (units of the parameter).
    pub high: Option<f64>,
}

impl Settings {
    /// A model with the limits of what it is for.
    pub(crate) fn limited(&self, spec: &ModelSpec, scope: Scope) -> Result<ModelSpec, LimitError> {
        let mut spec = spec.clone();
        for l in &self.limits {
            let meant = l.sensor.is_none_or(|s| s == scope.sensor)
                && l.axis.is_none_or(|axis| scope.axis == Some(axis));
            if meant {
                spec.limit(&l.process, &l.parameter, l.low, l.high)?;
            }
        }
        Ok(spec)
    }
}
