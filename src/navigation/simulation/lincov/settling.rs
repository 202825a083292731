//! What a filter comes to state while its attitude settles, on average over runs.
//!
//! A filter linearises about the specific force that it takes, which is off by δf ([`super::force_errors`]). While the vehicle stands, that shows
//! it a horizontal acceleration that is not there, and from the response of the velocity it believes to learn its heading. The filters
//! of runs therefore state less of the heading than the one along the reference, where δf is 0. That is even in δf: its mean to second order
//! is that over functions of time whose products have the mean of those of δf, each to either side.

use super::force_errors::paths;
use super::input::Sources;
use super::joint::Joint;
use super::pass::deviations;
use super::sides::Sides;
use super::track::{Step, Track};
use super::truth::TruthSide;
use crate::ekf::Belief;
use crate::ekf::covariance::{PSI, V};
use crate::sensors::outage::Outage;
use crate::simulation::REPORTED;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// The times for which errors of the specific force are followed (s): the first by whose end the attitude has settled, or the last.
const WINDOWS_S: [f64; 4] = [120.0, 240.0, 480.0, 960.0];
/// Functions of time: with 8, 16 and 32 of them the standard deviation of the heading comes within 0.81, 0.32 and 0.14 % of that of 300 runs after two
/// minutes at rest, where gyroscopes and accelerometers have four times the white noise that the filter believes in.
const PATHS: usize = 16;
/// A change of a variance, as a share of it, that is none.
const NOTHING: f64 = 1e-3;
/// Standard deviation of the heading (degrees) from which on little more is believed to be learned of it: what is, per time and as a share, goes with
/// its square.
const KNOWN_DEG: f64 = 0.5;
/// Marks until it is looked at again whether anything changes.
const MARKS: usize = 30;

/// Yaw among the reported states.
const YAW: usize = 8;

/// Variances of the reported states (m², (m/s)², degrees²), or what is added to them.
type Variances = [f64; REPORTED];

/// By how much filters state more than the one along the reference, on average over the runs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Settling {
    /// At the reports from the start on; nothing is added at those that are left.
    pub(crate) reports: Vec<Variances>,
    /// Just before the first fix after each outage.
    pub(crate) outage_ends: Vec<Variances>,
}

/// What the errors of the specific force do that come before the first outage; [`super::vertical_second_order`] has what they do in outages.
pub(crate) fn stated_while_settling(
    track: &Track,
    belief: &Belief,
    truth: &TruthSide,
    outages: &[Outage],
) -> Settling {
    // What is small itself needs no steps finer than a second; the marks stay.
    let track = &track.merged();
    let own = Sides::of_filter(Sources::of_belief(belief), track);
    let outage_s = outages.iter().map(|outage| outage.start_s).fold(f64::INFINITY, f64::min);
    let aided = track.marks.iter().take_while(|mark| mark.t_s < outage_s).count();
    let mut found = Settling { reports: Vec::new(), outage_ends: vec![[0.0; REPORTED]; track.outages] };
    for window_s in WINDOWS_S {
        let marks = track.marks[..aided].iter().take_while(|mark| mark.after_s < window_s).count();
        let paths = paths(track, belief, truth, marks, PATHS);
        if paths.is_empty() {
            break;
        }
        let has_settled = found.average(track, &own, &paths, marks);
        if has_settled || marks == aided {
            break;
        }
    }
    found
}

/// A filter that takes a wrong specific force, and the variances that it states.
struct Filter<'a> {
    joint: Joint<'a>,
    /// The error (m/s for a sample) by legs; afterwards there is none.
    force: Vec<DVec3>,
    reports: Vec<Variances>,
    outage_ends: Vec<(usize, Variances)>,
}

impl Settling {
    /// The average over filters whose specific force is off by `paths` over the legs to the first `marks` marks, followed until nothing is left of
    /// it; whether that is so at the end of the paths, and the heading known.
    fn average(&mut self, track: &Track, own: &Sides, paths: &[Vec<DVec3>], marks: usize) -> bool {
        let filter = |force| Filter::at_start(Joint::new(track.start, own), force);
        let mut along = filter(Vec::new());
        let to_either_side = paths.iter().flat_map(|path| [path.clone(), path.iter().map(|e| -e).collect()]);
        let mut off: Vec<Filter<'_>> = to_either_side.map(filter).collect();
        self.reports.clear();
        let (mut done, mut until) = (0, marks);
        loop {
            along.follow(track, done..until);
            off.par_iter_mut().for_each(|filter| filter.follow(track, done..until));
            let mean_less = |stated: &dyn Fn(&Filter<'_>) -> Variances| -> Variances {
                let (all, reference) = (off.iter().map(stated).collect::<Vec<_>>(), stated(&along));
                let mean = |i: usize| all.iter().map(|stated| stated[i]).sum::<f64>() / all.len() as f64;
                std::array::from_fn(|i| mean(i) - reference[i])
            };
            let reports = self.reports.len()..along.reports.len();
            self.reports.extend(reports.map(|report| mean_less(&|filter| filter.reports[report])));
            for (at, (outage, _)) in along.outage_ends.iter().enumerate() {
                self.outage_ends[*outage] = mean_less(&|filter| filter.outage_ends[at].1);
            }
            let last = self.reports.iter().zip(&along.reports).next_back();
            let is_nothing = last
                .is_none_or(|(more, stated)| more.iter().zip(stated).all(|(m, s)| m.abs() <= NOTHING * s));
            if is_nothing || until == track.marks.len() {
                let is_known = along.reports.last().is_none_or(|stated| stated[YAW] < KNOWN_DEG * KNOWN_DEG);
                return is_nothing && is_known && until == marks;
            }
            (done, until) = (until, (until + MARKS).min(track.marks.len()));
        }
    }
}

impl<'a> Filter<'a> {
    fn at_start(joint: Joint<'a>, force: Vec<DVec3>) -> Self {
        Self { joint, force, reports: Vec::new(), outage_ends: Vec::new() }
    }

    fn follow(&mut self, track: &Track, marks: Range<usize>) {
        let variances = |jacobian: &[DVec3; 3], joint: &Joint<'_>| {
            deviations(jacobian, &joint.xx).map(|sigma| sigma * sigma)
        };
        for (leg, (steps, mark)) in marks.clone().zip(track.legs(marks)) {
            for step in steps {
                match self.force.get(leg) {
                    Some(error) => self.joint.step(&step.with_force(f64::from(step.samples) * *error)),
                    None => self.joint.step(step),
                }
            }
            // Before the measurements of the same instant, as the runs have it.
            let ends = mark.outages.iter().map(|outage| (*outage, variances(&mark.jacobian, &self.joint)));
            self.outage_ends.extend(ends);
            mark.rows.iter().for_each(|row| _ = self.joint.measure(row));
            if mark.report {
                self.reports.push(variances(&mark.jacobian, &self.joint));
            }
        }
    }
}

impl Step {
    /// The same as a filter has it that takes `more` for the integral of the specific force over the step (m/s, in n).
    fn with_force(&self, more: DVec3) -> Self {
        let mut step = self.clone();
        // The velocity's response to an attitude error e is e × ∫ f dt.
        for (column, axis) in DVec3::AXES.into_iter().enumerate() {
            for (row, velocity) in axis.cross(more).to_array().into_iter().enumerate() {
                step.m[3 * PSI + column][3 * V + row] += velocity;
            }
        }
        step
    }
}
