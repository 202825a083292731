//! From the wavelet variances of K replicates to one curve
//! ([Minaretzis](crate::bibliography::Minaretzis24), eqs. 4–8).

use super::differing::between;
use crate::imu::Axis;
use crate::wavelet::{Curve, RobustVariance, Status, Tuning, interval};
use std::fmt;
use std::str::FromStr;

/// The curve to which a model is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Estimator {
    /// Average of the classical wavelet variances.
    Awv,
    /// Average of the robust wavelet variances: robust to outliers within replicates.
    SrAwv,
    /// Trimmed average, scale by scale, of the robust wavelet variances: robust to abnormal replicates too.
    #[default]
    DrAwv,
    /// Classical wavelet variance of one replicate.
    Gmwm,
    /// Robust wavelet variance of one replicate.
    Rgmwm,
    /// Regression on the slopes of the Allan deviation of one replicate.
    Avlr,
    /// A curve from elsewhere.
    Given,
}

nav_sim_signal::named!(
    Estimator {
        Awv = "awv",
        SrAwv = "sr-awv",
        DrAwv = "dr-awv",
        Gmwm = "gmwm",
        Rgmwm = "rgmwm",
        Avlr = "avlr",
        Given = "given",
    }, in files
);

impl Estimator {
    /// Whether it uses the robust wavelet variance.
    #[must_use]
    pub const fn is_robust(self) -> bool {
        matches!(self, Self::SrAwv | Self::DrAwv | Self::Rgmwm)
    }

    /// Whether it takes one replicate at a time.
    #[must_use]
    pub const fn is_single(self) -> bool {
        matches!(self, Self::Gmwm | Self::Rgmwm | Self::Avlr | Self::Given)
    }
}

/// Number of replicates that DR-AWV drops at each end, scale by scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trim {
    /// A number.
    Count(usize),
    /// A fraction of the K replicates, rounded down: floor(fraction·K).
    Fraction(f64),
}

impl Trim {
    /// The number for K replicates.
    #[must_use]
    pub fn count(self, replicates: usize) -> usize {
        match self {
            Self::Count(a) => a,
            // An exact product must not fall short: 0.3·10 is 2.9999999999999996.
            Self::Fraction(f) => (f * replicates as f64 + 1e-9).floor() as usize,
        }
    }
}

impl Default for Trim {
    /// 30 %.
    fn default() -> Self {
        Self::Fraction(0.3)
    }
}

impl fmt::Display for Trim {
    /// "2", "30%"
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => count.fmt(f),
            Self::Fraction(fraction) => write!(f, "{}%", 100.0 * fraction),
        }
    }
}

/// A text that is no trim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not a number of replicates such as 2, or a percentage under 50 such as 30%")]
pub struct TrimError;

impl FromStr for Trim {
    type Err = TrimError;

    fn from_str(text: &str) -> Result<Self, TrimError> {
        match text.strip_suffix('%') {
            None => text.parse().map(Self::Count).map_err(|_| TrimError),
            Some(percent) => match percent.trim().parse() {
                Ok(p) if (0.0..50.0).contains(&p) => Ok(Self::Fraction(p / 100.0)),
                _ => Err(TrimError),
            },
        }
    }
}

/// The wavelet variances of one replicate of one signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Replicate {
    /// File name or other label.
    pub name: String,
    /// The axis it is of, if known.
    pub axis: Option<Axis>,
    /// Its length T (samples).
    pub samples: usize,
    /// Classical wavelet variance at levels 1, 2, … (units²).
    pub classical: Vec<f64>,
    /// Robust wavelet variance at the same levels.
    pub robust: Vec<RobustVariance>,
    /// Mean of its later half less that of its earlier half (units): what a slow drift moves most. NaN where not known.
    pub trend: f64,
    /// Mean of the signal (units): gravity, Earth rate and the bias of this switching-on. NaN where not known.
    pub mean: f64,
}

impl Replicate {
    /// The wavelet variance that an estimator uses, at index level − 1.
    pub(crate) fn value(&self, estimator: Estimator, index: usize) -> f64 {
        if self.is_robust(estimator, index) { self.robust[index].value } else { self.classical[index] }
    }

    /// Whether that is the robust one: on coarse steps a robust estimator too takes the classical one.
    pub(crate) fn is_robust(&self, estimator: Estimator, index: usize) -> bool {
        estimator.is_robust() && self.robust[index].status != Status::Coarse
    }

    /// The wavelet variances that an estimator uses, from level 1 on (units²).
    #[must_use]
    pub fn values(&self, estimator: Estimator) -> Vec<f64> {
        (0..self.levels()).map(|index| self.value(estimator, index)).collect()
    }

    /// Number of levels at which it has wavelet variances.
    pub(crate) fn levels(&self) -> usize {
        self.classical.len()
    }
}

/// Why replicates have no average.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AverageError {
    /// No replicate, or none with a scale.
    #[error("no replicates")]
    None,
    /// The trim leaves nothing.
    #[error("trimming {trim} replicates at each end needs at least {} replicates; there are {replicates}", 2 * trim + 1)]
    Trim {
        /// Replicates dropped at each end.
        trim: usize,
        /// Replicates there are.
        replicates: usize,
    },
    /// A single-replicate estimator was given several.
    #[error("{estimator} takes one recording at a time; there are {replicates}")]
    Single {
        /// The estimator.
        estimator: &'static str,
        /// Replicates there are.
        replicates: usize,
    },
}

/// Number of levels that more than half of the replicates have: a few short ones cost the others nothing,
/// and no scale rests on a few long ones, or on one without a second to say how recordings differ.
fn majority(replicates: &[Replicate]) -> usize {
    let mut levels: Vec<usize> = replicates.iter().map(Replicate::levels).collect();
    levels.sort_unstable_by(|a, b| b.cmp(a));
    levels.get(levels.len() / 2).copied().unwrap_or(0)
}

/// The curve an estimator fits: averages with weights T_i/Σ T, level by level over the replicates that have it, up to the
/// last level that more than half of them have.
///
/// The paper's slips are resolved: SR-AWV's weights sum to one (its 1/J must be 1/K), DR-AWV keeps the
/// order statistics a + 1 … K − a (2a are dropped), weights of the kept ones renormalised. `tuning` is
/// that of the robust wavelet variances; the degrees of freedom are those of the replicates' eta3 combined. Where a
/// quantiser's steps move a robust variance the classical one serves. A level at which half of the kept ones or more have no
/// admissible root is ignored in fits; its value is the average of the classical ones, which bounds the noise from above.
///
/// # Errors
/// When there is no replicate, more than one for a single-replicate estimator, or none left by the trim.
pub fn average(
    replicates: &[Replicate],
    estimator: Estimator,
    trim: Trim,
    tuning: &Tuning,
) -> Result<Curve, AverageError> {
    let count = replicates.len();
    if estimator.is_single() && count > 1 {
        return Err(AverageError::Single { estimator: estimator.name(), replicates: count });
    }
    let levels = majority(replicates);
    if levels == 0 {
        return Err(AverageError::None);
    }
    let dropped = |count: usize| if estimator == Estimator::DrAwv { trim.count(count) } else { 0 };
    let is_enough = |count: usize| count > 2 * dropped(count);
    if !is_enough(count) {
        return Err(AverageError::Trim { trim: dropped(count), replicates: count });
    }
    let quantization = estimator.is_robust().then(|| *tuning.quantization());
    let kept_of_all = (count - 2 * dropped(count)) as f64;
    let differing = between(replicates, estimator, tuning) / kept_of_all;
    let mut curve = Curve { quantization, differing, ..Curve::default() };
    for level in 1..=levels as u32 {
        let long_enough = replicates.iter().filter(|r| r.levels() >= level as usize);
        let replicates: Vec<&Replicate> = long_enough.collect();
        // A trim by a number, of which too few are left at the longest scales.
        if !is_enough(replicates.len()) {
            break;
        }
        curve.levels.push(level);
        let kept_of = |estimator: Estimator| {
            let terms = replicates.iter().map(|r| Term::new(r, level, estimator, tuning.efficiency()));
            trimmed(terms.collect(), dropped(replicates.len()))
        };
        let mut kept = kept_of(estimator);
        // A value without a root is the nearest there is, not an estimate.
        if estimator.is_robust() && is_majority(&kept, |term| term.is_without_root) {
            curve.ignored.push(level);
            kept = kept_of(Estimator::Awv);
        }
        if estimator.is_robust() && is_majority(&kept, |term| !term.is_robust) {
            curve.classical.push(level);
        }
        let total: f64 = kept.iter().map(|t| t.samples).sum();
        curve.wv.push(kept.iter().map(|t| t.samples / total * t.nu).sum());
        // var(Σ w nu) = Σ w²·2 nu²/eta, the replicates' true nu taken equal.
        let inverse: f64 = kept.iter().map(|t| (t.samples / total).powi(2) / t.edof).sum();
        curve.edof.push(1.0 / inverse);
    }
    Ok(curve)
}

/// The terms without so many at either end. Scale by scale: a recording that is abnormal at long scales still serves at short
/// ones.
fn trimmed(mut terms: Vec<Term>, trim: usize) -> Vec<Term> {
    terms.sort_by(|a, b| a.nu.total_cmp(&b.nu));
    terms.truncate(terms.len() - trim);
    terms.split_off(trim)
}

fn is_majority(terms: &[Term], is_counted: fn(&&Term) -> bool) -> bool {
    2 * terms.iter().filter(is_counted).count() >= terms.len()
}

/// Contribution of one replicate at one level.
struct Term {
    samples: f64,
    nu: f64,
    edof: f64,
    is_robust: bool,
    is_without_root: bool,
}

impl Term {
    fn new(replicate: &Replicate, level: u32, estimator: Estimator, efficiency: f64) -> Self {
        let i = level as usize - 1;
        let eta3 = interval::edof_eta3(replicate.samples, level);
        let is_robust = replicate.is_robust(estimator, i);
        Self {
            samples: replicate.samples as f64,
            nu: replicate.value(estimator, i),
            edof: if is_robust { interval::edof_robust(eta3, efficiency) } else { eta3 },
            is_robust,
            is_without_root: is_robust && replicate.robust[i].status == Status::NoRoot,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wavelet::Convention;
    use approx::assert_relative_eq;

    fn tuning() -> Tuning {
        Tuning::new(0.6, Convention::Exact).unwrap()
    }

    fn replicate(samples: usize, classical: f64, robust: f64) -> Replicate {
        let robust = vec![RobustVariance { value: robust, status: Status::Ok, zeros: 0.0 }; 2];
        let (name, classical) = (String::new(), vec![classical; 2]);
        Replicate { name, axis: None, samples, classical, robust, trend: f64::NAN, mean: f64::NAN }
    }

    fn eight() -> Vec<Replicate> {
        (1..=8).map(|k| replicate(1000, f64::from(k), 10.0 * f64::from(k))).collect()
    }

    fn first(replicates: &[Replicate], estimator: Estimator, trim: Trim) -> f64 {
        average(replicates, estimator, trim, &tuning()).unwrap().wv[0]
    }

    #[test]
    fn thirty_per_cent_of_eight_is_two_at_each_end() {
        let trim = Trim::Fraction(0.3);
        assert_relative_eq!(first(&eight(), Estimator::Awv, trim), 4.5);
        assert_relative_eq!(first(&eight(), Estimator::SrAwv, trim), 45.0);
        assert_eq!((trim.count(8), trim.count(10), trim.count(3), Trim::Count(2).count(8)), (2, 3, 0, 2));
        let mut abnormal = eight();
        abnormal[0] = replicate(1000, 0.0, 1e9);
        abnormal[1] = replicate(1000, 0.0, 1e-9);
        // Kept: 40, 50, 60, 70.
        assert_relative_eq!(first(&abnormal, Estimator::DrAwv, trim), 55.0);
        assert_relative_eq!(first(&abnormal[..1], Estimator::Rgmwm, trim), 1e9);
    }

    #[test]
    fn longer_replicates_weigh_more_and_the_kept_weights_sum_to_one() {
        let replicates = [replicate(1000, 1.0, 1.0), replicate(3000, 5.0, 5.0), replicate(1000, 9.0, 100.0)];
        assert_relative_eq!(first(&replicates, Estimator::Awv, Trim::Count(0)), 5.0);
        assert_relative_eq!(first(&replicates, Estimator::DrAwv, Trim::Count(1)), 5.0);
        let curve = average(&replicates[..2], Estimator::Awv, Trim::Count(0), &tuning()).unwrap();
        let eta = |samples: f64| (samples - 1.0) / 2.0;
        assert_relative_eq!(curve.edof[0], 1.0 / (0.0625 / eta(1000.0) + 0.5625 / eta(3000.0)));
        assert_relative_eq!(curve.wv[0], 4.0);
    }

    /// Four of 1000 samples with two levels, and one of 10 with one: the second level is the average of the four, with the
    /// trim of four. Of two replicates one alone is no majority.
    #[test]
    fn a_level_is_averaged_over_the_replicates_that_have_it() {
        let mut replicates = eight()[..4].to_vec();
        replicates.push(replicate(10, 500.0, 500.0));
        replicates[4].classical.pop();
        replicates[4].robust.pop();
        let curve = |estimator, trim| average(&replicates, estimator, trim, &tuning()).unwrap();
        let awv = curve(Estimator::Awv, Trim::Count(0));
        assert_eq!(awv.levels, [1, 2]);
        assert_relative_eq!(awv.wv[0], (10.0 * 1000.0 + 10.0 * 500.0) / 4010.0, max_relative = 1e-14);
        assert_relative_eq!(awv.wv[1], 2.5);
        // floor(0.3·5) = floor(0.3·4) = 1: of 10, 20, 30, 40, 500 and of 10, 20, 30, 40.
        let trimmed = curve(Estimator::DrAwv, Trim::Fraction(0.3));
        assert_relative_eq!(trimmed.wv[0], 30.0);
        assert_relative_eq!(trimmed.wv[1], 25.0);
        // Two at each end leave one of five and none of four.
        assert_eq!(curve(Estimator::DrAwv, Trim::Count(2)).levels, [1]);
        let levels = |kept: &[Replicate]| {
            average(kept, Estimator::Awv, Trim::Count(0), &tuning()).unwrap().levels.len()
        };
        assert_eq!((levels(&replicates[3..]), levels(&replicates[2..])), (1, 2));
    }

    #[test]
    fn equal_replicates_multiply_the_degrees_of_freedom() {
        let curve = average(&eight(), Estimator::DrAwv, Trim::Count(2), &tuning()).unwrap();
        assert_relative_eq!(curve.edof[0], 4.0 * 0.6 * 499.5, max_relative = 1e-12);
    }

    /// Gaussian numbers of 0.3 steps, rounded: nu of level j is their variance over 2^j, that of the law of three numbers −1, 0,
    /// 1 (0.2 % beyond; P(1) = P(Z > 5/3) = 0.0478, variance 0.0956). Every scale counts and is right to four standard deviations,
    /// √(2/eta), and the 1.3 % of fine steps; the first is the classical variance, with all its degrees of freedom.
    #[test]
    fn scales_that_coarse_steps_move_are_classical() {
        use crate::wavelet::both;
        use rand::{RngExt, SeedableRng};
        let mut generator = crate::rng::Generator::seed_from_u64(5);
        let mut number = || (0.3 * generator.sample::<f64, _>(rand_distr::StandardNormal)).round();
        let signal: Vec<f64> = (0..1 << 17).map(|_| number()).collect();
        let (classical, robust) = both(&signal, 9, &tuning()).unwrap();
        let one = Replicate { samples: signal.len(), classical, robust, ..replicate(1, 0.0, 0.0) };
        let curve =
            |estimator| average(std::slice::from_ref(&one), estimator, Trim::Count(0), &tuning()).unwrap();
        assert_eq!(curve(Estimator::Gmwm).ignored, [0; 0]);
        let curve = curve(Estimator::Rgmwm);
        assert!(curve.ignored.is_empty() && curve.classical.contains(&1), "{curve:?}");
        assert_relative_eq!(curve.edof[0], interval::edof_eta3(1 << 17, 1));
        for ((level, nu), edof) in curve.levels.iter().zip(&curve.wv).zip(&curve.edof) {
            let off = (nu / (0.0956 / f64::from(*level).exp2()) - 1.0).abs();
            let allowed = 0.013 + 4.0 * (2.0 / edof).sqrt();
            assert!(off < allowed, "level {level}: {off}");
        }
    }

    /// Two of three replicates without a root at the first level: its value is the classical average, which no fit counts.
    #[test]
    fn a_scale_without_a_root_is_bounded_by_the_classical_average() {
        let mut replicates = eight()[..3].to_vec();
        replicates[..2].iter_mut().for_each(|r| r.robust[0].status = Status::NoRoot);
        let curve = average(&replicates, Estimator::SrAwv, Trim::Count(0), &tuning()).unwrap();
        assert_eq!((curve.ignored, curve.classical), (vec![1], vec![1]));
        assert_relative_eq!(curve.wv[0], 2.0);
        assert_relative_eq!(curve.wv[1], 20.0);
    }

    #[test]
    fn what_cannot_be_averaged_is_refused() {
        let error = |r: &[Replicate], e, t| average(r, e, t, &tuning()).unwrap_err().to_string();
        assert_eq!(error(&[], Estimator::Awv, Trim::Count(0)), "no replicates");
        assert_eq!(
            error(&eight(), Estimator::DrAwv, Trim::Count(4)),
            "trimming 4 replicates at each end needs at least 9 replicates; there are 8"
        );
        assert_eq!(
            error(&eight(), Estimator::Gmwm, Trim::Count(0)),
            "gmwm takes one recording at a time; there are 8"
        );
    }
}
