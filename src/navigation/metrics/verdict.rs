//! Whether a filter is as good as it believes: one verdict, from the normalised errors of all runs.
//!
//! Statistics: NEES and (error/SEE)² of every reported state, as means over the whole run and at the end of
//! each outage. Of a right filter each is a mean of chi-square variables, one of 9 or of 1 degree of freedom
//! for each independent run. The epochs of one run hang together in a way nobody knows beforehand, so a mean
//! over epochs is given the freedom of a single epoch: an interval that holds whatever their correlation, exact
//! at the ends of outages. All statistics together alarm on a right filter with probability 1 % at most
//! (Bonferroni), and what is significant but smaller than 10 % is let pass.

use super::consistency::chi_square_interval;
use super::estimate::Estimate;
use crate::simulation::{NEES_DOF, OutageRecord, REPORTED, REPORTED_NAMES, RunRecord};
use serde::{Deserialize, Deserializer, Serialize};

/// Probability at which a right filter is called wrong, all statistics together.
const LEVEL: f64 = 0.01;
/// Errors that differ by less than this share from the filter's standard deviations are let pass.
pub(super) const TOLERANCE: f64 = 0.1;
/// A mean NEES above this is not a matter of tuning: the filter has lost its way.
const LOST: f64 = 100.0;

/// What the verdict is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VerdictKind {
    /// Nothing speaks against the filter.
    Ok,
    /// Errors are larger than the filter believes.
    Overconfident,
    /// Errors are smaller than the filter believes.
    Underconfident,
    /// A state or covariance stopped being finite in at least one run.
    Diverged,
}

/// One of [`REPORTED_NAMES`], or [`ALL_STATES`]; `serde` would borrow what it saw as a reference.
pub type StateName = &'static str;

/// Stands for all states together, by their NEES, where they are off and no single one is.
pub const ALL_STATES: StateName = "all";

/// The verdict on the filter of an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// In one word.
    pub kind: VerdictKind,
    /// Mean NEES over epochs and runs; 9 if the filter is right.
    #[serde(deserialize_with = "number")]
    pub nees: f64,
    /// Its Monte-Carlo standard error, from the scatter of the runs.
    #[serde(deserialize_with = "number")]
    pub nees_std_error: f64,
    /// Mean share of epochs inside the filter's ellipsoid.
    #[serde(deserialize_with = "number")]
    pub coverage: f64,
    /// Its Monte-Carlo standard error, from the scatter of the runs.
    #[serde(deserialize_with = "number")]
    pub coverage_std_error: f64,
    /// The state that is farthest off in the direction of the verdict, or [`ALL_STATES`].
    #[serde(deserialize_with = "state")]
    pub worst_state: StateName,
    /// The outage at whose end it is (from 0); none: over the whole run.
    pub worst_outage: Option<usize>,
    /// Root mean square there of error over standard deviation: 1 if the filter is right.
    #[serde(deserialize_with = "number")]
    pub ratio: f64,
    /// Its Monte-Carlo standard error.
    #[serde(deserialize_with = "number")]
    pub ratio_std_error: f64,
    /// The first outage (from 0) in which errors are beyond linear theory, where covariance analysis, which is linear, found the
    /// verdict or would have. A verdict that rests on the analysis is one of linear theory alone from there on.
    pub beyond_linear: Option<usize>,
    /// Runs that count as independent; infinitely many (null) of a covariance analysis.
    #[serde(deserialize_with = "count")]
    pub independent_runs: f64,
    /// The error over standard deviation, common to all states, from which on these runs would tell it.
    #[serde(deserialize_with = "number")]
    pub detectable_ratio: f64,
    /// The same of one state alone.
    #[serde(deserialize_with = "number")]
    pub detectable_state_ratio: f64,
    /// Probability at which a right filter is called wrong, all statistics together.
    pub level: f64,
    /// Errors that differ by less than this share from the filter's standard deviations are let pass.
    pub tolerance: f64,
}

/// A number as JSON has it: null if it is none.
pub(super) fn number<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(value)?.unwrap_or(f64::NAN))
}

/// A count as JSON has it: null if it has no end.
fn count<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(value)?.unwrap_or(f64::INFINITY))
}

fn state<'de, D: Deserializer<'de>>(value: D) -> Result<&'static str, D::Error> {
    let name = String::deserialize(value)?;
    let known = REPORTED_NAMES.into_iter().chain([ALL_STATES]).find(|known| *known == name);
    known.ok_or_else(|| serde::de::Error::custom(format!("{name:?} is no state")))
}

/// The verdict on the filter at the end of one outage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutageVerdict {
    /// In one word.
    pub kind: VerdictKind,
    /// The state that is farthest off there in the direction of the verdict, or [`ALL_STATES`].
    pub worst_state: StateName,
    /// Root mean square there of error over standard deviation: 1 if the filter is right.
    pub ratio: f64,
    /// Its Monte-Carlo standard error.
    pub ratio_std_error: f64,
}

impl OutageVerdict {
    /// From the records of the runs, as [`Verdict::of`]: with the same limits, so that no outage is called wrong
    /// where the filter is not. A run that diverged did so in every outage, since nobody knows when.
    pub(crate) fn of(runs: &[RunRecord], outages: usize, independent_windows: Option<f64>) -> Vec<Self> {
        let kept: Vec<&RunRecord> = runs.iter().filter(|r| !r.diverged).collect();
        let statistics = Evidence { runs: &kept, windows: independent_windows }.statistics(outages);
        let independent_runs = independent_windows.unwrap_or(f64::INFINITY).min(kept.len() as f64);
        let judge = Judge::new(independent_runs, LEVEL / (2.0 * statistics.len() as f64));
        judge.outages(&statistics, outages, kept.len() < runs.len())
    }

    /// From the run whose squares are the expected ones, as [`Verdict::expected`].
    pub(crate) fn expected(record: &RunRecord) -> Vec<Self> {
        let statistics = Evidence { runs: &[record], windows: None }.statistics(record.outages.len());
        // Nothing is left to chance: the limits of significance close on 1, and the tolerance alone decides.
        Judge { limits: [(1.0, 1.0); 2] }.outages(&statistics, record.outages.len(), false)
    }
}

impl Verdict {
    /// From the records of the runs through a number of outages, those that diverged left out;
    /// `independent_windows` as in [`RunResult`](crate::simulation::RunResult).
    #[must_use]
    pub fn of(runs: &[RunRecord], outages: usize, independent_windows: Option<f64>) -> Self {
        let kept: Vec<&RunRecord> = runs.iter().filter(|r| !r.diverged).collect();
        let evidence = Evidence { runs: &kept, windows: independent_windows };
        let statistics = evidence.statistics(outages);
        let independent_runs = independent_windows.unwrap_or(f64::INFINITY).min(kept.len() as f64);
        let judge = Judge::new(independent_runs, LEVEL / (2.0 * statistics.len() as f64));
        let kind = if kept.len() < runs.len() { VerdictKind::Diverged } else { judge.kind(&statistics) };
        Self::by(&judge, kind, &evidence, &statistics, independent_runs)
    }

    /// From the run whose squares are the expected ones: nothing is left to chance, and what is off by more than
    /// the tolerance is wrong.
    pub(crate) fn expected(record: &RunRecord, beyond_linear: Option<usize>) -> Self {
        let evidence = Evidence { runs: &[record], windows: None };
        let statistics = evidence.statistics(record.outages.len());
        let judge = Judge { limits: [(1.0, 1.0); 2] };
        let verdict = Self::by(&judge, judge.kind(&statistics), &evidence, &statistics, f64::INFINITY);
        Self { beyond_linear, ..verdict }
    }

    fn by(
        judge: &Judge,
        kind: VerdictKind,
        evidence: &Evidence<'_>,
        statistics: &[Statistic],
        independent_runs: f64,
    ) -> Self {
        let worst = judge.worst(statistics, kind);
        let nees = evidence.mean(&|r| r.nees_mean);
        let coverage = evidence.mean(&|r| r.covered);
        Self {
            kind,
            nees: nees.value,
            nees_std_error: nees.std_error,
            coverage: coverage.value,
            coverage_std_error: coverage.std_error,
            worst_state: worst.name(),
            worst_outage: worst.outage,
            ratio: worst.ratio.value,
            ratio_std_error: worst.ratio.std_error,
            beyond_linear: None,
            independent_runs,
            detectable_ratio: judge.limits[0].1.max(1.0 + TOLERANCE),
            detectable_state_ratio: judge.limits[1].1.max(1.0 + TOLERANCE),
            level: LEVEL,
            tolerance: TOLERANCE,
        }
    }

    /// Whether it rests on covariance analysis, not on runs.
    #[must_use]
    pub const fn is_expected(&self) -> bool {
        self.independent_runs.is_infinite()
    }

    /// Whether the errors are of another order than the filter believes.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.nees > LOST
    }
}

/// A root mean square of normalised errors.
#[derive(Debug, Clone, Copy)]
struct Statistic {
    /// Reported state; none: all of them, by the NEES.
    state: Option<usize>,
    /// At the end of this outage; none: over the whole run.
    outage: Option<usize>,
    /// √(mean/degrees of freedom).
    ratio: Estimate,
}

impl Statistic {
    fn name(&self) -> StateName {
        self.state.map_or(ALL_STATES, |state| REPORTED_NAMES[state])
    }
}

/// The runs that count.
struct Evidence<'a> {
    runs: &'a [&'a RunRecord],
    windows: Option<f64>,
}

impl Evidence<'_> {
    fn mean(&self, value: &dyn Fn(&RunRecord) -> f64) -> Estimate {
        Estimate::mean_of(self.runs.iter().map(|r| value(r)), self.windows)
    }

    fn statistics(&self, outages: usize) -> Vec<Statistic> {
        let ratio = |value: &dyn Fn(&RunRecord) -> f64| self.mean(value).root();
        let mut all = Vec::new();
        let all_states = |r: &RunRecord| r.nees_mean / NEES_DOF as f64;
        all.push(Statistic { state: None, outage: None, ratio: ratio(&all_states) });
        for i in 0..REPORTED {
            all.push(Statistic { state: Some(i), outage: None, ratio: ratio(&|r| r.normalised_sq[i]) });
        }
        for k in 0..outages {
            let end = |value: &dyn Fn(&OutageRecord) -> f64| {
                // A record that is missing makes the statistic NaN, and NaN alarms in neither direction.
                ratio(&|r: &RunRecord| r.outages.get(k).map_or(f64::NAN, value))
            };
            let nees = end(&|o| o.nees_end / NEES_DOF as f64);
            all.push(Statistic { state: None, outage: Some(k), ratio: nees });
            for i in 0..REPORTED {
                // Normalised run by run with the run's own deviation: to first order it is the same in all of
                // them.
                let one = end(&|o| (o.error_end[i] / o.see_end[i]).powi(2));
                all.push(Statistic { state: Some(i), outage: Some(k), ratio: one });
            }
        }
        all
    }
}

/// The limits between which the ratios of a right filter lie.
struct Judge {
    /// Lower and upper limit of all states together, and of one state.
    limits: [(f64, f64); 2],
}

impl Judge {
    /// With probability `tail` beyond each limit.
    fn new(independent_runs: f64, tail: f64) -> Self {
        let limits = [NEES_DOF, 1].map(|dof| {
            // Of a right filter the square is χ² over its degrees of freedom; the ratio is its root.
            let band = chi_square_interval(dof, independent_runs, tail);
            let ratio = |mean: f64| (mean / dof as f64).sqrt();
            (ratio(band.lower), ratio(band.upper))
        });
        Self { limits }
    }

    /// Whether a statistic is significantly and materially off.
    fn of(&self, statistic: &Statistic) -> VerdictKind {
        let (lower, upper) = self.limits[usize::from(statistic.state.is_some())];
        let ratio = statistic.ratio.value;
        // Both: significant, since chance must not alarm; material, since with enough runs any linear filter
        // is wrong. Below, 1/1.1 is the same distance in the logarithm.
        if ratio > upper && ratio > 1.0 + TOLERANCE {
            VerdictKind::Overconfident
        } else if ratio < lower && ratio < 1.0 / (1.0 + TOLERANCE) {
            VerdictKind::Underconfident
        } else {
            VerdictKind::Ok
        }
    }

    /// Too much confidence anywhere is the graver fault.
    fn kind(&self, all: &[Statistic]) -> VerdictKind {
        let found: Vec<VerdictKind> = all.iter().map(|s| self.of(s)).collect();
        let faults = [VerdictKind::Overconfident, VerdictKind::Underconfident];
        faults.into_iter().find(|fault| found.contains(fault)).unwrap_or(VerdictKind::Ok)
    }

    /// The verdicts on outages, from the statistics at their ends.
    fn outages(&self, all: &[Statistic], outages: usize, diverged: bool) -> Vec<OutageVerdict> {
        let verdict_of_outage = |outage: usize| {
            let own: Vec<Statistic> = all.iter().filter(|s| s.outage == Some(outage)).copied().collect();
            let kind = if diverged { VerdictKind::Diverged } else { self.kind(&own) };
            let worst = self.worst(&own, kind);
            OutageVerdict {
                kind,
                worst_state: worst.name(),
                ratio: worst.ratio.value,
                ratio_std_error: worst.ratio.std_error,
            }
        };
        (0..outages).map(verdict_of_outage).collect()
    }

    /// The state that is farthest off in the direction of the verdict; of those that alarm, if any does. Where all
    /// states together alarm and none by itself does, it is they.
    fn worst(&self, all: &[Statistic], kind: VerdictKind) -> Statistic {
        let distance = |s: &Statistic| match kind {
            VerdictKind::Underconfident => -s.ratio.value.ln(),
            VerdictKind::Overconfident => s.ratio.value.ln(),
            VerdictKind::Ok | VerdictKind::Diverged => s.ratio.value.ln().abs(),
        };
        let key = |s: &&Statistic| (self.of(s) == kind, distance(s));
        let alarms = |s: &&Statistic| kind != VerdictKind::Ok && self.of(s) == kind;
        let alone = all.iter().filter(alarms).any(|s| s.state.is_some());
        let together = !alone && all.iter().filter(alarms).any(|s| s.state.is_none());
        let states = all.iter().filter(|s| s.state.is_none() == together);
        let farther = |a: &&Statistic, b: &&Statistic| {
            let (a, b) = (key(a), key(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        };
        states.max_by(farther).copied().unwrap_or(all[0])
    }
}

#[cfg(test)]
#[path = "verdict_tests.rs"]
mod tests;
