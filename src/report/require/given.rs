//! What a given IMU makes of the limits, in words and as JSON.

use super::{BeyondLinear, CURVE_S, LONGEST_S, Question, points_json};
use crate::report::markdown_table;
use crate::report::number::{percent, readable, seconds};
use nav_sim_navigation::require::{Limit, Margins, PartMargin, Worst};
use serde_json::{Value, json};

/// The longest outage that keeps the limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Longest {
    /// So long (s).
    Seconds(f64),
    /// All that was looked at (s).
    AtLeast(f64),
    /// None: a limit is exceeded where every fix comes. The hardest, just before a fix.
    Never(Worst),
}

/// What a model bridges.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bridged {
    /// The longest outage within the limits.
    pub longest: Longest,
    /// The quantity of each limit, at its worst place, after [`CURVE_S`]; none where the trajectory is too short.
    pub curves: Vec<[Option<f64>; CURVE_S.len()]>,
}

impl Bridged {
    fn json(&self, question: &Question) -> Value {
        let curve = |(limit, curve): (&Limit, &[Option<f64>; CURVE_S.len()])| json!({ "quantity": limit.quantity.name(), "points": points_json(curve) });
        question.limits.iter().zip(&self.curves).map(curve).collect()
    }
}

impl Longest {
    /// What is bridged (s).
    pub(crate) const fn length_s(self) -> f64 {
        match self {
            Self::Seconds(s) | Self::AtLeast(s) => s,
            Self::Never(_) => 0.0,
        }
    }

    /// In a cell of a table.
    pub(super) fn in_short(self) -> String {
        match self {
            Self::Seconds(s) => at_least_a_second(s),
            Self::AtLeast(s) => format!("≥ {} s", seconds(s)),
            Self::Never(_) => "none".to_owned(),
        }
    }

    fn in_words(self) -> String {
        match self {
            Self::Seconds(s) => at_least_a_second(s),
            Self::AtLeast(s) if s < LONGEST_S => {
                format!("at least {} s, from the earliest start to the end of the trajectory", seconds(s))
            }
            Self::AtLeast(s) => format!("at least {} s; longer ones are not looked at", seconds(s)),
            Self::Never(worst) => format!(
                "none; even without an outage {} is {} just before a fix, {} times the limit",
                worst.limit.quantity.name(),
                readable(worst.value),
                readable(worst.value / worst.limit.most)
            ),
        }
    }

    pub(super) fn json(self) -> Value {
        match self {
            Self::Seconds(s) => json!({ "longest_s": s }),
            Self::AtLeast(s) => json!({ "at_least_s": s }),
            Self::Never(worst) => {
                let with_all_fixes = json!({ "quantity": worst.limit.quantity.name(), "value": worst.value, "limit": worst.limit.most });
                json!({ "longest_s": 0.0, "with_all_fixes": with_all_fixes })
            }
        }
    }
}

/// Curves begin with the first second: what is not kept then may be kept for a part of it.
fn at_least_a_second(length_s: f64) -> String {
    if length_s < 1.0 { "less than 1 s".to_owned() } else { format!("{} s", seconds(length_s)) }
}

/// A model against its limits.
#[derive(Debug, Clone)]
pub(crate) struct GivenImu {
    /// Margins after the outage that was asked for; none where the longest is sought.
    pub margins: Option<Margins>,
    /// What was asked, and where.
    pub question: Question,
    /// What the model bridges.
    pub bridged: Bridged,
    /// Where the answer is beyond linear theory.
    pub beyond_linear: Option<BeyondLinear>,
}

impl GivenImu {
    /// The answer, and where linear theory does not cover it.
    pub(crate) fn verdict(&self) -> String {
        let (question, longest) = (&self.question, self.bridged.longest.in_words());
        let answer = match &self.margins {
            Some(margins) => {
                let times = readable(margins.worst.value / margins.worst.limit.most);
                let word = if margins.met() { "met" } else { "NOT met" };
                let starts =
                    if question.outages.len() > 1 { "from the same starts" } else { "from there on" };
                format!(
                    "{word}: {}; {}, {times} times the limit; longest outage within the limits, {starts}: {longest}",
                    question.in_words(),
                    question.worst(&margins.worst)
                )
            }
            None => format!(
                "longest outage within the limits ({}), {}: {longest}",
                question.limits_in_words(),
                question.starts()
            ),
        };
        answer + &BeyondLinear::line(self.beyond_linear.as_ref())
    }

    /// The verdict, and what decides.
    pub(crate) fn text(&self) -> String {
        match &self.margins {
            Some(margins) => {
                let (table, decides) =
                    (markdown_table(&margins_rows(margins)), what_decides(margins, &self.question));
                format!("{}\n\n{table}\n\n{decides}", self.verdict())
            }
            None => self.verdict(),
        }
    }

    /// Whether the limits are kept; of the longest outage, whether there is one.
    pub(crate) fn is_good(&self) -> bool {
        match &self.margins {
            Some(margins) => margins.met(),
            None => !matches!(self.bridged.longest, Longest::Never(_) | Longest::Seconds(0.0)),
        }
    }

    /// All of it.
    pub(crate) fn json(&self) -> String {
        let mut answer = json!({
            "schema_version": 1,
            "question": self.question.json(),
            "outage": self.bridged.longest.json(),
            "curves": self.bridged.json(&self.question),
            "beyond_linear": self.beyond_linear,
        });
        if let Some(margins) = &self.margins {
            let part =
                |p: &PartMargin| json!({ "part": p.part.name(), "share": p.share, "factor": p.factor });
            answer["met"] = json!(margins.met());
            answer["quantity"] = json!(margins.worst.limit.quantity.name());
            answer["value"] = json!(margins.worst.value);
            answer["limit"] = json!(margins.worst.limit.most);
            answer["place"] = json!(margins.worst.place);
            answer["parts"] = margins.parts.iter().map(part).collect();
            answer["binding"] = json!(margins.binding().map(|p| p.part.name()));
            answer["share_of_imu"] = json!(margins.share_of_imu());
            let without = &margins.without_imu;
            answer["without_imu_errors"] =
                json!({ "quantity": without.limit.quantity.name(), "value": without.value });
        }
        crate::report::json(&answer)
    }
}

/// Each part with its name, the largest marked, and the factor on it that meets the limit, as text where it is none.
pub(crate) fn parts_in_words(margins: &Margins) -> impl Iterator<Item = (String, &PartMargin, String)> {
    let binding = margins.binding().map(|binding| binding.part);
    margins.parts.iter().map(move |p| {
        let mark = if Some(p.part) == binding { " (binding)" } else { "" };
        let factor = match p.factor {
            Some(f) if f >= 1.0 => format!("× {} (slack: so much worse it may be)", readable(f)),
            Some(f) => format!("× {}", readable(f)),
            None if !p.part.is_of_imu() => String::new(),
            None if margins.met() => "any value".to_owned(),
            None => "none: the rest is too large".to_owned(),
        };
        (p.part.name() + mark, p, factor)
    })
}

/// What decides, and whether a better IMU helps.
pub(crate) fn what_decides(margins: &Margins, question: &Question) -> String {
    let Some(binding) = margins.binding() else { return String::new() };
    let of_imu = percent(margins.share_of_imu());
    let without = question.worst(&margins.without_imu);
    let better = if margins.an_imu_helps() {
        format!("an IMU without errors would leave {without}")
    } else {
        format!("no IMU keeps the limit: one without errors would leave {without}, from GNSS and start")
    };
    format!(
        "{} decides ({}); the whole IMU takes {of_imu} of the mean square; {better}",
        binding.part.name(),
        percent(binding.share)
    )
}

fn margins_rows(margins: &Margins) -> Vec<Vec<String>> {
    let head = ["part of the error", "share", "factor on its sigma that alone meets the limit"];
    let row = |(name, p, factor): (String, &PartMargin, String)| vec![name, percent(p.share), factor];
    std::iter::once(head.map(str::to_owned).to_vec()).chain(parts_in_words(margins).map(row)).collect()
}
