//! The vertical channel to second order: what tilts do to velocity and position down in an outage.
//!
//! A filter turns the specific force f by its attitude, which is off by ψ, and takes (exp ψ − 1) f for an acceleration. The first
//! order ψ × f is in every linear error model ([Groves](crate::bibliography::Groves13), chapter 14) and has no part downwards
//! where f stands upright. The second is ½ψ × (ψ × f), in level motion ½g(ψ_n² + ψ_e²) downwards; here are its mean and its
//! variance over the runs.
//!
//! The filter of a run linearises about its own estimate, where f is turned alike: it states the variance of ψ' × (f + ψ × f), ψ'
//! the error that it believes in and ψ that of the run. Averaged over the runs this is the variance along the reference and
//! that of ψ' × (ψ × f). Where the filter is right, it therefore states as much more as its error is larger: two tilts of variance σ²
//! that stand still for T add 2(gTσ²)² to the mean square of the velocity down, E (½gT(ψ_n² + ψ_e²))², and as much to the variance that
//! is stated, E (gT(ψ'_n ψ_n + ψ'_e ψ_e))².
//!
//! Both are double integrals over the outage, of products of two covariances between instants: fourth moments of normal
//! variables are such products ([Isserlis](crate::bibliography::Isserlis18)).
//!
//! Left out are what is of fourth order in ψ (a run's standard deviation is a root, whose mean is below the root of the mean), and the products of
//! velocity and position errors, which curve the Earth away. With a consumer IMU the analysis has the mean of what runs state of the velocity
//! down to 0.5 % after 120 s, 5 % after 300 s and 25 % after 600 s.

use super::branch::Pass;
use super::input::Sources;
use super::joint::Joint;
use super::mean::Mean;
use super::sides::Sides;
use super::track::{Measured, Step, Track};
use super::truth::TruthSide;
use crate::ekf::Belief;
use crate::ekf::covariance::{PSI, R, V};
use crate::sensors::outage::Outage;
use nalgebra::{Matrix2, Matrix3, Vector2};
use std::ops::RangeInclusive;

/// Position and velocity down among the navigation states.
const DOWN: [usize; 2] = [3 * R + 2, 3 * V + 2];
/// A unit of velocity down.
const VELOCITY: Vector2<f64> = Vector2::new(0.0, 1.0);

/// What is of second order in position and velocity down (m, m/s) at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SecondOrder {
    /// Time on the trajectory (s).
    pub(crate) t_s: f64,
    /// Mean of the error.
    pub(crate) mean: [f64; 2],
    /// Variance of the error, beside that of first order: odd moments of normal variables are 0, so the two add.
    pub(crate) variance: [f64; 2],
    /// By how much the variance that the filter states is larger, on average over the runs.
    pub(crate) believed: [f64; 2],
}

/// The second order at every mark of each of the track's outages, of which the last is the outage's end; nothing of an outage in
/// which a barometer measures, since heights correct what grows here, and nothing where a drift of the truth gives the tilt a mean, for
/// which the moments here are not.
pub(crate) fn vertical_second_order(
    track: &Track,
    belief: &Belief,
    truth: &TruthSide,
    outages: &[Outage],
) -> Vec<Vec<SecondOrder>> {
    let is_centred = truth.inertial.states.iter().all(|state| state.level == 0.0);
    let ways: Vec<_> = outages
        .iter()
        .enumerate()
        .map(|(k, outage)| track.unaided(k, outage).filter(|_| is_centred))
        .collect();
    let mut found = vec![Vec::new(); outages.len()];
    let Some(last) = ways.iter().flatten().map(|way| *way.end()).max() else { return found };
    // What is small itself needs no steps finer than a second; the marks stay.
    let track = &track.merged();
    let believed = Sources::of_belief(belief);
    let sides = Sides::of_errors(&believed, &truth.inertial, track);
    let own = Sides::of_filter(believed, track);
    let mut pass = Pass::new(track, &own, &sides, truth);
    let mut channel = Channel::default();
    for (index, (steps, mark)) in track.legs(0..last + 1).enumerate() {
        pass.follow(steps);
        let way = ways.iter().position(|way| way.as_ref().is_some_and(|way| way.contains(&index)));
        if let Some((outage, way)) = way.and_then(|k| Some((k, ways[k].as_ref()?))) {
            let mut form = Matrix3::zeros();
            if index > *way.start() {
                for step in steps {
                    channel.follow(step);
                    form += half_impulse(step);
                }
            }
            // By the trapezoidal rule a step acts half at its beginning, half at its end, where the next step has its first half.
            let mut impulse = Impulse::new(form, &pass);
            found[outage].push(channel.with(&impulse).at(mark.t_s));
            channel = if index == *way.end() {
                Channel::default()
            } else {
                let next = track.marks[index + 1].steps;
                impulse.form += track.steps[mark.steps..next].iter().map(half_impulse).sum::<Matrix3<f64>>();
                channel.and(impulse)
            };
        }
        pass.measure(mark, |_| true);
    }
    found
}

impl Track {
    /// The marks of the track's own outage `k`, from the first fix that is withheld to the end; none where a barometer measures.
    fn unaided(&self, k: usize, outage: &Outage) -> Option<RangeInclusive<usize>> {
        let end = self.marks.iter().position(|mark| mark.outages.contains(&k))?;
        let begin = self.marks.iter().position(|mark| outage.withholds(mark.t_s))?;
        let mut rows = self.marks.get(begin..=end)?.iter().flat_map(|mark| &mark.rows);
        rows.all(|row| row.what != Measured::Height).then_some(begin..=end)
    }
}

/// Half the bilinear form by which two attitude errors ψ' and ψ make velocity down (m/s) over a step: [ψ' × (W ψ)]_down is
/// ψ'_n (Wψ)_e − ψ'_e (Wψ)_n, with W ψ = ψ × ∫ f dt what the linear map does to the velocity.
fn half_impulse(step: &Step) -> Matrix3<f64> {
    let turned = |row: usize, column: usize| step.m[3 * PSI + column][3 * V + row];
    Matrix3::from_fn(|i, j| match i {
        0 => 0.5 * turned(1, j),
        1 => -0.5 * turned(0, j),
        _ => 0.0,
    })
}

/// Covariances of the attitude errors of now (rows) with those of then.
fn attitudes(columns: &[Mean<'_>; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| columns[j].values.x[3 * PSI + i])
}

/// A bilinear form of attitude errors at one instant, and what it does later.
struct Impulse<'a> {
    form: Matrix3<f64>,
    /// Covariances of the present errors with the attitude errors of then: the true ones, and those that the filter believes in.
    truth: [Mean<'a>; 3],
    filter: [Mean<'a>; 3],
    /// Position and velocity down now for a unit of velocity down then.
    response: Vector2<f64>,
}

impl<'a> Impulse<'a> {
    fn new(form: Matrix3<f64>, pass: &Pass<'a>) -> Self {
        let with_attitude =
            |joint: &Joint<'a>| std::array::from_fn(|j| joint.correlated(&joint.state(3 * PSI + j)));
        let (truth, filter) = (with_attitude(&pass.errors.joint), with_attitude(&pass.filter));
        Self { form, truth, filter, response: VELOCITY }
    }

    /// Covariances with one that begins now: of ½ψᵀAψ of both, and of ψ'ᵀAψ.
    fn covariances(&self, now: &Self) -> [f64; 2] {
        let (truth, filter) = (attitudes(&self.truth), attitudes(&self.filter));
        let symmetric = |form: &Matrix3<f64>| 0.5 * (form + form.transpose());
        // E ψ_i ψ_j ψ_k ψ_l less the product of the means is C_ik C_jl + C_il C_jk; with ψ' independent of ψ it is C'_ik C_jl.
        [
            0.5 * (symmetric(&now.form) * truth * symmetric(&self.form) * truth.transpose()).trace(),
            (now.form.transpose() * filter * self.form * truth.transpose()).trace(),
        ]
    }
}

/// Position and velocity down of second order.
#[derive(Clone, Copy, Default)]
struct Moments {
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
    believed: Matrix2<f64>,
}

impl Moments {
    fn at(&self, t_s: f64) -> SecondOrder {
        let Self { mean, covariance, believed } = self;
        let [variance, believed] = [covariance, believed].map(|p| p.diagonal().into());
        SecondOrder { t_s, mean: (*mean).into(), variance, believed }
    }
}

/// The vertical channel since an outage began.
#[derive(Default)]
struct Channel<'a> {
    impulses: Vec<Impulse<'a>>,
    moments: Moments,
}

impl<'a> Channel<'a> {
    /// Over a step, without what acts in it.
    fn follow(&mut self, step: &Step) {
        let map = Matrix2::from_fn(|i, j| step.m[DOWN[j]][DOWN[i]]);
        for impulse in &mut self.impulses {
            impulse.truth.iter_mut().chain(&mut impulse.filter).for_each(|column| column.step(step));
            impulse.response = map * impulse.response;
        }
        let Moments { mean, covariance, believed } = &mut self.moments;
        *mean = map * *mean;
        [covariance, believed].into_iter().for_each(|p| *p = map * *p * map.transpose());
    }

    /// With an impulse that acts now.
    fn with(&self, now: &Impulse<'_>) -> Moments {
        let mut moments = self.moments;
        let mut add = |[covariance, believed]: [f64; 2], outer: Matrix2<f64>| {
            moments.covariance += covariance * outer;
            moments.believed += believed * outer;
        };
        for then in &self.impulses {
            let outer = then.response * VELOCITY.transpose();
            add(then.covariances(now), outer + outer.transpose());
        }
        add(now.covariances(now), VELOCITY * VELOCITY.transpose());
        moments.mean += 0.5 * (now.form * attitudes(&now.truth)).trace() * VELOCITY;
        moments
    }

    fn and(mut self, now: Impulse<'a>) -> Self {
        self.moments = self.with(&now);
        self.impulses.push(now);
        self
    }
}
