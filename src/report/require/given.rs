//! What a given IMU makes of the limits, in words and as JSON.

use super::{BeyondLinear, CURVE_S, LONGEST_S, Question, points_json, share};
use crate::report::markdown_table;
use crate::report::number::{readable, seconds};
use nav_sim_navigation::require::{GroupMargin, Limit, Margins, Worst};
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
                format!("at least {} s, which is as long as this trajectory allows", seconds(s))
            }
            Self::AtLeast(s) => format!("at least {} s; longer ones are not looked at", seconds(s)),
            Self::Never(worst) => format!(
                "none; even without an outage {} is {} just before a fix, {} of the limit",
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
                format!(
                    "{word}: {}; {}, {times} of the limit; longest outage within the limits: {longest}",
                    question.in_words(),
                    question.worst(&margins.worst)
                )
            }
            None => format!("longest outage within the limits ({}): {longest}", question.limits_in_words()),
        };
        answer + &BeyondLinear::line(self.beyond_linear.as_ref())
    }

    /// The verdict, and what decides.
    pub(crate) fn text(&self) -> String {
        match &self.margins {
            Some(margins) => format!("{}\n\n{}", self.verdict(), markdown_table(&margins_rows(margins))),
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
            let group =
                |g: &GroupMargin| json!({ "part": g.group.name(), "share": g.share, "factor": g.factor });
            answer["met"] = json!(margins.met());
            answer["quantity"] = json!(margins.worst.limit.quantity.name());
            answer["value"] = json!(margins.worst.value);
            answer["limit"] = json!(margins.worst.limit.most);
            answer["place"] = json!(margins.worst.place);
            answer["groups"] = margins.groups.iter().map(group).collect();
            answer["share_of_drifts"] = json!(margins.drift);
            answer["share_of_the_rest"] = json!(margins.rest);
        }
        crate::report::json(&answer)
    }
}

/// A row for each part of the IMU.
fn margins_rows(margins: &Margins) -> Vec<Vec<String>> {
    let mut rows = vec![
        ["part of the error", "share", "factor on its sigma that alone meets the limit"]
            .map(str::to_owned)
            .to_vec(),
    ];
    let largest = margins.groups.iter().map(|g| g.share).fold(0.0, f64::max);
    let binding = |g: &GroupMargin| if g.share == largest { " (binding)" } else { "" };
    for g in &margins.groups {
        let factor = match g.factor {
            Some(f) if f >= 1.0 => format!("× {} (slack: so much worse it may be)", readable(f)),
            Some(f) => format!("× {}", readable(f)),
            None if margins.met() => "any value".to_owned(),
            None => "none: the rest is too large".to_owned(),
        };
        rows.push(vec![format!("{}{}", g.group.name(), binding(g)), share(g.share), factor]);
    }
    if margins.drift > 0.0 {
        rows.push(vec!["drift".to_owned(), share(margins.drift), String::new()]);
    }
    rows.push(vec!["GNSS, start, turn-on biases".to_owned(), share(margins.rest), String::new()]);
    rows
}
