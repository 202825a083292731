//! Charts as SVG: layout, axes, stripes; for a screen and for a phone, so that text is never scaled.

use crate::axis::{Ruler, extremes, is_shown, minor_ticks, range, ticks};
use crate::canvas::{Canvas, short, text};
use crate::chart::{Chart, Mark, Panel, Scale, Stroke};
use crate::escape::escape;
use crate::legend::{Legend, text_width};
use crate::marks::Frame;
use std::fmt::Write as _;

/// Between panels, and at the right of all.
const GAP: f64 = 14.0;

/// The content of an `<svg>` and its height; nothing without a value to show.
pub(crate) fn draw(chart: &Chart, canvas: &Canvas) -> Option<(String, f64)> {
    let mut svg = String::new();
    let legend = Legend::of(chart);
    let mut top = 0.0;
    let x_values = chart
        .panels
        .iter()
        .flat_map(|p| p.series.iter())
        .flat_map(|s| xs(&s.mark));
    let shown_y: Vec<Option<(f64, f64)>> = chart.panels.iter().map(y_range).collect();
    if shown_y.iter().all(Option::is_none) {
        return None;
    }
    let air = if chart.x.scale == Scale::Log || chart.is_map {
        0.03
    } else {
        0.0
    };
    let shown_x = range(&chart.x, x_values.collect::<Vec<_>>().into_iter(), air)?;
    let y_ticks =
        |panel: &Panel, range, height: f64| ticks(&panel.y, range, (height / 42.0).ceil() as usize);
    let widest = chart.panels.iter().zip(&shown_y).flat_map(|(p, range)| {
        range.map_or_else(Vec::new, |range| y_ticks(p, range, canvas.panel * p.height))
    });
    let left = 10.0
        + widest
            .map(|(_, label)| text_width(&label, canvas.font))
            .fold(24.0, f64::max);
    let right = canvas.width - GAP;
    // the first of slanted names begins left of its place
    let left = slanted_names(chart, canvas, right - left).map_or(left, |(longest, slot)| {
        left.max(0.79 * longest - 0.4 * slot)
    });
    for (i, (panel, range)) in chart.panels.iter().zip(&shown_y).enumerate() {
        let Some(range) = *range else { continue };
        let mut x = Ruler {
            range: shown_x,
            is_log: chart.x.scale == Scale::Log,
            pixels: (left, right),
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
        let sketch = Sketch {
            chart,
            panel,
            frame: Frame {
                x,
                y,
                scales: [&chart.x.scale, &panel.y.scale],
                most: canvas.width as usize,
            },
        };
        let is_last = i + 1 == chart.panels.len();
        let y_ticks = y_ticks(panel, sketch.frame.y.range, height);
        let below = sketch.draw(canvas, &y_ticks, is_last, &legend, &mut svg);
        top = plot_top + height + if is_last { below } else { GAP };
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
    frame: Frame<'a>,
}

impl Sketch<'_> {
    /// Returns the height of what stands below the plot.
    fn draw(
        &self,
        canvas: &Canvas,
        y_ticks: &[(f64, String)],
        is_last: bool,
        legend: &Legend<'_>,
        svg: &mut String,
    ) -> f64 {
        let (x, y) = (&self.frame.x, &self.frame.y);
        let ((left, right), (bottom, top)) = (x.pixels, y.pixels);
        *svg += "<g class=\"ticks\">\n";
        self.minor(svg);
        for (value, label) in y_ticks {
            let height = y.at(*value);
            let _ = writeln!(
                svg,
                "<path class=\"grid\" d=\"M{} {}H{}\"/>",
                short(left),
                short(height),
                short(right)
            );
            text(
                svg,
                "tick",
                (left - 6.0, height + 0.35 * canvas.font),
                "end",
                label,
            );
        }
        let below = self.x_axis(canvas, is_last, svg);
        *svg += "</g>\n";
        self.inside(legend, svg);
        let _ = writeln!(
            svg,
            "<path class=\"axis\" d=\"M{} {}V{}H{}\"/>",
            short(left),
            short(top),
            short(bottom),
            short(right)
        );
        self.places(canvas, svg);
        if self.chart.is_map {
            self.scale_bar(canvas, svg);
        }
        below
    }

    /// All that moves when the panel is zoomed; the script reads the axes from it.
    fn inside(&self, legend: &Legend<'_>, svg: &mut String) {
        let (x, y) = (&self.frame.x, &self.frame.y);
        let ((left, right), (bottom, top)) = (x.pixels, y.pixels);
        let place = [left, top, right - left, bottom - top].map(short);
        let _ = writeln!(
            svg,
            "<svg class=\"plot\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" viewBox=\"{}\" preserveAspectRatio=\"none\" \
             data-x=\"{}\" data-y=\"{}\">",
            place[0],
            place[1],
            place[2],
            place[3],
            place.join(" "),
            x.data(),
            y.data()
        );
        if !self.chart.is_map {
            for (from, to) in &self.chart.stripes.1 {
                let (a, b) = (x.within(*from), x.within(*to));
                if b > a {
                    let _ = writeln!(
                        svg,
                        "<rect class=\"outage\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>",
                        short(a),
                        place[1],
                        short(b - a),
                        place[3]
                    );
                }
            }
        }
        for series in &self.panel.series {
            self.frame.series(series, legend.key(&series.name), svg);
        }
        *svg += "</svg>\n";
    }

    /// Short lines between the labels of logarithmic axes.
    fn minor(&self, svg: &mut String) {
        let (x, y) = (&self.frame.x, &self.frame.y);
        let few = |ruler: &Ruler| ruler.is_log && ruler.range.1 / ruler.range.0 < 1e7;
        let mut d = String::new();
        for value in few(y).then(|| minor_ticks(y.range)).into_iter().flatten() {
            let _ = write!(d, "M{} {}h4", short(x.pixels.0), short(y.at(value)));
        }
        for value in few(x).then(|| minor_ticks(x.range)).into_iter().flatten() {
            let _ = write!(d, "M{} {}v-4", short(x.at(value)), short(y.pixels.0));
        }
        if !d.is_empty() {
            let _ = writeln!(svg, "<path class=\"minor\" d=\"{d}\"/>");
        }
    }

    /// Returns its height.
    fn x_axis(&self, canvas: &Canvas, is_last: bool, svg: &mut String) -> f64 {
        let (x, y) = (&self.frame.x, &self.frame.y);
        let ticks = ticks(&self.chart.x, x.range, canvas.labels);
        let is_named = matches!(self.chart.x.scale, Scale::Names(_));
        let slanted_name = slanted_names(self.chart, canvas, x.pixels.1 - x.pixels.0);
        for (value, label) in &ticks {
            let place = x.at(*value);
            if !is_named {
                let _ = writeln!(
                    svg,
                    "<path class=\"grid\" d=\"M{} {}V{}\"/>",
                    short(place),
                    short(y.pixels.0),
                    short(y.pixels.1)
                );
            }
            if is_last && slanted_name.is_some() {
                slanted(svg, (place + 4.0, y.pixels.0 + 16.0), label);
            } else if is_last {
                text(
                    svg,
                    "tick",
                    (place, y.pixels.0 + canvas.font + 5.0),
                    "middle",
                    label,
                );
            }
        }
        let labels = slanted_name.map_or(canvas.font + 9.0, |(longest, _)| 0.62 * longest + 22.0);
        if self.chart.x.label.is_empty() {
            return labels + 4.0;
        }
        if is_last {
            text(
                svg,
                "name",
                (x.pixels.1, y.pixels.0 + labels + canvas.font),
                "end",
                &self.chart.x.label,
            );
        }
        labels + canvas.font + 8.0
    }

    /// Names of places, in turn above and below them.
    fn places(&self, canvas: &Canvas, svg: &mut String) {
        let (x, y) = (&self.frame.x, &self.frame.y);
        let named = self.panel.series.iter().filter_map(|s| match s.mark {
            Mark::Place(px, py) | Mark::Reading(px, py)
                if is_shown(px, &self.chart.x.scale) && is_shown(py, &self.panel.y.scale) =>
            {
                Some((s, x.at(px), y.at(py)))
            }
            _ => None,
        });
        for (k, (series, px, py)) in named.enumerate() {
            let width = text_width(&series.name, canvas.font);
            let is_right = px + 8.0 + width < x.pixels.1;
            let (anchor, px) = if is_right {
                ("start", px + 7.0)
            } else {
                ("end", px - 7.0)
            };
            let py = if k % 2 == 0 {
                py - 6.0
            } else {
                py + canvas.font + 3.0
            };
            text(
                svg,
                &format!("place {}", series.colour.class()),
                (px, py),
                anchor,
                &series.name,
            );
        }
    }

    /// A round length at the bottom right of a map.
    fn scale_bar(&self, canvas: &Canvas, svg: &mut String) {
        let (x, y) = (&self.frame.x, &self.frame.y);
        let metres_per_pixel = (x.range.1 - x.range.0) / (x.pixels.1 - x.pixels.0);
        let most = 0.22 * (x.pixels.1 - x.pixels.0) * metres_per_pixel;
        let power = 10f64.powf(most.log10().floor());
        let length = [5.0, 2.0, 1.0]
            .into_iter()
            .map(|m| m * power)
            .find(|l| *l <= most)
            .unwrap_or(power);
        let (right, bottom) = (x.pixels.1 - 10.0, y.pixels.0 - 10.0);
        let left = right - length / metres_per_pixel;
        let label = if length >= 1000.0 {
            format!("{} km", length / 1000.0)
        } else {
            format!("{length} m")
        };
        let _ = writeln!(
            svg,
            "<path class=\"scale\" d=\"M{} {}v5H{}v-5\"/>",
            short(left),
            short(bottom - 5.0),
            short(right)
        );
        text(
            svg,
            "tick",
            (0.5 * (left + right), bottom - 0.5 * canvas.font),
            "middle",
            &label,
        );
    }
}

/// Where the names of the x axis have no room beside one another: the width of the longest, and the room of each.
fn slanted_names(chart: &Chart, canvas: &Canvas, width: f64) -> Option<(f64, f64)> {
    let Scale::Names(names) = &chart.x.scale else {
        return None;
    };
    let longest = names
        .iter()
        .map(|name| text_width(name, canvas.font))
        .fold(0.0, f64::max);
    let slot = width / names.len().max(1) as f64;
    (longest > slot - 6.0).then_some((longest, slot))
}

fn xs(mark: &Mark) -> Vec<f64> {
    match mark {
        Mark::Line(points, _) => points.iter().map(|p| p.0).collect(),
        Mark::Band(points) | Mark::InnerBand(points) => points.iter().map(|p| p.0).collect(),
        Mark::Points(points) => points.iter().map(|p| p.x).collect(),
        Mark::Bars(bars) => bars.iter().map(|b| b.0).collect(),
        Mark::Level(_) | Mark::Zone(..) => Vec::new(),
        Mark::Place(x, _) | Mark::Reading(x, _) => vec![*x],
    }
}

fn ys(mark: &Mark) -> Vec<f64> {
    match mark {
        Mark::Line(points, _) => points.iter().map(|p| p.1).collect(),
        Mark::Band(points) | Mark::InnerBand(points) => {
            points.iter().flat_map(|p| [p.1, p.2]).collect()
        }
        Mark::Points(points) => points.iter().flat_map(|p| [p.y, p.low, p.high]).collect(),
        Mark::Bars(bars) => bars.iter().flat_map(|b| [b.1, b.2]).collect(),
        Mark::Level(y) => vec![*y],
        Mark::Zone(low, high) => vec![*low, *high],
        Mark::Place(_, y) | Mark::Reading(_, y) => vec![*y],
    }
}

/// Whether a mark must be seen whole: bands, bars and auxiliary lines may leave the panel.
fn is_main(mark: &Mark) -> bool {
    matches!(
        mark,
        Mark::Line(_, Stroke::Plain)
            | Mark::Level(_)
            | Mark::Points(_)
            | Mark::Place(..)
            | Mark::Reading(..)
    )
}

/// How far beyond the main curves a logarithmic axis follows others.
const BEYOND: f64 = 30.0;

/// What a panel shows: what is far beyond the main curves is cut, so that it does not flatten them.
fn y_range(panel: &Panel) -> Option<(f64, f64)> {
    let has_bars = panel.series.iter().any(|s| matches!(s.mark, Mark::Bars(_)));
    let air = if has_bars { 0.0 } else { 0.04 };
    let values: Vec<f64> = panel.series.iter().flat_map(|s| ys(&s.mark)).collect();
    let main = panel
        .series
        .iter()
        .filter(|s| is_main(&s.mark))
        .flat_map(|s| match &s.mark {
            Mark::Points(points) if panel.y.scale == Scale::Log => {
                points.iter().map(|p| p.y).collect()
            }
            mark => ys(mark),
        });
    let Some((low, high)) = extremes(main.filter(|y| is_shown(*y, &panel.y.scale))) else {
        return range(&panel.y, values.into_iter(), air);
    };
    let (low, high) = match panel.y.scale {
        Scale::Log => (low / BEYOND, high * BEYOND),
        _ if low < high => (low - (high - low), high + (high - low)),
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    };
    let shown = values.into_iter().filter(|y| is_shown(*y, &panel.y.scale));
    range(&panel.y, shown.map(|y| y.clamp(low, high)), air)
}

/// A tick label that ends at a point, rising towards it.
fn slanted(svg: &mut String, (x, y): (f64, f64), words: &str) {
    let (x, y) = (short(x), short(y));
    let _ = writeln!(
        svg,
        "<text class=\"tick\" text-anchor=\"end\" transform=\"translate({x} {y}) rotate(-38)\">{}</text>",
        escape(words)
    );
}
