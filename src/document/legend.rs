//! The legend above the panels.

use crate::canvas::{Canvas, short, text};
use crate::chart::{Chart, Mark, Series};
use std::borrow::Cow;
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

/// A name and all that has it.
struct Entry<'a> {
    name: &'a str,
    /// The first panel that shows it, and tells it.
    panel: usize,
    series: Vec<&'a Series>,
}

/// Names that are told. One name alone is told by the axis.
pub(crate) struct Legend<'a> {
    entries: Vec<Entry<'a>>,
    stripes: Option<&'a str>,
}

impl<'a> Legend<'a> {
    pub(crate) fn of(chart: &'a Chart) -> Self {
        let mut entries: Vec<Entry<'a>> = Vec::new();
        for (panel, series) in chart
            .panels
            .iter()
            .enumerate()
            .flat_map(|(i, p)| p.series.iter().map(move |s| (i, s)))
        {
            if series.name.is_empty() || matches!(series.mark, Mark::Place(..) | Mark::Reading(..))
            {
                continue;
            }
            match entries.iter_mut().find(|e| e.name == series.name) {
                Some(entry) => entry.series.push(series),
                None => entries.push(Entry {
                    name: &series.name,
                    panel,
                    series: vec![series],
                }),
            }
        }
        let has_stripes =
            !chart.stripes.1.is_empty() && !chart.is_map && !chart.stripes.0.is_empty();
        Self {
            entries,
            stripes: has_stripes.then_some(chart.stripes.0.as_str()),
        }
    }

    /// The number of a name, of which the script knows what to hide.
    pub(crate) fn key(&self, name: &str) -> usize {
        self.entries
            .iter()
            .position(|e| e.name == name)
            .unwrap_or(self.entries.len())
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
        let stripes = self.stripes.filter(|_| panel == 0);
        if self.entries.len() + usize::from(self.stripes.is_some()) < 2 {
            return top + line;
        }
        let x = if title.is_empty() {
            left
        } else {
            left + text_width(title, canvas.font) + SPACE
        };
        let mut pen = Pen {
            left,
            x,
            y: top,
            line,
            canvas,
        };
        for (k, entry) in self
            .entries
            .iter()
            .enumerate()
            .filter(|(_, e)| e.panel == panel)
        {
            let name = fitting(entry.name, canvas);
            let (x, y) = pen.place(&name);
            let _ = write!(
                svg,
                "<g class=\"key {}\" data-k=\"{k}\">",
                entry.series[0].colour.class()
            );
            entry
                .series
                .iter()
                .for_each(|s| swatch(&s.mark, (x, y + 0.5 * line - 1.0), svg));
            text(svg, "", (x + SWATCH + 6.0, y + canvas.font), "start", &name);
            *svg += "</g>\n";
        }
        if let Some(name) = stripes {
            let (x, y) = pen.place(name);
            let (px, py) = (short(x), short(y + 0.5 * line - 7.0));
            let _ = write!(
                svg,
                "<rect class=\"outage\" x=\"{px}\" y=\"{py}\" width=\"{SWATCH}\" height=\"12\"/>"
            );
            text(svg, "", (x + SWATCH + 6.0, y + canvas.font), "start", name);
        }
        pen.y + line
    }
}

/// A name, without its middle if it is wider than the picture: ends tell names apart that begin alike.
fn fitting<'a>(name: &'a str, canvas: &Canvas) -> Cow<'a, str> {
    let room = canvas.width - 2.0 * (SWATCH + SPACE);
    let mut letters: Vec<char> = name.chars().collect();
    if text_width(name, canvas.font) <= room {
        return Cow::Borrowed(name);
    }
    let mut shown = String::new();
    while letters.len() > 2 {
        let middle = letters.len() / 2;
        letters.remove(middle);
        let (before, after) = letters.split_at(middle);
        shown = before.iter().chain(&['…']).chain(after).collect();
        if text_width(&shown, canvas.font) <= room {
            break;
        }
    }
    Cow::Owned(shown)
}

/// Where the next entry begins.
struct Pen<'a> {
    left: f64,
    x: f64,
    y: f64,
    line: f64,
    canvas: &'a Canvas,
}

impl Pen<'_> {
    fn place(&mut self, name: &str) -> (f64, f64) {
        let width = SWATCH + 6.0 + text_width(name, self.canvas.font);
        if self.x > self.left && self.x + width > self.canvas.width {
            (self.x, self.y) = (self.left, self.y + self.line);
        }
        let here = (self.x, self.y);
        self.x += width + SPACE;
        here
    }
}

/// What a mark looks like, in small.
fn swatch(mark: &Mark, (x, y): (f64, f64), svg: &mut String) {
    let square = || format!("M{} {}h{SWATCH}v12h-{SWATCH}Z", short(x), short(y - 6.0));
    let (class, d) = match mark {
        Mark::Line(_, stroke) => (
            stroke.class(),
            format!("M{} {}h{SWATCH}", short(x), short(y)),
        ),
        Mark::Level(_) => ("line level", format!("M{} {}h{SWATCH}", short(x), short(y))),
        Mark::Band(_) | Mark::Zone(..) => ("area", square()),
        Mark::InnerBand(_) => ("area inner", square()),
        Mark::Bars(_) => ("bar", square()),
        Mark::Points(_) | Mark::Place(..) | Mark::Reading(..) => (
            "dot",
            format!("M{} {}h0", short(x + 0.5 * SWATCH), short(y)),
        ),
    };
    let _ = write!(svg, "<path class=\"{class}\" d=\"{d}\"/>");
}
