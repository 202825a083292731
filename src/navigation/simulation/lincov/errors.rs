//! The true errors of a filter as they are taken along a track.

use super::joint::{Gain, Joint, add_scaled};
use super::mean::Mean;
use super::pass::{Instant, Judged};
use super::sides::Sides;
use super::track::{Mark, NAV, Nav, Row, Step, Track};
use super::truth::TruthSide;

/// The true errors at an instant.
#[derive(Clone)]
pub(super) struct Errors<'a> {
    truth: &'a TruthSide,
    pub(super) joint: Joint<'a>,
    mean: Option<Mean<'a>>,
}

impl<'a> Errors<'a> {
    /// Those of the start.
    pub(super) fn at_start(track: &Track, sides: &'a Sides, truth: &'a TruthSide) -> Self {
        let begin = if truth.starts_off {
            track.start
        } else {
            [[0.0; NAV]; NAV]
        };
        // A mean is rare (drifts, a strapdown too slow for the motion): without one its propagation is spared.
        let drifts = sides.t.states.iter().any(|s| s.level != 0.0);
        let is_off = truth.integrates && !track.is_closed();
        let mean = (drifts || is_off).then(|| Mean::new(sides));
        Self {
            truth,
            joint: Joint::new(begin, sides),
            mean,
        }
    }

    /// Over the steps that lead to a mark.
    pub(super) fn follow(&mut self, steps: &[Step], mark: &Mark) {
        for step in steps {
            self.joint.step(step);
            self.mean.iter_mut().for_each(|mean| mean.step(step));
        }
        if self.truth.integrates {
            self.mean
                .iter_mut()
                .for_each(|mean| add_scaled(&mut mean.values.x, 1.0, &mark.closure));
        }
    }

    /// Corrects by a measurement with the filter's gain; returns the expected square of the innovation.
    pub(super) fn measure(&mut self, row: &Row, gain: &Gain) -> f64 {
        // Without its noise where the source under study is another one: covariances of independent sources
        // add.
        let measured = self.joint.measured(row);
        let y = self.joint.innovation(
            &measured,
            if self.truth.has_noise(row.what) {
                row.noise
            } else {
                0.0
            },
        );
        let mean = self
            .mean
            .as_ref()
            .map_or(0.0, |mean| measured.dot(&mean.values));
        self.joint.correct(&y, gain);
        self.mean.iter_mut().for_each(|m| m.correct(mean, gain));
        y.s + mean * mean
    }

    pub(super) fn judged(&self, mark: &Mark, believed: &[Nav; NAV]) -> Judged {
        Judged {
            errors: self.instant(mark),
            believed: *believed,
        }
    }

    pub(super) fn instant(&self, mark: &Mark) -> Instant {
        Instant {
            after_s: mark.after_s,
            t_s: mark.t_s,
            measured: !mark.rows.is_empty(),
            fix: mark.fix,
            covariance: self.joint.xx,
            mean: self.mean.as_ref().map_or([0.0; NAV], |mean| mean.values.x),
            jacobian: mark.jacobian,
        }
    }
}
