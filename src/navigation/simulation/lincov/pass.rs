//! One filter along a track, and what makes its true errors.

use super::joint::JointCovariance;
use super::track::{
    AugmentedStates, ErrorSources, NAV, Nav, SIGNALS, ScalarMeasurement, Step, Track, TrackEpoch,
};
use super::truth::{TrueErrors, TruthModel};
use crate::ekf::covariance::PSI;
use crate::ekf::{FilterModel, SharedUpdate};
use crate::linalg::mean;
use crate::noise::Model;
use crate::sensors::outage::Outage;
use crate::simulation::gains::SharedEvent;
use crate::simulation::{BIASES, REPORTED};
use crate::units::DEG;
use glam::DVec3;
use nalgebra::SMatrix;
use rayon::prelude::*;
use std::ops::Range;

/// Yaw error over attitude error, 1/cos(80°), above which roll and yaw are not separable.
const MAX_YAW_GAIN: f64 = 5.76;

/// Ratio of a filter's covariance to that of its true errors, at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Consistency {
    /// Time from the start (s).
    pub after_s: f64,
    /// True if a measurement is used here.
    pub measured: bool,
    /// Standard deviations that the filter states (m, m/s, degrees).
    pub sigma: [f64; REPORTED],
    /// Root mean squares of its true errors.
    pub rmse: [f64; REPORTED],
    /// Expected NEES: tr(P⁻¹ P_true) over position, velocity and attitude; 9 for a filter that is right.
    pub nees: f64,
    /// tr(P⁻¹ P_true) − ln det(P⁻¹ P_true) − 9: twice the Kullback-Leibler divergence KL(true ‖ believed) of
    /// normal laws with these second moments. 0 for a filter that is right.
    pub divergence: f64,
    /// Expected logarithm of the density of the true error under the filter's belief (nats, of m, m/s, rad).
    pub log_density: f64,
}

impl Consistency {
    /// True RMSE over stated standard deviation: above 1 the filter is overconfident.
    pub fn ratio(&self) -> [f64; REPORTED] {
        std::array::from_fn(|i| self.rmse[i] / self.sigma[i])
    }
}

/// Result of a pass.
#[derive(Debug, Clone)]
pub struct Assessment {
    /// At every report (1 Hz), after the measurements.
    pub reports: Vec<Consistency>,
    /// Just before the first fix after each outage (or at the end).
    pub outage_ends: Vec<Consistency>,
}

impl Assessment {
    /// True RMSE over stated standard deviation over the whole run, as verdicts have it: the root mean square over the
    /// reports.
    pub fn ratio_over_run(&self) -> [f64; REPORTED] {
        let ratios: Vec<[f64; REPORTED]> = self.reports.iter().map(Consistency::ratio).collect();
        std::array::from_fn(|i| mean(ratios.iter().map(|r| r[i].powi(2))).sqrt())
    }
}

/// Takes a filter along a track with its own covariance and that of its true errors, where `truth` makes the
/// inertial errors, turn-on biases and scale factors are as the filter expects them, and the receiver is as the filter
/// believes. A drift (DR) is taken as the filter takes it: of that magnitude, either sign, each axis by itself; where
/// the same drift is in every run, [`super::TruthModel`] adds the errors instead of their variances.
pub fn assess(track: &Track, filter_model: &FilterModel, truth: &Model) -> Assessment {
    FilterPass::new(track, filter_model).assess(filter_model, truth)
}

/// Largest error of any reported state that the strapdown alone makes at the IMU's rate, over the standard deviation that the
/// filter states of it; 0 where the closure along the track is good.
pub fn strapdown_over_sigma(track: &Track, filter_model: &FilterModel) -> f64 {
    if track.is_closed() {
        return 0.0;
    }
    let law = FilterPass::new(track, filter_model).errors(&TruthModel::of_strapdown());
    // At the start there is no error yet, and perhaps no standard deviation.
    let instants = law.reports.iter().skip(1).chain(&law.outage_ends);
    let ratios = instants.flat_map(|assess_instant| {
        std::iter::zip(assess_instant.errors.rmse(), assess_instant.sigma())
    });
    ratios
        .map(|(error, sigma)| error / sigma)
        .fold(0.0, f64::max)
}

/// The law of a filter's true errors at one instant: normal, with this mean and covariance, in the filter's navigation states
/// (position m, velocity m/s, attitude rad, in n).
#[derive(Debug, Clone, Copy, Default)]
pub struct Instant {
    /// Time from the start (s).
    pub after_s: f64,
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// True if a measurement is used here.
    pub measured: bool,
    /// True if a fix is used here.
    pub fix: bool,
    /// Covariance of the errors.
    pub covariance: [Nav; NAV],
    /// Their mean.
    pub mean: Nav,
    jacobian: [DVec3; 3],
}

/// A filter's errors at one instant, and what it states of them.
#[derive(Debug, Clone, Copy, Default)]
pub struct AssessedInstant {
    /// The law of the true errors.
    pub errors: Instant,
    /// The covariance that the filter states.
    pub believed: [Nav; NAV],
}

/// The law of a filter's errors along a track.
#[derive(Debug, Clone, Default)]
pub struct ErrorDistribution {
    /// At every report (1 Hz), after the measurements.
    pub reports: Vec<AssessedInstant>,
    /// Just before the first fix after each outage (or at the end).
    pub outage_ends: Vec<AssessedInstant>,
    /// Sum of the expected squares of the innovations of fixes over the variances that the filter states, and how
    /// many fixes.
    pub nis: (f64, u64),
}

/// A filter along a track: its gains, which no draw changes, and its own covariance.
#[derive(Debug, Clone)]
pub struct FilterPass<'a> {
    track: &'a Track,
    believed: ErrorSources,
    /// The gains of every scalar measurement, in sequence: of x, then of its bias states.
    gains: Vec<f64>,
    /// The variances that the filter states for their innovations.
    innovations: Vec<f64>,
    reports: Vec<[Nav; NAV]>,
    /// Standard deviations that the filter states of the sensors' biases (m/s², rad/s), at every report.
    pub biases: Vec<[f64; BIASES]>,
    /// The covariance that the filter states at the end of each outage.
    ends: Vec<[Nav; NAV]>,
}

impl<'a> FilterPass<'a> {
    /// Takes a filter along a track.
    pub fn new(track: &'a Track, filter_model: &FilterModel) -> Self {
        let believed = ErrorSources::of_belief(filter_model);
        let own = AugmentedStates::of_filter(believed.clone(), track);
        let mut filter = JointCovariance::new(track.start, &own);
        let (mut gains, mut innovations) = (Vec::new(), Vec::new());
        let (mut reports, mut biases) = (Vec::new(), Vec::new());
        let mut ends = vec![[[0.0; NAV]; NAV]; track.outages];
        for (steps, mark) in track.legs(0..track.marks.len()) {
            steps.iter().for_each(|step| filter.step(step));
            // Before the measurements of the same instant, as the runs have it.
            mark.outages
                .iter()
                .for_each(|outage| ends[*outage] = filter.xx);
            for row in mark.rows.iter() {
                innovations.push(filter.measure(row, &mut gains));
            }
            if mark.report {
                reports.push(filter.xx);
                biases.push(filter.bias_variances().map(f64::sqrt));
            }
        }
        Self {
            track,
            gains,
            innovations,
            reports,
            biases,
            ends,
            believed,
        }
    }

    /// The filter event by event, as runs share it.
    pub(in crate::simulation) fn events(&self) -> Vec<SharedEvent> {
        let states = &self.believed.states;
        let gains = self.gains.chunks_exact(NAV + states.len());
        let (mut elapsed, mut gains) = (0.0, gains.zip(&self.innovations));
        let mut reports = self.reports.iter().zip(&self.biases);
        let event = |(steps, mark): (&[Step], &TrackEpoch)| {
            elapsed += steps.iter().map(|s| f64::from(s.samples)).sum::<f64>();
            let update = |(row, (gain, variance)): (&ScalarMeasurement, (&[f64], &f64))| {
                let of_states = states.iter().map(|s| row.coefficient(s, elapsed));
                let all = row.h[..NAV].iter().copied().chain(of_states).enumerate();
                SharedUpdate {
                    row: all.filter(|(_, h)| *h != 0.0).collect(),
                    gain: gain.into(),
                    variance: *variance,
                }
            };
            let after = mark.report.then(|| reports.next()).flatten();
            SharedEvent {
                before: mark.outages.first().map(|outage| self.ends[*outage]),
                updates: mark.rows.iter().zip(&mut gains).map(update).collect(),
                after: after.map(|(p, biases)| (*p, *biases)),
            }
        };
        let marks = self.track.legs(0..self.track.marks.len());
        marks.map(event).collect()
    }

    /// The reports, and what the filter states there.
    fn stated(&self) -> impl Iterator<Item = (&TrackEpoch, &[Nav; NAV])> {
        let marks = self.track.marks.iter();
        marks.filter(|mark| mark.report).zip(&self.reports)
    }

    /// Times from the start (s) of the reports at which something is measured, and the standard deviations of yaw there (degrees).
    pub fn yaw_sigma_at_updates(&self) -> Vec<(f64, f64)> {
        // Near the vertical roll and yaw are no separate angles: yaw is uncertain there however well the attitude is known.
        let is_separate = |mark: &TrackEpoch| mark.jacobian[2].length() < MAX_YAW_GAIN;
        self.stated()
            .filter(|(mark, _)| !mark.rows.is_empty() && is_separate(mark))
            .map(|(mark, p)| (mark.after_s, deviations(&mark.jacobian, p)[REPORTED - 1]))
            .collect()
    }

    /// Standard deviations that the filter states of the reported states (m, m/s, degrees), just before the first fix
    /// after each outage (or at the end).
    pub fn sigma_at_ends(&self) -> Vec<[f64; REPORTED]> {
        let mut sigmas = vec![[0.0; REPORTED]; self.track.outages];
        for mark in &self.track.marks {
            mark.outages
                .iter()
                .for_each(|o| sigmas[*o] = deviations(&mark.jacobian, &self.ends[*o]));
        }
        sigmas
    }

    /// Mean sigmas over the reports within each outage.
    pub fn sigma_means(&self, outages: &[Outage]) -> Vec<[f64; REPORTED]> {
        let of_outage = |outage: &Outage| {
            let within = self.stated().filter(|(mark, _)| outage.withholds(mark.t_s));
            let sigmas: Vec<[f64; REPORTED]> = within
                .map(|(mark, believed)| deviations(&mark.jacobian, believed))
                .collect();
            std::array::from_fn(|i| mean(sigmas.iter().map(|sigma| sigma[i])))
        };
        outages.iter().map(of_outage).collect()
    }

    /// The track.
    pub const fn track(&self) -> &'a Track {
        self.track
    }

    /// Runs [`assess`] for the filter's own belief.
    pub fn assess(&self, filter_model: &FilterModel, truth: &Model) -> Assessment {
        self.errors_as_expected(filter_model, truth).assessment()
    }

    /// Assesses the filter where settings state more of the true errors than a noise model.
    pub(super) fn assess_stated(
        &self,
        filter_model: &FilterModel,
        truth: &TrueErrors,
    ) -> Assessment {
        self.errors(&TruthModel::as_stated(
            filter_model,
            truth,
            !self.track.perfect,
        ))
        .assessment()
    }

    /// The errors of which [`assess`] tells.
    pub(super) fn errors_as_expected(
        &self,
        filter_model: &FilterModel,
        truth: &Model,
    ) -> ErrorDistribution {
        self.errors(&TruthModel::as_expected(
            filter_model,
            truth,
            !self.track.perfect,
        ))
    }

    /// The true errors of the filter.
    pub fn errors(&self, truth: &TruthModel) -> ErrorDistribution {
        self.errors_until(self.track.marks.len(), truth)
    }

    /// Assesses the filter at the ends of outages alone: what comes after the last is not computed.
    pub fn errors_at_ends(&self, truth: &TruthModel) -> Vec<AssessedInstant> {
        let last = self
            .track
            .marks
            .iter()
            .rposition(|m| !m.outages.is_empty())
            .map_or(0, |at| at + 1);
        self.errors_until(last, truth).outage_ends
    }

    /// Along the first `marks` marks.
    fn errors_until(&self, marks: usize, truth: &TruthModel) -> ErrorDistribution {
        let sides = AugmentedStates::of_errors(&self.believed, &truth.inertial, self.track);
        let mut errors = TrueErrorState::at_start(self.track, &sides, truth);
        let gains = self.gains.chunks_exact(NAV + self.believed.states.len());
        let mut gains = gains.zip(&self.innovations);
        let mut reports = self.reports.iter();
        let (mut law, mut ends) = (ErrorDistribution::default(), vec![None; self.track.outages]);
        for (steps, mark) in self.track.legs(0..marks) {
            errors.follow(steps, mark);
            mark.outages
                .iter()
                .for_each(|o| ends[*o] = Some(errors.assess_instant(mark, &self.ends[*o])));
            law.nis.1 += u64::from(mark.fix);
            for (row, (gains, believed)) in mark.rows.iter().zip(&mut gains) {
                let square = errors.measure(row, gains);
                if row.what.is_of_fix() {
                    // The gate and the NIS of runs are of fixes alone.
                    law.nis.0 += square / believed;
                }
            }
            if mark.report {
                law.reports.extend(
                    reports
                        .next()
                        .map(|believed| errors.assess_instant(mark, believed)),
                );
            }
        }
        law.outage_ends = ends.into_iter().flatten().collect();
        law
    }
}

impl ErrorDistribution {
    pub(super) fn assessment(&self) -> Assessment {
        let consistency =
            |all: &[AssessedInstant]| all.iter().map(AssessedInstant::consistency).collect();
        Assessment {
            reports: consistency(&self.reports),
            outage_ends: consistency(&self.outage_ends),
        }
    }
}

impl Instant {
    /// Mean squares and products of the true errors.
    pub(crate) fn moments(&self) -> [Nav; NAV] {
        let m = &self.mean;
        std::array::from_fn(|j| std::array::from_fn(|i| self.covariance[j][i] + m[i] * m[j]))
    }

    /// The reported states (m, m/s, degrees) of a vector of the filter's states.
    pub(crate) fn reported(&self, x: &Nav) -> [f64; REPORTED] {
        let psi = DVec3::new(x[3 * PSI], x[3 * PSI + 1], x[3 * PSI + 2]);
        let angles = self.jacobian.map(|row| row.dot(psi) / DEG);
        std::array::from_fn(|i| if i < 6 { x[i] } else { angles[i - 6] })
    }

    /// Variances of the reported states (m², (m/s)², degrees²) of a covariance of the filter's states.
    pub(crate) fn variances(&self, p: &[Nav; NAV]) -> [f64; REPORTED] {
        in_degrees(squares(&self.jacobian, p), DEG * DEG)
    }

    /// Root mean squares of the true errors of the reported states.
    pub fn rmse(&self) -> [f64; REPORTED] {
        deviations(&self.jacobian, &self.moments())
    }
}

/// A matrix of the filter's navigation states.
type Square = SMatrix<f64, NAV, NAV>;

impl AssessedInstant {
    /// Standard deviations that the filter states of the reported states.
    pub fn sigma(&self) -> [f64; REPORTED] {
        deviations(&self.errors.jacobian, &self.believed)
    }

    /// L⁻¹ P_true L⁻ᵀ with P = L Lᵀ: the identity where the filter is right; NaN where P is not positive definite.
    pub(super) fn whitened(&self) -> Square {
        let moments = self.errors.moments();
        let mut m = Square::from(moments);
        let Some(l) = Square::from(self.believed).cholesky().map(|p| p.l()) else {
            return Square::repeat(f64::NAN);
        };
        for _ in 0..2 {
            l.solve_lower_triangular_mut(&mut m);
            m.transpose_mut();
        }
        m
    }

    /// Ratio of the filter's covariance to that of its true errors.
    pub fn consistency(&self) -> Consistency {
        let moments = self.errors.moments();
        let [p, t] = [self.believed, moments].map(Square::from);
        let log_det = |l: Square| 2.0 * l.diagonal().map(f64::ln).sum();
        // One source alone need not move all nine states: P_true is then singular, its NEES finite, the
        // divergence infinite.
        let (nees, believed, real) = match (p.cholesky(), t.cholesky()) {
            (Some(p), Some(t_factor)) => {
                (p.solve(&t).trace(), log_det(p.l()), log_det(t_factor.l()))
            }
            (Some(p), None) => (p.solve(&t).trace(), log_det(p.l()), f64::NEG_INFINITY),
            _ => (f64::NAN, f64::NAN, f64::NAN),
        };
        let dof = NAV as f64;
        Consistency {
            after_s: self.errors.after_s,
            measured: self.errors.measured,
            sigma: self.sigma(),
            rmse: self.errors.rmse(),
            nees,
            divergence: nees - (real - believed) - dof,
            // E ln N(x; 0, P) = −½ (E xᵀ P⁻¹ x + ln det P + n ln 2π), and the first term is the expected
            // NEES.
            log_density: -0.5 * (nees + believed + dof * std::f64::consts::TAU.ln()),
        }
    }
}

/// Variances of the reported states of a covariance of the filter's states, angles in radians.
fn squares(jacobian: &[DVec3; 3], p: &[Nav; NAV]) -> [f64; REPORTED] {
    std::array::from_fn(|i| match i {
        0..6 => p[i][i],
        _ => {
            let j = jacobian[i - 6];
            let terms = (0..9).map(|k| p[3 * PSI + k / 3][3 * PSI + k % 3] * j[k / 3] * j[k % 3]);
            terms.sum::<f64>()
        }
    })
}

/// Standard deviations of the reported states (m, m/s, degrees).
fn deviations(jacobian: &[DVec3; 3], p: &[Nav; NAV]) -> [f64; REPORTED] {
    in_degrees(squares(jacobian, p).map(f64::sqrt), DEG)
}

/// Divides what is of angles.
fn in_degrees(all: [f64; REPORTED], unit: f64) -> [f64; REPORTED] {
    std::array::from_fn(|i| if i < 6 { all[i] } else { all[i] / unit })
}

// One outage at many places of a track, each alone: a pass with all fixes, from which each outage branches off.

/// Branches that are followed at a time: what they begin from is kept until then.
const TOGETHER: usize = 256;

/// Moments of an outage to examine.
#[derive(PartialEq)]
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
pub(crate) fn errors_in_outages(
    track: &Track,
    filter_model: &FilterModel,
    truth: &TruthModel,
    outages: &[Outage],
    moments: Moments,
) -> Vec<Vec<Instant>> {
    let ways: Vec<Range<usize>> = outages
        .iter()
        .map(|outage| track.without_fixes(outage))
        .collect();
    let mut order: Vec<usize> = (0..ways.len()).collect();
    order.sort_by_key(|place| ways[*place].start);
    let believed = ErrorSources::of_belief(filter_model);
    let sides = AugmentedStates::of_errors(&believed, &truth.inertial, track);
    let own = AugmentedStates::of_filter(believed, track);
    let mut filter = JointCovariance::new(track.start, &own);
    let mut errors = TrueErrorState::at_start(track, &sides, truth);
    let measure = |filter: &mut JointCovariance<'_>,
                   errors: &mut TrueErrorState<'_>,
                   row: &ScalarMeasurement| {
        let mut gains = Vec::with_capacity(NAV + sides.estimated);
        filter.measure(row, &mut gains);
        errors.measure(row, &gains);
    };
    let goes_on = |row: &&ScalarMeasurement| !row.of_gnss;
    let mut found = vec![Vec::new(); ways.len()];
    let mut at = 0;
    for together in order.chunks(TOGETHER) {
        let mut begun = Vec::with_capacity(together.len());
        for place in together {
            let way = &ways[*place];
            for (steps, mark) in track.legs(at..way.start) {
                steps.iter().for_each(|step| filter.step(step));
                errors.follow(steps, mark);
                let rows = mark.rows.iter();
                rows.for_each(|row| measure(&mut filter, &mut errors, row));
            }
            at = at.max(way.start);
            begun.push((*place, filter.clone(), errors.clone()));
        }
        let branch =
            |(place, mut filter, mut errors): (usize, JointCovariance<'_>, TrueErrorState<'_>)| {
                let (way, mut instants) = (&ways[place], Vec::new());
                // Without a measurement nobody asks for a gain: of the filter's own covariance nothing is needed then.
                let is_blind = !track.marks[way.clone()]
                    .iter()
                    .flat_map(|mark| mark.rows.iter())
                    .any(|row| goes_on(&row));
                let mut next = way.start;
                while next < way.end {
                    let long = is_blind.then(|| track.through(&outages[place], next, way.end));
                    let (steps, index) = long.unwrap_or_else(|| (track.leg(next), next));
                    let mark = &track.marks[index];
                    next = index + 1;
                    if !is_blind {
                        steps.iter().for_each(|step| filter.step(step));
                    }
                    errors.follow(steps, mark);
                    // Before the measurements, as the end of an outage in the runs: each report could be one.
                    let is_end = next == way.end;
                    let is_looked_at = is_end || moments == Moments::Reports && mark.report;
                    instants.extend(is_looked_at.then(|| errors.instant(mark)));
                    let rows = mark.rows.iter().filter(|_| !is_end).filter(goes_on);
                    rows.for_each(|row| measure(&mut filter, &mut errors, row));
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

impl Step {
    #[inline(always)]
    pub(super) fn map(&self, x: &Nav, e: &[f64]) -> Nav {
        let mut out = [0.0; NAV];
        for (column, x) in self.m.iter().zip(x) {
            add_scaled(&mut out, *x, column);
        }
        for (column, e) in self.b.iter().zip(e).filter(|(_, e)| **e != 0.0) {
            add_scaled(&mut out, *e, column);
        }
        out
    }
}

#[inline(always)]
pub(super) fn add_scaled(to: &mut Nav, factor: f64, x: &Nav) {
    for (to, x) in to.iter_mut().zip(x) {
        *to += factor * x;
    }
}

// The true errors of a filter as they are taken along a track.

/// The true errors at an instant.
#[derive(Clone)]
struct TrueErrorState<'a> {
    truth: &'a TruthModel,
    joint: JointCovariance<'a>,
    /// Mean of the true errors, which is the same in every run.
    mean: Option<ErrorMean>,
}

/// A number for each state: of the navigation error, and of the states b, then t.
#[derive(Clone)]
struct ErrorMean {
    x: Nav,
    s: Vec<f64>,
}

impl<'a> TrueErrorState<'a> {
    /// Covariances at the start.
    fn at_start(track: &Track, sides: &'a AugmentedStates, truth: &'a TruthModel) -> Self {
        let begin = if truth.starts_off {
            track.start
        } else {
            [[0.0; NAV]; NAV]
        };
        // A mean is rare (drifts, a strapdown too slow for the motion): without one its propagation is spared.
        let levels = || sides.states.iter().map(|s| s.level);
        let drifts = levels().any(|level| level != 0.0);
        let is_off = truth.integrates && !track.is_closed();
        let mean = (drifts || is_off).then(|| ErrorMean {
            x: [0.0; NAV],
            s: levels().collect(),
        });
        Self {
            truth,
            joint: JointCovariance::new(begin, sides),
            mean,
        }
    }

    /// Over the steps that lead to a mark.
    fn follow(&mut self, steps: &[Step], mark: &TrackEpoch) {
        for step in steps {
            if let Some(mean) = &mut self.mean {
                let (inputs, elapsed) = (self.joint.sides.over(step), self.joint.elapsed);
                let mut error = [0.0; SIGNALS];
                for (state, s) in mean.s.iter_mut().zip(&inputs.sources) {
                    // With the state at the beginning of the step, as in the covariance; it decays afterwards.
                    error[s.signal] += s.mean_after(elapsed) * *state;
                    *state *= s.decay;
                }
                mean.x = step.map(&mean.x, &error);
            }
            self.joint.step(step);
        }
        if let Some(mean) = self.mean.as_mut().filter(|_| self.truth.integrates) {
            add_scaled(&mut mean.x, 1.0, &mark.closure);
        }
    }

    /// Corrects by a measurement with the filter's gains; returns the expected square of the innovation.
    fn measure(&mut self, row: &ScalarMeasurement, gains: &[f64]) -> f64 {
        // Without its noise where the source under study is another one: covariances of independent sources
        // add.
        let noise = if self.truth.has_noise(row.what) {
            row.noise
        } else {
            0.0
        };
        let variance = self.joint.correct(row, noise, gains);
        let Some(ErrorMean { x, s }) = &mut self.mean else {
            return variance;
        };
        let value = self.joint.value_of_mean(row, x, s);
        let states = x.iter_mut().chain(s);
        states.zip(gains).for_each(|(state, k)| *state -= k * value);
        variance + value * value
    }

    fn assess_instant(&self, mark: &TrackEpoch, believed: &[Nav; NAV]) -> AssessedInstant {
        AssessedInstant {
            errors: self.instant(mark),
            believed: *believed,
        }
    }

    fn instant(&self, mark: &TrackEpoch) -> Instant {
        Instant {
            after_s: mark.after_s,
            t_s: mark.t_s,
            measured: !mark.rows.is_empty(),
            fix: mark.fix,
            covariance: self.joint.xx,
            mean: self.mean.as_ref().map_or([0.0; NAV], |mean| mean.x),
            jacobian: mark.jacobian,
        }
    }
}
