//! Line plots over time as inline SVG.

use super::number::readable;
use std::fmt::Write as _;

/// Scale of the vertical axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    Log,
}

/// A curve.
#[derive(Debug, Clone)]
pub(super) struct Line {
    pub(super) label: String,
    /// CSS class that gives its colour.
    pub(super) class: &'static str,
    pub(super) points: Vec<(f64, f64)>,
}

/// One panel.
#[derive(Debug, Clone)]
pub(super) struct Plot {
    pub(super) title: String,
    pub(super) scale: Scale,
    /// Range of the vertical axis that is shown at least.
    pub(super) include: Option<(f64, f64)>,
    /// Vertical stripes (outages).
    pub(super) stripes: Vec<(f64, f64)>,
    /// Horizontal band (where a correct filter stays).
    pub(super) band: Option<(f64, f64)>,
    pub(super) lines: Vec<Line>,
}

pub(super) const WIDTH: f64 = 860.0;
pub(super) const HEIGHT: f64 = 210.0;
pub(super) const LEFT: f64 = 62.0;
pub(super) const RIGHT: f64 = 12.0;
pub(super) const TOP: f64 = 28.0;
pub(super) const BOTTOM: f64 = 34.0;
/// More points than this a line add nothing to see.
const MAX_POINTS: usize = 2000;

/// From data to picture.
struct Frame {
    x: (f64, f64),
    y: (f64, f64),
    scale: Scale,
}

impl Frame {
    fn at_x(&self, x: f64) -> f64 {
        LEFT + (x - self.x.0) / (self.x.1 - self.x.0) * (WIDTH - LEFT - RIGHT)
    }

    fn at_y(&self, y: f64) -> f64 {
        let along = |v: f64| if self.scale == Scale::Log { v.log10() } else { v };
        let share = (along(y) - along(self.y.0)) / (along(self.y.1) - along(self.y.0));
        HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)
    }
}

impl Plot {
    /// The panel as an `<svg>` element.
    pub(super) fn render(&self) -> String {
        let title = escape(&self.title);
        match self.inside() {
            None => format!("<p>{title}: nothing to show.</p>\n"),
            Some(inside) => {
                format!(
                    "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\">\n{inside}</svg>\n"
                )
            }
        }
    }

    /// What the panel shows, [`WIDTH`] by [`HEIGHT`]; nothing without a point to show.
    pub(super) fn inside(&self) -> Option<String> {
        let frame = self.frame()?;
        let mut svg = String::new();
        self.background(&frame, &mut svg);
        axes(&frame, &mut svg);
        for line in &self.lines {
            path(line, &frame, &mut svg);
        }
        self.legend(&mut svg);
        Some(svg)
    }

    fn frame(&self) -> Option<Frame> {
        let shown = |y: f64| y.is_finite() && (self.scale == Scale::Linear || y > 0.0);
        let points = || self.lines.iter().flat_map(|l| &l.points).filter(|(_, y)| shown(*y));
        let extra = self.include.into_iter().chain(self.band).flat_map(|(a, b)| [a, b]).filter(|y| shown(*y));
        let x = range(points().map(|p| p.0))?;
        let y = range(points().map(|p| p.1).chain(extra))?;
        let y = match self.scale {
            Scale::Log => (y.0 / 1.15, y.1 * 1.15),
            Scale::Linear => {
                let margin = if y.1 > y.0 { 0.05 * (y.1 - y.0) } else { y.0.abs().max(1.0) * 0.1 };
                (y.0 - margin, y.1 + margin)
            }
        };
        let x = if x.1 > x.0 { x } else { (x.0 - 0.5, x.1 + 0.5) };
        Some(Frame { x, y, scale: self.scale })
    }

    fn background(&self, frame: &Frame, svg: &mut String) {
        let (top, bottom) = (TOP, HEIGHT - BOTTOM);
        for (start, end) in &self.stripes {
            let (a, b) = (frame.at_x(start.max(frame.x.0)), frame.at_x(end.min(frame.x.1)));
            if b > a {
                rect(svg, "outage", (a, top), (b - a, bottom - top));
            }
        }
        if let Some((low, high)) = self.band {
            let (a, b) = (frame.at_y(high), frame.at_y(low));
            rect(svg, "band", (LEFT, a), (WIDTH - LEFT - RIGHT, b - a));
        }
    }

    fn legend(&self, svg: &mut String) {
        text(svg, "title", (LEFT, 18.0), "start", &self.title);
        let mut x = WIDTH - RIGHT;
        for line in self.lines.iter().rev().filter(|l| !l.label.is_empty()) {
            text(svg, "label", (x, 18.0), "end", &line.label);
            x -= 7.0 * line.label.chars().count() as f64 + 8.0;
            let _ = writeln!(svg, "<path class=\"{}\" d=\"M{:.1} 14H{x:.1}\"/>", line.class, x - 22.0);
            x -= 36.0;
        }
    }
}

fn axes(frame: &Frame, svg: &mut String) {
    let bottom = HEIGHT - BOTTOM;
    for y in ticks(frame.y, frame.scale) {
        let at = frame.at_y(y);
        let _ = writeln!(svg, "<path class=\"grid\" d=\"M{LEFT} {at:.1}H{:.1}\"/>", WIDTH - RIGHT);
        text(svg, "tick", (LEFT - 6.0, at + 4.0), "end", &tick_label(y));
    }
    for x in ticks(frame.x, Scale::Linear) {
        let at = frame.at_x(x);
        let _ = writeln!(svg, "<path class=\"grid\" d=\"M{at:.1} {TOP}V{bottom}\"/>");
        text(svg, "tick", (at, bottom + 15.0), "middle", &tick_label(x));
    }
    text(svg, "tick", (WIDTH - RIGHT, HEIGHT - 4.0), "end", "time (s)");
    let _ = writeln!(svg, "<path class=\"axis\" d=\"M{LEFT} {TOP}V{bottom}H{:.1}\"/>", WIDTH - RIGHT);
}

pub(super) fn tick_label(value: f64) -> String {
    let rounded = (value * 1e9).round() / 1e9;
    if rounded.abs() >= 1e-4 && rounded.abs() < 1e6 || rounded == 0.0 {
        format!("{rounded}")
    } else {
        readable(value)
    }
}

/// Round values inside a range: about six of them; on a log scale 1, 2 and 5 of each decade, or decades.
pub(super) fn ticks((low, high): (f64, f64), scale: Scale) -> Vec<f64> {
    match scale {
        Scale::Linear => {
            let raw = (high - low) / 6.0;
            let power = 10f64.powf(raw.log10().floor());
            let step =
                [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw).unwrap_or(raw);
            let first = (low / step).ceil() as i64;
            (first..).map(|k| k as f64 * step).take_while(|v| *v <= high).collect()
        }
        Scale::Log => {
            let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
            let factors: &[f64] = if high / low > 1e3 { &[1.0] } else { &[1.0, 2.0, 5.0] };
            let all = decades.flat_map(|d| factors.iter().map(move |f| f * 10f64.powi(d)));
            all.filter(|v| low <= *v && *v <= high).collect()
        }
    }
}

fn path(line: &Line, frame: &Frame, svg: &mut String) {
    let mut d = String::new();
    let mut pen_up = true;
    for (x, y) in thinned(&line.points) {
        if !y.is_finite() || (frame.scale == Scale::Log && y <= 0.0) {
            pen_up = true;
            continue;
        }
        let command = if pen_up { 'M' } else { 'L' };
        let _ = write!(d, "{command}{:.1} {:.1}", frame.at_x(x), frame.at_y(y));
        pen_up = false;
    }
    let _ = writeln!(svg, "<path class=\"{}\" d=\"{d}\"/>", line.class);
}

/// At most [`MAX_POINTS`]: of each bucket its lowest and highest point, so that peaks stay.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MAX_POINTS {
        return points.to_vec();
    }
    let bucket = points.len().div_ceil(MAX_POINTS / 2);
    let extremes = |chunk: &[(f64, f64)]| {
        let by_y = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let mut pair: Vec<(f64, f64)> =
            chunk.iter().min_by(by_y).into_iter().chain(chunk.iter().max_by(by_y)).copied().collect();
        pair.sort_by(|a, b| a.0.total_cmp(&b.0));
        pair
    };
    points.chunks(bucket).flat_map(extremes).collect()
}

pub(super) fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, v| {
        let (low, high) = range.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

fn rect(svg: &mut String, class: &str, (x, y): (f64, f64), (w, h): (f64, f64)) {
    let _ = writeln!(
        svg,
        "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\"/>"
    );
}

pub(super) fn text(svg: &mut String, class: &str, (x, y): (f64, f64), anchor: &str, words: &str) {
    let _ = writeln!(
        svg,
        "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>",
        escape(words)
    );
}

/// Text made safe inside HTML and SVG.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<(f64, f64)>, scale: Scale) -> Plot {
        let lines = vec![Line { label: "a<b".into(), class: "asee", points }];
        Plot { title: "t".into(), scale, include: None, stripes: vec![(1.0, 2.0)], band: None, lines }
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks((0.0, 900.0), Scale::Linear), [0.0, 200.0, 400.0, 600.0, 800.0]);
        assert_eq!(ticks((0.4, 12.0), Scale::Log), [0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(ticks((0.02, 300.0), Scale::Log), [0.1, 1.0, 10.0, 100.0]);
    }

    #[test]
    fn data_corners_are_picture_corners() {
        let frame = Frame { x: (0.0, 10.0), y: (1.0, 100.0), scale: Scale::Log };
        assert_eq!((frame.at_x(0.0), frame.at_x(10.0)), (LEFT, WIDTH - RIGHT));
        assert_eq!((frame.at_y(1.0), frame.at_y(100.0)), (HEIGHT - BOTTOM, TOP));
        assert!((frame.at_y(10.0) - f64::midpoint(TOP, HEIGHT - BOTTOM)).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_drawn_breaks_the_line_and_nothing_is_unescaped() {
        let svg = plot(vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, -1.0), (3.0, 2.0)], Scale::Log).render();
        assert_eq!(svg.matches("class=\"asee\" d=\"M").count(), 2, "{svg}"); // the line and its legend
        assert!(svg.contains("a&lt;b") && !svg.contains("NaN"), "{svg}");
        let empty = plot(vec![(0.0, f64::NAN)], Scale::Linear).render();
        assert_eq!(empty, "<p>t: nothing to show.</p>\n");
    }

    #[test]
    fn thinning_keeps_peaks() {
        let points: Vec<(f64, f64)> =
            (0..100_000).map(|i| (f64::from(i), if i == 77_777 { 9.0 } else { 0.0 })).collect();
        let thin = thinned(&points);
        assert!(thin.len() <= MAX_POINTS && thin.iter().any(|p| p.1 == 9.0));
    }
}
