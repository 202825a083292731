//! Reduction of a noise model to white noise and one Gauss-Markov bias: what a 15-state filter can carry.
//!
//! The pair is the one closest to the model's own Haar wavelet variance, in the logarithm, with equal
//! weights, over the scales from one GNSS interval to [`window_s`]. Quantization noise is left out: its
//! integral is bounded. So is a drift: the filter has a state for its slope. The reduction is a pure function of model, interval and window.

use super::{Composite, ParameterError, Process, ProcessKind};
use crate::minimise::{Descent, MOST, Matrix};

/// Longest time scale that matters to a filter whose longest outage is given (s): eight times the outage,
/// at least 800 s. A window no longer than the outage makes the filter overconfident.
#[must_use]
pub fn window_s(longest_outage_s: f64) -> f64 {
    (8.0 * longest_outage_s).max(800.0)
}

/// White noise and one bias in the place of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReducedModel {
    /// Variance of a sample of white noise (units²).
    pub white: f64,
    /// The bias: a Gauss-Markov process, sampled as an AR1.
    pub bias: Process,
    /// Variance of the bias at the start (units²): that of the model's stationary processes; random walks
    /// start at 0.
    pub initial_variance: f64,
    /// Largest |ln(reduced/model)| of the wavelet variance over the scales fitted.
    pub misfit: f64,
}

/// Reason that a model could not be reduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReductionError {
    /// A parameter left its domain.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Fewer than three scales between the GNSS interval and the window.
    #[error(
        "fixes {interval_s} s apart are too rare to reduce the model over scales up to {window_s} s: at most {longest_interval_s:.1} s"
    )]
    TooFewScales {
        /// GNSS interval (s).
        interval_s: f64,
        /// Longest scale (s).
        window_s: f64,
        /// Longest GNSS interval that leaves three scales (s).
        longest_interval_s: f64,
    },
}

/// Reduces the noise of one axis at `rate_hz`, over scales from `interval_s` (one GNSS interval) to
/// `window_s`.
///
/// # Errors
/// When there are too few scales, or a parameter leaves its domain.
pub fn reduce(
    noise: &Composite,
    rate_hz: f64,
    interval_s: f64,
    window_s: f64,
) -> Result<ReducedModel, ReductionError> {
    let kept = carried(noise);
    // Level 1 (two samples) is the first there is; level 40 is three and a half centuries at 100 Hz.
    let level = |seconds: f64| (seconds * rate_hz).max(2.0).log2().round();
    let levels: Vec<u32> = (level(interval_s) as u32..=level(window_s).min(40.0) as u32).collect();
    // Three unknowns: white noise, variance and correlation time of the bias.
    if levels.len() < 3 {
        // the first of three levels is the last less two, to which half a level more is rounded
        let longest_interval_s = (level(window_s).min(40.0) - 1.5).exp2() / rate_hz;
        return Err(ReductionError::TooFewScales {
            interval_s,
            window_s,
            longest_interval_s,
        });
    }
    let target: Vec<f64> = levels.iter().map(|l| kept.haar_wv(*l)).collect();
    let fit = WaveletFit { levels, target };
    let [ln_white, ln_variance, ln_kappa] = fit.solve();
    // The Gauss-Markov bias as the AR1 that it is when sampled; expm1 keeps the digits of 1 − phi² for a slow
    // one.
    let (kappa, variance) = (ln_kappa.exp(), ln_variance.exp());
    Ok(ReducedModel {
        white: ln_white.exp(),
        bias: Process::ar1((-kappa).exp(), variance * -(-2.0 * kappa).exp_m1())?,
        initial_variance: kept.processes.iter().map(Process::initial_variance).sum(),
        misfit: fit
            .residuals(&[ln_white, ln_variance, ln_kappa])
            .iter()
            .fold(0.0, |m, r| r.abs().max(m)),
    })
}

/// Returns true if a filter with one bias per axis represents the noise exactly: at most one
/// process is a bias.
#[must_use]
pub fn is_exact(noise: &Composite) -> bool {
    let states = |p: &Process| match p.kind() {
        ProcessKind::Flicker => 2,
        _ => usize::from(p.recursion().is_some()),
    };
    noise.processes.iter().map(states).sum::<usize>() <= 1
}

/// The processes that the pair stands for: without quantization noise and without drift.
#[must_use]
pub fn carried(noise: &Composite) -> Composite {
    let is_apart = |p: &Process| matches!(p.kind(), ProcessKind::Quantization | ProcessKind::Drift);
    let processes = noise.processes.iter().copied();
    Composite::new(processes.filter(|p| !is_apart(p)).collect())
}

/// Least squares of ln(reduced/model) in (ln sigma2, ln variance, ln kappa), kappa = dt/T.
struct WaveletFit {
    levels: Vec<u32>,
    target: Vec<f64>,
}

impl WaveletFit {
    /// Best start of a grid over the correlation time, then a descent.
    fn solve(&self) -> [f64; 3] {
        let (first, last) = (
            f64::from(self.levels[0]),
            f64::from(self.levels[self.levels.len() - 1]),
        );
        let starts = (0..60).map(|i| {
            // From a quarter of the shortest scale, where the bias looks white, to sixteen times the longest,
            // where it looks like a random walk.
            let log2_tau = first - 2.0 + (last - first + 6.0) * f64::from(i) / 59.0;
            self.start(-log2_tau * std::f64::consts::LN_2)
        });
        let best = starts.min_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
        self.refine(best.expect("grid"))
    }

    /// The two variances for a given kappa: linear least squares of the relative misfit, both kept
    /// positive (a vanishing one is left at 1e-9 of the model's wavelet variance, where it is invisible).
    fn start(&self, ln_kappa: f64) -> [f64; 3] {
        let (mut aa, mut ab, mut bb, mut a1, mut b1) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut a_max, mut b_max) = (0.0_f64, 0.0_f64);
        for (level, target) in self.levels.iter().zip(&self.target) {
            let a = ProcessKind::White.haar_shape(0.0, *level).0 / target;
            let b = ProcessKind::GaussMarkov
                .haar_shape(ln_kappa.exp(), *level)
                .0
                / target;
            (aa, ab, bb, a1, b1) = (aa + a * a, ab + a * b, bb + b * b, a1 + a, b1 + b);
            (a_max, b_max) = (a_max.max(a), b_max.max(b));
        }
        // a·x + b·y ≈ 1 at every scale, in the mean square: to first order that is the logarithm of the
        // ratio.
        let determinant = aa * bb - ab * ab;
        let (mut x, mut y) = (
            (a1 * bb - b1 * ab) / determinant,
            (b1 * aa - a1 * ab) / determinant,
        );
        // Where one amplitude would be negative it is 0, and the other is fitted alone; NaN comes from
        // parallel columns.
        if x.is_nan() || x <= 0.0 {
            (x, y) = (0.0, b1 / bb);
        } else if y.is_nan() || y <= 0.0 {
            (x, y) = (a1 / aa, 0.0);
        }
        [x.max(1e-9 / a_max).ln(), y.max(1e-9 / b_max).ln(), ln_kappa]
    }

    fn residuals(&self, x: &[f64]) -> Vec<f64> {
        let (white, variance, kappa) = (x[0].exp(), x[1].exp(), x[2].exp());
        let model = |l| {
            white * ProcessKind::White.haar_shape(0.0, l).0
                + variance * ProcessKind::GaussMarkov.haar_shape(kappa, l).0
        };
        self.levels
            .iter()
            .zip(&self.target)
            .map(|(l, t)| (model(*l) / t).ln())
            .collect()
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.residuals(x).iter().map(|r| r * r).sum()
    }

    fn refine(&self, start: [f64; 3]) -> [f64; 3] {
        let descent = Descent {
            // Range of ln x for any f64.
            ranges: &[(-700.0, 700.0); 3],
            damping: 1e-3,
            enough: |cost| 1e-15 * cost,
        };
        let found = descent.minimum(
            &start,
            |x| self.cost(x),
            |cost| *cost,
            |x, _| self.normal_equations(x),
        );
        std::array::from_fn(|i| found.at[i])
    }

    /// Half the gradient and half the Gauss–Newton Hessian of the cost.
    fn normal_equations(&self, x: &[f64]) -> (Vec<f64>, Matrix) {
        let (white, variance, kappa) = (x[0].exp(), x[1].exp(), x[2].exp());
        let (mut normal, mut gradient) = ([[0.0; MOST]; MOST], vec![0.0; 3]);
        for (level, target) in self.levels.iter().zip(&self.target) {
            let (shape, slope) = ProcessKind::GaussMarkov.haar_shape(kappa, *level);
            let a = white * ProcessKind::White.haar_shape(0.0, *level).0;
            let b = variance * shape;
            // d ln(a + b) with respect to ln sigma2, ln variance and ln kappa.
            let row = [a, b, variance * slope * kappa].map(|part| part / (a + b));
            for i in 0..3 {
                (0..3).for_each(|j| normal[i][j] += row[i] * row[j]);
                gradient[i] += row[i] * ((a + b) / target).ln();
            }
        }
        (gradient, normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Process;
    use approx::{assert_abs_diff_eq, assert_relative_eq};

    fn ar1(phi: f64, sigma2: f64) -> Process {
        Process::ar1(phi, sigma2).unwrap()
    }

    fn n2() -> Vec<Process> {
        vec![
            Process::white(5e-5).unwrap(),
            ar1(0.9835, 1.3e-8),
            ar1(0.9999, 1e-11),
            Process::random_walk(2.9e-13).unwrap(),
            Process::quantization(1e-7).unwrap(),
        ]
    }

    /// Splitting the bias of a reducible model into two equal halves changes nothing but the form, so the
    /// fit must find the model itself.
    #[test]
    fn the_fit_recovers_a_pair_that_exists() {
        let model = Composite::new(vec![n2()[0], ar1(0.9995, 2e-10), ar1(0.9995, 3e-10)]);
        let reduced = reduce(&model, 100.0, 1.0, 800.0).unwrap();
        assert_relative_eq!(reduced.white, 5e-5, max_relative = 1e-6);
        assert_abs_diff_eq!(reduced.bias.shape(), 0.9995, epsilon = 1e-9);
        assert_relative_eq!(reduced.bias.amplitude(), 5e-10, max_relative = 1e-6);
        assert!(reduced.misfit < 1e-9);
    }

    /// The stationary point reached is the minimum: no start of a much finer search does better.
    #[test]
    fn no_other_pair_is_closer() {
        let kept = Composite::new(n2()[..4].to_vec());
        let levels: Vec<u32> = (7..=16).collect();
        let target = levels.iter().map(|l| kept.haar_wv(*l)).collect();
        let fit = WaveletFit { levels, target };
        let found = fit.cost(&fit.solve());
        for i in 0..4000 {
            let log10 = |k: i32, low: f64, high: f64| {
                (low + (high - low) * f64::from(k) / 15.0) * 10f64.ln()
            };
            let x = [
                log10(i % 16, -6.0, -3.0),
                log10(i / 16 % 16, -12.0, -5.0),
                log10(i / 256, -7.0, -1.0),
            ];
            assert!(found <= fit.cost(&fit.refine(x)) * (1.0 + 1e-6) + 1e-12);
        }
    }

    #[test]
    fn degenerate_models_are_reduced_too() {
        let walk = Composite::new(vec![n2()[3]]);
        let reduced = reduce(&walk, 100.0, 1.0, 800.0).unwrap();
        // a random walk is a Gauss-Markov process of infinite correlation time
        assert!(reduced.misfit < 0.05, "misfit {}", reduced.misfit);
    }

    /// A random walk beyond the correlation time of an AR1: the pair follows the model to eight times an outage of 300 s (level 18
    /// is 2621 s at 100 Hz), no worse than it follows it anywhere; a pair that ends with the outage is off there by a factor of 2.4.
    #[test]
    fn the_pair_holds_to_eight_times_the_outage() {
        assert_eq!(
            [0.0, 90.0, 100.0, 300.0].map(window_s),
            [800.0, 800.0, 800.0, 2400.0]
        );
        let model = Composite::new(vec![n2()[0], ar1(0.9999, 1e-11), n2()[3]]);
        let off_at_the_end = |window_s: f64| {
            let reduced = reduce(&model, 100.0, 1.0, window_s).unwrap();
            let pair = Composite::new(vec![Process::white(reduced.white).unwrap(), reduced.bias]);
            (
                (pair.haar_wv(18) / model.haar_wv(18)).ln().abs(),
                reduced.misfit,
            )
        };
        let (off, misfit) = off_at_the_end(window_s(300.0));
        assert!(off <= misfit * (1.0 + 1e-9), "{off} {misfit}");
        assert!(off_at_the_end(300.0).0 > 2.0_f64.ln());
    }

    /// The interval that is said to be the longest is: a little below it a reduction exists, a little above none.
    #[test]
    fn the_longest_interval_is_where_reductions_end() {
        let walk = Composite::new(vec![n2()[3]]);
        for (rate_hz, window_s) in [(100.0, 2.0), (100.0, 800.0), (400.0, 1234.0), (1.0, 800.0)] {
            let longest = match reduce(&walk, rate_hz, 1e4, window_s) {
                Err(ReductionError::TooFewScales {
                    longest_interval_s, ..
                }) => longest_interval_s,
                other => panic!("{other:?}"),
            };
            assert!(reduce(&walk, rate_hz, 0.999 * longest, window_s).is_ok());
            assert!(reduce(&walk, rate_hz, 1.001 * longest, window_s).is_err());
        }
    }
}
