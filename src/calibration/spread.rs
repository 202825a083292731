//! How replicates of one noise differ: between them, beyond what each of them scatters.
//!
//! Their ln nu scatter as their variance from replicate to replicate shows. Of that the part `within` follows from the
//! model and the length ([`SamplingLaw`]); `between` is what is there in excess, if anything (moments of a
//! random-effects model, level by level: ln nu_ij = centre_j + between_ij + within_ij).

use super::average::{Estimator, Replicate};
use super::robust_scale::{deviation, median};
use super::sampling::{SamplingLaw, chi_square_ratio};
use crate::rng::Generator;
use crate::wavelet::interval::edof_robust;
use rand::RngExt;
use rand_distr::StandardNormal;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Quantile 0.975 of the normal law.
const NORMAL_975: f64 = 1.959_963_984_540_054;
/// Residuals further than this many deviations count as this many in DR-AWV.
const CLIP: f64 = 3.0;

/// The spread of replicates around an estimator's curve.
#[derive(Debug, Clone)]
pub(super) struct Spread {
    /// Standard deviation of ln nu of a replicate of the same noise, of each level.
    pub(super) within: Vec<f64>,
    /// Standard deviation of what replicates differ by beyond that.
    pub(super) between: Vec<f64>,
    /// Degrees of freedom of each replicate at each level.
    pub(super) edof: Vec<Vec<f64>>,
    /// Standard deviation of ln nu of each replicate at each level, as the replicates show it: that of the replicates,
    /// more for the shorter and less for the longer of them.
    total: Vec<Vec<f64>>,
    /// Residuals of each replicate over their standard deviation, so that Σ over replicates of their squares
    /// is K − 1: their combinations with normal weights over √(K − 1) have unit variance and the replicates'
    /// correlations between levels.
    units: Vec<Vec<f64>>,
    /// Degrees of freedom with which the variances are known.
    freedom: f64,
}

impl Spread {
    pub(super) fn new(
        replicates: &[Replicate],
        estimator: Estimator,
        law: &SamplingLaw,
        efficiency: f64,
    ) -> Self {
        let levels = law.correlation.nrows();
        let edof: Vec<Vec<f64>> = replicates.iter().map(|r| edof(r, estimator, law, efficiency)).collect();
        let count = replicates.len() as f64;
        let within: Vec<f64> = (0..levels)
            .map(|j| (edof.iter().map(|e| variance_of_log(e[j])).sum::<f64>() / count).sqrt())
            .collect();
        let mut units = vec![vec![0.0; levels]; replicates.len()];
        let mut total = vec![vec![0.0; levels]; replicates.len()];
        let mut between = vec![0.0; levels];
        for j in 0..levels {
            let logs: Vec<f64> = replicates.iter().map(|r| r.value(estimator, j).ln()).collect();
            let (residuals, deviation) = residuals(&logs, estimator);
            between[j] = (deviation * deviation - within[j] * within[j]).max(0.0).sqrt();
            let own = |e: &Vec<f64>| (variance_of_log(e[j]) + between[j] * between[j]).sqrt();
            let usual = within[j].hypot(between[j]);
            for (i, residual) in residuals.into_iter().enumerate() {
                units[i][j] = residual;
                total[i][j] = deviation * own(&edof[i]) / usual;
            }
        }
        let freedom = (share_of_freedom(estimator) * (count - 1.0)).max(1.0);
        Self { within, between, edof, total, units, freedom }
    }

    /// Draws nu*/nu of as many new replicates as there are, `[replicate][level]`: with the variances of ln nu that the
    /// replicates show, and their correlations between levels.
    pub(super) fn draw(&self, generator: &mut Generator) -> Vec<Vec<f64>> {
        let of_replicate = |total: &Vec<f64>| {
            let scores = self.scores(generator);
            let ratio = |(score, total): (f64, &f64)| chi_square_ratio(score, edof_of_log(total * total));
            scores.into_iter().zip(total).map(ratio).collect()
        };
        self.total.iter().map(of_replicate).collect()
    }

    /// What makes an interval of normal quantiles one of Student's, for the few replicates that the variances are
    /// known from: the ratio of the quantiles 0.975.
    pub(super) fn student(&self) -> f64 {
        let student = StudentsT::new(0.0, 1.0, self.freedom).map_or(NORMAL_975, |law| law.inverse_cdf(0.975));
        student / NORMAL_975
    }

    /// Draws what ln nu of as many new replicates as there are differ by, beyond the scatter of each.
    pub(super) fn draw_between(&self, generator: &mut Generator) -> Vec<Vec<f64>> {
        let of_replicate = |_| self.scores(generator).iter().zip(&self.between).map(|(z, b)| z * b).collect();
        (0..self.units.len()).map(of_replicate).collect()
    }

    /// Normal numbers with the replicates' correlations between levels.
    fn scores(&self, generator: &mut Generator) -> Vec<f64> {
        let freedom = (self.units.len() as f64 - 1.0).max(1.0);
        let mut scores = vec![0.0; self.between.len()];
        for unit in &self.units {
            let weight = generator.sample::<f64, _>(StandardNormal) / freedom.sqrt();
            scores.iter_mut().zip(unit).for_each(|(score, u)| *score += weight * u);
        }
        scores
    }
}

/// The degrees of freedom of a chi-square whose logarithm has this variance: psi1(x) ≈ 1/x + 1/2x² at x = eta/2.
fn edof_of_log(variance: f64) -> f64 {
    (1.0 + (1.0 + 2.0 * variance).sqrt()) / variance
}

fn edof(replicate: &Replicate, estimator: Estimator, law: &SamplingLaw, efficiency: f64) -> Vec<f64> {
    let reduce = |e: f64| if estimator.is_robust() { edof_robust(e, efficiency) } else { e };
    law.edof(replicate.samples).into_iter().map(reduce).collect()
}

/// Variance of ln(chi²/eta): the trigamma function at eta/2, by its asymptotic series.
pub(super) fn variance_of_log(edof: f64) -> f64 {
    // psi1(x) = 1/x² + psi1(x + 1), then the series, whose error is under 1e-6 from x = 4.
    let (mut x, mut sum) = (0.5 * edof, 0.0);
    while x < 4.0 {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    sum + 1.0 / x + 0.5 * y + y / x * (1.0 / 6.0 - y * (1.0 / 30.0 - y / 42.0))
}

/// The degrees of freedom of a variance over those of the plain one, K − 1. That of K Gaussian numbers of which the
/// distant are clipped scatters as a chi-square of 0.87 (K − 1) degrees does (Satterthwaite's rule; 0.78 to 0.96 for K =
/// 5 … 24).
const fn share_of_freedom(estimator: Estimator) -> f64 {
    if matches!(estimator, Estimator::DrAwv) { 0.87 } else { 1.0 }
}

/// What makes the mean of the clipped variance of K Gaussian numbers their variance: 1.075 for K = 8.
fn small_sample(count: usize) -> f64 {
    1.0 + 0.6 / count as f64
}

/// Residuals over their standard deviation, and that: plain, or for DR-AWV clipped at [`CLIP`] deviations (by the MAD)
/// from the median.
fn residuals(logs: &[f64], estimator: Estimator) -> (Vec<f64>, f64) {
    let freedom = logs.len() as f64 - 1.0;
    if freedom < 1.0 {
        return (vec![0.0; logs.len()], 0.0);
    }
    let mut kept = logs.to_vec();
    let mut correction = 1.0;
    if estimator == Estimator::DrAwv {
        let (centre, scale) = (median(logs), deviation(logs));
        kept.iter_mut().for_each(|x| *x = x.clamp(centre - CLIP * scale, centre + CLIP * scale));
        correction = small_sample(logs.len());
    }
    let mean = kept.iter().sum::<f64>() / logs.len() as f64;
    let mut units: Vec<f64> = kept.iter().map(|x| x - mean).collect();
    let deviation = (units.iter().map(|x| x * x).sum::<f64>() / freedom).sqrt();
    if deviation > 0.0 {
        units.iter_mut().for_each(|x| *x /= deviation);
    }
    (units, deviation * correction.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// psi1(½) = π²/2, psi1(1) = π²/6, psi1(2) = π²/6 − 1.
    #[test]
    fn variance_of_the_logarithm() {
        let pi2 = std::f64::consts::PI.powi(2);
        assert_relative_eq!(variance_of_log(1.0), pi2 / 2.0, max_relative = 1e-6);
        assert_relative_eq!(variance_of_log(2.0), pi2 / 6.0, max_relative = 1e-6);
        assert_relative_eq!(variance_of_log(4.0), pi2 / 6.0 - 1.0, max_relative = 1e-5);
    }

    #[test]
    fn one_abnormal_value_moves_the_plain_residuals_and_hardly_the_clipped() {
        let mut logs = vec![-0.1, 0.0, 0.1, 0.05, -0.05, 0.02];
        let clean = residuals(&logs, Estimator::DrAwv).1;
        logs[2] = 10.0;
        assert!(residuals(&logs, Estimator::SrAwv).1 > 3.0);
        assert!(residuals(&logs, Estimator::DrAwv).1 < 3.0 * clean);
        let (units, _) = residuals(&logs, Estimator::SrAwv);
        assert_relative_eq!(units.iter().map(|u| u * u).sum::<f64>(), 5.0, max_relative = 1e-12);
    }

    /// 4000 draws of K Gaussian numbers: the mean of the clipped variance, corrected, is the variance (its standard
    /// error is √(2/ν/4000) = 0.5 to 1.2 %, four of which and the 2 % by which the rule is off are allowed), and it scatters
    /// as 0.87 (K − 1) degrees of freedom say to 15 % (that of a variance from 4000 is known to √(2/4000) = 2.2 %, the rule
    /// is off by 0.09).
    #[test]
    fn a_clipped_variance_scatters_as_said() {
        use rand::SeedableRng;
        let mut generator = Generator::seed_from_u64(2);
        for count in [5, 6, 8, 12, 24] {
            let variance = |generator: &mut Generator| {
                let x: Vec<f64> = (0..count).map(|_| generator.sample(StandardNormal)).collect();
                residuals(&x, Estimator::DrAwv).1.powi(2)
            };
            let drawn: Vec<f64> = (0..4000).map(|_| variance(&mut generator)).collect();
            let mean = drawn.iter().sum::<f64>() / 4000.0;
            let scatter = drawn.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 3999.0;
            assert!((mean - 1.0).abs() < 4.0 * 0.012 + 0.02, "{count}: {mean}");
            let freedom = 2.0 * mean * mean / scatter / (count as f64 - 1.0);
            assert!((freedom / 0.87 - 1.0).abs() < 0.15, "{count}: {freedom}");
        }
    }
}
