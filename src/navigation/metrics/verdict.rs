//! Verdict on the consistency of a filter, from the normalised errors of all runs.
//!
//! Statistics: NEES and (error/SEE)² of every reported state, as means over the whole run and at
//! the end of each outage. For a consistent filter each is a mean of chi-square variables, with 9
//! or 1 degrees of freedom per independent sample. For simulated runs a sample is a run: the epochs
//! of one run are correlated, so a mean over epochs gets the degrees of freedom of a single epoch,
//! an interval that holds for any correlation and is exact at the ends of outages. For one recorded
//! drive the errors themselves show their correlation time ([`SampleSize::of_series`]). All
//! statistics together alarm on a consistent filter with probability 1 % at most (Bonferroni), and
//! a significant difference below 10 % is not reported.
//!
//! A filter without an alarm is consistent only if the samples would have detected relevant errors:
//! 25 % above the filter's standard deviations in all states together, 50 % in one of them. With
//! fewer samples the verdict is undecided.

use super::estimate::{Estimate, PerState, SampleSize, chi_square_interval};
use crate::sensors::outage::Outage;
use crate::simulation::{NEES_DOF, OutageRecord, REPORTED, REPORTED_NAMES, RunRecord, TOLERANCE};
use serde::Serialize;

/// Probability at which a right filter is called wrong, all statistics together.
const LEVEL: f64 = 0.01;
/// Samples decide where errors so much larger than the filter's standard deviations would alarm: of all states together, of
/// one state.
const DECISIVE: [f64; 2] = [1.25, 1.5];
/// Fewer samples of a drive than these count as one where errors are smaller than stated.
const FEW: f64 = 10.0;
/// Level of the coverage of a recorded drive.
const COVERAGE: f64 = 0.95;
/// A mean NEES above this is not a matter of tuning: errors are of another order than the filter assumes.
const FAR: f64 = 100.0;

/// Verdict on a filter in one word, the gravest last.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum VerdictKind {
    /// Errors are as large as in the filter's model; other ones would have been found.
    #[default]
    Consistent,
    /// No fault was found, by samples too few to find one.
    Undecided,
    /// Errors are smaller than the filter assumes.
    Underconfident,
    /// No fault was found by a method that does not hold here, or something else speaks against the result.
    Doubtful,
    /// Errors are larger than the filter assumes.
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
    /// Kind of the samples.
    pub basis: Basis,
    /// Samples that count as independent; infinitely many (null) of a covariance analysis. Of a drive those of all states
    /// together.
    pub independent_samples: f64,
    /// The error over standard deviation, common to all states, from which on these samples would tell it.
    pub detectable_ratio: f64,
    /// Smallest error/σ that would be found in the state that is known least.
    pub detectable_state_ratio: f64,
    /// Factor on the number of samples that would decide; none (null) where the verdict is decided.
    pub times_to_decide: Option<f64>,
    /// Probability at which a right filter is called wrong, all statistics together.
    pub level: f64,
    /// Errors that differ by less than this share from the filter's standard deviations are let pass.
    pub tolerance: f64,
}

/// Kind of the samples of a verdict.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Basis {
    /// Simulated runs, each with noise of its own.
    #[default]
    Runs,
    /// Simulated runs on windows of a recording, of which only so many do not overlap.
    Windows,
    /// One recorded drive.
    Drive,
    /// Windows of a recorded drive in which fixes were withheld.
    Withheld,
    /// Covariance analysis.
    Expectation,
}

nav_sim_signal::named!(Basis {
    Runs = "runs",
    Windows = "windows",
    Drive = "drive",
    Withheld = "withheld",
    Expectation = "expectation",
}, in files);

/// The errors of a recorded drive at an instant, each over its standard deviation; NaN where one is not known.
#[derive(Debug, Clone, Copy)]
pub struct NormalisedErrors {
    /// Time (s).
    pub t_s: f64,
    /// In each reported state.
    pub over_sigma: [f64; REPORTED],
    /// Normalised by the covariance of the known states; none where correlations are not known.
    pub nees: Option<f64>,
}

/// The verdict on a recorded drive and what it is made of.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveVerdict {
    /// On the drive.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// Known states: the NEES of a right filter.
    pub nees_dof: usize,
    /// Root mean square of error over standard deviation in each state over the drive; NaN where not known.
    pub error_over_sigma: PerState<f64>,
    /// Its standard error.
    pub error_over_sigma_std_error: PerState<f64>,
    /// Samples that the errors of each state are worth.
    pub independent_samples: PerState<f64>,
    /// At the end of each outage, where there is one sample.
    pub outages: Vec<OutageVerdict>,
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
pub(super) fn verdicts(
    runs: &[RunRecord],
    outages: usize,
    windows: Option<f64>,
) -> (Verdict, Vec<OutageVerdict>) {
    let kept: Vec<&RunRecord> = runs.iter().filter(|r| !r.diverged).collect();
    let independent = SampleSize::of(kept.len() as u64, windows).independent;
    let judge = ConsistencyTest::of_runs(&kept, outages, windows, independent);
    let lost = (kept.len() < runs.len()).then_some(VerdictKind::Diverged);
    let kind = lost.unwrap_or_else(|| judge.kind(None));
    let basis = match windows {
        Some(windows) if windows < kept.len() as f64 => Basis::Windows,
        _ => Basis::Runs,
    };
    let verdict = Verdict {
        basis,
        independent_samples: independent,
        ..judge.verdict(kind, (&kept, windows))
    };
    (verdict, judge.outages(outages, lost))
}

/// Verdict from the run whose squares are the expected ones: nothing is left to chance, and what is off by more than
/// the tolerance is wrong. Where errors are beyond linear theory, finding no fault is no proof.
pub(super) fn expected(
    record: &RunRecord,
    beyond_linear: Option<usize>,
) -> (Verdict, Vec<OutageVerdict>) {
    let outages = record.outages.len();
    let judge = ConsistencyTest::of_runs(&[record], outages, None, f64::INFINITY);
    let kind = match judge.kind(None) {
        VerdictKind::Consistent if beyond_linear.is_some() => VerdictKind::Doubtful,
        kind => kind,
    };
    let verdict = Verdict {
        beyond_linear,
        basis: Basis::Expectation,
        independent_samples: f64::INFINITY,
        ..judge.verdict(kind, (&[record], None))
    };
    (verdict, judge.outages(outages, None))
}

impl Verdict {
    /// From the records of the runs through a number of outages, those that diverged left out;
    /// `independent_windows` as in [`RunResult`](crate::simulation::RunResult).
    pub fn of(runs: &[RunRecord], outages: usize, independent_windows: Option<f64>) -> Self {
        verdicts(runs, outages, independent_windows).0
    }

    /// The verdict on one recorded drive with outages: errors in order of time. None without errors over their standard
    /// deviations.
    pub fn of_drive(errors: &[NormalisedErrors], outages: &[Outage]) -> Option<DriveVerdict> {
        let column = |state: usize| errors.iter().map(move |e| e.over_sigma[state]);
        let known: Vec<usize> = (0..REPORTED)
            .filter(|state| column(*state).any(f64::is_finite))
            .collect();
        let size = |states: &[usize]| {
            let columns = states.iter().map(|state| column(*state));
            SampleSize::of_series(columns).independent
        };
        // Of standard deviations alone the sum of squares takes the place of the NEES. States whose errors hang together
        // are then worth fewer: of a sum of squares of covariance R, (tr R)² over as many states as tr R² (Satterthwaite).
        let has_covariance = errors.iter().any(|e| e.nees.is_some());
        let whole: Vec<&NormalisedErrors> = errors
            .iter()
            .filter(|e| known.iter().all(|state| e.over_sigma[*state].is_finite()))
            .collect();
        let moment = |i: usize, j: usize| {
            let products = whole.iter().map(|e| e.over_sigma[i] * e.over_sigma[j]);
            products.sum::<f64>()
        };
        let trace: f64 = known.iter().map(|i| moment(*i, *i)).sum();
        let pairs = known.iter().flat_map(|i| known.iter().map(move |j| (i, j)));
        let squares: f64 = pairs.map(|(i, j)| moment(*i, *j).powi(2)).sum();
        let together = match has_covariance {
            true => 1.0,
            false => (trace * trace / (known.len() as f64 * squares)).min(1.0),
        };
        let nees = |e: &NormalisedErrors| {
            let squares = || known.iter().map(|i| e.over_sigma[*i].powi(2)).sum();
            e.nees.unwrap_or_else(squares)
        };
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values
                .filter(|x| x.is_finite())
                .fold((0.0, 0), |(sum, n), x| (sum + x, n + 1));
            sum / f64::from(count)
        };
        let limit = chi_square_interval(known.len().max(1), 1.0, 1.0 - COVERAGE).upper;
        let end = |outage: &Outage| {
            let last = errors.iter().rfind(|e| outage.withholds(e.t_s));
            OutageRecord {
                error_end: last.map_or([f64::NAN; REPORTED], |e| e.over_sigma),
                see_end: [1.0; REPORTED],
                nees_end: last.map_or(f64::NAN, nees),
                ..OutageRecord::default()
            }
        };
        let record = RunRecord {
            nees_mean: mean(&mut whole.iter().map(|e| nees(e))),
            covered: mean(&mut whole.iter().map(|e| f64::from(u8::from(nees(e) <= limit)))),
            normalised_sq: std::array::from_fn(|i| mean(&mut column(i).map(|z| z * z))),
            outages: outages.iter().map(end).collect(),
            ..RunRecord::default()
        };
        if known.is_empty() {
            return None;
        }
        let independent = (size(&known) * together).max(1.0);
        let samples_of_state: [f64; REPORTED] = std::array::from_fn(|state| size(&[state]));
        let samples = |outage: Option<usize>, state: Option<usize>| match (outage, state) {
            (Some(_), _) => 1.0,
            (_, Some(state)) => samples_of_state[state],
            _ => independent,
        };
        let mut judge = ConsistencyTest::new(&[&record], outages.len(), None, known.len(), samples);
        // Slow errors that are small by chance leave fast ones, which look like many samples: one is sure.
        let tail = judge.tail;
        let few = judge.statistics.iter_mut();
        let few = few.filter(|s| s.freedom.1.min(independent) < FEW);
        few.for_each(|s| s.limits.0 = ratio_limits((s.freedom.0, 1.0), tail).0);
        // the scatter of the root of a chi-square mean
        for s in &mut judge.statistics {
            let degrees = s.freedom.0 as f64 * s.freedom.1;
            s.ratio.std_error = s.ratio.value * (0.5 / degrees).sqrt();
        }
        let verdict = judge.verdict(judge.kind(None), (&[&record], None));
        let degrees = known.len() as f64 * independent;
        let of_states = |of: fn(&Estimate) -> f64| {
            let mut values = [f64::NAN; REPORTED];
            let whole = judge.statistics.iter().filter(|s| s.outage.is_none());
            for (state, s) in whole.filter_map(|s| Some((s.state?, s))) {
                values[state] = of(&s.ratio);
            }
            PerState(values)
        };
        Some(DriveVerdict {
            error_over_sigma: of_states(|ratio| ratio.value),
            error_over_sigma_std_error: of_states(|ratio| ratio.std_error),
            independent_samples: PerState(samples_of_state),
            nees_dof: known.len(),
            outages: judge.outages(outages.len(), None),
            verdict: Self {
                basis: Basis::Drive,
                independent_samples: independent,
                nees_std_error: verdict.nees * (2.0 / degrees).sqrt(),
                coverage_std_error: (COVERAGE * (1.0 - COVERAGE) / independent).sqrt(),
                ..verdict
            },
        })
    }

    /// The verdict on normalised squares of this many degrees of freedom each, independent of one another; none without any.
    pub fn of_windows(squares: impl Iterator<Item = (f64, usize)>) -> Option<Self> {
        let (mut sum, mut degrees, mut windows) = (0.0, 0, 0.0);
        for (square, own) in squares {
            (sum, degrees, windows) = (sum + square, degrees + own, windows + 1.0);
        }
        let (tail, freedom) = (0.5 * LEVEL, (degrees, 1.0));
        let ratio = (sum / degrees as f64).sqrt();
        let together = Statistic {
            state: None,
            outage: None,
            ratio: Estimate {
                value: ratio,
                std_error: ratio * (0.5 / degrees as f64).sqrt(),
            },
            freedom,
            limits: ratio_limits(freedom, tail),
        };
        let judge = ConsistencyTest {
            statistics: vec![together],
            tail,
        };
        let record = RunRecord {
            nees_mean: sum / windows,
            covered: f64::NAN,
            ..RunRecord::default()
        };
        (degrees > 0).then(|| Self {
            basis: Basis::Withheld,
            independent_samples: windows,
            ..judge.verdict(judge.kind(None), (&[&record], None))
        })
    }

    /// Returns true if it rests on covariance analysis instead of runs.
    pub fn is_expected(&self) -> bool {
        self.basis == Basis::Expectation
    }

    /// Returns true if the errors exceed the filter's sigma by an order of magnitude.
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
    /// Degrees of freedom of a sample, and independent samples.
    freedom: (usize, f64),
    /// Between these the ratio of a right filter lies.
    limits: (f64, f64),
}

impl Statistic {
    fn name(&self) -> StateName {
        self.state.map_or(ALL_STATES, |state| REPORTED_NAMES[state])
    }

    /// The error over standard deviation from which on it alarms.
    fn detectable(&self) -> f64 {
        self.limits.1.max(1.0 + TOLERANCE)
    }
}

/// Between which a right filter's root mean square of this many degrees of freedom lies but with probability `tail` on
/// either side.
fn ratio_limits((dof, samples): (usize, f64), tail: f64) -> (f64, f64) {
    if samples.is_infinite() {
        return (1.0, 1.0); // nothing is left to chance: the tolerance alone decides
    }
    // Of a right filter the square is χ² over its degrees of freedom; the ratio is its root.
    let band = chi_square_interval(dof, samples, tail);
    let ratio = |mean: f64| (mean / dof as f64).sqrt();
    (ratio(band.lower), ratio(band.upper))
}

/// The statistics of some samples and what a right filter's are.
struct ConsistencyTest {
    /// All states together and each of them, over the whole run and at the end of each outage.
    statistics: Vec<Statistic>,
    /// Probability that one of them is beyond a limit.
    tail: f64,
}

impl ConsistencyTest {
    /// For runs that all count alike.
    fn of_runs(
        runs: &[&RunRecord],
        outages: usize,
        windows: Option<f64>,
        independent: f64,
    ) -> Self {
        Self::new(runs, outages, windows, NEES_DOF, |_, _| independent)
    }

    /// For so many reported states; `samples`: how many are independent, of an outage (none: of the whole) and a state
    /// (none: of all together).
    fn new(
        runs: &[&RunRecord],
        outages: usize,
        windows: Option<f64>,
        states: usize,
        samples: impl Fn(Option<usize>, Option<usize>) -> f64,
    ) -> Self {
        let square = |run: &RunRecord, outage: Option<usize>, state: Option<usize>| match outage {
            None => state.map_or(run.nees_mean / states as f64, |i| run.normalised_sq[i]),
            // A record that is missing makes the statistic NaN, and NaN alarms in neither direction.
            Some(k) => run.outages.get(k).map_or(f64::NAN, |end| {
                // Normalised run by run with the run's own deviation: to first order it is the same in all of them.
                let of_state = |i: usize| (end.error_end[i] / end.see_end[i]).powi(2);
                state.map_or(end.nees_end / states as f64, of_state)
            }),
        };
        let some_and_each = |n: usize| std::iter::once(None).chain((0..n).map(Some));
        let places: Vec<_> = some_and_each(outages)
            .flat_map(|outage| some_and_each(REPORTED).map(move |state| (outage, state)))
            .collect();
        let tail = LEVEL / (2.0 * places.len() as f64);
        let statistic = |(outage, state): (Option<usize>, Option<usize>)| {
            let squares = runs.iter().map(|r| square(r, outage, state));
            let dof = if state.is_none() { states } else { 1 };
            let freedom = (dof, samples(outage, state));
            Statistic {
                state,
                outage,
                ratio: Estimate::mean_of(squares, windows).root(),
                freedom,
                limits: ratio_limits(freedom, tail),
            }
        };
        Self {
            statistics: places.into_iter().map(statistic).collect(),
            tail,
        }
    }

    /// The statistics of an outage; none: all.
    fn of(&self, outage: Option<usize>) -> impl Iterator<Item = &Statistic> + Clone {
        let is_of = move |s: &&Statistic| outage.is_none_or(|k| s.outage == Some(k));
        self.statistics.iter().filter(is_of)
    }

    /// The statistics over the whole run, or, of an outage, its own.
    fn deciding(&self, outage: Option<usize>) -> impl Iterator<Item = &Statistic> + Clone {
        let is_known = move |s: &&Statistic| s.outage == outage && !s.ratio.value.is_nan();
        self.statistics.iter().filter(is_known)
    }

    /// The verdict on runs of these statistics.
    fn verdict(&self, kind: VerdictKind, (runs, windows): (&[&RunRecord], Option<f64>)) -> Verdict {
        let worst = self.worst(None, kind);
        let mean =
            |of: fn(&RunRecord) -> f64| Estimate::mean_of(runs.iter().map(|r| of(r)), windows);
        let (nees, coverage) = (mean(|r| r.nees_mean), mean(|r| r.covered));
        let detectable = |is_state: bool| {
            let own = self
                .deciding(None)
                .filter(|s| s.state.is_some() == is_state);
            own.map(Statistic::detectable)
                .fold(1.0 + TOLERANCE, f64::max)
        };
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
            detectable_ratio: detectable(false),
            detectable_state_ratio: detectable(true),
            times_to_decide: (kind == VerdictKind::Undecided).then(|| self.times_to_decide()),
            level: LEVEL,
            tolerance: TOLERANCE,
            ..Verdict::default()
        }
    }

    /// True if so many times the samples find errors that matter.
    fn is_decisive(&self, outage: Option<usize>, times: f64) -> bool {
        // Without a statistic, as in an outage between two rows of a solution, nothing is decided.
        let mut own = self.deciding(outage).peekable();
        own.peek().is_some()
            && own.all(|s| {
                let freedom = (s.freedom.0, s.freedom.1 * times);
                ratio_limits(freedom, self.tail).1 <= DECISIVE[usize::from(s.state.is_some())]
            })
    }

    /// The fewest times the samples that decide, by bisection: the limits close on 1 as samples are added.
    fn times_to_decide(&self) -> f64 {
        let (mut few, mut enough) = (1.0, 2.0);
        while !self.is_decisive(None, enough) && enough < 1e9 {
            (few, enough) = (enough, 2.0 * enough);
        }
        while enough - few > 1e-9 * enough {
            let middle = f64::midpoint(few, enough);
            if self.is_decisive(None, middle) {
                enough = middle;
            } else {
                few = middle;
            }
        }
        enough
    }

    /// Verdict of a statistic that is off both significantly and materially; else none.
    fn fault(statistic: &Statistic) -> Option<VerdictKind> {
        let (lower, upper) = statistic.limits;
        let ratio = statistic.ratio.value;
        // Both: significant, since chance must not alarm; material, since with enough samples any linear filter
        // is wrong. Below, 1/1.1 is the same distance in the logarithm.
        if ratio > upper && ratio > 1.0 + TOLERANCE {
            Some(VerdictKind::Overconfident)
        } else if ratio < lower && ratio < 1.0 / (1.0 + TOLERANCE) {
            Some(VerdictKind::Underconfident)
        } else {
            None
        }
    }

    /// Too much confidence anywhere is the graver fault. Of an outage; none: of all.
    fn kind(&self, outage: Option<usize>) -> VerdictKind {
        let found = self.of(outage).filter_map(Self::fault).max();
        found.unwrap_or(match self.is_decisive(outage, 1.0) {
            true => VerdictKind::Consistent,
            false => VerdictKind::Undecided,
        })
    }

    /// The verdicts on outages, from the statistics at their ends.
    fn outages(&self, outages: usize, lost: Option<VerdictKind>) -> Vec<OutageVerdict> {
        let verdict_of_outage = |outage: usize| {
            let kind = lost.unwrap_or_else(|| self.kind(Some(outage)));
            let worst = self.worst(Some(outage), kind);
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
    fn worst(&self, outage: Option<usize>, kind: VerdictKind) -> Statistic {
        let distance = |s: &Statistic| {
            let distance = match kind {
                VerdictKind::Underconfident => -s.ratio.value.ln(),
                VerdictKind::Overconfident => s.ratio.value.ln(),
                _ => s.ratio.value.ln().abs(),
            };
            // what is not known is nowhere farthest
            if distance.is_nan() {
                f64::NEG_INFINITY
            } else {
                distance
            }
        };
        let all = self.of(outage);
        let alarms = |s: &Statistic| Self::fault(s) == Some(kind);
        let alarmed = |alone: bool| {
            let mut own = all.clone().filter(|s| s.state.is_some() == alone);
            own.any(alarms)
        };
        let together = alarmed(false) && !alarmed(true);
        let states = all.filter(|s| s.state.is_none() == together);
        let farther = |a: &&Statistic, b: &&Statistic| {
            let by_distance = distance(a).total_cmp(&distance(b));
            alarms(a).cmp(&alarms(b)).then(by_distance)
        };
        states
            .max_by(farther)
            .copied()
            .unwrap_or(self.statistics[0])
    }
}

#[cfg(test)]
#[path = "verdict_tests.rs"]
mod tests;
