//! One outage at many places of a track, each alone: a pass with all fixes, from which each outage branches off.

use super::errors::{Errors, StepInputs};
use super::input::Sources;
use super::joint::Joint;
use super::pass::Instant;
use super::track::{Mark, Measured, Row, Track};
use super::truth::TruthSide;
use crate::ekf::Belief;
use crate::sensors::outage::Outage;
use rayon::prelude::*;
use std::ops::Range;

/// Branches that are followed at a time: what they begin from is kept until then.
const TOGETHER: usize = 256;

/// Which moments of an outage are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Moments {
    /// Its end: just before the first fix after it, or at the end of the track.
    End,
    /// Every report within it, and its end.
    Reports,
}

/// The errors of a filter in each of some outages along a track that has none: what a pass along a track with that
/// outage alone finds, at the cost of the outage instead of the way from the start.
///
/// The outages may overlap: no branch knows of another.
#[must_use]
pub(crate) fn errors_in_outages(
    track: &Track,
    belief: &Belief,
    truth: &TruthSide,
    outages: &[Outage],
    moments: Moments,
) -> Vec<Vec<Instant>> {
    let ways: Vec<Range<usize>> = outages.iter().map(|outage| track.without_fixes(outage)).collect();
    let mut order: Vec<usize> = (0..ways.len()).collect();
    order.sort_by_key(|place| ways[*place].start);
    let (filter_sources, none) = (Sources::of_belief(belief), Sources::default());
    let estimates = filter_sources.estimates();
    let mut filter_inputs = StepInputs::new(&filter_sources, &none);
    let mut true_inputs = StepInputs::new(&estimates, &truth.inertial);
    let mut pass = Pass::new(track, truth, &filter_sources, &estimates);
    let mut found = vec![Vec::new(); ways.len()];
    let mut at = 0;
    for together in order.chunks(TOGETHER) {
        let mut begun = Vec::with_capacity(together.len());
        for place in together {
            let way = &ways[*place];
            for mark in at..way.start {
                pass.follow(mark, &mut filter_inputs, &mut true_inputs);
                pass.measure(&track.marks[mark], |_| true);
            }
            at = at.max(way.start);
            begun.push((*place, pass.clone()));
        }
        let branch = |(place, mut pass): (usize, Pass<'_>)| {
            // Each branch for itself: the steps of a few lengths are made anew in a moment.
            let mut filter_inputs = StepInputs::new(&filter_sources, &none);
            let mut true_inputs = StepInputs::new(&estimates, &truth.inertial);
            let mut instants = Vec::new();
            for mark in ways[place].clone() {
                pass.follow(mark, &mut filter_inputs, &mut true_inputs);
                let (last, mark) = (mark + 1 == ways[place].end, &track.marks[mark]);
                // The end is looked at before its measurements, a report after them, as in the runs.
                if last {
                    instants.push(pass.instant(mark));
                } else {
                    pass.measure(mark, |row| row.what == Measured::Height);
                    instants.extend((moments == Moments::Reports && mark.report).then(|| pass.instant(mark)));
                }
            }
            (place, instants)
        };
        for (place, instants) in begun.into_par_iter().map(branch).collect::<Vec<_>>() {
            found[place] = instants;
        }
    }
    found
}

impl Track {
    /// The marks from the first whose fix an outage withholds to that of its end.
    fn without_fixes(&self, outage: &Outage) -> Range<usize> {
        let fix_where = |is_wanted: &dyn Fn(f64) -> bool| {
            self.marks.iter().position(|mark| mark.fix && is_wanted(mark.t_s))
        };
        let end = fix_where(&|t_s| outage.is_over(t_s)).unwrap_or(self.marks.len() - 1);
        // An outage between two fixes withholds none.
        fix_where(&|t_s| outage.withholds(t_s)).unwrap_or(end)..end + 1
    }
}

/// A filter's own covariance and its true errors, side by side.
#[derive(Clone)]
struct Pass<'a> {
    track: &'a Track,
    truth: &'a TruthSide,
    filter: Joint,
    errors: Errors,
}

impl<'a> Pass<'a> {
    fn new(track: &'a Track, truth: &'a TruthSide, filter: &Sources, estimates: &Sources) -> Self {
        let filter = Joint::new(track.start, filter, &Sources::default());
        Self { track, truth, filter, errors: Errors::at_start(track, estimates, truth) }
    }

    /// Over the steps that lead to a mark.
    fn follow(&mut self, mark: usize, filter: &mut StepInputs<'_>, truth: &mut StepInputs<'_>) {
        let begin = mark.checked_sub(1).map_or(0, |before| self.track.marks[before].steps);
        for step in &self.track.steps[begin..self.track.marks[mark].steps] {
            self.filter.step(step, filter.over(step.samples));
            self.errors.step(step, truth.over(step.samples));
        }
    }

    /// The measurements of a mark that are wanted.
    fn measure(&mut self, mark: &Mark, is_used: impl Fn(&Row) -> bool) {
        for row in mark.rows.iter().filter(|row| is_used(row)) {
            let expected = self.filter.innovation(row, row.r);
            let gain = expected.gain();
            self.filter.correct(&expected, &gain);
            self.errors.measure(row, self.truth, &gain);
        }
    }

    fn instant(&self, mark: &Mark) -> Instant {
        self.errors.instant(mark, &self.filter.xx)
    }
}
