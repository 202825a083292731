//! Figures of a fusion: fixes used, consistency, errors at the ends of outages. They serialize as `summary.json` has them.

use super::correlation::middle;
use super::{Confidence, FixRecord, Nine, Row, RowError, Solution, Use};
use crate::metrics::PerState;
use crate::sensors::outage::Outage;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Distance at the end of an outage, and what the filter states of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Drift {
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
    /// Whether a fix follows it.
    followed_by_fix: bool,
    /// Against the first fix after it (the last withheld one, when none follows).
    pub end_from_fix: Option<Drift>,
    /// Against the reference at that time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_from_reference: Option<Drift>,
}

/// Innovations of the fixes that end outages and gaps, all together: the only ones that the filter was not led to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ends {
    /// How many outages and gaps.
    pub count: usize,
    /// Root mean square of the horizontal error over its standard deviation: 1 if right.
    pub error_over_sigma: f64,
    /// Probability of as large a one if right.
    pub p_value: f64,
}

/// Figures of a solution.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcome {
    /// Fixes used, withheld, rejected.
    pub fixes: [usize; 3],
    /// Mean NIS of the fixes used, divided by their number of components: 1 if all is as believed.
    pub nis_per_component: f64,
    /// Errors at the end of each outage.
    pub outages: Vec<OutageDrift>,
    /// The ends of all outages and gaps, where there are any.
    pub ends: Option<Ends>,
    /// Differences of the rows from the reference, where one reaches them.
    pub reference: Option<FromReference>,
    /// Figures of the smoothed solution, where there is one.
    pub smoothed: Option<SmoothedOutcome>,
}

/// Differences of rows from a reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FromReference {
    /// Root mean square in each state.
    pub rmse: PerState<f64>,
    /// The same of the horizontal distance (m).
    pub horizontal_rmse_m: f64,
    /// Largest horizontal distance (m).
    pub horizontal_max_m: f64,
    /// Root mean square of the difference over its standard deviation in each state: 1 if both are right.
    pub error_over_sigma: PerState<f64>,
    /// Mean NEES.
    pub nees_mean: f64,
    /// What it is if both are right.
    pub nees_dof: usize,
    /// How well the velocity of the reference is known, which the NEES allows for: root mean square (m/s).
    pub velocity_sigma_m_s: f64,
}

/// Figures of a smoothed solution beside the filter's.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SmoothedOutcome {
    /// Root mean square of the smoothed horizontal standard deviation (m).
    pub horizontal_sigma_rms_m: f64,
    /// The same of the filter's (m).
    horizontal_sigma_rms_filter_m: f64,
    /// Differences of the smoothed rows from the reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<FromReference>,
    /// Their verdict.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confidence: Option<Confidence>,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    pub horizontal_max_m: Option<f64>,
    /// The filter's (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub horizontal_max_filter_m: Option<f64>,
}

/// The figures of a solution with these outages.
#[must_use]
pub fn outcome(solution: &Solution, outages: &[Outage]) -> Outcome {
    let count = |kind: Use| solution.fixes.iter().filter(|f| f.used == kind).count();
    Outcome {
        fixes: [count(Use::Used), count(Use::Withheld), count(Use::Rejected)],
        nis_per_component: nis_per_component(solution),
        outages: outages.iter().map(|o| drift(solution, *o)).collect(),
        ends: ends(solution),
        reference: from_reference(&solution.rows),
        smoothed: solution
            .smoothed
            .as_ref()
            .map(|rows| smoothed(&solution.rows, rows, outages)),
    }
}

/// Time without a fix from which one is a test of the IMU (s), and how many of their median interval.
const APART: (f64, f64) = (10.0, 5.0);

/// The fixes that nothing was used before for so long. Their horizontal innovations are two normal numbers each, and the
/// sum of m of their squares, normalised, is chi-square of 2m degrees.
fn ends(solution: &Solution) -> Option<Ends> {
    let known: Vec<&FixRecord> = solution
        .fixes
        .iter()
        .filter(|f| f.used != Use::Withheld)
        .collect();
    let steps: Vec<f64> = known.windows(2).map(|w| w[1].t_s - w[0].t_s).collect();
    let apart_s = APART.0.max(APART.1 * middle(steps)?);
    let of_ends: Vec<f64> = known
        .windows(2)
        .filter(|w| w[1].t_s - w[0].t_s > apart_s)
        .map(|w| w[1].horizontal_nis)
        .collect();
    let (count, sum) = (of_ends.len(), of_ends.iter().sum::<f64>());
    let degrees = 2.0 * count as f64;
    let p_value = ChiSquared::new(degrees).ok()?.sf(sum);
    Some(Ends {
        count,
        error_over_sigma: (sum / degrees).sqrt(),
        p_value,
    })
}

/// Mean NIS of the fixes used, divided by their number of components.
pub(super) fn nis_per_component(solution: &Solution) -> f64 {
    let used = || solution.fixes.iter().filter(|f| f.used == Use::Used);
    used().map(|f| f.nis).sum::<f64>() / used().map(|f| f.innovation.len()).sum::<usize>() as f64
}

fn from_reference(rows: &[Row]) -> Option<FromReference> {
    let errors: Vec<RowError> = rows.iter().filter_map(|row| row.error).collect();
    let n = errors.len() as f64;
    let rms = |of: &dyn Fn(&RowError) -> f64| {
        (errors.iter().map(|e| of(e).powi(2)).sum::<f64>() / n).sqrt()
    };
    let per_state =
        |of: &dyn Fn(&RowError, usize) -> f64| std::array::from_fn(|i| rms(&|e| of(e, i)));
    let rmse: Nine = per_state(&|e, i| e.values[i]);
    (!errors.is_empty()).then(|| FromReference {
        rmse: PerState(rmse),
        horizontal_rmse_m: horizontal(&rmse),
        horizontal_max_m: errors
            .iter()
            .map(|e| horizontal(&e.values))
            .fold(0.0, f64::max),
        error_over_sigma: PerState(per_state(&|e, i| {
            e.values[i] / e.sigma[i].max(f64::MIN_POSITIVE)
        })),
        nees_mean: errors.iter().map(|e| e.nees).sum::<f64>() / n,
        nees_dof: rmse.len(),
        velocity_sigma_m_s: rms(&|e| e.velocity_sigma),
    })
}

fn horizontal(values: &Nine) -> f64 {
    values[0].hypot(values[1])
}

fn smoothed(filtered: &[Row], smoothed: &[Row], outages: &[Outage]) -> SmoothedOutcome {
    let sigma_rms = |rows: &[Row]| {
        (rows
            .iter()
            .map(|row| horizontal(&row.sigma).powi(2))
            .sum::<f64>()
            / rows.len() as f64)
            .sqrt()
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
    let reference = from_reference(smoothed);
    SmoothedOutcome {
        horizontal_sigma_rms_m: sigma_rms(smoothed),
        horizontal_sigma_rms_filter_m: sigma_rms(filtered),
        confidence: reference.as_ref().map(FromReference::confidence),
        reference,
        outages: outages.iter().filter_map(of_outage).collect(),
    }
}

/// Largest horizontal standard deviation of the rows in an outage and distance from the reference; none without rows.
fn largest(rows: &[Row], outage: &Outage) -> Option<(f64, Option<f64>)> {
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
    let end_from_fix = last.map(|f| Drift {
        horizontal_m: f.innovation[0].hypot(f.innovation[1]),
        down_m: f.innovation[2],
        expected_sigma_m: f.sigma[0].hypot(f.sigma[1]),
    });
    let end_from_reference = last.and_then(|f| {
        let error = f.error?;
        let (horizontal_m, expected_sigma_m) = (horizontal(&error), f.horizontal_sigma_m);
        Some(Drift {
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
