//! A given IMU against its limits.

use super::{
    CHECKED, DRIFT, DriftPoint, LONGEST_S, Question, drift_chart, note_beyond, points,
    quantity_in_words,
};
use nav_sim_document::{Colour, Document, Mark, Series, Table, Tone, readable};
use nav_sim_navigation::require::{Margins, Quantity, Worst};
use nav_sim_navigation::sensors::outage::Outage;
use serde::Serialize;

/// The longest outage that keeps the limits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Longest {
    /// Its length (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longest_s: Option<f64>,
    /// All that was looked at (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_least_s: Option<f64>,
    pub text: String,
}

impl Longest {
    /// Length that is bridged (s).
    pub(super) fn length_s(&self) -> f64 {
        self.longest_s.or(self.at_least_s).unwrap_or_default()
    }

    fn in_words(&self) -> String {
        let text = &self.text;
        match self.at_least_s {
            Some(s) if s < LONGEST_S => format!("{text}, to the end of the trajectory"),
            Some(_) => format!("{text}, longer ones are not looked at"),
            None => text.clone(),
        }
    }
}

/// A model against its limits.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct GivenImu {
    pub(super) schema_version: u32,
    pub(super) question: Question,
    pub(super) outage: Longest,
    /// The quantity of each limit, at its worst place, after outages of growing length.
    pub(super) curves: Vec<LimitCurve>,
    /// The outage of the answer, where it is beyond linear theory.
    pub(crate) beyond_linear: Option<Outage>,
    /// With and without what the vehicle knows of its own motion; empty where that is not asked.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) aidings: Vec<Aided>,
    /// After the outage that was asked for; none where the longest is sought.
    #[serde(flatten)]
    pub(super) judged: Option<Margins>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct LimitCurve {
    pub quantity: Quantity,
    pub points: Vec<DriftPoint>,
}

/// Limits where the vehicle measures something of its own motion.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Aided {
    pub aiding: &'static str,
    /// The hardest limit; none where no place has an outage of that length.
    #[serde(flatten)]
    pub worst: Option<Worst>,
    pub outage: Longest,
}

impl GivenImu {
    fn verdict(&self) -> Vec<String> {
        let (question, longest) = (&self.question, self.outage.in_words());
        let Some(judged) = &self.judged else {
            let (limits, starts) = (question.limits_in_words(), question.starts());
            return vec![format!(
                "longest outage within {limits}: {longest} ({starts})"
            )];
        };
        let word = if judged.met { "met" } else { "NOT met" };
        let times = readable(judged.worst.value / judged.worst.limit.most);
        let without = &judged.without_imu_errors;
        let (name, left) = (without.limit.quantity, readable(without.value));
        vec![
            format!(
                "{word}: {}, {times} times the limit",
                question.worst(&judged.worst)
            ),
            format!("asked: {}", question.in_words()),
            format!("longest outage within the limits, from the same starts: {longest}"),
            match without.margin() >= 0.0 {
                true => format!("an IMU without errors would leave {name} {left}"),
                false => {
                    format!("no IMU keeps the limit: GNSS and start alone leave {name} {left}")
                }
            },
        ]
    }

    /// Verdict, tables and charts.
    pub(super) fn document(&self) -> Document {
        let is_good = match &self.judged {
            Some(judged) => judged.met,
            None => self.outage.length_s() > 0.0,
        };
        let mut document = Document::new(
            "An IMU against its limits",
            Tone::from(is_good),
            self.verdict(),
        );
        note_beyond(self.beyond_linear, &mut document);
        if !self.aidings.is_empty() {
            document.section("What the car knows of its own motion");
            let columns = [
                ("aiding", "aiding"),
                ("error after the outage", "value"),
                ("quantity", "quantity"),
                ("limit", "limit"),
                ("longest outage within the limits", "outage/text"),
            ];
            document.lead(Table::of(self, "/aidings/*", &columns));
        }
        document.section("Error against the length of an outage");
        for (k, (limit, curve)) in self.question.limits.iter().zip(&self.curves).enumerate() {
            let mut series = vec![Series::new("limit", Colour::RIGHT, Mark::Level(limit.most))];
            let points = points(&curve.points);
            series.extend(Series::dotted_line("this IMU", Colour::REAL, points));
            document.chart(&drift_chart(limit.quantity, series), DRIFT);
            let columns = [
                ("outage (s)", "outage_s"),
                (quantity_in_words(limit.quantity), "value"),
            ];
            let rows = format!("/curves/{k}/points/*");
            document.table(&Table::of(self, &rows, &columns));
        }
        document.checked(CHECKED);
        document
    }
}
