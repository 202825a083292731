//! Charts as SVG: layout, axes, stripes; for a screen and for a phone, so that text is never scaled.

use crate::chart::{Chart, ChartAxis, Mark, Panel, PointInterval, Series, Stroke};
use crate::number::readable;
use std::fmt::Write as _;

/// Between panels, and at the right of all.
const GAP: f64 = 14.0;

/// The content of an `<svg>` and its height; nothing without a value to show.
pub(crate) fn draw(chart: &Chart, canvas: &Canvas) -> Option<(String, f64)> {
    let (mut svg, mut top) = (String::new(), 0.0);
    let legend = Legend::of(chart);
    let shown: Vec<(usize, &Panel, (f64, f64))> = (0..)
        .zip(&chart.panels)
        .filter_map(|(i, panel)| Some((i, panel, y_range(panel)?)))
        .collect();
    let last = shown.last()?.0;
    let is_log = chart.x.is_log;
    let air = if is_log || chart.is_map { 0.03 } else { 0.0 };
    let series = chart.panels.iter().flat_map(|p| &p.series);
    let x_range = range(&chart.x, series.flat_map(|s| values(&s.mark).0), air)?;
    let y_ticks =
        |panel: &Panel, range, height: f64| ticks(&panel.y, range, (height / 42.0).ceil() as usize);
    let width = |(_, label): (f64, String)| text_width(&label, canvas.font);
    let labels = shown.iter().flat_map(|(_, panel, range)| {
        y_ticks(panel, *range, canvas.panel * panel.height)
            .into_iter()
            .map(width)
    });
    let left = 10.0 + labels.fold(24.0, f64::max);
    for (i, panel, range) in shown {
        let mut x = AxisScale {
            range: x_range,
            is_log,
            pixels: (left, canvas.width - GAP),
        };
        let mut y = AxisScale {
            range,
            is_log: panel.y.is_log,
            pixels: (0.0, 0.0),
        };
        let mut height = canvas.panel * panel.height;
        if chart.is_map {
            height = equalise(&mut x, &mut y, canvas);
        }
        let plot_top = legend.draw(i, &panel.y.label, (left, top), canvas, &mut svg) + 2.0;
        y.pixels = (plot_top + height, plot_top);
        let y_ticks = y_ticks(panel, y.range, height);
        let most = canvas.width as usize;
        let frame = Frame { x, y, most };
        let below = frame.grid(&chart.x, canvas, &y_ticks, i == last, &mut svg);
        frame.inside(chart, panel, &legend, &mut svg);
        frame.places(panel, canvas, &mut svg);
        top = plot_top + height + if i == last { below } else { GAP };
    }
    Some((svg, top.ceil()))
}

/// Gives both rulers of a map one scale and returns its height.
fn equalise(x: &mut AxisScale, y: &mut AxisScale, canvas: &Canvas) -> f64 {
    let width = x.pixels.1 - x.pixels.0;
    let spans = [x.range.1 - x.range.0, y.range.1 - y.range.0];
    let height = (width * spans[1] / spans[0]).clamp(0.4 * canvas.map, canvas.map);
    let metres = (spans[0] / width).max(spans[1] / height);
    for (ruler, pixels) in [(x, width), (y, height)] {
        let (middle, half) = (0.5 * (ruler.range.0 + ruler.range.1), 0.5 * pixels * metres);
        ruler.range = (middle - half, middle + half);
    }
    height
}

impl Frame {
    /// Ticks and grid; returns the height of what stands below the plot.
    fn grid(
        &self,
        x_axis: &ChartAxis,
        canvas: &Canvas,
        y_ticks: &[(f64, String)],
        is_last: bool,
        svg: &mut String,
    ) -> f64 {
        let (Frame { x, y, .. }, font) = (self, canvas.font);
        let ((left, right), (bottom, top)) = (x.pixels, y.pixels);
        *svg += "<g class=\"ticks\">\n";
        for (value, label) in y_ticks {
            let height = y.at(*value);
            let _ = writeln!(
                svg,
                "<path class=\"grid\" d=\"M{left:.1} {height:.1}H{right:.1}\"/>"
            );
            text(
                svg,
                "tick",
                (left - 6.0, height + 0.35 * font),
                "end",
                label,
            );
        }
        for (value, label) in ticks(x_axis, x.range, canvas.labels) {
            let place = x.at(value);
            let _ = writeln!(
                svg,
                "<path class=\"grid\" d=\"M{place:.1} {bottom:.1}V{top:.1}\"/>"
            );
            if is_last {
                text(svg, "tick", (place, bottom + font + 5.0), "middle", &label);
            }
        }
        let below = 2.0 * font + 9.0;
        if is_last {
            text(svg, "name", (right, bottom + below), "end", &x_axis.label);
        }
        *svg += "</g>\n";
        below + 8.0
    }

    /// All that moves when the panel is zoomed; the script reads the axes from it.
    fn inside(&self, chart: &Chart, panel: &Panel, legend: &Legend<'_>, svg: &mut String) {
        let Frame { x, y, .. } = self;
        let ((left, right), (bottom, top)) = (x.pixels, y.pixels);
        let (width, height) = (right - left, bottom - top);
        let _ = writeln!(
            svg,
            "<svg class=\"plot\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             viewBox=\"{left:.1} {top:.1} {width:.1} {height:.1}\" preserveAspectRatio=\"none\" data-x=\"{}\" data-y=\"{}\" data-name=\"{}\">",
            x.data(),
            y.data(),
            escape(&panel.y.label)
        );
        let stripes = chart.stripes.1.iter().filter(|_| !chart.is_map);
        for (from, to) in stripes.map(|(from, to)| (x.within(*from), x.within(*to))) {
            if to > from {
                let width = to - from;
                let _ = writeln!(
                    svg,
                    "<rect class=\"outage\" x=\"{from:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
                );
            }
        }
        for series in &panel.series {
            self.series(series, legend.key(&series.name), svg);
        }
        let _ = writeln!(
            svg,
            "</svg>\n<path class=\"axis\" d=\"M{left:.1} {top:.1}V{bottom:.1}H{right:.1}\"/>"
        );
    }

    /// Names of places beside them.
    fn places(&self, panel: &Panel, canvas: &Canvas, svg: &mut String) {
        let Frame { x, y, .. } = self;
        for series in &panel.series {
            let Mark::Place(px, py) = series.mark else {
                continue;
            };
            if !self.shows(px, py) {
                continue;
            }
            let width = text_width(&series.name, canvas.font);
            let (px, py) = (x.at(px), y.at(py) - 6.0);
            let (anchor, px) = match px + 8.0 + width < x.pixels.1 {
                true => ("start", px + 7.0),
                false => ("end", px - 7.0),
            };
            let class = format!("place {}", series.colour.class());
            text(svg, &class, (px, py), anchor, &series.name);
        }
    }
}

/// The values of a mark on both axes.
fn values(mark: &Mark) -> (Vec<f64>, Vec<f64>) {
    match mark {
        Mark::Line(points, _) => points.iter().copied().unzip(),
        Mark::Band(points) => {
            let ends = points.iter().flat_map(|&(x, a, b)| [(x, a), (x, b)]);
            ends.unzip()
        }
        Mark::Points(points) => {
            let ends = points
                .iter()
                .flat_map(|p| [p.y, p.low, p.high].map(|y| (p.x, y)));
            ends.unzip()
        }
        Mark::Level(y) => (Vec::new(), vec![*y]),
        Mark::Zone(low, high) => (Vec::new(), vec![*low, *high]),
        Mark::Place(x, y) => (vec![*x], vec![*y]),
    }
}

/// Largest factor by which a logarithmic axis extends beyond the main curves for others.
const BEYOND: f64 = 30.0;

/// Range of the vertical axis. Values far beyond the main curves are cut, so that they do not
/// flatten them; bands and auxiliary lines may leave the panel.
fn y_range(panel: &Panel) -> Option<(f64, f64)> {
    let is_log = panel.y.is_log;
    let main = panel.series.iter().flat_map(|s| match &s.mark {
        Mark::Points(points) if is_log => points.iter().map(|p| p.y).collect(),
        Mark::Line(_, Stroke::Plain) | Mark::Level(_) | Mark::Points(_) | Mark::Place(..) => {
            values(&s.mark).1
        }
        _ => Vec::new(),
    });
    let main = extremes(main.filter(|y| is_shown(*y, is_log)));
    let (low, high) = match main {
        Some((low, high)) if is_log => (low / BEYOND, high * BEYOND),
        Some((low, high)) if low < high => (2.0 * low - high, 2.0 * high - low),
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    };
    let ys = panel.series.iter().flat_map(|s| values(&s.mark).1);
    let shown = ys.filter(|y| is_shown(*y, is_log));
    range(&panel.y, shown.map(|y| y.clamp(low, high)), 0.04)
}

// Ranges, ticks and their labels.

/// From values to pixels along one axis.
struct AxisScale {
    /// First and last value shown.
    range: (f64, f64),
    is_log: bool,
    /// Pixels of the first and the last value.
    pixels: (f64, f64),
}

impl AxisScale {
    fn at(&self, value: f64) -> f64 {
        let along = |v: f64| if self.is_log { v.log10() } else { v };
        let (low, high) = (along(self.range.0), along(self.range.1));
        self.pixels.0 + (along(value) - low) / (high - low) * (self.pixels.1 - self.pixels.0)
    }

    /// Position of a value clamped to the ends.
    fn within(&self, value: f64) -> f64 {
        self.at(value.clamp(self.range.0, self.range.1))
    }

    /// `log 1e-3 100`, for the script.
    fn data(&self) -> String {
        let word = if self.is_log { "log" } else { "linear" };
        format!("{word} {:e} {:e}", self.range.0, self.range.1)
    }
}

/// Returns true if an axis, which may be logarithmic, can show the value.
fn is_shown(value: f64, is_log: bool) -> bool {
    value.is_finite() && (!is_log || value > 0.0)
}

/// Range of an axis: the values with a margin; none without a value.
fn range(axis: &ChartAxis, values: impl Iterator<Item = f64>, air: f64) -> Option<(f64, f64)> {
    let extra = axis.include.into_iter().flat_map(|(low, high)| [low, high]);
    let shown = values.chain(extra).filter(|v| is_shown(*v, axis.is_log));
    let (low, high) = extremes(shown)?;
    Some(if axis.is_log {
        let air = if low == high {
            2.0
        } else {
            (high / low).powf(air).max(1.0 + 2.0 * air)
        };
        (low / air, high * air)
    } else if low == high {
        (
            low - 0.1 * low.abs().max(1.0),
            high + 0.1 * high.abs().max(1.0),
        )
    } else {
        (low - air * (high - low), high + air * (high - low))
    })
}

/// Least and largest.
fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, v| {
        let (low, high) = range.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

/// Places of an axis that have a label, and the labels; `most`: about how many.
fn ticks(axis: &ChartAxis, range: (f64, f64), most: usize) -> Vec<(f64, String)> {
    if axis.is_log && range.1 / range.0 >= 6.0 {
        decades(range, most)
    } else {
        steps(range, most)
    }
}

/// Powers of ten, with their halves and fifths where there are few.
fn decades((low, high): (f64, f64), most: usize) -> Vec<(f64, String)> {
    let exponents = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let spanned = (high / low).log10();
    let factors: &[i32] = if spanned < 1.6 { &[1, 2, 5] } else { &[1] };
    let every = (spanned / most as f64).ceil().max(1.0) as i32;
    let all = exponents
        .filter(|e| e.rem_euclid(every) == 0)
        .flat_map(|e| {
            factors
                .iter()
                .map(move |f| (f64::from(*f) * 10f64.powi(e), *f, e))
        });
    let shown: Vec<_> = all.filter(|(v, ..)| (low..=high).contains(v)).collect();
    let is_plain = shown.iter().all(|(v, ..)| (1e-3..2e4).contains(v));
    shown
        .into_iter()
        .map(|(v, f, e)| (v, if is_plain { plain(v) } else { power(f, e) }))
        .collect()
}

/// Even steps of 1, 2 or 5 times a power of ten.
fn steps((low, high): (f64, f64), most: usize) -> Vec<(f64, String)> {
    let raw = (high - low) / most as f64;
    let exponent = raw.log10().floor();
    let choice = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|m| m * 10f64.powf(exponent) >= raw * 0.999);
    let step = choice.unwrap_or(10.0) * 10f64.powf(exponent);
    let (first, last) = (
        (low / step - 1e-9).ceil() as i64,
        (high / step + 1e-9).floor() as i64,
    );
    let largest = low.abs().max(high.abs());
    let label = |v: f64| match largest {
        m if !(1e-4..1e6).contains(&m) => readable(v).replace('-', "−"),
        _ => plain((v / step).round() * step),
    };
    (first..=last)
        .map(|k| k as f64 * step)
        .map(|v| (v, label(v)))
        .collect()
}

/// A number without an exponent.
fn plain(value: f64) -> String {
    let rounded = format!("{value:.6}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" {
        "0".to_owned()
    } else {
        short.replace('-', "−")
    }
}

/// `10⁻³` or `2·10⁻³`.
fn power(factor: i32, exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    let exponent: String = exponent.to_string().chars().map(raised).collect();
    if factor == 1 {
        format!("10{exponent}")
    } else {
        format!("{factor}·10{exponent}")
    }
}

#[cfg(test)]
mod marks_tests {
    use super::*;

    fn labels(axis: &ChartAxis, range: (f64, f64)) -> Vec<String> {
        ticks(axis, range, 8)
            .into_iter()
            .map(|(_, label)| label)
            .collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(
            labels(&ChartAxis::linear(""), (0.0, 900.0)),
            ["0", "200", "400", "600", "800"]
        );
        assert_eq!(
            labels(&ChartAxis::linear(""), (-0.021, 0.02)),
            ["−0.02", "−0.01", "0", "0.01", "0.02"]
        );
        assert_eq!(
            labels(&ChartAxis::log(""), (0.4, 12.0)),
            ["0.5", "1", "2", "5", "10"]
        );
        assert_eq!(
            labels(&ChartAxis::log(""), (0.02, 3e3)),
            ["0.1", "1", "10", "100", "1000"]
        );
        assert_eq!(
            labels(&ChartAxis::log(""), (3e-9, 2e-6)),
            ["10⁻⁸", "10⁻⁷", "10⁻⁶"]
        );
        assert_eq!(
            labels(&ChartAxis::log(""), (0.9, 1.3))
                .first()
                .map(String::as_str),
            Some("0.9")
        );
    }

    #[test]
    fn many_decades_are_labelled_now_and_then() {
        let shown = ticks(&ChartAxis::log(""), (1e-12, 1e3), 5);
        assert_eq!(
            shown
                .iter()
                .map(|t| t.0.log10().round())
                .collect::<Vec<_>>(),
            [-12., -9., -6., -3., 0., 3.]
        );
    }

    #[test]
    fn ends_of_the_range_are_ends_of_the_axis() {
        let ruler = AxisScale {
            range: (1.0, 100.0),
            is_log: true,
            pixels: (200.0, 0.0),
        };
        assert_eq!(
            (ruler.at(1.0), ruler.at(10.0), ruler.at(100.0)),
            (200.0, 100.0, 0.0)
        );
        assert_eq!(ruler.within(1e9), 0.0);
    }

    #[test]
    fn a_range_holds_what_can_be_shown() {
        let values = [f64::NAN, -1.0, 0.0, 1.0, 100.0];
        let (low, high) = range(&ChartAxis::log(""), values.into_iter(), 0.0).unwrap();
        assert_eq!((low, high), (1.0, 100.0));
        assert_eq!(
            range(
                &ChartAxis::linear("").including(-3.0, 5.0),
                values.into_iter(),
                0.0
            ),
            Some((-3.0, 100.0))
        );
        assert_eq!(
            range(&ChartAxis::linear(""), [f64::NAN].into_iter(), 0.0),
            None
        );
        let (low, high) = range(&ChartAxis::linear(""), [2.0].into_iter(), 0.0).unwrap();
        assert!(low < 2.0 && high > 2.0);
    }
}

// Sizes that charts are drawn in, and text in them.

/// A size to draw in.
pub(crate) struct Canvas {
    /// Class of the style sheet.
    pub(crate) class: &'static str,
    pub(crate) width: f64,
    /// Usual height of a panel.
    panel: f64,
    /// Size of text.
    pub(crate) font: f64,
    /// About how many labels the x axis has.
    labels: usize,
    /// Most that a map may be high.
    map: f64,
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

// Text inside HTML and SVG.

/// Text made safe inside HTML and SVG.
#[must_use]
pub fn escape(text: &str) -> String {
    one_line(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Text of names, of files say, that neither begins a line, nor does anything to a terminal, nor is shown as another.
#[must_use]
pub fn one_line(text: &str) -> String {
    let shown = |c: char| match turns(c) || c.is_control() {
        true => c.escape_default().to_string(),
        false => c.to_string(),
    };
    text.chars().map(shown).collect()
}

/// Returns true for a character that turns the direction of the text after it, and so disguises a
/// name (Unicode TR 36, sec. 2.1).
const fn turns(c: char) -> bool {
    matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

// The legend above the panels.

/// Width of a text (pixels), rather too much: that of a wide typeface.
fn text_width(text: &str, font: f64) -> f64 {
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
struct LegendEntry<'a> {
    name: &'a str,
    /// The first panel that shows it, and tells it.
    panel: usize,
    series: Vec<&'a Series>,
}

/// Names that are reported. One name alone is told by the axis.
struct Legend<'a>(Vec<LegendEntry<'a>>);

impl<'a> Legend<'a> {
    fn of(chart: &'a Chart) -> Self {
        let mut entries: Vec<LegendEntry<'a>> = Vec::new();
        for (panel, of_panel) in chart.panels.iter().enumerate() {
            for series in &of_panel.series {
                let is_beside = matches!(series.mark, Mark::Place(..));
                match entries.iter_mut().find(|e| e.name == series.name) {
                    _ if series.name.is_empty() || is_beside => {}
                    Some(entry) => entry.series.push(series),
                    None => entries.push(LegendEntry {
                        name: &series.name,
                        panel,
                        series: vec![series],
                    }),
                }
            }
        }
        let (name, stripes) = &chart.stripes;
        if !stripes.is_empty() && !chart.is_map {
            entries.push(LegendEntry {
                name,
                panel: 0,
                series: Vec::new(),
            });
        }
        Self(entries)
    }

    /// The number of a name, of which the script knows what to hide.
    fn key(&self, name: &str) -> usize {
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
        Mark::Points(_) | Mark::Place(..) => ("dot", format!("M{:.1} {y:.1}h0", x + 0.5 * SWATCH)),
    };
    let _ = write!(svg, "<path class=\"{class}\" d=\"{d}\"/>");
}

// Marks as SVG paths.

/// Points beyond which each is small.
const MANY: usize = 150;

/// Rulers of one panel.
struct Frame {
    x: AxisScale,
    y: AxisScale,
    /// Points of a line that can be distinguished.
    most: usize,
}

impl Frame {
    fn shows(&self, x: f64, y: f64) -> bool {
        is_shown(x, self.x.is_log) && is_shown(y, self.y.is_log)
    }

    fn point(&self, x: f64, y: f64) -> String {
        format!("{:.1} {:.1}", self.x.at(x), self.y.at(y))
    }

    /// The series as a group of paths.
    fn series(&self, series: &Series, key: usize, svg: &mut String) {
        let _ = write!(
            svg,
            "<g class=\"series {}\" data-k=\"{key}\" data-name=\"{}\">",
            series.colour.class(),
            escape(&series.name)
        );
        match &series.mark {
            Mark::Line(points, stroke) => {
                path(svg, stroke.class(), &self.line(points));
            }
            Mark::Band(points) => path(svg, "area", &self.band(points)),
            Mark::Points(points) => self.points(points, svg),
            Mark::Level(y) => path(svg, "line level", &self.span(*y)),
            Mark::Zone(low, high) => {
                let (a, b) = self.x.range;
                path(
                    svg,
                    "area",
                    &self.band(&[(a, *low, *high), (b, *low, *high)]),
                );
            }
            Mark::Place(x, y) => path(svg, "dot", &format!("M{}h0", self.point(*x, *y))),
        }
        *svg += "</g>\n";
    }

    fn line(&self, points: &[(f64, f64)]) -> String {
        let mut d = String::new();
        let mut pen_up = true;
        for (x, y) in thinned(points, self.most) {
            if self.shows(x, y) {
                let _ = write!(d, "{}{}", if pen_up { 'M' } else { 'L' }, self.point(x, y));
            }
            pen_up = !self.shows(x, y);
        }
        d
    }

    /// There along the upper curve and back along the lower one; where one of them cannot be shown, it ends.
    fn band(&self, points: &[(f64, f64, f64)]) -> String {
        // A line of as many points has the lowest and the highest of every two pixels.
        let points = thinned_band(points, self.most / 2);
        let is_drawn = |p: &(f64, f64, f64)| self.shows(p.0, p.2) && !p.1.is_nan();
        let pieces = points
            .split(|p| !is_drawn(p))
            .filter(|piece| !piece.is_empty());
        let closed = |piece: &[(f64, f64, f64)]| {
            let corner = |x, y| format!("{:.1} {:.1}", self.x.at(x), self.y.within(y));
            let forth = piece.iter().map(|p| corner(p.0, p.2));
            let back = piece.iter().rev().map(|p| corner(p.0, p.1));
            format!("M{}Z", forth.chain(back).collect::<Vec<_>>().join("L"))
        };
        pieces.map(closed).collect()
    }

    fn points(&self, points: &[PointInterval], svg: &mut String) {
        // more lie on one another
        let every = points.len().div_ceil(self.most).max(1);
        let shown = || {
            points
                .iter()
                .step_by(every)
                .filter(|p| self.shows(p.x, p.y))
        };
        let with_bar = |p: &&PointInterval| !(p.low.is_nan() && p.high.is_nan());
        let bar = |p: &PointInterval| {
            let [low, high] =
                [p.low, p.high].map(|end| self.y.within(if end.is_nan() { p.y } else { end }));
            format!("M{:.1} {low:.1}V{high:.1}", self.x.at(p.x))
        };
        path(
            svg,
            "whisker",
            &shown().filter(with_bar).map(bar).collect::<String>(),
        );
        let class = if points.len() > MANY {
            "dot small"
        } else {
            "dot"
        };
        let mut dots: Vec<String> = shown()
            .map(|p| format!("M{}h0", self.point(p.x, p.y)))
            .collect();
        dots.dedup();
        path(svg, class, &dots.concat());
    }

    fn span(&self, y: f64) -> String {
        let (a, b) = self.x.range;
        if !self.shows(b, y) {
            return String::new();
        }
        format!("M{}L{}", self.point(a, y), self.point(b, y))
    }
}

fn path(svg: &mut String, class: &str, d: &str) {
    if !d.is_empty() {
        let _ = write!(svg, "<path class=\"{class}\" d=\"{d}\"/>");
    }
}

/// At most about so many points: of each bucket its lowest and its highest one, so that peaks stay; a gap stays
/// a gap.
fn thinned(points: &[(f64, f64)], most: usize) -> Vec<(f64, f64)> {
    if points.len() <= most {
        return points.to_vec();
    }
    let bucket = points.len().div_ceil(most / 2);
    if !points.is_sorted_by(|a, b| a.0 <= b.0) {
        // a track: what is lowest in y says nothing of its shape
        return points
            .iter()
            .step_by(bucket.div_ceil(2))
            .chain(points.last())
            .copied()
            .collect();
    }
    let extremes = |chunk: &[(f64, f64)]| {
        let by_y = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let gap = chunk.iter().find(|p| !p.1.is_finite()).copied();
        let known = || chunk.iter().filter(|p| p.1.is_finite());
        let mut pair: Vec<(f64, f64)> = known()
            .min_by(by_y)
            .into_iter()
            .chain(known().max_by(by_y))
            .copied()
            .chain(gap)
            .collect();
        pair.sort_by(|a, b| a.0.total_cmp(&b.0));
        pair.dedup();
        pair
    };
    points.chunks(bucket).flat_map(extremes).collect()
}

/// A thinned band: of each bucket all that it covers.
fn thinned_band(points: &[(f64, f64, f64)], most: usize) -> Vec<(f64, f64, f64)> {
    if points.len() <= most {
        return points.to_vec();
    }
    let cover = |chunk: &[(f64, f64, f64)]| {
        let low = chunk.iter().fold(f64::INFINITY, |low, p| low.min(p.1));
        let high = chunk
            .iter()
            .fold(f64::NEG_INFINITY, |high, p| high.max(p.2));
        (chunk[chunk.len() / 2].0, low, high)
    };
    points
        .chunks(points.len().div_ceil(most))
        .map(cover)
        .collect()
}

#[cfg(test)]
mod axis_tests {
    use super::*;

    fn frame(is_log: bool) -> Frame {
        let ruler = |is_log, pixels| AxisScale {
            range: (1.0, 11.0),
            is_log,
            pixels,
        };
        Frame {
            x: ruler(false, (0.0, 100.0)),
            y: ruler(is_log, (100.0, 0.0)),
            most: 100,
        }
    }

    #[test]
    fn what_cannot_be_shown_breaks_the_line() {
        let points = [
            (1.0, 1.0),
            (2.0, f64::NAN),
            (3.0, 1.0),
            (4.0, 11.0),
            (5.0, -1.0),
            (6.0, 1.0),
        ];
        assert_eq!(
            frame(true).line(&points),
            "M0.0 100.0M20.0 100.0L30.0 0.0M50.0 100.0"
        );
        assert_eq!(
            frame(false).line(&points[2..]),
            "M20.0 100.0L30.0 0.0L40.0 120.0L50.0 100.0"
        );
    }

    #[test]
    fn a_band_goes_there_and_back() {
        assert_eq!(
            frame(false).band(&[(1.0, 2.0, 3.0), (11.0, 2.0, 30.0)]),
            "M0.0 80.0L100.0 0.0L100.0 90.0L0.0 90.0Z"
        );
    }

    #[test]
    fn thinning_keeps_peaks_and_gaps() {
        let value = |i| match i {
            77_777 => 9.0,
            50_000 => f64::NAN,
            _ => 0.0,
        };
        let points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), value(i))).collect();
        let thin = thinned(&points, 1000);
        assert!(
            thin.len() <= 1501
                && thin.iter().any(|p| p.1 == 9.0)
                && thin.iter().any(|p| p.1.is_nan())
        );
        let band: Vec<_> = points.iter().map(|(x, y)| (*x, -y, *y)).collect();
        let thin = thinned_band(&band, 1000);
        assert!(thin.len() <= 1000 && thin.iter().any(|p| (p.1, p.2) == (-9.0, 9.0)));
    }
}
