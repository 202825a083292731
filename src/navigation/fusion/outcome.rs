//! What a fusion says of itself: how many fixes, how consistent, how far off at the end of outages.

use super::{Nine, Row, RowError, Solution, Use};
use crate::sensors::outage::Outage;

/// A distance at the end of an outage, and what the filter believed of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Horizontal distance (m).
    pub horizontal_m: f64,
    /// Difference down (m).
    pub down_m: f64,
    /// Horizontal standard deviation that the filter states (m).
    pub sigma_m: f64,
}

/// What an outage did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutageDrift {
    /// The outage.
    pub outage: Outage,
    /// Fixes that were withheld.
    pub withheld: usize,
    /// Whether a fix follows it.
    pub is_followed: bool,
    /// Against the first fix after it (the last withheld one, when none follows).
    pub from_fix: Option<Drift>,
    /// Against the reference at that time.
    pub from_reference: Option<Drift>,
}

/// Figures of a solution.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcome {
    /// Fixes used, withheld, rejected.
    pub fixes: [usize; 3],
    /// Mean NIS of the fixes used, divided by their number of components: 1 if all is as believed.
    pub nis_per_component: f64,
    /// What each outage did.
    pub outages: Vec<OutageDrift>,
    /// How far the rows are from the reference, where one reaches them.
    pub reference: Option<FromReference>,
    /// What smoothing does, where it was done.
    pub smoothed: Option<SmoothedOutcome>,
}

/// Differences of rows from a reference.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FromReference {
    /// Root mean square in each state.
    pub rmse: Nine,
    /// Root mean square of the difference over its standard deviation in each state: 1 if both are right.
    pub over_sigma: Nine,
    /// Largest horizontal distance (m).
    pub horizontal_max_m: f64,
    /// Mean NEES (9 if both are right).
    pub nees_mean: f64,
    /// How well the velocity of the reference is known, which the NEES allows for: root mean square (m/s).
    pub velocity_sigma: f64,
}

/// What smoothing does to a solution.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SmoothedOutcome {
    /// Root mean square of the horizontal standard deviations, of the filter and smoothed (m).
    pub sigma_rms_m: [f64; 2],
    /// How far the smoothed rows are from the reference.
    pub reference: Option<FromReference>,
    /// The outages in which there are rows.
    pub outages: Vec<SmoothedOutage>,
}

/// The rows in an outage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothedOutage {
    /// The outage.
    pub outage: Outage,
    /// Of the filter.
    pub filtered: Farthest,
    /// Smoothed.
    pub smoothed: Farthest,
}

/// The largest of some rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Farthest {
    /// Horizontal standard deviation (m).
    pub sigma_m: f64,
    /// Horizontal distance from the reference (m).
    pub from_reference_m: Option<f64>,
}

/// The figures of a solution with these outages.
#[must_use]
pub fn outcome(solution: &Solution, outages: &[Outage]) -> Outcome {
    let count = |kind: Use| solution.fixes.iter().filter(|f| f.used == kind).count();
    let used = || solution.fixes.iter().filter(|f| f.used == Use::Used);
    let components: usize = used().map(|f| f.innovation.len()).sum();
    Outcome {
        fixes: [count(Use::Used), count(Use::Withheld), count(Use::Rejected)],
        nis_per_component: used().map(|f| f.nis).sum::<f64>() / components as f64,
        outages: outages.iter().map(|o| drift(solution, *o)).collect(),
        reference: from_reference(&solution.rows),
        smoothed: solution.smoothed.as_ref().map(|rows| smoothed(&solution.rows, rows, outages)),
    }
}

fn from_reference(rows: &[Row]) -> Option<FromReference> {
    let errors: Vec<RowError> = rows.iter().filter_map(|row| row.error).collect();
    let n = errors.len() as f64;
    let rms = |of: &dyn Fn(&RowError) -> f64| (errors.iter().map(|e| of(e).powi(2)).sum::<f64>() / n).sqrt();
    (!errors.is_empty()).then(|| FromReference {
        rmse: std::array::from_fn(|i| rms(&|e| e.values[i])),
        over_sigma: std::array::from_fn(|i| rms(&|e| e.values[i] / e.sigma[i].max(f64::MIN_POSITIVE))),
        velocity_sigma: rms(&|e| e.velocity_sigma),
        horizontal_max_m: errors.iter().map(|e| horizontal(&e.values)).fold(0.0, f64::max),
        nees_mean: errors.iter().map(|e| e.nees).sum::<f64>() / n,
    })
}

fn horizontal(values: &Nine) -> f64 {
    values[0].hypot(values[1])
}

fn smoothed(filtered: &[Row], smoothed: &[Row], outages: &[Outage]) -> SmoothedOutcome {
    let mean_square =
        |rows: &[Row]| rows.iter().map(|row| horizontal(&row.sigma).powi(2)).sum::<f64>() / rows.len() as f64;
    let of_outage = |outage: &Outage| {
        let [filtered, smoothed] = [filtered, smoothed].map(|rows| farthest(rows, outage));
        Some(SmoothedOutage { outage: *outage, filtered: filtered?, smoothed: smoothed? })
    };
    SmoothedOutcome {
        sigma_rms_m: [filtered, smoothed].map(|rows| mean_square(rows).sqrt()),
        reference: from_reference(smoothed),
        outages: outages.iter().filter_map(of_outage).collect(),
    }
}

/// The largest of the rows in an outage; none without rows.
fn farthest(rows: &[Row], outage: &Outage) -> Option<Farthest> {
    let within = || rows.iter().filter(|row| outage.withholds(row.t_s));
    Some(Farthest {
        sigma_m: within().map(|row| horizontal(&row.sigma)).reduce(f64::max)?,
        from_reference_m: within().filter_map(|row| Some(horizontal(&row.error?.values))).reduce(f64::max),
    })
}

fn drift(solution: &Solution, outage: Outage) -> OutageDrift {
    let withheld = || solution.fixes.iter().filter(|f| outage.withholds(f.t_s));
    let after = solution.fixes.iter().find(|f| f.t_s + 1e-9 >= outage.end_s);
    let last = after.or(withheld().next_back());
    let from_fix = last.map(|f| Drift {
        horizontal_m: f.innovation[0].hypot(f.innovation[1]),
        down_m: f.innovation[2],
        sigma_m: f.sigma[0].hypot(f.sigma[1]),
    });
    let from_reference = last.and_then(|f| {
        let error = f.error?;
        Some(Drift { horizontal_m: horizontal(&error), down_m: error[2], sigma_m: f.horizontal_sigma_m })
    });
    OutageDrift {
        outage,
        withheld: withheld().count(),
        is_followed: after.is_some(),
        from_fix,
        from_reference,
    }
}
