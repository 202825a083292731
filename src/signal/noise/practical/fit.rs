//! The policies `matched` and `envelope`: searches of one or two variables over the horizon.

use super::{Bias, Curve, Markov, Pair, Policy};

/// Below this share of the model's Allan variance a part is invisible; the searches begin there.
const LEAST_SHARE: f64 = 1e-9;

/// Allan variance of white noise of density 1 at `rate_hz`.
pub(super) fn white(samples: u32, rate_hz: f64) -> f64 {
    rate_hz / f64::from(samples)
}

/// Allan variance of a random walk of density 1, or of a Gauss-Markov process of variance 1 and correlation time T.
pub(super) fn bias(t_corr_s: Option<f64>, samples: u32, rate_hz: f64) -> f64 {
    let m = f64::from(samples);
    // K²τ/3 with the term of the sampling: twice the wavelet variance gamma2 (4m² + 2)/(24m), gamma2 = K²/f.
    let Some(t_corr_s) = t_corr_s else {
        return (2.0 * m * m + 1.0) / (6.0 * m * rate_hz);
    };
    let kappa = 1.0 / (t_corr_s * rate_hz);
    super::super::allan::unit_markov(kappa, samples)
}

/// The pair of a policy.
pub(super) fn pair(curve: &Curve, policy: Policy, kind: Bias) -> Pair {
    let t_corr_s = match kind {
        Bias::Walk => None,
        Bias::MarkovOf(t_corr_s) => Some(t_corr_s),
        Bias::Markov => Some(correlation_time_s(&[curve], policy)),
    };
    let found = Problem::new(curve, policy, t_corr_s).solve();
    let (density, amplitude) = (found.white.sqrt(), found.bias.sqrt());
    match t_corr_s {
        None => Pair {
            density,
            walk: amplitude,
            markov: None,
        },
        Some(t_corr_s) => Pair {
            density,
            walk: 0.0,
            markov: Some(Markov {
                sigma: amplitude,
                t_corr_s,
            }),
        },
    }
}

/// The correlation time whose pairs are the closest to the curves together (s). A curve without a bias is as close with
/// any: it has no say.
pub(super) fn correlation_time_s(curves: &[&Curve], policy: Policy) -> f64 {
    // A quarter of the horizon's begin looks white over it, thirty times its end like a random walk.
    let horizon = curves[0].horizon;
    let (low, high) = (horizon.from_s / 4.0, horizon.to_s * 30.0);
    let misfit = |ln_t: f64| -> f64 {
        curves
            .iter()
            .map(|curve| Problem::new(curve, policy, Some(ln_t.exp())).solve().misfit)
            .sum()
    };
    least(low.ln(), high.ln(), 60, misfit).0.exp()
}

/// Squares of N and of K (or sigma_b), and the sum of squares of the logarithms of the Allan deviation ratios.
#[derive(Clone, Copy)]
struct Solution {
    white: f64,
    bias: f64,
    misfit: f64,
}

/// One row per averaging time: Allan variances of unit white noise and unit bias, and the model's.
struct Problem {
    rows: Vec<[f64; 3]>,
    reference: [f64; 3],
    policy: Policy,
}

impl Problem {
    fn new(curve: &Curve, policy: Policy, t_corr_s: Option<f64>) -> Self {
        let row = |p: &super::Point| {
            let target = if policy == Policy::Envelope {
                p.whole
            } else {
                p.carried
            };
            [
                white(p.samples, curve.rate_hz),
                bias(t_corr_s, p.samples, curve.rate_hz),
                target,
            ]
        };
        Self {
            rows: curve.points.iter().map(row).collect(),
            reference: row(&curve.reference),
            policy,
        }
    }

    /// Searches the white variance: the bias follows from it in both policies.
    fn solve(&self) -> Solution {
        let [w, _, target] = self.reference;
        let most = match self.policy {
            Policy::Envelope => self
                .rows
                .iter()
                .map(|[w, _, target]| target / w)
                .fold(0.0, f64::max),
            // White noise alone may not exceed the Allan variance at the reference, through which the pair
            // goes.
            _ => target / w,
        };
        // Neither end is in reach of a search in the logarithm: no white noise, no bias.
        let ends = [self.with_white(0.0), self.with_white(most)];
        // The best may lie close to either end: one search is logarithmic in what white noise leaves to the
        // bias, the other in the white noise.
        let (ln_rest, _) = least(LEAST_SHARE.ln(), -LEAST_SHARE, 80, |x| {
            self.with_white(most * -x.exp_m1()).misfit
        });
        let (ln_white, _) = least(LEAST_SHARE.ln(), 0.0, 80, |x| {
            self.with_white(most * x.exp()).misfit
        });
        let inner = [
            self.with_white(most * -ln_rest.exp_m1()),
            self.with_white(most * ln_white.exp()),
        ];
        let all = ends.into_iter().chain(inner);
        all.min_by(|a, b| a.misfit.total_cmp(&b.misfit))
            .unwrap_or(ends[1])
    }

    /// The bias that goes with a white variance: through the model's Allan variance at the reference, or over it
    /// everywhere.
    fn with_white(&self, white: f64) -> Solution {
        let rest = |[w, b, target]: &[f64; 3]| ((target - white * w) / b).max(0.0);
        let bias = match self.policy {
            Policy::Envelope => self.rows.iter().map(rest).fold(0.0, f64::max),
            _ => rest(&self.reference),
        };
        // Half: the logarithm is of the deviation, the rows are variances.
        let log_ratio = |[w, b, target]: &[f64; 3]| 0.5 * ((white * w + bias * b) / target).ln();
        let misfit = self.rows.iter().map(log_ratio).map(|r| r * r).sum();
        Solution {
            white,
            bias,
            misfit,
        }
    }
}

/// Least point of a function of one variable on an interval, and the value there: the best of a grid, then
/// golden sections between its neighbours.
fn least(low: f64, high: f64, steps: u32, f: impl Fn(f64) -> f64) -> (f64, f64) {
    let grid = |i: u32| low + (high - low) * f64::from(i) / f64::from(steps);
    let best = (0..=steps)
        .map(|i| (i, f(grid(i))))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(i, _)| i);
    let (mut a, mut b) = (grid(best.saturating_sub(1)), grid((best + 1).min(steps)));
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    while b - a > 1e-9 * (1.0 + a.abs()) {
        let (left, right) = (b - golden * (b - a), a + golden * (b - a));
        if f(left) <= f(right) {
            b = right
        } else {
            a = left
        }
    }
    let middle = 0.5 * (a + b);
    // The end of the interval may be the best and golden sections only come near it.
    [grid(best), middle]
        .map(|x| (x, f(x)))
        .into_iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((middle, f(middle)))
}
