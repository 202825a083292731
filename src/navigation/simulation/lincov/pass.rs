//! One filter and one truth along a track.

use super::input::{SIGNALS, Sources};
use super::joint::{Inputs, Joint};
use super::track::{Mark, NAV, Nav, Track};
use crate::ekf::Belief;
use crate::ekf::covariance::PSI;
use crate::noise::Model;
use crate::simulation::REPORTED;
use crate::units::DEG;
use glam::DVec3;
use nalgebra::SMatrix;

/// How a filter's covariance stands to that of its true errors, at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Consistency {
    /// Time from the start (s).
    pub after_s: f64,
    /// Whether a measurement is used here.
    pub measured: bool,
    /// Standard deviations that the filter states (m, m/s, degrees).
    pub sigma: [f64; REPORTED],
    /// Root mean squares of its true errors.
    pub rmse: [f64; REPORTED],
    /// Expected NEES: tr(P⁻¹ P_true) over position, velocity and attitude; 9 for a filter that is right.
    pub nees: f64,
    /// tr(P⁻¹ P_true) − ln det(P⁻¹ P_true) − 9: twice the Kullback-Leibler divergence of the believed law of
    /// the errors from the true one. 0 for a filter that is right.
    pub divergence: f64,
}

impl Consistency {
    /// True RMSE over stated standard deviation: above 1 the filter is overconfident.
    #[must_use]
    pub fn ratio(&self) -> [f64; REPORTED] {
        std::array::from_fn(|i| self.rmse[i] / self.sigma[i])
    }
}

/// What a pass finds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Assessment {
    /// At every report (1 Hz), after the measurements.
    pub reports: Vec<Consistency>,
    /// Just before the first fix after each outage (or at the end).
    pub outage_ends: Vec<Consistency>,
}

/// Takes a filter along a track with its own covariance and that of its true errors, where `truth` makes the
/// inertial errors, turn-on biases and scale factors are as the filter expects them, and the receiver is as the filter believes.
#[must_use]
pub fn assess(track: &Track, belief: &Belief, truth: &Model) -> Assessment {
    let believed = Sources::of_belief(belief);
    let mut real = Sources::of_model(truth);
    real.states.extend(Sources::beside_model(belief));
    let estimates =
        Sources { states: believed.states.iter().map(|s| s.estimate()).collect(), white: [0.0; SIGNALS] };
    let none = Sources { states: Vec::new(), white: [0.0; SIGNALS] };
    let begin = if track.perfect { [[0.0; NAV]; NAV] } else { track.start };
    let mut filter = Joint::new(track.start, &believed, &none);
    let mut errors = Joint::new(begin, &estimates, &real);
    let mut inputs = StepInputs { made: Vec::new() };
    let mut assessment = Assessment::default();
    let mut ends = vec![None; track.outages];
    let mut done = 0;
    for mark in &track.marks {
        for step in &track.steps[done..mark.steps] {
            let (of_filter, of_errors) = inputs
                .of(step.samples, |n| (Inputs::new(&believed, &none, n), Inputs::new(&estimates, &real, n)));
            filter.step(step, of_filter);
            errors.step(step, of_errors);
        }
        done = mark.steps;
        for outage in &mark.outages {
            ends[*outage] = Some(consistency(&filter.xx, &errors.xx, mark));
        }
        for row in &mark.rows {
            let y = filter.innovation(row);
            let gain = y.gain();
            filter.correct(&y, &gain);
            errors.correct(&errors.innovation(row), &gain);
        }
        if mark.report {
            assessment.reports.push(consistency(&filter.xx, &errors.xx, mark));
        }
    }
    assessment.outage_ends = ends.into_iter().flatten().collect();
    assessment
}

/// Inputs by the number of samples of a step; few numbers occur.
struct StepInputs {
    made: Vec<(u32, (Inputs, Inputs))>,
}

impl StepInputs {
    fn of(&mut self, samples: u32, make: impl Fn(u32) -> (Inputs, Inputs)) -> (&Inputs, &Inputs) {
        let found = self.made.iter().position(|(n, _)| *n == samples);
        let at = found.unwrap_or_else(|| {
            self.made.push((samples, make(samples)));
            self.made.len() - 1
        });
        let (_, (filter, errors)) = &self.made[at];
        (filter, errors)
    }
}

fn consistency(filter: &[Nav; NAV], errors: &[Nav; NAV], mark: &Mark) -> Consistency {
    let p = SMatrix::<f64, NAV, NAV>::from_fn(|i, j| filter[j][i]);
    let t = SMatrix::<f64, NAV, NAV>::from_fn(|i, j| errors[j][i]);
    let (nees, log_det) = match (p.cholesky(), t.cholesky()) {
        (Some(p), Some(t_factor)) => {
            let log_det = |l: SMatrix<f64, NAV, NAV>| 2.0 * l.diagonal().map(f64::ln).sum();
            (p.solve(&t).trace(), log_det(t_factor.l()) - log_det(p.l()))
        }
        (Some(p), None) => (p.solve(&t).trace(), f64::NEG_INFINITY),
        _ => (f64::NAN, f64::NAN),
    };
    Consistency {
        after_s: mark.after_s,
        measured: !mark.rows.is_empty(),
        sigma: deviations(filter, &mark.jacobian),
        rmse: deviations(errors, &mark.jacobian),
        nees,
        divergence: nees - log_det - NAV as f64,
    }
}

/// Standard deviations in the reported states (m, m/s, degrees).
fn deviations(p: &[Nav; NAV], jacobian: &[DVec3; 3]) -> [f64; REPORTED] {
    std::array::from_fn(|i| match i {
        0..6 => p[i][i].sqrt(),
        _ => {
            let j = jacobian[i - 6];
            let terms = (0..9).map(|k| p[3 * PSI + k / 3][3 * PSI + k % 3] * j[k / 3] * j[k % 3]);
            terms.sum::<f64>().sqrt() / DEG
        }
    })
}
