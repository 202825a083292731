//! What a filter comes to state while its attitude settles, on average over runs.
//!
//! A filter takes the specific force f for (exp ψ) f, ψ the error of its attitude, and linearises there. While the vehicle stands, a tilt
//! error shows it a horizontal acceleration that is not there, and from the response of the velocity it believes to learn its heading. The
//! filters of runs therefore state less of the heading than the one along the reference, where ψ is 0. That is even in ψ: its mean over the
//! attitude errors of the start, which settle as the gains have it, is taken over the six points of the unscented transform
//! ([Särkkä](crate::bibliography::Sarkka13), section 5.5), two on each axis of their covariance. Tilts that come later are left out; those of
//! the true accelerometers' biases of the start change nothing that 700 runs show.

use super::input::Sources;
use super::joint::Joint;
use super::mean::Mean;
use super::pass::deviations;
use super::sides::Sides;
use super::track::{NAV, Step, Track};
use crate::ekf::Belief;
use crate::ekf::covariance::{PSI, V};
use crate::sensors::outage::Outage;
use crate::simulation::REPORTED;
use glam::{DQuat, DVec3};
use nalgebra::Matrix3;

/// How long the attitude of the start is followed (s).
const SETTLED_S: f64 = 120.0;
/// Squared distance of the points from the mean, in variances: the fourth moment of a normal variable.
const DISTANCE: f64 = 3.0;

/// An attitude error of the start as the filter corrects it, and what two filters state that are off by it, to either side.
struct Point<'a> {
    error: Mean<'a>,
    filters: [Joint<'a>; 2],
}

/// By how much filters state more at a report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settling {
    /// Time on the trajectory (s).
    pub(crate) t_s: f64,
    /// Variances of the reported states (m², (m/s)², degrees²) beyond those along the reference, on average over the runs.
    pub(crate) believed: [f64; REPORTED],
}

/// At every report until the attitude has settled or the first outage begins, in which [`super::vertical_second_order`] has what the attitude
/// does.
pub(crate) fn stated_while_settling(track: &Track, belief: &Belief, outages: &[Outage]) -> Vec<Settling> {
    let believed = Sources::of_belief(belief);
    let sides = Sides::of_errors(&believed, &Sources::default(), track);
    let own = Sides::of_filter(believed, track);
    let mut along = Joint::new(track.start, &own);
    let mut points =
        errors_at_start(track, &sides).map(|error| Point { error, filters: [along.clone(), along.clone()] });
    let mut found = Vec::new();
    let aided_s = outages.iter().map(|outage| outage.start_s).fold(f64::INFINITY, f64::min);
    let marks = track.marks.iter().take_while(|mark| mark.after_s < SETTLED_S && mark.t_s < aided_s).count();
    for (steps, mark) in track.legs(0..marks) {
        for step in steps {
            along.step(step);
            for Point { error, filters: [ahead, behind] } in &mut points {
                let psi = DVec3::from_slice(&error.x[3 * PSI..]);
                ahead.step(&step.turned(psi));
                behind.step(&step.turned(-psi));
                error.step(step);
            }
        }
        for row in &mark.rows {
            let (gain, _) = along.measure(row);
            for Point { error, filters } in &mut points {
                filters.iter_mut().for_each(|filter| _ = filter.measure(row));
                error.correct(error.innovation(row), &gain);
            }
        }
        if mark.report {
            let variances =
                |filter: &Joint<'_>| deviations(&mark.jacobian, &filter.xx).map(|sigma| sigma * sigma);
            let reference = variances(&along);
            let mut larger = [0.0; REPORTED];
            for stated in points.iter().flat_map(|point| point.filters.each_ref().map(variances)) {
                for i in 0..REPORTED {
                    larger[i] += (stated[i] - reference[i]) / (2.0 * DISTANCE);
                }
            }
            found.push(Settling { t_s: mark.t_s, believed: larger });
        }
    }
    found
}

/// The axes of the covariance of the attitude errors of the start.
fn errors_at_start<'a>(track: &Track, sides: &'a Sides) -> [Mean<'a>; 3] {
    let attitude = Matrix3::from_fn(|i, j| track.start[3 * PSI + j][3 * PSI + i]).symmetric_eigen();
    std::array::from_fn(|axis| {
        let distance = (DISTANCE * attitude.eigenvalues[axis].max(0.0)).sqrt();
        let mut x = [0.0; NAV];
        x[3 * PSI..].copy_from_slice((attitude.eigenvectors.column(axis) * distance).as_slice());
        Mean { sides, x, b: vec![0.0; sides.b.states.len()], t: Vec::new(), elapsed: 0.0 }
    })
}

impl Step {
    /// The same as a filter has it whose attitude is off by `psi` (rad).
    fn turned(&self, psi: DVec3) -> Self {
        let mut turned = self.clone();
        // The velocity's response to an attitude error e is e × ∫ f dt: its columns hold ∫ f dt.
        let response = |row: usize, column: usize| self.m[3 * PSI + column][3 * V + row];
        let force = DVec3::new(-response(2, 1), response(2, 0), -response(1, 0));
        let more = DQuat::from_scaled_axis(psi) * force - force;
        for (column, axis) in DVec3::AXES.into_iter().enumerate() {
            let velocity = axis.cross(more).to_array();
            for (row, velocity) in velocity.into_iter().enumerate() {
                turned.m[3 * PSI + column][3 * V + row] += velocity;
            }
        }
        turned
    }
}
