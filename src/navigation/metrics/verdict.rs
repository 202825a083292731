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

use super::estimate::{Estimate, SampleSize, chi_square_interval};
use crate::simulation::{NEES_DOF, REPORTED, REPORTED_NAMES, RunRecord, TOLERANCE};
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
#[derive(Debug, Clone, Copy, Default, Serialize)]
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
#[derive(Debug, Clone, Copy, Default, Serialize)]
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
    let independent_runs = SampleSize::of(kept.len() as u64, windows).independent;
    let statistics = statistics(&kept, outages, windows);
    let judge = Judge::new(independent_runs, statistics.len());
    let lost = (kept.len() < runs.len()).then_some(VerdictKind::Diverged);
    let kind = lost.unwrap_or_else(|| judge.kind(&statistics));
    let verdict = judge.verdict(kind, &statistics, (&kept, windows), independent_runs);
    (verdict, judge.outages(&statistics, outages, lost))
}

/// The same from the run whose squares are the expected ones: nothing is left to chance, and what is off by more than
/// the tolerance is wrong. Where errors are beyond linear theory, finding no fault is no proof.
pub(super) fn expected(
    record: &RunRecord,
    beyond_linear: Option<usize>,
) -> (Verdict, Vec<OutageVerdict>) {
    let (judge, outages) = (Judge::EXACT, record.outages.len());
    let statistics = statistics(&[record], outages, None);
    let kind = match judge.kind(&statistics) {
        VerdictKind::Consistent if beyond_linear.is_some() => VerdictKind::Doubtful,
        kind => kind,
    };
    let verdict = Verdict {
        beyond_linear,
        ..judge.verdict(kind, &statistics, (&[record], None), f64::INFINITY)
    };
    (verdict, judge.outages(&statistics, outages, None))
}

impl Verdict {
    /// From the records of the runs through a number of outages, those that diverged left out;
    /// `independent_windows` as in [`RunResult`](crate::simulation::RunResult).
    pub fn of(runs: &[RunRecord], outages: usize, independent_windows: Option<f64>) -> Self {
        judged(runs, outages, independent_windows).0
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
#[derive(Clone, Copy)]
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

/// All states together and each of them, over the whole run and at the end of each outage.
fn statistics(runs: &[&RunRecord], outages: usize, windows: Option<f64>) -> Vec<Statistic> {
    let square = |run: &RunRecord, outage: Option<usize>, state: Option<usize>| match outage {
        None => state.map_or(run.nees_mean / NEES_DOF as f64, |i| run.normalised_sq[i]),
        // A record that is missing makes the statistic NaN, and NaN alarms in neither direction.
        Some(k) => run.outages.get(k).map_or(f64::NAN, |end| {
            // Normalised run by run with the run's own deviation: to first order it is the same in all of them.
            let of_state = |i: usize| (end.error_end[i] / end.see_end[i]).powi(2);
            state.map_or(end.nees_end / NEES_DOF as f64, of_state)
        }),
    };
    let statistic = |outage, state| Statistic {
        state,
        outage,
        ratio: Estimate::mean_of(runs.iter().map(|r| square(r, outage, state)), windows).root(),
    };
    let some_and_each = |n: usize| std::iter::once(None).chain((0..n).map(Some));
    some_and_each(outages)
        .flat_map(|outage| some_and_each(REPORTED).map(move |state| (outage, state)))
        .map(|(outage, state)| statistic(outage, state))
        .collect()
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

    /// The verdict on runs of these statistics.
    fn verdict(
        &self,
        kind: VerdictKind,
        statistics: &[Statistic],
        (runs, windows): (&[&RunRecord], Option<f64>),
        independent_runs: f64,
    ) -> Verdict {
        let worst = self.worst(statistics, kind);
        let mean =
            |of: fn(&RunRecord) -> f64| Estimate::mean_of(runs.iter().map(|r| of(r)), windows);
        let (nees, coverage) = (mean(|r| r.nees_mean), mean(|r| r.covered));
        // Errors over standard deviations from which on it alarms: of all states together, of one state.
        let [detectable_ratio, detectable_state_ratio] =
            self.limits.map(|(_, upper)| upper.max(1.0 + TOLERANCE));
        Verdict {
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
            runs_to_decide: (kind == VerdictKind::Undecided)
                .then(|| Self::runs_to_decide(statistics.len())),
            level: LEVEL,
            tolerance: TOLERANCE,
        }
    }

    /// Whether it finds errors that matter.
    fn is_decisive(&self) -> bool {
        let limits = self.limits.iter().zip(DECISIVE);
        limits
            .into_iter()
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
        let found = all.iter().filter_map(|s| self.fault(s)).max();
        found.unwrap_or(match self.is_decisive() {
            true => VerdictKind::Consistent,
            false => VerdictKind::Undecided,
        })
    }

    /// The verdicts on outages, from the statistics at their ends.
    fn outages(
        &self,
        all: &[Statistic],
        outages: usize,
        lost: Option<VerdictKind>,
    ) -> Vec<OutageVerdict> {
        let verdict_of_outage = |outage: usize| {
            let own = all.iter().filter(|s| s.outage == Some(outage));
            let own: Vec<Statistic> = own.copied().collect();
            let kind = lost.unwrap_or_else(|| self.kind(&own));
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
        let alarms = |s: &Statistic| self.fault(s) == Some(kind);
        let alarmed = |alone: bool| all.iter().any(|s| s.state.is_some() == alone && alarms(s));
        let together = alarmed(false) && !alarmed(true);
        let states = all.iter().filter(|s| s.state.is_none() == together);
        let farther = |a: &&Statistic, b: &&Statistic| {
            let by_distance = distance(a).total_cmp(&distance(b));
            alarms(a).cmp(&alarms(b)).then(by_distance)
        };
        states.max_by(farther).copied().unwrap_or(all[0])
    }
}

#[cfg(test)]
#[path = "verdict_tests.rs"]
mod tests;
