//! What is asked of a calibration, and what comes of it: data that estimation, tests and words share.

mod departure;
mod inference;
mod ranking;
mod settings;

pub use departure::{Departure, Miss};
pub use inference::{
    AxesDiffer, Bootstrap, Goodness, Indistinct, Inference, LevelSpread, ParameterInterval, Practical,
    PracticalIntervals, Undetermined,
};
pub use ranking::{Candidate, Ranking, TooSimple};
pub use settings::{FitRange, ModelChoice, ParameterLimit, Settings};

use crate::curve::{Estimator, Scope};
use crate::fit::{Fit, FitError, estimate_again};
use crate::model::ModelSpec;
use crate::wavelet::Curve;

/// One fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// What it is for: an axis of a sensor, or all its axes.
    pub scope: Scope,
    /// Replicates averaged; 0 for a curve from elsewhere.
    pub replicates: usize,
    /// Recordings that these are of.
    pub recordings: usize,
    /// The estimator.
    pub estimator: Estimator,
    /// What the model is made of.
    pub spec: ModelSpec,
    /// How that was chosen, if it was.
    pub ranking: Option<Ranking>,
    /// The curve that was fitted.
    pub curve: Curve,
    /// The model.
    pub fit: Fit,
    /// How the axes that are pooled differ, where they do.
    pub axes_differ: Option<AxesDiffer>,
    /// Remarks, in words.
    pub notes: Vec<String>,
    /// Intervals of its parameters and goodness of fit, once [`infer`](crate::infer) was asked for them.
    pub inference: Option<Inference>,
}

impl Outcome {
    /// The fit to a curve that resembles this one.
    pub(crate) fn estimate_again(&self, curve: &Curve, settings: &Settings) -> Result<Fit, FitError> {
        estimate_again(self.estimator, curve, &self.spec, settings.rate_hz, settings.weighting, &self.fit)
    }
}
