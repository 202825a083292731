//! Sizes that charts are drawn in, and text in them.

use crate::escape::escape;
use std::fmt::Write as _;

/// A size to draw in.
pub(crate) struct Canvas {
    /// Class of the style sheet.
    pub(crate) class: &'static str,
    pub(crate) width: f64,
    /// Usual height of a panel.
    pub(crate) panel: f64,
    /// Size of text.
    pub(crate) font: f64,
    /// About how many labels the x axis has.
    pub(crate) labels: usize,
    /// Most that a map may be high.
    pub(crate) map: f64,
}

pub(crate) const WIDE: Canvas = Canvas {
    class: "wide",
    width: 960.0,
    panel: 250.0,
    font: 14.0,
    labels: 10,
    map: 480.0,
};
pub(crate) const NARROW: Canvas = Canvas {
    class: "narrow",
    width: 358.0,
    panel: 200.0,
    font: 12.0,
    labels: 5,
    map: 340.0,
};
pub(crate) const SMALL: Canvas = Canvas {
    class: "small",
    width: 310.0,
    panel: 150.0,
    font: 12.0,
    labels: 5,
    map: 260.0,
};

/// A text at a place; `anchor`: which part of it stands there.
pub(crate) fn text(svg: &mut String, class: &str, (x, y): (f64, f64), anchor: &str, words: &str) {
    let words = escape(words);
    let _ = writeln!(
        svg,
        "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>"
    );
}
