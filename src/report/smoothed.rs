//! What a fusion says of its errors against a reference, and of what smoothing does to them.

use crate::fusion::{FromReference, SmoothedOutcome};
use crate::metrics::PerState;
use serde::Serialize;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Reference {
    pub(super) rmse: PerState<f64>,
    pub(super) horizontal_rmse_m: f64,
    pub(super) horizontal_max_m: f64,
    pub(super) nees_mean: f64,
    pub(super) nees_dof: usize,
}

impl From<FromReference> for Reference {
    fn from(r: FromReference) -> Self {
        Self {
            rmse: PerState(r.rmse),
            horizontal_rmse_m: r.rmse[0].hypot(r.rmse[1]),
            horizontal_max_m: r.horizontal_max_m,
            nees_mean: r.nees_mean,
            nees_dof: 9,
        }
    }
}

/// What smoothing does, beside the filter's own.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Smoothed {
    /// Root mean square of the horizontal standard deviation.
    horizontal_sigma_rms_m: f64,
    horizontal_sigma_rms_filter_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<Reference>,
    outages: Vec<SmoothedOutageRow>,
}

/// The largest of the rows in an outage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct SmoothedOutageRow {
    start_s: f64,
    end_s: f64,
    sigma_max_m: f64,
    sigma_max_filter_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    horizontal_max_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    horizontal_max_filter_m: Option<f64>,
}

impl From<&SmoothedOutcome> for Smoothed {
    fn from(outcome: &SmoothedOutcome) -> Self {
        let [filter, smoothed] = outcome.sigma_rms_m;
        let outages = outcome.outages.iter().map(|o| SmoothedOutageRow {
            start_s: o.outage.start_s,
            end_s: o.outage.end_s,
            sigma_max_m: o.smoothed.sigma_m,
            sigma_max_filter_m: o.filtered.sigma_m,
            horizontal_max_m: o.smoothed.from_reference_m,
            horizontal_max_filter_m: o.filtered.from_reference_m,
        });
        Self {
            horizontal_sigma_rms_m: smoothed,
            horizontal_sigma_rms_filter_m: filter,
            reference: outcome.reference.map(Into::into),
            outages: outages.collect(),
        }
    }
}

/// Errors over standard deviations, of all states together, that are said.
const TOO_SURE: f64 = 1.5;

impl Smoothed {
    /// What is said of it, filter → smoothed.
    pub(super) fn lines(&self, filter: Option<&Reference>) -> Vec<String> {
        let mut lines = vec![format!(
            "smoothed, filter → smoothed: horizontal 1 sigma {:.3} → {:.3} m (RMS)",
            self.horizontal_sigma_rms_filter_m, self.horizontal_sigma_rms_m
        )];
        if let (Some(before), Some(after)) = (filter, &self.reference) {
            lines[0] += &format!(
                "; RMSE against the reference: horizontal {:.3} → {:.3} m, down {:.3} → {:.3} m, yaw {:.3} → {:.3}°; NEES {:.2} → {:.2}",
                before.horizontal_rmse_m,
                after.horizontal_rmse_m,
                before.rmse.0[2],
                after.rmse.0[2],
                before.rmse.0[8],
                after.rmse.0[8],
                before.nees_mean,
                after.nees_mean
            );
            let times = (after.nees_mean / after.nees_dof as f64).sqrt();
            if times > TOO_SURE {
                lines[0] += &format!("; smoothed errors are {times:.1} times their standard deviations");
            }
        }
        let largest =
            |of: fn(&SmoothedOutageRow) -> Option<f64>| self.outages.iter().filter_map(of).reduce(f64::max);
        if let (Some(before), Some(after)) =
            (largest(|o| Some(o.sigma_max_filter_m)), largest(|o| Some(o.sigma_max_m)))
        {
            let mut line =
                format!("smoothed, in outages, largest: horizontal 1 sigma {before:.2} → {after:.2} m");
            if let (Some(before), Some(after)) =
                (largest(|o| o.horizontal_max_filter_m), largest(|o| o.horizontal_max_m))
            {
                line += &format!(", from the reference {before:.2} → {after:.2} m");
            }
            lines.push(line);
        }
        lines
    }
}
