//! Units of a catalogue against a limit.

use super::given::Longest;
use super::{
    CHECKED, CONFIRM, DRIFT, DriftPoint, Question, drift_chart, points, quantity_in_words,
};
use nav_sim_document::{Colour, Document, Importance, Mark, Series, Table, Tone};
use nav_sim_navigation::require::{Quantity, Worst};
use nav_sim_navigation::sensors::outage::Outage;
use serde::Serialize;

/// What a ranking takes for granted.
const RULE: &str = "A figure that is missing counts as none: open means that the limit would be kept then. Turn-on bias is the repeatability from one switching-on to the next; an initial tolerance of the zero offset counts as removed before use. Figures named without a sensor are missing for both.";

/// A unit of a catalogue.
#[derive(Debug, Clone, Serialize)]
pub(super) struct RankedUnit {
    pub(super) unit: String,
    /// True if the limits are kept by figures that are all stated.
    pub(super) met: bool,
    /// `met`, `not met`, or `open` where figures are missing.
    pub(super) kept: &'static str,
    /// Figures that its datasheet does not state: they count as zero.
    pub(super) not_stated: Vec<String>,
    /// The same in words.
    pub(super) missing: String,
    /// The hardest limit for the outage asked for.
    #[serde(flatten)]
    pub(super) worst: Worst,
    pub(super) outage: Longest,
    /// The quantity of the first limit, at its worst place, after outages of growing length.
    pub(super) curve: Vec<DriftPoint>,
    /// The outage asked for, where it is beyond linear theory.
    pub(super) beyond_linear: Option<Outage>,
}

/// Units against limits: those whose figures are all stated, the best first, then the others by name.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Ranking {
    pub(super) schema_version: u32,
    pub(super) question: Question,
    pub(super) curve_quantity: Quantity,
    pub(super) units: Vec<RankedUnit>,
}

impl Ranking {
    /// True if a unit keeps the limits, by figures that are all stated.
    pub(crate) fn is_met(&self) -> bool {
        self.units.iter().any(|unit| unit.met)
    }

    fn verdict(&self) -> Vec<String> {
        let count = self.units.iter().filter(|u| u.met).count();
        let answer = match self.units.iter().find(|u| u.met) {
            None => "no unit keeps the limit by figures that are all stated".to_owned(),
            Some(best) => format!(
                "{} is the best of {count} units that keep the limit",
                best.unit
            ),
        };
        let mut lines = vec![answer, format!("asked: {}", self.question.in_words())];
        let missing = self
            .units
            .iter()
            .filter(|u| !u.not_stated.is_empty())
            .count();
        if missing > 0 {
            lines.push(format!(
                "{missing} units are not ranked: their data sheets leave figures out (--verbose lists them)"
            ));
        }
        lines
    }

    fn curves(&self) -> Vec<Series> {
        // more hues cannot be told apart
        const COLOURED: usize = 6;
        let curve =
            |(k, unit): (usize, &RankedUnit)| match k < COLOURED && unit.not_stated.is_empty() {
                true => Series::line(&unit.unit, Colour::Hue(k), points(&unit.curve)),
                false => Series::thin("others", Colour::Soft, points(&unit.curve)),
            };
        let most = Mark::Level(self.question.limits[0].most);
        // what stands behind is drawn first
        std::iter::once(Series::new("limit", Colour::Ink, most))
            .chain(self.units.iter().enumerate().rev().map(curve))
            .collect()
    }

    /// Verdict, tables and charts.
    pub(super) fn document(&self) -> Document {
        let tone = Tone::from(self.is_met());
        let mut document = Document::new("IMUs against a limit", tone, self.verdict());
        let beyond = self.units.iter().filter(|u| u.beyond_linear.is_some());
        let names: Vec<&str> = beyond.map(|u| u.unit.as_str()).collect();
        if !names.is_empty() {
            let text = format!("beyond linear theory: {}: {CONFIRM}", names.join(", "));
            document.note(Importance::Warning, text);
        }
        let quantity = quantity_in_words(self.curve_quantity);
        let columns = format!(
            "1 s … 300 s: {quantity} after such an outage; bridges: longest outage within the limits"
        );
        document.note(Importance::Remark, columns);
        document.section("Ranking");
        let columns = [
            ("unit", "unit"),
            ("limit", "kept"),
            ("bridges", "outage/text"),
            ("{outage_s} s", "curve/*/value"),
        ];
        document.lead(Table::of(self, "/units/*", &columns));
        document.chart(&drift_chart(self.curve_quantity, self.curves()), DRIFT);
        document.section("Figures that are missing");
        let columns = [("unit", "unit"), ("not stated", "missing")];
        document.table(&Table::of(self, "/units/*", &columns));
        document.text(RULE);
        document.checked(CHECKED);
        document
    }
}

/// `bias, accel turn-on`: figures that both sensors lack are named once.
pub(crate) fn stated_in_words(not_stated: &[String]) -> String {
    let mut words = not_stated.join(", ").replace('_', "-");
    for figure in ["noise", "bias", "turn-on"] {
        words = words.replace(&format!("accel {figure}, gyro {figure}"), figure);
    }
    words
}
