//! A trajectory in pictures: map, height, speed, attitude, outages marked.

use nav_sim_document::{Axis, Chart, Colour, Mark, Panel, Series, Table};
use nav_sim_navigation::closure::{Bounds, Closure};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::frames::RollPitchYaw;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::{Excess, Limits};
use nav_sim_signal::units::DEG;
use serde::Serialize;
use serde_json::{Value, json};

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
                Mark::Line(within.collect(), nav_sim_document::Stroke::Bold),
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
mod trajectory_tests {
    use super::*;
    use nav_sim_document::svg;

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

// The check of a trajectory: could a vehicle move along it, and does navigation close on it?

/// Results of the check.
#[derive(Debug, Serialize)]
pub struct TrajectoryCheck {
    /// File.
    pub file: String,
    start_s: f64,
    end_s: f64,
    points: usize,
    path_m: f64,
    largest: Value,
    limits: Value,
    beyond_limits: Vec<String>,
    warnings: Vec<String>,
    closure: Closed,
    bounds: Bounds,
}

#[derive(Debug, Serialize)]
struct Closed {
    #[serde(flatten)]
    closure: Closure,
    within_bounds: bool,
}

impl TrajectoryCheck {
    /// `largest` and `beyond` are of [`examine`](nav_sim_navigation::trajectory::plausibility::examine).
    pub(crate) fn new(
        (file, warnings): (String, Vec<String>),
        trajectory: &Trajectory,
        (largest, beyond, limits): ([f64; 4], &[Excess], Limits),
        (closure, bounds): (Closure, Bounds),
    ) -> Self {
        let motion = |[speed, acceleration, jerk, rate]: [f64; 4]| {
            json!({
                "speed_m_s": speed,
                "acceleration_m_s2": acceleration,
                "jerk_m_s3": jerk,
                "rate_deg_s": rate / DEG,
            })
        };
        Self {
            file,
            start_s: trajectory.start_s(),
            end_s: trajectory.end_s(),
            points: trajectory.knots().len(),
            path_m: path_length(trajectory),
            largest: motion(largest),
            limits: motion([limits.speed, limits.acceleration, limits.jerk, limits.rate]),
            beyond_limits: beyond.iter().map(ToString::to_string).collect(),
            warnings,
            closure: Closed {
                closure,
                within_bounds: closure.within(&bounds),
            },
            bounds,
        }
    }

    /// True if the closure is within the bounds.
    pub(crate) const fn is_closed(&self) -> bool {
        self.closure.within_bounds
    }

    /// True if the motion is within the limits.
    pub(crate) const fn is_plausible(&self) -> bool {
        self.beyond_limits.is_empty()
    }

    /// The same for people.
    pub(crate) fn text(&self) -> String {
        let rows = [
            ("path (m)", "path_m -"),
            ("speed (m/s)", "largest/speed_m_s limits/speed_m_s"),
            (
                "acceleration (m/s²)",
                "largest/acceleration_m_s2 limits/acceleration_m_s2",
            ),
            (
                "jerk over 0.1 s (m/s³)",
                "largest/jerk_m_s3 limits/jerk_m_s3",
            ),
            (
                "angular rate (deg/s)",
                "largest/rate_deg_s limits/rate_deg_s",
            ),
            (
                "closure: position (m)",
                "closure/position_m bounds/position_m",
            ),
            ("horizontal (m)", "closure/horizontal_m -"),
            ("velocity (m/s)", "closure/velocity_m_s bounds/velocity_m_s"),
            ("attitude (rad)", "closure/attitude_rad bounds/attitude_rad"),
        ];
        let c = &self.closure.closure;
        format!(
            "{}: {} s from {} s, {} points\nclosure at {} Hz over {} s: {}\n{}",
            self.file,
            self.end_s - self.start_s,
            self.start_s,
            self.points,
            c.rate_hz,
            c.duration_s,
            if self.is_closed() {
                "within bounds"
            } else {
                "BEYOND A BOUND"
            },
            Table::of_keys(self, &["", "largest", "limit"], &rows).columns(usize::MAX)
        )
    }

    /// Bounds that are not met, and how often limits are exceeded; none where all is well.
    pub(crate) fn missed(&self) -> Option<String> {
        let closure = (!self.is_closed()).then(|| {
            let (c, b) = (&self.closure.closure, &self.bounds);
            format!(
                "closure at {} Hz is {:.3e} m, {:.3e} m/s, {:.3e} rad, beyond {:e} m, {:e} m/s or {:e} rad",
                c.rate_hz,
                c.position_m,
                c.velocity_m_s,
                c.attitude_rad,
                b.position_m,
                b.velocity_m_s,
                b.attitude_rad
            )
        });
        let motion = match self.beyond_limits.len() {
            0 => None,
            1 => Some("the motion is beyond a limit in 1 stretch".to_owned()),
            n => Some(format!("the motion is beyond a limit in {n} stretches")),
        };
        let missed: Vec<String> = closure.into_iter().chain(motion).collect();
        (!missed.is_empty()).then(|| format!("{}: {}", self.file, missed.join("; ")))
    }
}

/// Length of the path (m): chords between the points.
fn path_length(trajectory: &Trajectory) -> f64 {
    let places: Vec<_> = trajectory
        .knots()
        .iter()
        .map(|t| trajectory.kinematics(*t).r_e)
        .collect();
    places.windows(2).map(|w| w[0].distance(w[1])).sum()
}
