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
    /// Factor of the degrees of freedom of each level for the samples that are missing; empty where none are.
    pub coverage: Vec<f64>,
    /// Mean of its later half less that of its earlier half (units): what a slow drift moves most. NaN where not known.
    pub trend: f64,
    /// Mean of the signal (units): gravity, Earth rate and the bias of this switching-on. NaN where not known.
    pub mean: f64,
}

impl Replicate {
    /// The wavelet variance that an estimator uses, at index level − 1.
    pub(crate) fn value(&self, estimator: Estimator, index: usize) -> f64 {
        if self.is_robust(estimator, index) {
            self.robust[index].value
        } else {
            self.classical[index]
        }
    }

    /// Whether that is the robust one: on coarse steps a robust estimator too takes the classical one.
    pub(crate) fn is_robust(&self, estimator: Estimator, index: usize) -> bool {
        estimator.is_robust() && self.robust[index].status != Status::Coarse
    }

    /// The wavelet variances that an estimator uses, from level 1 on (units²).
    #[must_use]
    pub fn values(&self, estimator: Estimator) -> Vec<f64> {
        (0..self.levels())
            .map(|index| self.value(estimator, index))
            .collect()
    }

    /// The part of the degrees of freedom of a whole signal that missing samples leave, at index level − 1.
    pub(crate) fn covered(&self, index: usize) -> f64 {
        self.coverage.get(index).copied().unwrap_or(1.0)
    }

    /// eta3 of the samples that are there.
    #[must_use]
    pub fn edof_eta3(&self, level: u32) -> f64 {
        (interval::edof_eta3(self.samples, level) * self.covered(level as usize - 1)).max(1.0)
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
        return Err(AverageError::Single {
            estimator: estimator.name(),
            replicates: count,
        });
    }
    let levels = majority(replicates);
    if levels == 0 {
        return Err(AverageError::None);
    }
    let dropped = |count: usize| {
        if estimator == Estimator::DrAwv {
            trim.count(count)
        } else {
            0
        }
    };
    let is_enough = |count: usize| count > 2 * dropped(count);
    if !is_enough(count) {
        return Err(AverageError::Trim {
            trim: dropped(count),
            replicates: count,
        });
    }
    let quantization = estimator.is_robust().then(|| *tuning.quantization());
    let kept_of_all = (count - 2 * dropped(count)) as f64;
    let differing = between(replicates, estimator, tuning) / kept_of_all;
    let mut curve = Curve {
        quantization,
        differing,
        ..Curve::default()
    };
    for level in 1..=levels as u32 {
        let long_enough = replicates.iter().filter(|r| r.levels() >= level as usize);
        let replicates: Vec<&Replicate> = long_enough.collect();
        // A trim by a number, of which too few are left at the longest scales.
        if !is_enough(replicates.len()) {
            break;
        }
        curve.levels.push(level);
        let kept_of = |estimator: Estimator| {
            let terms = replicates
                .iter()
                .map(|r| Term::new(r, level, estimator, tuning.efficiency()));
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
        curve
            .wv
            .push(kept.iter().map(|t| t.samples / total * t.nu).sum());
        // var(Σ w nu) = Σ w²·2 nu²/eta, the replicates' true nu taken equal.
        let inverse: f64 = kept
            .iter()
            .map(|t| (t.samples / total).powi(2) / t.edof)
            .sum();
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
        let eta3 = replicate.edof_eta3(level);
        let is_robust = replicate.is_robust(estimator, i);
        Self {
            samples: replicate.samples as f64,
            nu: replicate.value(estimator, i),
            edof: if is_robust {
                interval::edof_robust(eta3, efficiency)
            } else {
                eta3
            },
            is_robust,
            is_without_root: is_robust && replicate.robust[i].status == Status::NoRoot,
        }
    }
}

#[cfg(test)]
mod tests;
