//! Units of a catalogue against a limit.

use super::given::Longest;
use super::{
    BeyondLinear, CHECKED, CURVE_S, DRIFT, DriftCurve, Question, drift_chart, points, points_json,
    quantity_in_words, value, warn_of_units,
};
use nav_sim_document::{Cell, Colour, Document, Importance, Mark, Series, Table, Tone};
use nav_sim_navigation::require::Worst;
use serde::{Serialize, Serializer};
use serde_json::json;

/// What a ranking takes for granted.
const RULE: &str = "Turn-on bias is the repeatability from one switching-on to the next; an initial tolerance of the zero offset counts as removed before use. Figures named without a sensor are missing for both.";

/// A unit of a catalogue.
#[derive(Debug, Clone)]
pub(super) struct RankedUnit {
    /// Its name.
    pub(super) name: String,
    /// Figures that its datasheet does not state: they count as zero.
    pub(super) not_stated: Vec<String>,
    /// The hardest limit for the outage asked for.
    pub(super) worst: Worst,
    /// The quantity of the first limit, at its worst place, after outages of growing length.
    pub(super) curve: DriftCurve,
    /// The longest outage within the limits.
    pub(super) longest: Longest,
    /// Where its figure for the outage asked for is beyond linear theory.
    pub(super) beyond_linear: Option<BeyondLinear>,
}

impl RankedUnit {
    pub(super) fn is_complete(&self) -> bool {
        self.not_stated.is_empty()
    }

    /// Whether it keeps the limits, by figures that are all stated.
    fn is_met(&self) -> bool {
        self.worst.margin() >= 0.0 && self.is_complete()
    }
}

/// Units against limits: those whose figures are all stated, the best first, then the others by name.
#[derive(Debug, Clone)]
pub(crate) struct Ranking {
    pub(super) units: Vec<RankedUnit>,
    pub(super) question: Question,
}

impl Ranking {
    /// Whether a unit keeps the limits, by figures that are all stated.
    pub(crate) fn is_met(&self) -> bool {
        self.units.iter().any(RankedUnit::is_met)
    }

    fn complete(&self) -> &[RankedUnit] {
        &self.units[..self.units.partition_point(RankedUnit::is_complete)]
    }

    fn incomplete(&self) -> &[RankedUnit] {
        &self.units[self.complete().len()..]
    }

    fn verdict(&self) -> Vec<String> {
        let met: Vec<&str> = self
            .units
            .iter()
            .filter(|u| u.is_met())
            .map(|u| u.name.as_str())
            .collect();
        let asked = self.question.in_words();
        let answer = match met.as_slice() {
            [] => "no unit keeps the limit by figures that are all stated".to_owned(),
            [best, ..] => format!(
                "{best} is the best of {} units that keep the limit",
                met.len()
            ),
        };
        let mut lines = vec![answer, format!("asked: {asked}")];
        let missing = self.incomplete().len();
        if missing > 0 {
            lines.push(format!(
                "{missing} units are not ranked: their data sheets leave figures out (--verbose lists them)"
            ));
        }
        lines
    }

    /// Limit, longest outage and errors of units, whose first stands at `first` in the result.
    fn table(&self, units: &[RankedUnit], first: usize) -> Table {
        let lengths = CURVE_S.iter().map(|s| format!("{s} s"));
        let mut table = Table::new(["unit", "limit", "bridges"]).and(lengths);
        for (i, unit) in units.iter().enumerate() {
            let limit = match unit.worst.margin() >= 0.0 {
                true if unit.is_complete() => "met",
                true => "open",
                false => "not met",
            };
            let cell = |(k, x): (usize, &Option<f64>)| {
                value(*x, &format!("/units/{}/curve/{k}/value", first + i))
            };
            let begin = [
                unit.name.clone().into(),
                limit.into(),
                Cell::figures(unit.longest.in_short()),
            ];
            table.row(
                begin
                    .into_iter()
                    .chain(unit.curve.iter().enumerate().map(cell)),
            );
        }
        table
    }

    fn missing(&self) -> Table {
        let mut table = Table::new(["unit", "not stated"]);
        for unit in self.incomplete() {
            table.row([
                unit.name.clone().into(),
                stated_in_words(&unit.not_stated).into(),
            ]);
        }
        table
    }

    fn curves(&self) -> Vec<Series> {
        // more hues cannot be told apart
        const COLOURED: usize = 6;
        let curve = |(k, unit): (usize, &RankedUnit)| match k < COLOURED && unit.is_complete() {
            true => Series::line(&unit.name, Colour::Hue(k), points(&unit.curve)),
            false => Series::thin("others", Colour::Soft, points(&unit.curve)),
        };
        let limit = Series::new(
            "limit",
            Colour::Ink,
            Mark::Level(self.question.limits[0].most),
        );
        // what stands behind is drawn first
        std::iter::once(limit)
            .chain(self.units.iter().enumerate().rev().map(curve))
            .collect()
    }
}

impl Ranking {
    /// Verdict, tables and charts.
    pub(super) fn document(&self) -> Document {
        let mut document = Document::new(
            "IMUs against a limit",
            Tone::from(self.is_met()),
            self.verdict(),
        );
        let beyond = self
            .units
            .iter()
            .filter(|u| u.beyond_linear.is_some())
            .map(|u| u.name.as_str());
        warn_of_units(&beyond.collect::<Vec<_>>(), &mut document);
        let quantity = quantity_in_words(self.question.curve_of());
        let columns = format!(
            "1 s … 300 s: {quantity} after such an outage; bridges: longest outage within the limits"
        );
        document.note(Importance::Remark, columns);
        document.section("Ranking");
        document.lead(self.table(self.complete(), 0));
        document.chart(&drift_chart(self.question.curve_of(), self.curves()), DRIFT);
        if !self.incomplete().is_empty() {
            document.section("Not ranked: figures are missing");
            document.text(
                "A figure that is missing counts as none: open means that the limit would be kept then.",
            );
            document.table(&self.table(self.incomplete(), self.complete().len()));
            document.table(&self.missing());
            document.text(RULE);
        }
        document.checked(CHECKED);
        document
    }
}

impl Serialize for Ranking {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let unit = |u: &RankedUnit| {
            json!({
                "unit": u.name,
                "met": u.is_met(),
                "not_stated": u.not_stated,
                "quantity": u.worst.limit.quantity.name(),
                "value": u.worst.value,
                "place": u.worst.place,
                "outage": u.longest.json(),
                "curve": points_json(&u.curve),
                "beyond_linear": u.beyond_linear,
            })
        };
        let file = json!({
            "schema_version": 1,
            "question": self.question.json(),
            "curve_quantity": self.question.curve_of().name(),
            "units": self.units.iter().map(unit).collect::<Vec<_>>(),
        });
        file.serialize(serializer)
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
