//! Lever arm and delay of the fixes that explain large innovations.
//!
//! The innovations change almost linearly with the place of the antenna and with the delay of the fixes. The filter is
//! run with each a little off; least squares over the innovations of all fixes give the values at which they are
//! smallest ([Ljung](crate::bibliography::Ljung99), ch. 7: the prediction-error method, which is maximum likelihood
//! here). What was found is a cause only if the NIS of the filter, run with it, is smaller: an explanation is tested by
//! taking the cause away.

use super::gate::Gate;
use super::outcome::total_nis;
use super::{DriveData, FixRecord, FusionError, FusionSettings, Solution, Start, earlier, fuse};
use crate::ekf::FilterModel;
use crate::gnss::GnssFix;
use crate::linalg::median;
use crate::trajectory::reference::Reference;
use glam::DVec3;
use nalgebra::{DMatrix, DVector, Matrix4, Vector4};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Offsets at which the filter is run (m; s).
const OFF: [f64; 4] = [0.3, 0.3, 0.3, 0.03];
/// The antenna's and the delay's among the four.
pub(super) const ANTENNA: Range<usize> = 0..3;
pub(super) const DELAY: Range<usize> = 3..4;
/// Longest part of a recording that is used (s).
const MOST_S: f64 = 1200.0;
/// Gauss-Newton steps at most, and the share of the NIS that another one must take away: a solution that is far off makes
/// little of the first.
const STEPS: (usize, f64) = (5, 0.02);
/// A part whose absence costs less than this in −2 ln(likelihood) is no part of the cause: odds of e^10.
const COSTLY: f64 = 20.0;
/// Share of the NIS that a cause leaves at most: what receivers state is right to a factor, so its level tells nothing.
const LEFT: f64 = 0.9;
/// An antenna farther off (m) and a delay longer (s) are none: what is wrong is something else.
const FARTHEST: (f64, f64) = (10.0, 2.0);

/// Lever arm and delay at which the fixes agree with the IMU.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AntennaOffset {
    /// Antenna from IMU: front, right, down (m), and standard deviations; none where it is as given.
    pub lever_arm_b: Option<[DVec3; 2]>,
    /// Delay of the fixes (s), and its standard deviation; none where it is not significant.
    pub delay_s: Option<[f64; 2]>,
    /// Mean NIS per component as it is, and with these.
    pub nis: [f64; 2],
}

/// Finds where the antenna is and how late the fixes are, where that makes the innovations smaller.
pub fn antenna_offset(
    recorded: &DriveData<'_>,
    filter_model: &FilterModel,
    start: &Start,
    settings: &FusionSettings,
) -> Option<AntennaOffset> {
    let to_s = start.t_s + MOST_S;
    let scene = OffsetSearch {
        recorded: recorded.until(to_s),
        filter_model,
        start,
        settings,
    };
    let (mut x, mut steps) = (Vector4::zeros(), 0);
    let mut best = scene.innovations(&x)?;
    let now = nis(&best);
    let normal = loop {
        let before = nis(&best);
        let normal = scene.normal(&x, &best)?;
        x += normal.inverse * normal.gradient;
        best = scene.innovations(&x)?;
        steps += 1;
        if steps == STEPS.0 || steps > 1 && nis(&best) > (1.0 - STEPS.1) * before {
            break normal;
        }
    };
    let scale = scale(&best);
    let kept = normal.significant_parts(&x, scale)?;
    let (x, covariance) = normal.without_the_rest(&x, &kept)?;
    // either would do where both are kept for want of one that is needed by itself
    if normal.cost(&x, 0..4)? < COSTLY * scale {
        return None;
    }
    let nis = [now, nis(&scene.innovations(&x)?)];
    let antenna_b = DVec3::new(x[0], x[1], x[2]);
    let is_cause = nis[1] < LEFT * nis[0];
    if !is_cause || antenna_b.length() > FARTHEST.0 || x[3].abs() > FARTHEST.1 {
        return None;
    }
    let sigma = covariance.diagonal().map(|v| (v * scale).sqrt());
    Some(AntennaOffset {
        lever_arm_b: kept.contains(&ANTENNA).then(|| {
            [
                settings.lever_arm_b + antenna_b,
                DVec3::new(sigma[0], sigma[1], sigma[2]),
            ]
        }),
        delay_s: kept.contains(&DELAY).then(|| [x[3], sigma[3]]),
        nis,
    })
}

/// Input of the repeated filter runs.
struct OffsetSearch<'a> {
    recorded: DriveData<'a>,
    filter_model: &'a FilterModel,
    start: &'a Start,
    settings: &'a FusionSettings,
}

impl OffsetSearch<'_> {
    /// The innovations of each fix that is used, with the antenna and the delay off by `x`.
    fn innovations(&self, x: &Vector4<f64>) -> Option<Vec<Option<FixRecord>>> {
        let gnss = earlier(self.recorded.gnss, x[3]);
        let settings = FusionSettings {
            lever_arm_b: self.settings.lever_arm_b + DVec3::new(x[0], x[1], x[2]),
            ..self.settings.trial()
        };
        let recorded = self.recorded.with_gnss(&gnss);
        let solution = fuse(&recorded, self.filter_model, self.start, &settings, None).ok()?;
        let first = gnss.partition_point(|f| f.t_s <= self.start.t_s);
        let mut of_fix = vec![None; gnss.len()];
        for (fix, record) in of_fix[first..].iter_mut().zip(solution.fixes) {
            *fix = Some(record).filter(|record| record.used);
        }
        Some(of_fix)
    }

    /// The normal equations about `x`, where the innovations are `there`.
    fn normal(&self, x: &Vector4<f64>, there: &[Option<FixRecord>]) -> Option<Normal> {
        let off = |k: usize| self.innovations(&(x + Vector4::ith(k, OFF[k])));
        let aside = (0..4)
            .into_par_iter()
            .map(off)
            .collect::<Option<Vec<_>>>()?;
        let (mut information, mut gradient) = (Matrix4::zeros(), Vector4::zeros());
        for (i, fix) in there.iter().enumerate() {
            let Some(fix) = fix else { continue };
            let moved: Option<Vec<&FixRecord>> = aside.iter().map(|a| a[i].as_ref()).collect();
            let Some(moved) = moved else { continue };
            for (c, (z, sigma)) in fix.innovation.iter().zip(&fix.sigma).enumerate() {
                let slope =
                    Vector4::from_fn(|k, _| (moved[k].innovation[c] - z) / (OFF[k] * sigma));
                information += slope * slope.transpose();
                gradient -= slope * (z / sigma);
            }
        }
        Some(Normal {
            inverse: information.try_inverse()?,
            gradient,
        })
    }
}

/// Mean NIS per component.
fn nis(innovations: &[Option<FixRecord>]) -> f64 {
    let (nis, components) = total_nis(innovations.iter().flatten());
    nis / components.max(1) as f64
}

/// Gain in units of that of independent innovations of NIS 1: errors that are larger, and errors that last, make any
/// gain as much larger (the sum of the autocorrelations of ρᵏ is (1 + ρ)/(1 − ρ)).
fn scale(innovations: &[Option<FixRecord>]) -> f64 {
    let lag_1 = Whiteness::of(innovations.iter().flatten()).map_or(0.0, |w| w.lag_1);
    nis(innovations) * sigma_factor(lag_1).powi(2)
}

/// Least squares: the inverse of the information about the four, and the gradient.
pub(super) struct Normal {
    pub(super) inverse: Matrix4<f64>,
    pub(super) gradient: Vector4<f64>,
}

impl Normal {
    /// Increase of −2 ln(likelihood) without a part, the other parts re-estimated.
    pub(super) fn cost(&self, x: &Vector4<f64>, part: Range<usize>) -> Option<f64> {
        let n = part.len();
        let block = self
            .inverse
            .view((part.start, part.start), (n, n))
            .into_owned();
        let of: DVector<f64> = x.rows(part.start, n).into_owned();
        Some(of.dot(&(DMatrix::try_inverse(block)? * &of)))
    }

    /// The parts that `x` owes its gain to. Costs count `scale` times less.
    pub(super) fn significant_parts(
        &self,
        x: &Vector4<f64>,
        scale: f64,
    ) -> Option<Vec<Range<usize>>> {
        let [antenna, delay] = [self.cost(x, ANTENNA)?, self.cost(x, DELAY)?];
        let limit = COSTLY * scale;
        Some(match (antenna > limit, delay > limit) {
            (true, true) => vec![ANTENNA, DELAY],
            (true, false) => vec![ANTENNA],
            // on a straight way at one speed either would do: one number instead of three
            _ => vec![DELAY],
        })
    }

    /// The best values of the parts that are kept where the others are zero, and their covariance.
    fn without_the_rest(
        &self,
        x: &Vector4<f64>,
        kept: &[Range<usize>],
    ) -> Option<(Vector4<f64>, Matrix4<f64>)> {
        let dropped: Vec<usize> = (0..4)
            .filter(|k| !kept.iter().any(|part| part.contains(k)))
            .collect();
        let (mut x, mut p) = (*x, self.inverse);
        // as if each of them had been measured to be zero
        for k in dropped {
            let gain = p.column(k) / p[(k, k)];
            x -= gain * x[k];
            p -= gain * p.row(k);
        }
        x.iter()
            .chain(p.iter())
            .all(|v| v.is_finite())
            .then_some((x, p))
    }
}

// Errors of fixes that last: found in the innovations, answered by larger standard deviations, of the position and of the
// velocity each by itself.
//
// The innovations of a right filter are white ([Mehra](crate::bibliography::Mehra70)). Where the errors of the fixes
// last, they are correlated from one fix to the next, however small they are, and a filter that averages them states
// too little. White noise with the sum of the autocorrelations of ρᵏ has (1 + ρ)/(1 − ρ) times
// the variance, which is what the filter is then told.

/// Quantile of a normal distribution at 0.999: white innovations are called correlated once in a thousand recordings.
const QUANTILE: f64 = 3.090;
/// Correlation that is worth a word: below it standard deviations change by less than a tenth.
const LEAST: f64 = 0.1;
/// Pairs of which anything is said.
const FEWEST: usize = 50;
/// Largest correlation that is trusted: 32 times the standard deviation.
const LARGEST: f64 = 0.998;
/// Innovations count as this many times their median deviation at most: normal ones reach it once in 17 000 (4 σ).
const FAR: f64 = 6.0;
/// Fixes this many times the median interval apart are no neighbours.
const APART: f64 = 1.5;

/// The first component of the position and of the velocity.
const PARTS: [usize; 2] = [0, 3];

/// Correlation time of the errors of a receiver's fixes.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Correlation {
    /// Estimated from the innovations.
    #[default]
    Auto,
    /// No longer than one fix.
    None,
    /// This many seconds for positions; velocities are uncorrelated.
    Seconds(f64),
}

/// Autocorrelation of normalised innovations from one to the next.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Whiteness {
    /// Autocorrelation at lag 1: 0 if right.
    pub lag_1: f64,
    /// Limit that white innovations exceed once in a thousand recordings, or the smallest relevant
    /// value.
    pub limit: f64,
}

impl Whiteness {
    /// For the positions of the fixes used; none where they are few.
    pub fn of<'a>(fixes: impl IntoIterator<Item = &'a FixRecord>) -> Option<Self> {
        Self::of_part(fixes, PARTS[0])
    }

    /// Statistics of three components of the fixes.
    fn of_part<'a>(fixes: impl IntoIterator<Item = &'a FixRecord>, first: usize) -> Option<Self> {
        let normalised = |f: &FixRecord| -> Vec<f64> {
            let both = f.innovation.iter().zip(&f.sigma);
            both.skip(first)
                .take(3)
                .map(|(z, sigma)| z / sigma)
                .collect()
        };
        let used = fixes.into_iter().filter(|f| f.used);
        let mut all: Vec<(f64, Vec<f64>)> = used
            .map(|f| (f.t_s, normalised(f)))
            .filter(|(_, normalised)| !normalised.is_empty())
            .collect();
        // outliers, which are in no order, must not hide it
        let each = || all.iter().flat_map(|(_, z)| z);
        let far = FAR * median(each().map(|z| z.abs()))?;
        let parts = all.iter_mut().flat_map(|(_, z)| z);
        parts.for_each(|z| *z = z.clamp(-far, far));
        Self::of_series(&all)
    }

    /// Autocorrelation of a series of times and normalised innovations.
    pub(super) fn of_series(series: &[(f64, impl AsRef<[f64]>)]) -> Option<Self> {
        let interval_s = median(series.windows(2).map(|w| w[1].0 - w[0].0))?;
        let neighbours = series
            .windows(2)
            .filter(|w| w[1].0 - w[0].0 < APART * interval_s);
        let (mut product, mut square, mut pairs) = (0.0, 0.0, 0);
        for pair in neighbours {
            let [a, b] = [0, 1].map(|k: usize| pair[k].1.as_ref());
            product += a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            square += a.iter().chain(b).map(|z| z * z).sum::<f64>() / 2.0;
            pairs += a.len().min(b.len());
        }
        // The estimate of n independent pairs is normal about 0 with variance 1/n (Mehra, sec. III).
        let limit = LEAST.max(QUANTILE / (pairs as f64).sqrt());
        (pairs >= FEWEST && square > 0.0).then(|| Self {
            lag_1: product / square,
            limit,
        })
    }

    /// Returns true if the innovations are correlated.
    pub fn is_correlated(&self) -> bool {
        self.lag_1 > self.limit
    }
}

/// A solution and the fixes that it believes.
#[derive(Debug, Clone)]
pub struct WeightedSolution {
    /// The solution.
    pub solution: Solution,
    /// The solution with standard deviations as stated, where they are not.
    pub as_stated: Option<Solution>,
    /// Whiteness of the innovations with standard deviations as stated: of position, of velocity.
    pub whiteness: [Option<Whiteness>; 2],
    /// Factors on the stated standard deviations of these.
    pub sigma_factors: [f64; 2],
}

impl WeightedSolution {
    /// The solution whose innovations tell what the fixes are worth.
    pub fn with_stated_sigmas(&self) -> &Solution {
        self.as_stated.as_ref().unwrap_or(&self.solution)
    }

    /// The largest correlation of errors that last.
    pub fn correlation(&self) -> Option<f64> {
        let lasting = self.whiteness.iter().flatten();
        let lasting = lasting.filter(|w| w.is_correlated()).map(|w| w.lag_1);
        lasting.reduce(f64::max)
    }
}

/// [`fuse`] with the standard deviations that the correlation of the fixes asks for.
///
/// # Errors
/// As [`fuse`].
pub fn fuse_correlated(
    recorded: &DriveData<'_>,
    filter_model: &FilterModel,
    start: &Start,
    settings: &FusionSettings,
    (reference, correlation): (Option<&Reference>, Correlation),
) -> Result<WeightedSolution, FusionError> {
    let ungated = FusionSettings {
        gate: None,
        ..settings.clone()
    };
    let stated = fuse(recorded, filter_model, start, &ungated, reference)?;
    let whiteness = PARTS.map(|first| Whiteness::of_part(&stated.fixes, first));
    let lag_1 = match correlation {
        Correlation::Auto => {
            whiteness.map(|w| w.filter(Whiteness::is_correlated).map(|white| white.lag_1))
        }
        Correlation::None => [None; 2],
        // a Gauss-Markov process from one fix to the next
        Correlation::Seconds(seconds) => {
            let lag_1 = interval_s(recorded.gnss).map(|step_s| (-step_s / seconds).exp());
            [lag_1, None]
        }
    };
    let sigma_factors = lag_1.map(|lag_1| lag_1.map_or(1.0, sigma_factor));
    let [position, velocity] = sigma_factors;
    let again = || {
        let fixes = recorded.gnss.iter();
        let gnss: Vec<GnssFix> = fixes
            .map(|f| f.with_sigmas_times(position, velocity))
            .collect();
        fuse(
            &recorded.with_gnss(&gnss),
            filter_model,
            start,
            settings,
            reference,
        )
    };
    let (solution, as_stated) = match lag_1 {
        [None, None] if !gates(&stated, settings.gate) => (stated, None),
        [None, None] => (again()?, None),
        _ => {
            let (solution, mut stated) = (again()?, stated);
            let both = stated.fixes.iter_mut().zip(&solution.fixes);
            both.for_each(|(stated, fix)| stated.rejected_above = fix.rejected_above);
            (solution, Some(stated))
        }
    };
    Ok(WeightedSolution {
        solution,
        as_stated,
        whiteness,
        sigma_factors,
    })
}

/// True if a gate would reject any fix.
fn gates(solution: &Solution, level: Option<f64>) -> bool {
    let is_far = |f: &FixRecord| f.used && f.nis > Gate::bound(level, f.innovation.len());
    solution.fixes.iter().any(is_far)
}

/// Standard deviation of white noise that counts as much as one of 1 whose autocorrelation is ρᵏ.
fn sigma_factor(lag_1: f64) -> f64 {
    let rho = lag_1.clamp(0.0, LARGEST);
    ((1.0 + rho) / (1.0 - rho)).sqrt()
}

/// Median time from one fix to the next (s).
pub fn interval_s(gnss: &[GnssFix]) -> Option<f64> {
    median(gnss.windows(2).map(|w| w[1].t_s - w[0].t_s))
}
