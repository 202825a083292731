//! A trajectory on a map, and its check.

use nav_sim_document::{Chart, Colour, Mark, Series, Table};
use nav_sim_navigation::closure::{Bounds, Closure};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::{Excess, Limits, Quantity};
use nav_sim_signal::units::DEG;
use serde::Serialize;

/// Instants of a trajectory that are drawn: more do not show.
const INSTANTS: u32 = 4000;

/// The track of a trajectory: time (s), and place east and north of the start (m), at evenly spaced instants.
pub(crate) fn track(trajectory: &Trajectory) -> Vec<(f64, [f64; 2])> {
    let start = trajectory.state(trajectory.start_s());
    let step = (trajectory.end_s() - trajectory.start_s()) / f64::from(INSTANTS);
    let instant = |k: u32| {
        let t_s = trajectory.start_s() + step * f64::from(k);
        let state = trajectory.state(t_s);
        let moved = ned_difference(&start, state.lat, state.lon, state.h);
        (t_s, [moved.y, moved.x])
    };
    (0..=INSTANTS).map(instant).collect()
}

/// A track on a map: outages marked, start and end named.
pub(crate) fn track_map(track: &[(f64, [f64; 2])], title: &str, outages: &[(f64, f64)]) -> Chart {
    let way = |from_s: f64, to_s: f64| {
        let within = track.iter().filter(|(t, _)| (from_s..to_s).contains(t));
        within.map(|(_, place)| (*place).into()).collect()
    };
    let all = way(f64::NEG_INFINITY, f64::INFINITY);
    let mut series = vec![Series::line("reference", Colour::BELIEVED, all)];
    series.extend(outages.iter().map(|(start_s, end_s)| {
        let line = Mark::Line(way(*start_s, *end_s), nav_sim_document::Stroke::Bold);
        Series::new("outage", Colour::REAL, line)
    }));
    let ends = [("start", track.first()), ("end", track.last())];
    series.extend(ends.into_iter().filter_map(|(name, end)| {
        let (_, [east, north]) = *end?;
        Some(Series::new(name, Colour::RIGHT, Mark::Place(east, north)))
    }));
    Chart::map(title, series)
}

#[cfg(test)]
mod trajectory_tests {
    use super::*;
    use nav_sim_document::svg;

    #[test]
    fn a_map_has_everything_inside() {
        let track: Vec<_> = (0..11)
            .map(|k| (f64::from(k), [0.0, 100.0 * f64::from(k)]))
            .collect();
        let svg = svg("a<b", &[track_map(&track, "a<b", &[(3.0, 6.0)])]);
        assert!(svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("data-name=\"outage\"").count(), 1);
        assert!(
            svg.contains("<title>a&lt;b</title>") && !svg.contains("NaN") && !svg.contains("href")
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
    largest: Motion,
    limits: Motion,
    beyond_limits: Vec<String>,
    warnings: Vec<String>,
    closure: Closed,
    bounds: Bounds,
}

#[derive(Debug, Serialize)]
struct Motion {
    speed_m_s: f64,
    acceleration_m_s2: f64,
    jerk_m_s3: f64,
    rate_deg_s: f64,
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
        let shown = |q: Quantity| largest[q as usize] * q.display().2;
        Self {
            file,
            start_s: trajectory.start_s(),
            end_s: trajectory.end_s(),
            points: trajectory.knots().len(),
            path_m: path_length(trajectory),
            largest: Motion {
                speed_m_s: shown(Quantity::Speed),
                acceleration_m_s2: shown(Quantity::Acceleration),
                jerk_m_s3: shown(Quantity::Jerk),
                rate_deg_s: shown(Quantity::Rate),
            },
            limits: Motion {
                speed_m_s: limits.speed,
                acceleration_m_s2: limits.acceleration,
                jerk_m_s3: limits.jerk,
                rate_deg_s: limits.rate / DEG,
            },
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
