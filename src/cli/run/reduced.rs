//! What the reduction of the model to 15 states does: said, stored, and warned of.

use super::impossible;
use crate::cli::{Failure, Session};
use nav_sim::ekf::Belief;
use nav_sim::metrics::{ReductionQuality, ReductionSummary, TOLERANCE};
use nav_sim::noise::{Model, reduction};
use nav_sim::scenario::Scenario;
use nav_sim::simulation::{Experiment, Plan, covariance_pass};

/// The reduction and its quality, found by one covariance pass of the reduced and of the full filter along
/// the trajectory; none for the full filter.
pub(super) fn reduction(
    scenario: &Scenario,
    model: &Model,
    belief: &Belief,
    experiment: &Experiment<'_>,
    session: &Session,
) -> Result<Option<ReductionSummary>, Failure> {
    if !scenario.filter.states.is_reduced() {
        return Ok(None);
    }
    let longest = experiment.outages.iter().map(|o| o.end_s - o.start_s).fold(0.0, f64::max);
    let (interval_s, window_s) = (1.0 / scenario.gnss.rate_hz, reduction::window_s(longest));
    let mut summary = ReductionSummary::of(model, interval_s, window_s).map_err(Failure::input)?;
    if summary.is_exact() {
        return Ok(Some(summary));
    }
    summary.lines().iter().for_each(|line| session.printer.say(line));
    let Ok(full) = scenario.with_full_noise().belief(model, experiment.outages) else {
        session.printer.say("the model has no full filter to compare the reduction with");
        return Ok(Some(summary));
    };
    let plan = Plan::new(experiment).map_err(impossible)?;
    let quality = ReductionQuality::of(&covariance_pass(&plan, belief), &covariance_pass(&plan, &full));
    summary.quality = Some(quality);
    if let Some(worst) = summary.worst_position().filter(|worst| *worst > TOLERANCE) {
        session.printer.warn(&format!(
            "the reduction to 15 states is off by {:.0} % in the standard deviation of position at the end of an outage; \
             --filter full has a state for every process",
            100.0 * worst
        ));
    }
    Ok(Some(summary))
}
