//! Practitioners' parameters: what other programs call N, K, B and T, from a noise model.
//!
//! Filters elsewhere know white noise of density N (units/√Hz; "angle" or "velocity random walk") and a bias that is a
//! random walk of density K (units/s/√Hz; "rate random walk") or a Gauss-Markov process of standard deviation sigma_b
//! and correlation time T. With the averaging time τ their Allan variances are ([IEEE 952](crate::bibliography::Ieee952),
//! annex C)
//!
//! ```text
//! N²/τ      K²τ/3      (q T)²/τ·[1 − (T/2τ)(3 − 4e^(−τ/T) + e^(−2τ/T))],  q² = 2 sigma_b²/T
//! ```
//!
//! N²/τ rules below τ = √3 N/K, K²τ/3 above. Models with several AR1 are more than such a pair; a [`Policy`] says which
//! pair stands for them over a [`Horizon`] of averaging times, and [`NoiseDensities::closure`] by how much it is off.
//!
//! ```
//! use nav_sim_signal::noise::{practical::*, Composite, Process};
//! // no WN at all: an AR1 of a few milliseconds is the white noise
//! let axis = Composite::new(vec![Process::ar1(0.5, 1e-4)?]);
//! let curve = Curve::largest(&[&axis], 100.0, Horizon::default())?;
//! assert_eq!(curve.pair(Policy::Strict, Bias::Walk).density, 0.0);
//! let matched = curve.pair(Policy::Matched, Bias::Walk);
//! // its low-frequency density is sqrt(sigma2 dt)/(1 − phi)
//! assert!((matched.density / 2e-3 - 1.0).abs() < 0.02);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::continuous::{walk_density, white_density};
use super::{Composite, Process, ProcessKind};
use crate::minimise::line_minimum;
use crate::units::Refused;

/// Averaging times per octave at which curves are compared.
const PER_OCTAVE: f64 = 16.0;

/// Averaging times over which a pair stands for a model (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Horizon {
    /// Shortest (s).
    pub from_s: f64,
    /// Longest (s).
    pub to_s: f64,
}

impl Default for Horizon {
    /// 1 s to 100 s: from one GNSS or camera interval to an outage.
    fn default() -> Self {
        Self {
            from_s: 1.0,
            to_s: 100.0,
        }
    }
}

/// Rule by which a pair stands for a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Policy {
    /// Only what the model has under that name: WN is N, RW is K, the slowest AR1 or GM is the Gauss-Markov bias.
    Strict,
    /// The model's Allan deviation at 1 s exactly, and the bias by least squares of the logarithm of the Allan deviation
    /// over the horizon. Quantization noise and drift, which such a pair cannot carry, are left out.
    Matched,
    /// The smallest pair whose Allan deviation is nowhere below the model's over the horizon, quantization noise and
    /// drift included.
    Envelope,
}

crate::named!(Policy { Strict = "strict", Matched = "matched", Envelope = "envelope" });

/// Model of the bias in the other program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BiasModel {
    /// A random walk.
    Walk,
    /// A Gauss-Markov process, its correlation time sought too.
    Markov,
    /// A Gauss-Markov process of a given correlation time (s).
    MarkovOf(f64),
}

/// A Gauss-Markov process.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Markov {
    /// Standard deviation (units).
    pub sigma: f64,
    /// Correlation time (s).
    pub t_corr_s: f64,
}

impl Markov {
    /// Density of the white noise that drives it, sigma √(2/T) (units/s/√Hz).
    pub fn drive(&self) -> f64 {
        self.sigma * (2.0 / self.t_corr_s).sqrt()
    }
}

/// White noise and a bias: what is exported.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct NoiseDensities {
    /// White noise density N (units/√Hz).
    pub density: f64,
    /// Random-walk density K (units/s/√Hz).
    pub walk: f64,
    /// Gauss-Markov bias.
    pub markov: Option<Markov>,
}

impl NoiseDensities {
    /// Its Allan variance (units²) for averages over `samples` at `rate_hz`, sampled as the model is.
    pub fn allan_variance(&self, samples: u32, rate_hz: f64) -> f64 {
        let n2 = self.density * self.density * white(samples, rate_hz);
        let k2 = self.walk * self.walk * bias(None, samples, rate_hz);
        let gm = |m: Markov| m.sigma * m.sigma * bias(Some(m.t_corr_s), samples, rate_hz);
        n2 + k2 + self.markov.map_or(0.0, gm)
    }

    /// Averaging time from which on the random walk exceeds the white noise, τ = √3 N/K (s); none without a
    /// random walk.
    pub fn crossover_s(&self) -> Option<f64> {
        (self.walk > 0.0).then(|| 3.0_f64.sqrt() * self.density / self.walk)
    }

    /// First averaging time (s), from its crossover on and up to `to_s`, at which its Allan deviation is more than `factor`
    /// times that of a model: from there on the model's deviation does not rise as the random walk's does. None where it is
    /// nowhere, or without a random walk.
    pub fn departs_s(
        &self,
        model: &Composite,
        rate_hz: f64,
        to_s: f64,
        factor: f64,
    ) -> Option<f64> {
        let longest = (to_s * rate_hz).min(f64::from(1_u32 << 30));
        let from = (self.crossover_s()? * rate_hz).max(1.0);
        let is_above =
            |m: &u32| self.allan_variance(*m, rate_hz) > factor * factor * model.allan_variance(*m);
        let departs = averages(from, longest.max(from))
            .into_iter()
            .find(is_above)?;
        Some(f64::from(departs) / rate_hz)
    }

    /// Smallest and largest ratio of its Allan deviation to that of the model.
    pub fn closure(&self, curve: &AllanCurve) -> PairClosure {
        let ratio = |p: &Point| Ratio {
            ratio: (self.allan_variance(p.samples, curve.rate_hz) / p.whole).sqrt(),
            tau_s: f64::from(p.samples) / curve.rate_hz,
        };
        let ratios: Vec<Ratio> = curve.points.iter().map(ratio).collect();
        let by_ratio = |a: &&Ratio, b: &&Ratio| a.ratio.total_cmp(&b.ratio);
        let first = ratios[0];
        PairClosure {
            lowest: *ratios.iter().min_by(by_ratio).unwrap_or(&first),
            highest: *ratios.iter().max_by(by_ratio).unwrap_or(&first),
        }
    }
}

/// Ratio of Allan deviations, exported pair to model, at one averaging time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Ratio {
    /// Allan deviation of the pair over that of the model.
    pub ratio: f64,
    /// Averaging time (s).
    pub tau_s: f64,
}

/// The closure certificate: how an exported pair compares with the model over the horizon.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PairClosure {
    /// Smallest ratio over the horizon.
    pub lowest: Ratio,
    /// Largest ratio over the horizon.
    pub highest: Ratio,
}

/// The Allan variance that a pair has to stand for.
#[derive(Debug, Clone, PartialEq)]
pub struct AllanCurve {
    axes: Vec<Composite>,
    rate_hz: f64,
    points: Vec<Point>,
    /// At 1 s, or the sample nearest to it.
    reference: Point,
    horizon: Horizon,
}

/// The largest axis at one averaging time.
#[derive(Debug, Clone, PartialEq)]
struct Point {
    samples: u32,
    /// Allan variance of the whole model.
    whole: f64,
    /// Allan variance without quantization noise and drift.
    carried: f64,
}

impl AllanCurve {
    /// The Allan variance of the largest of some axes at each averaging time of the horizon.
    ///
    /// # Errors
    /// When the horizon is too short or too long for the rate, or the axes have no noise there.
    pub fn largest(axes: &[&Composite], rate_hz: f64, horizon: Horizon) -> Result<Self, Refused> {
        let Horizon { from_s, to_s } = horizon;
        let (shortest_s, longest_s) = (1.0 / rate_hz, f64::from(1_u32 << 30) / rate_hz);
        let usable =
            from_s >= shortest_s * (1.0 - 1e-9) && to_s >= 4.0 * from_s && to_s <= longest_s;
        if !usable {
            return Err(Refused(format!(
                "the horizon {from_s} s to {to_s} s is refused: at {rate_hz} Hz it must begin at {shortest_s} s or later, span a factor of four and end below {longest_s:.0} s"
            )));
        }
        let point = |samples| point(axes, samples);
        let points: Vec<Point> = averages(from_s * rate_hz, to_s * rate_hz)
            .into_iter()
            .map(point)
            .collect();
        if let Some(p) = points.iter().find(|p| p.whole <= 0.0) {
            let tau_s = f64::from(p.samples) / rate_hz;
            return Err(Refused(format!(
                "the model has no noise at an averaging time of {tau_s} s"
            )));
        }
        // N is read at 1 s, where N²/τ is N².
        let reference = point((rate_hz.round() as u32).max(1));
        let axes = axes.iter().map(|a| (*a).clone()).collect();
        Ok(Self {
            axes,
            rate_hz,
            points,
            reference,
            horizon,
        })
    }

    /// The pair that stands for the model.
    pub fn pair(&self, policy: Policy, bias: BiasModel) -> NoiseDensities {
        let walk = bias == BiasModel::Walk;
        // A model that is such a pair is itself the best one, exactly and not to the accuracy of a search.
        if policy == Policy::Strict || (walk && self.is_white_and_walk()) {
            return self.strict(walk);
        }
        pair(self, policy, bias)
    }

    /// The one correlation time of Gauss-Markov biases that suits this curve and another together (s), by least squares
    /// over both: a curve without a bias leaves it to the other. Not for [`Policy::Strict`], which takes times as they are.
    pub fn shared_correlation_time_s(&self, other: &Self, policy: Policy) -> f64 {
        correlation_time_s(&[self, other], policy)
    }

    /// Returns true if all axes have the same white noise and random walk, so that the largest is
    /// one of them.
    fn is_white_and_walk(&self) -> bool {
        let pair = |p: &Process| matches!(p.kind(), ProcessKind::White | ProcessKind::RandomWalk);
        self.axes
            .iter()
            .all(|a| *a == self.axes[0] && a.processes.iter().all(pair))
    }

    fn strict(&self, walk: bool) -> NoiseDensities {
        // Each figure is the largest of any axis, so the pair need not be that of one of them.
        let largest = |f: &dyn Fn(&Composite) -> f64| self.axes.iter().map(f).fold(0.0, f64::max);
        let density =
            largest(&|axis| white_density(axis.amplitude_of(ProcessKind::White), self.rate_hz));
        let k =
            largest(&|axis| walk_density(axis.amplitude_of(ProcessKind::RandomWalk), self.rate_hz));
        let slowest = self.axes.iter().filter_map(|axis| {
            let own = axis.processes.iter();
            own.filter_map(|p| markov_of(p, self.rate_hz))
                .max_by(|a, b| a.t_corr_s.total_cmp(&b.t_corr_s))
        });
        // Of each axis the slowest, of these the largest: a filter has one bias state an axis, and one figure
        // for all three.
        let markov = slowest.max_by(|a, b| a.sigma.total_cmp(&b.sigma));
        NoiseDensities {
            density,
            walk: if walk { k } else { 0.0 },
            markov: markov.filter(|_| !walk),
        }
    }

    /// Largest share that quantization noise and drift have of the Allan variance over the horizon, and where (s): what
    /// [`Policy::Matched`] leaves out.
    pub fn left_out(&self) -> Ratio {
        let share = |p: &Point| Ratio {
            ratio: 1.0 - p.carried / p.whole,
            tau_s: f64::from(p.samples) / self.rate_hz,
        };
        let none = Ratio {
            ratio: 0.0,
            tau_s: self.horizon.from_s,
        };
        self.points
            .iter()
            .map(share)
            .fold(none, |a, b| if b.ratio > a.ratio { b } else { a })
    }
}

fn point(axes: &[&Composite], samples: u32) -> Point {
    let largest = |f: &dyn Fn(&Process) -> bool| {
        let of_axis = |axis: &&Composite| -> f64 {
            axis.processes
                .iter()
                .filter(|p| f(p))
                .map(|p| p.allan_variance(samples))
                .sum()
        };
        axes.iter().map(of_axis).fold(0.0, f64::max)
    };
    let carried = |p: &Process| !matches!(p.kind(), ProcessKind::Quantization | ProcessKind::Drift);
    Point {
        samples,
        whole: largest(&|_| true),
        carried: largest(&carried),
    }
}

/// Whole numbers of samples from one to another, evenly in the logarithm.
fn averages(from: f64, to: f64) -> Vec<u32> {
    let steps = ((to / from).log2() * PER_OCTAVE).ceil();
    let factor = |i: u32| {
        (from * (to / from).powf(f64::from(i) / steps))
            .round()
            .max(1.0) as u32
    };
    let mut all: Vec<u32> = (0..=steps as u32).map(factor).collect();
    // Of few samples neighbouring times round to the same number, which would count twice.
    all.dedup();
    all
}

/// Standard deviation and correlation time of an AR1 or GM that has them.
fn markov_of(process: &Process, rate_hz: f64) -> Option<Markov> {
    let [.., variance] = process.recursion()?;
    let t_corr_s = process
        .correlation_time_s(rate_hz)
        .filter(|_| variance > 0.0)?;
    Some(Markov {
        sigma: variance.sqrt(),
        t_corr_s,
    })
}

// The policies `matched` and `envelope`: searches of one or two variables over the horizon.

/// Below this share of the model's Allan variance a part is invisible; the searches begin there.
const LEAST_SHARE: f64 = 1e-9;

/// Allan variance of white noise of density 1 at `rate_hz`.
fn white(samples: u32, rate_hz: f64) -> f64 {
    rate_hz / f64::from(samples)
}

/// Allan variance of a random walk of density 1, or of a Gauss-Markov process of variance 1 and correlation time T.
fn bias(t_corr_s: Option<f64>, samples: u32, rate_hz: f64) -> f64 {
    let m = f64::from(samples);
    // K²τ/3 with the term of the sampling: twice the wavelet variance gamma2 (4m² + 2)/(24m), gamma2 = K²/f.
    let Some(t_corr_s) = t_corr_s else {
        return (2.0 * m * m + 1.0) / (6.0 * m * rate_hz);
    };
    let kappa = 1.0 / (t_corr_s * rate_hz);
    super::ar1::unit_markov(kappa, samples)
}

/// The pair of a policy.
fn pair(curve: &AllanCurve, policy: Policy, kind: BiasModel) -> NoiseDensities {
    let t_corr_s = match kind {
        BiasModel::Walk => None,
        BiasModel::MarkovOf(t_corr_s) => Some(t_corr_s),
        BiasModel::Markov => Some(correlation_time_s(&[curve], policy)),
    };
    let found = PairProblem::new(curve, policy, t_corr_s).solve();
    let (density, amplitude) = (found.white.sqrt(), found.bias.sqrt());
    match t_corr_s {
        None => NoiseDensities {
            density,
            walk: amplitude,
            markov: None,
        },
        Some(t_corr_s) => NoiseDensities {
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
fn correlation_time_s(curves: &[&AllanCurve], policy: Policy) -> f64 {
    // A quarter of the horizon's begin looks white over it, thirty times its end like a random walk.
    let horizon = curves[0].horizon;
    let (low, high) = (horizon.from_s / 4.0, horizon.to_s * 30.0);
    let misfit = |ln_t: f64| -> f64 {
        curves
            .iter()
            .map(|curve| {
                PairProblem::new(curve, policy, Some(ln_t.exp()))
                    .solve()
                    .misfit
            })
            .sum()
    };
    least(low.ln(), high.ln(), 30, misfit).0.exp()
}

/// Squares of N and of K (or sigma_b), and the sum of squares of the logarithms of the Allan deviation ratios.
#[derive(Clone, Copy)]
struct PairSolution {
    white: f64,
    bias: f64,
    misfit: f64,
}

/// One row per averaging time: Allan variances of unit white noise and unit bias, and the model's.
struct PairProblem {
    rows: Vec<[f64; 3]>,
    reference: [f64; 3],
    policy: Policy,
}

impl PairProblem {
    fn new(curve: &AllanCurve, policy: Policy, t_corr_s: Option<f64>) -> Self {
        let row = |p: &Point| {
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
    fn solve(&self) -> PairSolution {
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
        // The best may lie close to either end: the search is logarithmic in the share of the white noise and in what
        // it leaves to the bias.
        let share = |logit: f64| 1.0 / (1.0 + (-logit).exp());
        let furthest = -LEAST_SHARE.ln();
        let (logit, _) = least(-furthest, furthest, 30, |logit| {
            self.with_white(most * share(logit)).misfit
        });
        let inner = self.with_white(most * share(logit));
        let all = ends.into_iter().chain([inner]);
        all.min_by(|a, b| a.misfit.total_cmp(&b.misfit))
            .unwrap_or(ends[1])
    }

    /// The bias that goes with a white variance: through the model's Allan variance at the reference, or over it
    /// everywhere.
    fn with_white(&self, white: f64) -> PairSolution {
        let rest = |[w, b, target]: &[f64; 3]| ((target - white * w) / b).max(0.0);
        let bias = match self.policy {
            Policy::Envelope => self.rows.iter().map(rest).fold(0.0, f64::max),
            _ => rest(&self.reference),
        };
        // Half: the logarithm is of the deviation, the rows are variances.
        let log_ratio = |[w, b, target]: &[f64; 3]| 0.5 * ((white * w + bias * b) / target).ln();
        let misfit = self.rows.iter().map(log_ratio).map(|r| r * r).sum();
        PairSolution {
            white,
            bias,
            misfit,
        }
    }
}

/// Least point of a function of one variable on an interval, and the value there: the best of a grid, then
/// parabolas between its neighbours.
fn least(low: f64, high: f64, steps: u32, f: impl Fn(f64) -> f64) -> (f64, f64) {
    let grid = |i: u32| low + (high - low) * f64::from(i) / f64::from(steps);
    let best = (0..=steps)
        .map(|i| (i, f(grid(i))))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(i, _)| i);
    let (low, high) = (grid(best.saturating_sub(1)), grid((best + 1).min(steps)));
    // No closer: at 1e-8 of a variable the function is flat to rounding.
    let middle = line_minimum(low, high, 1e-8, &f);
    // The end of the interval may be the best and parabolas only come near it.
    [grid(best), middle]
        .map(|x| (x, f(x)))
        .into_iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((middle, f(middle)))
}

// The parameters of one axis, each with the averaging times that it governs.

/// A minimum of the Allan deviation: the bias instability B of data sheets. The coefficient of flicker noise that
/// [IEEE 952](crate::bibliography::Ieee952) calls B is that over √(2 ln 2/π) = 0.664.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct AllanMinimum {
    /// Averaging time (s).
    pub tau_s: f64,
    /// Allan deviation there, the bias instability (units).
    pub deviation: f64,
}

impl AllanMinimum {
    /// The lowest minimum of the largest Allan deviation of some axes, strictly within one sample and `range_s`; none where it
    /// still falls, or rises from the start.
    pub fn of(axes: &[&Composite], rate_hz: f64, range_s: f64) -> Option<Self> {
        // The grid of 1/16 octave is fine enough: around its minimum N²/τ + K²τ/3 is proportional to cosh x with
        // x = ln(τ/τ₀), and √cosh(ln 2/32) exceeds 1 by 1e-4.
        let samples = averages(1.0, (range_s * rate_hz).clamp(2.0, f64::from(1_u32 << 30)));
        let variance = |m: &u32| {
            axes.iter()
                .map(|a| a.allan_variance(*m))
                .fold(0.0, f64::max)
        };
        let variances: Vec<f64> = samples.iter().map(variance).collect();
        // An end of the range is no minimum: the deviation may go on falling beyond it.
        let inner = (1..samples.len().saturating_sub(1))
            .filter(|i| variances[*i] < variances[i - 1] && variances[*i] <= variances[i + 1]);
        let lowest = inner.min_by(|a, b| variances[*a].total_cmp(&variances[*b]))?;
        Some(Self {
            tau_s: f64::from(samples[lowest]) / rate_hz,
            deviation: variances[lowest].sqrt(),
        })
    }
}

/// Practitioners' parameters of an axis.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct AxisParameters {
    /// N and K of the policy: white noise and random walk.
    pub walk: NoiseDensities,
    /// N, sigma_b and T of the policy: white noise and a Gauss-Markov bias.
    pub markov: NoiseDensities,
    /// The lowest minimum of the Allan deviation within the range; none where it still falls, or rises from the start.
    pub minimum: Option<AllanMinimum>,
}

impl AxisParameters {
    /// Parameters of the largest of some axes at each averaging time. Minima are sought up to `range_s`.
    ///
    /// # Errors
    /// As [`AllanCurve::largest`].
    pub fn of(
        axes: &[&Composite],
        rate_hz: f64,
        horizon: Horizon,
        policy: Policy,
        range_s: f64,
    ) -> Result<Self, Refused> {
        let curve = AllanCurve::largest(axes, rate_hz, horizon)?;
        Ok(Self {
            walk: curve.pair(policy, BiasModel::Walk),
            markov: curve.pair(policy, BiasModel::Markov),
            minimum: AllanMinimum::of(axes, rate_hz, range_s),
        })
    }
}

#[cfg(test)]
#[path = "practical_tests.rs"]
mod practical_tests;
