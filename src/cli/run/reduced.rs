//! What the reduction of the model to 15 states does: said, stored, and warned of.

use crate::cli::{Failure, Session};
use nav_sim::ekf::Belief;
use nav_sim::metrics::{ReductionQuality, ReductionSummary};
use nav_sim::noise::Model;
use nav_sim::simulation::lincov::{Track, assess};

/// What a filter of 15 states was made for, and what it is assessed along.
pub(in crate::cli) struct Made<'a> {
    pub(in crate::cli) model: &'a Model,
    pub(in crate::cli) belief: &'a Belief,
    /// The filter with a state for every process, if the model has one.
    pub(in crate::cli) full: Option<Belief>,
    pub(in crate::cli) track: &'a Track,
    /// Time between fixes (s).
    pub(in crate::cli) interval_s: f64,
    /// Longest time scale (s).
    pub(in crate::cli) window_s: f64,
}

/// The reduction and its quality, the model taken for the truth: one covariance analysis of the reduced and of
/// the full filter.
pub(in crate::cli) fn reduction(made: &Made<'_>, session: &Session) -> Result<ReductionSummary, Failure> {
    let Made { model, belief, track, interval_s, window_s, .. } = *made;
    let mut summary =
        ReductionSummary::of(model, belief, interval_s, window_s).map_err(Failure::could_not)?;
    if summary.is_exact() {
        return Ok(summary);
    }
    summary.lines().iter().for_each(|line| session.printer.say(line));
    let full = made.full.as_ref().map(|full| assess(track, full, model));
    let quality = ReductionQuality::of(&assess(track, belief, model), full.as_ref());
    session.printer.say(&quality.line());
    if let Some(doubt) = quality.doubt() {
        let remedy = if full.is_some() { "; --filter full has a state for every process" } else { "" };
        session.printer.warn(&format!("{doubt}{remedy}"));
    }
    summary.quality = Some(quality);
    Ok(summary)
}
