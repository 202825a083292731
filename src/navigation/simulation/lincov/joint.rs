//! The covariance of \[navigation error; bias estimates\] and its correlation with the states of the truth.

use super::column::Column;
use super::input::{SIGNALS, StepOfSource};
use super::sides::{Inputs, Sides};
use super::track::{NAV, Nav, Row, Step};
use crate::simulation::BIASES;
use multiversion::multiversion;

/// Covariance of z = \[x; b\] jointly with states t that no measurement corrects.
///
/// For the filter's own covariance b are its biases' errors and there is no t. For the true one b are its
/// estimates, which nothing drives but the corrections, and t are the negated states of the true IMU: the
/// error of a bias is estimate less truth, so both enter the navigation error alike. States t are independent
/// of one another and stay so.
#[derive(Debug, Clone)]
pub(super) struct Joint<'a> {
    sides: &'a Sides,
    pub(super) xx: [Nav; NAV],
    xb: Vec<Nav>,
    /// Row-major.
    bb: Vec<f64>,
    xt: Vec<Nav>,
    /// A row for each b.
    bt: Vec<f64>,
    tt: Vec<f64>,
    /// Samples so far.
    elapsed: f64,
}

impl<'a> Joint<'a> {
    pub(super) fn new(xx: [Nav; NAV], sides: &'a Sides) -> Self {
        let (b, t) = (&sides.b, &sides.t);
        let (nb, nt) = (b.states.len(), t.states.len());
        let mut bb = vec![0.0; nb * nb];
        for (i, source) in b.states.iter().enumerate() {
            bb[i * nb + i] = source.initial;
        }
        Self {
            sides,
            xx,
            xb: vec![[0.0; NAV]; nb],
            bb,
            xt: vec![[0.0; NAV]; nt],
            bt: vec![0.0; nb * nt],
            tt: t.states.iter().map(|s| s.initial).collect(),
            elapsed: 0.0,
        }
    }

    /// Variances of the biases of the signals: of the sum of the states b of each, drifts at their age.
    pub(super) fn bias_variances(&self) -> [f64; BIASES] {
        let states = &self.sides.b.states;
        let factors: Vec<f64> = states.iter().map(|s| s.share(self.elapsed)).collect();
        let (nb, mut variances) = (factors.len(), [0.0; BIASES]);
        for (i, a) in states.iter().enumerate().filter(|(_, a)| a.signal < BIASES) {
            let of_signal = states
                .iter()
                .enumerate()
                .filter(|(_, b)| b.signal == a.signal);
            variances[a.signal] += of_signal
                .map(|(j, _)| factors[i] * factors[j] * self.bb[i * nb + j])
                .sum::<f64>();
        }
        variances
    }

    /// Covariance of everything with a linear form of the states as they are now.
    pub(super) fn covariance_with(&self, form: &Column) -> Column {
        let (nb, nt) = (self.xb.len(), self.xt.len());
        let mut x = [0.0; NAV];
        for (column, h) in self.xx.iter().zip(&form.x) {
            add_scaled(&mut x, *h, column);
        }
        let product = |x: &Nav| -> f64 { x.iter().zip(&form.x).map(|(a, h)| a * h).sum() };
        let mut b: Vec<f64> = self.xb.iter().map(product).collect();
        let mut t: Vec<f64> = self.xt.iter().map(product).collect();
        // Most measurements are of the navigation error alone.
        for (j, h) in form.b.iter().enumerate().filter(|(_, h)| **h != 0.0) {
            add_scaled(&mut x, *h, &self.xb[j]);
            (0..nb).for_each(|i| b[i] += h * self.bb[i * nb + j]);
            (0..nt).for_each(|i| t[i] += h * self.bt[j * nt + i]);
        }
        for (j, h) in form.t.iter().enumerate().filter(|(_, h)| **h != 0.0) {
            add_scaled(&mut x, *h, &self.xt[j]);
            (0..nb).for_each(|i| b[i] += h * self.bt[i * nt + j]);
            t[j] += h * self.tt[j];
        }
        Column { x, b, t }
    }

    /// Over one step.
    pub(super) fn step(&mut self, step: &Step) {
        over(self, step);
    }

    /// A P Aᵀ + Q in blocks.
    #[inline(always)]
    fn propagate(&mut self, step: &Step) {
        let signals = self.sides.signals;
        let inputs = self.sides.over(step);
        let (nb, nt) = (inputs.b.len(), inputs.t.len());
        let elapsed = self.elapsed;
        let mean = |s: &StepOfSource| s.mean + s.ramp * elapsed;
        // A P, rows of x. Column by column: M times the column's x part, B times the means of its biases.
        let mut gx = [[0.0; NAV]; NAV];
        for j in 0..NAV {
            let mut u = [0.0; SIGNALS];
            inputs
                .b
                .iter()
                .zip(&self.xb)
                .for_each(|(s, x)| u[s.signal] += mean(s) * x[j]);
            inputs
                .t
                .iter()
                .zip(&self.xt)
                .for_each(|(s, x)| u[s.signal] += mean(s) * x[j]);
            // Into a copy: the cross terms below still need P before the step.
            gx[j] = step.map(&self.xx[j], &u[..signals]);
        }
        for j in 0..nb {
            let mut u = [0.0; SIGNALS];
            inputs
                .b
                .iter()
                .zip(&self.bb[j * nb..])
                .for_each(|(s, p)| u[s.signal] += mean(s) * p);
            inputs
                .t
                .iter()
                .zip(&self.bt[j * nt..])
                .for_each(|(s, p)| u[s.signal] += mean(s) * p);
            self.xb[j] = step.map(&self.xb[j], &u[..signals]);
        }
        for j in 0..nt {
            let mut u = [0.0; SIGNALS];
            inputs
                .b
                .iter()
                .enumerate()
                .for_each(|(i, s)| u[s.signal] += mean(s) * self.bt[i * nt + j]);
            // The states t are independent: of column j only its own variance feeds its signal.
            u[inputs.t[j].signal] += mean(&inputs.t[j]) * self.tt[j];
            self.xt[j] = step.map(&self.xt[j], &u[..signals]);
        }
        // (A P) Aᵀ: the same map on the rows of A P.
        for i in 0..NAV {
            let row: Nav = std::array::from_fn(|j| gx[j][i]);
            let mut u = [0.0; SIGNALS];
            inputs
                .b
                .iter()
                .zip(&self.xb)
                .for_each(|(s, x)| u[s.signal] += mean(s) * x[i]);
            inputs
                .t
                .iter()
                .zip(&self.xt)
                .for_each(|(s, x)| u[s.signal] += mean(s) * x[i]);
            self.xx[i] = step.map(&row, &u[..signals]);
        }
        // The states themselves last: the maps above are of their values at the beginning of the step.
        self.step_biases(step, inputs);
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
    fn step_biases(&mut self, step: &Step, inputs: &Inputs) {
        let (nb, nt) = (inputs.b.len(), inputs.t.len());
        let decay = |x: &mut Nav, s: &StepOfSource| {
            x.iter_mut().for_each(|v| *v *= s.decay);
            // The w of the step moves the mean input and the state together: cov(x, s) = b q_cross.
            step.b
                .get(s.signal)
                .into_iter()
                .for_each(|b| add_scaled(x, s.q_cross, b));
        };
        self.xb
            .iter_mut()
            .zip(&inputs.b)
            .for_each(|(x, s)| decay(x, s));
        self.xt
            .iter_mut()
            .zip(&inputs.t)
            .for_each(|(x, s)| decay(x, s));
        for (i, s) in inputs.b.iter().enumerate() {
            let (bb, bt) = (
                &mut self.bb[i * nb..(i + 1) * nb],
                &mut self.bt[i * nt..(i + 1) * nt],
            );
            bb.iter_mut()
                .zip(&inputs.b)
                .for_each(|(p, other)| *p *= s.decay * other.decay);
            bt.iter_mut()
                .zip(&inputs.t)
                .for_each(|(p, other)| *p *= s.decay * other.decay);
            bb[i] += s.q_state;
        }
        for (p, s) in self.tt.iter_mut().zip(&inputs.t) {
            *p = *p * s.decay * s.decay + s.q_state;
        }
    }

    /// What a row measures, as a linear form.
    pub(super) fn measured(&self, row: &Row) -> Column {
        Column::measured(row, self.sides, self.elapsed)
    }

    /// A measurement with white noise of variance `r`.
    pub(super) fn innovation(&self, measured: &Column, r: f64) -> Innovation {
        let with = self.covariance_with(measured);
        // hᵀ P h + r
        let s = r + measured.dot(&with);
        Innovation { with, s }
    }

    /// Corrects by a measurement as the filter does whose own covariance this is; returns its gain, and the variance that it
    /// states for the innovation.
    pub(super) fn measure(&mut self, row: &Row) -> (Gain, f64) {
        let y = self.innovation(&self.measured(row), row.r);
        let gain = y.gain();
        self.correct(&y, &gain);
        (gain, y.s)
    }

    /// z ← z − k y for an innovation y; the gain belongs to a filter that need not be right.
    pub(super) fn correct(&mut self, y: &Innovation, gain: &Gain) {
        corrected(self, y, gain);
    }

    #[inline(always)]
    fn update(&mut self, y: &Innovation, gain: &Gain) {
        let (nb, nt, with) = (self.xb.len(), self.xt.len(), &y.with);
        // P − k cᵀ − c kᵀ + k s kᵀ, by (s k − c) kᵀ − k cᵀ
        // With the optimal gain s k = c and the first term is zero. Here c is of the truth and k of the
        // filter.
        let rest_x: Nav = std::array::from_fn(|i| y.s * gain.x[i] - with.x[i]);
        for j in 0..NAV {
            add_scaled(&mut self.xx[j], gain.x[j], &rest_x);
            add_scaled(&mut self.xx[j], -with.x[j], &gain.x);
        }
        let (mut bb, mut bt) = (
            self.bb.chunks_exact_mut(nb.max(1)),
            self.bt.chunks_exact_mut(nt.max(1)),
        );
        for (xb, (k, c)) in self.xb.iter_mut().zip(gain.b.iter().zip(&with.b)) {
            add_scaled(xb, *k, &rest_x);
            add_scaled(xb, -c, &gain.x);
            let rest = y.s * k - c;
            let row = bb.next().into_iter().flatten();
            for (p, (other, with)) in row.zip(gain.b.iter().zip(&with.b)) {
                *p += rest * other - k * with;
            }
            // t has no gain: a measurement does not change what truly makes the errors, only the
            // estimate's relation to it.
            let row = bt.next().into_iter().flatten();
            row.zip(&with.t).for_each(|(p, with)| *p -= k * with);
        }
        for (xt, c) in self.xt.iter_mut().zip(&with.t) {
            add_scaled(xt, -c, &gain.x);
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
        let nb = self.xb.len();
        for i in 0..nb {
            for j in 0..i {
                let mean = 0.5 * (self.bb[i * nb + j] + self.bb[j * nb + i]);
                (self.bb[i * nb + j], self.bb[j * nb + i]) = (mean, mean);
            }
        }
    }
}

/// Covariances with an innovation, and its variance.
#[derive(Debug, Clone)]
pub(super) struct Innovation {
    pub(super) with: Column,
    /// Its variance.
    pub(super) s: f64,
}

impl Innovation {
    /// The gain that is best where the covariance is right.
    fn gain(&self) -> Gain {
        Gain {
            x: self.with.x.map(|c| c / self.s),
            b: self.with.b.iter().map(|c| c / self.s).collect(),
        }
    }
}

/// A filter's gain.
#[derive(Debug, Clone)]
pub(super) struct Gain {
    pub(super) x: Nav,
    pub(super) b: Vec<f64>,
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
fn corrected(joint: &mut Joint<'_>, y: &Innovation, gain: &Gain) {
    joint.update(y, gain);
}

#[inline(always)]
pub(super) fn add_scaled(to: &mut Nav, factor: f64, x: &Nav) {
    for (to, x) in to.iter_mut().zip(x) {
        *to += factor * x;
    }
}
