//! Whether a filter is as good as it believes: one verdict, from the normalised errors of all runs.
//!
//! Statistics: NEES and (error/SEE)² of every reported state, as means over the whole run and at the end of
//! each outage. Of a right filter each is a mean of chi-square variables, one of 9 or of 1 degree of freedom
//! for each independent run. The epochs of one run hang together in a way nobody knows beforehand, so a mean
//! over epochs is given the freedom of a single epoch: an interval that holds whatever their correlation, exact
//! at the ends of outages. All statistics together alarm on a right filter with probability 1 % at most
//! (Bonferroni), and what is significant but smaller than 10 % is let pass.
//!
//! A filter that does not alarm is consistent only where the runs would have found errors that matter: 25 % above the
//! filter's standard deviations in all states together, 50 % in one of them. Fewer runs leave it undecided.

use super::estimate::{Estimate, chi_square_interval};
use crate::simulation::{NEES_DOF, OutageRecord, REPORTED, REPORTED_NAMES, RunRecord, TOLERANCE};
use serde::Serialize;

/// Probability at which a right filter is called wrong, all statistics together.
const LEVEL: f64 = 0.01;
/// Runs decide where errors so much larger than the filter's standard deviations would alarm: of all states together, of
/// one state.
const DECISIVE: [f64; 2] = [1.25, 1.5];
/// A mean NEES above this is not a matter of tuning: errors are of another order than the filter believes.
const FAR: f64 = 100.0;

/// Verdict on a filter in one word, the gravest last.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum VerdictKind {
    /// Errors are as large as the filter believes; other ones would have been found.
    #[default]
    Consistent,
    /// No fault was found, by runs too few to find one.
    Undecided,
    /// Errors are smaller than the filter believes.
    Underconfident,
    /// No fault was found by a method that does not hold here, or something else speaks against the result.
    Doubtful,
    /// Errors are larger than the filter believes.
    Overconfident,
    /// A limit that was required is not kept.
    NotMet,
    /// A state or covariance stopped being finite in at least one run.
    Diverged,
}

nav_sim_signal::named!(VerdictKind {
    Consistent = "consistent",
    Undecided = "undecided",
    Underconfident = "underconfident",
    Doubtful = "doubtful",
    Overconfident = "overconfident",
    NotMet = "not_met",
    Diverged = "diverged",
}, in files);

/// One of [`REPORTED_NAMES`], or [`ALL_STATES`].
pub type StateName = &'static str;

/// Stands for all states together, by their NEES, where they are off and no single one is.
pub const ALL_STATES: StateName = "all";

/// The verdict on the filter of an experiment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// In one word.
    pub kind: VerdictKind,
    /// Mean NEES over epochs and runs; 9 if the filter is right.
    pub nees: f64,
    /// Its Monte-Carlo standard error, from the scatter of the runs.
    pub nees_std_error: f64,
    /// Mean share of epochs inside the filter's ellipsoid.
    pub coverage: f64,
    /// Its Monte-Carlo standard error, from the scatter of the runs.
    pub coverage_std_error: f64,
    /// The state that is farthest off in the direction of the verdict, or [`ALL_STATES`].
    pub worst_state: StateName,
    /// The outage at whose end it is (from 0); none: over the whole run.
    pub worst_outage: Option<usize>,
    /// Root mean square there of error over standard deviation: 1 if the filter is right.
    pub ratio: f64,
    /// Its Monte-Carlo standard error.
    pub ratio_std_error: f64,
    /// Verdict by covariance analysis, where that was made beside the runs.
    pub by_covariance_analysis: Option<VerdictKind>,
    /// The first outage (from 0) in which errors are beyond linear theory, where covariance analysis does not hold.
    pub beyond_linear: Option<usize>,
    /// Runs that count as independent; infinitely many (null) of a covariance analysis.
    pub independent_runs: f64,
    /// The error over standard deviation, common to all states, from which on these runs would tell it.
    pub detectable_ratio: f64,
    /// The same of one state alone.
    pub detectable_state_ratio: f64,
    /// Independent runs that would decide; none (null) where the verdict is decided.
    pub runs_to_decide: Option<u64>,
    /// Probability at which a right filter is called wrong, all statistics together.
    pub level: f64,
    /// Errors that differ by less than this share from the filter's standard deviations are let pass.
    pub tolerance: f64,
}

/// The verdict on the filter at the end of one outage.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
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

/// Verdicts on the whole and on each outage, from the records of the runs through a number of outages, those that diverged left
/// out. No outage is called wrong where the filter is not. A run that diverged did so in every outage, since nobody knows when.
pub(super) fn judged(
    runs: &[RunRecord],
    outages: usize,
    windows: Option<f64>,
) -> (Verdict, Vec<OutageVerdict>) {
    let kept: Vec<&RunRecord> = runs.iter().filter(|r| !r.diverged).collect();
    let evidence = Evidence {
        runs: &kept,
        windows,
    };
    let statistics = evidence.statistics(outages);
    let independent_runs = evidence.independent_runs();
    let judge = Judge::new(independent_runs, statistics.len());
    let is_diverged = kept.len() < runs.len();
    let kind = match is_diverged {
        true => VerdictKind::Diverged,
        false => judge.kind(&statistics),
    };
    (
        Verdict::by(&judge, kind, &evidence, &statistics, independent_runs),
        judge.outages(&statistics, outages, is_diverged),
    )
}

/// The same from the run whose squares are the expected ones: nothing is left to chance, and what is off by more than
/// the tolerance is wrong. Where errors are beyond linear theory, finding no fault is no proof.
pub(super) fn expected(
    record: &RunRecord,
    beyond_linear: Option<usize>,
) -> (Verdict, Vec<OutageVerdict>) {
    let evidence = Evidence {
        runs: &[record],
        windows: None,
    };
    let statistics = evidence.statistics(record.outages.len());
    let kind = match Judge::EXACT.kind(&statistics) {
        VerdictKind::Consistent if beyond_linear.is_some() => VerdictKind::Doubtful,
        kind => kind,
    };
    let verdict = Verdict::by(&Judge::EXACT, kind, &evidence, &statistics, f64::INFINITY);
    (
        Verdict {
            beyond_linear,
            ..verdict
        },
        Judge::EXACT.outages(&statistics, record.outages.len(), false),
    )
}

impl Verdict {
    /// From the records of the runs through a number of outages, those that diverged left out;
    /// `independent_windows` as in [`RunResult`](crate::simulation::RunResult).
    pub fn of(runs: &[RunRecord], outages: usize, independent_windows: Option<f64>) -> Self {
        judged(runs, outages, independent_windows).0
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
        let [detectable_ratio, detectable_state_ratio] = judge.detectable();
        let is_undecided = kind == VerdictKind::Undecided;
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
            by_covariance_analysis: None,
            beyond_linear: None,
            independent_runs,
            detectable_ratio,
            detectable_state_ratio,
            runs_to_decide: is_undecided.then(|| Judge::runs_to_decide(statistics.len())),
            level: LEVEL,
            tolerance: TOLERANCE,
        }
    }

    /// Whether it rests on covariance analysis, not on runs.
    pub const fn is_expected(&self) -> bool {
        self.independent_runs.is_infinite()
    }

    /// Whether the errors are of another order than the filter believes.
    pub fn is_far_off(&self) -> bool {
        self.nees > FAR
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
    fn independent_runs(&self) -> f64 {
        self.windows
            .unwrap_or(f64::INFINITY)
            .min(self.runs.len() as f64)
    }

    fn mean(&self, value: &dyn Fn(&RunRecord) -> f64) -> Estimate {
        Estimate::mean_of(self.runs.iter().map(|r| value(r)), self.windows)
    }

    fn statistics(&self, outages: usize) -> Vec<Statistic> {
        let ratio = |value: &dyn Fn(&RunRecord) -> f64| self.mean(value).root();
        let mut all = Vec::new();
        let all_states = |r: &RunRecord| r.nees_mean / NEES_DOF as f64;
        all.push(Statistic {
            state: None,
            outage: None,
            ratio: ratio(&all_states),
        });
        for i in 0..REPORTED {
            all.push(Statistic {
                state: Some(i),
                outage: None,
                ratio: ratio(&|r| r.normalised_sq[i]),
            });
        }
        for k in 0..outages {
            let end = |value: &dyn Fn(&OutageRecord) -> f64| {
                // A record that is missing makes the statistic NaN, and NaN alarms in neither direction.
                ratio(&|r: &RunRecord| r.outages.get(k).map_or(f64::NAN, value))
            };
            let nees = end(&|o| o.nees_end / NEES_DOF as f64);
            all.push(Statistic {
                state: None,
                outage: Some(k),
                ratio: nees,
            });
            for i in 0..REPORTED {
                // Normalised run by run with the run's own deviation: to first order it is the same in all of
                // them.
                let one = end(&|o| (o.error_end[i] / o.see_end[i]).powi(2));
                all.push(Statistic {
                    state: Some(i),
                    outage: Some(k),
                    ratio: one,
                });
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
    /// Nothing is left to chance: the limits of significance close on 1, and the tolerance alone decides.
    const EXACT: Self = Self {
        limits: [(1.0, 1.0); 2],
    };

    /// Of so many independent runs and so many statistics on both sides.
    fn new(independent_runs: f64, statistics: usize) -> Self {
        let tail = LEVEL / (2.0 * statistics as f64);
        let limits = [NEES_DOF, 1].map(|dof| {
            // Of a right filter the square is χ² over its degrees of freedom; the ratio is its root.
            let band = chi_square_interval(dof, independent_runs, tail);
            let ratio = |mean: f64| (mean / dof as f64).sqrt();
            (ratio(band.lower), ratio(band.upper))
        });
        Self { limits }
    }

    /// Errors over standard deviations from which on it alarms: of all states together, of one state.
    fn detectable(&self) -> [f64; 2] {
        self.limits.map(|(_, upper)| upper.max(1.0 + TOLERANCE))
    }

    /// Whether it finds errors that matter.
    fn is_decisive(&self) -> bool {
        self.limits
            .iter()
            .zip(DECISIVE)
            .all(|((_, upper), limit)| *upper <= limit)
    }

    /// The fewest independent runs that decide, by bisection: the limits close on 1 as runs are added.
    fn runs_to_decide(statistics: usize) -> u64 {
        let decides = |runs: u64| Self::new(runs as f64, statistics).is_decisive();
        let (mut few, mut enough) = (0, 1);
        while !decides(enough) {
            (few, enough) = (enough, 2 * enough);
        }
        while enough - few > 1 {
            let middle = few.midpoint(enough);
            if decides(middle) {
                enough = middle
            } else {
                few = middle
            }
        }
        enough
    }

    /// Whether a statistic is significantly and materially off.
    fn fault(&self, statistic: &Statistic) -> Option<VerdictKind> {
        let (lower, upper) = self.limits[usize::from(statistic.state.is_some())];
        let ratio = statistic.ratio.value;
        // Both: significant, since chance must not alarm; material, since with enough runs any linear filter
        // is wrong. Below, 1/1.1 is the same distance in the logarithm.
        if ratio > upper && ratio > 1.0 + TOLERANCE {
            Some(VerdictKind::Overconfident)
        } else if ratio < lower && ratio < 1.0 / (1.0 + TOLERANCE) {
            Some(VerdictKind::Underconfident)
        } else {
            None
        }
    }

    /// Too much confidence anywhere is the graver fault.
    fn kind(&self, all: &[Statistic]) -> VerdictKind {
        let without_fault = if self.is_decisive() {
            VerdictKind::Consistent
        } else {
            VerdictKind::Undecided
        };
        all.iter()
            .filter_map(|s| self.fault(s))
            .max()
            .unwrap_or(without_fault)
    }

    /// The verdicts on outages, from the statistics at their ends.
    fn outages(&self, all: &[Statistic], outages: usize, diverged: bool) -> Vec<OutageVerdict> {
        let verdict_of_outage = |outage: usize| {
            let own: Vec<Statistic> = all
                .iter()
                .filter(|s| s.outage == Some(outage))
                .copied()
                .collect();
            let kind = if diverged {
                VerdictKind::Diverged
            } else {
                self.kind(&own)
            };
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
            _ => s.ratio.value.ln().abs(),
        };
        let alarms = |s: &&Statistic| self.fault(s) == Some(kind);
        let key = |s: &&Statistic| (alarms(s), distance(s));
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
