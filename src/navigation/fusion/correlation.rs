//! Errors of fixes that last: found in the innovations, answered by larger standard deviations of the position.
//!
//! The innovations of a right filter are white ([Mehra](crate::bibliography::Mehra70)). Where the errors of the fixes
//! last, those of the position are correlated from one fix to the next, however small they are, and a filter that
//! averages them states too little. White noise with the sum of the autocorrelations of ρᵏ has (1 + ρ)/(1 − ρ) times
//! the variance, which is what the filter is then told.

use super::{FixRecord, FusionError, Recorded, Settings, Solution, Start, Use, fuse};
use crate::ekf::Belief;
use crate::gnss::GnssFix;
use crate::trajectory::reference::Reference;
use serde::{Deserialize, Serialize};

/// Quantile of a normal distribution at 0.999: white innovations are called correlated once in a thousand recordings.
const QUANTILE: f64 = 3.090;
/// Correlation that is worth a word: below it standard deviations change by less than a tenth.
const LEAST: f64 = 0.1;
/// Pairs of which anything is said.
const FEWEST: usize = 50;
/// Largest correlation that is believed: 32 times the standard deviation.
const LARGEST: f64 = 0.998;
/// Fixes this many times the median interval apart are no neighbours.
const APART: f64 = 1.5;

/// How long the errors of a receiver's positions last.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Correlation {
    /// As the innovations show.
    #[default]
    Auto,
    /// No longer than one fix.
    None,
    /// So many seconds.
    Seconds(f64),
}

/// Autocorrelation of normalised innovations (of a fix, those of position) from one to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Whiteness {
    /// Autocorrelation at lag 1: 0 if right.
    pub lag_1: f64,
    /// What white innovations exceed once in a thousand recordings, or what is worth a word.
    pub limit: f64,
}

impl Whiteness {
    /// Of the fixes used; none where they are few.
    #[must_use]
    pub fn of<'a>(fixes: impl IntoIterator<Item = &'a FixRecord>) -> Option<Self> {
        let used = fixes.into_iter().filter(|f| f.used == Use::Used);
        let position = |f: &FixRecord| [0, 1, 2].map(|i| f.innovation[i] / f.sigma[i]);
        let all: Vec<(f64, [f64; 3])> = used.map(|f| (f.t_s, position(f))).collect();
        Self::of_series(&all)
    }

    /// Of times and normalised innovations.
    pub(super) fn of_series(series: &[(f64, impl AsRef<[f64]>)]) -> Option<Self> {
        let interval_s = middle(series.windows(2).map(|w| w[1].0 - w[0].0).collect())?;
        let neighbours = series
            .windows(2)
            .filter(|w| w[1].0 - w[0].0 < APART * interval_s);
        let (mut product, mut square, mut pairs) = (0.0, 0.0, 0);
        for pair in neighbours {
            let [a, b] = [0, 1].map(|k: usize| pair[k].1.as_ref());
            product += a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            square += a.iter().chain(b).map(|z| z * z).sum::<f64>() / 2.0;
            pairs += a.len();
        }
        // The estimate of n independent pairs is normal about 0 with variance 1/n (Mehra, sec. III).
        let limit = LEAST.max(QUANTILE / (pairs as f64).sqrt());
        (pairs >= FEWEST && square > 0.0).then(|| Self {
            lag_1: product / square,
            limit,
        })
    }

    /// Whether the innovations are correlated.
    #[must_use]
    pub fn is_correlated(&self) -> bool {
        self.lag_1 > self.limit
    }
}

/// A solution and the fixes that it believes.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighed {
    /// What came out.
    pub solution: Solution,
    /// The solution with standard deviations as stated, where they are not.
    pub as_stated: Option<Solution>,
    /// Whiteness of the innovations with standard deviations as stated.
    pub whiteness: Option<Whiteness>,
    /// How many times the stated standard deviations of position.
    pub pos_sigma_factor: f64,
    /// The fixes with these.
    pub gnss: Vec<GnssFix>,
}

impl Weighed {
    /// The solution whose innovations tell what the fixes are worth.
    #[must_use]
    pub fn judged(&self) -> &Solution {
        self.as_stated.as_ref().unwrap_or(&self.solution)
    }
}

/// [`fuse`] with the standard deviations of position that the correlation of the fixes asks for.
///
/// # Errors
/// Those of [`fuse`].
pub fn fuse_correlated(
    recorded: &Recorded<'_>,
    belief: &Belief,
    start: &Start,
    settings: &Settings,
    (reference, correlation): (Option<&Reference>, Correlation),
) -> Result<Weighed, FusionError> {
    let stated = fuse(recorded, belief, start, settings, reference)?;
    let whiteness = Whiteness::of(&stated.fixes);
    let lag_1 = match correlation {
        Correlation::Auto => whiteness.filter(Whiteness::is_correlated).map(|w| w.lag_1),
        Correlation::None => None,
        // a Gauss-Markov process from one fix to the next
        Correlation::Seconds(seconds) => {
            interval_s(recorded.gnss).map(|step_s| (-step_s / seconds).exp())
        }
    };
    let Some(lag_1) = lag_1 else {
        let gnss = recorded.gnss.to_vec();
        return Ok(Weighed {
            solution: stated,
            as_stated: None,
            whiteness,
            pos_sigma_factor: 1.0,
            gnss,
        });
    };
    let pos_sigma_factor = sigma_factor(lag_1);
    let gnss: Vec<GnssFix> = recorded
        .gnss
        .iter()
        .map(|f| f.with_sigmas_times(pos_sigma_factor, 1.0))
        .collect();
    let solution = fuse(
        &Recorded {
            gnss: &gnss,
            ..*recorded
        },
        belief,
        start,
        settings,
        reference,
    )?;
    Ok(Weighed {
        solution,
        as_stated: Some(stated),
        whiteness,
        pos_sigma_factor,
        gnss,
    })
}

/// Standard deviation of white noise that counts as much as one of 1 whose autocorrelation is ρᵏ.
pub(super) fn sigma_factor(lag_1: f64) -> f64 {
    let rho = lag_1.clamp(0.0, LARGEST);
    ((1.0 + rho) / (1.0 - rho)).sqrt()
}

/// Median time from one fix to the next (s).
fn interval_s(gnss: &[GnssFix]) -> Option<f64> {
    middle(gnss.windows(2).map(|w| w[1].t_s - w[0].t_s).collect())
}

/// The value in the middle, in order.
pub(super) fn middle(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
