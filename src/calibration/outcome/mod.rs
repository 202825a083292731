//! Settings and results of a calibration: data that estimation, tests and words share.

mod departure;
mod inference;
mod note;
mod ranking;
mod settings;

pub use departure::{Departure, Misfit, Miss};
pub use inference::{
    AxesDiffer, Bootstrap, Goodness, Indistinct, Inference, LevelSpread, ParameterInterval,
    ParameterSpread, Practical, PracticalIntervals, Undetermined,
};
pub use note::{Note, Share, shares};
pub use ranking::{Candidate, Ranking, TooSimple};
pub use settings::{Advance, FitRange, ModelChoice, Settings};

use crate::curve::{Estimator, Scope};
use crate::fit::{Fit, FitError, avlr, refit};
use crate::model::ModelSpec;
use crate::noise::{Composite, Model, ParameterRef};
use crate::wavelet::Curve;

/// The noise model of outcomes, at a rate (Hz); axes of none have no noise.
pub fn model_of<'a>(outcomes: impl IntoIterator<Item = &'a Outcome>, rate_hz: f64) -> Model {
    let mut model = Model {
        rate_hz,
        axes: Default::default(),
    };
    outcomes
        .into_iter()
        .for_each(|outcome| outcome.put_into(&mut model));
    model
}

/// Scale of a level (s).
#[must_use]
pub fn tau_s(level: u32, rate_hz: f64) -> f64 {
    f64::from(level).exp2() / rate_hz
}

/// Gives noise to the axes of a model.
pub fn put(composite: &Composite, scope: Scope, model: &mut Model) {
    for channel in scope.channels() {
        model.axes[channel.index()] = composite.clone();
    }
}

/// One fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Scope of the model: an axis of a sensor, or all its axes.
    pub scope: Scope,
    /// Replicates averaged; 0 for a curve from elsewhere.
    pub replicates: usize,
    /// Recordings that these are of.
    pub recordings: usize,
    /// The estimator.
    pub estimator: Estimator,
    /// Specification of the model.
    pub spec: ModelSpec,
    /// Ranking by which the specification was chosen, if it was.
    pub ranking: Option<Ranking>,
    /// The curve that was fitted.
    pub curve: Curve,
    /// The model.
    pub fit: Fit,
    /// Difference of the pooled axes, where there is one.
    pub axes_differ: Option<AxesDiffer>,
    /// Intervals of its parameters and goodness of fit, once [`infer`](crate::infer) was asked for them.
    pub inference: Option<Inference>,
}

impl Outcome {
    /// Gives its noise to the axes of a model that it is for.
    pub fn put_into(&self, model: &mut Model) {
        put(&self.fit.composite, self.scope, model);
    }

    /// Whether a parameter follows the curve: its process has an amplitude, and it is not at the end of the search.
    pub(crate) fn moves(&self, of: ParameterRef) -> bool {
        let at_end = self.fit.at_end.contains(&of.process) && of.parameter.is_shape();
        !(self.fit.zero.contains(&of.process) || at_end)
    }

    /// The fit to a curve that resembles this one.
    pub(crate) fn estimate_again(
        &self,
        curve: &Curve,
        settings: &Settings,
    ) -> Result<Fit, FitError> {
        match self.estimator {
            Estimator::Avlr => avlr(curve, &self.spec),
            _ => refit(
                curve,
                &self.spec,
                settings.rate_hz,
                settings.weighting,
                &self.fit,
            ),
        }
    }
}
