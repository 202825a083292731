//! Intervals of parameters from draws around their estimates.

use crate::curve::median;
use crate::fit::{Fit, Range, correlated};
use crate::noise::practical::{AllanCurve, AllanMinimum, BiasModel, Horizon, Policy};
use crate::noise::{Composite, Parameter, ParameterRef, Process, ProcessKind};
use crate::outcome::{Outcome, ParameterInterval, Practical, PracticalIntervals, Undetermined};

impl ParameterInterval {
    /// Removes the interval and records why.
    pub(crate) fn refuse(&mut self, why: Undetermined) {
        (self.low, self.high) = (f64::NAN, f64::NAN);
        self.absent = Some(why);
    }

    /// Puts the interval of another fit, of the same parameter, in place of this one, if it holds the estimate.
    pub(crate) fn replace(&mut self, other: &Self, value: f64) {
        [self.low, self.high] = unless_one_sided(value, [other.low, other.high]);
        self.lost = other.lost;
        let one_sided = self.low.is_nan().then_some(Undetermined::OneSided);
        self.absent = other.absent.clone().or(one_sided);
    }
}

/// Multiplies the distances of the parameters of draws from their median, process by process: by Student's quantile over the
/// normal one, where the draws' own spread is known from few replicates.
pub(crate) fn stretch(fits: &mut [Fit], stretches: &[f64]) {
    for (i, stretch) in stretches.iter().enumerate() {
        let kind = fits.first().map(|fit| fit.composite.processes[i].kind());
        for (p, parameter) in kind
            .iter()
            .flat_map(|kind| kind.parameters().iter().enumerate())
        {
            let scaled = |fit: &Fit| parameter.scaled(fit.composite.processes[i].values()[p]);
            // Of a process without amplitude the shape is anything.
            let is_there = |fit: &Fit| !fit.zero.contains(&i) && scaled(fit).is_finite();
            let there = fits.iter().filter(|fit| is_there(fit));
            let middle = median(&there.map(scaled).collect::<Vec<_>>());
            for fit in fits.iter_mut().filter(|fit| is_there(fit)) {
                let value = parameter.unscaled(middle + stretch * (scaled(fit) - middle));
                let process = &mut fit.composite.processes[i];
                *process = process.with(*parameter, value).unwrap_or(*process);
            }
        }
    }
}

/// The intervals of all parameters, in the order of the model, from draws stretched by `stretches`.
pub(crate) fn intervals(
    outcome: &Outcome,
    fits: &[Fit],
    stretches: &[f64],
) -> Vec<ParameterInterval> {
    let model = &outcome.fit.composite;
    let searched = correlated(&outcome.curve);
    let matched: Vec<Vec<Option<&Process>>> =
        fits.iter().map(|fit| matched(&outcome.fit, fit)).collect();
    let mut intervals = Vec::new();
    for (i, process) in model.processes.iter().enumerate() {
        let there: Vec<&Process> = matched.iter().filter_map(|m| m[i]).collect();
        let lost = match outcome.fit.zero.contains(&i) {
            true => 1.0,
            false => 1.0 - there.len() as f64 / fits.len() as f64,
        };
        let vanished = match lost {
            1.0.. => Some(Undetermined::Zero),
            lost if lost > TAIL => Some(Undetermined::Vanishes),
            _ => None,
        };
        // By draws mirrored at the estimate, and the quantiles of the draws themselves.
        let of_parameter = |(p, (&parameter, value)): (usize, (&Parameter, f64))| {
            let drawn = there.iter().map(|process| process.values()[p]).collect();
            let quantiles = tails(drawn);
            // Amplitudes are not negative.
            let least = if parameter.is_shape() {
                f64::NEG_INFINITY
            } else {
                0.0
            };
            let at_least = |end: f64| end.clamp(least, f64::INFINITY);
            let [low, high] = match vanished {
                // The quantile is that of what has vanished.
                Some(_) => [f64::NAN; 2],
                None => {
                    unless_one_sided(value, mirrored(parameter, quantiles, value)).map(at_least)
                }
            };
            let one_sided = low.is_nan().then_some(Undetermined::OneSided);
            let interval = ParameterInterval {
                of: ParameterRef {
                    process: i,
                    parameter,
                },
                low,
                high,
                lost,
                absent: vanished.clone().or(one_sided),
            };
            (interval, quantiles.map(at_least))
        };
        let parameters = process.kind().parameters().iter().zip(process.values());
        let (mut own, quantiles): (Vec<_>, Vec<_>) =
            parameters.enumerate().map(of_parameter).unzip();
        if own.iter().any(|i| leaves_search(searched, process, i)) {
            own.iter_mut()
                .for_each(|i| i.refuse(Undetermined::BeyondSearch));
        }
        // With its amplitude the shape is lost too.
        let widest = UNDETERMINED_RATIO.powf(stretches[i].min(2.0));
        let open = |i: &ParameterInterval| {
            !i.of.parameter.is_shape() && i.absent.is_none() && i.high > i.low * widest
        };
        if own.iter().any(open) {
            own.iter_mut().for_each(|i| i.refuse(Undetermined::Open));
        }
        for (interval, quantiles) in own
            .iter_mut()
            .zip(quantiles)
            .filter(|(i, _)| i.absent.is_none())
        {
            [interval.low, interval.high] = hull([interval.low, interval.high], quantiles);
        }
        intervals.extend(own);
    }
    intervals
}

/// Ratio of the 95 % quantiles of an amplitude above which it counts as undetermined (squared for its interval, which
/// few recordings widen).
pub const UNDETERMINED_RATIO: f64 = 100.0;

/// Returns true if the interval of a correlation time reaches the end of the searched range: the
/// time is then unbounded on that side.
fn leaves_search(searched: Range, process: &Process, interval: &ParameterInterval) -> bool {
    let kappa = |end: f64| match interval.of.parameter {
        Parameter::Phi => Some(-end.ln()),
        Parameter::Beta => process.kappa().map(|kappa| kappa * end / process.shape()),
        _ => None,
    };
    // Ends beyond by rounding are not beyond.
    let beyond = |u: f64| u < searched.low - 1e-6 || u > searched.high + 1e-6;
    [interval.low, interval.high]
        .into_iter()
        .filter_map(kappa)
        .any(|kappa| beyond(kappa.ln()))
}

/// The interval, or NaN if it excludes its own estimate (all but 2.5 % of the draws on one side: a biased estimator).
fn unless_one_sided(value: f64, [low, high]: [f64; 2]) -> [f64; 2] {
    let rounding = 1e-9 * value.abs();
    if low <= value + rounding && value - rounding <= high {
        [low, high]
    } else {
        [f64::NAN; 2]
    }
}

/// The processes of a draw in the order of the model; none where one has vanished. Alike ones are distinguished by
/// their correlation times: those that are there, in the draw and in the model, keep their order, and so many of
/// them are paired as can be, the nearest.
pub(super) fn matched<'a>(estimate: &Fit, fit: &'a Fit) -> Vec<Option<&'a Process>> {
    let (drawn, model) = (&fit.composite.processes, &estimate.composite.processes);
    let kinds: Vec<ProcessKind> = model.iter().map(Process::kind).collect();
    let cost = |i: usize, d: usize| (log_time(&model[i]) - log_time(&drawn[d])).powi(2);
    let mut matched = vec![None; drawn.len()];
    for (first, kind) in kinds
        .iter()
        .enumerate()
        .filter(|(i, kind)| !kinds[..*i].contains(kind))
    {
        let own: Vec<usize> = (first..kinds.len())
            .filter(|i| kinds[*i] == *kind)
            .collect();
        let present = |of: &Fit| -> Vec<usize> {
            let own = own.iter().copied();
            own.filter(|i| !of.zero.contains(i) && !of.at_end.contains(i))
                .collect()
        };
        let (items, places) = (present(fit), present(estimate));
        // Fits list alike processes by correlation time, and only their number may differ.
        let pairs: Vec<(usize, usize)> = if items.len() <= places.len() {
            let nearest = nearest(&places, &items, cost);
            nearest.into_iter().zip(items).collect()
        } else {
            let nearest = nearest(&items, &places, |d, i| cost(i, d));
            places.into_iter().zip(nearest).collect()
        };
        for (place, d) in pairs {
            matched[place] = Some(&drawn[d]);
        }
    }
    matched
}

/// The choice, in their order, of as many places as there are items with the least sum of costs.
fn nearest(
    places: &[usize],
    items: &[usize],
    cost: impl Fn(usize, usize) -> f64 + Copy,
) -> Vec<usize> {
    fn best(
        places: &[usize],
        items: &[usize],
        cost: &dyn Fn(usize, usize) -> f64,
    ) -> (f64, Vec<usize>) {
        let Some((item, others)) = items.split_first() else {
            return (0.0, Vec::new());
        };
        let choose = |at: usize| {
            let (rest, mut chosen) = best(&places[at + 1..], others, cost);
            chosen.insert(0, places[at]);
            (rest + cost(places[at], *item), chosen)
        };
        let candidates = (0..(places.len() + 1).saturating_sub(items.len())).map(choose);
        candidates
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f64::INFINITY, Vec::new()))
    }
    best(places, items, &cost).1
}

/// ln of the correlation time, of those that have one.
fn log_time(process: &Process) -> f64 {
    if !process.kind().is_correlated() {
        return 0.0;
    }
    let longest = -f64::MIN_POSITIVE.ln();
    -process.kappa().unwrap_or(longest).ln()
}

/// The smallest interval that holds both. A weak process is reported only if overestimated. Its draws are smaller, and
/// mirroring alone would put the interval above them.
const fn hull(mirrored: [f64; 2], quantiles: [f64; 2]) -> [f64; 2] {
    [mirrored[0].min(quantiles[0]), mirrored[1].max(quantiles[1])]
}

/// Quantiles 0.025 and 0.975 of draws.
fn tails(mut drawn: Vec<f64>) -> [f64; 2] {
    drawn.sort_by(f64::total_cmp);
    [TAIL, 1.0 - TAIL].map(|p| quantile(&drawn, p))
}

/// The 95 % interval: the quantiles of the draws mirrored at the estimate.
///
/// Amplitudes and correlation times are scale parameters: estimate over truth is distributed as draw over estimate, whatever
/// the truth. So the ends of an interval are estimate²/draw at the quantiles of the draws (exact for a variance whose estimate
/// is a chi-square; the same as the quantiles themselves where the draws are symmetric in the logarithm); theta
/// of MA1 likewise with differences. Where the estimate or a quantile is at the bound, 0, the ends are the quantiles
/// themselves.
fn mirrored(parameter: Parameter, quantiles: [f64; 2], estimate: f64) -> [f64; 2] {
    let scaled = |x| parameter.scaled(x);
    let mut ends = quantiles.map(|q| parameter.unscaled(2.0 * scaled(estimate) - scaled(q)));
    ends.sort_by(f64::total_cmp);
    if scaled(estimate).is_finite() && ends.iter().all(|e| e.is_finite()) {
        ends
    } else {
        quantiles
    }
}

/// 95 % interval of a positive figure computed from the model, from its values in the draws. Mirrored only: unlike a
/// process it is always reported, so there is no selection.
pub fn derived_interval(estimate: f64, drawn: Vec<f64>) -> [f64; 2] {
    mirrored(Parameter::Sigma2, tails(drawn), estimate)
}

/// The 95 % interval of a positive quantity that some of `draws` draws have; none where more of them lack it than the
/// quantile leaves out, or its draws lie to one side of the estimate.
fn scale_interval(estimate: f64, drawn: Vec<f64>, draws: usize) -> Option<[f64; 2]> {
    if (drawn.len() as f64) < (1.0 - TAIL) * draws as f64 || drawn.is_empty() {
        return None;
    }
    let quantiles = tails(drawn);
    let ends = unless_one_sided(estimate, mirrored(Parameter::Sigma2, quantiles, estimate));
    ends.iter()
        .all(|end| end.is_finite())
        .then(|| hull(ends, quantiles))
}

/// Probability beyond either end of a 95 % interval.
pub(super) const TAIL: f64 = 0.025;

/// Quantile of sorted draws, interpolated; NaN of none. The k-th of n is at k/(n + 1), so that one draw more is
/// beyond it with that probability exactly ([Davison and Hinkley](crate::bibliography::DavisonHinkley97), Section 5.2).
pub(super) fn quantile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = (p * (sorted.len() + 1) as f64 - 1.0).clamp(0.0, last as f64);
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (at - below as f64) * (sorted[above] - sorted[below])
}

// N, K and B of a fit, and their intervals from the draws of the bootstrap.

/// Longest averaging time that the scales of a fit tell of (s): a scale is two averages long.
fn observed_s(outcome: &Outcome, rate_hz: f64) -> Option<f64> {
    let longest = outcome.curve.counted_levels().into_iter().max()?;
    Some(f64::from(longest - 1).exp2() / rate_hz)
}

impl Outcome {
    /// N, K and B of practitioners, as exports have them; none at a rate without averages of 1 s, nor
    /// without noise.
    pub fn practical(&self, rate_hz: f64) -> Option<Practical> {
        let read = self.for_navigation();
        let range_s = observed_s(read, rate_hz)?;
        let intervals = read.inference.as_ref();
        Some(Practical {
            intervals: intervals.map_or(PracticalIntervals::default(), |i| i.practical),
            ..Practical::of(&read.fit.composite, rate_hz, range_s)?
        })
    }
}

impl Practical {
    /// The parameters of a model, without intervals.
    fn of(model: &Composite, rate_hz: f64, range_s: f64) -> Option<Self> {
        let curve = AllanCurve::largest(&[model], rate_hz, Horizon::default()).ok()?;
        let walk = curve.pair(Policy::Matched, BiasModel::Walk);
        Some(Self {
            walk,
            minimum: AllanMinimum::of(&[model], rate_hz, range_s),
            intervals: PracticalIntervals::default(),
            range_s,
            walk_until_s: walk.departs_s(model, rate_hz, range_s, Self::BESIDE),
        })
    }
}

/// The 95 % intervals from the fits of the draws, stretched as for [`intervals`].
pub(crate) fn practical_intervals(
    outcome: &Outcome,
    fits: &[Fit],
    rate_hz: f64,
) -> PracticalIntervals {
    let Some(range_s) = observed_s(outcome, rate_hz) else {
        return PracticalIntervals::default();
    };
    let drawn: Vec<&Composite> = fits.iter().map(|fit| &fit.composite).collect();
    let own = &outcome.fit.composite;
    let [density, walk, instability] =
        figures_with_intervals(own, &drawn, rate_hz, range_s).map(|(_, ends)| ends);
    PracticalIntervals {
        density,
        walk,
        instability,
    }
}

/// N, K and B of a model, matched over the default horizon and up to `range_s`, and their 95 % intervals from the models of
/// draws; none where the model or the draws do not determine them.
pub fn figures_with_intervals(
    model: &Composite,
    drawn: &[&Composite],
    rate_hz: f64,
    range_s: f64,
) -> [(Option<f64>, Option<[f64; 2]>); 3] {
    let read = |model: &Composite| -> Option<[Option<f64>; 3]> {
        let curve = AllanCurve::largest(&[model], rate_hz, Horizon::default()).ok()?;
        let pair = curve.pair(Policy::Matched, BiasModel::Walk);
        let minimum = AllanMinimum::of(&[model], rate_hz, range_s);
        let instability = minimum.map(|m| m.deviation);
        Some([Some(pair.density), Some(pair.walk), instability])
    };
    let own = read(model).unwrap_or_default();
    let figures: Vec<_> = drawn.iter().filter_map(|model| read(model)).collect();
    [0, 1, 2].map(|k| {
        let there = figures.iter().filter_map(|r| r[k]).filter(|x| *x > 0.0);
        let ends = own[k].and_then(|own| scale_interval(own, there.collect(), drawn.len()));
        (own[k], ends)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;
    use crate::{Estimator, Scope, fit};
    use rand_distr::ChiSquared;

    /// Of two AR1 with correlation times of 10 and 1000 samples a draw keeps one of 700, its other (by label the
    /// first, its time anything) having no amplitude: the one that is there is the second. Vanished in more draws than the
    /// quantile leaves out, the first has no interval.
    #[test]
    fn a_component_that_vanishes_in_draws_takes_nothing_of_the_other() {
        let ar1 = |time: f64, sigma2: f64| Process::ar1((-1.0 / time).exp(), sigma2).unwrap();
        let fit_of = |processes: Vec<Process>| {
            let composite = Composite::new(processes);
            let mut curve = exact(&composite, 12, |_| 100.0);
            curve.wv.iter_mut().for_each(|nu| *nu += 1e-12);
            let spec = "2*AR1".parse().unwrap();
            let mut fit = fit(&curve, &spec, 1.0, Weighting::Edof).unwrap();
            (fit.composite, fit.zero) = (composite, Vec::new());
            Outcome {
                scope: Scope {
                    sensor: Sensor::Accel,
                    axis: None,
                },
                replicates: 0,
                recordings: 0,
                axes_differ: None,
                estimator: Estimator::Awv,
                spec,
                ranking: None,
                curve,
                fit,
                inference: None,
                reading: None,
            }
        };
        let outcome = fit_of(vec![ar1(10.0, 1.0), ar1(1000.0, 1.0)]);
        let whole = |factor: f64| fit_of(vec![ar1(10.0, factor), ar1(1000.0, factor)]).fit;
        // The one that is not there has a time beyond the other's: by order it is the second.
        let mut lost = fit_of(vec![ar1(700.0, 1.1), ar1(5000.0, 0.0)]).fit;
        lost.zero = vec![1];
        let matched = matched(&outcome.fit, &lost);
        assert!(matched[0].is_none() && matched[1].unwrap() == &lost.composite.processes[0]);
        let draws = |lost_ones: usize| -> Vec<Fit> {
            let whole = (0..100 - lost_ones).map(|i| whole(0.8 + 0.4 * i as f64 / 99.0));
            whole.chain((0..lost_ones).map(|_| lost.clone())).collect()
        };
        let all = intervals(&outcome, &draws(2), &[1.0; 2]);
        assert!(all.iter().all(|i| i.absent.is_none()), "{all:?}");
        let all = intervals(&outcome, &draws(10), &[1.0; 2]);
        assert!(
            all[0].absent == Some(Undetermined::Vanishes) && (all[0].lost - 0.1).abs() < 1e-9,
            "{all:?}"
        );
        assert!(
            all[0].low.is_nan() && all[2].lost == 0.0 && all[3].low < 1.0 && all[3].high > 1.0,
            "{all:?}"
        );
    }

    #[test]
    fn an_interval_holds_its_estimate_or_is_none() {
        assert_eq!(unless_one_sided(1.0, [0.5, 2.0]), [0.5, 2.0]);
        assert!(
            unless_one_sided(3.0, [0.5, 2.0])
                .iter()
                .all(|end| end.is_nan())
        );
    }

    /// A variance known to be a chi-square of ν = 8 degrees of freedom over ν: 4000 draws around an estimate of 3 give the
    /// textbook's 3ν/17.53 … 3ν/2.18 (quantiles 0.975 and 0.025), to four standard errors of the draws' quantiles q,
    /// relative: 4·√(0.025·0.975/4000)/(q f(q)) with the densities 0.00876 and 0.0363, 6.4 and 12.5 %.
    #[test]
    fn the_interval_of_a_variance_is_the_textbooks() {
        let mut generator = generator(1, 0);
        let law = ChiSquared::new(8.0).unwrap();
        let drawn = (0..4000)
            .map(|_| 3.0 * generator.sample(law) / 8.0)
            .collect();
        let [low, high] = derived_interval(3.0, drawn);
        assert_relative_eq!(low, 24.0 / 17.53, max_relative = 0.064);
        assert_relative_eq!(high, 24.0 / 2.18, max_relative = 0.125);
        assert_eq!(derived_interval(0.0, vec![0.0, 0.0, 1.0]), [0.0, 1.0]);
        let [low, high] = mirrored(Parameter::Phi, [0.85, 0.93], 0.9);
        assert!(
            0.0 < low && low < 0.9 && 0.9 < high && high < 1.0,
            "{low} {high}"
        );
    }

    /// Draws that are on the whole a quarter of the estimate, 0.5 to 2 times their median: mirrored at the
    /// estimate, 2 to 8 times it; as they are, 1/8 to 1/2 of it. All of that is in the interval.
    #[test]
    fn the_interval_of_a_parameter_holds_the_draws_and_their_mirror_image() {
        let curve = exact(
            &Composite::new(vec![Process::white(1.0).unwrap()]),
            8,
            |_| 50.0,
        );
        let spec = "WN".parse().unwrap();
        let own = fit(&curve, &spec, 1.0, Weighting::Edof).unwrap();
        for factor in [1.0, 1.5] {
            let draw = |k: i32| {
                let white = Process::white(0.25 * (0.01 * f64::from(k)).exp2()).unwrap();
                Fit {
                    composite: Composite::new(vec![white]),
                    ..own.clone()
                }
            };
            let mut fits: Vec<Fit> = (-100..=100).map(draw).collect();
            stretch(&mut fits, &[factor]);
            let drawn = fits
                .iter()
                .map(|fit| fit.composite.processes[0].values()[0]);
            let quantiles = tails(drawn.collect());
            let found = hull(mirrored(Parameter::Sigma2, quantiles, 1.0), quantiles);
            // quantiles 0.025 and 0.975 of 201: the fifth from either end
            let end = 4.0 * 0.96_f64.exp2().powf(factor);
            assert_relative_eq!(found[..], [1.0 / end, end][..], max_relative = 0.01);
        }
    }
}

#[cfg(test)]
mod practical_tests {
    use super::*;
    use crate::noise::Process;

    fn practical(processes: Vec<Process>) -> Practical {
        Practical::of(&Composite::new(processes), 100.0, 1e4).unwrap()
    }

    /// White noise of N = 1e-3 with a random walk that takes over at √3·1e-3/1e-5 = 173 s; with a Gauss-Markov process of 30 s,
    /// which the pair over 1 s to 100 s follows on its rise and not on its fall (from 1.9·30 s on); with one that
    /// adds 3 % to the Allan variance at 30 s: the random walk that follows it over 1 s to 100 s would take over beyond,
    /// where nothing rises.
    #[test]
    fn a_random_walk_is_observed_where_the_model_rises_as_it_does() {
        let white = Process::white(1e-4).unwrap();
        let walk = Process::random_walk(1e-12).unwrap();
        let markov = |sigma: f64| Process::gauss_markov(1.0 / 30.0, sigma * sigma, 100.0).unwrap();
        let with_walk = practical(vec![white, walk]);
        assert!(with_walk.walk_is_observed() && with_walk.walk_until_s.is_none());
        let hump = practical(vec![white, markov(3e-3)]);
        let until = hump.walk_until_s.unwrap();
        assert!(
            hump.walk_is_observed() && (60.0..600.0).contains(&until),
            "{until}"
        );
        let trace = practical(vec![white, markov(5e-5)]);
        assert!(!trace.walk_is_observed(), "{trace:?}");
        assert!(trace.walk.crossover_s().unwrap() < trace.range_s);
    }
}
