//! How a target's file is laid out.

use super::{Entry, Export, Values};
use nav_sim_signal::noise::practical::Bias;

/// Lines of all entries together.
pub(super) type Blocks = fn(&[Entry]) -> Vec<String>;

/// A target's parameters and the syntax of its file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// The parameters, in the target's units.
    pub(super) entries: fn(&Values) -> Vec<Entry>,
    /// What it takes a bias for.
    pub(super) bias: Bias,
    /// What begins a comment, and what ends it.
    pub(super) comment: &'static str,
    pub(super) comment_end: &'static str,
    /// A line that must be the very first.
    pub(super) first: Option<&'static str>,
    /// Lines before the entries.
    pub(super) open: &'static str,
    /// Lines after them.
    pub(super) close: &'static str,
    /// One entry.
    pub(super) line: fn(&Entry) -> String,
    /// All entries, where they stand in blocks.
    pub(super) blocks: Option<Blocks>,
    /// The document that keys and units are from.
    pub(super) source: &'static str,
}

/// Entries as in YAML below a head of `#` comments, with a bias that walks.
pub(super) const PLAIN: Layout = Layout {
    entries: |_| Vec::new(),
    bias: Bias::Walk,
    comment: "#",
    comment_end: "",
    first: None,
    open: "",
    close: "",
    line: yaml,
    blocks: None,
    source: "",
};

impl Export {
    /// The file: a head of comments that says what it is and how good it is, then the parameters. `model` is the name of
    /// the model file.
    pub fn text(&self, model: &str) -> String {
        let layout = self.target.layout();
        let mut lines: Vec<String> = layout.first.iter().map(|l| (*l).to_owned()).collect();
        let mut head = self.head(model);
        head.push(format!("Keys and units: {}", layout.source));
        // two hyphens end the comment of XML
        let said = |l: &String| {
            if layout.comment_end.is_empty() {
                l.clone()
            } else {
                l.replace("--", "- -")
            }
        };
        lines.extend(
            head.iter()
                .map(|l| format!("{} {}{}", layout.comment, said(l), layout.comment_end)),
        );
        lines.extend((!layout.open.is_empty()).then(|| layout.open.to_owned()));
        match layout.blocks {
            Some(blocks) => lines.extend(blocks(&self.entries)),
            None => lines.extend(self.entries.iter().map(layout.line)),
        }
        lines.extend((!layout.close.is_empty()).then(|| layout.close.to_owned()));
        lines.join("\n")
    }
}

/// A number that reads back to the same, with a point: YAML 1.1 takes `2e-5` for a text.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0.0".to_owned();
    }
    if (1e-3..1e6).contains(&value.abs()) {
        let plain = format!("{value}");
        return if plain.contains('.') {
            plain
        } else {
            plain + ".0"
        };
    }
    let text = format!("{value:e}");
    match text.split_once('e') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0e{exponent}"),
        _ => text,
    }
}

/// Unit, meaning, and what the range of the target does not hold.
pub(super) fn remark(entry: &Entry) -> String {
    let wanted = entry.wanted.map(|w| {
        format!(
            "; the model says {}, outside the documented range",
            number(w)
        )
    });
    format!(
        "{}; {}{}",
        entry.unit,
        entry.meaning,
        wanted.unwrap_or_default()
    )
}

/// Three equal axes, between commas.
pub(super) fn triple(value: f64) -> String {
    [number(value), number(value), number(value)].join(", ")
}

/// `key: value  # unit; meaning`
pub(super) fn yaml(entry: &Entry) -> String {
    format!(
        "{}: {}  # {}",
        entry.key,
        number(entry.value),
        remark(entry)
    )
}
