//! Marks as SVG paths.

use crate::axis::{Ruler, is_shown};
use crate::chart::{Interval, Mark, Series};
use crate::escape::escape;
use std::fmt::Write as _;

/// Points beyond which each is small.
const MANY: usize = 150;

/// Rulers of one panel.
pub(crate) struct Frame {
    pub(crate) x: Ruler,
    pub(crate) y: Ruler,
    /// Points of a line that can be told apart.
    pub(crate) most: usize,
}

impl Frame {
    pub(crate) fn shows(&self, x: f64, y: f64) -> bool {
        is_shown(x, self.x.is_log) && is_shown(y, self.y.is_log)
    }

    fn point(&self, x: f64, y: f64) -> String {
        format!("{:.1} {:.1}", self.x.at(x), self.y.at(y))
    }

    /// The series as a group of paths.
    pub(crate) fn series(&self, series: &Series, key: usize, svg: &mut String) {
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
            Mark::InnerBand(points) => path(svg, "area inner", &self.band(points)),
            Mark::Points(points) => self.points(points, svg),
            Mark::Bars(bars) => path(svg, "bar", &self.bars(bars)),
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
            Mark::Reading(x, y) => {
                let (left, bottom) = (self.x.pixels.0, self.y.pixels.0);
                let (px, py) = (self.x.at(*x), self.y.at(*y));
                path(
                    svg,
                    "line level",
                    &format!("M{left:.1} {py:.1}H{px:.1}V{bottom:.1}"),
                );
                path(svg, "dot", &format!("M{px:.1} {py:.1}h0"));
            }
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

    fn points(&self, points: &[Interval], svg: &mut String) {
        let shown = || points.iter().filter(|p| self.shows(p.x, p.y));
        let with_bar = |p: &&Interval| !(p.low.is_nan() && p.high.is_nan());
        let bar = |p: &Interval| {
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

    /// As wide as 0.7 of the distance of two names.
    fn bars(&self, bars: &[(f64, f64, f64)]) -> String {
        let bar = |(x, from, to): &(f64, f64, f64)| {
            let [left, right] = [x - 0.35, x + 0.35].map(|x| self.x.at(x));
            let [low, high] = [*from, *to].map(|y| self.y.within(y));
            format!("M{left:.1} {low:.1}H{right:.1}V{high:.1}H{left:.1}Z")
        };
        bars.iter()
            .filter(|(_, from, to)| from != to)
            .map(bar)
            .collect()
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

/// The same of a band: of each bucket all that it covers.
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
mod tests {
    use super::*;

    fn frame(is_log: bool) -> Frame {
        let ruler = |is_log, pixels| Ruler {
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
        assert_eq!(
            frame(false).bars(&[(6.0, 1.0, 2.0), (7.0, 2.0, 2.0)]),
            "M46.5 100.0H53.5V90.0H46.5Z"
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
