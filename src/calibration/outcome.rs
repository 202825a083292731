//! Settings and results of a calibration: data that estimation, tests and words share.

use crate::curve::{CalibrationError, Estimator, Pool, Scope, Trim, implied};
use crate::fit::{Fit, Weighting, avlr, refit, score};
use crate::imu::Axis;
use crate::model::{ModelSpec, SpecError};
use crate::noise::practical::{AllanMinimum, NoiseDensities};
use crate::noise::{Composite, Model, ParameterRef};
use crate::wavelet::{Curve, Tuning};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::str::FromStr;

/// The noise model of outcomes, at a rate (Hz); axes of none have no noise.
pub fn model_of<'a>(outcomes: impl IntoIterator<Item = &'a Outcome>, rate_hz: f64) -> Model {
    let mut model = Model {
        rate_hz,
        axes: Default::default(),
    };
    outcomes
        .into_iter()
        .for_each(|outcome| outcome.apply_to(&mut model));
    model
}

/// Scale of a level (s).
pub fn tau_s(level: u32, rate_hz: f64) -> f64 {
    f64::from(level).exp2() / rate_hz
}

/// One fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Scope of the model: an axis of a sensor, or all its axes.
    pub scope: Scope,
    /// Replicates averaged; 0 for a curve from elsewhere.
    pub replicates: usize,
    /// Recordings that these are of.
    pub recordings: usize,
    /// The estimator.
    pub estimator: Estimator,
    /// Specification of the model.
    pub spec: ModelSpec,
    /// Ranking by which the specification was chosen, if it was.
    pub ranking: Option<ModelRanking>,
    /// The curve that was fitted.
    pub curve: Curve,
    /// The model.
    pub fit: Fit,
    /// Difference of the pooled axes, where there is one.
    pub axes_differ: Option<AxesDiffer>,
    /// Intervals of its parameters and goodness of fit, once [`add_intervals`](crate::add_intervals) was asked for them.
    pub inference: Option<Inference>,
    /// White noise, quantization noise, flicker noise and random walk read off the curve, where the model does not describe it.
    pub reading: Option<Box<Outcome>>,
}

impl Outcome {
    /// Gives its noise to the axes of a model that it is for.
    pub fn apply_to(&self, model: &mut Model) {
        for channel in self.scope.channels() {
            model.axes[channel.index()] = self.fit.composite.clone();
        }
    }

    /// Outcome whose processes a navigation filter should use: the reading of the curve where the
    /// model does not describe it, else the model itself.
    pub fn for_navigation(&self) -> &Self {
        self.reading.as_deref().unwrap_or(self)
    }

    /// The fit to a curve that resembles this one.
    pub(crate) fn estimate_again(
        &self,
        curve: &Curve,
        settings: &CalibrationSettings,
    ) -> Result<Fit, CalibrationError> {
        match self.estimator {
            Estimator::Avlr => avlr(curve, &self.spec),
            _ => refit(
                curve,
                &self.spec,
                settings.rate_hz,
                settings.weighting,
                &self.fit,
            ),
        }
    }
}

// Settings of a calibration.

/// Settings of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationSettings {
    /// The curves to fit.
    pub estimators: Vec<Estimator>,
    /// Choice of the model.
    pub model: ModelChoice,
    /// Replicates that DR-AWV drops.
    pub trim: Trim,
    /// The tuning the robust wavelet variances were made with.
    pub tuning: Tuning,
    /// Weights of the scales.
    pub weighting: Weighting,
    /// The scales that count (s); none: all.
    pub fit_range: Option<FitRange>,
    /// Sample rate (Hz).
    pub rate_hz: f64,
}

/// Scales that count in a fit, both ends included (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitRange {
    /// Shortest (s).
    pub from_s: f64,
    /// Longest (s).
    pub to_s: f64,
}

/// Who says what the model is made of.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelChoice {
    /// The user.
    Given(ModelSpec),
    /// The curves.
    Auto,
}

impl Default for ModelChoice {
    fn default() -> Self {
        Self::Given(ModelSpec::n2())
    }
}

impl FromStr for ModelChoice {
    type Err = SpecError;

    /// "auto", or a sum of processes.
    fn from_str(text: &str) -> Result<Self, SpecError> {
        if text.eq_ignore_ascii_case("auto") {
            Ok(Self::Auto)
        } else {
            text.parse().map(Self::Given)
        }
    }
}

/// Is told how many more steps of a long computation are done, from any thread.
pub type Advance<'a> = &'a (dyn Fn(u64) + Sync);

impl ModelChoice {
    /// Stages of a choice.
    pub(crate) const STAGES: u64 = 3;

    /// Number of steps of a fit, in which a draw of the bootstrap is one.
    pub const fn steps(&self) -> u64 {
        match self {
            Self::Given(_) => 10,
            // dozens of candidates, each fitted to as many draws
            Self::Auto => Self::STAGES * 300,
        }
    }

    /// Parameters that are to be found, at least.
    pub fn parameters(&self) -> usize {
        match self {
            Self::Given(spec) => spec.parameters(),
            Self::Auto => 2,
        }
    }
}

impl std::fmt::Display for ModelChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given(spec) => spec.fmt(f),
            Self::Auto => f.write_str("auto"),
        }
    }
}

impl Default for CalibrationSettings {
    /// Settings that suit most recordings: DR-AWV, N2. At 1 Hz, until a rate is known.
    fn default() -> Self {
        Self {
            estimators: vec![Estimator::default()],
            model: ModelChoice::default(),
            trim: Trim::default(),
            tuning: Tuning::default(),
            weighting: Weighting::default(),
            fit_range: None,
            rate_hz: 1.0,
        }
    }
}

impl CalibrationSettings {
    /// Returns true for a level within the range of the fit; the ends may be off by rounding.
    pub(crate) fn counts(&self, level: u32) -> bool {
        let scale_s = tau_s(level, self.rate_hz);
        self.fit_range.is_none_or(|range| {
            scale_s >= range.from_s * (1.0 - 1e-9) && scale_s <= range.to_s * (1.0 + 1e-9)
        })
    }

    /// Signals that the estimators take as replicates of one another, unless told otherwise: those of single
    /// recordings pool nothing.
    pub fn pool(&self) -> Pool {
        if self.estimators.iter().any(|e| e.is_single()) {
            Pool::Axes
        } else {
            Pool::Sensor
        }
    }
}

// Uncertainty of a fit: the results.

/// Settings of the bootstrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bootstrap {
    /// Number of draws.
    pub draws: usize,
    /// Seed of all of them.
    pub seed: u64,
}

impl Bootstrap {
    /// Draws, usually: the ends of a 95 % interval are the fifth of them at either side.
    pub const DRAWS: usize = 200;
}

impl Default for Bootstrap {
    fn default() -> Self {
        Self {
            draws: Self::DRAWS,
            seed: 1,
        }
    }
}

/// Uncertainty of a fit by the bootstrap.
#[derive(Debug, Clone, PartialEq)]
pub struct Inference {
    /// Draws made.
    pub draws: usize,
    /// Draws that had a fit.
    pub fitted: usize,
    /// The models of these draws: what other recordings of the same IMU would have given. Their distances from the median are
    /// stretched for the few replicates from which their scatter is known: by Student's quantile over the normal one.
    pub drawn: Vec<Composite>,
    /// One interval a parameter that is not fixed, in the order of the model.
    pub intervals: Vec<ParameterInterval>,
    /// Goodness of fit of the model; none for slopes (AVLR), which are not fitted to the curve.
    pub goodness: Option<Goodness>,
    /// Spread of the replicates at each level of the curve. Empty for a curve from elsewhere.
    pub spread: Vec<LevelSpread>,
    /// Probability that replicates of one noise differ as much at some scale (see [`ALIKE_LEVEL`](crate::ALIKE_LEVEL)); none of a
    /// single signal.
    pub alike: Option<f64>,
    /// Parameters that are known to differ between recordings; none where [`alike`](Self::alike) does not say that these differ.
    pub varying: Vec<ParameterSpread>,
    /// Alike processes that cannot be distinguished, and the simpler model.
    pub indistinct: Option<IndistinctProcesses>,
    /// Intervals of N, K and B.
    pub practical: PracticalIntervals,
}

/// Practitioners' parameters of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Practical {
    /// N and K, of the policy "matched" over the default horizon.
    pub walk: NoiseDensities,
    /// B.
    pub minimum: Option<AllanMinimum>,
    /// 95 % intervals of N, K and B.
    pub intervals: PracticalIntervals,
    /// Longest averaging time that was observed (s): how far a minimum was looked for.
    pub range_s: f64,
    /// First of these averaging times (s) at which the pair of N and K has more than [`Practical::BESIDE`] times the Allan
    /// deviation of the model, if there is one: K is no random walk beyond.
    pub walk_until_s: Option<f64>,
}

impl Practical {
    /// Ratio of Allan deviations from which on a random walk does not stand for a model: over an octave of averaging times a
    /// random walk and a floor part by √2, over two by this.
    pub const BESIDE: f64 = 2.0;

    /// Returns true if K is supported by the data: the random walk dominates within the observed
    /// averaging times, and the model agrees with it over an octave of these. Otherwise K
    /// extrapolates.
    pub fn walk_is_observed(&self) -> bool {
        let lasts = |from: f64| self.walk_until_s.is_none_or(|until| until >= 2.0 * from);
        self.walk
            .crossover_s()
            .is_some_and(|from| from <= self.range_s && lasts(from))
    }
}

/// 95 % intervals (units of the parameter); none where the draws do not determine it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PracticalIntervals {
    /// White noise density N (units/√Hz).
    pub density: Option<[f64; 2]>,
    /// Random-walk density K (units/s/√Hz).
    pub walk: Option<[f64; 2]>,
    /// Bias instability B (units).
    pub instability: Option<[f64; 2]>,
}

/// The axes of a pooled sensor, where they differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxesDiffer {
    /// Level at which they differ by the largest ratio.
    pub level: u32,
    /// Probability that alike axes differ so at some scale.
    pub p_value: f64,
    /// The axis with the largest wavelet variance there.
    pub largest: Axis,
    /// The one with the smallest.
    pub smallest: Axis,
    /// The one over the other.
    pub ratio: f64,
}

/// Spread of replicates at one scale: standard deviations of ln nu of a replicate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct LevelSpread {
    /// Scale (s).
    pub tau_s: f64,
    /// Standard deviation by the law of the noise alone.
    pub within: f64,
    /// Standard deviation of the differences beyond that.
    pub between: f64,
}

/// Normal distribution, between recordings, of the logarithm of a parameter (for phi and beta, of
/// the correlation time).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ParameterSpread {
    /// The parameter.
    #[serde(skip)]
    pub of: ParameterRef,
    /// Its median (units of the parameter).
    pub median: f64,
    /// 95 % interval of that.
    pub median_ci95: [f64; 2],
    /// Standard deviation of the logarithm.
    pub sd: f64,
    /// 95 % interval of that.
    pub sd_ci95: [f64; 2],
}

/// The 95 % interval of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterInterval {
    /// The parameter.
    pub of: ParameterRef,
    /// Lower end (units of the parameter); NaN where the draws do not determine it.
    pub low: f64,
    /// Upper end (units of the parameter); NaN where the draws do not determine it.
    pub high: f64,
    /// Share of the draws in which its process has vanished: is zero, or has its correlation time at the end of what can be
    /// searched, where it is another process by name only.
    pub lost: f64,
    /// Reason that there is no interval, if there is none.
    pub absent: Option<Undetermined>,
}

/// Reason that a parameter has no interval.
#[derive(Debug, Clone, PartialEq)]
pub enum Undetermined {
    /// Its process is zero at the optimum.
    Zero,
    /// Its process vanishes in more of the draws than the quantile leaves out.
    Vanishes,
    /// The draws lie to one side of the estimate.
    OneSided,
    /// The interval of the correlation time ends beyond what can be searched.
    BeyondSearch,
    /// The draws leave the amplitude of its process open by more than a factor of 100: in some of them it all but vanishes.
    Open,
    /// These processes, which are alike, cannot be distinguished.
    Indistinct(Vec<usize>),
}

/// The test of over-identifying restrictions. Its statistic is the least Σ Omega_j (nu_j − nu_j(theta))²; what it
/// is when the model holds is known from the bootstrap, which repeats the whole estimation, so no weighting and
/// no trim makes the probability wrong, and the replicates' differences are allowed for.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Goodness {
    /// J, the objective.
    pub statistic: f64,
    /// Scales less free parameters of processes that are there.
    pub dof: usize,
    /// Median of J when the model holds.
    pub expected: f64,
    /// Probability of a J at least this large when the model holds: (1 + draws that have one) / (1 + draws).
    pub p_value: f64,
}

/// Probability below which the model is said not to describe the curve.
const LEVEL: f64 = 0.05;

impl Goodness {
    /// Returns true if the probability of a J this large under the model is below 5 %.
    pub fn is_rejected(&self) -> bool {
        self.p_value < LEVEL
    }
}

/// Processes of one kind that cannot be distinguished.
#[derive(Debug, Clone, PartialEq)]
pub struct IndistinctProcesses {
    /// Their positions in the model.
    pub processes: Vec<usize>,
    /// The model with one of them less, which describes the curve as well.
    pub spec: ModelSpec,
    /// Probability of so large a gain by the further process if the simpler model is true.
    pub p_value: f64,
    /// Intervals of the simpler model's parameters.
    pub intervals: Vec<ParameterInterval>,
}

// Choice of a model: the results.

/// A model that was tried.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelCandidate {
    /// The model.
    pub spec: ModelSpec,
    /// Σ Omega_j (nu_j − nu_j(theta))².
    pub objective: f64,
    /// 2 Σ Omega_j cov(nu_j, nu_j(theta)).
    pub optimism: f64,
    /// For a simpler one than the best that was tested against it: the probability of so large a difference of
    /// their objectives if it is true.
    pub p_value: Option<f64>,
    /// Probability of so large an objective if it is true, where that was asked: the J-test.
    pub j_p_value: Option<f64>,
}

impl ModelCandidate {
    /// Returns true if the model was tested and does not describe the curve.
    pub fn is_rejected(&self) -> bool {
        self.j_p_value.is_some_and(|p| p < LEVEL)
    }

    /// The criterion.
    pub fn wvic(&self) -> f64 {
        self.objective + self.optimism
    }
}

/// The candidates and the choice.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelRanking {
    /// The candidates, the least WVIC first.
    pub candidates: Vec<ModelCandidate>,
    /// Index of the chosen one.
    pub chosen: usize,
    /// The largest simpler model that does not do as well as the chosen one, and the probability of so large a difference of
    /// their objectives if it is true, at most.
    pub too_simple: Option<(ModelSpec, f64)>,
}

// Departure of a curve from the model that was fitted to it: where it matters, and where it is most certain.

/// Scales missed by more standard deviations than this are reported.
const MISSED: f64 = 4.0;
/// Scales off by more standard deviations than this are what speaks against a model whose scales are off together.
const DOUBTFUL: f64 = 2.0;
/// Standard deviation (relative) to which a wavelet variance must be known for its distance from the model to be reported.
const KNOWN: f64 = 0.1;

/// A curve at one level, against the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleMisfit {
    /// Level.
    pub level: u32,
    /// Wavelet variance of the data over that of the model.
    pub ratio: f64,
    /// The normal score of that ratio, a chi-square over its degrees of freedom where the model holds.
    pub deviations: f64,
    is_fitted: bool,
    /// True if the data are known to 10 % at this scale.
    is_known: bool,
}

/// Probability of the scores of all scales together below which a model is not said to fit, where no J-test was made.
const IMPOSSIBLE: f64 = 1e-4;

/// A curve against its model.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveDeparture {
    /// Scales that count in the fit.
    pub scales: usize,
    /// Scales at which the model is off by more than four standard deviations.
    pub missed: Vec<ScaleMisfit>,
    /// Scale with the ratio furthest from 1, among those known to 10 % (among all, if none is).
    pub furthest: Option<ScaleMisfit>,
    /// The longest of these scales, where there are longer ones.
    pub known_to: Option<u32>,
    /// The scale with the ratio furthest from 1 of all that are missed, those that count in no fit included, where the model
    /// does not fit: by single scales, by all together or by the J-test.
    pub misfit: Option<ScaleMisfit>,
}

impl CurveDeparture {
    fn of(all: &[ScaleMisfit], goodness: Option<Goodness>) -> Self {
        let beyond = |all: &[ScaleMisfit], deviations: f64| -> Vec<ScaleMisfit> {
            let is_beyond = |m: &&ScaleMisfit| m.deviations.abs() > deviations;
            all.iter().filter(is_beyond).copied().collect()
        };
        let fitted: Vec<ScaleMisfit> = all.iter().filter(|m| m.is_fitted).copied().collect();
        let known: Vec<ScaleMisfit> = fitted.iter().filter(|m| m.is_known).copied().collect();
        let missed = beyond(&fitted, MISSED);
        let doubtful = furthest(&beyond(&fitted, DOUBTFUL));
        let is_rejected = match goodness {
            Some(goodness) => goodness.is_rejected(),
            None => doubtful.is_some() && chance(&fitted) < IMPOSSIBLE,
        };
        let farthest = furthest(if known.is_empty() { &fitted } else { &known });
        let of_fit = furthest(&missed).or(doubtful);
        let worst = of_fit.or(furthest(&beyond(all, MISSED))).or(farthest);
        let known_to = known.last().map(|m| m.level);
        Self {
            scales: fitted.len(),
            furthest: farthest,
            known_to: known_to.filter(|level| fitted.last().is_some_and(|m| m.level != *level)),
            misfit: worst.filter(|_| is_rejected || !missed.is_empty()),
            missed,
        }
    }
}

/// Probability of scores at least as far off together, where the model holds: their squares as a chi-square of as many
/// degrees of freedom as scales. That parameters were fitted makes it larger, that neighbours hang together smaller.
fn chance(all: &[ScaleMisfit]) -> f64 {
    let squares: f64 = all.iter().map(|m| m.deviations * m.deviations).sum();
    ChiSquared::new(all.len().max(1) as f64).map_or(1.0, |law| law.sf(squares))
}

fn furthest(all: &[ScaleMisfit]) -> Option<ScaleMisfit> {
    // In the logarithm half is as far from 1 as twice.
    all.iter()
        .copied()
        .max_by(|a, b| a.ratio.ln().abs().total_cmp(&b.ratio.ln().abs()))
}

impl Outcome {
    /// The curve against the model.
    pub fn departure(&self) -> CurveDeparture {
        let curve = &self.curve;
        let implied = implied(&self.fit.composite, curve);
        let data = curve.wv.iter().zip(&curve.edof).zip(implied);
        // Var ln nu is 2/eta by a curve's own noise, and what recordings differ by beside it.
        let known_to = |edof: &f64| 1.0 / (1.0 / edof + 0.5 * curve.differing);
        let miss = |(level, ((nu, edof), implied)): (&u32, ((&f64, &f64), f64))| ScaleMisfit {
            level: *level,
            ratio: nu / implied,
            deviations: score(nu / implied, known_to(edof)),
            is_fitted: !curve.ignored.contains(level),
            is_known: (2.0 / edof).sqrt() <= KNOWN,
        };
        let all: Vec<ScaleMisfit> = curve.levels.iter().zip(data).map(miss).collect();
        CurveDeparture::of(&all, self.goodness())
    }

    /// Goodness of fit of the model, if it was tested.
    pub fn goodness(&self) -> Option<Goodness> {
        self.inference.as_ref().and_then(|i| i.goodness)
    }
}

#[cfg(test)]
mod departure_tests {
    use super::{CurveDeparture, ScaleMisfit, chance};
    use crate::fit::score;
    use crate::pipeline::fit_given;
    use crate::wavelet::Curve;
    use approx::assert_abs_diff_eq;
    use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

    /// Twelve scales that are off by one deviation each are what chance brings: P(chi-square of 12 > 12) = 0.4457 (tables). Off by
    /// three each, none is missed by itself, and together they are impossible. What is reported is of the scales that are known;
    /// what speaks against the model is the scale where it is worst.
    #[test]
    fn scales_are_judged_together_and_told_as_far_as_they_are_known() {
        let off = |deviations: f64| -> Vec<ScaleMisfit> {
            (1..=12)
                .map(|level| ScaleMisfit {
                    level,
                    ratio: 1.0 - 0.05 * f64::from(level),
                    deviations,
                    is_fitted: true,
                    is_known: level <= 8,
                })
                .collect()
        };
        let departure = |deviations| CurveDeparture::of(&off(deviations), None);
        let allowed = departure(-1.0);
        assert!(
            (chance(&off(-1.0)) - 0.4457).abs() < 5e-5 && allowed.misfit.is_none(),
            "{allowed:?}"
        );
        assert_eq!(
            (allowed.furthest.unwrap().level, allowed.known_to),
            (8, Some(8))
        );
        let impossible = departure(-3.0);
        assert!(
            impossible.missed.is_empty() && chance(&off(-3.0)) < 1e-15,
            "{impossible:?}"
        );
        assert_eq!(impossible.misfit.unwrap().level, 12);
        assert_eq!(CurveDeparture::of(&off(1.0)[..8], None).known_to, None);
    }

    /// White noise, exact but for a fifth more at one scale: missed where recordings are alike, not where they differ by as much.
    #[test]
    fn what_recordings_differ_by_is_no_miss() {
        let levels: Vec<u32> = (1..=12).collect();
        let wv = levels
            .iter()
            .map(|l| 0.5_f64.powi(*l as i32) * [1.0, 1.2][usize::from(*l == 5)]);
        let outcome = |differing: f64| {
            let curve = Curve {
                wv: wv.clone().collect(),
                edof: vec![1e6; 12],
                levels: levels.clone(),
                differing,
                ..Curve::default()
            };
            fit_given(curve, "WN", 100.0)
        };
        assert!(!outcome(0.0).departure().missed.is_empty());
        assert!(outcome(0.04).departure().missed.is_empty());
    }

    /// Against the exact law: the cube is good to a tenth of a deviation out to five of them, from ten degrees on.
    #[test]
    fn scores_are_those_of_the_chi_square() {
        let normal = Normal::new(0.0, 1.0).unwrap();
        for edof in [10.0, 32.0, 300.0] {
            let law = ChiSquared::new(edof).unwrap();
            for ratio in [0.2, 0.39, 0.7, 1.0, 1.5, 2.5] {
                let below = law.cdf(ratio * edof);
                let exact = if below < 0.5 {
                    normal.inverse_cdf(below)
                } else {
                    -normal.inverse_cdf(law.sf(ratio * edof))
                };
                if exact.abs() < 5.0 {
                    assert_abs_diff_eq!(score(ratio, edof), exact, epsilon = 0.1);
                }
            }
        }
    }
}
