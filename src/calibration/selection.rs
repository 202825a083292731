//! Which model? Ranks sums of processes by the wavelet information criterion, and takes the simplest that is as
//! good as the best.
//!
//! WVIC = Σ Omega_j (nu_j − nu_j(theta))² + 2 Σ Omega_j cov(nu_j, nu_j(theta)): what the distance to the curve of
//! another recording of the same noise would be on average, the covariance (the optimism: how far the model
//! follows the noise of its own curve) from a parametric bootstrap
//! ([Guerrier](crate::bibliography::Guerrier13); Efron's covariance penalty). Draws are from the candidate
//! that fits best, the same for all.
//!
//! A criterion of this kind keeps a superfluous process now and then however long the record. So the simplest
//! candidate nested in the best is taken whose distance is not larger than that of the best beyond chance: by a bootstrap from
//! it, at 1 %: the best is the most fortunate of several; and which the J-test does not reject at 1 %, by draws that
//! scatter as the recordings do. Where it rejects the best too, the first by WVIC that passes is taken.

use crate::curve::{CalibrationError, Estimator, Group, implied, p_value};
use crate::fit::{Fit, Weighting, fit, refit, too_few_scales};
use crate::model::ModelSpec;
use crate::noise::ProcessKind;
use crate::outcome::{Advance, CalibrationSettings, ModelCandidate, ModelChoice, ModelRanking};
use crate::uncertainty::bootstrap::CurveSampler;
use crate::wavelet::Curve;
use rayon::prelude::*;

/// Draws behind an optimism, and behind a test.
const DRAWS: usize = 199;
/// Draws after which a simpler model that is twice as far off as any of them is given up: so many that none as far
/// off has a probability of [`LEVEL`].
const FIRST: usize = 99;
/// A simpler model is given up when chance makes so large a difference with no more than this probability. Under 5 %, for
/// what it is compared with is the best of several larger ones: at 5 % white noise was given up in 8 of 30 sets.
const LEVEL: f64 = 0.01;
/// The J-test costs a candidate its place below this probability: at 5 %, as that of the fit has it, a larger sum with a worse
/// criterion was taken in the place of a true one that was rejected by chance.
const J_LEVEL: f64 = 0.01;
/// Seed of the draws: a choice is an answer, the same each time.
const SEED: u64 = 1;

/// All sums of WN, QN, RW, DR and up to two AR1 that so many scales can carry.
fn sums(scales: usize) -> Vec<ModelSpec> {
    let single = [
        ProcessKind::White,
        ProcessKind::Quantization,
        ProcessKind::RandomWalk,
        ProcessKind::Drift,
    ];
    let mut all = Vec::new();
    for bits in 0..1_u32 << single.len() {
        for correlated in 0..=2 {
            let chosen = single
                .iter()
                .enumerate()
                .filter(|(i, _)| bits >> i & 1 == 1)
                .map(|(_, k)| *k);
            let spec =
                ModelSpec::of(chosen.chain(std::iter::repeat_n(ProcessKind::Ar1, correlated)));
            // At least one scale more than parameters, or the model meets the curve exactly and its distance
            // tells nothing.
            if (1..scales).contains(&spec.parameters()) {
                all.push(spec);
            }
        }
    }
    all.sort_by_key(ModelSpec::parameters);
    all
}

/// Fits every candidate and chooses.
///
/// # Errors
/// When the curve is too short for any, or no curve.
pub(crate) fn choose(
    group: &Group,
    estimator: Estimator,
    curve: &Curve,
    settings: &CalibrationSettings,
    advance: Advance<'_>,
) -> Result<(ModelSpec, ModelRanking), CalibrationError> {
    let stage = ModelChoice::Auto.steps() / ModelChoice::STAGES;
    // One weighting for all candidates, whatever their models expect.
    let reported = settings;
    let settings = &CalibrationSettings {
        weighting: Weighting::Edof,
        ..settings.clone()
    };
    let fitted = |spec: &ModelSpec| {
        fit(curve, spec, settings.rate_hz, settings.weighting).map(|fit| (spec.clone(), fit))
    };
    let scales = curve.counted_levels().len();
    let all = sums(scales);
    let fits = all.par_iter().map(fitted).collect::<Result<Vec<_>, _>>()?;
    let fits: Vec<(ModelSpec, Fit)> = fits
        .into_iter()
        .filter(|(_, f)| f.zero.is_empty() && f.at_end.is_empty())
        .collect();
    advance(stage);
    let field = CandidateSet {
        group,
        estimator,
        curve,
        settings,
        reported,
        fits,
    };
    field
        .rank(&|| advance(stage))
        .ok_or_else(|| too_few_scales("auto", 2, scales))
}

/// The probabilities of the candidates that were tested.
#[derive(Default)]
struct Trials {
    /// Against the best, of which they are special cases.
    simpler: Vec<(usize, f64)>,
    /// Against the curve: the J-test.
    whole: Vec<(usize, f64)>,
}

impl Trials {
    /// Candidates that the ranking lists, however far they are: the chosen one, and those that only the
    /// J-test refused.
    fn listed(&self, chosen: usize) -> Vec<usize> {
        let rejected = self.whole.iter().map(|(i, _)| *i);
        rejected.chain([chosen]).collect()
    }
}

fn found(tested: &[(usize, f64)], i: usize) -> Option<f64> {
    tested.iter().find(|(t, _)| *t == i).map(|(_, p)| *p)
}

/// The candidates, with all that their comparison needs.
struct CandidateSet<'a> {
    group: &'a Group,
    estimator: Estimator,
    curve: &'a Curve,
    /// With the weighting that is the same for all candidates.
    settings: &'a CalibrationSettings,
    /// With the weighting of the fit that is reported.
    reported: &'a CalibrationSettings,
    fits: Vec<(ModelSpec, Fit)>,
}

impl CandidateSet<'_> {
    fn rank(&self, stage_done: &dyn Fn()) -> Option<(ModelSpec, ModelRanking)> {
        let nearest = (0..self.fits.len())
            .min_by(|a, b| self.objective(*a).total_cmp(&self.objective(*b)))?;
        // One set of curves for all candidates: their optimisms are then compared on the same noise.
        let curves = self.draws(nearest);
        // An optimism is not negative: whose distance alone exceeds the sum of the nearest is not the best.
        let bound = self.objective(nearest) + self.optimism(nearest, &curves);
        let near: Vec<usize> = (0..self.fits.len())
            .filter(|i| self.objective(*i) <= bound)
            .collect();
        let mut ranked: Vec<(usize, f64)> = near
            .into_par_iter()
            .map(|i| (i, self.optimism(i, &curves)))
            .collect();
        let order = |ranked: &mut Vec<(usize, f64)>| {
            ranked
                .sort_by(|a, b| (self.objective(a.0) + a.1).total_cmp(&(self.objective(b.0) + b.1)))
        };
        order(&mut ranked);
        let best = ranked.first()?.0;
        stage_done();
        let mut trials = Trials::default();
        let chosen = self.take(best, &ranked, &mut trials);
        stage_done();
        for tested in trials.listed(chosen) {
            if !ranked.iter().any(|(i, _)| *i == tested) {
                ranked.push((tested, self.optimism(tested, &curves)));
            }
        }
        order(&mut ranked);
        let candidate = |&(i, optimism): &(usize, f64)| ModelCandidate {
            spec: self.fits[i].0.clone(),
            objective: self.objective(i),
            optimism,
            p_value: found(&trials.simpler, i),
            j_p_value: found(&trials.whole, i),
        };
        let candidates: Vec<ModelCandidate> = ranked.iter().map(candidate).collect();
        let place = ranked.iter().position(|(i, _)| *i == chosen)?;
        let too_simple = trials.simpler.iter().rev();
        let too_simple = too_simple
            .copied()
            .find(|(i, p)| *p <= LEVEL && *i != chosen);
        let spec = |i: usize| self.fits[i].0.clone();
        Some((
            spec(chosen),
            ModelRanking {
                candidates,
                chosen: place,
                too_simple: too_simple.map(|(i, p)| (spec(i), p)),
            },
        ))
    }

    fn objective(&self, i: usize) -> f64 {
        self.fits[i].1.objective
    }

    /// The simplest that does as well as the best and that the J-test does not reject; else the best, else the first by WVIC
    /// that it does not reject; where it rejects all, the simplest that does as well.
    fn take(&self, best: usize, ranked: &[(usize, f64)], trials: &mut Trials) -> usize {
        let mut simplest = None;
        // Ascending in their number of parameters.
        for i in
            (0..self.fits.len()).filter(|i| self.fits[*i].0.is_special_case_of(&self.fits[best].0))
        {
            if i != best {
                let p = self.p_value(i, best);
                trials.simpler.push((i, p));
                if p <= LEVEL {
                    continue;
                }
            }
            simplest.get_or_insert(i);
            if self.passes(i, trials) {
                return i;
            }
        }
        let passing = ranked
            .iter()
            .map(|(i, _)| *i)
            .find(|i| self.passes(*i, trials));
        passing.or(simplest).unwrap_or(best)
    }

    /// Returns true if the J-test does not reject candidate `i`.
    fn passes(&self, i: usize, trials: &mut Trials) -> bool {
        let p = found(&trials.whole, i).unwrap_or_else(|| {
            let p = self.j_p_value(i);
            trials.whole.push((i, p));
            p
        });
        p >= J_LEVEL
    }

    /// Probability of so large an objective if the candidate is true, of its fit as it would be reported.
    fn j_p_value(&self, i: usize) -> f64 {
        let Self {
            curve, reported, ..
        } = *self;
        let spec = &self.fits[i].0;
        // Weights of the observed variances cannot reject a model that is far below them: a scale costs edof/2 at most.
        let Ok(own) = fit(curve, spec, reported.rate_hz, reported.weighting) else {
            return 0.0;
        };
        let name = self.group.scope.name();
        let sampler = self.sampler(&name, &own);
        let draw = |run| sampler.draw_as_recorded(sampler.generator(SEED, "auto J-test", run));
        let curves: Vec<Curve> = (0..DRAWS).filter_map(draw).collect();
        let objective = |c: &Curve| {
            let fit = refit(c, spec, reported.rate_hz, reported.weighting, &own);
            fit.ok().map(|fit| fit.objective)
        };
        let drawn: Vec<f64> = curves.par_iter().filter_map(objective).collect();
        p_value(own.objective, &drawn)
    }

    /// New curves of a candidate.
    fn draws(&self, i: usize) -> Vec<Curve> {
        let name = self.group.scope.name();
        let sampler = self.sampler(&name, &self.fits[i].1);
        let draw = |run| sampler.draw(sampler.generator(SEED, "auto", run));
        (0..DRAWS).filter_map(draw).collect()
    }

    fn sampler<'b>(&'b self, name: &'b str, fit: &Fit) -> CurveSampler<'b> {
        let (replicates, settings) = (&self.group.replicates, self.settings);
        CurveSampler::of_fit(name, replicates, self.estimator, self.curve, fit, settings)
    }

    fn again(&self, i: usize, curve: &Curve) -> Option<Fit> {
        let (spec, fit) = &self.fits[i];
        refit(
            curve,
            spec,
            self.settings.rate_hz,
            self.settings.weighting,
            fit,
        )
        .ok()
    }

    /// 2 Σ Omega_j cov(nu_j, nu_j(theta)), Omega that of the curve itself.
    fn optimism(&self, i: usize, curves: &[Curve]) -> f64 {
        let fitted = |c| Some((c, implied(&self.again(i, c)?.composite, c)));
        let pairs: Vec<(&Curve, Vec<f64>)> = curves.iter().filter_map(fitted).collect();
        let count = pairs.len() as f64;
        let roots = self.settings.weighting.roots(self.curve, &self.curve.wv);
        let term = |(j, root): (usize, &f64)| {
            let rooted = |(c, implied): &(&Curve, Vec<f64>)| (root * c.wv[j], root * implied[j]);
            let (mut a, mut b, mut ab) = (0.0, 0.0, 0.0);
            // About the first, so that no digits are lost.
            let first = rooted(&pairs[0]);
            for (x, y) in pairs.iter().map(rooted) {
                let (x, y) = (x - first.0, y - first.1);
                (a, b, ab) = (a + x, b + y, ab + x * y);
            }
            2.0 * (ab - a * b / count) / (count - 1.0)
        };
        if pairs.len() < 2 {
            f64::INFINITY
        } else {
            roots.iter().enumerate().map(term).sum()
        }
    }

    /// Probability that the objectives differ by so much if the simpler is true (an upper bound where it is
    /// hopeless).
    fn p_value(&self, simple: usize, best: usize) -> f64 {
        let observed = self.objective(simple) - self.objective(best);
        let curves = self.draws(simple);
        let difference =
            |c: &Curve| Some(self.again(simple, c)?.objective - self.again(best, c)?.objective);
        let (some, rest) = curves.split_at(FIRST.min(curves.len()));
        let mut drawn: Vec<f64> = some.par_iter().filter_map(difference).collect();
        // With the 99 drawn and none as far off, p ≤ 1/100: the other hundred would only confirm it.
        if observed <= 2.0 * drawn.iter().copied().fold(0.0, f64::max) {
            drawn.extend(rest.par_iter().filter_map(difference).collect::<Vec<_>>());
        }
        p_value(observed, &drawn)
    }
}

#[cfg(test)]
#[path = "selection_tests.rs"]
mod tests;
