//! What the reduction of a model to 15 states does.

use crate::app::Context;
use crate::report::{reduction_doubt, reduction_line};
use nav_sim_navigation::ekf::Belief;
use nav_sim_navigation::metrics::{ReductionQuality, ReductionSummary};
use nav_sim_navigation::simulation::lincov::{Track, assess};
use nav_sim_signal::noise::{Model, ParameterError};

/// What a filter of 15 states was made for, and what it is assessed along.
#[derive(Debug)]
#[non_exhaustive]
pub(crate) struct Reduced<'a> {
    /// The model that was reduced.
    pub model: &'a Model,
    /// The filter.
    pub belief: &'a Belief,
    /// The filter with a state for every process, if the model has one.
    pub full: Option<Belief>,
    /// What both are assessed along.
    pub track: &'a Track,
    /// Time between fixes (s).
    pub interval_s: f64,
    /// Longest time scale (s).
    pub window_s: f64,
}

impl Reduced<'_> {
    /// The reduction and its quality, the model taken for the truth: one covariance analysis of the reduced and of
    /// the full filter.
    ///
    /// # Errors
    /// When a parameter of the belief is outside its domain.
    pub(crate) fn summary(
        &self,
        context: &Context<'_>,
    ) -> Result<ReductionSummary, ParameterError> {
        let Self {
            model,
            belief,
            track,
            interval_s,
            window_s,
            ..
        } = *self;
        let mut summary = ReductionSummary::of(model, belief, interval_s, window_s)?;
        if summary.is_exact() {
            return Ok(summary);
        }
        let full = self.full.as_ref().map(|full| assess(track, full, model));
        let quality = ReductionQuality::of(&assess(track, belief, model), full.as_ref());
        context.remark(reduction_line(&quality));
        reduction_doubt(&quality)
            .iter()
            .for_each(|doubt| context.warn(doubt));
        summary.quality = Some(quality);
        Ok(summary)
    }
}
