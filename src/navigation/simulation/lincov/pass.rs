//! One filter along a track, and what makes its true errors.

use super::errors::Errors;
use super::input::Sources;
use super::joint::{Gain, Joint};
use super::sides::Sides;
use super::track::{Mark, NAV, Nav, Track};
use super::truth::{TrueErrors, TruthSide};
use crate::ekf::Belief;
use crate::ekf::covariance::PSI;
use crate::noise::Model;
use crate::sensors::outage::Outage;
use crate::simulation::{BIASES, REPORTED};
use crate::units::DEG;
use glam::DVec3;
use nalgebra::SMatrix;

/// Yaw error over that of attitude at a pitch of 80°: 1/cos(pitch).
const STEEP: f64 = 5.76;

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
    /// tr(P⁻¹ P_true) − ln det(P⁻¹ P_true) − 9: twice the Kullback-Leibler divergence KL(true ‖ believed) of
    /// normal laws with these second moments. 0 for a filter that is right.
    pub divergence: f64,
    /// Expected logarithm of the density of the true error under the filter's belief (nats, of m, m/s, rad).
    pub log_density: f64,
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

impl Assessment {
    /// True RMSE over stated standard deviation over the whole run, as verdicts have it: the root mean square over the
    /// reports.
    #[must_use]
    pub fn ratio_over_run(&self) -> [f64; REPORTED] {
        let count = self.reports.len() as f64;
        let ratios: Vec<[f64; REPORTED]> = self.reports.iter().map(Consistency::ratio).collect();
        std::array::from_fn(|i| (ratios.iter().map(|r| r[i].powi(2)).sum::<f64>() / count).sqrt())
    }
}

/// Takes a filter along a track with its own covariance and that of its true errors, where `truth` makes the
/// inertial errors, turn-on biases and scale factors are as the filter expects them, and the receiver is as the filter
/// believes. A drift (DR) is taken as the filter takes it: of that magnitude, either sign, each axis by itself; where
/// the same drift is in every run, [`super::TruthSide`] adds the errors instead of their variances.
#[must_use]
pub fn assess(track: &Track, belief: &Belief, truth: &Model) -> Assessment {
    FilterPass::new(track, belief)
        .errors_as_expected(belief, truth)
        .assessment()
}

/// Largest error of any reported state that the strapdown alone makes at the IMU's rate, over the standard deviation that the
/// filter states of it; 0 where the closure along the track is good.
#[must_use]
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
#[derive(Debug, Clone, Copy, PartialEq)]
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
    pub(super) jacobian: [DVec3; 3],
}

/// A filter's errors at one instant, and what it states of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// The law of the true errors.
    pub errors: Instant,
    /// The covariance that the filter states.
    pub believed: [Nav; NAV],
}

/// The law of a filter's errors along a track.
#[derive(Debug, Clone, Default, PartialEq)]
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
    gains: Vec<(Gain, f64)>,
    reports: Vec<[Nav; NAV]>,
    /// Standard deviations that the filter states of the biases, at every report.
    biases: Vec<[f64; BIASES]>,
    /// The covariance that the filter states at the end of each outage.
    ends: Vec<[Nav; NAV]>,
}

impl<'a> FilterPass<'a> {
    /// Takes a filter along a track.
    #[must_use]
    pub fn new(track: &'a Track, belief: &Belief) -> Self {
        let own = Sides::of_filter(Sources::of_belief(belief), track);
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
            believed: own.b,
        }
    }

    /// Standard deviations that the filter states of the sensors' biases (m/s², rad/s), at every report.
    #[must_use]
    pub fn bias_sigmas(&self) -> &[[f64; BIASES]] {
        &self.biases
    }

    /// Times from the start (s) of the reports at which something is measured, and the standard deviations of yaw there (degrees).
    #[must_use]
    pub fn yaw_while_measured(&self) -> Vec<(f64, f64)> {
        let reports = self
            .track
            .marks
            .iter()
            .filter(|mark| mark.report)
            .zip(&self.reports);
        // Near the vertical roll and yaw are no separate angles: yaw is uncertain there however well the attitude is known.
        let is_separate = |mark: &Mark| mark.jacobian[2].length() < STEEP;
        let measured = reports.filter(|(mark, _)| !mark.rows.is_empty() && is_separate(mark));
        measured
            .map(|(mark, p)| (mark.after_s, deviations(&mark.jacobian, p)[REPORTED - 1]))
            .collect()
    }

    /// Standard deviations that the filter states of the reported states (m, m/s, degrees), just before the first fix
    /// after each outage (or at the end).
    #[must_use]
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
    #[must_use]
    pub fn sigma_means(&self, outages: &[Outage]) -> Vec<[f64; REPORTED]> {
        let reports = self
            .track
            .marks
            .iter()
            .filter(|mark| mark.report)
            .zip(&self.reports);
        let sigmas: Vec<(f64, [f64; REPORTED])> = reports
            .map(|(mark, believed)| (mark.t_s, deviations(&mark.jacobian, believed)))
            .collect();
        let mean = |outage: &Outage| {
            let within = || sigmas.iter().filter(|(t_s, _)| outage.withholds(*t_s));
            let count = within().count() as f64;
            std::array::from_fn(|i| within().map(|(_, sigma)| sigma[i]).sum::<f64>() / count)
        };
        outages.iter().map(mean).collect()
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
    #[must_use]
    pub fn errors(&self, truth: &TruthSide) -> ErrorLaw {
        self.errors_until(self.track.marks.len(), truth)
    }

    /// The same at the ends of outages alone: what comes after the last is not computed.
    #[must_use]
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
                if row.what.kind() == 0 {
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
    #[must_use]
    pub(crate) fn moments(&self) -> [Nav; NAV] {
        let m = &self.mean;
        std::array::from_fn(|j| std::array::from_fn(|i| self.covariance[j][i] + m[i] * m[j]))
    }

    /// The reported states (m, m/s, degrees) of a vector of the filter's states.
    #[must_use]
    pub(crate) fn reported(&self, x: &Nav) -> [f64; REPORTED] {
        let psi = DVec3::new(x[3 * PSI], x[3 * PSI + 1], x[3 * PSI + 2]);
        std::array::from_fn(|i| {
            if i < 6 {
                x[i]
            } else {
                self.jacobian[i - 6].dot(psi) / DEG
            }
        })
    }

    /// Variances of the reported states (m², (m/s)², degrees²) of a covariance of the filter's states.
    #[must_use]
    pub(crate) fn variances(&self, p: &[Nav; NAV]) -> [f64; REPORTED] {
        let squares = squares(&self.jacobian, p);
        std::array::from_fn(|i| {
            if i < 6 {
                squares[i]
            } else {
                squares[i] / (DEG * DEG)
            }
        })
    }

    /// Root mean squares of the true errors of the reported states.
    #[must_use]
    pub fn rmse(&self) -> [f64; REPORTED] {
        deviations(&self.jacobian, &self.moments())
    }
}

impl Judged {
    /// Standard deviations that the filter states of the reported states.
    #[must_use]
    pub fn sigma(&self) -> [f64; REPORTED] {
        deviations(&self.errors.jacobian, &self.believed)
    }

    /// L⁻¹ P_true L⁻ᵀ with P = L Lᵀ: the identity where the filter is right; NaN where P is not positive definite.
    pub(super) fn whitened(&self) -> SMatrix<f64, NAV, NAV> {
        let moments = self.errors.moments();
        let p = SMatrix::<f64, NAV, NAV>::from_fn(|i, j| self.believed[j][i]);
        let mut m = SMatrix::<f64, NAV, NAV>::from_fn(|i, j| moments[j][i]);
        let Some(l) = p.cholesky().map(|p| p.l()) else {
            return SMatrix::repeat(f64::NAN);
        };
        for _ in 0..2 {
            l.solve_lower_triangular_mut(&mut m);
            m.transpose_mut();
        }
        m
    }

    /// How the filter's covariance stands to that of its true errors.
    #[must_use]
    pub fn consistency(&self) -> Consistency {
        let moments = self.errors.moments();
        let p = SMatrix::<f64, NAV, NAV>::from_fn(|i, j| self.believed[j][i]);
        let t = SMatrix::<f64, NAV, NAV>::from_fn(|i, j| moments[j][i]);
        let log_det = |l: SMatrix<f64, NAV, NAV>| 2.0 * l.diagonal().map(f64::ln).sum();
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
pub(super) fn deviations(jacobian: &[DVec3; 3], p: &[Nav; NAV]) -> [f64; REPORTED] {
    let roots = squares(jacobian, p).map(f64::sqrt);
    std::array::from_fn(|i| if i < 6 { roots[i] } else { roots[i] / DEG })
}
