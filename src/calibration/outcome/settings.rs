//! Settings of a calibration.

use crate::curve::{Estimator, Pool, Trim};
use crate::fit::Weighting;
use crate::model::{ModelSpec, SpecError};
use crate::wavelet::Tuning;
use std::str::FromStr;

/// Settings of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The curves to fit.
    pub estimators: Vec<Estimator>,
    /// Choice of the model.
    pub model: ModelChoice,
    /// Replicates that DR-AWV drops.
    pub trim: Trim,
    /// The tuning the robust wavelet variances were made with.
    pub tuning: Tuning,
    /// Weights of the scales.
    pub weighting: Weighting,
    /// The scales that count (s); none: all.
    pub fit_range: Option<FitRange>,
    /// Sample rate (Hz).
    pub rate_hz: f64,
}

/// Scales that count in a fit, both ends included (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitRange {
    /// Shortest (s).
    pub from_s: f64,
    /// Longest (s).
    pub to_s: f64,
}

impl FitRange {
    /// Whether a level counts at a rate (Hz); ends may be off by rounding.
    pub(crate) fn holds(&self, level: u32, rate_hz: f64) -> bool {
        let scale_s = f64::from(level).exp2() / rate_hz;
        scale_s >= self.from_s * (1.0 - 1e-9) && scale_s <= self.to_s * (1.0 + 1e-9)
    }
}

/// Who says what the model is made of.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelChoice {
    /// The user.
    Given(ModelSpec),
    /// The curves.
    Auto,
}

impl Default for ModelChoice {
    fn default() -> Self {
        Self::Given(ModelSpec::n2())
    }
}

impl FromStr for ModelChoice {
    type Err = SpecError;

    /// "auto", or a sum of processes.
    fn from_str(text: &str) -> Result<Self, SpecError> {
        if text.eq_ignore_ascii_case("auto") {
            Ok(Self::Auto)
        } else {
            text.parse().map(Self::Given)
        }
    }
}

/// Is told how many more steps of a long computation are done, from any thread.
pub type Advance<'a> = &'a (dyn Fn(u64) + Sync);

impl ModelChoice {
    /// Stages of a choice.
    pub(crate) const STAGES: u64 = 3;

    /// Number of steps of a fit, in which a draw of the bootstrap is one.
    #[must_use]
    pub const fn steps(&self) -> u64 {
        match self {
            Self::Given(_) => 10,
            // dozens of candidates, each fitted to as many draws
            Self::Auto => Self::STAGES * 300,
        }
    }

    /// Parameters that are to be found, at least.
    #[must_use]
    pub fn parameters(&self) -> usize {
        match self {
            Self::Given(spec) => spec.parameters(),
            Self::Auto => 2,
        }
    }
}

impl std::fmt::Display for ModelChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given(spec) => spec.fmt(f),
            Self::Auto => f.write_str("auto"),
        }
    }
}

impl Default for Settings {
    /// Settings that suit most recordings: DR-AWV, N2. At 1 Hz, until a rate is known.
    fn default() -> Self {
        Self {
            estimators: vec![Estimator::default()],
            model: ModelChoice::default(),
            trim: Trim::default(),
            tuning: Tuning::default(),
            weighting: Weighting::default(),
            fit_range: None,
            rate_hz: 1.0,
        }
    }
}

impl Settings {
    /// Signals that the estimators take as replicates of one another, unless told otherwise: those of single
    /// recordings pool nothing.
    #[must_use]
    pub fn pool(&self) -> Pool {
        if self.estimators.iter().any(|e| e.is_single()) {
            Pool::Axes
        } else {
            Pool::Sensor
        }
    }
}
