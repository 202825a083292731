//! Least squares: theta = argmin Σ Omega_j (nu_j − nu_j(theta))².

use super::assemble::assemble;
use super::objective::{Component, Objective, Range};
use super::optimise::Termination;
use super::result::{Fit, FitError};
use super::search::{Effort, search};
use super::weighting::{Weighting, inverse_deviations};
use crate::curve::implied;
use crate::model::ModelSpec;
use crate::noise::Kind;
use crate::wavelet::Curve;

/// Fits a model to a curve. The rate (Hz) is what a GM is sampled at.
///
/// AR1 and GM processes are sought with correlation times between a sixth of a sample (phi = e^−6) and twenty times the
/// longest scale; phi is positive. A fit that ends there is told ([`Fit::at_end`]).
///
/// # Errors
/// When the curve has fewer scales than the model parameters, or numbers that are no wavelet variances.
pub fn fit(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
) -> Result<Fit, FitError> {
    let observed = Weights {
        weighting,
        nu: curve.wv.clone(),
    };
    // The observed variances are the only ones there are before a model; what is low by chance weighs too
    // much in this round.
    let first = fit_near(curve, spec, rate_hz, observed, Effort::WHOLE, &[])?;
    match weighting {
        Weighting::Model => settled(curve, spec, rate_hz, first),
        Weighting::Edof => Ok(first),
    }
}

/// Largest number of repeated fits until the weights are those of the model itself.
const MOST_ROUNDS: usize = 20;
/// The same of a curve that resembles one already fitted, whose model is where the weights begin.
const FEW_ROUNDS: usize = 3;
/// Relative change of the implied curve below which no further fit is made.
const SETTLED: f64 = 1e-6;

/// The curve that a fit implies, where it may be divided by.
fn expected(curve: &Curve, fit: &Fit) -> Vec<f64> {
    // A model without any amplitude implies nothing.
    implied(&fit.composite, curve)
        .iter()
        .zip(&curve.wv)
        .map(|(nu, wv)| nu.max(1e-6 * wv))
        .collect()
}

/// Fits with the weights of the last result until they are those of the result itself.
fn settled(curve: &Curve, spec: &ModelSpec, rate_hz: f64, first: Fit) -> Result<Fit, FitError> {
    let (mut visited, last) = reweighted(curve, spec, rate_hz, first, MOST_ROUNDS, Effort::WHOLE)?;
    if is_settled(curve, &last) {
        return Ok(last.at_own_weights(curve));
    }
    // The weights of each of two minima lead the search to the other: both are followed within their own basin, and the one
    // that is nearer to the curve by its own weights is taken.
    visited.push(last);
    let recent = visited.into_iter().rev().take(2);
    let within = recent.map(|fit| {
        reweighted(
            curve,
            spec,
            rate_hz,
            fit.within_its_basin(),
            MOST_ROUNDS,
            Effort::WITHIN,
        )
        .map(|(_, fit)| fit)
    });
    let ended = within
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .map(|fit| {
            let termination = if is_settled(curve, &fit) {
                fit.termination
            } else {
                Termination::IterationLimit
            };
            Fit {
                termination,
                ..fit.at_own_weights(curve)
            }
        });
    Ok(ended
        .min_by(|a, b| a.objective.total_cmp(&b.objective))
        .expect("two fits"))
}

/// Whether the weights of a fit are those of its own result.
fn is_settled(curve: &Curve, fit: &Fit) -> bool {
    let nu = expected(curve, fit);
    nu.iter()
        .zip(&fit.weighted_for)
        .all(|(a, b)| (a / b - 1.0).abs() < SETTLED)
}

/// Fits with the weights of the last result; those before the last, and the last.
fn reweighted(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    first: Fit,
    rounds: usize,
    effort: Effort,
) -> Result<(Vec<Fit>, Fit), FitError> {
    let (mut before, mut last) = (Vec::new(), first);
    while before.len() < rounds && !is_settled(curve, &last) {
        let weights = Weights {
            weighting: Weighting::Model,
            nu: expected(curve, &last),
        };
        let next = fit_near(curve, spec, rate_hz, weights, effort, &last.minima)?;
        before.push(std::mem::replace(&mut last, next));
    }
    Ok((before, last))
}

impl Fit {
    /// The same with its own minimum as the only one known.
    fn within_its_basin(mut self) -> Self {
        self.minima.truncate(1);
        self
    }

    /// The same with its objective and residuals in standard deviations of the curve where the model holds: in the weights of
    /// the fit a scale far above the model counts little, and a model would be the less rejected the more it misses.
    fn at_own_weights(self, curve: &Curve) -> Self {
        let nu = expected(curve, &self);
        let pairs = inverse_deviations(curve, &nu)
            .into_iter()
            .zip(curve.wv.iter().zip(&nu));
        let residuals: Vec<f64> = pairs.map(|(root, (wv, nu))| root * (wv - nu)).collect();
        let objective = residuals.iter().map(|r| r * r).sum();
        // Of other minima what is known is how far they are behind by the weights of the fit.
        let behind = |other: f64| objective * (other / self.objective).max(1.0);
        let runner_up = self
            .runner_up
            .map(behind)
            .filter(|other: &f64| other.is_finite());
        Self {
            objective,
            residuals,
            runner_up,
            ..self
        }
    }
}

/// The same for a curve that resembles one already fitted: a coarser grid, and the minima of that one.
pub(crate) fn refit(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weighting: Weighting,
    like: &Fit,
) -> Result<Fit, FitError> {
    // The model of the curve that this one resembles is known better than one draw knows itself.
    let nu = match weighting {
        Weighting::Model => expected(curve, like),
        Weighting::Edof => curve.wv.clone(),
    };
    let weights = Weights { weighting, nu };
    let first = fit_near(curve, spec, rate_hz, weights, Effort::AGAIN, &like.minima)?;
    match weighting {
        Weighting::Model => {
            // The weights change little: the basin of the first round is that of the others.
            let (_, last) = reweighted(
                curve,
                spec,
                rate_hz,
                first.within_its_basin(),
                FEW_ROUNDS,
                Effort::WITHIN,
            )?;
            Ok(last.at_own_weights(curve))
        }
        Weighting::Edof => Ok(first),
    }
}

/// Weights of the scales of a curve.
struct Weights {
    weighting: Weighting,
    /// Wavelet variances at which the weights are evaluated (units²).
    nu: Vec<f64>,
}

fn fit_near(
    curve: &Curve,
    spec: &ModelSpec,
    rate_hz: f64,
    weights: Weights,
    effort: Effort,
    known: &[Vec<f64>],
) -> Result<Fit, FitError> {
    check(curve, spec)?;
    let components = spec
        .kinds()
        .iter()
        .map(|kind| component(*kind, curve))
        .collect();
    let Weights { weighting, nu } = weights;
    let objective = Objective::new(curve, weighting, &nu, components);
    let found = search(&objective, effort, known);
    Ok(Fit {
        weighted_for: nu,
        ..assemble(&objective, &found, rate_hz)?
    })
}

fn check(curve: &Curve, spec: &ModelSpec) -> Result<(), FitError> {
    let bad = |values: &[f64], (low, high): (f64, f64)| {
        values.iter().position(|v| !(*v >= low && *v <= high))
    };
    if let Some(i) = bad(&curve.wv, Curve::WV_RANGE) {
        return Err(FitError::NotPositive {
            level: curve.levels[i],
            value: curve.wv[i],
        });
    }
    if let Some(i) = bad(&curve.edof, Curve::EDOF_RANGE) {
        return Err(FitError::NoWeight {
            level: curve.levels[i],
            value: curve.edof[i],
        });
    }
    let (parameters, scales) = (spec.parameters(), curve.levels.len() - curve.ignored.len());
    if scales < parameters {
        return Err(FitError::TooFewScales {
            spec: spec.to_string(),
            parameters,
            scales,
        });
    }
    Ok(())
}

/// Correlation times that are sought, in longest scales and in samples: beyond these ends the wavelet variance of an AR1
/// is that of a random walk to 2 % (at the longest scale), and of white noise to 0.8 % (the first scale against the others).
const LONGEST: f64 = 20.0;
const SHORTEST: f64 = 1.0 / 6.0;

/// ln κ of the correlation times that are sought, 1/κ in samples.
pub(crate) fn correlated(curve: &Curve) -> Range {
    let longest = f64::from(curve.levels.iter().copied().max().unwrap_or(1)).exp2();
    Range {
        low: -(LONGEST * longest).ln(),
        high: -SHORTEST.ln(),
    }
}

/// A process with the widest range in which a curve can say anything of its shape.
fn component(kind: Kind, curve: &Curve) -> Component {
    let coordinate = match kind {
        // Correlation times in logarithms: equal steps of ln κ change the curve about equally.
        Kind::Ar1 | Kind::GaussMarkov => Some(correlated(curve)),
        Kind::Ma1 => Some(Range {
            low: -1.0,
            high: 1.0,
        }),
        _ => None,
    };
    Component { kind, coordinate }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Ar1, Composite, Process, Quantization, RandomWalk, White};
    use crate::rng::Generator;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    #[test]
    fn what_is_no_wavelet_variance_is_refused() {
        let refused = |wv: f64, edof: f64| {
            let curve = Curve {
                wv: vec![1.0, wv, 0.25],
                edof: vec![50.0, edof, 50.0],
                levels: vec![1, 2, 3],
                ..Curve::default()
            };
            fit(&curve, &"WN".parse().unwrap(), 1.0, Weighting::Edof).unwrap_err()
        };
        for value in [-1.0, 0.0, 1e101] {
            assert_eq!(
                refused(value, 50.0),
                FitError::NotPositive { level: 2, value }
            );
            assert_eq!(refused(0.5, value), FitError::NoWeight { level: 2, value });
        }
    }

    /// An AR1 that has to stand for a random walk takes the longest correlation time that is sought, 20 times 2^12 samples, and
    /// is told to lie at the end; what is not there is told to be zero, and lies nowhere.
    #[test]
    fn a_process_at_the_end_of_its_range_is_told() {
        let white = Process::White(White::new(1.0).unwrap());
        let walk = Process::RandomWalk(RandomWalk::new(1e-4).unwrap());
        let levels: Vec<u32> = (1..=12).collect();
        let fitted = |processes: Vec<Process>| {
            let model = Composite::new(processes);
            let wv = levels.iter().map(|level| model.haar_wv(*level)).collect();
            let curve = Curve {
                wv,
                edof: vec![50.0; 12],
                levels: levels.clone(),
                ..Curve::default()
            };
            fit(&curve, &"WN+AR1".parse().unwrap(), 1.0, Weighting::Edof).unwrap()
        };
        let wandering = fitted(vec![white, walk]);
        let Process::Ar1(ar1) = wandering.composite.processes[1] else {
            panic!("{:?}", wandering.composite)
        };
        assert!(
            (-ar1.phi().ln() * 20.0 * 4096.0 - 1.0).abs() < 1e-6,
            "{ar1:?}"
        );
        assert_eq!((wandering.at_end, wandering.zero), (vec![1], vec![]));
        let still = fitted(vec![white]);
        assert_eq!((still.at_end, still.zero), (vec![], vec![1]));
    }

    /// N2 with 8 to 30 % of noise at every scale, a third of it unknown to the degrees of freedom: on some of these curves the
    /// weights of one minimum lead to another and back. What is called converged has the weights of its own result.
    #[test]
    fn a_fit_is_called_converged_where_its_weights_are_its_own() {
        let model = Composite::new(vec![
            Process::White(White::new(1.0).unwrap()),
            Process::Quantization(Quantization::new(0.5).unwrap()),
            Process::Ar1(Ar1::new(0.9, 1e-3).unwrap()),
            Process::Ar1(Ar1::new(0.999, 1e-5).unwrap()),
            Process::RandomWalk(RandomWalk::new(1e-8).unwrap()),
        ]);
        let levels: Vec<u32> = (1..=14).collect();
        let mut generator = Generator::seed_from_u64(29);
        let mut unsettled = 0;
        for k in 0..30 {
            let noise = 0.08 + 0.22 * f64::from(k % 3) / 2.0;
            let off = |_| (noise * generator.sample::<f64, _>(StandardNormal)).exp();
            let wv = levels
                .iter()
                .map(|l| model.haar_wv(*l))
                .zip(levels.iter().map(off))
                .map(|(nu, off)| nu * off);
            let curve = Curve {
                wv: wv.collect(),
                edof: vec![3.0 / (noise * noise); levels.len()],
                levels: levels.clone(),
                ..Curve::default()
            };
            let fit = fit(&curve, &ModelSpec::n2(), 1.0, Weighting::Model).unwrap();
            let is_converged = fit.termination == Termination::Converged;
            unsettled += u32::from(!is_converged);
            assert_eq!(is_converged, is_settled(&curve, &fit), "curve {k}");
            let phi = |process: &Process| {
                if let Process::Ar1(p) = process {
                    Some(p.phi())
                } else {
                    None
                }
            };
            assert!(
                fit.composite.processes.iter().filter_map(phi).is_sorted(),
                "curve {k}"
            );
            // the best agrees with itself; another minimum is behind it
            assert!(
                (1..=fit.starts).contains(&fit.agreeing),
                "curve {k}: {} of {}",
                fit.agreeing,
                fit.starts
            );
            assert!(
                fit.runner_up.is_none_or(|other| other > fit.objective),
                "curve {k}: {:?}",
                fit.runner_up
            );
        }
        // Most can be followed within the basin of either minimum.
        assert!(unsettled <= 3, "{unsettled}");
    }
}
