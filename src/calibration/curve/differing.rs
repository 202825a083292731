//! Differences of replicates beyond their noise, one number for all scales: what limits the weight of scales that are known
//! far better than recordings agree.

use super::average::{Estimator, Replicate};
use super::robust_scale::{MAD_TO_DEVIATION, median};
use super::shape::variance_of_log;
use crate::wavelet::Tuning;
use crate::wavelet::interval::edof_robust;

/// Replicates from which on a scatter is told.
const LEAST: usize = 3;

/// Variance b² of ln nu between replicates: the mean over the scales of s²/(noise + b²) is 1, s² the variance from replicate
/// to replicate ([Paule and Mandel](crate::bibliography::PauleMandel82)), noise that of eta3. A single scale would tell b with
/// few degrees of freedom, and weights would follow chance.
pub(super) fn between(replicates: &[Replicate], estimator: Estimator, tuning: &Tuning) -> f64 {
    let at_level = |level: u32| {
        let index = level as usize - 1;
        let present: Vec<&Replicate> = replicates.iter().filter(|r| r.levels() > index).collect();
        (present.len() >= LEAST).then(|| {
            let logs: Vec<f64> = present
                .iter()
                .map(|r| r.value(estimator, index).ln())
                .collect();
            let noise = present
                .iter()
                .map(|r| variance_of_log(degrees(r, estimator, level, tuning)));
            (
                scatter(&logs, estimator),
                noise.sum::<f64>() / present.len() as f64,
            )
        })
    };
    let scales: Vec<(f64, f64)> = (1..)
        .map_while(at_level)
        .filter(|(scatter, _)| scatter.is_finite())
        .collect();
    let excess = |b2: f64| {
        scales
            .iter()
            .map(|(s2, noise)| s2 / (noise + b2) - 1.0)
            .sum::<f64>()
    };
    // At the largest scatter no term is above 0.
    falling_root(excess, scales.iter().map(|(s2, _)| *s2).fold(0.0, f64::max))
}

/// The root of a falling function between 0 and `high`, halved to rounding; 0 where it is not positive there.
pub(crate) fn falling_root(function: impl Fn(f64) -> f64, high: f64) -> f64 {
    let (mut low, mut high) = (0.0, high);
    if function(low) <= 0.0 {
        return 0.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if function(middle) > 0.0 {
            low = middle
        } else {
            high = middle
        }
    }
    low
}

fn degrees(replicate: &Replicate, estimator: Estimator, level: u32, tuning: &Tuning) -> f64 {
    let eta3 = replicate.edof_eta3(level);
    let is_robust = replicate.is_robust(estimator, level as usize - 1);
    if is_robust {
        edof_robust(eta3, tuning.efficiency())
    } else {
        eta3
    }
}

/// Variance of ln nu from replicate to replicate: for DR-AWV of those near the middle, as those that differ most are trimmed.
fn scatter(logs: &[f64], estimator: Estimator) -> f64 {
    if estimator == Estimator::DrAwv {
        let middle = median(logs);
        let distances: Vec<f64> = logs.iter().map(|x| (x - middle).abs()).collect();
        return (MAD_TO_DEVIATION * median(&distances)).powi(2);
    }
    let mean = logs.iter().sum::<f64>() / logs.len() as f64;
    logs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (logs.len() - 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Generator;
    use crate::wavelet::interval::edof_eta3;
    use crate::wavelet::{RobustVariance, Status};
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// 24 replicates whose variances differ by a common factor of deviation b, and by their noise √(2/eta3): b² is known to
    /// √(2/23) = 30 % of 24 (36 % of a median absolute deviation, four times within 2.5), and is far below b² where there is none.
    #[test]
    fn a_common_factor_is_found() {
        let tuning = Tuning::default();
        let mut generator = Generator::seed_from_u64(4);
        let mut normal = || generator.sample::<f64, _>(StandardNormal);
        let mut set = |b: f64| -> Vec<Replicate> {
            let replicate = |_| {
                let factor = (b * normal()).exp();
                let noise = |level| (2.0 / edof_eta3(1 << 16, level)).sqrt();
                let nu: Vec<f64> = (1..=10)
                    .map(|l| factor * (noise(l) * normal()).exp())
                    .collect();
                let robust = |value: &f64| RobustVariance {
                    value: *value,
                    status: Status::Ok,
                    zeros: 0.0,
                };
                Replicate {
                    name: String::new(),
                    axis: None,
                    samples: 1 << 16,
                    robust: nu.iter().map(robust).collect(),
                    classical: nu,
                    coverage: Vec::new(),
                    trend: f64::NAN,
                    mean: f64::NAN,
                }
            };
            (0..24).map(replicate).collect()
        };
        let (alike, different) = (set(0.0), set(0.1));
        for estimator in [Estimator::Awv, Estimator::DrAwv] {
            let found = between(&different, estimator, &tuning);
            assert!((0.004..0.025).contains(&found), "{estimator:?}: {found}");
            assert!(between(&alike, estimator, &tuning) < 0.001, "{estimator:?}");
        }
        assert_eq!(between(&different[..2], Estimator::Awv, &tuning), 0.0);
    }
}
