//! One filter along a track, and what makes its true errors.

use super::track::{Mark, NAV, Nav, Row, SIGNALS, Sides, Sources, Step, StepOfSource, Track};
use super::truth::{TrueErrors, TruthSide};
use crate::ekf::Belief;
use crate::ekf::covariance::PSI;
use crate::linalg::mean;
use crate::noise::Model;
use crate::sensors::outage::Outage;
use crate::simulation::{BIASES, REPORTED};
use crate::units::DEG;
use glam::DVec3;
use multiversion::multiversion;
use nalgebra::SMatrix;
use rayon::prelude::*;
use std::ops::Range;

/// Yaw error over that of attitude at a pitch of 80°: 1/cos(pitch).
const STEEP: f64 = 5.76;

/// How a filter's covariance stands to that of its true errors, at one instant.
#[derive(Debug, Clone, Copy)]
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

/// What a pass finds.
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
/// the same drift is in every run, [`super::TruthSide`] adds the errors instead of their variances.
pub fn assess(track: &Track, belief: &Belief, truth: &Model) -> Assessment {
    FilterPass::new(track, belief)
        .errors_as_expected(belief, truth)
        .assessment()
}

/// Largest error of any reported state that the strapdown alone makes at the IMU's rate, over the standard deviation that the
/// filter states of it; 0 where the closure along the track is good.
pub fn strapdown_over_sigma(track: &Track, belief: &Belief) -> f64 {
    if track.is_closed() {
        return 0.0;
    }
    let law = FilterPass::new(track, belief).errors(&TruthSide::of_strapdown());
    // At the start there is no error yet, and perhaps no standard deviation.
    let instants = law.reports.iter().skip(1).chain(&law.outage_ends);
    let ratios = instants.flat_map(|judged| std::iter::zip(judged.errors.rmse(), judged.sigma()));
    ratios
        .map(|(error, sigma)| error / sigma)
        .fold(0.0, f64::max)
}

/// The law of a filter's true errors at one instant: normal, with this mean and covariance, in the filter's navigation states
/// (position m, velocity m/s, attitude rad, in n).
#[derive(Debug, Clone, Copy)]
pub struct Instant {
    /// Time from the start (s).
    pub after_s: f64,
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// Whether a measurement is used here.
    pub measured: bool,
    /// Whether a fix is used here.
    pub fix: bool,
    /// Covariance of the errors.
    pub covariance: [Nav; NAV],
    /// Their mean.
    pub mean: Nav,
    jacobian: [DVec3; 3],
}

/// A filter's errors at one instant, and what it states of them.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    /// The law of the true errors.
    pub errors: Instant,
    /// The covariance that the filter states.
    pub believed: [Nav; NAV],
}

/// The law of a filter's errors along a track.
#[derive(Debug, Clone, Default)]
pub struct ErrorLaw {
    /// At every report (1 Hz), after the measurements.
    pub reports: Vec<Judged>,
    /// Just before the first fix after each outage (or at the end).
    pub outage_ends: Vec<Judged>,
    /// Sum of the expected squares of the innovations of fixes over the variances that the filter states, and how
    /// many fixes.
    pub nis: (f64, u64),
}

/// A filter along a track: its gains, which no draw changes, and its own covariance.
#[derive(Debug, Clone)]
pub struct FilterPass<'a> {
    track: &'a Track,
    believed: Sources,
    /// The gain of every scalar measurement, in sequence, and the variance that the filter states for its innovation.
    gains: Vec<(Column, f64)>,
    reports: Vec<[Nav; NAV]>,
    /// Standard deviations that the filter states of the sensors' biases (m/s², rad/s), at every report.
    pub biases: Vec<[f64; BIASES]>,
    /// The covariance that the filter states at the end of each outage.
    ends: Vec<[Nav; NAV]>,
}

impl<'a> FilterPass<'a> {
    /// Takes a filter along a track.
    pub fn new(track: &'a Track, belief: &Belief) -> Self {
        let believed = Sources::of_belief(belief);
        let own = Sides::of_filter(believed.clone(), track);
        let mut filter = Joint::new(track.start, &own);
        let (mut gains, mut reports, mut biases) = (Vec::new(), Vec::new(), Vec::new());
        let mut ends = vec![[[0.0; NAV]; NAV]; track.outages];
        for (steps, mark) in track.legs(0..track.marks.len()) {
            steps.iter().for_each(|step| filter.step(step));
            // Before the measurements of the same instant, as the runs have it.
            mark.outages
                .iter()
                .for_each(|outage| ends[*outage] = filter.xx);
            gains.extend(mark.rows.iter().map(|row| filter.measure(row)));
            if mark.report {
                reports.push(filter.xx);
                biases.push(filter.bias_variances().map(f64::sqrt));
            }
        }
        Self {
            track,
            gains,
            reports,
            biases,
            ends,
            believed,
        }
    }

    /// The reports, and what the filter states there.
    fn stated(&self) -> impl Iterator<Item = (&Mark, &[Nav; NAV])> {
        let marks = self.track.marks.iter();
        marks.filter(|mark| mark.report).zip(&self.reports)
    }

    /// Times from the start (s) of the reports at which something is measured, and the standard deviations of yaw there (degrees).
    pub fn yaw_while_measured(&self) -> Vec<(f64, f64)> {
        // Near the vertical roll and yaw are no separate angles: yaw is uncertain there however well the attitude is known.
        let is_separate = |mark: &Mark| mark.jacobian[2].length() < STEEP;
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

    /// Their means over the reports within each of some outages.
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

    /// As [`assess`], of the filter's own belief, where settings state more of the true errors than a noise model.
    pub(super) fn assess_stated(&self, belief: &Belief, truth: &TrueErrors) -> Assessment {
        self.errors(&TruthSide::as_stated(belief, truth, !self.track.perfect))
            .assessment()
    }

    /// The errors of which [`assess`] tells.
    pub(super) fn errors_as_expected(&self, belief: &Belief, truth: &Model) -> ErrorLaw {
        self.errors(&TruthSide::as_expected(belief, truth, !self.track.perfect))
    }

    /// The true errors of the filter.
    pub fn errors(&self, truth: &TruthSide) -> ErrorLaw {
        self.errors_until(self.track.marks.len(), truth)
    }

    /// The same at the ends of outages alone: what comes after the last is not computed.
    pub fn errors_at_ends(&self, truth: &TruthSide) -> Vec<Judged> {
        let last = self
            .track
            .marks
            .iter()
            .rposition(|m| !m.outages.is_empty())
            .map_or(0, |at| at + 1);
        self.errors_until(last, truth).outage_ends
    }

    /// Along the first `marks` marks.
    fn errors_until(&self, marks: usize, truth: &TruthSide) -> ErrorLaw {
        let sides = Sides::of_errors(&self.believed, &truth.inertial, self.track);
        let mut errors = Errors::at_start(self.track, &sides, truth);
        let (mut gains, mut reports) = (self.gains.iter(), self.reports.iter());
        let (mut law, mut ends) = (ErrorLaw::default(), vec![None; self.track.outages]);
        for (steps, mark) in self.track.legs(0..marks) {
            errors.follow(steps, mark);
            mark.outages
                .iter()
                .for_each(|o| ends[*o] = Some(errors.judged(mark, &self.ends[*o])));
            law.nis.1 += u64::from(mark.fix);
            for (row, (gain, believed)) in mark.rows.iter().zip(&mut gains) {
                let square = errors.measure(row, gain);
                if row.what.is_of_fix() {
                    // The gate and the NIS of runs are of fixes alone.
                    law.nis.0 += square / believed;
                }
            }
            if mark.report {
                law.reports
                    .extend(reports.next().map(|believed| errors.judged(mark, believed)));
            }
        }
        law.outage_ends = ends.into_iter().flatten().collect();
        law
    }
}

impl ErrorLaw {
    pub(super) fn assessment(&self) -> Assessment {
        let consistency = |all: &[Judged]| all.iter().map(Judged::consistency).collect();
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

impl Judged {
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

    /// How the filter's covariance stands to that of its true errors.
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

/// Which moments of an outage are looked at.
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
    let mut filter = Joint::new(track.start, &own);
    let mut errors = Errors::at_start(track, &sides, truth);
    let measure = |filter: &mut Joint<'_>, errors: &mut Errors<'_>, row: &Row| {
        errors.measure(row, &filter.measure(row).0);
    };
    let goes_on = |row: &&Row| !row.of_gnss;
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
        let branch = |(place, mut filter, mut errors): (usize, Joint<'_>, Errors<'_>)| {
            let (way, mut instants) = (&ways[place], Vec::new());
            // Without a measurement nobody asks for a gain: of the filter's own covariance nothing is needed then.
            let is_blind = !track.marks[way.clone()]
                .iter()
                .flat_map(|mark| &mark.rows)
                .any(|row| goes_on(&row));
            for (index, (steps, mark)) in way.clone().zip(track.legs(way.clone())) {
                if !is_blind {
                    steps.iter().for_each(|step| filter.step(step));
                }
                errors.follow(steps, mark);
                // Before the measurements, as the end of an outage in the runs: each report could be one.
                let is_end = index + 1 == way.end;
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

// The covariance of \[navigation error; bias estimates\] and its correlation with the states of the truth.

/// Covariance of z = \[x; b\] jointly with states t that no measurement corrects.
///
/// For the filter's own covariance b are its biases' errors and there is no t. For the true one b are its
/// estimates, which nothing drives but the corrections, and t are the negated states of the true IMU: the
/// error of a bias is estimate less truth, so both enter the navigation error alike. States t are independent
/// of one another and stay so.
#[derive(Clone)]
struct Joint<'a> {
    sides: &'a Sides,
    xx: [Nav; NAV],
    /// Covariances of x with the states b, then t.
    xs: Vec<Nav>,
    /// A row for each b, with b and t.
    bs: Vec<f64>,
    tt: Vec<f64>,
    /// Samples so far.
    elapsed: f64,
}

impl<'a> Joint<'a> {
    fn new(xx: [Nav; NAV], sides: &'a Sides) -> Self {
        let (states, nb) = (&sides.states, sides.estimated);
        let mut bs = vec![0.0; nb * states.len()];
        for (i, source) in states[..nb].iter().enumerate() {
            bs[i * states.len() + i] = source.initial;
        }
        Self {
            sides,
            xx,
            xs: vec![[0.0; NAV]; states.len()],
            bs,
            tt: states[nb..].iter().map(|s| s.initial).collect(),
            elapsed: 0.0,
        }
    }

    /// Variances of the biases of the signals: of the sum of the states b of each, drifts at their age.
    fn bias_variances(&self) -> [f64; BIASES] {
        let states = &self.sides.states[..self.sides.estimated];
        let factors: Vec<f64> = states.iter().map(|s| s.share(self.elapsed)).collect();
        let mut variances = [0.0; BIASES];
        for (i, a) in states.iter().enumerate().filter(|(_, a)| a.signal < BIASES) {
            let of_signal = states
                .iter()
                .enumerate()
                .filter(|(_, b)| b.signal == a.signal);
            variances[a.signal] += of_signal
                .map(|(j, _)| factors[i] * factors[j] * self.between(i, j))
                .sum::<f64>();
        }
        variances
    }

    /// Covariance of two of the states b and t.
    #[inline(always)]
    fn between(&self, i: usize, j: usize) -> f64 {
        let nb = self.sides.estimated;
        match i.min(j) {
            first if first < nb => self.bs[first * self.xs.len() + i.max(j)],
            first if i == j => self.tt[first - nb],
            _ => 0.0,
        }
    }

    /// Covariance of everything with a linear form of the states as they are now.
    fn covariance_with(&self, form: &Column) -> Column {
        let mut x = [0.0; NAV];
        for (column, h) in self.xx.iter().zip(&form.x) {
            add_scaled(&mut x, *h, column);
        }
        let product = |x: &Nav| -> f64 { x.iter().zip(&form.x).map(|(a, h)| a * h).sum() };
        let mut s: Vec<f64> = self.xs.iter().map(product).collect();
        // Most measurements are of the navigation error alone.
        for (j, h) in form.s.iter().enumerate().filter(|(_, h)| **h != 0.0) {
            add_scaled(&mut x, *h, &self.xs[j]);
            for (i, s) in s.iter_mut().enumerate() {
                *s += h * self.between(i, j);
            }
        }
        Column { x, s }
    }

    /// Over one step.
    pub(super) fn step(&mut self, step: &Step) {
        over(self, step);
    }

    /// A P Aᵀ + Q in blocks.
    #[inline(always)]
    fn propagate(&mut self, step: &Step) {
        let (signals, nb) = (self.sides.signals, self.sides.estimated);
        let inputs = self.sides.over(step);
        let (sources, elapsed) = (&inputs.sources, self.elapsed);
        let mean = |s: &StepOfSource| s.mean + s.ramp * elapsed;
        let of_column = |xs: &[Nav], j: usize| {
            let mut u = [0.0; SIGNALS];
            let pairs = sources.iter().zip(xs);
            pairs.for_each(|(s, x)| u[s.signal] += mean(s) * x[j]);
            u
        };
        // A P, rows of x. Column by column: M times the column's x part, B times the means of its biases. Into a copy: the
        // cross terms below still need P before the step.
        let gx: [Nav; NAV] =
            std::array::from_fn(|j| step.map(&self.xx[j], &of_column(&self.xs, j)[..signals]));
        let n = sources.len();
        for j in 0..n {
            let mut u = [0.0; SIGNALS];
            if j < nb {
                let pairs = sources.iter().zip(&self.bs[j * n..]);
                pairs.for_each(|(s, p)| u[s.signal] += mean(s) * p);
            } else {
                let own = sources[..nb].iter().enumerate();
                own.for_each(|(i, s)| u[s.signal] += mean(s) * self.bs[i * n + j]);
                // The states t are independent: of column j only its own variance feeds its signal.
                u[sources[j].signal] += mean(&sources[j]) * self.tt[j - nb];
            }
            self.xs[j] = step.map(&self.xs[j], &u[..signals]);
        }
        // (A P) Aᵀ: the same map on the rows of A P.
        for i in 0..NAV {
            let row: Nav = std::array::from_fn(|j| gx[j][i]);
            self.xx[i] = step.map(&row, &of_column(&self.xs, i)[..signals]);
        }
        // The states themselves last: the maps above are of their values at the beginning of the step.
        self.step_biases(step, sources);
        self.elapsed += f64::from(step.samples);
        for (white, unit) in inputs.white.iter().zip(&step.white) {
            self.xx
                .iter_mut()
                .zip(unit)
                .for_each(|(column, unit)| add_scaled(column, *white, unit));
        }
        let q_mean = &inputs.q_mean[usize::from(!step.white.is_empty())];
        // What is new in the mean input of a signal acts through one column of B: Q = Σ q b bᵀ.
        for (q, column) in q_mean.iter().zip(&step.b).filter(|(q, _)| **q != 0.0) {
            for j in 0..NAV {
                add_scaled(&mut self.xx[j], q * column[j], column);
            }
        }
    }

    #[inline(always)]
    fn step_biases(&mut self, step: &Step, sources: &[StepOfSource]) {
        for (x, s) in self.xs.iter_mut().zip(sources) {
            x.iter_mut().for_each(|v| *v *= s.decay);
            // The w of the step moves the mean input and the state together: cov(x, s) = b q_cross.
            if let Some(b) = step.b.get(s.signal) {
                add_scaled(x, s.q_cross, b);
            }
        }
        let (own, truth) = sources.split_at(self.sides.estimated);
        for (i, s) in own.iter().enumerate() {
            let row = &mut self.bs[i * sources.len()..][..sources.len()];
            row.iter_mut()
                .zip(sources)
                .for_each(|(p, other)| *p *= s.decay * other.decay);
            row[i] += s.q_state;
        }
        for (p, s) in self.tt.iter_mut().zip(truth) {
            *p = *p * s.decay * s.decay + s.q_state;
        }
    }

    /// What a row measures, as a linear form.
    fn measured(&self, row: &Row) -> Column {
        let coefficient = |source| row.coefficient(source, self.elapsed);
        Column {
            x: std::array::from_fn(|i| row.h[i]),
            s: self.sides.states.iter().map(coefficient).collect(),
        }
    }

    /// Covariances with the innovation of a measurement with white noise of variance `r`, and its variance.
    fn innovation(&self, measured: &Column, r: f64) -> (Column, f64) {
        let with = self.covariance_with(measured);
        // hᵀ P h + r
        let s = r + measured.dot(&with);
        (with, s)
    }

    /// Corrects by a measurement as the filter does whose own covariance this is; returns its gain, and the variance that it
    /// states for the innovation.
    fn measure(&mut self, row: &Row) -> (Column, f64) {
        let (with, s) = self.innovation(&self.measured(row), row.r);
        // the gain that is best where the covariance is right
        let own = with.s.iter().take(self.sides.estimated);
        let gain = Column {
            x: with.x.map(|c| c / s),
            s: own.map(|c| c / s).collect(),
        };
        corrected(self, (&with, s), &gain);
        (gain, s)
    }

    /// z ← z − k y for an innovation y; the gain belongs to a filter that need not be right.
    #[inline(always)]
    fn update(&mut self, (with, variance): (&Column, f64), gain: &Column) {
        let (n, nb) = (self.xs.len(), self.sides.estimated);
        // P − k cᵀ − c kᵀ + k s kᵀ, by (s k − c) kᵀ − k cᵀ
        // With the optimal gain s k = c and the first term is zero. Here c is of the truth and k of the
        // filter.
        let rest_x: Nav = std::array::from_fn(|i| variance * gain.x[i] - with.x[i]);
        for j in 0..NAV {
            add_scaled(&mut self.xx[j], gain.x[j], &rest_x);
            add_scaled(&mut self.xx[j], -with.x[j], &gain.x);
        }
        for (x, k) in self.xs.iter_mut().zip(&gain.s) {
            add_scaled(x, *k, &rest_x);
        }
        for (x, c) in self.xs.iter_mut().zip(&with.s) {
            add_scaled(x, -c, &gain.x);
        }
        for (i, (k, c)) in gain.s.iter().zip(&with.s).enumerate() {
            let rest = variance * k - c;
            let (own, truth) = self.bs[i * n..][..n].split_at_mut(nb);
            for (p, (other, with)) in own.iter_mut().zip(gain.s.iter().zip(&with.s)) {
                *p += rest * other - k * with;
            }
            // t has no gain: a measurement does not change what truly makes the errors, only the
            // estimate's relation to it.
            let truth = truth.iter_mut().zip(&with.s[nb..]);
            truth.for_each(|(p, with)| *p -= k * with);
        }
        self.symmetrise();
    }

    /// Takes the mean of each pair of covariances that should be equal. Rounding makes them unequal, the correction above leaves
    /// their difference as it is (k cᵀ + c kᵀ is symmetric), and over the steps it would grow as the unaided vertical channel does,
    /// by e in some 400 s: after three hours no digit is left.
    fn symmetrise(&mut self) {
        for i in 0..NAV {
            for j in 0..i {
                let mean = 0.5 * (self.xx[i][j] + self.xx[j][i]);
                (self.xx[i][j], self.xx[j][i]) = (mean, mean);
            }
        }
        let n = self.xs.len();
        for i in 0..self.sides.estimated {
            for j in 0..i {
                let mean = 0.5 * (self.bs[i * n + j] + self.bs[j * n + i]);
                (self.bs[i * n + j], self.bs[j * n + i]) = (mean, mean);
            }
        }
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

// Products and sums of nine, for the widest vectors that the machine has: the same digits on each, since nothing is fused.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"))]
fn over(joint: &mut Joint<'_>, step: &Step) {
    joint.propagate(step);
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2"))]
fn corrected(joint: &mut Joint<'_>, innovation: (&Column, f64), gain: &Column) {
    joint.update(innovation, gain);
}

#[inline(always)]
pub(super) fn add_scaled(to: &mut Nav, factor: f64, x: &Nav) {
    for (to, x) in to.iter_mut().zip(x) {
        *to += factor * x;
    }
}

// One number for each state: a mean, covariances with something, or the coefficients of a linear form.

/// A number for each state of z = \[navigation error `x`; bias states b\] and for each state t of the truth (`s`), as
/// [`Joint`] has them; a gain is of z alone.
#[derive(Debug, Clone)]
struct Column {
    x: Nav,
    s: Vec<f64>,
}

impl Column {
    /// The value of a linear form.
    fn dot(&self, other: &Self) -> f64 {
        let sum = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        sum(&self.x, &other.x) + sum(&self.s, &other.s)
    }
}

// The true errors of a filter as they are taken along a track.

/// The true errors at an instant.
#[derive(Clone)]
struct Errors<'a> {
    truth: &'a TruthSide,
    joint: Joint<'a>,
    /// Mean of the true errors, which is the same in every run.
    mean: Option<Column>,
}

impl<'a> Errors<'a> {
    /// Those of the start.
    fn at_start(track: &Track, sides: &'a Sides, truth: &'a TruthSide) -> Self {
        let begin = if truth.starts_off {
            track.start
        } else {
            [[0.0; NAV]; NAV]
        };
        // A mean is rare (drifts, a strapdown too slow for the motion): without one its propagation is spared.
        let levels = || sides.states.iter().map(|s| s.level);
        let drifts = levels().any(|level| level != 0.0);
        let is_off = truth.integrates && !track.is_closed();
        let mean = (drifts || is_off).then(|| Column {
            x: [0.0; NAV],
            s: levels().collect(),
        });
        Self {
            truth,
            joint: Joint::new(begin, sides),
            mean,
        }
    }

    /// Over the steps that lead to a mark.
    fn follow(&mut self, steps: &[Step], mark: &Mark) {
        for step in steps {
            if let Some(mean) = &mut self.mean {
                let (inputs, elapsed) = (self.joint.sides.over(step), self.joint.elapsed);
                let mut error = [0.0; SIGNALS];
                for (state, s) in mean.s.iter_mut().zip(&inputs.sources) {
                    // With the state at the beginning of the step, as in the covariance; it decays afterwards.
                    error[s.signal] += (s.mean + s.ramp * elapsed) * *state;
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

    /// Corrects by a measurement with the filter's gain; returns the expected square of the innovation.
    fn measure(&mut self, row: &Row, gain: &Column) -> f64 {
        // Without its noise where the source under study is another one: covariances of independent sources
        // add.
        let measured = self.joint.measured(row);
        let noise = if self.truth.has_noise(row.what) {
            row.noise
        } else {
            0.0
        };
        let (with, variance) = self.joint.innovation(&measured, noise);
        let mean = self.mean.as_ref().map_or(0.0, |mean| measured.dot(mean));
        corrected(&mut self.joint, (&with, variance), gain);
        if let Some(Column { x, s }) = &mut self.mean {
            let states = x.iter_mut().chain(s);
            let gains = gain.x.iter().chain(&gain.s);
            states.zip(gains).for_each(|(state, k)| *state -= k * mean);
        }
        variance + mean * mean
    }

    fn judged(&self, mark: &Mark, believed: &[Nav; NAV]) -> Judged {
        Judged {
            errors: self.instant(mark),
            believed: *believed,
        }
    }

    fn instant(&self, mark: &Mark) -> Instant {
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
