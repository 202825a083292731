//! What a fusion says of its errors against a reference, and of what smoothing does to them.

use super::number::window;
use super::page::{Cell, Table};
use nav_sim_navigation::fusion::{Confidence, FromReference, SmoothedOutcome, Verdict};
use nav_sim_navigation::metrics::PerState;
use nav_sim_navigation::simulation::REPORTED_NAMES;
use serde::Serialize;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Reference {
    pub(super) rmse: PerState<f64>,
    pub(super) horizontal_rmse_m: f64,
    pub(super) horizontal_max_m: f64,
    /// Root mean square of error over standard deviation.
    error_over_sigma: PerState<f64>,
    pub(super) nees_mean: f64,
    pub(super) nees_dof: usize,
    pub(super) velocity_sigma_m_s: f64,
}

impl From<FromReference> for Reference {
    fn from(r: FromReference) -> Self {
        Self {
            rmse: PerState(r.rmse),
            horizontal_rmse_m: r.rmse[0].hypot(r.rmse[1]),
            horizontal_max_m: r.horizontal_max_m,
            error_over_sigma: PerState(r.over_sigma),
            nees_mean: r.nees_mean,
            nees_dof: 9,
            velocity_sigma_m_s: r.velocity_sigma,
        }
    }
}

/// Unevenness of a reference's velocity that is said (m/s).
const UNEVEN: f64 = 0.1;

impl Reference {
    /// What its velocity is worth, where that is little.
    pub(super) fn velocity_words(&self) -> String {
        let sigma = self.velocity_sigma_m_s;
        if sigma < UNEVEN {
            String::new()
        } else {
            format!(" (the reference's own ± {sigma:.2}: its positions step)")
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
    #[serde(skip_serializing_if = "Option::is_none")]
    confidence: Option<ConfidenceRow>,
    outages: Vec<SmoothedOutageRow>,
}

/// Whether smoothed errors against the reference are as large as stated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct ConfidenceRow {
    verdict: &'static str,
    error_over_sigma: f64,
    worst_state: &'static str,
    worst_error_over_sigma: f64,
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
            confidence: outcome.reference.map(|r| r.confidence().into()),
            outages: outages.collect(),
        }
    }
}

impl From<Confidence> for ConfidenceRow {
    fn from(c: Confidence) -> Self {
        Self {
            verdict: c.verdict.name(),
            error_over_sigma: c.over_sigma,
            worst_state: REPORTED_NAMES[c.state],
            worst_error_over_sigma: c.over_sigma_of_state,
        }
    }
}

impl ConfidenceRow {
    /// The verdict, by how much and where.
    fn line(&self) -> String {
        let word =
            if self.verdict == Verdict::Ok.name() { "consistent with the reference" } else { self.verdict };
        format!(
            "smoothed solution {word}: errors {:.1} times their standard deviations in all states together, {:.1} times in {}",
            self.error_over_sigma, self.worst_error_over_sigma, self.worst_state
        )
    }
}

impl Smoothed {
    /// What is said of it, filter → smoothed.
    pub(super) fn lines(&self, filter: Option<&Reference>) -> Vec<String> {
        let mut line = format!(
            "smoothed, filter → smoothed: horizontal 1 sigma {:.3} → {:.3} m (RMS)",
            self.horizontal_sigma_rms_filter_m, self.horizontal_sigma_rms_m
        );
        if let (Some(before), Some(after)) = (filter, &self.reference) {
            line += &format!(
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
        }
        let mut lines: Vec<String> = self.confidence.iter().map(ConfidenceRow::line).collect();
        lines.push(line);
        let largest = |value: fn(&SmoothedOutageRow) -> Option<f64>| {
            self.outages.iter().filter_map(value).reduce(f64::max)
        };
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

    /// The outages as the page shows them.
    pub(super) fn outage_table(&self) -> Table {
        let has_reference = self.outages.iter().any(|o| o.horizontal_max_m.is_some());
        let of_both = |what: &str| [format!("{what}, filter (m)"), format!("{what}, smoothed (m)")];
        let mut table = Table::new(["outage"]).and(of_both("largest horizontal 1 σ"));
        if has_reference {
            table = table.and(of_both("largest horizontal error"));
        }
        for (i, o) in self.outages.iter().enumerate() {
            let cell = |value: f64, key: &str| Cell::number(value, &format!("/smoothed/outages/{i}/{key}"));
            let mut cells = vec![
                Cell::from(window(o.start_s, o.end_s)),
                cell(o.sigma_max_filter_m, "sigma_max_filter_m"),
                cell(o.sigma_max_m, "sigma_max_m"),
            ];
            if has_reference {
                let errors = [
                    (o.horizontal_max_filter_m, "horizontal_max_filter_m"),
                    (o.horizontal_max_m, "horizontal_max_m"),
                ];
                cells.extend(
                    errors.map(|(value, key)| value.map_or_else(|| Cell::figures("–"), |v| cell(v, key))),
                );
            }
            table.row(cells);
        }
        table
    }
}
