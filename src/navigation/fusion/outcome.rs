//! Figures of a fusion: fixes used, consistency, errors at the ends of outages. They serialize as `summary.json` has them.

use super::{
    AidInnovations, FixRecord, Nine, RowError, Solution, SolutionRow, WeightedSolution,
    WithheldWindows, aid_innovations, horizontal,
};
use crate::linalg::{by_value, mean, median};
use crate::metrics::{DriveVerdict, NormalisedErrors, PerState, Verdict, VerdictKind};
use crate::sensors::outage::Outage;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Distance at the end of an outage, and what the filter states of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EndError {
    /// Horizontal distance (m).
    pub horizontal_m: f64,
    /// Difference down (m).
    down_m: f64,
    /// Horizontal standard deviation that the filter states (m).
    pub expected_sigma_m: f64,
}

/// Errors at the end of an outage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutageDrift {
    /// The outage.
    #[serde(flatten)]
    pub outage: Outage,
    /// Fixes that were withheld.
    pub fixes_withheld: usize,
    /// True if a fix follows it.
    followed_by_fix: bool,
    /// Against the first fix after it (the last withheld one, when none follows).
    pub end_from_fix: Option<EndError>,
    /// Against the reference at that time.
    pub end_from_reference: Option<EndError>,
}

/// Innovations of the fixes that end outages and gaps: unlike those of consecutive fixes they test the free-inertial
/// drift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutageEnds {
    /// Number of outages and gaps.
    pub count: usize,
    /// Root mean square of the horizontal error over its standard deviation: 1 if right.
    pub error_over_sigma: f64,
    /// Probability of as large a one if right.
    pub p_value: f64,
}

/// Fixes by what became of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FixCounts {
    /// Used.
    pub used: usize,
    /// In an outage.
    pub withheld: usize,
    /// Beyond the gate.
    pub rejected: usize,
}

/// Fixes that the gate rejected.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outliers {
    /// Share of the fixes that were not withheld.
    pub share: f64,
    /// Their times (s).
    pub t_s: Vec<f64>,
    /// Times at which so many were rejected in a row that the gate was opened (s).
    pub gate_reopened_s: Vec<f64>,
}

/// Figures of a solution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FusionFigures {
    /// Fixes.
    pub fixes: FixCounts,
    /// Mean NIS of the fixes used or rejected, divided by their number of components: 1 if all is as believed. A rejected
    /// one counts as much as the gate lets pass.
    pub nis_per_component: f64,
    /// Outliers, where there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outliers: Option<Outliers>,
    /// Errors at the end of each outage.
    pub outages: Vec<OutageDrift>,
    /// The ends of all outages and gaps, where there are any.
    pub ends: Option<OutageEnds>,
    /// Differences of the rows from the reference, where one reaches them.
    pub reference: Option<FromReference>,
    /// Figures of the smoothed solution, where there is one.
    pub smoothed: Option<SmoothedOutcome>,
}

/// Differences of rows from a reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FromReference {
    /// Root mean square in each state.
    pub rmse: PerState<f64>,
    /// RMSE of the horizontal distance (m).
    pub horizontal_rmse_m: f64,
    /// Largest horizontal distance (m).
    pub horizontal_max_m: f64,
    /// Root mean square of the difference over its standard deviation in each state: 1 if both are right.
    pub error_over_sigma: PerState<f64>,
    /// Mean NEES.
    pub nees_mean: f64,
    /// Degrees of freedom of the NEES: its mean if both are right.
    nees_dof: usize,
    /// Root mean square of the standard deviation of the reference's velocity, which the NEES
    /// includes (m/s).
    pub velocity_sigma_m_s: f64,
    /// Verdict on the errors over their standard deviations.
    pub verdict: Option<DriveVerdict>,
}

/// Figures of a smoothed solution beside the filter's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SmoothedOutcome {
    /// Root mean square of the smoothed horizontal standard deviation (m).
    pub horizontal_sigma_rms_m: f64,
    /// Root mean square of the filter's horizontal standard deviation (m).
    horizontal_sigma_rms_filter_m: f64,
    /// Differences of the smoothed rows from the reference.
    pub reference: Option<FromReference>,
    /// The outages in which there are rows.
    pub outages: Vec<SmoothedOutage>,
}

/// The largest of the rows in an outage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SmoothedOutage {
    /// The outage.
    #[serde(flatten)]
    pub outage: Outage,
    /// Smoothed horizontal standard deviation (m).
    pub sigma_max_m: f64,
    /// The filter's (m).
    pub sigma_max_filter_m: f64,
    /// Smoothed horizontal distance from the reference (m).
    pub horizontal_max_m: Option<f64>,
    /// The filter's (m).
    pub horizontal_max_filter_m: Option<f64>,
}

/// Figures of a solution: fixes, NIS, errors at the ends of outages and against the reference.
pub fn outcome(solution: &Solution, outages: &[Outage]) -> FusionFigures {
    let outliers = outliers(solution);
    let rejected = outliers.as_ref().map_or(0, |outliers| outliers.t_s.len());
    let used = solution.fixes.iter().filter(|f| f.used).count();
    FusionFigures {
        fixes: FixCounts {
            used,
            withheld: solution.fixes.len() - used - rejected,
            rejected,
        },
        outliers,
        nis_per_component: nis_per_component(solution),
        outages: outages.iter().map(|o| drift(solution, *o)).collect(),
        ends: ends(solution),
        reference: from_reference(&solution.rows, outages),
        smoothed: solution
            .smoothed
            .as_ref()
            .map(|rows| smoothed(&solution.rows, rows, outages)),
    }
}

fn outliers(solution: &Solution) -> Option<Outliers> {
    let rejected = not_withheld(solution).filter(|f| !f.used);
    let t_s: Vec<f64> = rejected.map(|f| f.t_s).collect();
    (!t_s.is_empty()).then(|| Outliers {
        share: t_s.len() as f64 / not_withheld(solution).count() as f64,
        t_s,
        gate_reopened_s: solution.gate_reopened_s.clone(),
    })
}

/// Shortest gap between fixes that counts as an outage (s), and in median fix intervals.
pub(super) const APART: (f64, f64) = (10.0, 5.0);

/// Innovations of the fixes that end an outage or gap. Under a consistent filter the sum of m horizontal NIS is
/// chi-square with 2m degrees of freedom.
fn ends(solution: &Solution) -> Option<OutageEnds> {
    let known: Vec<&FixRecord> = solution.fixes.iter().filter(|f| f.used).collect();
    let steps = known.windows(2).map(|w| w[1].t_s - w[0].t_s);
    let apart_s = APART.0.max(APART.1 * median(steps)?);
    let of_ends: Vec<f64> = known
        .windows(2)
        .filter(|w| w[1].t_s - w[0].t_s > apart_s)
        .map(|w| w[1].horizontal_nis)
        .collect();
    let (count, sum) = (of_ends.len(), of_ends.iter().sum::<f64>());
    let degrees = 2.0 * count as f64;
    let p_value = ChiSquared::new(degrees).ok()?.sf(sum);
    Some(OutageEnds {
        count,
        error_over_sigma: (sum / degrees).sqrt(),
        p_value,
    })
}

/// Mean NIS of the fixes used or rejected, divided by their number of components.
pub(super) fn nis_per_component(solution: &Solution) -> f64 {
    let (nis, components) = total_nis(not_withheld(solution));
    nis / components as f64
}

/// Sum of the NIS of fixes, and of how many components.
pub(super) fn total_nis<'a>(fixes: impl Iterator<Item = &'a FixRecord>) -> (f64, usize) {
    fixes.fold((0.0, 0), |(nis, components), fix| {
        let counted = fix.nis.min(fix.rejected_above.unwrap_or(f64::INFINITY));
        (nis + counted, components + fix.innovation.len())
    })
}

fn from_reference(rows: &[SolutionRow], outages: &[Outage]) -> Option<FromReference> {
    let errors: Vec<RowError> = rows.iter().filter_map(|row| row.error).collect();
    let rms = |of: &dyn Fn(&RowError) -> f64| mean(errors.iter().map(|e| of(e).powi(2))).sqrt();
    let per_state =
        |of: &dyn Fn(&RowError, usize) -> f64| std::array::from_fn(|i| rms(&|e| of(e, i)));
    let rmse: Nine = per_state(&|e, i| e.values[i]);
    let normalised = |row: &SolutionRow| {
        let e = row.error?;
        Some(NormalisedErrors {
            t_s: row.t_s,
            over_sigma: std::array::from_fn(|i| e.values[i] / e.sigma[i]),
            nees: Some(e.nees),
        })
    };
    let normalised: Vec<NormalisedErrors> = rows.iter().filter_map(normalised).collect();
    (!errors.is_empty()).then(|| FromReference {
        verdict: Verdict::of_drive(&normalised, outages),
        rmse: PerState(rmse),
        horizontal_rmse_m: horizontal(&rmse),
        horizontal_max_m: errors
            .iter()
            .map(|e| horizontal(&e.values))
            .fold(0.0, f64::max),
        error_over_sigma: PerState(per_state(&|e, i| {
            e.values[i] / e.sigma[i].max(f64::MIN_POSITIVE)
        })),
        nees_mean: mean(errors.iter().map(|e| e.nees)),
        nees_dof: rmse.len(),
        velocity_sigma_m_s: rms(&|e| e.velocity_sigma),
    })
}

fn smoothed(
    filtered: &[SolutionRow],
    smoothed: &[SolutionRow],
    outages: &[Outage],
) -> SmoothedOutcome {
    let sigma_rms = |rows: &[SolutionRow]| {
        let squares = rows.iter().map(|row| horizontal(&row.sigma).powi(2));
        mean(squares).sqrt()
    };
    let of_outage = |outage: &Outage| {
        let [
            (sigma_max_filter_m, horizontal_max_filter_m),
            (sigma_max_m, horizontal_max_m),
        ] = [largest(filtered, outage)?, largest(smoothed, outage)?];
        let outage = *outage;
        Some(SmoothedOutage {
            outage,
            sigma_max_m,
            sigma_max_filter_m,
            horizontal_max_m,
            horizontal_max_filter_m,
        })
    };
    let reference = from_reference(smoothed, outages);
    SmoothedOutcome {
        horizontal_sigma_rms_m: sigma_rms(smoothed),
        horizontal_sigma_rms_filter_m: sigma_rms(filtered),
        reference,
        outages: outages.iter().filter_map(of_outage).collect(),
    }
}

/// Largest horizontal standard deviation of the rows in an outage and distance from the reference; none without rows.
fn largest(rows: &[SolutionRow], outage: &Outage) -> Option<(f64, Option<f64>)> {
    let within = || rows.iter().filter(|row| outage.withholds(row.t_s));
    let error = within()
        .filter_map(|row| Some(horizontal(&row.error?.values)))
        .reduce(f64::max);
    Some((
        within()
            .map(|row| horizontal(&row.sigma))
            .reduce(f64::max)?,
        error,
    ))
}

fn drift(solution: &Solution, outage: Outage) -> OutageDrift {
    let withheld = || solution.fixes.iter().filter(|f| outage.withholds(f.t_s));
    let after = solution.fixes.iter().find(|f| f.t_s + 1e-9 >= outage.end_s);
    let last = after.or(withheld().next_back());
    let end_from_fix = last.map(|f| EndError {
        horizontal_m: f.innovation[0].hypot(f.innovation[1]),
        down_m: f.innovation[2],
        expected_sigma_m: f.sigma[0].hypot(f.sigma[1]),
    });
    let end_from_reference = last.and_then(|f| {
        let error = f.error?;
        let (horizontal_m, expected_sigma_m) = (horizontal(&error), f.horizontal_sigma_m);
        Some(EndError {
            horizontal_m,
            down_m: error[2],
            expected_sigma_m,
        })
    });
    OutageDrift {
        outage,
        fixes_withheld: withheld().count(),
        followed_by_fix: after.is_some(),
        end_from_fix,
        end_from_reference,
    }
}

// Worth of a solution: by its own innovations, and by a reference where there is one.

/// NIS per component above which a solution is doubtful (innovations √2 times as large as stated), and overconfident
/// (twice). The sigmas that receivers state are off by such factors; right solutions of real drives have a NIS below
/// 1.5, most of them far below 1.
const NIS_LIMITS: (f64, f64) = (2.0, 4.0);
/// NIS per component below which the stated sigmas of the fixes are too large to decide.
const NIS_LOW: f64 = 0.5;
/// Components with which the mean NIS of a consistent filter stays below the first limit.
const MIN_COMPONENTS: usize = 50;
/// Stretch in which the NIS is examined by itself (s), and the share of bad ones that is too much.
const STRETCH_S: f64 = 60.0;
const BAD_STRETCHES: f64 = 0.1;
/// Evidence on a solution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "evidence", rename_all = "snake_case")]
pub enum Finding {
    /// No fix was used.
    NoFix,
    /// The fixes of the minute after the start contradict it, and every other that was tried.
    Start {
        /// Their NIS divided by the number of components.
        nis_per_component: f64,
    },
    /// The fixes do not tell whether the vehicle goes forwards or backwards: forwards is taken.
    Direction,
    /// Axes of the IMU that are hardly front, right, down.
    NotLevel {
        /// Roll at the start (degrees).
        roll_deg: f64,
        /// Pitch (degrees).
        pitch_deg: f64,
    },
    /// Errors of the fixes that last.
    Correlated {
        /// Autocorrelation of the innovations from one fix to the next, of position or velocity.
        lag_1: f64,
        /// Factor on the stated standard deviation of position in the filter.
        pos_sigma_factor: f64,
        /// Factor on the standard deviation of velocity.
        vel_sigma_factor: f64,
    },
    /// Mean NIS of the fixes used.
    Nis {
        /// Divided by the number of components: 1 if right.
        per_component: f64,
    },
    /// Minutes in which most fixes are too far from the solution.
    Minutes {
        /// Number of such minutes.
        bad: usize,
        /// All minutes with fixes.
        of: usize,
        /// Beginning of the worst (s).
        worst_s: f64,
        /// NIS per component of the nearest nine tenths of its fixes.
        nis_per_component: f64,
    },
    /// Mean NIS of what the vehicle knows.
    Aid {
        /// Name as in [`super::AidInnovations`].
        aid: &'static str,
        /// Divided by the number of components: 1 if right.
        nis_per_component: f64,
    },
    /// Errors at the ends of outages and gaps.
    Ends(OutageEnds),
    /// Errors against the reference.
    Reference {
        /// Verdict on them.
        verdict: Verdict,
    },
    /// Errors at the ends of windows in which fixes were withheld.
    Withheld(WithheldWindows),
}

/// Verdict and the findings it rests on.
#[derive(Debug, Clone)]
pub struct FusionAssessment {
    /// The gravest of the findings.
    pub verdict: VerdictKind,
    /// Findings, the gravest first.
    pub findings: Vec<(VerdictKind, Finding)>,
}

/// The largest mean NIS per component that is `limit` or chance: five standard deviations of the mean of
/// chi-squares.
fn bound(limit: f64, components: usize) -> f64 {
    limit.max(1.0 + 5.0 * (2.0 / components.max(1) as f64).sqrt())
}

/// Mean NIS per component above which a solution is overconfident.
pub(super) fn nis_bound(components: usize) -> f64 {
    bound(NIS_LIMITS.1, components)
}

/// Judges a solution: its fixes with standard deviations as stated, its errors as believed. `of_start` is what speaks
/// against the start, as the alignment found it, `withheld` the errors at the ends of withheld windows.
pub fn assess(
    weighed: &WeightedSolution,
    outcome: &FusionFigures,
    of_start: &[(VerdictKind, Finding)],
    withheld: Option<WithheldWindows>,
) -> FusionAssessment {
    let mut findings = of_start.to_vec();
    let of_fixes = weighed.with_stated_sigmas();
    let correlated = correlated(weighed);
    findings.push(match (nis(of_fixes), correlated) {
        // time-correlated fix errors make the NIS low even if the stated sigmas are right
        ((VerdictKind::Undecided, Finding::Nis { .. }), Some(correlated)) => correlated,
        (nis, _) => nis,
    });
    findings.extend(correlated.filter(|found| !findings.contains(found)));
    findings.extend(stretches(of_fixes));
    findings.extend(aids(of_fixes));
    findings.extend(ends_finding(outcome));
    let of_reference = outcome.reference.as_ref().and_then(|r| r.verdict.as_ref());
    let of_reference = of_reference.map(|found| {
        let verdict = found.verdict;
        (verdict.kind, Finding::Reference { verdict })
    });
    let of_windows = withheld.map(|found| (found.verdict.kind, Finding::Withheld(found)));
    let errors: Vec<_> = of_windows.into_iter().chain(of_reference).collect();
    // errors against a reference, or at withheld fixes, outweigh innovations: their undecided findings are dropped
    let is_told = |finding: &Finding| matches!(finding, Finding::Correlated { .. });
    if !errors.is_empty() {
        // windows show what the IMU does, and not that the fixes are better than stated
        let is_open = correlated.is_none() && outcome.reference.is_none();
        let is_low = |finding: &Finding| matches!(finding, Finding::Nis { per_component } if *per_component < NIS_LOW);
        findings.retain(|(verdict, finding)| {
            *verdict != VerdictKind::Undecided && !is_told(finding) || is_open && is_low(finding)
        });
    }
    let decides = errors
        .iter()
        .any(|(kind, _)| *kind == VerdictKind::Consistent);
    findings.extend(
        errors
            .into_iter()
            .filter(|(kind, _)| !(decides && *kind == VerdictKind::Undecided)),
    );
    findings.sort_by_key(|(verdict, _)| std::cmp::Reverse(*verdict));
    let verdict = findings
        .first()
        .map_or(VerdictKind::Consistent, |(verdict, _)| *verdict);
    FusionAssessment { verdict, findings }
}

/// Returns true if the fixes contradict a solution.
pub(super) fn is_contradicted(solution: &Solution, of_start: &[(VerdictKind, Finding)]) -> bool {
    let found = [Some(nis(solution)), stretches(solution)];
    of_start
        .iter()
        .chain(found.iter().flatten())
        .any(|(verdict, _)| *verdict == VerdictKind::Overconfident)
}

/// Errors that last: standard deviations as stated are then too small.
fn correlated(weighed: &WeightedSolution) -> Option<(VerdictKind, Finding)> {
    let lag_1 = weighed.correlation()?;
    let [pos_sigma_factor, vel_sigma_factor] = weighed.sigma_factors;
    let verdict = match pos_sigma_factor.max(vel_sigma_factor) > 1.0 {
        true => VerdictKind::Undecided,
        false => VerdictKind::Doubtful,
    };
    let found = Finding::Correlated {
        lag_1,
        pos_sigma_factor,
        vel_sigma_factor,
    };
    Some((verdict, found))
}

/// Fixes that were not withheld: used, or rejected by the gate.
pub(super) fn not_withheld(solution: &Solution) -> impl Iterator<Item = &FixRecord> {
    let fixes = solution.fixes.iter();
    fixes.filter(|f| f.used || f.rejected_above.is_some())
}

fn nis(solution: &Solution) -> (VerdictKind, Finding) {
    let (nis, components) = total_nis(not_withheld(solution));
    let per_component = nis / components as f64;
    let verdict = match per_component {
        _ if components == 0 => return (VerdictKind::Doubtful, Finding::NoFix),
        nis if nis > nis_bound(components) => VerdictKind::Overconfident,
        nis if nis > bound(NIS_LIMITS.0, components) => VerdictKind::Doubtful,
        nis if nis < NIS_LOW || components < MIN_COMPONENTS => VerdictKind::Undecided,
        _ => VerdictKind::Consistent,
    };
    (verdict, Finding::Nis { per_component })
}

/// Aids that are farther from the solution than stated.
fn aids(solution: &Solution) -> impl Iterator<Item = (VerdictKind, Finding)> {
    let is_far = |w: &AidInnovations| w.nis_per_component > NIS_LIMITS.0.max(w.nis_band.upper);
    aid_innovations(&solution.aids)
        .into_iter()
        .filter(is_far)
        .map(|w| {
            let (aid, nis_per_component) = (w.aid, w.nis_per_component);
            let found = Finding::Aid {
                aid,
                nis_per_component,
            };
            (VerdictKind::Doubtful, found)
        })
}

/// Minutes in which most fixes are far from what is stated. The farthest tenth of them is left out: single
/// wild fixes are the receiver's.
fn stretches(solution: &Solution) -> Option<(VerdictKind, Finding)> {
    let begin_s = not_withheld(solution).next()?.t_s;
    let mut minutes: Vec<Vec<&FixRecord>> = Vec::new();
    for fix in not_withheld(solution) {
        let minute = ((fix.t_s - begin_s) / STRETCH_S) as usize;
        minutes.resize(minutes.len().max(minute + 1), Vec::new());
        minutes[minute].push(fix);
    }
    let of = minutes.iter().filter(|m| !m.is_empty()).count();
    let bad: Vec<(usize, f64)> = minutes
        .iter()
        .enumerate()
        .filter_map(|(k, fixes)| Some((k, trimmed_nis_if_too_large(fixes)?)))
        .collect();
    let (worst, nis_per_component) = *bad.iter().max_by(|a, b| by_value(a, b))?;
    let minutes = Finding::Minutes {
        bad: bad.len(),
        of,
        worst_s: begin_s + STRETCH_S * worst as f64,
        nis_per_component,
    };
    let is_much = bad.len() as f64 > BAD_STRETCHES * of as f64;
    Some((too_large(is_much), minutes))
}

/// NIS per component of these fixes without the largest tenth; `None` if it is not too large.
fn trimmed_nis_if_too_large(fixes: &[&FixRecord]) -> Option<f64> {
    let mut sorted = fixes.to_vec();
    sorted.sort_by(|a, b| a.nis.total_cmp(&b.nis));
    let kept = sorted[..sorted.len() * 9 / 10].iter().copied();
    let (nis, components) = total_nis(kept);
    let nis = nis / components.max(1) as f64;
    (components > 0 && nis > nis_bound(components)).then_some(nis)
}

/// Errors at the ends of outages and gaps that are larger than stated.
fn ends_finding(outcome: &FusionFigures) -> Option<(VerdictKind, Finding)> {
    let ends = outcome.ends?;
    let degrees = 2 * ends.count;
    let sum = degrees as f64 * ends.error_over_sigma.powi(2);
    let kind = Verdict::of_windows([(sum, degrees)].into_iter())?.kind;
    (kind == VerdictKind::Overconfident).then_some((kind, Finding::Ends(ends)))
}

/// Verdict on errors that are larger than stated.
const fn too_large(is_much: bool) -> VerdictKind {
    match is_much {
        true => VerdictKind::Overconfident,
        false => VerdictKind::Doubtful,
    }
}

// Recorded data that cannot be fused.

/// Recorded data that cannot be fused.
#[derive(Debug, Clone, thiserror::Error)]
pub enum FusionError {
    /// The clocks have nothing in common.
    #[error("the clocks do not overlap: IMU {} to {} s, GNSS {} to {} s", .imu.0, .imu.1, .gnss.0, .gnss.1)]
    Clocks {
        /// First and last sample (s).
        imu: (f64, f64),
        /// First and last fix (s).
        gnss: (f64, f64),
    },
    /// It begins after the data end, or before they begin.
    #[error("the start at {t_s:.2} s is not within the IMU's {} to {} s", .imu.0, .imu.1)]
    Start {
        /// The start (s).
        t_s: f64,
        /// First and last sample (s).
        imu: (f64, f64),
    },
    /// The initial position is not where the fixes are.
    #[error(
        "the initial position is {metres:.0} m from the fix at {t_s:.2} s, with a standard deviation of {sigma_m:.1} m"
    )]
    Place {
        /// The first fix after the start (s).
        t_s: f64,
        /// Distance (m).
        metres: f64,
        /// Horizontal standard deviation of both (m).
        sigma_m: f64,
    },
    /// Latitude and longitude lose their meaning.
    #[error("latitude {lat_deg:.3}° at {t_s:.2} s is beyond ±89.9°")]
    Pole {
        /// When (s).
        t_s: f64,
        /// Latitude (degrees).
        lat_deg: f64,
    },
    /// The smoother needs too much memory.
    #[error("the smoother would take {:.1} GB for {marks} rows and fixes of {states} states, 2 GB at most", bytes / 1e9)]
    Memory {
        /// Its size (bytes).
        bytes: f64,
        /// Rows and fixes.
        marks: f64,
        /// States of the filter.
        states: usize,
    },
    /// State or covariance stopped being finite.
    #[error("the filter diverged at {t_s:.2} s")]
    Diverged {
        /// When (s).
        t_s: f64,
    },
}

/// Seconds of a GNSS week.
const WEEK_S: f64 = 604_800.0;

impl FusionError {
    /// Clock delay of the fixes that explains the lack of overlap (s): whole weeks, or the value
    /// that starts both recordings in the same second.
    pub fn delay_s(&self) -> Option<f64> {
        let Self::Clocks { imu, gnss } = self else {
            return None;
        };
        let apart_s = gnss.0 - imu.0;
        let overlap = |delay_s: &f64| gnss.0 - delay_s <= imu.1 && imu.0 <= gnss.1 - delay_s;
        [WEEK_S, 1.0]
            .map(|step| (apart_s / step).round() * step)
            .into_iter()
            .find(overlap)
    }
}

#[cfg(test)]
mod assessment_tests {
    use super::VerdictKind::*;
    use super::*;
    use crate::fusion::outcome;
    use approx::assert_relative_eq;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    /// A fix a second of three components with this NIS per component.
    fn solution(nis: impl Fn(usize) -> f64, seconds: usize) -> Solution {
        let fix = |k: usize| FixRecord {
            t_s: k as f64,
            used: true,
            rejected_above: None,
            innovation: vec![0.0; 3],
            sigma: vec![1.0; 3],
            nis: 3.0 * nis(k),
            horizontal_nis: 2.0 * nis(k),
            horizontal_sigma_m: 1.0,
            error: None,
        };
        Solution {
            fixes: (0..seconds).map(fix).collect(),
            ..Solution::default()
        }
    }

    fn judged(solution: &Solution) -> FusionAssessment {
        assess(&weighed(solution), &outcome(solution, &[]), &[], None)
    }

    fn weighed(solution: &Solution) -> WeightedSolution {
        WeightedSolution {
            solution: solution.clone(),
            as_stated: None,
            whiteness: [crate::fusion::Whiteness::of(&solution.fixes), None],
            sigma_factors: [1.0; 2],
        }
    }

    #[test]
    fn the_nis_tells_what_is_consistent_too_large_and_untold() {
        let verdict = |nis: f64| judged(&solution(|_| nis, 600)).verdict;
        assert_eq!([0.6, 1.0, 1.6].map(verdict), [Consistent; 3]);
        assert_eq!(
            [0.3, 2.5, 5.0].map(verdict),
            [Undecided, Doubtful, Overconfident]
        );
        assert_eq!(judged(&solution(|_| 1.0, 10)).verdict, Undecided);
    }

    /// However few fixes there are, one beyond the gate is counted, and its NIS as far as the gate lets pass.
    #[test]
    fn rejected_fixes_of_a_short_recording_count() {
        let mut few = solution(|k| if k == 2 { 100.0 } else { 1.0 }, 4);
        (few.fixes[2].used, few.fixes[2].rejected_above) = (false, Some(15.0));
        let found = outcome(&few, &[]);
        let FixCounts {
            used,
            withheld,
            rejected,
        } = found.fixes;
        assert_eq!([used, withheld, rejected], [3, 0, 1]);
        let outliers = found.outliers.unwrap();
        assert_eq!((outliers.share, outliers.t_s), (0.25, vec![2.0]));
        assert_eq!(found.nis_per_component, (3.0 * 3.0 + 15.0) / 12.0);
    }

    /// Bad minutes count although the mean over the drive hides them; one wild fix is no bad minute.
    #[test]
    fn bad_minutes_count_and_wild_fixes_do_not() {
        let bad = |minutes: usize| {
            judged(&solution(
                |k| if k < 60 * minutes { 9.0 } else { 0.3 },
                1800,
            ))
        };
        let one = bad(1);
        assert_eq!((one.verdict, bad(4).verdict), (Doubtful, Overconfident));
        assert!(
            matches!(one.findings[0].1, Finding::Minutes { bad: 1, of: 30, .. }),
            "{one:?}"
        );
        let wild = solution(|k| if k == 77 { 300.0 } else { 0.5 }, 600);
        assert_eq!(judged(&wild).verdict, Consistent);
    }

    /// Ten outages of ends 1.5 and 2.5 times as far as stated are too much, and 1.3 is chance: chi-square of 20 degrees exceeds
    /// 40, ratio 1.41, once in 200.
    #[test]
    fn ends_of_outages_count() {
        let verdict = |ratio: f64| {
            let mut all = solution(|k| if k % 60 == 59 { ratio * ratio } else { 0.9 }, 600);
            all.fixes
                .retain(|f| f.t_s % 60.0 >= 59.0 || f.t_s % 60.0 < 30.0);
            let outcome = outcome(&all, &[]);
            assert_eq!(outcome.ends.unwrap().count, 10);
            assert_relative_eq!(
                outcome.ends.unwrap().error_over_sigma,
                ratio,
                max_relative = 1e-12
            );
            assess(&weighed(&all), &outcome, &[], None)
                .findings
                .into_iter()
                .find(|(_, f)| matches!(f, Finding::Ends(_)))
        };
        assert_eq!(
            [1.3, 1.5, 2.5].map(|ratio| verdict(ratio).map(|(kind, _)| kind)),
            [None, Some(Overconfident), Some(Overconfident)]
        );
    }

    /// Innovations of position whose neighbours are alike: what is small is then no sign of large standard deviations, and
    /// is not called consistent.
    #[test]
    fn errors_that_last_are_told() {
        let mut all = solution(|_| 0.3, 600);
        for (k, fix) in all.fixes.iter_mut().enumerate() {
            fix.innovation = vec![if k % 40 < 20 { 0.5 } else { -0.5 }; 3];
        }
        let found = judged(&all);
        let Finding::Correlated {
            lag_1,
            pos_sigma_factor,
            ..
        } = found.findings[0].1
        else {
            panic!("{found:?}")
        };
        // of 599 pairs 29 are of either sign
        assert!(
            (lag_1 - (1.0 - 2.0 * 29.0 / 599.0)).abs() < 1e-12 && pos_sigma_factor == 1.0,
            "{found:?}"
        );
        assert_eq!(found.verdict, Doubtful);
        assert!(
            !found.findings.iter().any(|(kind, _)| *kind == Undecided),
            "{found:?}"
        );
        let answered = WeightedSolution {
            sigma_factors: [1.0, 4.3],
            ..weighed(&all)
        };
        let found = assess(&answered, &outcome(&all, &[]), &[], None);
        assert_eq!(found.verdict, Undecided);
    }

    /// Errors of 1.0, 1.4 and 0.7 times the stated at the ends of twelve windows decide; of two windows with six components, χ²
    /// of 12 degrees, 1.4 is chance. Fixes that are better than stated stay open.
    #[test]
    fn withheld_windows_decide() {
        let judged_at = |nis: f64, ratio: f64, windows: usize| {
            let all = solution(|_| nis, 600);
            let squares = (0..windows).map(|_| (6.0 * ratio * ratio, 6));
            let withheld = WithheldWindows {
                windows,
                length_s: 20.0,
                verdict: Verdict::of_windows(squares).unwrap(),
            };
            assess(&weighed(&all), &outcome(&all, &[]), &[], Some(withheld)).verdict
        };
        for (nis, ratio, windows, expected) in [
            (1.0, 1.0, 12, Consistent),
            (1.0, 1.4, 12, Overconfident),
            (1.0, 0.7, 12, Underconfident),
            (1.0, 1.4, 2, Undecided),
            (0.3, 1.0, 12, Undecided),
        ] {
            assert_eq!(
                judged_at(nis, ratio, windows),
                expected,
                "{nis} {ratio} {windows}"
            );
        }
    }

    /// What is as believed is doubted once in 500 at most, however few its fixes.
    #[test]
    fn chance_is_no_doubt() {
        for components in [3, 6, 12, 30, 100, 1000] {
            let n = f64::from(components);
            let p = ChiSquared::new(n)
                .unwrap()
                .sf(n * bound(NIS_LIMITS.0, components as usize));
            assert!(p < 2e-3, "{components}: {p}");
        }
    }
}
