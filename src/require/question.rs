//! Limits, the places of an outage, and what all answers share: curves of drift, doubts.

use nav_sim_document::{
    Axis, Cell, Chart, Document, Importance, Panel, Series, readable, seconds, window,
};
use nav_sim_navigation::metrics::OutageMetrics;
use nav_sim_navigation::require::{Limit, Quantity, Worst};
use nav_sim_navigation::sensors::outage::Outage;
use serde::Serialize;
use serde_json::{Value, json};

/// Lengths of an outage on the curves of units (s).
pub(super) const CURVE_S: [u32; 7] = [1, 3, 10, 30, 60, 120, 300];
/// Longest outage that is looked at (s).
pub(super) const LONGEST_S: f64 = 600.0;
/// What confirms a figure of covariance analysis.
const CONFIRM: &str = "confirm with nav-sim run --method both";
/// Last line of each page.
pub(super) const CHECKED: &str = "covariance analysis against sampled runs: docs/validation.md.";
/// Caption of drift curves.
pub(super) const DRIFT: &str =
    "The error at the end of an outage against its length, at the worst of the places.";

/// Error after each of [`CURVE_S`]; none where the trajectory is too short.
pub(super) type DriftCurve = [Option<f64>; CURVE_S.len()];

/// An outage in which errors are beyond linear theory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct BeyondLinear {
    start_s: f64,
    end_s: f64,
}

impl BeyondLinear {
    /// None where linear theory covers the outage.
    pub(super) fn of(outage: &OutageMetrics) -> Option<Self> {
        outage.beyond_linear.then_some(Self {
            start_s: outage.start_s,
            end_s: outage.end_s,
        })
    }

    /// Warns of it.
    pub(super) fn note(beyond: Option<&Self>, document: &mut Document) {
        if let Some(Self { start_s, end_s }) = beyond {
            let place = window(*start_s, *end_s);
            document.note(
                Importance::Warning,
                format!("beyond linear theory in outage {place}: {CONFIRM}"),
            );
        }
    }
}

/// Warns of units beyond linear theory.
pub(super) fn warn_of_units(names: &[&str], document: &mut Document) {
    let units = match names.len() {
        0 => return,
        1..=3 => names.join(", "),
        more => format!("{more} units"),
    };
    document.note(
        Importance::Warning,
        format!("beyond linear theory: {units}: {CONFIRM}"),
    );
}

/// What was asked, and where.
#[derive(Debug, Clone)]
pub(crate) struct Question {
    /// The limits.
    pub limits: Vec<Limit>,
    /// The places of the outage.
    pub outages: Vec<Outage>,
}

impl Question {
    /// `p95_m ≤ 5 after an outage of 60 s (the worst of 541 starts tried, 300 to 840 s)`
    pub(super) fn in_words(&self) -> String {
        let first = self.outages[0];
        let worst = if self.outages.len() > 1 {
            "the worst of "
        } else {
            ""
        };
        let length = seconds(first.end_s - first.start_s);
        format!(
            "{} after an outage of {length} s ({worst}{})",
            self.limits_in_words(),
            self.starts()
        )
    }

    /// Places where the outage was tried: `541 starts tried, 300 to 840 s`, or `from 300 s on`.
    pub(super) fn starts(&self) -> String {
        let [first, last] =
            [self.outages.first(), self.outages.last()].map(|o| o.map_or(0.0, |o| o.start_s));
        if last > first {
            format!(
                "{} starts tried, {} to {} s",
                self.outages.len(),
                seconds(first),
                seconds(last)
            )
        } else {
            format!("from {} s on", seconds(first))
        }
    }

    /// The quantity that curves of units show: one for all, that of the first limit.
    pub(super) fn curve_of(&self) -> Quantity {
        self.limits[0].quantity
    }

    pub(super) fn limits_in_words(&self) -> String {
        let limit = |l: &Limit| format!("{} ≤ {}", l.quantity.name(), readable(l.most));
        self.limits.iter().map(limit).collect::<Vec<_>>().join(", ")
    }

    pub(super) fn json(&self) -> Value {
        let limit = |l: &Limit| json!({ "quantity": l.quantity.name(), "most": l.most });
        let outage = |o: &Outage| json!({ "start_s": o.start_s, "end_s": o.end_s });
        json!({
            "limits": self.limits.iter().map(limit).collect::<Vec<_>>(),
            "outages": self.outages.iter().map(outage).collect::<Vec<_>>(),
        })
    }

    /// `p95_m 4.87 at the end of outage 300–360 s`
    pub(super) fn worst(&self, worst: &Worst) -> String {
        let outage = self.outages.get(worst.place).unwrap_or(&self.outages[0]);
        let place = window(outage.start_s, outage.end_s);
        format!(
            "{} {} at the end of outage {place}",
            worst.limit.quantity.name(),
            readable(worst.value)
        )
    }
}

/// A quantity and its unit, for axes and heads.
pub(super) const fn quantity_in_words(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::P50 => "horizontal error, median (m)",
        Quantity::P95 => "horizontal error, 95 % quantile (m)",
        Quantity::Rmse => "horizontal error, RMSE (m)",
        Quantity::Angle(0) => "roll, RMSE (°)",
        Quantity::Angle(1) => "pitch, RMSE (°)",
        Quantity::Angle(_) => "yaw, RMSE (°)",
    }
}

pub(super) fn points_json(curve: &DriftCurve) -> Vec<Value> {
    CURVE_S
        .iter()
        .zip(curve)
        .map(|(s, x)| json!({ "outage_s": s, "value": x }))
        .collect()
}

pub(super) fn drift_chart(quantity: Quantity, series: Vec<Series>) -> Chart {
    let panel = Panel {
        height: 1.3,
        ..Panel::new(Axis::log(quantity_in_words(quantity)), series)
    };
    Chart::new(
        "Drift without fixes",
        Axis::log("length of the outage (s)"),
        vec![panel],
    )
}

pub(super) fn points(curve: &DriftCurve) -> Vec<(f64, f64)> {
    CURVE_S
        .iter()
        .zip(curve)
        .map(|(s, x)| (f64::from(*s), x.unwrap_or(f64::NAN)))
        .collect()
}

pub(super) fn value(x: Option<f64>, pointer: &str) -> Cell {
    x.map_or_else(|| Cell::figures("–"), |x| Cell::number(x, pointer))
}
