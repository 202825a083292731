//! What the calibration of a model leaves open in the figures of a covariance analysis.
//!
//! Every draw of the calibration ([`draws_file`](crate::formats::draws_file)) goes through the analysis as the model
//! itself did, and a figure has the interval that its draws give, as a parameter has ([`derived_interval`]).
//!
//! Two questions, two kinds of draws. What the filter's errors will be is open by the calibration of what *makes* them:
//! the filter that was made is kept, and the draws are truths. What the filter states is open by the calibration of what
//! it *believes*: each draw has the filter that knows it, with a state for each process, since the reduction to 15 states
//! would have to be found anew for each; the interval is carried over as a ratio.

use crate::formats::draws_file::Draws;
use nav_sim_calibration::derived_interval;
use nav_sim_navigation::ekf::Belief;
use nav_sim_navigation::metrics::{OutageSummary, PerState, horizontal_quantiles};
use nav_sim_navigation::simulation::Experiment;
use nav_sim_navigation::simulation::lincov::{FilterPass, Instant, Track, TruthSide};
use nav_sim_signal::noise::Model;
use rayon::prelude::*;

/// A covariance analysis that was made.
pub(super) struct Analysed<'a> {
    pub(super) experiment: &'a Experiment<'a>,
    pub(super) track: &'a Track,
    pub(super) belief: &'a Belief,
}

/// Figures at the end of an outage.
type Figures = Vec<f64>;

/// Probabilities of the quantiles of the horizontal error.
const QUANTILES: [f64; 2] = [0.5, 0.95];

impl Analysed<'_> {
    /// Puts the intervals of RMSE and of the quantiles of the horizontal error into the outages.
    pub(super) fn errors(&self, truth: &Model, draws: &Draws, outages: &mut [OutageSummary]) {
        let track = self.track.coarse();
        let filter = FilterPass::new(&track, self.belief);
        let figures = |model: &Model| -> Vec<Figures> {
            let truth = TruthSide::together(&TruthSide::sources(self.experiment, model));
            let ends = filter.errors_at_ends(&truth);
            let figures =
                |end: &Instant| [&end.rmse()[..], &horizontal_quantiles(end, QUANTILES)].concat();
            ends.iter().map(|end| figures(&end.errors)).collect()
        };
        for (outage, interval) in outages.iter_mut().zip(intervals(truth, draws, &figures)) {
            let rmse = outage.rmse_end.0;
            outage.rmse_end_ci95 = Some(PerState(std::array::from_fn(|i| {
                interval.about(i, rmse[i])
            })));
            let h = &mut outage.horizontal_error_end_m;
            let ends = |(low, high): (f64, f64)| (Some(low), Some(high));
            h.p50_ci95 = ends(interval.about(rmse.len(), h.p50));
            h.p95_ci95 = ends(interval.about(rmse.len() + 1, h.p95));
        }
    }

    /// Puts the intervals of the ASEE into the outages; `full` makes the filter that knows a model. None are put where a
    /// model has no such filter.
    pub(super) fn beliefs(
        &self,
        model: &Model,
        draws: &Draws,
        full: &(dyn Fn(&Model) -> Option<Belief> + Sync),
        outages: &mut [OutageSummary],
    ) {
        let track = self.track.merged();
        let figures = |model: &Model| -> Vec<Figures> {
            let Some(belief) = full(model) else {
                return Vec::new();
            };
            let filter = FilterPass::new(&track, &belief);
            let means = filter.sigma_means(self.experiment.outages);
            filter
                .sigma_at_ends()
                .iter()
                .zip(means)
                .map(|(end, mean)| [&end[..], &mean].concat())
                .collect()
        };
        for (outage, interval) in outages.iter_mut().zip(intervals(model, draws, &figures)) {
            let (end, mean) = (outage.asee_end.0, outage.asee_mean.0);
            outage.asee_end_ci95 =
                Some(PerState(std::array::from_fn(|i| interval.about(i, end[i]))));
            let of_mean = PerState(std::array::from_fn(|i| {
                interval.about(end.len() + i, mean[i])
            }));
            // An outage between two reports has no mean.
            outage.asee_mean_ci95 = Some(of_mean).filter(|_| mean.iter().all(|x| x.is_finite()));
        }
    }
}

/// The figures of one outage: of the estimate, and of each draw.
struct Drawn {
    estimate: Figures,
    draws: Vec<Figures>,
    stretch: f64,
}

impl Drawn {
    /// The interval of a figure, whose ends over the estimate are carried over to its value.
    fn about(&self, figure: usize, value: f64) -> (f64, f64) {
        let estimate = self.estimate[figure];
        let drawn = self.draws.iter().map(|draw| draw[figure]).collect();
        let [low, high] = derived_interval(estimate, drawn, self.stretch);
        (value * (low / estimate), value * (high / estimate))
    }
}

/// What the draws give beside the estimate, outage by outage.
fn intervals(
    estimate: &Model,
    draws: &Draws,
    figures: &(dyn Fn(&Model) -> Vec<Figures> + Sync),
) -> Vec<Drawn> {
    let of_draws: Vec<Vec<Figures>> = draws.models.par_iter().map(figures).collect();
    let of_outage = |(k, estimate): (usize, Figures)| Drawn {
        estimate,
        draws: of_draws
            .iter()
            .filter_map(|ends| ends.get(k).cloned())
            .collect(),
        stretch: draws.stretch,
    };
    figures(estimate)
        .into_iter()
        .enumerate()
        .map(of_outage)
        .collect()
}
