//! A given IMU against its limits.

use super::{
    BeyondLinear, CHECKED, CURVE_S, DRIFT, DriftCurve, LONGEST_S, Question, drift_chart, points,
    points_json, quantity_in_words, value,
};
use nav_sim_document::{Cell, Colour, Document, Mark, Series, Table, Tone, readable, seconds};
use nav_sim_navigation::require::{Limit, Margins, Worst};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

/// The longest outage that keeps the limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Longest {
    /// So long (s).
    Seconds(f64),
    /// All that was looked at (s).
    AtLeast(f64),
    /// None: a limit is exceeded where every fix comes. The hardest, just before a fix.
    Never(Worst),
}

impl Longest {
    /// What is bridged (s).
    pub(super) const fn length_s(self) -> f64 {
        match self {
            Self::Seconds(s) | Self::AtLeast(s) => s,
            Self::Never(_) => 0.0,
        }
    }

    /// In a cell of a table.
    pub(super) fn in_short(self) -> String {
        match self {
            // curves begin with the first second: what is not kept then may be kept for a part of it
            Self::Seconds(s) if s < 1.0 => "less than 1 s".to_owned(),
            Self::Seconds(s) => format!("{} s", seconds(s)),
            Self::AtLeast(s) => format!("≥ {} s", seconds(s)),
            Self::Never(_) => "none".to_owned(),
        }
    }

    fn in_words(self) -> String {
        match self {
            Self::AtLeast(s) if s < LONGEST_S => {
                format!("{}, to the end of the trajectory", self.in_short())
            }
            Self::AtLeast(_) => format!("{}, longer ones are not looked at", self.in_short()),
            Self::Never(worst) => {
                let (name, value) = (worst.limit.quantity.name(), readable(worst.value));
                format!("none; even without an outage {name} is {value} just before a fix")
            }
            Self::Seconds(_) => self.in_short(),
        }
    }

    pub(super) fn json(self) -> Value {
        match self {
            Self::Seconds(s) => json!({ "longest_s": s }),
            Self::AtLeast(s) => json!({ "at_least_s": s }),
            Self::Never(worst) => {
                let (quantity, most) = (worst.limit.quantity.name(), worst.limit.most);
                let with_all_fixes =
                    json!({ "quantity": quantity, "value": worst.value, "limit": most });
                json!({ "longest_s": 0.0, "with_all_fixes": with_all_fixes })
            }
        }
    }
}

/// A model against its limits.
#[derive(Debug, Clone)]
pub(crate) struct GivenImu {
    /// Margins after the outage that was asked for; none where the longest is sought.
    pub margins: Option<Margins>,
    /// What was asked, and where.
    pub question: Question,
    /// The longest outage within the limits.
    pub(super) longest: Longest,
    /// The quantity of each limit, at its worst place, after outages of growing length.
    pub(super) curves: Vec<DriftCurve>,
    /// With and without what the vehicle knows of its own motion; empty where that is not asked.
    pub(super) aidings: Vec<Aided>,
    /// Where the answer is beyond linear theory.
    pub beyond_linear: Option<BeyondLinear>,
}

/// Limits where the vehicle measures something of its own motion.
#[derive(Debug, Clone)]
pub(super) struct Aided {
    pub(super) name: &'static str,
    /// The hardest limit; none where no place has an outage of that length.
    pub(super) worst: Option<Worst>,
    pub(super) longest: Longest,
}

impl GivenImu {
    /// A row for each aiding.
    fn aiding_table(&self) -> Table {
        let mut table = Table::new([
            "aiding",
            "error after the outage",
            "limit",
            "longest outage within the limits",
        ]);
        for (
            i,
            Aided {
                name,
                worst,
                longest,
            },
        ) in self.aidings.iter().enumerate()
        {
            let error = match worst {
                Some(worst) => Cell::number(worst.value, &format!("/aidings/{i}/value")),
                None => Cell::figures("–"),
            };
            let limit = worst.as_ref().map_or(String::new(), |worst| {
                format!(
                    "{} ≤ {}",
                    worst.limit.quantity.name(),
                    readable(worst.limit.most)
                )
            });
            table.row([
                (*name).into(),
                error,
                Cell::figures(limit),
                Cell::figures(longest.in_short()),
            ]);
        }
        table
    }

    fn verdict(&self) -> Vec<String> {
        let (question, longest) = (&self.question, self.longest.in_words());
        let Some(margins) = &self.margins else {
            let (limits, starts) = (question.limits_in_words(), question.starts());
            return vec![format!(
                "longest outage within {limits}: {longest} ({starts})"
            )];
        };
        let word = if margins.met() { "met" } else { "NOT met" };
        let times = readable(margins.worst.value / margins.worst.limit.most);
        let mut lines = vec![
            format!(
                "{word}: {}, {times} times the limit",
                question.worst(&margins.worst)
            ),
            format!("asked: {}", question.in_words()),
            format!("longest outage within the limits, from the same starts: {longest}"),
        ];
        lines.push(Self::what_an_imu_may_do(margins));
        lines
    }

    /// Whether a better IMU helps.
    fn what_an_imu_may_do(margins: &Margins) -> String {
        let without = readable(margins.without_imu.value);
        let name = margins.without_imu.limit.quantity.name();
        match margins.an_imu_helps() {
            true => format!("an IMU without errors would leave {name} {without}"),
            false => format!("no IMU keeps the limit: GNSS and start alone leave {name} {without}"),
        }
    }

    fn drift_table(&self) -> Table {
        let names = self
            .question
            .limits
            .iter()
            .map(|l| quantity_in_words(l.quantity).to_owned());
        let mut table = Table::new(["outage (s)"]).and(names);
        for (k, length_s) in CURVE_S.iter().enumerate() {
            let cell = |(i, curve): (usize, &DriftCurve)| {
                value(curve[k], &format!("/curves/{i}/points/{k}/value"))
            };
            let first = Cell::figures(length_s.to_string());
            table.row(std::iter::once(first).chain(self.curves.iter().enumerate().map(cell)));
        }
        table
    }
}

impl GivenImu {
    /// Verdict, tables and charts.
    pub(super) fn document(&self) -> Document {
        let is_good = match &self.margins {
            Some(margins) => margins.met(),
            None => self.longest.length_s() > 0.0,
        };
        let mut document = Document::new(
            "An IMU against its limits",
            Tone::from(is_good),
            self.verdict(),
        );
        BeyondLinear::note(self.beyond_linear.as_ref(), &mut document);
        if !self.aidings.is_empty() {
            document.section("What the car knows of its own motion");
            document.lead(self.aiding_table());
        }
        document.section("Error against the length of an outage");
        for (limit, curve) in self.question.limits.iter().zip(&self.curves) {
            let mut series = vec![Series::new("limit", Colour::RIGHT, Mark::Level(limit.most))];
            series.extend(Series::dotted_line("this IMU", Colour::REAL, points(curve)));
            document.chart(&drift_chart(limit.quantity, series), DRIFT);
        }
        document.table(&self.drift_table());
        document.checked(CHECKED);
        document
    }
}

impl Serialize for GivenImu {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let curve = |(limit, curve): (&Limit, &DriftCurve)| json!({ "quantity": limit.quantity.name(), "points": points_json(curve) });
        let mut file = json!({
            "schema_version": 1,
            "question": self.question.json(),
            "outage": self.longest.json(),
            "curves": self.question.limits.iter().zip(&self.curves).map(curve).collect::<Value>(),
            "beyond_linear": self.beyond_linear,
        });
        if !self.aidings.is_empty() {
            let aided = |Aided {
                             name,
                             worst,
                             longest,
                         }: &Aided| {
                json!({
                    "aiding": name,
                    "quantity": worst.map(|w| w.limit.quantity.name()),
                    "value": worst.map(|w| w.value),
                    "outage": longest.json(),
                })
            };
            file["aidings"] = self.aidings.iter().map(aided).collect();
        }
        if let Some(margins) = &self.margins {
            let without = &margins.without_imu;
            file["met"] = json!(margins.met());
            file["quantity"] = json!(margins.worst.limit.quantity.name());
            file["value"] = json!(margins.worst.value);
            file["limit"] = json!(margins.worst.limit.most);
            file["place"] = json!(margins.worst.place);
            file["without_imu_errors"] =
                json!({ "quantity": without.limit.quantity.name(), "value": without.value });
        }
        file.serialize(serializer)
    }
}
