//! Charts as SVG: layout, axes, stripes; for a screen and for a phone, so that text is never scaled.

use crate::axis::{Ruler, extremes, is_shown, range, ticks};
use crate::canvas::{Canvas, text};
use crate::chart::{Chart, Mark, Panel, Scale, Stroke};
use crate::escape::escape;
use crate::legend::{Legend, text_width};
use crate::marks::Frame;
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
    let is_log = chart.x.scale == Scale::Log;
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
    // the first of slanted names begins left of its place
    let left = longest_name(chart, canvas).map_or(left, |longest| left.max(0.79 * longest));
    for (i, panel, range) in shown {
        let mut x = Ruler {
            range: x_range,
            is_log,
            pixels: (left, canvas.width - GAP),
        };
        let mut y = Ruler {
            range,
            is_log: panel.y.scale == Scale::Log,
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
        let sketch = Sketch {
            chart,
            panel,
            canvas,
            frame,
        };
        let below = sketch.draw(&y_ticks, i == last, &legend, &mut svg);
        top = plot_top + height + if i == last { below } else { GAP };
    }
    Some((svg, top.ceil()))
}

/// Gives both rulers of a map one scale and returns its height.
fn equalise(x: &mut Ruler, y: &mut Ruler, canvas: &Canvas) -> f64 {
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

/// One panel on its place.
struct Sketch<'a> {
    chart: &'a Chart,
    panel: &'a Panel,
    canvas: &'a Canvas,
    frame: Frame,
}

impl Sketch<'_> {
    /// Returns the height of what stands below the plot.
    fn draw(
        &self,
        y_ticks: &[(f64, String)],
        is_last: bool,
        legend: &Legend<'_>,
        svg: &mut String,
    ) -> f64 {
        let Frame { x, y, .. } = &self.frame;
        let ((left, right), (bottom, top)) = (x.pixels, y.pixels);
        *svg += "<g class=\"ticks\">\n";
        for (value, label) in y_ticks {
            let height = y.at(*value);
            let _ = writeln!(
                svg,
                "<path class=\"grid\" d=\"M{left:.1} {height:.1}H{right:.1}\"/>"
            );
            let place = (left - 6.0, height + 0.35 * self.canvas.font);
            text(svg, "tick", place, "end", label);
        }
        let below = self.x_axis(is_last, svg);
        *svg += "</g>\n";
        self.inside(legend, svg);
        let _ = writeln!(
            svg,
            "<path class=\"axis\" d=\"M{left:.1} {top:.1}V{bottom:.1}H{right:.1}\"/>"
        );
        self.places(svg);
        below
    }

    /// All that moves when the panel is zoomed; the script reads the axes from it.
    fn inside(&self, legend: &Legend<'_>, svg: &mut String) {
        let Frame { x, y, .. } = &self.frame;
        let ((left, right), (bottom, top)) = (x.pixels, y.pixels);
        let (width, height) = (right - left, bottom - top);
        let _ = writeln!(
            svg,
            "<svg class=\"plot\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             viewBox=\"{left:.1} {top:.1} {width:.1} {height:.1}\" preserveAspectRatio=\"none\" data-x=\"{}\" data-y=\"{}\">",
            x.data(),
            y.data()
        );
        let stripes = self.chart.stripes.1.iter().filter(|_| !self.chart.is_map);
        for (from, to) in stripes.map(|(from, to)| (x.within(*from), x.within(*to))) {
            if to > from {
                let width = to - from;
                let _ = writeln!(
                    svg,
                    "<rect class=\"outage\" x=\"{from:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
                );
            }
        }
        for series in &self.panel.series {
            self.frame.series(series, legend.key(&series.name), svg);
        }
        *svg += "</svg>\n";
    }

    /// Returns its height.
    fn x_axis(&self, is_last: bool, svg: &mut String) -> f64 {
        let (Frame { x, y, .. }, axis, font) = (&self.frame, &self.chart.x, self.canvas.font);
        let (bottom, top) = y.pixels;
        let longest = longest_name(self.chart, self.canvas);
        for (value, label) in ticks(axis, x.range, self.canvas.labels) {
            let place = x.at(value);
            if longest.is_none() {
                let _ = writeln!(
                    svg,
                    "<path class=\"grid\" d=\"M{place:.1} {bottom:.1}V{top:.1}\"/>"
                );
            }
            match (is_last, longest) {
                (true, None) => text(svg, "tick", (place, bottom + font + 5.0), "middle", &label),
                // a name that ends at its place, rising towards it
                (true, Some(_)) => {
                    let (x, y, label) = (place + 4.0, bottom + 16.0, escape(&label));
                    let _ = writeln!(
                        svg,
                        "<text class=\"tick\" text-anchor=\"end\" transform=\"translate({x:.1} {y:.1}) rotate(-38)\">{label}</text>"
                    );
                }
                _ => {}
            }
        }
        let labels = longest.map_or(font + 9.0, |longest| 0.62 * longest + 22.0);
        if is_last {
            text(
                svg,
                "name",
                (x.pixels.1, bottom + labels + font),
                "end",
                &axis.label,
            );
        }
        labels + font + 8.0
    }

    /// Names of places beside them.
    fn places(&self, svg: &mut String) {
        let Frame { x, y, .. } = &self.frame;
        for series in &self.panel.series {
            let (Mark::Place(px, py) | Mark::Reading(px, py)) = series.mark else {
                continue;
            };
            if !self.frame.shows(px, py) {
                continue;
            }
            let width = text_width(&series.name, self.canvas.font);
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

/// Width of the longest of the names of an x axis, if it has names.
fn longest_name(chart: &Chart, canvas: &Canvas) -> Option<f64> {
    let Scale::Names(names) = &chart.x.scale else {
        return None;
    };
    let widths = names.iter().map(|name| text_width(name, canvas.font));
    Some(widths.fold(0.0, f64::max))
}

/// The values of a mark on both axes.
fn values(mark: &Mark) -> (Vec<f64>, Vec<f64>) {
    match mark {
        Mark::Line(points, _) => points.iter().copied().unzip(),
        Mark::Band(points) | Mark::InnerBand(points) | Mark::Bars(points) => {
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
        Mark::Place(x, y) | Mark::Reading(x, y) => (vec![*x], vec![*y]),
    }
}

/// How far beyond the main curves a logarithmic axis follows others.
const BEYOND: f64 = 30.0;

/// What a panel shows: what is far beyond the main curves is cut, so that it does not flatten them. Bands, bars and
/// auxiliary lines may leave the panel.
fn y_range(panel: &Panel) -> Option<(f64, f64)> {
    let has_bars = panel.series.iter().any(|s| matches!(s.mark, Mark::Bars(_)));
    let air = if has_bars { 0.0 } else { 0.04 };
    let is_log = panel.y.scale == Scale::Log;
    let main = panel.series.iter().flat_map(|s| match &s.mark {
        Mark::Points(points) if is_log => points.iter().map(|p| p.y).collect(),
        Mark::Line(_, Stroke::Plain)
        | Mark::Level(_)
        | Mark::Points(_)
        | Mark::Place(..)
        | Mark::Reading(..) => values(&s.mark).1,
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
    range(&panel.y, shown.map(|y| y.clamp(low, high)), air)
}
