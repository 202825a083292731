//! Where the errors that an answer rests on are too large for linear theory.

use crate::report::number::{readable, window};
use nav_sim_navigation::metrics::OutageMetrics;
use serde::Serialize;

/// An outage whose errors are beyond linear theory, by the rules of `run`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct BeyondLinear {
    start_s: f64,
    end_s: f64,
    /// Shift of the velocity down over the standard deviation that linear theory gives it.
    vel_d_share: Option<f64>,
    /// What heading error times tilt adds to the NEES at most.
    nees: Option<f64>,
}

impl BeyondLinear {
    /// None where linear theory covers the outage.
    pub(crate) fn of(outage: &OutageMetrics) -> Option<Self> {
        let second = &outage.second_order;
        let (vel_d_share, nees) = (second.beyond_linear(), second.beyond_linear_horizontally());
        let is_beyond = vel_d_share.or(nees).is_some();
        is_beyond.then_some(Self { start_s: outage.start_s, end_s: outage.end_s, vel_d_share, nees })
    }

    /// A sentence.
    fn in_words(&self) -> String {
        let down = self.vel_d_share.map(|share| {
            format!(
                "attitude errors shift the velocity down by {} times the standard deviation that linear theory gives it",
                readable(share)
            )
        });
        let horizontal = self.nees.map(|nees| {
            format!("heading error times tilt makes the NEES larger by up to about {}", readable(nees))
        });
        let both: Vec<String> = down.into_iter().chain(horizontal).collect();
        format!(
            "beyond linear: in the outage {} {}; errors of second order are not in the answer, and `nav-sim run --method both` shows how \
             far they are from it",
            window(self.start_s, self.end_s),
            both.join(" and ")
        )
    }
}

/// The sentence on a line of its own, if there is one.
pub(super) fn line(beyond: Option<&BeyondLinear>) -> String {
    beyond.map_or_else(String::new, |beyond| format!("\n{}", beyond.in_words()))
}
