//! The estimators themselves: what they aim at, sets of replicates, accuracy, and what one outlier or one abnormal
//! replicate moves.

use nalgebra::{DMatrix, SymmetricEigen};
use nav_sim::calibration::{
    Estimator, Fit, ModelSpec, Replicate, Trim, Weighting, average, estimate, fit, median,
};
use nav_sim::signal::imu::Channel;
use nav_sim::signal::noise::contamination::{Contamination, Operation};
use nav_sim::signal::noise::{
    Composite, Model, Parameter, ParameterDistribution, ParameterError, ParameterRef, Process,
    ProcessKind, Spread, Synthesizer, Variation,
};
use nav_sim::signal::rng::StreamKey;
use nav_sim::signal::wavelet::{Curve, RootStatus, Tuning, classical_and_robust, interval};
use rand::{Rng, RngExt};
use std::error::Error;

/// Why a study cannot be done.
type Failure = Box<dyn Error + Send + Sync>;

// One set of replicates: drawn, contaminated in several ways, estimated from.
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
    /// As [`Failure`]; whether there is one does not depend on the set, unless a parameter that varies is scaled: it may
    /// leave its domain in some of them.
    pub fn set(&self, set: u64) -> Result<Vec<Estimate>, Failure> {
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

    /// Whether the contaminations can be applied and the model has something to scale, before anything is
    /// drawn.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn check(&self) -> Result<(), Failure> {
        let mut nothing = vec![0.0; self.samples];
        for scenario in &self.scenarios {
            for replicate in 1..=self.replicates {
                let (channel, rate_hz) = (self.channel, self.model.rate_hz);
                // The model's own values stand for those drawn: a scaled parameter that leaves its domain
                // only for some draw is found when it is drawn.
                scenario.scale(&mut self.model.axis(channel).clone(), channel, replicate)?;
                scenario.apply(&mut nothing, channel, replicate, rate_hz, 0)?;
            }
        }
        Ok(())
    }

    /// Names of the fitted model's parameters: "AR1 phi", …
    #[must_use]
    pub fn parameters(composite: &nav_sim::signal::noise::Composite) -> Vec<String> {
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
    pub fn values(composite: &nav_sim::signal::noise::Composite) -> Vec<f64> {
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
    fn replicate(&self, set: u64, replicate: u64) -> Result<Vec<Replicate>, Failure> {
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
    pub fn drawn(&self, set: u64, replicate: u64) -> Model {
        let seed = self.seed_of(set);
        self.spread.draw(&self.model, seed, replicate - 1)
    }

    /// The samples of one replicate (counted from 1) of a given model.
    pub fn synthesized(&self, set: u64, replicate: u64, model: &Model) -> Vec<f64> {
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
    ) -> Result<Vec<f64>, Failure> {
        let mut model = self.drawn(set, replicate);
        let rate_hz = model.rate_hz;
        how.scale(
            &mut model.axes[self.channel.index()],
            self.channel,
            replicate,
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
    pub fn measure(&self, samples: &[f64]) -> Result<Replicate, Failure> {
        let (classical, robust) = classical_and_robust(samples, self.levels, &self.tuning)?;
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
    pub fn estimate_all(&self, replicates: &[Replicate]) -> Result<Vec<Estimate>, Failure> {
        self.estimators
            .iter()
            .map(|e| self.estimate(replicates, *e))
            .collect()
    }

    fn estimate(
        &self,
        replicates: &[Replicate],
        estimator: Estimator,
    ) -> Result<Estimate, Failure> {
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
        let without_root = robust.filter(|v| v.status == RootStatus::NoRoot).count();
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

// The target of the estimators when parameters vary between replicates
// (Minaretzis et al. 2024, eqs. 2 and 3): the model nearest to the *expected*
// wavelet variance, which is not the model of the expected parameters.
/// The target of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// nu_0 = E\[nu(theta_i)\], with the degrees of freedom of K replicates.
    pub curve: Curve,
    /// theta_0: the fit to it.
    pub fit: Fit,
}

/// theta_0 of a design: nu_0 by quadrature over the laws of the parameters, fitted as the estimators fit.
///
/// theta_0 depends on the weights Omega_j = eta_j/(2 nu_0j²) as far as nu_0 is no curve of the model. They
/// are those of the classical estimator; those of the robust ones are proportional to them, but for the
/// last scales, where degrees of freedom stop at 1. Nothing here is contaminated, and nothing is sampled.
///
/// # Errors
/// When the laws do not belong to the model, or the levels are too few for it.
pub fn target(design: &Design) -> Result<Target, Failure> {
    let axis = design.channel.index();
    let (noise, laws) = (&design.model.axes[axis], &design.spread.axes[axis]);
    let rate_hz = design.model.rate_hz;
    // The degrees of freedom of the average of K independent curves of one length.
    let edof = |j| design.replicates as f64 * interval::edof_eta3(design.samples, j);
    let levels: Vec<u32> = (1..=design.levels).collect();
    let curve = Curve {
        wv: expected_wv(noise, laws, design.levels)?,
        edof: levels.iter().map(|j| edof(*j)).collect(),
        levels,
        ..Curve::default()
    };
    let fit = fit(&curve, &design.spec, rate_hz, design.weighting)?;
    Ok(Target { curve, fit })
}

/// E\[nu_j\] at levels 1, 2, … when the parameters of `noise` follow `laws`, independently.
///
/// # Errors
/// When a law does not belong to this noise.
pub fn expected_wv(
    noise: &Composite,
    laws: &[Variation],
    levels: u32,
) -> Result<Vec<f64>, ParameterError> {
    let mut expected = vec![0.0; levels as usize];
    for (at, process) in noise.processes.iter().enumerate() {
        let own = laws.iter().filter(|l| l.of.process == at);
        for (process, weight) in weighted(process, own)? {
            for (nu, level) in expected.iter_mut().zip(1..) {
                // nu is a sum over the processes, and so is its expectation: laws of different processes need
                // no common quadrature.
                *nu += weight * process.haar_wv(level);
            }
        }
    }
    Ok(expected)
}

/// The processes, with weights of sum 1, that stand for one whose parameters follow laws.
fn weighted<'a>(
    process: &Process,
    laws: impl Iterator<Item = &'a Variation>,
) -> Result<Vec<(Process, f64)>, ParameterError> {
    let mut all = vec![(Composite::new(vec![*process]), 1.0)];
    for law in laws {
        let of = ParameterRef {
            process: 0,
            ..law.of
        };
        let nodes = nodes(law.law, all[0].0.value(of), of.parameter);
        let mut next = Vec::with_capacity(all.len() * nodes.len());
        for (noise, weight) in &all {
            for (value, node) in &nodes {
                let mut noise = noise.clone();
                noise.set(of, *value)?;
                next.push((noise, weight * node));
            }
        }
        all = next;
    }
    let processes = all
        .into_iter()
        .map(|(noise, weight)| (noise.processes[0], weight));
    Ok(processes.collect())
}

// Expectations under the laws of parameters.
/// Number of nodes by which a law is replaced: exact for polynomials of degree 95 under a beta law.
const NODES: usize = 48;
/// A normal law is cut off so many standard deviations from its centre: 1e-19 of it lies beyond.
const CUT: f64 = 9.0;

/// Values and weights (of sum 1) that stand for the law of a parameter about `centre` (the model's value).
pub fn nodes(law: ParameterDistribution, centre: f64, parameter: Parameter) -> Vec<(f64, f64)> {
    match law {
        ParameterDistribution::Beta { a, b, low, width } => {
            beta(a, b).map(|(x, w)| (low + width * x, w)).collect()
        }
        ParameterDistribution::Normal { sd } if sd > 0.0 => normal(centre, sd, parameter.domain()),
        ParameterDistribution::Normal { .. } => vec![(centre, 1.0)],
        ParameterDistribution::Lognormal { median, sd, .. } if sd > 0.0 => {
            let scaled = normal(
                parameter.scaled(median),
                sd,
                (f64::NEG_INFINITY, f64::INFINITY),
            );
            scaled
                .into_iter()
                .map(|(x, w)| (parameter.unscaled(x), w))
                .collect()
        }
        ParameterDistribution::Lognormal { median, .. } => vec![(median, 1.0)],
    }
}

/// A truncated normal law by Gauss-Legendre quadrature of its density.
fn normal(centre: f64, sd: f64, (low, high): (f64, f64)) -> Vec<(f64, f64)> {
    let (low, high) = (low.max(centre - CUT * sd), high.min(centre + CUT * sd));
    let density = |x: f64| (-0.5 * ((x - centre) / sd).powi(2)).exp();
    // Legendre's weight is Jacobi's with alpha = beta = 0.
    let raw = beta(1.0, 1.0).map(|(u, w)| (low + (high - low) * u, w));
    let raw: Vec<_> = raw.map(|(x, w)| (x, w * density(x))).collect();
    let total: f64 = raw.iter().map(|(_, w)| w).sum();
    // Truncation takes some of the law away: what is left is made a law again.
    raw.into_iter().map(|(x, w)| (x, w / total)).collect()
}

/// Gauss-Jacobi quadrature for B ~ Beta(a, b): the eigenvalues of the Jacobi matrix, and the squares of the
/// first components of its eigenvectors (Golub and Welsch).
fn beta(a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> {
    // Jacobi's weight on (−1, 1) is (1 − x)^alpha (1 + x)^beta, and u = (1 + x)/2 has the density
    // u^(a−1) (1 − u)^(b−1): alpha goes with b.
    let (alpha, beta) = (b - 1.0, a - 1.0);
    let sum = alpha + beta;
    let diagonal = |k: usize| {
        let s = 2.0 * k as f64 + sum;
        match k {
            // The general forms are 0/0 here for alpha + beta = 0 and, below, −1: the common factor is
            // cancelled.
            0 => (beta - alpha) / (sum + 2.0),
            _ => (beta * beta - alpha * alpha) / (s * (s + 2.0)),
        }
    };
    let squared = |k: usize| {
        let (k, s) = (k as f64, 2.0 * k as f64 + sum);
        match k {
            1.0 => 4.0 * (1.0 + alpha) * (1.0 + beta) / ((sum + 2.0).powi(2) * (sum + 3.0)),
            _ => 4.0 * k * (k + alpha) * (k + beta) * (k + sum) / (s * s * (s + 1.0) * (s - 1.0)),
        }
    };
    let matrix = DMatrix::from_fn(NODES, NODES, |i, j| match i.abs_diff(j) {
        0 => diagonal(i),
        1 => squared(i.max(j)).sqrt(),
        _ => 0.0,
    });
    let eigen = SymmetricEigen::new(matrix);
    // The law has mass 1, so the squared components are the weights as they are.
    (0..NODES).map(move |i| {
        (
            0.5 * (1.0 + eigen.eigenvalues[i]),
            eigen.eigenvectors[(0, i)].powi(2),
        )
    })
}

// Accuracy of estimates: bias, spread and RMSE about the target over many sets.
/// 1 / normal quantile of ¾: the median absolute deviation of Gaussian numbers times this is their standard deviation.
pub const MAD_TO_DEVIATION: f64 = 1.482_602_218_505_602;

/// Resamples of the bootstrap: a standard error is then known to 1/√(2·1000) = 2 %.
const RESAMPLES: usize = 1000;

/// Errors of one estimator in one parameter, relative to the target.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Accuracy {
    /// Median of the relative errors.
    pub bias: f64,
    /// Standard error of the bias over draws of the sets.
    pub bias_se: f64,
    /// 1.4826·MAD of the relative errors.
    pub spread: f64,
    /// √(bias² + spread²) (Minaretzis et al. 2024, eq. 15).
    pub rmse: f64,
    /// Standard error of the RMSE.
    pub rmse_se: f64,
    /// The RMSE of each resample of the sets; the n-th of every estimator is of the same sets.
    #[serde(skip)]
    resampled: Vec<f64>,
}

impl Accuracy {
    /// The ratio of this RMSE to another's on the same sets, and its standard error.
    #[must_use]
    pub fn ratio_to(&self, other: &Self) -> (f64, f64) {
        let ratios: Vec<f64> = self
            .resampled
            .iter()
            .zip(&other.resampled)
            .map(|(a, b)| a / b)
            .collect();
        // The deviation of the ratios themselves: the errors of two estimators on one set are correlated, and
        // most of that cancels.
        let error = if self.rmse_se.is_nan() {
            f64::NAN
        } else {
            standard_deviation(&ratios)
        };
        (self.rmse / other.rmse, error)
    }
}

/// The accuracy of estimates of a parameter whose target is `target`; NaN without estimates.
///
/// Monte-Carlo errors are standard deviations over a bootstrap of the sets. The same seed and number of
/// sets resample the same sets, so that comparisons of estimators are paired.
#[must_use]
pub fn accuracy(estimates: &[f64], target: f64, seed: u64) -> Accuracy {
    let errors: Vec<f64> = estimates.iter().map(|e| (e - target) / target).collect();
    let (bias, spread) = centre_and_spread(&mut errors.clone());
    let key = StreamKey {
        seed,
        scenario: "accuracy",
        run: 0,
        source: "bootstrap",
        process: "",
    };
    let mut generator = key.generator();
    let mut resample = vec![0.0; errors.len()];
    let mut draw = || {
        // The key has no estimator in it: the n-th resample is of the same sets for all of them, and their
        // ratio is paired.
        resample.fill_with(|| errors[generator.random_range(0..errors.len())]);
        centre_and_spread(&mut resample)
    };
    let resampled: Vec<(f64, f64)> = (0..RESAMPLES).map(|_| draw()).collect();
    let biases: Vec<f64> = resampled.iter().map(|(bias, _)| *bias).collect();
    let rmses: Vec<f64> = resampled
        .iter()
        .map(|(bias, spread)| bias.hypot(*spread))
        .collect();
    // A single set says nothing of how sets differ.
    let error = |x: &[f64]| {
        if estimates.len() > 1 {
            standard_deviation(x)
        } else {
            f64::NAN
        }
    };
    Accuracy {
        bias,
        spread,
        rmse: bias.hypot(spread),
        bias_se: error(&biases),
        rmse_se: error(&rmses),
        resampled: rmses,
    }
}

/// Median and 1.4826·MAD; the order of the numbers is lost.
fn centre_and_spread(x: &mut [f64]) -> (f64, f64) {
    let centre = median(x);
    x.iter_mut().for_each(|v| *v = (*v - centre).abs());
    (centre, MAD_TO_DEVIATION * median(x))
}

pub fn standard_deviation(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    (x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
}

// Sensitivity curves: how far an estimate moves when one thing goes wrong, against how wrong it goes.
//
// Proposition 1 of Minaretzis et al. 2024 says that the influence on SR-AWV of
// outliers, and on DR-AWV of abnormal replicates too, is bounded. It holds for a fixed number of scales and
// long records. A single sample takes part in 2^j of the T − 2^j + 1 coefficients of level j: with the usual
// floor(log2 T) − 1 levels that is more at the last ones than the robust wavelet variance withstands
// (26 % at an efficiency of 0.6), whose values there are unbounded in one outlier. What keeps the
// parameters of SR-AWV bounded all the same are the weights of the fit, which fall with the square of the
// wavelet variance; DR-AWV drops the values themselves.
/// Effect of a disturbance of one size.
#[derive(Debug, Clone, PartialEq)]
pub struct Movement {
    /// The size: of an outlier in standard deviations of the signal's white part, or the factor of an
    /// abnormal variance.
    pub size: f64,
    /// For each estimator of the design, the relative change of each parameter.
    pub changes: Vec<Vec<f64>>,
}

/// Adds one outlier of each of the sizes (multiples of `unit`, m/s² or rad/s) to the sample in the middle of
/// the first replicate of set 0, clean otherwise.
///
/// # Errors
/// As [`Failure`].
pub fn outlier_curve(design: &Design, unit: f64, sizes: &[f64]) -> Result<Vec<Movement>, Failure> {
    // Set 0 is one realisation: a sensitivity curve is of a sample, the influence function of its limit.
    let mut samples = design.synthesized(0, 1, &design.drawn(0, 1));
    let middle = samples.len() / 2;
    let clean = samples[middle];
    curve(design, &[1], sizes, |_, size| {
        samples[middle] = clean + size * unit;
        design.measure(&samples)
    })
}

/// Multiplies the random-walk variance of the last `count` replicates of set 0, clean otherwise, by each of
/// the factors.
///
/// # Errors
/// As [`Failure`]; when the model has no random walk.
pub fn abnormal_curve(
    design: &Design,
    count: u64,
    factors: &[f64],
) -> Result<Vec<Movement>, Failure> {
    let abnormal: Vec<u64> =
        (1 + design.replicates.saturating_sub(count)..=design.replicates).collect();
    curve(design, &abnormal, factors, |replicate, factor| {
        let mut model = design.drawn(0, replicate);
        let processes = &mut model.axes[design.channel.index()].processes;
        let mut walks = processes
            .iter_mut()
            .filter(|p| p.kind() == ProcessKind::RandomWalk);
        let walk = walks.next();
        let walk = walk.ok_or("no random walk whose variance could be made abnormal")?;
        *walk = walk.times(factor)?;
        design.measure(&design.synthesized(0, replicate, &model))
    })
}

/// The movements when the replicates listed (counted from 1) are replaced by what `disturbed` makes of them.
fn curve(
    design: &Design,
    touched: &[u64],
    sizes: &[f64],
    mut disturbed: impl FnMut(u64, f64) -> Result<Replicate, Failure>,
) -> Result<Vec<Movement>, Failure> {
    let clean = |r| design.measure(&design.synthesized(0, r, &design.drawn(0, r)));
    let mut replicates = (1..=design.replicates)
        .map(clean)
        .collect::<Result<Vec<_>, _>>()?;
    let reference = design.estimate_all(&replicates)?;
    let mut changes_at = |size: &f64| {
        // Overwritten at every size, so each starts from the clean ones and not from the size before.
        for replicate in touched {
            replicates[*replicate as usize - 1] = disturbed(*replicate, *size)?;
        }
        let moved = design.estimate_all(&replicates)?;
        let changes = moved
            .iter()
            .zip(&reference)
            .map(|(m, r)| relative(m, r))
            .collect();
        Ok(Movement {
            size: *size,
            changes,
        })
    };
    sizes.iter().map(&mut changes_at).collect()
}

fn relative(moved: &Estimate, reference: &Estimate) -> Vec<f64> {
    moved
        .theta
        .iter()
        .zip(&reference.theta)
        .map(|(m, r)| (m - r) / r)
        .collect()
}
