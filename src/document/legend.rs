//! The legend above the panels.

use crate::canvas::{Canvas, text};
use crate::chart::{Chart, Mark, Series};
use std::fmt::Write as _;

/// Width of a text (pixels), rather too much: that of a wide typeface.
pub(crate) fn text_width(text: &str, font: f64) -> f64 {
    let width = |c: char| match c {
        'i' | 'j' | 'l' | 'f' | 't' | 'r' | '.' | ',' | ':' | '(' | ')' | '|' | '/' | ' ' => 0.42,
        'm' | 'w' | 'M' | 'W' | '%' | '−' => 0.95,
        c if c.is_uppercase() => 0.72,
        _ => 0.64,
    };
    font * text.chars().map(width).sum::<f64>()
}

const SWATCH: f64 = 24.0;
const SPACE: f64 = 16.0;

/// A name and all that has it; of stripes no series.
struct Entry<'a> {
    name: &'a str,
    /// The first panel that shows it, and tells it.
    panel: usize,
    series: Vec<&'a Series>,
}

/// Names that are told. One name alone is told by the axis.
pub(crate) struct Legend<'a>(Vec<Entry<'a>>);

impl<'a> Legend<'a> {
    pub(crate) fn of(chart: &'a Chart) -> Self {
        let mut entries: Vec<Entry<'a>> = Vec::new();
        for (panel, of_panel) in chart.panels.iter().enumerate() {
            for series in &of_panel.series {
                let is_beside = matches!(series.mark, Mark::Place(..) | Mark::Reading(..));
                match entries.iter_mut().find(|e| e.name == series.name) {
                    _ if series.name.is_empty() || is_beside => {}
                    Some(entry) => entry.series.push(series),
                    None => entries.push(Entry {
                        name: &series.name,
                        panel,
                        series: vec![series],
                    }),
                }
            }
        }
        let (name, stripes) = &chart.stripes;
        if !stripes.is_empty() && !chart.is_map {
            entries.push(Entry {
                name,
                panel: 0,
                series: Vec::new(),
            });
        }
        Self(entries)
    }

    /// The number of a name, of which the script knows what to hide.
    pub(crate) fn key(&self, name: &str) -> usize {
        let found = self.0.iter().position(|e| e.name == name);
        found.unwrap_or(self.0.len())
    }

    /// Draws what one panel tells, beginning behind `title`, at the height `top`; returns where it ends.
    pub(crate) fn draw(
        &self,
        panel: usize,
        title: &str,
        (left, top): (f64, f64),
        canvas: &Canvas,
        svg: &mut String,
    ) -> f64 {
        let line = canvas.font + 7.0;
        text(svg, "name", (left, top + canvas.font), "start", title);
        if self.0.len() < 2 {
            return top + line;
        }
        let (mut x, mut y) = (left, top);
        if !title.is_empty() {
            x += text_width(title, canvas.font) + SPACE;
        }
        // the place of the next entry
        let mut place = |name: &str| {
            let width = SWATCH + 6.0 + text_width(name, canvas.font);
            if x > left && x + width > canvas.width {
                (x, y) = (left, y + line);
            }
            x += width + SPACE;
            (x - width - SPACE, y)
        };
        let mut end = top;
        let entries = self.0.iter().enumerate();
        for (k, entry) in entries.filter(|(_, e)| e.panel == panel) {
            let name = fitting(entry.name, canvas);
            let (x, y) = place(&name);
            let middle = y + 0.5 * line - 1.0;
            let first = entry.series.first();
            let class = first.map_or(String::new(), |s| format!("key {}", s.colour.class()));
            let _ = write!(svg, "<g class=\"{class}\" data-k=\"{k}\">");
            if entry.series.is_empty() {
                let top = middle - 6.0;
                let _ = write!(
                    svg,
                    "<rect class=\"outage\" x=\"{x:.1}\" y=\"{top:.1}\" width=\"{SWATCH}\" height=\"12\"/>"
                );
            }
            let swatches = entry.series.iter().map(|s| &s.mark);
            swatches.for_each(|mark| swatch(mark, (x, middle), svg));
            text(svg, "", (x + SWATCH + 6.0, y + canvas.font), "start", &name);
            *svg += "</g>\n";
            end = y;
        }
        end + line
    }
}

/// A name, without its middle if it is wider than the picture: ends tell names apart that begin alike.
fn fitting(name: &str, canvas: &Canvas) -> String {
    let share = (canvas.width - 2.0 * (SWATCH + SPACE)) / text_width(name, canvas.font);
    let letters: Vec<char> = name.chars().collect();
    if share >= 1.0 {
        return name.to_owned();
    }
    let half = (0.5 * share * letters.len() as f64) as usize;
    let half = half.saturating_sub(1);
    let (before, after) = (&letters[..half], &letters[letters.len() - half..]);
    before.iter().chain(&['…']).chain(after).collect()
}

/// A mark in small.
fn swatch(mark: &Mark, (x, y): (f64, f64), svg: &mut String) {
    let line = format!("M{x:.1} {y:.1}h{SWATCH}");
    let square = format!("M{x:.1} {:.1}h{SWATCH}v12h-{SWATCH}Z", y - 6.0);
    let (class, d) = match mark {
        Mark::Line(_, stroke) => (stroke.class(), line),
        Mark::Level(_) => ("line level", line),
        Mark::Band(_) | Mark::Zone(..) => ("area", square),
        Mark::InnerBand(_) => ("area inner", square),
        Mark::Bars(_) => ("bar", square),
        Mark::Points(_) | Mark::Place(..) | Mark::Reading(..) => {
            ("dot", format!("M{:.1} {y:.1}h0", x + 0.5 * SWATCH))
        }
    };
    let _ = write!(svg, "<path class=\"{class}\" d=\"{d}\"/>");
}
