//! What a fusion says of itself: how many fixes, how consistent, how far off at the end of outages.

use super::{Nine, Solution, Use};
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
    /// Root mean square difference from the reference in each state, over all rows that have one.
    pub rmse: Option<Nine>,
    /// Largest horizontal distance from the reference (m).
    pub horizontal_max_m: Option<f64>,
    /// Mean NEES against the reference (9 if both are right).
    pub nees_mean: Option<f64>,
}

/// The figures of a solution with these outages.
#[must_use]
pub fn outcome(solution: &Solution, outages: &[Outage]) -> Outcome {
    let count = |kind: Use| solution.fixes.iter().filter(|f| f.used == kind).count();
    let used = || solution.fixes.iter().filter(|f| f.used == Use::Used);
    let components: usize = used().map(|f| f.innovation.len()).sum();
    let errors: Vec<_> = solution.rows.iter().filter_map(|row| row.error).collect();
    let n = errors.len() as f64;
    let any = (!errors.is_empty()).then_some(());
    let rms = |i: usize| (errors.iter().map(|e| e.values[i].powi(2)).sum::<f64>() / n).sqrt();
    Outcome {
        fixes: [count(Use::Used), count(Use::Withheld), count(Use::Rejected)],
        nis_per_component: used().map(|f| f.nis).sum::<f64>() / components as f64,
        outages: outages.iter().map(|o| drift(solution, *o)).collect(),
        rmse: any.map(|()| std::array::from_fn(rms)),
        horizontal_max_m: any
            .map(|()| errors.iter().map(|e| e.values[0].hypot(e.values[1])).fold(0.0, f64::max)),
        nees_mean: any.map(|()| errors.iter().map(|e| e.nees).sum::<f64>() / n),
    }
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
        let horizontal_m = error[0].hypot(error[1]);
        Some(Drift { horizontal_m, down_m: error[2], sigma_m: f.horizontal_sigma_m })
    });
    OutageDrift {
        outage,
        withheld: withheld().count(),
        is_followed: after.is_some(),
        from_fix,
        from_reference,
    }
}
