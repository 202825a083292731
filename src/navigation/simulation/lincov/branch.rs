//! One outage at many places of a track, each alone: a pass with all fixes, from which each outage branches off.

use super::errors::Errors;
use super::input::Sources;
use super::joint::Joint;
use super::pass::Instant;
use super::sides::Sides;
use super::track::{Mark, Row, Step, Track};
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

/// The true errors of a filter in each of some outages along a track that has none: what a pass along a track with that
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
    let ways: Vec<Range<usize>> = outages
        .iter()
        .map(|outage| track.without_fixes(outage))
        .collect();
    let mut order: Vec<usize> = (0..ways.len()).collect();
    order.sort_by_key(|place| ways[*place].start);
    let believed = Sources::of_belief(belief);
    let sides = Sides::of_errors(&believed, &truth.inertial, track);
    let own = Sides::of_filter(believed, track);
    let mut pass = Pass::new(track, &own, &sides, truth);
    let goes_on = |row: &Row| !row.of_gnss;
    let mut found = vec![Vec::new(); ways.len()];
    let mut at = 0;
    for together in order.chunks(TOGETHER) {
        let mut begun = Vec::with_capacity(together.len());
        for place in together {
            let way = &ways[*place];
            for (steps, mark) in track.legs(at..way.start) {
                pass.follow(steps, mark);
                pass.measure(mark, |_| true);
            }
            at = at.max(way.start);
            begun.push((*place, pass.clone()));
        }
        let branch = |(place, mut pass): (usize, Pass<'_>)| {
            let (way, mut instants) = (&ways[place], Vec::new());
            // Without a measurement nobody asks for a gain: of the filter's own covariance nothing is needed then.
            let is_blind = !track.marks[way.clone()]
                .iter()
                .flat_map(|mark| &mark.rows)
                .any(goes_on);
            for (index, (steps, mark)) in way.clone().zip(track.legs(way.clone())) {
                if is_blind {
                    pass.errors.follow(steps, mark);
                } else {
                    pass.follow(steps, mark);
                }
                // Before the measurements, as the end of an outage in the runs: each report could be one.
                let is_end = index + 1 == way.end;
                let is_looked_at = is_end || moments == Moments::Reports && mark.report;
                instants.extend(is_looked_at.then(|| pass.errors.instant(mark)));
                if !is_end {
                    pass.measure(mark, goes_on);
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
            self.marks
                .iter()
                .position(|mark| mark.fix && is_wanted(mark.t_s))
        };
        let end = fix_where(&|t_s| outage.is_over(t_s)).unwrap_or(self.marks.len() - 1);
        // An outage between two fixes withholds none.
        fix_where(&|t_s| outage.withholds(t_s)).unwrap_or(end)..end + 1
    }
}

/// A filter's own covariance and its true errors, side by side.
#[derive(Clone)]
pub(super) struct Pass<'a> {
    pub(super) filter: Joint<'a>,
    pub(super) errors: Errors<'a>,
}

impl<'a> Pass<'a> {
    /// At the start of a track, of a filter's own states and those of its true errors.
    pub(super) fn new(
        track: &Track,
        own: &'a Sides,
        sides: &'a Sides,
        truth: &'a TruthSide,
    ) -> Self {
        Self {
            filter: Joint::new(track.start, own),
            errors: Errors::at_start(track, sides, truth),
        }
    }

    /// Over the steps that lead to a mark.
    pub(super) fn follow(&mut self, steps: &[Step], mark: &Mark) {
        steps.iter().for_each(|step| self.filter.step(step));
        self.errors.follow(steps, mark);
    }

    /// The measurements of a mark that are wanted.
    pub(super) fn measure(&mut self, mark: &Mark, is_wanted: impl Fn(&Row) -> bool) {
        for row in mark.rows.iter().filter(|row| is_wanted(row)) {
            let (gain, _) = self.filter.measure(row);
            self.errors.measure(row, &gain);
        }
    }
}
