//! From the wavelet variances of K replicates to one curve
//! ([Minaretzis](crate::bibliography::Minaretzis24), eqs. 4–8).

use super::sampling::variance_of_log;
use crate::imu::{Axis, Channel, Recording, Sensor, Signal};
use crate::units::Refused;
use crate::wavelet::{
    Curve, GappyVariances, RobustVariance, RootStatus, Tuning, WaveletError, classical_and_robust,
    default_levels, gappy, interval,
};
use rayon::prelude::*;
use statrs::distribution::{Continuous, ContinuousCDF, Normal};
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
    /// Returns true for an estimator that uses the robust wavelet variance.
    pub const fn is_robust(self) -> bool {
        matches!(self, Self::SrAwv | Self::DrAwv | Self::Rgmwm)
    }

    /// Returns true for an estimator that takes one replicate at a time.
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

impl FromStr for Trim {
    type Err = Refused;

    fn from_str(text: &str) -> Result<Self, Refused> {
        let found = match text.strip_suffix('%') {
            None => text.parse::<u32>().ok().map(|n| Self::Count(n as usize)),
            Some(percent) => {
                let percent = percent.trim().parse().ok();
                let percent = percent.filter(|p| (0.0..50.0).contains(p));
                percent.map(|p: f64| Self::Fraction(p / 100.0))
            }
        };
        let expected = "expected a number such as 2, or a percentage under 50 such as 30%";
        found.ok_or_else(|| Refused(expected.to_owned()))
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

    /// Returns true if the variance used at a level is the robust one. On coarse quantization steps
    /// a robust estimator falls back to the classical variance.
    pub(crate) fn is_robust(&self, estimator: Estimator, index: usize) -> bool {
        estimator.is_robust() && self.robust[index].status != RootStatus::Coarse
    }

    /// The wavelet variances that an estimator uses, from level 1 on (units²).
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
    pub fn edof_eta3(&self, level: u32) -> f64 {
        (interval::edof_eta3(self.samples, level) * self.covered(level as usize - 1)).max(1.0)
    }

    /// Degrees of freedom of the wavelet variance that an estimator uses.
    pub(crate) fn edof(&self, estimator: Estimator, level: u32, tuning: &Tuning) -> f64 {
        let eta3 = self.edof_eta3(level);
        if self.is_robust(estimator, level as usize - 1) {
            interval::edof_robust(eta3, tuning.efficiency())
        } else {
            eta3
        }
    }

    /// Number of levels at which it has wavelet variances.
    pub(crate) fn levels(&self) -> usize {
        self.classical.len()
    }
}

/// Reason for which a calibration fails, where the advice depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CalibrationFault {
    /// A signal too short for its scales.
    TooShort,
    /// A trim that leaves no replicate.
    Trim,
    /// Fewer scales than parameters.
    TooFewScales,
    /// A wavelet variance that is not positive has no logarithm, no weight, no meaning.
    NotPositive,
    /// A process without a slope of its own in the Allan deviation.
    NoSlope,
    /// Anything else.
    Other,
}

/// Reason that there is no wavelet variance, no curve or no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct CalibrationError {
    /// Its cause.
    pub cause: CalibrationFault,
    message: String,
}

impl CalibrationError {
    pub(crate) fn new(cause: CalibrationFault, message: impl ToString) -> Self {
        let message = message.to_string();
        Self { cause, message }
    }

    pub(crate) fn other(message: impl ToString) -> Self {
        Self::new(CalibrationFault::Other, message)
    }

    /// The error with the name of its group or signal in front.
    pub(crate) fn within(self, part: &str) -> Self {
        Self::new(self.cause, format!("{part}: {}", self.message))
    }
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
) -> Result<Curve, CalibrationError> {
    let count = replicates.len();
    if estimator.is_single() && count > 1 {
        let message = format!("{estimator} takes one recording at a time; there are {count}");
        return Err(CalibrationError::other(message));
    }
    let levels = majority(replicates);
    if levels == 0 {
        return Err(CalibrationError::other("no replicates"));
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
        let trim = dropped(count);
        let least = 2 * trim + 1;
        let message =
            format!("a trim of {trim} at each end needs {least} replicates; there are {count}");
        return Err(CalibrationError::new(CalibrationFault::Trim, message));
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
                .map(|r| Term::new(r, level, estimator, tuning));
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
        let bias = |t: &Term| match t.is_robust {
            true => t.samples / total * robust_bias(t.edof, tuning),
            false => 0.0,
        };
        let bias: f64 = kept.iter().map(bias).sum();
        let trim = dropped(replicates.len()) as f64 / replicates.len() as f64;
        let ninths = kept.iter().map(|t| t.samples / total / (9.0 * t.eta3));
        curve.log_bias.push(match trim {
            0.0 => log_bias(1.0 / inverse, bias),
            _ => bias.ln_1p() + trimmed_log_bias(ninths.sum(), trim),
        });
    }
    Ok(curve)
}

/// Median ln of the mean of the middle ones of many variances over the true one, a share `trim` dropped at each end. `variance`:
/// that of their cube roots. Robust variances of few coefficients scatter as classical ones do: so the degrees are
/// twice eta3.
fn trimmed_log_bias(variance: f64, trim: f64) -> f64 {
    // (chi²/n)^(1/3) = c + √v z (Wilson and Hilferty), and E z² = 1 − 2 q phi(q)/(1 − 2 trim) of |z| < q.
    let (normal, c) = (Normal::standard(), 1.0 - variance);
    let q = normal.inverse_cdf(1.0 - trim);
    let square = 1.0 - 2.0 * q * normal.pdf(q) / (1.0 - 2.0 * trim);
    (c.powi(3) + 3.0 * c * variance * square).ln()
}

/// Median ln of a wavelet variance over the true one, of these degrees of freedom and relative bias.
pub fn log_bias(edof: f64, bias: f64) -> f64 {
    // The cube root of chi²/n is nearly normal about 1 − 2/(9 n) (Wilson and Hilferty). Where it matters a variance has about
    // twice the degrees of freedom of eta3.
    bias.ln_1p() + 3.0 * (-1.0 / (9.0 * edof)).max(-0.9).ln_1p()
}

/// Relative bias of a robust variance of few coefficients.
pub fn robust_bias(edof: f64, tuning: &Tuning) -> f64 {
    (tuning.bias() / edof).min(LARGEST_BIAS)
}

/// Largest relative bias of a robust variance, beyond which its expansion fails: the most that was measured
/// (docs/limits.md: 21 % with two lengths of the scale in the record).
pub(crate) const LARGEST_BIAS: f64 = 0.2;

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
    eta3: f64,
    edof: f64,
    is_robust: bool,
    is_without_root: bool,
}

impl Term {
    fn new(replicate: &Replicate, level: u32, estimator: Estimator, tuning: &Tuning) -> Self {
        let i = level as usize - 1;
        let is_robust = replicate.is_robust(estimator, i);
        Self {
            samples: replicate.samples as f64,
            nu: replicate.value(estimator, i),
            eta3: replicate.edof_eta3(level),
            edof: replicate.edof(estimator, level, tuning),
            is_robust,
            is_without_root: is_robust && replicate.robust[i].status == RootStatus::NoRoot,
        }
    }
}

// Differences of replicates beyond their noise, one number for all scales: what limits the weight of scales that are known
// far better than recordings agree.

/// Replicates from which on a scatter is reported.
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
                .map(|r| variance_of_log(r.edof(estimator, level, tuning)));
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

// From recordings to groups of replicates: the wavelet variances of every signal.

/// Sensor, and axis if not all, that one model is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scope {
    /// The sensor.
    pub sensor: Sensor,
    /// The axis; none if the axes are pooled.
    pub axis: Option<Axis>,
}

impl Scope {
    /// `accel.x`, or `accel` if the axes are pooled.
    pub fn name(&self) -> String {
        match self.axis {
            None => self.sensor.name().to_owned(),
            Some(axis) => Channel {
                sensor: self.sensor,
                axis,
            }
            .to_string(),
        }
    }

    /// The channels it covers.
    pub fn channels(&self) -> Vec<Channel> {
        let axes = self.axis.map_or(Axis::ALL.to_vec(), |axis| vec![axis]);
        axes.into_iter()
            .map(|axis| Channel {
                sensor: self.sensor,
                axis,
            })
            .collect()
    }
}

/// Signals to which one model is fitted: replicates of one axis, or of all axes of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Scope of the model.
    pub scope: Scope,
    /// The replicates, each with the axis it is of.
    pub replicates: Vec<Replicate>,
}

impl Group {
    /// Names the group and an estimator in an error.
    pub(crate) fn named(
        &self,
        estimator: Estimator,
    ) -> impl Fn(CalibrationError) -> CalibrationError + use<> {
        let part = format!("{}, {estimator}", self.scope.name());
        move |e| e.within(&part)
    }

    /// Recordings that the replicates are of.
    pub(crate) fn recordings(&self) -> usize {
        let mut names: Vec<&str> = self.replicates.iter().map(|r| r.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
    }
}

/// Rule by which signals are replicates of one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pool {
    /// Signals of one axis: one model per axis.
    Axes,
    /// Signals of all axes of a sensor: one model per sensor.
    Sensor,
}

nav_sim_signal::named!(Pool { Axes = "axes", Sensor = "sensor" }, in files);

/// The wavelet variances of all signals of a recording, in their order; missing samples are NaN. Without a number of levels there are as
/// many as usual for its length.
///
/// # Errors
/// When it is too short for the levels.
pub fn replicates(
    recording: &Recording,
    levels: Option<u32>,
    tuning: &Tuning,
) -> Result<Vec<(Channel, Replicate)>, CalibrationError> {
    let replicate = |signal: &Signal| {
        let (channel, samples) = (signal.channel, signal.samples.len());
        let levels = levels.unwrap_or_else(|| default_levels(samples));
        let error = |e: WaveletError| {
            let message = format!("{}, {channel}: {e}", recording.name);
            CalibrationError::new(CalibrationFault::TooShort, message)
        };
        let (classical, robust, coverage) = if signal.samples.iter().any(|x| x.is_nan()) {
            let GappyVariances {
                classical,
                robust,
                coverage,
            } = gappy(&signal.samples, levels, tuning).map_err(error)?;
            (classical, robust, coverage)
        } else {
            let (classical, robust) =
                classical_and_robust(&signal.samples, levels, tuning).map_err(error)?;
            (classical, robust, Vec::new())
        };
        let (name, axis) = (recording.name.clone(), Some(channel.axis));
        let trend = trend(&signal.samples);
        // Of the samples themselves too: a warm-up may have been left out after the mean was taken.
        let mean = signal.mean + mean_about(0.0, &signal.samples);
        Ok((
            channel,
            Replicate {
                name,
                axis,
                samples,
                classical,
                robust,
                coverage,
                trend,
                mean,
            },
        ))
    };
    recording.signals.par_iter().map(replicate).collect()
}

/// Mean of the later half of a signal less that of its earlier half; the middle one of an odd number is left out.
pub fn trend(samples: &[f64]) -> f64 {
    let half = samples.len() / 2;
    // Half by half about their first value, so that no digits of a small change are lost.
    let first = samples.iter().copied().find(|x| !x.is_nan()).unwrap_or(0.0);
    mean_about(first, &samples[samples.len() - half..]) - mean_about(first, &samples[..half])
}

/// Mean distance from a value of the samples that are there; missing ones are NaN.
pub(super) fn mean_about(value: f64, samples: &[f64]) -> f64 {
    let present = || samples.iter().filter(|x| !x.is_nan());
    present().map(|x| x - value).sum::<f64>() / present().count() as f64
}

/// The groups, in the order of [`Channel::ALL`].
pub fn grouped(replicates: Vec<(Channel, Replicate)>, pool: Pool) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let mut replicates = replicates;
    // A stable sort: within a channel the recordings keep the order in which they were given.
    replicates.sort_by_key(|(channel, _)| channel.index());
    for (channel, replicate) in replicates {
        let axis = (pool == Pool::Axes).then_some(channel.axis);
        let scope = Scope {
            sensor: channel.sensor,
            axis,
        };
        match groups.last_mut() {
            Some(group) if group.scope == scope => group.replicates.push(replicate),
            _ => groups.push(Group {
                scope,
                replicates: vec![replicate],
            }),
        }
    }
    groups
}

// The median, and the factor from a median absolute deviation to a standard deviation.

/// 1 / normal quantile of ¾: the median absolute deviation of Gaussian numbers times this is their standard deviation.
pub(crate) const MAD_TO_DEVIATION: f64 = 1.482_602_218_505_602;

/// The median; NaN of nothing.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

/// Share of the statistics that are as large, the observed one among them: exchangeable with B draws it has any of B + 1 ranks
/// with the same probability, so that P(p ≤ a) ≤ a ([Davison and Hinkley](crate::bibliography::DavisonHinkley97), eq. 4.11).
pub(crate) fn p_value(observed: f64, draws: &[f64]) -> f64 {
    let as_large = draws.iter().filter(|draw| **draw >= observed).count();
    (1 + as_large) as f64 / (1 + draws.len()) as f64
}

#[cfg(test)]
#[path = "average_tests.rs"]
mod average_tests;

#[cfg(test)]
mod differing_tests {
    use super::*;
    use crate::tests::*;
    use crate::wavelet::interval::edof_eta3;
    use crate::wavelet::{RobustVariance, RootStatus};

    /// 24 replicates whose variances differ by a common factor of deviation b, and by their noise √(2/eta3): b² is known to
    /// √(2/23) = 30 % of 24 (36 % of a median absolute deviation, four times within 2.5), and is far below b² where there is none.
    #[test]
    fn a_common_factor_is_found() {
        let tuning = Tuning::default();
        let mut generator = generator(4, 0);
        let mut normal = || normal(&mut generator);
        let mut set = |b: f64| -> Vec<Replicate> {
            let replicate = |_| {
                let factor = (b * normal()).exp();
                let noise = |level| (2.0 / edof_eta3(1 << 16, level)).sqrt();
                let nu: Vec<f64> = (1..=10)
                    .map(|l| factor * (noise(l) * normal()).exp())
                    .collect();
                let robust = |value: &f64| RobustVariance {
                    value: *value,
                    status: RootStatus::Ok,
                    zeros: 0.0,
                };
                let robust = nu.iter().map(robust).collect();
                Replicate {
                    samples: 1 << 16,
                    ..replicate(nu, robust)
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
