//! How replicates of one noise differ: between them, beyond what each of them scatters.
//!
//! A random-effects model of ln nu, level by level: ln nu_ij = centre_j + between_ij + within_ij. The
//! variance of `within` follows from the model and the length ([`SamplingLaw`]); that of `between` is what
//! the replicates' variance has in excess, if anything (moments).

use super::average::{Estimator, Replicate};
use super::robust_scale::{deviation, median};
use super::sampling::SamplingLaw;
use crate::rng::Generator;
use crate::wavelet::interval::edof_robust;
use rand::RngExt;
use rand_distr::{ChiSquared, StandardNormal};

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
    /// Residuals of each replicate over their standard deviation, so that Σ over replicates of their squares
    /// is K − 1: their combinations with normal weights over √(K − 1) have unit variance and the replicates'
    /// correlations between levels.
    units: Vec<Vec<f64>>,
    /// Degrees of freedom with which `between` is known.
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
        let between = (0..levels)
            .map(|j| {
                let logs: Vec<f64> = replicates.iter().map(|r| r.value(estimator, j).ln()).collect();
                let (residuals, total) = residuals(&logs, estimator);
                for (unit, residual) in units.iter_mut().zip(residuals) {
                    unit[j] = residual;
                }
                (total * total - within[j] * within[j]).max(0.0).sqrt()
            })
            .collect();
        let freedom = (share_of_freedom(estimator) * (count - 1.0)).max(1.0);
        Self { within, between, edof, units, freedom }
    }

    /// Draws the differences of ln nu of as many new replicates as there are, `[replicate][level]`; on demand with
    /// the heavier tails that the few replicates they are known from call for (which have no variance for three
    /// replicates or fewer).
    pub(super) fn draw_between(&self, heavy_tails: bool, generator: &mut Generator) -> Vec<Vec<f64>> {
        let count = self.units.len();
        let levels = self.between.len();
        // The degrees of freedom are at least 1.
        let chi2 = ChiSquared::new(self.freedom).map_or(self.freedom, |law| generator.sample(law));
        let tail = if heavy_tails { (self.freedom / chi2.max(1e-3)).sqrt() } else { 1.0 };
        let freedom = (count as f64 - 1.0).max(1.0);
        let mut draw = |_| {
            let mut difference = vec![0.0; levels];
            for unit in &self.units {
                let weight = generator.sample::<f64, _>(StandardNormal) / freedom.sqrt();
                difference.iter_mut().zip(unit).for_each(|(d, u)| *d += weight * u);
            }
            difference.iter().zip(&self.between).map(|(d, b)| d * b * tail).collect()
        };
        (0..count).map(&mut draw).collect()
    }
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

/// The degrees of freedom of a variance over those of the plain one, K − 1. The square of a MAD of K Gaussian numbers
/// scatters as a chi-square of 0.4 (K − 1) degrees does (Satterthwaite's rule; 0.54 to 0.37 for K = 4 … 30).
const fn share_of_freedom(estimator: Estimator) -> f64 {
    if matches!(estimator, Estimator::DrAwv) { 0.4 } else { 1.0 }
}

/// What makes the mean square of 1.4826 MAD of K Gaussian numbers their variance: 1.05 for K = 8.
fn small_sample(count: usize) -> f64 {
    1.0 + 0.4 / count as f64
}

/// Residuals over their standard deviation, and that: plain, or by median and MAD and clipped for DR-AWV.
fn residuals(logs: &[f64], estimator: Estimator) -> (Vec<f64>, f64) {
    let freedom = logs.len() as f64 - 1.0;
    if freedom < 1.0 {
        return (vec![0.0; logs.len()], 0.0);
    }
    let deviations = |centre: f64| logs.iter().map(move |x| x - centre);
    let sum2 = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>();
    let (mut scaled, total) = if estimator == Estimator::DrAwv {
        let (centre, scale) = (median(logs), small_sample(logs.len()) * deviation(logs));
        if scale > 0.0 {
            (deviations(centre).map(|d| (d / scale).clamp(-CLIP, CLIP)).collect::<Vec<_>>(), scale)
        } else {
            (vec![0.0; logs.len()], 0.0)
        }
    } else {
        let plain: Vec<f64> = deviations(logs.iter().sum::<f64>() / logs.len() as f64).collect();
        let total = (sum2(&plain) / freedom).sqrt();
        (plain, total)
    };
    let length = (sum2(&scaled) / freedom).sqrt();
    if length > 0.0 {
        scaled.iter_mut().for_each(|s| *s /= length);
    }
    (scaled, total)
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
        assert!(residuals(&logs, Estimator::DrAwv).1 < 2.0 * clean);
        let (units, _) = residuals(&logs, Estimator::SrAwv);
        assert_relative_eq!(units.iter().map(|u| u * u).sum::<f64>(), 5.0, max_relative = 1e-12);
    }

    /// 4000 draws of K Gaussian numbers: the mean of the squared MAD, corrected, is the variance (its standard
    /// error is √(2/ν/4000) = 1.1 to 1.8 %, four of which and the 2 to 13 % by which the rule is off for the fewest are
    /// allowed), and scatters as 0.4 (K − 1) degrees of freedom say to a third.
    #[test]
    fn the_square_of_a_mad_scatters_as_said() {
        use rand::SeedableRng;
        let mut generator = Generator::seed_from_u64(2);
        for count in [6, 8, 12, 24] {
            let square = |generator: &mut Generator| {
                let x: Vec<f64> = (0..count).map(|_| generator.sample(StandardNormal)).collect();
                (small_sample(count) * deviation(&x)).powi(2)
            };
            let squares: Vec<f64> = (0..4000).map(|_| square(&mut generator)).collect();
            let mean = squares.iter().sum::<f64>() / 4000.0;
            let variance = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 3999.0;
            assert!((mean - 1.0).abs() < 0.1, "{count}: {mean}");
            let freedom = 2.0 * mean * mean / variance / (count as f64 - 1.0);
            assert!((freedom / 0.4 - 1.0).abs() < 0.33, "{count}: {freedom}");
        }
    }
}
