//! Outages in which errors are beyond linear theory, in words and as JSON.

use super::number::window;
use nav_sim_navigation::metrics::OutageMetrics;
use serde::Serialize;

/// An outage in which errors are beyond linear theory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct BeyondLinear {
    start_s: f64,
    end_s: f64,
}

impl BeyondLinear {
    /// None where linear theory covers the outage.
    pub(crate) fn of(outage: &OutageMetrics) -> Option<Self> {
        outage.beyond_linear.then_some(Self { start_s: outage.start_s, end_s: outage.end_s })
    }

    /// For an answer of `require`, on a line of its own; nothing where there is no such outage.
    pub(super) fn line(beyond: Option<&Self>) -> String {
        let place = |beyond: &Self| window(beyond.start_s, beyond.end_s);
        beyond
            .map_or_else(String::new, |b| format!("\nbeyond linear theory in outage {}: {CONFIRM}", place(b)))
    }
}

/// What confirms a figure of covariance analysis.
pub(super) const CONFIRM: &str = "confirm with nav-sim run --method both";
