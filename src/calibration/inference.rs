//! How sure a fit is: intervals of its parameters, and whether the model describes the curve at all.
//!
//! A parametric bootstrap. Each draw makes K new replicates: ln nu* of replicate i at level j is ln nu_j of the
//! fitted model, plus a difference *between* replicates (Gaussian, with the excess variance the recorded
//! replicates show at that level and their correlations between levels; a Student tail for the few they are),
//! plus the scatter *within* a recording (chi-square, from the large-sample law of the model's own wavelet
//! variance and the length of the recording; divided by the efficiency where robust). The estimator is applied
//! to the new replicates, trim and all, and the model fitted to the curve it gives. No signal is simulated.
//! Intervals are pivotal in the logarithm (see [`interval`]); a curve from elsewhere scatters by its own degrees of freedom.
//!
//! Where replicates differ the J-test is conservative: their residuals, which give the correlations between scales,
//! have the noise in them.

use super::average::{Estimator, Replicate, average};
use super::fit::Fit;
use super::goodness::{Goodness, goodness};
use super::limits::Limits;
use super::pipeline::{Outcome, Settings, estimate_again};
use super::replicates::Group;
use super::sampling::SamplingLaw;
use super::spec::ModelSpec;
use super::spread::Spread;
use crate::noise::Process;
use crate::rng::StreamKey;
use crate::wavelet::{Curve, RobustVariance, Status};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// How to draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bootstrap {
    /// Number of draws.
    pub draws: usize,
    /// Seed of all of them.
    pub seed: u64,
}

/// The 95 % interval of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterInterval {
    /// Label of the process.
    pub process: String,
    /// Name of the parameter.
    pub parameter: &'static str,
    /// Lower end (units of the parameter); NaN where the draws do not determine it.
    pub low: f64,
    /// Upper end (units of the parameter); NaN where the draws do not determine it.
    pub high: f64,
    /// Share of the draws in which its process has vanished.
    pub lost: f64,
}

impl ParameterInterval {
    /// Why there is no interval, if there is none.
    #[must_use]
    pub fn undetermined(&self) -> Option<String> {
        if self.low.is_finite() && self.high.is_finite() {
            return None;
        }
        let Self { process, parameter, lost, .. } = self;
        Some(if *lost >= 1.0 {
            format!("{process} {parameter}: no interval, not determined: {process} is zero")
        } else if *lost > TAIL {
            format!(
                "{process} {parameter}: no interval, not determined: {process} vanishes in {} of the draws",
                super::notes::percent(*lost)
            )
        } else {
            format!("{process} {parameter}: no interval: its draws lie to one side of the estimate")
        })
    }
}

/// What the bootstrap says about a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Inference {
    /// Draws made.
    pub draws: usize,
    /// Draws that had a fit.
    pub fitted: usize,
    /// One interval a parameter that is not fixed, in the order of the model.
    pub intervals: Vec<ParameterInterval>,
    /// Whether the model describes the curve; of slopes (AVLR), which are not fitted to it, nothing is known.
    pub goodness: Option<Goodness>,
    /// Levels of the curve, each with the standard deviation of ln nu of a replicate: within by the law,
    /// between beyond that. Empty for a curve from elsewhere.
    pub spread: Vec<(u32, f64, f64)>,
}

/// Fills in the inference of every outcome. The same seed gives the same numbers on any number of threads.
pub fn infer(groups: &[Group], outcomes: &mut [Outcome], settings: &Settings, bootstrap: Bootstrap) {
    outcomes.par_iter_mut().for_each(|outcome| {
        let group = &groups[outcome.group];
        outcome.inference = Some(inference(group, outcome, settings, bootstrap));
    });
}

fn inference(group: &Group, outcome: &Outcome, settings: &Settings, bootstrap: Bootstrap) -> Inference {
    let world = World::new(&group.replicates, outcome, settings);
    let name = group.name();
    let draw = |run: usize| {
        let key = StreamKey {
            seed: bootstrap.seed,
            scenario: "bootstrap",
            run: run as u64,
            source: &name,
            process: outcome.estimator.name(),
        };
        let curve = world.draw(&key, settings)?;
        estimate_again(&curve, outcome, settings).ok()
    };
    let fits: Vec<Fit> = (0..bootstrap.draws).into_par_iter().filter_map(draw).collect();
    let spread = world.spread.as_ref();
    let rows = |s: &Spread| {
        let levels = outcome.curve.levels.iter().copied();
        levels.zip(s.within.iter().zip(&s.between)).map(|(l, (w, b))| (l, *w, *b)).collect()
    };
    Inference {
        draws: bootstrap.draws,
        fitted: fits.len(),
        intervals: intervals(outcome, &fits),
        goodness: (outcome.estimator != Estimator::Avlr)
            .then(|| goodness(&outcome.fit, &outcome.spec, &fits)),
        spread: spread.map_or(Vec::new(), rows),
    }
}

/// What is drawn from.
pub(super) struct World<'a> {
    replicates: &'a [Replicate],
    outcome: &'a Outcome,
    law: SamplingLaw,
    /// Of replicates; none for a curve from elsewhere.
    spread: Option<Spread>,
    /// Wavelet variance of the model, of each level of the curve.
    centre: Vec<f64>,
    /// Whether what replicates differ by has the tails of how little is known of it.
    heavy_tails: bool,
}

impl<'a> World<'a> {
    pub(super) fn new(replicates: &'a [Replicate], outcome: &'a Outcome, settings: &Settings) -> Self {
        let model = &outcome.fit.composite;
        let levels = outcome.curve.levels.iter().copied().max().unwrap_or(1) as usize;
        let law = SamplingLaw::new(model, levels);
        let efficiency = settings.tuning.efficiency();
        let spread =
            (!replicates.is_empty()).then(|| Spread::new(replicates, outcome.estimator, &law, efficiency));
        let centre = outcome.curve.levels.iter().map(|level| model.haar_wv(*level)).collect();
        Self { replicates, outcome, law, spread, centre, heavy_tails: true }
    }

    /// The same, replicates differing by Gaussian numbers: their curves have a covariance.
    pub(super) fn gaussian(self) -> Self {
        Self { heavy_tails: false, ..self }
    }

    /// Covariance of curves, relative to that of the model.
    pub(super) fn covariance(&self, draws: usize, group: &str, settings: &Settings) -> DMatrix<f64> {
        let process = self.outcome.estimator.name();
        let draw = |run: usize| {
            let key = StreamKey { seed: 1, scenario: "covariance", run: run as u64, source: group, process };
            let curve = self.draw(&key, settings)?;
            Some(curve.wv.iter().zip(&self.centre).map(|(nu, centre)| nu / centre - 1.0).collect())
        };
        let errors: Vec<Vec<f64>> = (0..draws).filter_map(draw).collect();
        let count = errors.len() as f64;
        let levels = self.centre.len();
        let mean: Vec<f64> = (0..levels).map(|j| errors.iter().map(|e| e[j]).sum::<f64>() / count).collect();
        let product = |i: usize, j: usize| {
            errors.iter().map(|e| (e[i] - mean[i]) * (e[j] - mean[j])).sum::<f64>() / (count - 1.0)
        };
        DMatrix::from_fn(levels, levels, product)
    }

    /// A new curve of the same estimator.
    pub(super) fn draw(&self, key: &StreamKey<'_>, settings: &Settings) -> Option<Curve> {
        let mut generator = key.generator();
        let Some(spread) = &self.spread else {
            let curve = &self.outcome.curve;
            // The law knows all levels from 1; the curve may have some of them.
            let mut edof = vec![1.0; self.law.correlation.nrows()];
            curve.levels.iter().zip(&curve.edof).for_each(|(l, e)| edof[*l as usize - 1] = *e);
            let ratio = self.law.draw(&edof, &mut generator);
            let wv = curve.levels.iter().zip(&self.centre).map(|(l, nu)| nu * ratio[*l as usize - 1]);
            return Some(Curve { wv: wv.collect(), ..curve.clone() });
        };
        let between = spread.draw_between(self.heavy_tails, &mut generator);
        let drawn = self.replicates.iter().zip(&spread.edof).zip(&between);
        let replicates: Vec<Replicate> = drawn
            .map(|((replicate, edof), between)| {
                let ratios = self.law.draw(edof, &mut generator);
                let nu = self.centre.iter().zip(ratios).zip(between).map(|((nu, r), b)| nu * r * b.exp());
                like(replicate, nu.collect())
            })
            .collect();
        average(&replicates, self.outcome.estimator, settings.trim, settings.tuning.efficiency()).ok()
    }
}

/// A replicate of the same length with other variances.
fn like(replicate: &Replicate, nu: Vec<f64>) -> Replicate {
    let robust = nu.iter().map(|value| RobustVariance { value: *value, status: Status::Ok }).collect();
    Replicate { name: String::new(), axis: replicate.axis, samples: replicate.samples, classical: nu, robust }
}

fn intervals(outcome: &Outcome, fits: &[Fit]) -> Vec<ParameterInterval> {
    let (model, spec) = (&outcome.fit.composite, &outcome.spec);
    let zero = &outcome.fit.zero;
    let matched: Vec<Vec<Option<&Process>>> =
        fits.iter().map(|fit| matched(&outcome.fit, spec, fit)).collect();
    let mut intervals = Vec::new();
    for (i, (process, label)) in model.processes.iter().zip(model.labels()).enumerate() {
        let there: Vec<&Process> = matched.iter().filter_map(|m| m[i]).collect();
        let lost = if zero.contains(&label) { 1.0 } else { 1.0 - there.len() as f64 / fits.len() as f64 };
        for (p, (parameter, value)) in process.parameters().into_iter().enumerate() {
            if spec.is_fixed(i, parameter) {
                continue;
            }
            let drawn = there.iter().map(|process| process.parameters()[p].1).collect();
            let [low, high] = match lost {
                // The quantile is that of what has vanished.
                lost if lost > TAIL => [f64::NAN; 2],
                _ => holding(value, interval(parameter, value, drawn)),
            };
            intervals.push(ParameterInterval { process: label.clone(), parameter, low, high, lost });
        }
    }
    intervals
}

/// An interval that holds its estimate; none where the estimator misses its own estimate 39 times in 40.
fn holding(value: f64, [low, high]: [f64; 2]) -> [f64; 2] {
    let rounding = 1e-9 * value.abs();
    if low <= value + rounding && value - rounding <= high { [low, high] } else { [f64::NAN; 2] }
}

/// The processes of a draw in the order of the model; none where one has vanished. Alike ones are told apart by
/// their correlation times: those that are there, in the draw and in the model, keep their order, and so many of
/// them are paired as can be, the nearest.
fn matched<'a>(estimate: &Fit, spec: &ModelSpec, fit: &'a Fit) -> Vec<Option<&'a Process>> {
    let labels = fit.composite.labels();
    let (drawn, model) = (&fit.composite.processes, &estimate.composite.processes);
    let there = |fit: &Fit, i: usize| !fit.zero.contains(&labels[i]);
    let kinds = spec.kinds();
    let cost = |i: usize, d: usize| (log_time(&model[i]) - log_time(&drawn[d])).powi(2);
    let mut matched = vec![None; drawn.len()];
    for (first, kind) in kinds.iter().enumerate().filter(|(i, kind)| !kinds[..*i].contains(kind)) {
        let own: Vec<usize> = (first..kinds.len()).filter(|i| kinds[*i] == *kind).collect();
        let items: Vec<usize> = own.iter().copied().filter(|i| there(fit, *i)).collect();
        let places: Vec<usize> = own.iter().copied().filter(|i| there(estimate, *i)).collect();
        let pairs: Vec<(usize, usize)> = if own.iter().any(|i| spec.limits()[*i] != Limits::NONE) {
            items.iter().map(|i| (*i, *i)).collect()
        } else if items.len() <= places.len() {
            nearest(&places, &items, cost).into_iter().zip(items).collect()
        } else {
            places.iter().copied().zip(nearest(&items, &places, |d, i| cost(i, d))).collect()
        };
        for (place, d) in pairs {
            matched[place] = Some(&drawn[d]);
        }
    }
    matched
}

/// The choice, in their order, of as many places as there are items with the least sum of costs.
fn nearest(places: &[usize], items: &[usize], cost: impl Fn(usize, usize) -> f64 + Copy) -> Vec<usize> {
    fn best(places: &[usize], items: &[usize], cost: &dyn Fn(usize, usize) -> f64) -> (f64, Vec<usize>) {
        let Some((item, others)) = items.split_first() else { return (0.0, Vec::new()) };
        let choose = |at: usize| {
            let (rest, mut chosen) = best(&places[at + 1..], others, cost);
            chosen.insert(0, places[at]);
            (rest + cost(places[at], *item), chosen)
        };
        let candidates = (0..(places.len() + 1).saturating_sub(items.len())).map(choose);
        candidates.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, Vec::new()))
    }
    best(places, items, &cost).1
}

/// ln of the correlation time, of those that have one.
fn log_time(process: &Process) -> f64 {
    match process {
        Process::Ar1(p) => -(-p.phi().max(f64::MIN_POSITIVE).ln()).ln(),
        Process::GaussMarkov(p) => -p.beta().ln(),
        _ => 0.0,
    }
}

/// The 95 % interval of a parameter from draws around its estimate.
///
/// Amplitudes and correlation times are scale parameters: estimate over truth is distributed as draw over estimate, whatever
/// the truth. So the ends are estimate²/draw at the quantiles of the draws (exact for a variance whose estimate
/// is a chi-square; the same as the quantiles themselves where the draws are symmetric in the logarithm); theta
/// of MA1 likewise with differences. It takes no skewness of the draws, which have heavy tails. Where the
/// estimate or a quantile is at the bound, 0, the ends are the quantiles themselves.
fn interval(parameter: &str, estimate: f64, drawn: Vec<f64>) -> [f64; 2] {
    let scale = |value: f64| match parameter {
        "phi" => (-value.ln()).ln(),
        "theta" => value,
        _ => value.ln(),
    };
    let back = |scaled: f64| match parameter {
        "phi" => (-scaled.exp()).exp(),
        "theta" => scaled.clamp(-1.0, 1.0),
        _ => scaled.exp(),
    };
    let mut sorted = drawn;
    sorted.sort_by(f64::total_cmp);
    let quantiles = [TAIL, 1.0 - TAIL].map(|p| quantile(&sorted, p));
    let mut ends = quantiles.map(|q| back(2.0 * scale(estimate) - scale(q)));
    ends.sort_by(f64::total_cmp);
    if ends.iter().all(|e| e.is_finite()) && scale(estimate).is_finite() { ends } else { quantiles }
}

/// Probability beyond either end of a 95 % interval.
const TAIL: f64 = 0.025;

/// Quantile of sorted numbers, interpolated; NaN of none.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = p * last as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (at - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Estimator, ModelChoice, Pool, Trim, Weighting, calibrate, grouped};
    use crate::imu::{Axis, Channel, Sensor};
    use crate::noise::{RandomWalk, White};
    use crate::wavelet::{Convention, Tuning, classical};
    use rand::RngExt;
    use rand_distr::StandardNormal;

    const CHANNEL: Channel = Channel { sensor: Sensor::Gyro, axis: Axis::X };
    const SAMPLES: usize = 1024;

    fn settings(spec: &str) -> Settings {
        Settings {
            estimators: vec![Estimator::Awv],
            model: ModelChoice::Given(spec.parse().unwrap()),
            limits: Vec::new(),
            trim: Trim::Count(0),
            tuning: Tuning::new(0.6, Convention::Exact).unwrap(),
            weighting: Weighting::Edof,
            rate_hz: 1.0,
        }
    }

    /// Replicates of white noise and random walk, each with its own variances.
    fn group(set: u64, replicates: &[(f64, f64)]) -> Group {
        let one = |(run, (sigma2, gamma2)): (usize, &(f64, f64))| {
            let run = run as u64;
            let key = StreamKey { seed: set, scenario: "", run, source: "", process: "" };
            let mut generator = key.generator();
            let mut walk = 0.0;
            let mut next = || {
                walk += gamma2.sqrt() * generator.sample::<f64, _>(StandardNormal);
                walk + sigma2.sqrt() * generator.sample::<f64, _>(StandardNormal)
            };
            let signal: Vec<f64> = (0..SAMPLES).map(|_| next()).collect();
            let nu = classical(&signal, 8).unwrap();
            let template = Replicate {
                name: String::new(),
                axis: None,
                samples: SAMPLES,
                classical: vec![],
                robust: vec![],
            };
            (CHANNEL, like(&template, nu))
        };
        grouped(replicates.iter().enumerate().map(one).collect(), Pool::Axes).remove(0)
    }

    fn inferred(group: Group, settings: &Settings, draws: usize) -> Outcome {
        let groups = [group];
        let mut outcomes = calibrate(&groups, settings).unwrap();
        infer(&groups, &mut outcomes, settings, Bootstrap { draws, seed: 3 });
        outcomes.remove(0)
    }

    /// Of two AR1 with correlation times of 10 and 1000 samples a draw keeps one of 700, its other (by label the
    /// first, its time anything) having no amplitude: the one that is there is the second. Vanished in more draws than the
    /// quantile leaves out, the first has no interval.
    #[test]
    fn a_component_that_vanishes_in_draws_takes_nothing_of_the_other() {
        use crate::noise::{Ar1, Composite};
        let ar1 = |time: f64, sigma2: f64| Process::Ar1(Ar1::new((-1.0 / time).exp(), sigma2).unwrap());
        let of = |processes: Vec<Process>| {
            let composite = Composite::new(processes);
            let levels: Vec<u32> = (1..=12).collect();
            let wv = levels.iter().map(|l| composite.haar_wv(*l) + 1e-12).collect();
            let curve = Curve { edof: vec![100.0; 12], levels, wv };
            let spec = "2*AR1".parse().unwrap();
            let mut fit = crate::calibration::fit(&curve, &spec, 1.0, Weighting::Edof).unwrap();
            (fit.composite, fit.zero) = (composite, Vec::new());
            Outcome::bare(0, Estimator::Awv, curve, spec, fit)
        };
        let outcome = of(vec![ar1(10.0, 1.0), ar1(1000.0, 1.0)]);
        let whole = |factor: f64| of(vec![ar1(10.0, factor), ar1(1000.0, factor)]).fit;
        // The one that is not there has a time beyond the other's: by order it is the second.
        let mut lost = of(vec![ar1(700.0, 1.1), ar1(5000.0, 0.0)]).fit;
        lost.zero = vec!["AR1_2".to_owned()];
        let matched = matched(&outcome.fit, &outcome.spec, &lost);
        assert!(matched[0].is_none() && matched[1].unwrap() == &lost.composite.processes[0]);
        let draws = |lost_ones: usize| -> Vec<Fit> {
            let whole = (0..100 - lost_ones).map(|i| whole(0.8 + 0.4 * i as f64 / 99.0));
            whole.chain((0..lost_ones).map(|_| lost.clone())).collect()
        };
        let all = intervals(&outcome, &draws(2));
        assert!(all.iter().all(|i| i.undetermined().is_none()), "{all:?}");
        let all = intervals(&outcome, &draws(10));
        let text = all[0].undetermined().unwrap();
        assert_eq!(text, "AR1_1 phi: no interval, not determined: AR1_1 vanishes in 10 % of the draws");
        assert!(
            all[0].low.is_nan() && all[2].lost == 0.0 && all[3].low < 1.0 && all[3].high > 1.0,
            "{all:?}"
        );
    }

    #[test]
    fn an_interval_holds_its_estimate_or_is_none() {
        assert_eq!(holding(1.0, [0.5, 2.0]), [0.5, 2.0]);
        assert!(holding(3.0, [0.5, 2.0]).iter().all(|end| end.is_nan()));
    }

    /// A variance known to be a chi-square of ν = 8 degrees of freedom over ν: 4000 draws around an estimate of 3 give the
    /// textbook's 3ν/17.53 … 3ν/2.18 (quantiles 0.975 and 0.025), to four standard errors of the draws' quantiles,
    /// 4·√(0.025·0.975/4000)/f: 7 and 4 %.
    #[test]
    fn the_interval_of_a_variance_is_the_textbooks() {
        use rand_distr::ChiSquared;
        let mut generator = StreamKey { seed: 1, scenario: "", run: 0, source: "", process: "" }.generator();
        let law = ChiSquared::new(8.0).unwrap();
        let drawn = (0..4000).map(|_| 3.0 * generator.sample(law) / 8.0).collect();
        let [low, high] = interval("sigma2", 3.0, drawn);
        assert!(
            (low / (24.0 / 17.53) - 1.0).abs() < 0.07 && (high / (24.0 / 2.18) - 1.0).abs() < 0.1,
            "{low} {high}"
        );
        assert_eq!(interval("sigma2", 0.0, vec![0.0, 0.0, 1.0]), [0.0, 0.95]);
        let [low, high] = interval("phi", 0.9, vec![0.85, 0.9, 0.93]);
        assert!(0.0 < low && low < 0.9 && 0.9 < high && high < 1.0, "{low} {high}");
    }

    /// 150 sets of 4 signals: a frequency that is really 0.95 lies within 4·√(0.95·0.05/150) = 0.071 of it; the
    /// test rejects in 5 % of them, within the same.
    #[test]
    fn intervals_cover_and_the_j_test_keeps_its_level() {
        const SETS: u64 = 150;
        let settings = settings("WN+RW");
        let truth =
            [Process::White(White::new(1.0).unwrap()), Process::RandomWalk(RandomWalk::new(1e-3).unwrap())];
        let mut covered = [0_u32; 2];
        let mut rejected = 0_u32;
        for set in 0..SETS {
            let inference = inferred(group(set, &[(1.0, 1e-3); 4]), &settings, 99).inference.unwrap();
            for (i, process) in truth.iter().enumerate() {
                let value = process.parameters()[0].1;
                let interval = &inference.intervals[i];
                covered[i] += u32::from(interval.low < value && value < interval.high);
            }
            rejected += u32::from(inference.goodness.unwrap().p_value <= 0.05);
        }
        let share = |n: u32| f64::from(n) / SETS as f64;
        let shown = (share(covered[0]), share(covered[1]), share(rejected));
        assert!((shown.0 - 0.95).abs() < 0.071 && (shown.1 - 0.95).abs() < 0.071, "{shown:?}");
        assert!((shown.2 - 0.05).abs() < 0.071, "{shown:?}");
    }

    /// sigma2 of 8 replicates with variances 0.8 … 1.22: their standard deviation over √8 is the spread of the
    /// mean, of which 1.96 (normal) to 3 (Student with 7 degrees, chance of 300 draws) make half an interval.
    #[test]
    fn differences_between_replicates_widen_the_intervals() {
        let variances: Vec<(f64, f64)> = (0..8).map(|i| (0.8 + 0.06 * f64::from(i), 0.0)).collect();
        let deviation = 0.06 * 6.0_f64.sqrt(); // of 0 … 7: √6
        let half = |inference: &Inference| 0.5 * (inference.intervals[0].high - inference.intervals[0].low);
        let spread = inferred(group(1, &variances), &settings("WN"), 300).inference.unwrap();
        let unit = half(&spread) / (deviation / 8.0_f64.sqrt());
        assert!(unit > 1.6 && unit < 3.4, "{unit}");
        assert!(spread.spread[0].2 > 2.0 * spread.spread[0].1, "{:?}", spread.spread);
        let alike = inferred(group(1, &[(1.0, 0.0); 8]), &settings("WN"), 300).inference.unwrap();
        // Noise alone: at least 1.96·√(2/(8·1024)) = 0.031, which maximum likelihood would reach.
        assert!(half(&alike) > 0.027 && half(&alike) < 0.06, "{}", half(&alike));
    }

    #[test]
    fn a_model_that_is_wrong_is_rejected() {
        let outcome = inferred(group(5, &[(1.0, 1e-2); 4]), &settings("WN"), 99);
        assert!(outcome.inference.unwrap().goodness.unwrap().p_value < 0.05);
    }
}
