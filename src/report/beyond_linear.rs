//! Outages in which errors are beyond linear theory, by the rules of `run`, in words and as JSON.

use super::number::{readable, window};
use nav_sim_navigation::metrics::OutageSecondOrder;
use serde::Serialize;

/// An outage in which errors are beyond linear theory.
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
    /// None where linear theory covers the outage (start, end) (s).
    pub(crate) fn of((start_s, end_s): (f64, f64), second: &OutageSecondOrder) -> Option<Self> {
        let (vel_d_share, nees) = (second.beyond_linear(), second.beyond_linear_horizontally());
        let is_beyond = vel_d_share.or(nees).is_some();
        is_beyond.then_some(Self { start_s, end_s, vel_d_share, nees })
    }

    /// Those among several outages.
    pub(crate) fn among<'a>(outages: impl Iterator<Item = ((f64, f64), &'a OutageSecondOrder)>) -> Vec<Self> {
        outages.filter_map(|(window, second)| Self::of(window, second)).collect()
    }

    /// What makes the errors: `in the outage 300–600 s attitude errors shift …`.
    fn cause(&self) -> String {
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
        format!("in the outage {} {}", window(self.start_s, self.end_s), both.join(" and "))
    }

    /// To rank outages by: about how many times the limit.
    fn excess(&self) -> f64 {
        let down = self.vel_d_share.map_or(0.0, |share| share / OutageSecondOrder::SECOND_ORDER_LIMIT);
        let ratio = self.nees.map_or(0.0, OutageSecondOrder::ratio_of_nees);
        down.max(ratio)
    }

    /// For an answer of `require`, on a line of its own; nothing where there is no such outage.
    pub(super) fn line(beyond: Option<&Self>) -> String {
        let line = |beyond: &Self| format!("\nbeyond linear: {}; {OF_A_FIGURE}", beyond.cause());
        beyond.map_or_else(String::new, line)
    }
}

/// What a figure of covariance analysis is worth in such an outage.
pub(super) const OF_A_FIGURE: &str = "errors of second order are not in the answer; in runs, horizontal errors and angles at the ends of such outages were within a tenth \
     of it (docs/limits.md), and `nav-sim run --method both` shows how far yours are";

/// What its verdicts are worth.
pub(crate) const OF_A_VERDICT: &str =
    "verdicts of covariance analysis hold until the first such outage, and runs have to confirm the rest";

/// Such outages in several places: runs, cells of a study, units of a catalogue.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct BeyondLinearPlaces {
    /// Places that were looked at.
    looked_at: usize,
    /// Those that have such an outage.
    names: Vec<String>,
    outages: usize,
    /// Where it is worst.
    worst: Option<(String, BeyondLinear)>,
}

impl BeyondLinearPlaces {
    /// A place, and what is beyond linear theory in it, each under a name of its own.
    pub(crate) fn add(&mut self, place: &str, found: impl IntoIterator<Item = (String, BeyondLinear)>) {
        self.looked_at += 1;
        let before = self.outages;
        for (name, beyond) in found {
            self.outages += 1;
            if self.worst.as_ref().is_none_or(|(_, worst)| beyond.excess() > worst.excess()) {
                self.worst = Some((name, beyond));
            }
        }
        if self.outages > before {
            self.names.push(place.to_owned());
        }
    }

    /// One line: how many of the `places` ("cells"), which, and the worst; with what that means for what is told.
    pub(crate) fn line(&self, places: &str, meaning: &str) -> Option<String> {
        let (name, worst) = self.worst.as_ref()?;
        let more = match self.names.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let names = self.names[..self.names.len().min(NAMED)].join(", ");
        let outages = match self.outages == self.names.len() {
            true => String::new(),
            false => format!("{} outages in ", self.outages),
        };
        Some(format!(
            "beyond linear: {outages}{} of {} {places} ({names}{more}), the worst in {name}: {}; {meaning}",
            self.names.len(),
            self.looked_at,
            worst.cause()
        ))
    }
}

/// Most places that are named.
const NAMED: usize = 6;

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cells of three, the worse by five times the limit in the velocity down against a NEES whose root is 1.5 times too large.
    #[test]
    fn places_are_counted_and_the_worst_is_named() {
        let second = |vel_d_m_s: f64, nees: f64| OutageSecondOrder {
            vel_d_m_s,
            linear_vel_d_m_s: 0.1,
            nees,
            ..OutageSecondOrder::UNKNOWN
        };
        let found = |outages: &[OutageSecondOrder]| {
            let windows = outages
                .iter()
                .enumerate()
                .map(|(k, second)| ((100.0 * k as f64, 100.0 * k as f64 + 90.0), second));
            BeyondLinear::among(windows)
                .into_iter()
                .map(|beyond| ("a 15".to_owned(), beyond))
                .collect::<Vec<_>>()
        };
        let mut places = BeyondLinearPlaces::default();
        assert_eq!(places.line("cells", "so"), None);
        places.add("first", found(&[second(0.029, 0.1), second(0.031, f64::NAN)]));
        places.add("second", found(&[second(0.001, 0.2)]));
        places.add("third", found(&[second(f64::NAN, 11.25), second(0.15, 0.0)]));
        let line = places.line("cells", "so").unwrap();
        assert_eq!(
            line,
            "beyond linear: 3 outages in 2 of 3 cells (first, third), the worst in a 15: in the outage 100–190 s attitude errors shift \
             the velocity down by 1.50 times the standard deviation that linear theory gives it; so"
        );
    }
}
