//! The reduction of a noise model to 15 states by what it does to a filter, not by its wavelet variance.
//!
//! A filter with one Gauss-Markov bias an axis cannot follow the processes of a larger model; the pair
//! closest in wavelet variance leaves it overconfident. Here white noise, drive and correlation time of each
//! sensor's level axes and of its axis down are chosen so that the true errors at the ends of outages have the
//! largest expected log density under the filter's own covariance, and that this covariance is closest to that of the true
//! errors along the drive, in the sense of the Kullback-Leibler divergence.

use super::pass::{AssessedInstant, Assessment, Consistency, ErrorDistribution, FilterPass};
use super::track::{NAV, Track};
use crate::earth::GravityModel;
use crate::ekf::{FilterModel, FixUpdate, InitialSettings};
use crate::imu::{Axis, Channel};
use crate::linalg::mean;
use crate::minimise::{Descent, MOST, Minimum};
use crate::noise::practical::{AllanCurve, BiasModel, Horizon, NoiseDensities, Policy};
use crate::noise::{Composite, Model, Process, reduction};
use crate::sensors::aiding::AidingSettings;
use crate::sensors::defects::ImuSettings;
use crate::sensors::gnss::GnssSettings;
use crate::sensors::imu::Truth;
use crate::sensors::outage::Outage;
use crate::simulation::plan::Experiment;
use crate::simulation::{Gains, NEES_DOF, REPORTED};
use crate::trajectory::Trajectory;
use crate::trajectory::profile::{
    Acceleration, Bank, Length, Profile, ProfileStart, Segment, SegmentKind, Turning,
};
use crate::units::DEG;
use rayon::prelude::*;

/// White noise, drive, correlation time: of the accelerometers front and right, down, of the gyroscopes front and right,
/// down.
const FACTORS: usize = 12;
/// Logarithms of factors on the wavelet reduction.
type Factors = [f64; FACTORS];

/// The belief of 15 states whose covariance is closest to that of the errors it makes along a track, where the
/// errors are those of `model`; `wavelet` is the belief by wavelet variance, from which the search starts; axes of a
/// sensor are reduced as `alike` says. Axes that are white noise and one bias already stay as they are.
pub fn reduced_belief(
    model: &Model,
    wavelet: FilterModel,
    track: &Track,
    alike: AxisGrouping,
) -> FilterModel {
    let exact = Channel::ALL.map(|c| reduction::is_exact(model.axis(c)));
    let is_free = |i: &usize| {
        Channel::ALL
            .into_iter()
            .any(|c| !exact[c.index()] && alike.first_factor(c) == i / 3 * 3)
    };
    let free: Vec<usize> = (0..FACTORS).filter(is_free).collect();
    if free.is_empty() {
        return wavelet;
    }
    let track = track.outline();
    let search = Search {
        model,
        base: wavelet,
        track,
        exact,
        alike,
        free,
    };
    search.filter_model(&search.minimise())
}

/// Axes of a sensor are reduced alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisGrouping {
    /// Front and right; down apart, whose gyroscope shows in the heading alone.
    Level,
    /// All: nobody knows how the IMU is mounted.
    All,
}

impl AxisGrouping {
    /// The first of the three factors that act on an axis.
    fn first_factor(self, channel: Channel) -> usize {
        let apart = self == Self::Level && channel.axis == Axis::Z;
        6 * channel.sensor as usize + if apart { 3 } else { 0 }
    }
}

/// The choice of the factors.
struct Search<'a> {
    model: &'a Model,
    base: FilterModel,
    track: Track,
    /// Axes that are left as they are.
    exact: [bool; 6],
    alike: AxisGrouping,
    /// Factors that act on an axis.
    free: Vec<usize>,
}

impl Search<'_> {
    fn filter_model(&self, ln: &Factors) -> FilterModel {
        let mut filter_model = self.base.clone();
        for channel in Channel::ALL.into_iter().filter(|c| !self.exact[c.index()]) {
            let (s, i) = (channel.sensor as usize, channel.axis as usize);
            // a factor needs something to act on: the wavelet fit may have put all white noise into the bias
            let first = self.alike.first_factor(channel);
            let white = filter_model.white[s][i].max(
                self.model
                    .axis(channel)
                    .processes
                    .iter()
                    .map(Process::white_variance)
                    .sum(),
            );
            filter_model.white[s][i] = white * ln[first].exp();
            let group = &mut filter_model.groups[s][0];
            group.innovation[i] *= ln[first + 1].exp();
            // A factor on the correlation time T is 1/factor on κ = dt/T; in phi itself 0.9999 and 0.99999
            // would hardly differ.
            let kappa = -(group.phi[i] - 1.0).ln_1p() * (-ln[first + 2]).exp();
            group.phi[i] = (-kappa).exp();
        }
        filter_model
    }

    /// The cost and what it is made of.
    fn value(&self, ln: &Factors) -> CostValue {
        let filter_model = self.filter_model(ln);
        let law = FilterPass::new(&self.track, &filter_model)
            .errors_as_expected(&filter_model, self.model);
        let assessment = law.assessment();
        let steep = steep(&assessment);
        // Small errors that are stated as they are have the largest density.
        let cost = average(&assessment, |end| -2.0 * end.log_density)
            + steep.iter().map(QuarticCost::cost).sum::<f64>();
        let parts = shape(&law)
            .chain(steep.iter().map(QuarticCost::part))
            .collect();
        CostValue { cost, parts }.with_ridge(RIDGE, ln)
    }

    /// Factors to the pair of N and Gauss-Markov bias that is exported.
    fn of_pair(&self) -> Option<Factors> {
        let (mut ln, rate_hz) = ([0.0; FACTORS], self.model.rate_hz);
        let mut known: Vec<(&Composite, NoiseDensities)> = Vec::new();
        for channel in Channel::ALL.into_iter().filter(|c| !self.exact[c.index()]) {
            let noise = self.model.axis(channel);
            let of_alike = known.iter().find(|(axis, _)| *axis == noise);
            let pair = match of_alike {
                Some((_, pair)) => *pair,
                None => AllanCurve::largest(&[noise], rate_hz, Horizon::default())
                    .ok()?
                    .pair(Policy::Matched, BiasModel::Markov),
            };
            known.push((noise, pair));
            let (s, i) = (channel.sensor as usize, channel.axis as usize);
            let group = &self.base.groups[s][0];
            let phi = (-1.0 / (pair.markov?.t_corr_s * rate_hz)).exp();
            let innovation = pair.markov?.sigma.powi(2) * (1.0 - phi * phi);
            let factors = [
                pair.density.powi(2) * rate_hz / self.base.white[s][i],
                innovation / group.innovation[i],
                group.phi[i].ln() / phi.ln(),
            ];
            for (k, factor) in factors.into_iter().enumerate() {
                ln[self.alike.first_factor(channel) + k] = factor.ln().clamp(-MAX_LN, MAX_LN);
            }
        }
        ln.iter().all(|x| x.is_finite()).then_some(ln)
    }

    /// The factors that are free descend from where the search starts.
    fn minimise(&self) -> Factors {
        let factors = |free: &[f64]| {
            let mut ln = [0.0; FACTORS];
            self.free.iter().zip(free).for_each(|(i, x)| ln[*i] = *x);
            ln
        };
        let value = |free: &[f64]| self.value(&factors(free));
        // The exported pair is nearer where the wavelet fit is far from what a filter can carry.
        let cost = |ln: &Factors| self.value(ln).cost;
        let start = match self.of_pair() {
            Some(pair) if cost(&pair) < cost(&START) => pair,
            _ => START,
        };
        let start: Vec<f64> = self.free.iter().map(|i| start[*i]).collect();
        let found = minimum(value, &start, (-MAX_LN, MAX_LN), |_| ENOUGH);
        if found.value.cost.is_finite() {
            factors(&found.at)
        } else {
            [0.0; FACTORS]
        }
    }
}

/// Start of the search: about the mean of the optima of two IMUs on three trajectories, all axes of
/// a sensor alike.
const START: Factors = [0.3, -0.3, 1.0, 0.3, -0.3, 1.0, 0.3, 0.0, 0.4, 0.3, 0.0, 0.4];
/// Cost of a factor e: what the fixes do not tell stays near the wavelet reduction.
const RIDGE: f64 = 5e-4;
/// Largest logarithm of a factor.
const MAX_LN: f64 = 6.0;
/// A step that gains less is the last: 2e-3 of divergence is 1 % in each of nine standard deviations.
const ENOUGH: f64 = 2e-3;
/// Share of the outage ends in the cost.
pub(super) const ENDS: f64 = 0.3;
/// A ratio whose logarithm is this far from 0 begins to count for itself, with this weight.
const OFF: f64 = 0.08;
const OFF_WEIGHT: f64 = 0.4;
/// Weight in the cost of the states whose ratio is off over the whole drive.
const WAY: f64 = 0.3;
/// Penalty on the mean NEES: the logarithm at which it begins to count, and its weight.
const NEES_OFF: f64 = 0.03;
const NEES_WEIGHT: f64 = 0.1;

/// A logarithm that costs its fourth power: `scale` off costs `weight`, half of that a sixteenth, twice as much sixteen times;
/// both directions count alike.
struct QuarticCost {
    x: f64,
    scale: f64,
    weight: f64,
}

impl QuarticCost {
    fn cost(&self) -> f64 {
        self.weight * (self.x / self.scale).powi(4)
    }

    fn part(&self) -> CostTerm {
        // The square of (x/scale)², whose slope is 2 x/scale²: as Gauss and Newton have it, so that a step halves x.
        CostTerm {
            value: self.x,
            curvature: 8.0 * self.weight * self.x.powi(2) / self.scale.powi(4),
        }
    }
}

/// Costs beside the divergence: for a single state whose ratio is a tenth off, at an outage's end
/// or over the whole way, since the divergence alone sacrifices one state for eight; and for the
/// mean NEES, since the divergence prefers a filter that is rather underconfident.
fn steep(assessment: &Assessment) -> Vec<QuarticCost> {
    let ends = &assessment.outage_ends;
    let of_end = ENDS * OFF_WEIGHT / ends.len() as f64;
    let at_ends = ends.iter().flat_map(|end| end.ratio());
    let mut all: Vec<QuarticCost> = at_ends
        .map(|r| QuarticCost {
            x: r.ln(),
            scale: OFF,
            weight: of_end,
        })
        .collect();
    let reports = assessment.reports.get(1..).unwrap_or_default();
    if reports.is_empty() {
        return all;
    }
    let mean = |of: &dyn Fn(&Consistency) -> f64| mean(reports.iter().map(of));
    // Root mean square over the way, so that one bad minute is not hidden by an hour that is good.
    let over_way = |i: usize| 0.5 * mean(&|c| c.ratio()[i].powi(2)).ln();
    all.extend((0..REPORTED).map(|i| QuarticCost {
        x: over_way(i),
        scale: OFF,
        weight: WAY * OFF_WEIGHT,
    }));
    let nees = (mean(&|c| c.nees) / NEES_DOF as f64).ln();
    all.push(QuarticCost {
        x: nees,
        scale: NEES_OFF,
        weight: WAY * NEES_WEIGHT,
    });
    all
}

/// Parts of the divergence: P⁻¹ P_true as L⁻¹ P_true L⁻ᵀ. Near the identity the divergence is half
/// the sum of squares of the deviations of its elements, so that its second derivative with respect
/// to each is the weight of the instant.
fn shape(law: &ErrorDistribution) -> impl Iterator<Item = CostTerm> {
    let reports = law.reports.get(1..).unwrap_or_default();
    let of_ends = if law.outage_ends.is_empty() {
        0.0
    } else {
        ENDS
    };
    let weighted = |all: &[AssessedInstant], weight: f64| {
        let weight = weight / all.len().max(1) as f64;
        all.iter()
            .map(|judged| (judged.whitened(), weight))
            .collect::<Vec<_>>()
    };
    let all = weighted(&law.outage_ends, of_ends)
        .into_iter()
        .chain(weighted(reports, 1.0 - of_ends));
    all.flat_map(|(m, weight)| {
        // An element off the diagonal is there twice.
        let part = move |(i, j): (usize, usize)| CostTerm {
            value: m[(i, j)],
            curvature: if i == j { weight } else { 2.0 * weight },
        };
        (0..NAV)
            .flat_map(|i| (0..=i).map(move |j| (i, j)))
            .map(part)
    })
}

/// The mean divergence along the drive, and with its share the mean cost at the outage ends.
pub(super) fn average(assessment: &Assessment, of_end: impl Fn(&Consistency) -> f64) -> f64 {
    // The first instant is the initial state, which no belief about the IMU changes. A trajectory of a few
    // seconds has no other: the mean of none is NaN, and a search ends where it starts.
    let reports = assessment.reports.get(1..).unwrap_or_default();
    let all = mean(reports.iter().map(|c| c.divergence));
    if assessment.outage_ends.is_empty() {
        return all;
    }
    ENDS * mean(assessment.outage_ends.iter().map(of_end)) + (1.0 - ENDS) * all
}

/// Time before the first outage, between the two and after them (s).
const LEAD_S: [f64; 3] = [300.0, 240.0, 60.0];
/// Longest outage that is followed along the drive (s).
const LONGEST_S: f64 = 600.0;
/// Samples a second along the drive: enough for its turns.
const DRIVE_HZ: f64 = 10.0;

/// A built-in drive with a receiver and two outages, as long as the shortest and the longest of `outages_s` (s):
/// for data whose reference is not known. None where the receiver's rate does not allow it.
pub fn drive(
    model: &Model,
    defects: &ImuSettings,
    gnss: &GnssSettings,
    initial: &InitialSettings,
    gravity: GravityModel,
    outages_s: &[f64],
) -> Option<Track> {
    let longest = outages_s.iter().copied().fold(0.0, f64::max).min(LONGEST_S);
    let shortest = outages_s.iter().copied().fold(longest, f64::min);
    let first = LEAD_S[0] + shortest;
    let second = first + LEAD_S[1];
    let duration = second + longest + LEAD_S[2];
    let outages: Vec<Outage> = [(LEAD_S[0], first), (second, second + longest)]
        .into_iter()
        .filter(|(start_s, end_s)| end_s > start_s)
        .map(|(start_s, end_s)| Outage { start_s, end_s })
        .collect();
    let trajectory = path(duration)?;
    let often = gnss.rate_hz.max(1.0);
    // many fixes a second count as one of their mean
    let gnss = GnssSettings {
        rate_hz: gnss.rate_hz.min(1.0),
        pos_sigma_m: gnss.pos_sigma_m.map(|s| s / often.sqrt()),
        vel_sigma_m_s: gnss.vel_sigma_m_s.map(|v| v.map(|s| s / often.sqrt())),
        ..gnss.clone()
    };
    // The next multiple of the receiver's rate: every fix must meet a sample.
    let rate_hz = gnss.rate_hz * (DRIVE_HZ / gnss.rate_hz).ceil();
    let experiment = Experiment {
        trajectory: &trajectory,
        rate_hz,
        gravity,
        truth: Truth::Model(model),
        filter_models: &[],
        gnss: &gnss,
        initial,
        defects,
        baro: None,
        aiding: &AidingSettings::default(),
        update: FixUpdate::default(),
        gains: Gains::default(),
        outages: &outages,
        seed: 0,
        coverage_level: 0.95,
    };
    Track::of_noise_at(model.rate_hz, &experiment).ok()
}

/// A drive of at least that long: what a car meets in town and out of it, over and over.
fn path(duration_s: f64) -> Option<Trajectory> {
    let straight = |s: f64| SegmentKind::Straight(Length::Duration(s));
    let accelerate = |to_speed: f64, s: f64| SegmentKind::Accelerate {
        to_speed,
        by: Acceleration::Duration(s),
    };
    let turn = |deg: f64, s: f64| SegmentKind::Turn {
        angle: deg * DEG,
        by: Turning::Duration(s),
    };
    let cycle = [
        accelerate(14.0, 11.0),
        straight(12.0),
        turn(90.0, 9.0),
        straight(15.0),
        accelerate(8.0, 6.0),
        turn(-60.0, 8.0),
        accelerate(20.0, 12.0),
        straight(25.0),
        turn(-100.0, 13.0),
        turn(60.0, 11.0),
        straight(10.0),
        accelerate(0.0, 14.0),
        straight(12.0),
    ];
    // The sum of the durations above.
    let cycle_s = 158.0;
    let segment = |kind: &SegmentKind| Segment {
        kind: kind.clone(),
        climb_m: 0.0,
        ramp_s: None,
    };
    let cycles = (duration_s / cycle_s).ceil() as usize;
    let segments = cycle
        .iter()
        .cycle()
        .take(cycles * cycle.len())
        .map(segment)
        .collect();
    let start = ProfileStart {
        t_s: 0.0,
        lat: 45.0 * DEG,
        lon: 0.0,
        h: 0.0,
        heading: 40.0 * DEG,
        speed: 0.0,
    };
    Profile {
        start,
        bank: Bank::None,
        ramp_s: 1.5,
        segments,
    }
    .build()
    .ok()
}

// Descent by damped Gauss-Newton steps with forward differences, of a cost that says what it is made of.

/// Step of the forward differences, for variables that are logarithms of factors.
const DIFFERENCE: f64 = 0.02;

/// A value of the cost.
pub(super) struct CostValue {
    pub cost: f64,
    pub parts: Vec<CostTerm>,
}

impl CostValue {
    /// With a cost of the squares of the variables.
    pub(super) fn with_ridge(mut self, ridge: f64, x: &[f64]) -> Self {
        self.cost += ridge * x.iter().map(|x| x * x).sum::<f64>();
        let curvature = 2.0 * ridge;
        let part = |&value: &f64| CostTerm { value, curvature };
        self.parts.extend(x.iter().map(part));
        self
    }
}

/// A number that the variables change, and the second derivative of the cost with respect to it.
#[derive(Clone, Copy)]
pub(super) struct CostTerm {
    pub value: f64,
    pub curvature: f64,
}

/// Minimum of a cost near `start`, the same on any number of threads; the start where its cost is not finite.
pub(super) fn minimum(
    value: impl Fn(&[f64]) -> CostValue + Sync,
    start: &[f64],
    bounds: (f64, f64),
    enough: fn(f64) -> f64,
) -> Minimum<CostValue> {
    // Half the gradient, and half of Gauss and Newton's Hessian Σ c ∂f ∂fᵀ of the parts f.
    let quadratic = |x: &[f64], here: &CostValue| {
        let beside = |i: usize| {
            let mut beside = x.to_vec();
            beside[i] += DIFFERENCE;
            value(&beside)
        };
        // One-sided: half the evaluations of central differences, each of which is a pass along the whole track.
        let beside: Vec<CostValue> = (0..x.len()).into_par_iter().map(beside).collect();
        let slope = |(here, there): (&CostTerm, &CostTerm)| {
            (0.5 * here.curvature).sqrt() * (there.value - here.value) / DIFFERENCE
        };
        let slopes = |there: &CostValue| here.parts.iter().zip(&there.parts).map(slope).collect();
        let jacobian: Vec<Vec<f64>> = beside.iter().map(slopes).collect();
        let mut hessian = [[0.0; MOST]; MOST];
        for (i, a) in jacobian.iter().enumerate() {
            for (j, b) in jacobian.iter().enumerate() {
                hessian[i][j] = a.iter().zip(b).map(|(a, b)| a * b).sum();
            }
        }
        // A forward difference is the slope half a step further on: the Hessian, which is known, takes it back.
        let slope = |(i, there): (usize, &CostValue)| {
            0.5 * ((there.cost - here.cost) / DIFFERENCE - DIFFERENCE * hessian[i][i])
        };
        (beside.iter().enumerate().map(slope).collect(), hessian)
    };
    let descent = Descent {
        ranges: &vec![bounds; start.len()],
        // Half of 0.1: where the cost falls by a tenth for a factor e, the first step moves by as much.
        damping: 0.05,
        enough,
    };
    descent.minimum(start, &value, |value| value.cost, quadratic)
}

#[cfg(test)]
mod damped_tests {
    use super::*;

    /// A curved valley, the sum of the squares of two parts, whose minimum is 0 at (1, 1): the steps follow it there, or to
    /// the bound x = 1.5, where the lowest point is y = 2.25.
    #[test]
    fn a_curved_valley_is_followed_to_its_end_or_to_a_bound() {
        let valley = |x: &[f64]| {
            let parts = [10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]];
            CostValue {
                cost: parts.iter().map(|f| f * f).sum(),
                parts: parts
                    .map(|value| CostTerm {
                        value,
                        curvature: 2.0,
                    })
                    .into(),
            }
        };
        let found = minimum(valley, &[-1.0, 0.0], (-3.0, 3.0), |_| 1e-9).at;
        assert!(
            (found[0] - 1.0).abs() < 0.02 && (found[1] - 1.0).abs() < 0.04,
            "{found:?}"
        );
        let found = minimum(valley, &[2.0, 2.0], (1.5, 3.0), |_| 1e-9).at;
        assert!(
            (found[0] - 1.5).abs() < 1e-9 && (found[1] - 2.25).abs() < 0.02,
            "{found:?}"
        );
        let nan = |_: &[f64]| CostValue {
            cost: f64::NAN,
            parts: Vec::new(),
        };
        let nowhere = minimum(nan, &[0.5], (0.0, 1.0), |_| 0.0);
        assert!(nowhere.at == [0.5] && !nowhere.value.cost.is_finite());
    }
}
