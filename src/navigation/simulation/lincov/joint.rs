//! The covariance of \[navigation error; bias estimates\] and its correlation with the states of the truth, over steps
//! and measurements.
//!
//! All states but the navigation's lie side by side in [`Lanes`], eight to a register, so that the two maps of a
//! step, of 9 × 9 and 9 × signals, meet rows without a gap.

use super::pass::add_scaled;
use super::track::{AugmentedStates, NAV, Nav, SIGNALS, ScalarMeasurement, Step};
use crate::lanes::{Kernel, LANES, Lanes, Level, Wide, dispatch};
use crate::simulation::BIASES;
use std::ops::Range;

/// Covariance of z = \[x; b\] jointly with states t that no measurement corrects.
///
/// For the filter's own covariance b are its biases' errors and there is no t. For the true one b are its
/// estimates, which nothing drives but the corrections, and t are the negated states of the true IMU: the
/// error of a bias is estimate less truth, so both enter the navigation error alike. States t are independent
/// of one another and stay so.
#[derive(Clone)]
pub(super) struct JointCovariance<'a> {
    pub sides: &'a AugmentedStates,
    pub xx: [Nav; NAV],
    /// A row for each of x: covariances with the states b, then t.
    xs: Vec<Lanes>,
    /// A row for each of b, with b and t.
    bs: Vec<Lanes>,
    tt: Vec<f64>,
    /// Samples so far.
    pub elapsed: f64,
    level: Level,
    /// Intermediate results of a step, and of a measurement.
    means: Vec<Lanes>,
    scratch: Vec<Lanes>,
    measured: UpdateScratch,
}

/// A scalar measurement on the way into the covariance.
#[derive(Clone, Default)]
struct UpdateScratch {
    /// Its coefficients of the states b and t that are not zero.
    form: Vec<(usize, f64)>,
    /// Its covariance with b and t, and the gains of b (zero for t).
    with: Vec<Lanes>,
    gain: Vec<Lanes>,
}

#[inline(always)]
fn at(row: &[Lanes], i: usize) -> f64 {
    row[i / LANES].0[i % LANES]
}

#[inline(always)]
fn at_mut(row: &mut [Lanes], i: usize) -> &mut f64 {
    &mut row[i / LANES].0[i % LANES]
}

impl<'a> JointCovariance<'a> {
    pub(super) fn new(xx: [Nav; NAV], sides: &'a AugmentedStates) -> Self {
        let (states, nb, width) = (&sides.states, sides.estimated, sides.width());
        let mut bs = vec![Lanes::ZERO; nb * width];
        for (i, source) in states[..nb].iter().enumerate() {
            *at_mut(&mut bs[i * width..], i) = source.initial;
        }
        let measured = UpdateScratch {
            form: Vec::new(),
            with: vec![Lanes::ZERO; width],
            gain: vec![Lanes::ZERO; width],
        };
        let tail = sides.tail();
        Self {
            sides,
            xx,
            xs: vec![Lanes::ZERO; NAV * width],
            bs,
            tt: states[nb..].iter().map(|s| s.initial).collect(),
            elapsed: 0.0,
            level: Level::best(),
            means: vec![Lanes::ZERO; states.len() * sides.signals.div_ceil(LANES)],
            scratch: vec![Lanes::ZERO; sides.signals * (width + tail) + NAV * tail],
            measured,
        }
    }

    /// Variances of the biases of the signals: of the sum of the states b of each, drifts at their age.
    pub(super) fn bias_variances(&self) -> [f64; BIASES] {
        let (states, width) = (
            &self.sides.states[..self.sides.estimated],
            self.sides.width(),
        );
        let factors: Vec<f64> = states.iter().map(|s| s.share(self.elapsed)).collect();
        let mut variances = [0.0; BIASES];
        for (i, a) in states.iter().enumerate().filter(|(_, a)| a.signal < BIASES) {
            let row = &self.bs[i * width..];
            let of_signal = states
                .iter()
                .enumerate()
                .filter(|(_, b)| b.signal == a.signal);
            variances[a.signal] += of_signal
                .map(|(j, _)| factors[i] * factors[j] * at(row, j))
                .sum::<f64>();
        }
        variances
    }

    /// Over one step.
    pub(super) fn step(&mut self, step: &Step) {
        dispatch(self.level, Propagation { joint: self, step });
    }

    /// Corrects by a measurement as the filter does whose own covariance this is; adds its gains to `gains`, and returns the
    /// variance that it states for the innovation.
    pub(super) fn measure(&mut self, row: &ScalarMeasurement, gains: &mut Vec<f64>) -> f64 {
        self.set_form(row);
        let correction = Correction {
            joint: self,
            row,
            r: row.r,
            gains: None,
        };
        let (variance, gain) = dispatch(correction.joint.level, correction);
        gains.extend(gain);
        gains.extend((0..self.sides.estimated).map(|i| at(&self.measured.gain, i)));
        variance
    }

    /// Corrects by a measurement with white noise of variance `r`, with the gains of a filter that need not be right;
    /// returns the variance of the innovation.
    pub(super) fn correct(&mut self, row: &ScalarMeasurement, r: f64, gains: &[f64]) -> f64 {
        self.set_form(row);
        let correction = Correction {
            joint: self,
            row,
            r,
            gains: Some(gains),
        };
        dispatch(correction.joint.level, correction).0
    }

    fn set_form(&mut self, row: &ScalarMeasurement) {
        self.measured.form.clear();
        // Most measurements are of the navigation error alone.
        if row.is_of_states(self.sides) {
            let coefficients = self
                .sides
                .states
                .iter()
                .map(|s| row.coefficient(s, self.elapsed));
            let all = coefficients.enumerate().filter(|(_, h)| *h != 0.0);
            self.measured.form.extend(all);
        }
    }

    /// A linear form of a mean of x and of the states, at the row that was measured last.
    pub(super) fn value_of_mean(&self, row: &ScalarMeasurement, x: &Nav, states: &[f64]) -> f64 {
        let of_x: f64 = x.iter().zip(&row.h).map(|(x, h)| x * h).sum();
        of_x + self
            .measured
            .form
            .iter()
            .map(|(j, h)| h * states[*j])
            .sum::<f64>()
    }
}

/// A P Aᵀ + Q in blocks.
struct Propagation<'j, 'a> {
    joint: &'j mut JointCovariance<'a>,
    step: &'j Step,
}

impl Kernel for Propagation<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Self { joint, step } = self;
        let sides = joint.sides;
        let inputs = sides.over(step);
        let (width, tail, signals) = (sides.width(), sides.tail(), sides.signals);
        let (n, nb) = (inputs.sources.len(), sides.estimated);
        let (u, rest) = joint.scratch.split_at_mut(signals * width);
        let (u_tail, tails) = rest.split_at_mut(signals * tail);
        // The covariances of the signals' means over the step: with the states (u), with x and with one another (u_tail);
        // of x with x and the signals (tails).
        let zero = W::from(0.0);
        for lanes in u.iter_mut().chain(&mut *u_tail).chain(&mut *tails) {
            zero.store(lanes);
        }
        let q_mean = &inputs.q_mean[usize::from(!step.white.is_empty())];
        for s in 0..signals {
            // What is new in the mean of a signal acts as the mean itself: Q = Σ q b bᵀ.
            *at_mut(&mut u_tail[s * tail..], NAV + s) = q_mean[s];
        }
        let blocks = signals.div_ceil(LANES);
        for j in 0..n {
            let mean = inputs.sources[j].mean_after(joint.elapsed);
            let s = inputs.sources[j].signal;
            *at_mut(&mut joint.means[j * blocks..], s) = mean;
            if mean == 0.0 {
                continue;
            }
            if j < nb {
                let (row, factor) = (&mut u[s * width..][..width], W::from(mean));
                for c in 0..width {
                    let sum = W::load(&joint.bs[j * width + c]).mul_add(factor, W::load(&row[c]));
                    sum.store(&mut row[c]);
                }
            } else {
                // The states t are independent: of column j only its own variance feeds its signal.
                *at_mut(&mut u[s * width..], j) += mean * joint.tt[j - nb];
            }
        }
        let means = &joint.means;
        // In the columns of b the signals' means have a part of t as well.
        for i in 0..nb {
            let sums = sums::<W>(means, blocks, &joint.bs[i * width..][..width], nb..n);
            for s in 0..signals {
                *at_mut(&mut u[s * width..], i) += at(&sums, s);
            }
        }
        for k in 0..NAV {
            let sums = sums::<W>(means, blocks, &joint.xs[k * width..][..width], 0..n);
            for s in 0..signals {
                *at_mut(&mut tails[k * tail..], NAV + s) = at(&sums, s);
            }
        }
        for s in 0..signals {
            let sums = sums::<W>(means, blocks, &u[s * width..][..width], 0..n);
            for other in 0..signals {
                *at_mut(&mut u_tail[s * tail..], NAV + other) += at(&sums, other);
            }
        }
        for k in 0..NAV {
            for i in 0..NAV {
                *at_mut(&mut tails[k * tail..], i) = joint.xx[i][k];
            }
            for s in 0..signals {
                *at_mut(&mut u_tail[s * tail..], k) = at(&tails[k * tail..][..tail], NAV + s);
            }
        }
        // A P in the columns of x and of the signals' means, from which comes that of x.
        map::<W>(step, tails, u_tail, tail, signals);
        joint.xx = square::<W>(step, tails, tail, signals);
        for (white, unit) in inputs.white.iter().zip(&step.white) {
            if *white != 0.0 {
                for i in 0..NAV {
                    for j in 0..NAV {
                        joint.xx[i][j] += white * unit[i][j];
                    }
                }
            }
        }
        // In the columns of the states, which take their step meanwhile: the w of the step moves the mean input and the
        // state together, cov(x, s) = b q_cross.
        for c in 0..width {
            let decay = W::load(&inputs.decay[c]);
            for s in 0..signals {
                let at = s * width + c;
                let fresh = W::load(&inputs.q_cross[at]);
                W::load(&u[at]).mul_add(decay, fresh).store(&mut u[at]);
            }
            for k in 0..NAV {
                let x = &mut joint.xs[k * width + c];
                (W::load(x) * decay).store(x);
            }
        }
        map::<W>(step, &mut joint.xs, u, width, signals);
        for i in 0..nb {
            let row = &mut joint.bs[i * width..][..width];
            let own = W::from(inputs.sources[i].decay);
            for c in 0..width {
                (W::load(&row[c]) * own * W::load(&inputs.decay[c])).store(&mut row[c]);
            }
            *at_mut(row, i) += inputs.sources[i].q_state;
        }
        for j in nb..n {
            let (source, p) = (&inputs.sources[j], &mut joint.tt[j - nb]);
            *p = *p * source.decay * source.decay + source.q_state;
        }
        joint.elapsed += f64::from(step.samples);
    }
}

/// For each signal the sum over some of its states of their means over the step times what a row has of them. The mean of a
/// state stands in the lane of its signal.
#[inline(always)]
fn sums<W: Wide>(
    means: &[Lanes],
    blocks: usize,
    row: &[Lanes],
    states: Range<usize>,
) -> [Lanes; SIGNALS.div_ceil(LANES)] {
    let mut sums = [Lanes::ZERO; SIGNALS.div_ceil(LANES)];
    for block in 0..blocks {
        // Four sums: each product would wait for the one before.
        let mut parts = [W::from(0.0); 4];
        let mut first = states.start;
        while first + 4 <= states.end {
            for i in 0..4 {
                let mean = W::load(&means[(first + i) * blocks + block]);
                parts[i] = mean.mul_add(W::from(at(row, first + i)), parts[i]);
            }
            first += 4;
        }
        for j in first..states.end {
            let mean = W::load(&means[j * blocks + block]);
            parts[0] = mean.mul_add(W::from(at(row, j)), parts[0]);
        }
        ((parts[0] + parts[1]) + (parts[2] + parts[3])).store(&mut sums[block]);
    }
    sums
}

/// M times the rows of x plus B times those of the signals, in the place of x.
#[inline(always)]
fn map<W: Wide>(step: &Step, x: &mut [Lanes], u: &[Lanes], width: usize, signals: usize) {
    for c in 0..width {
        let mut sum = [W::from(0.0); NAV];
        for k in 0..NAV {
            let row = W::load(&x[k * width + c]);
            for i in 0..NAV {
                sum[i] = row.mul_add(W::from(step.m[k][i]), sum[i]);
            }
        }
        for s in 0..signals {
            let row = W::load(&u[s * width + c]);
            for i in 0..NAV {
                sum[i] = row.mul_add(W::from(step.b[s][i]), sum[i]);
            }
        }
        for i in 0..NAV {
            sum[i].store(&mut x[i * width + c]);
        }
    }
}

/// (A P) Aᵀ of x from the rows of A P in the columns of x and of the signals' means.
///
/// Covariances that should be equal are replaced by their mean. Rounding makes them unequal, corrections leave their
/// difference as it is, and over the steps it would grow as the unaided vertical channel does, by e in some 400 s: after
/// three hours no digit is left.
#[inline(always)]
fn square<W: Wide>(step: &Step, rows: &[Lanes], width: usize, signals: usize) -> [Nav; NAV] {
    // Columns 0 to 7 are one register, the last one follows from symmetry.
    const LAST: usize = NAV - 1;
    let mut sums = [W::from(0.0); NAV];
    let mut corner = 0.0;
    for k in 0..NAV + signals {
        let column = if k < NAV {
            &step.m[k]
        } else {
            &step.b[k - NAV]
        };
        let mut head = Lanes::ZERO;
        head.0.copy_from_slice(&column[..LAST]);
        let head = W::load(&head);
        for i in 0..NAV {
            sums[i] = head.mul_add(W::from(at(&rows[i * width..][..width], k)), sums[i]);
        }
        corner += column[LAST] * at(&rows[LAST * width..][..width], k);
    }
    let mut first = [Lanes::ZERO; NAV];
    for i in 0..NAV {
        sums[i].store(&mut first[i]);
    }
    let mut p = [[0.0; NAV]; NAV];
    for i in 0..LAST {
        for j in 0..LAST {
            p[i][j] = 0.5 * (first[i].0[j] + first[j].0[i]);
        }
        (p[i][LAST], p[LAST][i]) = (first[LAST].0[i], first[LAST].0[i]);
    }
    p[LAST][LAST] = corner;
    p
}

/// z ← z − k y for an innovation y, with the filter's own best gain or with those that are given.
struct Correction<'j, 'a, 'r> {
    joint: &'j mut JointCovariance<'a>,
    row: &'r ScalarMeasurement,
    /// Variance of the measurement's white noise.
    r: f64,
    gains: Option<&'r [f64]>,
}

impl Kernel for Correction<'_, '_, '_> {
    /// Variance of the innovation, and the gains of x.
    type Output = (f64, Nav);

    #[inline(always)]
    fn run<W: Wide>(self) -> (f64, Nav) {
        let Self {
            joint,
            row,
            r,
            gains,
        } = self;
        let (width, nb) = (joint.sides.width(), joint.sides.estimated);
        let UpdateScratch { form, with, gain } = &mut joint.measured;
        // Covariance of everything with the measurement.
        let mut with_x = [0.0; NAV];
        for k in 0..NAV {
            if row.h[k] != 0.0 {
                add_scaled(&mut with_x, row.h[k], &joint.xx[k]);
            }
        }
        for c in 0..width {
            let mut sum = W::from(0.0);
            for k in 0..NAV {
                if row.h[k] != 0.0 {
                    sum = W::load(&joint.xs[k * width + c]).mul_add(W::from(row.h[k]), sum);
                }
            }
            sum.store(&mut with[c]);
        }
        for (j, h) in &*form {
            for k in 0..NAV {
                with_x[k] += h * at(&joint.xs[k * width..][..width], *j);
            }
            if *j < nb {
                for c in 0..width {
                    let row = W::load(&joint.bs[j * width + c]);
                    row.mul_add(W::from(*h), W::load(&with[c]))
                        .store(&mut with[c]);
                }
            } else {
                for i in 0..nb {
                    *at_mut(with, i) += h * at(&joint.bs[i * width..][..width], *j);
                }
                *at_mut(with, *j) += h * joint.tt[j - nb];
            }
        }
        // hᵀ P h + r
        let mut variance = r;
        for k in 0..NAV {
            variance += row.h[k] * with_x[k];
        }
        for (j, h) in &*form {
            variance += h * at(with, *j);
        }
        let mut gain_x = [0.0; NAV];
        for i in 0..NAV {
            // the gain that is best where the covariance is right
            gain_x[i] = gains.map_or(with_x[i] / variance, |gains| gains[i]);
        }
        for i in 0..nb {
            *at_mut(gain, i) = gains.map_or(at(with, i) / variance, |gains| gains[NAV + i]);
        }
        // P − k cᵀ − c kᵀ + k s kᵀ, by (s k − c) kᵀ − k cᵀ
        // With the optimal gain s k = c and the first term is zero. Here c is of the truth and k of the filter. A state t
        // has no gain: a measurement does not change what truly makes the errors, only the estimate's relation to it.
        for i in 0..NAV {
            let rest = variance * gain_x[i] - with_x[i];
            for j in 0..NAV {
                joint.xx[i][j] += rest * gain_x[j] - gain_x[i] * with_x[j];
            }
            outer::<W>(&mut joint.xs[i * width..], rest, gain_x[i], gain, with);
        }
        for i in 0..nb {
            let (k, c) = (at(gain, i), at(with, i));
            outer::<W>(&mut joint.bs[i * width..], variance * k - c, k, gain, with);
        }
        (variance, gain_x)
    }
}

/// Adds `rest` times the gains less `k` times the covariances to a row.
#[inline(always)]
fn outer<W: Wide>(row: &mut [Lanes], rest: f64, k: f64, gain: &[Lanes], with: &[Lanes]) {
    for c in 0..gain.len() {
        let sum = W::load(&gain[c]).mul_add(W::from(rest), W::load(&row[c]));
        W::load(&with[c])
            .mul_add(W::from(-k), sum)
            .store(&mut row[c]);
    }
}
