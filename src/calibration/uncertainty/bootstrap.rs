//! New curves from a fit: the parametric bootstrap behind intervals, goodness of fit and full weighting.
//!
//! Each draw makes K new replicates. Their ln nu at all levels have the variances and the correlations that the
//! recorded ones show (Gaussian scores; chi-square in shape, so that the mean of nu is that of the fitted model): what
//! replicates differ by and the scatter within each are in these together, so that nothing is assumed of either, and what
//! few replicates leave unknown is Student's t ([`ReplicateSpread::student`]). The draws for full weighting, which needs more
//! than the rank of K replicates, and those of a single recording have the scatter *within* a recording of the
//! large-sample law (of the model's own wavelet variance and the length; divided by the efficiency where robust) and,
//! *between* replicates, the excess over it. Robust variances of few coefficients read high, in a draw as in a recording.
//! The estimator is applied to the new replicates, trim and all. No signal is simulated. A curve from elsewhere
//! scatters by its own degrees of freedom.

use super::intervals::{intervals, practical_intervals, stretch};
use super::spread::{LEVEL as ALIKE_LEVEL, ReplicateSpread, alike_p_value};
use super::varying::{parameter_spreads, simpler};
use crate::curve::sampling::{SamplingDistribution, implied};
use crate::curve::{Estimator, Group, LARGEST_BIAS, Replicate, average, median, p_value};
use crate::fit::Fit;
use crate::outcome::{
    Advance, Bootstrap, CalibrationSettings, Goodness, IndistinctProcesses, Inference, LevelSpread,
    Outcome, tau_s,
};
use crate::rng::{Generator, StreamKey};
use crate::wavelet::{Curve, RobustVariance, RootStatus};
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Sources of scatter in the draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScatterSource {
    /// Recordings differ, and each scatters for its length.
    All,
    /// Recordings differ, each of them endless.
    BetweenRecordings,
}

/// Draws curves as a fitted model and the spread of the replicates would give them.
pub(crate) struct CurveSampler<'a> {
    /// Name of the group.
    group: &'a str,
    replicates: &'a [Replicate],
    estimator: Estimator,
    /// The curve that was fitted.
    curve: &'a Curve,
    settings: &'a CalibrationSettings,
    pub(crate) law: SamplingDistribution,
    /// Spread of the replicates; none for a curve from elsewhere.
    pub(crate) spread: Option<ReplicateSpread>,
    /// The curve that the model implies.
    centre: Vec<f64>,
}

impl<'a> CurveSampler<'a> {
    /// A sampler of the curves of some replicates that the fit of an outcome would give.
    pub(crate) fn new(
        group: &'a str,
        replicates: &'a [Replicate],
        outcome: &'a Outcome,
        settings: &'a CalibrationSettings,
    ) -> Self {
        let (estimator, curve) = (outcome.estimator, &outcome.curve);
        Self::of_fit(group, replicates, estimator, curve, &outcome.fit, settings)
    }

    pub(crate) fn of_fit(
        group: &'a str,
        replicates: &'a [Replicate],
        estimator: Estimator,
        curve: &'a Curve,
        fit: &Fit,
        settings: &'a CalibrationSettings,
    ) -> Self {
        let levels = curve.levels.iter().copied().max().unwrap_or(1) as usize;
        let law = SamplingDistribution::new(&fit.composite, levels);
        let spread = (!replicates.is_empty())
            .then(|| ReplicateSpread::new(replicates, estimator, &law, &settings.tuning));
        Self {
            group,
            replicates,
            estimator,
            curve,
            settings,
            law,
            spread,
            centre: implied(&fit.composite, curve),
        }
    }

    /// Generator of a draw.
    pub(crate) fn generator(&self, seed: u64, scenario: &str, run: usize) -> Generator {
        let key = StreamKey {
            seed,
            scenario,
            run: run as u64,
            source: self.group,
            process: self.estimator.name(),
        };
        key.generator()
    }

    /// A new curve of the same estimator, of replicates that scatter as the recorded ones do.
    pub(crate) fn draw_as_recorded(&self, mut generator: Generator) -> Option<Curve> {
        match &self.spread {
            Some(spread) if self.replicates.len() > 1 => self.curve(spread.draw(&mut generator)),
            _ => self.draw(generator),
        }
    }

    /// A new curve of the same estimator, of replicates that scatter by the law and by what they differ beyond it.
    pub(crate) fn draw(&self, mut generator: Generator) -> Option<Curve> {
        let Some(spread) = &self.spread else {
            return Some(self.elsewhere(&mut generator));
        };
        let mut between = spread.draw_between(&mut generator);
        between.iter_mut().flatten().for_each(|b| *b = b.exp());
        self.draw_with(generator, &between, ScatterSource::All)
    }

    /// A new curve of the same estimator, of replicates that differ by `between` (`[replicate][level]`, over the model)
    /// and, unless they are endless, scatter by the law.
    pub(crate) fn draw_with(
        &self,
        mut generator: Generator,
        between: &[Vec<f64>],
        scattering: ScatterSource,
    ) -> Option<Curve> {
        if scattering == ScatterSource::BetweenRecordings {
            let log_bias = Vec::new();
            let curve = self.curve(between.to_vec());
            return curve.map(|curve| Curve { log_bias, ..curve });
        }
        let of_recording = |(edof, between): (&Vec<f64>, &Vec<f64>)| {
            let within = self.law.draw(edof, &mut generator).into_iter();
            within.zip(between).map(|(ratio, b)| ratio * b).collect()
        };
        let edof = &self.spread.as_ref()?.edof;
        self.curve(edof.iter().zip(between).map(of_recording).collect())
    }

    /// The estimator's curve of replicates of which nu*/nu is given.
    fn curve(&self, ratios: Vec<Vec<f64>>) -> Option<Curve> {
        let tuning = &self.settings.tuning;
        let edof = self.spread.iter().flat_map(|s| &s.edof);
        let drawn_replicate = |((replicate, ratios), edof): ((&Replicate, Vec<f64>), &Vec<f64>)| {
            let levels = self.centre.iter().zip(ratios).zip(edof);
            let drawn = |(j, ((nu, ratio), edof)): (usize, ((&f64, f64), &f64))| {
                // The law gives ratios whose mean is 1; robust variances of few coefficients read high, and so
                // must those drawn.
                let bias = match replicate.is_robust(self.estimator, j) {
                    true => (tuning.bias() / edof).min(LARGEST_BIAS),
                    false => 0.0,
                };
                nu * ratio * (1.0 + bias)
            };
            let levels = levels.take(replicate.levels()).enumerate();
            with_variances(replicate, levels.map(drawn).collect())
        };
        let pairs = self.replicates.iter().zip(ratios).zip(edof);
        let replicates: Vec<Replicate> = pairs.map(drawn_replicate).collect();
        let curve = average(&replicates, self.estimator, self.settings.trim, tuning).ok()?;
        // The draws have a root everywhere; what the fit left out, it leaves out of every draw.
        let (wv, edof, levels) = (curve.wv, curve.edof, curve.levels);
        Some(Curve {
            levels,
            wv,
            edof,
            quantization: curve.quantization,
            ..self.curve.clone()
        })
    }

    /// A curve from elsewhere, which scatters by its degrees of freedom, and as a whole by what recordings differ by.
    fn elsewhere(&self, generator: &mut Generator) -> Curve {
        let curve = self.curve;
        // The law knows all levels from 1; the curve may have some of them.
        let mut edof = vec![1.0; self.law.correlation.nrows()];
        curve
            .levels
            .iter()
            .zip(&curve.edof)
            .for_each(|(l, e)| edof[*l as usize - 1] = *e);
        let ratio = self.law.draw(&edof, generator);
        let shared = curve.differing.sqrt() * generator.sample::<f64, _>(StandardNormal);
        let wv = curve
            .levels
            .iter()
            .zip(&self.centre)
            .map(|(l, nu)| nu * ratio[*l as usize - 1] * shared.exp());
        Curve {
            wv: wv.collect(),
            ..curve.clone()
        }
    }
}

/// A replicate of the same length with other variances, classical where that replicate's are.
pub(crate) fn with_variances(replicate: &Replicate, nu: Vec<f64>) -> Replicate {
    let status = |j: usize| match replicate.robust.get(j).map(|robust| robust.status) {
        Some(RootStatus::Coarse) => RootStatus::Coarse,
        _ => RootStatus::Ok,
    };
    let robust = nu
        .iter()
        .enumerate()
        .map(|(j, nu)| RobustVariance {
            value: *nu,
            status: status(j),
            zeros: 0.0,
        })
        .collect();
    Replicate {
        name: String::new(),
        axis: replicate.axis,
        samples: replicate.samples,
        coverage: replicate.coverage.clone(),
        classical: nu,
        robust,
        trend: f64::NAN,
        mean: f64::NAN,
    }
}

// Whether a model describes a curve: the J-test
// ([Guerrier](crate::bibliography::Guerrier13)).

/// The test of a fit, given the fits of the draws.
fn goodness(outcome: &Outcome, draws: &[Fit]) -> Goodness {
    let Outcome { fit, .. } = outcome;
    let objectives: Vec<f64> = draws.iter().map(|d| d.objective).collect();
    Goodness {
        statistic: fit.objective,
        dof: (outcome.curve.counted_levels().len()).saturating_sub(fit.free_parameters()),
        expected: median(&objectives),
        p_value: p_value(fit.objective, &objectives),
    }
}

// Uncertainty of a fit: intervals of its parameters, and whether the model describes the curve at all.
//
// A parametric bootstrap ([`super::bootstrap`]): the model is fitted to each curve drawn.
//
// Intervals of two replicates, known to one degree of freedom at every scale, cover less than they say (87 and 93 % of
// 300 sets, white noise and random walk); of three and more 93 to 96 %, and 89 to 93 % for the white noise of three
// recordings whose axes share what these differ by.

/// The inference of an outcome; where alike processes cannot be distinguished, with the intervals of the simpler model.
pub(crate) fn inference(
    group: &Group,
    outcome: &Outcome,
    settings: &CalibrationSettings,
    bootstrap: Bootstrap,
    advance: Advance<'_>,
) -> Inference {
    let mut own = by_bootstrap(group, outcome, settings, bootstrap, advance);
    if let Some((simple, processes, p_value)) = simpler(group, outcome, settings) {
        // By recursion: the simpler model may itself have processes that are not distinguished.
        let intervals = inference(group, &simple, settings, bootstrap, &|_| {}).intervals;
        let indistinct = IndistinctProcesses {
            processes,
            spec: simple.spec,
            p_value,
            intervals,
        };
        indistinct.adopt(outcome, &mut own.intervals);
        own.indistinct = Some(indistinct);
    }
    advance(bootstrap.draws as u64);
    own
}

/// The draws of an outcome, and what they tell.
pub(crate) fn by_bootstrap(
    group: &Group,
    outcome: &Outcome,
    settings: &CalibrationSettings,
    bootstrap: Bootstrap,
    advance: Advance<'_>,
) -> Inference {
    let name = group.scope.name();
    let sampler = CurveSampler::new(&name, &group.replicates, outcome, settings);
    // The scatter that the model lacks at each scale belongs to its intervals, and not to the test of whether it lacks any.
    let draw = |run: usize, lack_of_fit: f64| {
        let generator = |scenario| sampler.generator(bootstrap.seed, scenario, run);
        let mut curve = sampler.draw_as_recorded(generator("bootstrap"))?;
        let mut misfit = generator("misfit");
        for wv in curve.wv.iter_mut().filter(|_| lack_of_fit > 0.0) {
            *wv *= (lack_of_fit.sqrt() * misfit.sample::<f64, _>(StandardNormal)).exp();
        }
        outcome.estimate_again(&curve, settings).ok()
    };
    let runs = || (0..bootstrap.draws).into_par_iter();
    let mut fits: Vec<Fit> = runs()
        .filter_map(|run| {
            let fit = draw(run, 0.0);
            advance(1);
            fit
        })
        .collect();
    let goodness = (outcome.estimator != Estimator::Avlr).then(|| goodness(outcome, &fits));
    if outcome.fit.lack_of_fit > 0.0 {
        fits = runs()
            .filter_map(|run| draw(run, outcome.fit.lack_of_fit))
            .collect();
    }
    let spread = sampler.spread.as_ref();
    let model = &outcome.fit.composite;
    let one = vec![1.0; model.processes.len()];
    let stretches = spread.map_or(one, |spread| spread.student(model, &outcome.curve));
    stretch(&mut fits, &stretches);
    let intervals = intervals(outcome, &fits, &stretches);
    let alike = spread
        .and_then(|s| alike_p_value(&group.replicates, outcome.estimator, s, &sampler.law, &name));
    let varying = match alike {
        Some(p) if p <= ALIKE_LEVEL => {
            parameter_spreads(group, outcome, &intervals, settings, bootstrap)
        }
        _ => Vec::new(),
    };
    advance(bootstrap.draws as u64);
    Inference {
        draws: bootstrap.draws,
        fitted: fits.len(),
        drawn: fits.iter().map(|fit| fit.composite.clone()).collect(),
        intervals,
        goodness,
        spread: spread.map_or(Vec::new(), |s| {
            level_spreads(s, &outcome.curve.levels, settings.rate_hz)
        }),
        alike,
        varying,
        indistinct: None,
        practical: practical_intervals(outcome, &fits, settings.rate_hz),
    }
}

/// Deviations within recordings and between them, scale by scale.
fn level_spreads(spread: &ReplicateSpread, levels: &[u32], rate_hz: f64) -> Vec<LevelSpread> {
    let deviations = spread.within.iter().zip(&spread.between);
    let of_level = |(&level, (&within, &between)): (&u32, (&f64, &f64))| LevelSpread {
        tau_s: tau_s(level, rate_hz),
        within,
        between,
    };
    levels.iter().zip(deviations).map(of_level).collect()
}

#[cfg(test)]
#[path = "goodness_tests.rs"]
mod goodness_tests;

#[cfg(test)]
mod inference_tests {
    use super::*;
    use crate::noise::ProcessKind;
    use crate::tests::*;
    use crate::{ParameterInterval, grouped};

    const CHANNEL: Channel = Channel {
        sensor: Sensor::Gyro,
        axis: Axis::X,
    };
    const SAMPLES: usize = 1024;

    /// Replicates of white noise and random walk, each with its own variances.
    fn group(set: u64, replicates: &[(f64, f64)]) -> Group {
        let recording = |(run, (sigma2, gamma2)): (usize, &(f64, f64))| {
            let mut generator = generator(set, run as u64);
            let mut walk = 0.0;
            let mut next = || {
                walk += gamma2.sqrt() * normal(&mut generator);
                walk + sigma2.sqrt() * normal(&mut generator)
            };
            let signal: Vec<f64> = (0..SAMPLES).map(|_| next()).collect();
            (CHANNEL, measured(String::new(), &signal, 8))
        };
        let replicates = replicates.iter().enumerate().map(recording).collect();
        grouped(replicates, Pool::Axes).remove(0)
    }

    /// 150 sets of 3, 4 and 8 signals: a frequency that is really 0.95 lies within 4·√(0.95·0.05/150) = 0.071 of it; the
    /// test rejects in 5 % of them, within the same.
    #[test]
    fn intervals_cover_and_the_j_test_keeps_its_level() {
        const SETS: u64 = 150;
        let settings = plain_settings("WN+RW");
        let truth = [1.0, 1e-3];
        for replicates in [3, 4, 8] {
            let mut covered = [0_u32; 2];
            let mut rejected = 0_u32;
            for set in 0..SETS {
                let group = group(set, &vec![(1.0, 1e-3); replicates]);
                let inference = inferred(&[group], &settings, 99, 3).inference.unwrap();
                for (i, value) in truth.into_iter().enumerate() {
                    let interval = &inference.intervals[i];
                    covered[i] += u32::from(interval.low < value && value < interval.high);
                }
                rejected += u32::from(inference.goodness.unwrap().p_value <= 0.05);
            }
            let share = |n: u32| f64::from(n) / SETS as f64;
            let shown = (share(covered[0]), share(covered[1]), share(rejected));
            assert!(
                (shown.0 - 0.95).abs() < 0.071 && (shown.1 - 0.95).abs() < 0.071,
                "{replicates}: {shown:?}"
            );
            assert!((shown.2 - 0.05).abs() < 0.071, "{replicates}: {shown:?}");
        }
    }

    /// sigma2 of 8 replicates with variances 0.8 … 1.22: their standard deviation over √8 is the spread of the
    /// mean, of which 1.96 (normal) to 3 (Student with 7 degrees, chance of 300 draws) make half an interval.
    #[test]
    fn differences_between_replicates_widen_the_intervals() {
        let variances: Vec<(f64, f64)> = (0..8).map(|i| (0.8 + 0.06 * f64::from(i), 0.0)).collect();
        let deviation = 0.06 * 6.0_f64.sqrt(); // of 0 … 7: √6
        let half_of = |variances: &[(f64, f64)]| {
            let groups = [group(1, variances)];
            let found = inferred(&groups, &plain_settings("WN"), 300, 3)
                .inference
                .unwrap();
            let interval = &found.intervals[0];
            (0.5 * (interval.high - interval.low), found.spread)
        };
        let (half, spread) = half_of(&variances);
        let unit = half / (deviation / 8.0_f64.sqrt());
        assert!(unit > 1.6 && unit < 3.4, "{unit}");
        assert!(spread[0].between > 2.0 * spread[0].within, "{spread:?}");
        let (alike, _) = half_of(&[(1.0, 0.0); 8]);
        // Noise alone: at least 1.96·√(2/(8·1024)) = 0.031, which maximum likelihood would reach.
        assert!((0.027..0.06).contains(&alike), "{alike}");
    }

    #[test]
    fn a_model_that_is_wrong_is_rejected() {
        let groups = [group(5, &[(1.0, 1e-2); 4])];
        let outcome = inferred(&groups, &plain_settings("WN"), 99, 3);
        assert!(outcome.inference.unwrap().goodness.unwrap().p_value < 0.05);
    }

    /// 100 sets of four recordings of white noise, flicker noise and random walk, each leading at some of nine scales: the mean
    /// estimate of B² is within four of its standard errors of the truth, and the intervals hold it in 95 %, within
    /// 4·√(0.95·0.05/100) = 8.7 %.
    #[test]
    fn flicker_noise_is_fitted_and_covered() {
        const SETS: u64 = 100;
        let process = |code, value| {
            Process::of_values(ProcessKind::named(code).unwrap(), &[value], 1.0).unwrap()
        };
        let axis = Composite::new(vec![
            process("WN", 1.0),
            process("FN", 0.05),
            process("RW", 2e-5),
        ]);
        let model = Model::pooled(1.0, &axis, &axis);
        let settings = plain_settings("WN+FN+RW");
        let found = |seed: u64| {
            let groups = recorded(&imu(&model, None, seed), 4, &[CHANNEL], 1 << 13, &settings);
            let outcome = inferred(&groups, &settings, 99, 3);
            let interval = outcome.inference.unwrap().intervals[1].clone();
            (outcome.fit.composite.processes[1].values()[0], interval)
        };
        let all: Vec<_> = (0..SETS).into_par_iter().map(found).collect();
        let n = SETS as f64;
        let mean = all.iter().map(|(b2, _)| b2).sum::<f64>() / n;
        let sd = (all.iter().map(|(b2, _)| (b2 - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        assert_abs_diff_eq!(mean, 0.05, epsilon = 4.0 * sd / n.sqrt());
        let is_held = |(_, i): &&(f64, ParameterInterval)| i.low < 0.05 && 0.05 < i.high;
        let held = all.iter().filter(is_held).count() as f64 / n;
        assert_abs_diff_eq!(held, 0.95, epsilon = 0.087);
    }
}
