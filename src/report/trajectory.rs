//! A trajectory in pictures: map, height, speed, attitude, outages marked.

use super::page::{Axis, Chart, Colour, Mark, Panel, Series};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::frames::RollPitchYaw;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::units::DEG;

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

/// Instants of a trajectory that are drawn: more do not show.
const INSTANTS: u32 = 4000;

impl TrajectorySeries {
    /// A trajectory at evenly spaced instants.
    pub(crate) fn of(trajectory: &Trajectory) -> Self {
        let start = trajectory.state(trajectory.start_s());
        let step = (trajectory.end_s() - trajectory.start_s()) / f64::from(INSTANTS);
        let mut series = Self::default();
        for k in 0..=INSTANTS {
            let t_s = trajectory.start_s() + step * f64::from(k);
            let state = trajectory.state(t_s);
            let moved = ned_difference(&start, state.lat, state.lon, state.h);
            let rpy = RollPitchYaw::from_quat(state.q_b_n);
            series.t_s.push(t_s);
            series.north_east_m.push([moved.x, moved.y]);
            series.height_m.push(state.h);
            series.speed_m_s.push(state.v_n.length());
            series
                .rpy_deg
                .push([rpy.roll, rpy.pitch, rpy.yaw].map(|a| a / DEG));
        }
        series
    }

    /// The way on a map: outages marked, start and end named.
    pub(crate) fn map(&self, title: &str, outages: &[(f64, f64)]) -> Chart {
        let east_north = |p: &[f64; 2]| (p[1], p[0]);
        let way = self.north_east_m.iter().map(east_north).collect();
        let mut series = vec![Series::line("reference", Colour::BELIEVED, way)];
        for (start_s, end_s) in outages {
            let instants = self.t_s.iter().zip(&self.north_east_m);
            let within = instants
                .filter(|(t, _)| (start_s..end_s).contains(t))
                .map(|(_, p)| east_north(p));
            series.push(Series::new(
                "outage",
                Colour::REAL,
                Mark::Line(within.collect(), super::page::Stroke::Bold),
            ));
        }
        let ends = [
            ("start", self.north_east_m.first()),
            ("end", self.north_east_m.last()),
        ];
        series.extend(ends.into_iter().filter_map(|(name, p)| {
            let (east, north) = east_north(p?);
            Some(Series::new(name, Colour::RIGHT, Mark::Place(east, north)))
        }));
        Chart::map(title, series)
    }

    /// Height, speed and attitude. At least so much is shown that rounding does not fill a panel.
    pub(crate) fn over_time(&self, outages: &[(f64, f64)]) -> Chart {
        let values = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
            self.t_s
                .iter()
                .enumerate()
                .map(|(i, t)| (*t, value(i)))
                .collect()
        };
        let rpy = |k: usize| values(&|i| self.rpy_deg[i][k]);
        let line = |name: &str, hue: usize, points| Series::line(name, Colour::Hue(hue), points);
        let panel = |label: &str, (low, high): (f64, f64), series| Panel {
            height: 0.6,
            ..Panel::new(Axis::linear(label).including(low, high), series)
        };
        let height = self
            .height_m
            .first()
            .map_or((0.0, 1.0), |h| (h - 1.0, h + 1.0));
        let panels = vec![
            panel(
                "height (m)",
                height,
                vec![line("", 0, values(&|i| self.height_m[i]))],
            ),
            panel(
                "speed (m/s)",
                (0.0, 1.0),
                vec![line("", 0, values(&|i| self.speed_m_s[i]))],
            ),
            panel(
                "roll, pitch (°)",
                (-1.0, 1.0),
                vec![line("roll", 0, rpy(0)), line("pitch", 1, rpy(1))],
            ),
            panel("yaw (°)", (-1.0, 1.0), vec![line("", 0, broken(&rpy(2)))]),
        ];
        Chart::new(
            "Height, speed and attitude",
            Axis::linear("time (s)"),
            panels,
        )
        .with_outages(outages)
    }
}

/// The line is broken where the heading passes ±180°.
fn broken(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut pieces = Vec::new();
    for piece in points.chunk_by(|a, b| (a.1 - b.1).abs() <= 180.0) {
        pieces.extend_from_slice(piece);
        pieces.extend(piece.last().map(|p| (p.0, f64::NAN)));
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::page::svg;

    fn series() -> TrajectorySeries {
        let n = 11;
        TrajectorySeries {
            t_s: (0..n).map(f64::from).collect(),
            north_east_m: (0..n).map(|k| [100.0 * f64::from(k), 0.0]).collect(),
            height_m: vec![400.0; n as usize],
            speed_m_s: vec![100.0; n as usize],
            rpy_deg: (0..n)
                .map(|k| [0.0, 0.0, if k < 5 { 179.0 } else { -179.0 }])
                .collect(),
        }
    }

    #[test]
    fn one_picture_with_everything_inside() {
        let (series, outages) = (series(), [(3.0, 6.0)]);
        let svg = svg(
            "a<b",
            &[series.map("a<b", &outages), series.over_time(&outages)],
        );
        assert!(svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("class=\"outage\" x").count(), 5); // a stripe in each panel, and the legend
        assert_eq!(svg.matches("data-name=\"outage\"").count(), 1); // on the map
        assert!(
            svg.contains("<title>a&lt;b</title>") && !svg.contains("NaN") && !svg.contains("href")
        );
    }

    #[test]
    fn the_heading_is_broken_where_it_wraps() {
        let s = series();
        let yaw: Vec<_> = s
            .t_s
            .iter()
            .zip(&s.rpy_deg)
            .map(|(t, r)| (*t, r[2]))
            .collect();
        let pieces = broken(&yaw);
        assert_eq!(
            pieces
                .split(|p| p.1.is_nan())
                .map(<[_]>::len)
                .collect::<Vec<_>>(),
            [5, 6, 0]
        );
    }
}
