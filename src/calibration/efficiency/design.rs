//! One set of replicates: drawn, contaminated in several ways, estimated from.

use crate::imu::Channel;
use crate::noise::contamination::{Contamination, Operation, RefusedRule};
use crate::noise::{Model, Spread, SpreadError, Synthesizer};
use crate::rng::StreamKey;
use crate::wavelet::{Status, Tuning, WaveletError, both, default_levels};
use crate::{
    AverageError, Estimator, FitError, ModelSpec, Replicate, Trim, Weighting, average, estimate,
};
use rand::Rng;

/// A study of estimators: what is drawn, what is done to it, how it is estimated from.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Seed of everything.
    pub seed: u64,
    /// The model whose axis is studied.
    pub model: Model,
    /// Variation of its parameters between replicates.
    pub spread: Spread,
    /// The axis.
    pub channel: Channel,
    /// Replicates in a set, K.
    pub replicates: u64,
    /// Samples of a replicate, T.
    pub samples: usize,
    /// Levels of the wavelet variance, J.
    pub levels: u32,
    /// Contaminations of the replicates, one for each scenario.
    pub scenarios: Vec<Contamination>,
    /// The estimators compared: averages over replicates, and AVLR of the classical average.
    pub estimators: Vec<Estimator>,
    /// The model that is fitted.
    pub spec: ModelSpec,
    /// Replicates that DR-AWV drops.
    pub trim: Trim,
    /// Tuning of the robust wavelet variance.
    pub tuning: Tuning,
    /// Weights of the scales in the fit.
    pub weighting: Weighting,
}

/// Why a study cannot be done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// The laws are no laws of the model.
    #[error(transparent)]
    Spread(#[from] SpreadError),
    /// A contamination cannot be applied.
    #[error(transparent)]
    Contamination(#[from] RefusedRule),
    /// The replicates are too short for the levels.
    #[error(transparent)]
    Wavelet(#[from] WaveletError),
    /// The trim leaves no replicate.
    #[error(transparent)]
    Average(#[from] AverageError),
    /// The levels are too few for the model.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// There is no abnormal replicate to be made.
    #[error("{channel} has no random walk whose variance could be made abnormal")]
    NoRandomWalk {
        /// The axis.
        channel: Channel,
    },
}

/// Estimate by one estimator from one set in one scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The parameters of the fitted model, in its order.
    pub theta: Vec<f64>,
    /// The fit's objective.
    pub objective: f64,
    /// Robust wavelet variances without an admissible root among the K·J (0 for a classical estimator).
    pub without_root: usize,
}

impl Design {
    /// Estimates from one set (counted from 0): scenario by scenario, in each estimator by estimator.
    ///
    /// The clean replicates of a set are the same in all scenarios, and where scenarios treat a replicate
    /// alike its wavelet variances are taken once. A set depends on its number and the seed only.
    ///
    /// # Errors
    /// As [`StudyError`]; whether there is one does not depend on the set, unless a parameter that varies is scaled: it may
    /// leave its domain in some of them.
    pub fn set(&self, set: u64) -> Result<Vec<Estimate>, StudyError> {
        let mut scenarios = vec![Vec::new(); self.scenarios.len()];
        for replicate in 1..=self.replicates {
            for (into, measured) in scenarios.iter_mut().zip(self.replicate(set, replicate)?) {
                into.push(measured);
            }
        }
        let estimate = |replicates: &Vec<Replicate>| self.estimate_all(replicates);
        let estimates = scenarios
            .iter()
            .map(estimate)
            .collect::<Result<Vec<_>, _>>()?;
        Ok(estimates.into_iter().flatten().collect())
    }

    /// The same study of replicates of another length, with the usual number of levels.
    #[must_use]
    pub fn with_samples(self, samples: usize) -> Self {
        Self {
            samples,
            levels: default_levels(samples),
            ..self
        }
    }

    /// Whether the contaminations can be applied and the model has something to scale, before anything is
    /// drawn.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn check(&self) -> Result<(), StudyError> {
        let mut nothing = vec![0.0; self.samples];
        for scenario in &self.scenarios {
            for replicate in 1..=self.replicates {
                let (channel, rate_hz) = (self.channel, self.model.rate_hz);
                // The model's own values stand for those drawn: a scaled parameter that leaves its domain
                // only for some draw is found when it is drawn.
                scenario.scale(
                    &mut self.model.axis(channel).clone(),
                    channel,
                    replicate,
                    rate_hz,
                )?;
                scenario.apply(&mut nothing, channel, replicate, rate_hz, 0)?;
            }
        }
        Ok(())
    }

    /// Names of the fitted model's parameters: "AR1 phi", …
    #[must_use]
    pub fn parameters(composite: &crate::noise::Composite) -> Vec<String> {
        let labelled = composite.processes.iter().zip(composite.labels());
        labelled
            .flat_map(|(p, l)| {
                p.parameters()
                    .into_iter()
                    .map(move |(n, _)| format!("{l} {n}"))
            })
            .collect()
    }

    /// Values of the same.
    #[must_use]
    pub fn values(composite: &crate::noise::Composite) -> Vec<f64> {
        composite
            .processes
            .iter()
            .flat_map(|p| p.parameters().into_iter().map(|(_, v)| v))
            .collect()
    }

    /// A set is an experiment with a seed of its own.
    fn seed_of(&self, set: u64) -> u64 {
        let key = StreamKey {
            seed: self.seed,
            scenario: "efficiency",
            run: set,
            source: "set",
            process: "seed",
        };
        // A seed of its own: the streams within a set are then keyed as those of any other experiment.
        key.generator().next_u64()
    }

    /// The wavelet variances of one replicate (counted from 1) in every scenario.
    fn replicate(&self, set: u64, replicate: u64) -> Result<Vec<Replicate>, StudyError> {
        let operations: Vec<Vec<&Operation>> = self
            .scenarios
            .iter()
            .map(|s| s.operations_for(self.channel, replicate))
            .collect();
        let mut measured: Vec<Replicate> = Vec::with_capacity(operations.len());
        for (i, own) in operations.iter().enumerate() {
            let same = operations[..i].iter().position(|earlier| earlier == own);
            measured.push(match same {
                Some(same) => measured[same].clone(),
                None => self.measure(&self.contaminated(set, replicate, &self.scenarios[i])?)?,
            });
        }
        Ok(measured)
    }

    /// The model of one replicate (counted from 1), as drawn.
    pub(super) fn drawn(&self, set: u64, replicate: u64) -> Result<Model, StudyError> {
        Ok(self
            .spread
            .draw(&self.model, self.seed_of(set), replicate - 1)?)
    }

    /// The samples of one replicate (counted from 1) of a given model.
    pub(super) fn synthesized(&self, set: u64, replicate: u64, model: &Model) -> Vec<f64> {
        let (seed, source) = (self.seed_of(set), self.channel.to_string());
        let key = StreamKey {
            seed,
            scenario: "",
            run: replicate - 1,
            source: &source,
            process: "",
        };
        let mut samples = vec![0.0; self.samples];
        Synthesizer::new(model.axis(self.channel), key).fill(&mut samples);
        samples
    }

    fn contaminated(
        &self,
        set: u64,
        replicate: u64,
        how: &Contamination,
    ) -> Result<Vec<f64>, StudyError> {
        let mut model = self.drawn(set, replicate)?;
        let rate_hz = model.rate_hz;
        how.scale(
            &mut model.axes[self.channel.index()],
            self.channel,
            replicate,
            rate_hz,
        )?;
        let mut samples = self.synthesized(set, replicate, &model);
        how.apply(
            &mut samples,
            self.channel,
            replicate,
            rate_hz,
            self.seed_of(set),
        )?;
        Ok(samples)
    }

    /// The wavelet variances of one signal.
    pub(super) fn measure(&self, samples: &[f64]) -> Result<Replicate, StudyError> {
        let (classical, robust) = both(samples, self.levels, &self.tuning)?;
        let (name, axis) = (String::new(), Some(self.channel.axis));
        Ok(Replicate {
            name,
            axis,
            samples: samples.len(),
            classical,
            robust,
            coverage: Vec::new(),
            trend: f64::NAN,
            mean: f64::NAN,
        })
    }

    /// Estimates from replicates, one for each estimator.
    pub(super) fn estimate_all(
        &self,
        replicates: &[Replicate],
    ) -> Result<Vec<Estimate>, StudyError> {
        self.estimators
            .iter()
            .map(|e| self.estimate(replicates, *e))
            .collect()
    }

    fn estimate(
        &self,
        replicates: &[Replicate],
        estimator: Estimator,
    ) -> Result<Estimate, StudyError> {
        // The slopes of several replicates are those of their average.
        let averaged = if estimator == Estimator::Avlr {
            Estimator::Awv
        } else {
            estimator
        };
        let curve = average(replicates, averaged, self.trim, &self.tuning)?;
        let fit = estimate(
            estimator,
            &curve,
            &self.spec,
            self.model.rate_hz,
            self.weighting,
        )?;
        let robust = replicates.iter().flat_map(|r| &r.robust);
        let without_root = robust.filter(|v| v.status == Status::NoRoot).count();
        Ok(Estimate {
            theta: Self::values(&fit.composite),
            objective: fit.objective,
            without_root: if estimator.is_robust() {
                without_root
            } else {
                0
            },
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::imu::{Axis, Sensor};
    use crate::noise::contamination::{Extent, Rule};
    use crate::noise::{Composite, Law, Process, Variation};
    use crate::wavelet::Convention;

    pub(in crate::efficiency) const RATE: f64 = 100.0;

    /// WN + AR1 + RW whose parts lead at different scales of 2^12 samples and more; five replicates.
    pub(in crate::efficiency) fn design(samples: usize) -> Design {
        let process =
            |code, values: &[f64]| Process::from_values(code, values, RATE).unwrap().unwrap();
        let noise = Composite::new(vec![
            process("WN", &[1.0]),
            process("AR1", &[0.97, 0.01]),
            process("RW", &[1e-5]),
        ]);
        let law = Law::Beta {
            a: 2.0,
            b: 2.0,
            low: 0.9,
            width: 0.2,
        };
        let laws = vec![Variation::new(&noise, RATE, "WN", "sigma2", law).unwrap()];
        Design {
            seed: 5,
            model: Model::pooled(RATE, &noise, &noise),
            spread: Spread {
                axes: [laws, vec![], vec![], vec![], vec![], vec![]],
            },
            channel: Channel {
                sensor: Sensor::Accel,
                axis: Axis::X,
            },
            replicates: 5,
            samples,
            levels: samples.ilog2() - 1,
            scenarios: Vec::new(),
            estimators: vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
            spec: ModelSpec::n1(),
            trim: Trim::Count(1),
            tuning: Tuning::new(0.6, Convention::Exact).unwrap(),
            weighting: Weighting::Edof,
        }
    }

    fn rule(replicate: Option<u64>, operation: Operation) -> Rule {
        Rule {
            sensor: Sensor::Accel,
            replicate,
            operation,
            place: String::new(),
        }
    }

    fn scenario(rules: Vec<Rule>) -> Contamination {
        Contamination {
            name: String::new(),
            rules,
        }
    }

    fn three() -> Vec<Contamination> {
        let replace = Operation::Replace {
            points: Extent::Samples(20),
            block: Extent::Samples(1),
            mean: None,
            sigma: 30.0,
        };
        let (process, parameter) = ("RW".to_owned(), "gamma2".to_owned());
        let scale = Operation::Scale {
            process,
            parameter,
            factor: 100.0,
        };
        let second = vec![rule(None, replace)];
        let third = [second.clone(), vec![rule(Some(4), scale)]].concat();
        vec![scenario(Vec::new()), scenario(second), scenario(third)]
    }

    /// Sharing of wavelet variances between scenarios changes nothing: each scenario alone gives the same.
    #[test]
    fn a_scenario_does_not_depend_on_its_company() {
        let together = Design {
            scenarios: three(),
            ..design(4096)
        }
        .set(2)
        .unwrap();
        assert_eq!(together.len(), 9);
        for (i, one) in three().into_iter().enumerate() {
            let alone = Design {
                scenarios: vec![one],
                ..design(4096)
            }
            .set(2)
            .unwrap();
            assert_eq!(alone, together[3 * i..3 * i + 3]);
        }
    }

    #[test]
    fn sets_repeat_and_differ() {
        let design = Design {
            scenarios: three(),
            ..design(4096)
        };
        let (first, second) = (design.set(0).unwrap(), design.set(1).unwrap());
        assert_eq!(first, design.set(0).unwrap());
        assert!(first.iter().zip(&second).all(|(a, b)| a.theta != b.theta));
        let other = Design { seed: 6, ..design };
        assert_ne!(first[0].theta, other.set(0).unwrap()[0].theta);
    }

    /// 20 outliers of 30 sigma among 16384 samples multiply the variance of the first scale by about
    /// 1 + 20·900/16384 = 2.1: AWV's white noise follows, that of the robust estimators does not. One
    /// replicate of five with a random walk of 100 times the variance raises the mean variance to 20.8
    /// times, which SR-AWV follows and DR-AWV does not.
    #[test]
    fn each_layer_of_robustness_does_what_it_is_for() {
        let design = Design {
            scenarios: three(),
            ..design(1 << 14)
        };
        let names = Design::parameters(&crate::efficiency::target(&design).unwrap().fit.composite);
        assert_eq!(names, ["WN sigma2", "AR1 phi", "AR1 sigma2", "RW gamma2"]);
        let estimates = design.set(0).unwrap();
        let theta = |scenario: usize, estimator: usize, p: usize| {
            estimates[3 * scenario + estimator].theta[p]
        };
        assert!(theta(1, 0, 0) > 1.5, "AWV: {}", theta(1, 0, 0));
        for robust in [1, 2] {
            assert!((theta(1, robust, 0) / theta(0, robust, 0) - 1.0).abs() < 0.1);
        }
        assert!(
            theta(2, 1, 3) > 5.0 * theta(1, 1, 3),
            "SR-AWV: {} {}",
            theta(2, 1, 3),
            theta(1, 1, 3)
        );
        assert!(
            theta(2, 2, 3) < 3.0 * theta(1, 2, 3),
            "DR-AWV: {} {}",
            theta(2, 2, 3),
            theta(1, 2, 3)
        );
    }

    /// A step of 2 in the middle of every replicate, some five standard deviations of the random walk by then: at the last
    /// scales the curve is several times too high. The weights of the model protect as those of the literature do; weights
    /// that grow with the model as it follows the step (edof/(2 nu(theta)²) alone) gave 2.6 times the error. Paired sets: a ratio
    /// of medians of 24 is known to some 10 %, so that 1.2 is two standard deviations.
    #[test]
    fn a_step_draws_the_random_walk_no_further_than_with_weights_of_the_literature() {
        let step = Operation::Step {
            at: Extent::Samples(1 << 13),
            amplitude: 2.0,
        };
        let scenarios = vec![scenario(vec![rule(None, step)])];
        let error = |weighting: Weighting, estimator: usize| {
            let design = Design {
                weighting,
                scenarios: scenarios.clone(),
                ..design(1 << 14)
            };
            let gamma2 = |set| design.set(set).unwrap()[estimator].theta[3];
            let errors: Vec<f64> = (0..24)
                .map(|set| (gamma2(set) / 1e-5 - 1.0).abs())
                .collect();
            crate::curve::median(&errors)
        };
        for estimator in [1, 2] {
            let (model, edof) = (
                error(Weighting::Model, estimator),
                error(Weighting::Edof, estimator),
            );
            assert!(model < 1.2 * edof, "{estimator}: {model} {edof}");
        }
    }
}
