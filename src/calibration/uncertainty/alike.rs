//! Whether replicates differ beyond their noise: a test with a level.
//!
//! At each scale the mean square of the residuals of ln nu, each over the deviation that noise alone gives it; of all
//! scales together the largest. What that is for replicates of one noise is drawn from the large-sample law of the fitted
//! model ([`SamplingLaw`]), the correlations between scales included, so that looking at many scales costs nothing.
//! Axes that are pooled may differ from one another in every recording alike: recordings are compared axis by axis.

use super::spread::{Spread, mean_square};
use crate::curve::sampling::SamplingLaw;
use crate::curve::shape::Shape;
use crate::curve::{Estimator, Replicate};
use crate::imu::Axis;
use crate::outcome::{LevelSpread, Outcome};
use crate::rng::StreamKey;
use rayon::prelude::*;

/// Probability with which replicates of one noise are said to differ.
pub const LEVEL: f64 = 0.025;
/// Sets drawn: a probability of 2.5 % is known to 0.7 %.
const DRAWS: usize = 499;
/// Seed of the draws: a test is an answer, the same each time.
const SEED: u64 = 1;
/// A scale with fewer degrees of freedom in a replicate is left out: a robust variance of so few coefficients does not
/// follow the large-sample law.
const LEAST: f64 = 4.0;

/// Probability that replicates of one noise differ at some scale as much as these do; none of a single one.
pub(crate) fn p_value(
    replicates: &[Replicate],
    estimator: Estimator,
    spread: &Spread,
    law: &SamplingLaw,
    group: &str,
) -> Option<f64> {
    let scales: Vec<Scale> = law
        .shapes
        .iter()
        .enumerate()
        .map_while(|(j, shape)| Scale::new(j, replicates, spread, shape))
        .collect();
    if scales.is_empty() {
        return None;
    }
    let largest = |nu: &dyn Fn(usize, usize) -> f64| {
        let squares = scales
            .iter()
            .enumerate()
            .map(|(j, scale)| scale.mean_square(&|i| nu(i, j), estimator));
        squares
            .filter(|square| square.is_finite())
            .fold(0.0, f64::max)
    };
    let observed = largest(&|i, j| replicates[i].value(estimator, j));
    let draw = |run: usize| {
        let process = estimator.name();
        let key = StreamKey {
            seed: SEED,
            scenario: "alike",
            run: run as u64,
            source: group,
            process,
        };
        let mut generator = key.generator();
        let ratios: Vec<Vec<f64>> = spread
            .edof
            .iter()
            .map(|e| law.draw(e, &mut generator))
            .collect();
        largest(&|i, j| ratios[i][j])
    };
    let larger = (0..DRAWS)
        .into_par_iter()
        .filter(|run| draw(*run) >= observed)
        .count();
    // The observed set counts as one of the draws, all exchangeable if the fitted law holds: p is never 0,
    // and the level is kept (Davison and Hinkley 1997, chapter 4).
    Some((1 + larger) as f64 / (1 + DRAWS) as f64)
}

impl Outcome {
    /// Probability of such differences of the replicates and the scale where they are largest, where they differ beyond their noise.
    #[must_use]
    pub fn differing(&self) -> Option<(f64, LevelSpread)> {
        let inference = self.inference.as_ref()?;
        let p_value = inference.alike.filter(|p| *p <= LEVEL)?;
        // Relative to the noise: at the last scales recordings scatter most for lack of coefficients, which is no difference.
        let ratio = |s: &LevelSpread| s.between / s.within;
        let most = inference
            .spread
            .iter()
            .max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
        Some((p_value, *most))
    }
}

/// The replicates that are compared at one scale.
struct Scale {
    /// Which replicates, and the axis of each.
    members: Vec<(usize, Option<Axis>)>,
    /// Variance of ln nu of each by its noise.
    noise: Vec<f64>,
}

impl Scale {
    /// Those that are long enough for the level of index `j`; none where no axis is there twice: each axis alone in its
    /// recording is compared with nothing.
    fn new(j: usize, replicates: &[Replicate], spread: &Spread, shape: &Shape) -> Option<Self> {
        let is_long_enough = |i: &usize| replicates[*i].levels() > j && spread.edof[*i][j] >= LEAST;
        let members: Vec<(usize, Option<Axis>)> = (0..replicates.len())
            .filter(is_long_enough)
            .map(|i| (i, replicates[i].axis))
            .collect();
        let is_repeated = |(k, (_, axis)): (usize, &(usize, Option<Axis>))| {
            members[..k].iter().any(|(_, a)| a == axis)
        };
        let noise = members
            .iter()
            .map(|(i, _)| shape.variance_of_log(spread.edof[*i][j]))
            .collect();
        members
            .iter()
            .enumerate()
            .any(is_repeated)
            .then_some(Self { members, noise })
    }

    /// Mean square of the residuals of ln nu less the mean of its axis: of drawn values in the same way as of observed ones,
    /// so that the degrees of freedom of the means are allowed for.
    fn mean_square(&self, nu: &dyn Fn(usize) -> f64, estimator: Estimator) -> f64 {
        let logs: Vec<f64> = self.members.iter().map(|(i, _)| nu(*i).ln()).collect();
        let mean = |axis: &Option<Axis>| {
            let of_axis = || {
                self.members
                    .iter()
                    .zip(&logs)
                    .filter(|((_, other), _)| other == axis)
            };
            of_axis().map(|(_, log)| log).sum::<f64>() / of_axis().count() as f64
        };
        let residuals: Vec<f64> = self
            .members
            .iter()
            .zip(&logs)
            .map(|((_, axis), log)| log - mean(axis))
            .collect();
        mean_square(&residuals, &self.noise, estimator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Composite, Process, RandomWalk, White};
    use crate::wavelet::{Convention, Tuning, both};
    use rand::RngExt;
    use rand_distr::StandardNormal;

    const SAMPLES: usize = 2048;
    const GAMMA2: f64 = 1e-4;

    fn tuning() -> Tuning {
        Tuning::new(0.6, Convention::Exact).unwrap()
    }

    /// Signals of white noise and random walk, their white noise of standard deviation e^(spread/2 · N(0, 1)).
    fn set(seed: u64, count: usize, spread: f64) -> Vec<Replicate> {
        let tuning = tuning();
        let recording = |run: usize| {
            let key = StreamKey {
                seed,
                scenario: "",
                run: run as u64,
                source: "",
                process: "",
            };
            let mut generator = key.generator();
            let mut normal = || generator.sample::<f64, _>(StandardNormal);
            let sigma = (0.5 * spread * normal()).exp();
            let mut walk = 0.0;
            let signal: Vec<f64> = (0..SAMPLES)
                .map(|_| {
                    walk += GAMMA2.sqrt() * normal();
                    walk + sigma * normal()
                })
                .collect();
            let (classical, robust) = both(&signal, 10, &tuning).unwrap();
            Replicate {
                name: format!("run{run}"),
                axis: None,
                samples: SAMPLES,
                classical,
                robust,
                coverage: Vec::new(),
                trend: f64::NAN,
                mean: f64::NAN,
            }
        };
        (0..count).map(recording).collect()
    }

    /// Sets, of so many, that are said to differ.
    fn told(sets: u64, count: usize, spread: f64, estimator: Estimator) -> u32 {
        let white = Process::White(White::new(1.0).unwrap());
        let walk = Process::RandomWalk(RandomWalk::new(GAMMA2).unwrap());
        let law = SamplingLaw::new(&Composite::new(vec![white, walk]), 10);
        let differs = |seed: u64| {
            let replicates = set(seed, count, spread);
            let own = Spread::new(&replicates, estimator, &law, &tuning());
            u32::from(p_value(&replicates, estimator, &own, &law, "accel").unwrap() <= LEVEL)
        };
        (0..sets).into_par_iter().map(differs).sum()
    }

    /// The level is 2.5 %: of 200 sets of alike replicates 5 ± 2.2, so no more than 13 (four deviations). A spread of 20 % in
    /// sigma2, of which noise makes 4.4 % at the first scale (1024 degrees of freedom or fewer), is told in nearly all.
    #[test]
    fn alike_replicates_are_said_to_differ_as_rarely_as_promised() {
        for (count, estimator) in [
            (2, Estimator::Awv),
            (3, Estimator::Awv),
            (8, Estimator::Awv),
            (3, Estimator::SrAwv),
            (8, Estimator::DrAwv),
        ] {
            let told_wrongly = told(200, count, 0.0, estimator);
            assert!(
                told_wrongly <= 13,
                "{count} {}: {told_wrongly} of 200",
                estimator.name()
            );
        }
        assert!(told(20, 8, 0.2, Estimator::Awv) >= 19 && told(20, 8, 0.2, Estimator::DrAwv) >= 18);
    }

    /// Four recordings of three axes, of which the last has 1.7 times the variance in each of them: of 40 sets 1 ± 1 is said to
    /// differ, so no more than 5.
    #[test]
    fn axes_that_differ_are_not_recordings_that_differ() {
        let white = Process::White(White::new(1.0).unwrap());
        let walk = Process::RandomWalk(RandomWalk::new(GAMMA2).unwrap());
        let law = SamplingLaw::new(&Composite::new(vec![white, walk]), 10);
        let differs = |seed: u64| {
            let of_axis = |axis: Axis| {
                let variance = if axis == Axis::Z { 1.7 } else { 1.0 };
                set(3 * seed + axis as u64, 4, 0.0)
                    .into_iter()
                    .map(move |replicate| Replicate {
                        axis: Some(axis),
                        classical: replicate.classical.iter().map(|nu| variance * nu).collect(),
                        ..replicate
                    })
            };
            let replicates: Vec<Replicate> = Axis::ALL.into_iter().flat_map(of_axis).collect();
            let own = Spread::new(&replicates, Estimator::Awv, &law, &tuning());
            u32::from(p_value(&replicates, Estimator::Awv, &own, &law, "accel").unwrap() <= LEVEL)
        };
        let told: u32 = (0..40).into_par_iter().map(differs).sum();
        assert!(told <= 5, "{told} of 40");
    }

    #[test]
    fn one_signal_cannot_differ() {
        let law = SamplingLaw::new(
            &Composite::new(vec![Process::White(White::new(1.0).unwrap())]),
            10,
        );
        let one = set(1, 1, 0.0);
        let own = Spread::new(&one, Estimator::Awv, &law, &tuning());
        assert_eq!(p_value(&one, Estimator::Awv, &own, &law, "accel"), None);
    }
}
