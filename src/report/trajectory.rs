//! A trajectory as one self-contained SVG: map, height, speed, attitude, outages marked.

use super::svg::{
    BOTTOM, HEIGHT, LEFT, Line, Plot, RIGHT, Scale, TOP, WIDTH, escape, range, text, tick_label, ticks,
};
use std::fmt::Write as _;

/// A trajectory in samples: one value an instant in every list.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrajectorySeries {
    /// Time (s).
    pub t_s: Vec<f64>,
    /// North and east of the start (m).
    pub north_east_m: Vec<[f64; 2]>,
    /// Height above the ellipsoid (m).
    pub height_m: Vec<f64>,
    /// Speed (m/s).
    pub speed_m_s: Vec<f64>,
    /// Roll, pitch, yaw (deg).
    pub rpy_deg: Vec<[f64; 3]>,
}

const MAP_HEIGHT: f64 = 520.0;
const STYLE: &str = concat!(
    include_str!("report.css"),
    ".first { stroke: var(--believed); stroke-width: 1.6; } .second { stroke: var(--real); stroke-width: 1.6; }\n",
    ".missing { stroke: var(--real); stroke-width: 5; opacity: .45; } .end { fill: var(--real); }\n",
    ".begin { fill: var(--believed); } .paper { fill: var(--paper); }\n",
);

/// The picture; `outages` are (start, end) in seconds.
#[must_use]
pub fn trajectory_svg(title: &str, series: &TrajectorySeries, outages: &[(f64, f64)]) -> String {
    let panels = panels(series, outages);
    let height = MAP_HEIGHT + panels.len() as f64 * HEIGHT;
    let title = escape(title);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         height=\"{height}\" role=\"img\" aria-label=\"{title}\">\n<title>{title}</title>\n<style>\n{STYLE}</style>\n\
         <rect class=\"paper\" width=\"{WIDTH}\" height=\"{height}\"/>\n"
    );
    map(series, outages, &title, &mut svg);
    for (i, panel) in panels.iter().enumerate() {
        let y = MAP_HEIGHT + i as f64 * HEIGHT;
        let inside = panel.inside().unwrap_or_default();
        let _ = write!(svg, "<g transform=\"translate(0 {y})\">\n{inside}</g>\n");
    }
    svg + "</svg>\n"
}

fn panels(series: &TrajectorySeries, outages: &[(f64, f64)]) -> Vec<Plot> {
    let over_time = |values: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        series.t_s.iter().enumerate().map(|(i, t)| (*t, values(i))).collect()
    };
    let line = |label: &str, class, points| Line { label: label.to_owned(), class, points };
    // At least so much is shown, so that rounding does not fill a panel.
    let panel = |title: &str, include, lines| Plot {
        title: title.to_owned(),
        scale: Scale::Linear,
        include: Some(include),
        stripes: outages.to_vec(),
        band: None,
        lines,
    };
    let rpy = |k: usize| over_time(&|i| series.rpy_deg[i][k]);
    let height = series.height_m.first().map_or((0.0, 1.0), |h| (h - 1.0, h + 1.0));
    let attitude = vec![line("roll", "first", rpy(0)), line("pitch", "second", rpy(1))];
    let yaw = pieces(&rpy(2)).into_iter().map(|points| line("", "first", points)).collect();
    vec![
        panel("height (m)", height, vec![line("", "first", over_time(&|i| series.height_m[i]))]),
        panel("speed (m/s)", (0.0, 1.0), vec![line("", "first", over_time(&|i| series.speed_m_s[i]))]),
        panel("roll and pitch (degrees)", (-1.0, 1.0), attitude),
        panel("yaw (degrees)", (-1.0, 1.0), yaw),
    ]
}

/// The line is broken where the heading passes ±180°.
fn pieces(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    points.chunk_by(|a, b| (a.1 - b.1).abs() <= 180.0).map(<[_]>::to_vec).collect()
}

/// From metres to the picture, the same scale both ways.
struct Frame {
    east: (f64, f64),
    north: (f64, f64),
    scale: f64,
}

impl Frame {
    fn of(series: &TrajectorySeries) -> Option<Self> {
        let side = |k: usize| range(series.north_east_m.iter().map(|p| p[k]));
        let (north, east) = (side(0)?, side(1)?);
        let (width, height) = (WIDTH - LEFT - RIGHT, MAP_HEIGHT - TOP - BOTTOM);
        let fits = |range: (f64, f64), pixels: f64| pixels / (1.08 * (range.1 - range.0)).max(1.0);
        let scale = fits(east, width).min(fits(north, height));
        let around = |(low, high): (f64, f64), pixels: f64| {
            let (middle, half) = (0.5 * (low + high), 0.5 * pixels / scale);
            (middle - half, middle + half)
        };
        Some(Self { east: around(east, width), north: around(north, height), scale })
    }

    fn at(&self, [north, east]: [f64; 2]) -> (f64, f64) {
        (LEFT + (east - self.east.0) * self.scale, MAP_HEIGHT - BOTTOM - (north - self.north.0) * self.scale)
    }
}

fn map(series: &TrajectorySeries, outages: &[(f64, f64)], title: &str, svg: &mut String) {
    let Some(frame) = Frame::of(series) else { return };
    let (right, bottom) = (WIDTH - RIGHT, MAP_HEIGHT - BOTTOM);
    for north in ticks(frame.north, Scale::Linear) {
        let (_, y) = frame.at([north, frame.east.0]);
        let _ = writeln!(svg, "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{right}\"/>");
        text(svg, "tick", (LEFT - 6.0, y + 4.0), "end", &tick_label(north));
    }
    for east in ticks(frame.east, Scale::Linear) {
        let (x, _) = frame.at([frame.north.0, east]);
        let _ = writeln!(svg, "<path class=\"grid\" d=\"M{x:.1} {TOP}V{bottom}\"/>");
        text(svg, "tick", (x, bottom + 15.0), "middle", &tick_label(east));
    }
    let _ = writeln!(svg, "<text class=\"title\" x=\"{LEFT}\" y=\"18\">{title}: north over east (m)</text>");
    for (start, end) in outages {
        let missing = |t: f64| *start <= t && t < *end;
        let points =
            series.t_s.iter().zip(&series.north_east_m).filter(|(t, _)| missing(**t)).map(|(_, p)| *p);
        track(&frame, points, "missing", svg);
    }
    track(&frame, series.north_east_m.iter().copied(), "first", svg);
    for (class, place) in [("begin", series.north_east_m.first()), ("end", series.north_east_m.last())] {
        let (x, y) = frame.at(*place.unwrap_or(&[0.0; 2]));
        let _ = writeln!(svg, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"/>");
    }
}

fn track(frame: &Frame, points: impl Iterator<Item = [f64; 2]>, class: &str, svg: &mut String) {
    let mut d = String::new();
    for (i, point) in points.enumerate() {
        let (x, y) = frame.at(point);
        let _ = write!(d, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' });
    }
    let _ = writeln!(svg, "<path class=\"{class}\" d=\"{d}\"/>");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series() -> TrajectorySeries {
        let n = 11;
        TrajectorySeries {
            t_s: (0..n).map(f64::from).collect(),
            north_east_m: (0..n).map(|k| [100.0 * f64::from(k), 0.0]).collect(),
            height_m: vec![400.0; n as usize],
            speed_m_s: vec![100.0; n as usize],
            rpy_deg: (0..n).map(|k| [0.0, 0.0, if k < 5 { 179.0 } else { -179.0 }]).collect(),
        }
    }

    #[test]
    fn one_picture_with_everything_inside() {
        let svg = trajectory_svg("a<b", &series(), &[(3.0, 6.0)]);
        assert!(svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("class=\"outage\"").count(), 4); // a stripe in each panel
        assert_eq!(svg.matches("<path class=\"missing\"").count(), 1);
        assert!(svg.contains("<title>a&lt;b</title>") && !svg.contains("NaN") && !svg.contains("href"));
    }

    #[test]
    fn the_map_has_one_scale_and_the_heading_is_broken_where_it_wraps() {
        let s = series();
        let frame = Frame::of(&s).unwrap();
        let ((x0, y0), (x1, y1)) = (frame.at([0.0, 0.0]), frame.at([300.0, 300.0]));
        assert!((x1 - x0 - (y0 - y1)).abs() < 1e-9 && x1 > x0);
        let yaw: Vec<_> = s.t_s.iter().zip(&s.rpy_deg).map(|(t, r)| (*t, r[2])).collect();
        assert_eq!(pieces(&yaw).iter().map(Vec::len).collect::<Vec<_>>(), [5, 6]);
    }
}
