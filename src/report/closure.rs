//! Whether a vehicle could move along a trajectory and navigation closes on it, in words and as JSON.

use nav_sim_navigation::closure::{Bounds, Closure};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::plausibility::{Excess, Quantity};
use serde::Serialize;

/// What was found.
#[derive(Debug, Serialize)]
pub(crate) struct TrajectoryCheck {
    /// File.
    pub file: String,
    start_s: f64,
    end_s: f64,
    points: usize,
    path_m: f64,
    largest: Largest,
    beyond_limits: Vec<String>,
    warnings: Vec<String>,
    closure: Closed,
    #[serde(skip)]
    bounds: Bounds,
}

#[derive(Debug, Serialize)]
struct Largest {
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
        (largest, beyond): ([f64; 4], &[Excess]),
        (closure, bounds): (Closure, Bounds),
    ) -> Self {
        let shown = |q: Quantity| largest[q as usize] * q.display().2;
        Self {
            file,
            start_s: trajectory.start_s(),
            end_s: trajectory.end_s(),
            points: trajectory.knots().len(),
            path_m: path_length(trajectory),
            largest: Largest {
                speed_m_s: shown(Quantity::Speed),
                acceleration_m_s2: shown(Quantity::Acceleration),
                jerk_m_s3: shown(Quantity::Jerk),
                rate_deg_s: shown(Quantity::Rate),
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

    /// Whether the closure is within the bounds.
    pub(crate) const fn is_closed(&self) -> bool {
        self.closure.within_bounds
    }

    /// Whether the motion is within the limits.
    pub(crate) const fn is_plausible(&self) -> bool {
        self.beyond_limits.is_empty()
    }

    /// The same for people; limits of speed, acceleration, jerk and rate (deg/s) as they were given.
    pub(crate) fn text(&self, [speed, acceleration, jerk, rate_deg_s]: [f64; 4]) -> String {
        let (l, c, b) = (&self.largest, &self.closure.closure, &self.bounds);
        let verdict = if self.is_closed() {
            "within bounds"
        } else {
            "BEYOND A BOUND"
        };
        let Self {
            file,
            start_s,
            end_s,
            points,
            path_m,
            ..
        } = self;
        let rows = [
            format!(
                "{file}: {} s from {start_s} s, {points} points",
                end_s - start_s
            ),
            format!("  path          {path_m:.1} m"),
            format!("  speed         {:8.3} m/s    limit {speed}", l.speed_m_s),
            format!(
                "  acceleration  {:8.3} m/s²   limit {acceleration}",
                l.acceleration_m_s2
            ),
            format!("  jerk (0.1 s)  {:8.3} m/s³   limit {jerk}", l.jerk_m_s3),
            format!(
                "  angular rate  {:8.3} deg/s  limit {rate_deg_s}",
                l.rate_deg_s
            ),
            format!(
                "closure at {} Hz over {} s: {verdict}",
                c.rate_hz, c.duration_s
            ),
            format!(
                "  position      {:.3e} m (horizontal {:.3e})  bound {:e}",
                c.position_m, c.horizontal_m, b.position_m
            ),
            format!(
                "  velocity      {:.3e} m/s  bound {:e}",
                c.velocity_m_s, b.velocity_m_s
            ),
            format!(
                "  attitude      {:.3e} rad  bound {:e}",
                c.attitude_rad, b.attitude_rad
            ),
        ];
        rows.join("\n")
    }

    /// Which bounds are not met, and how often limits are exceeded; none where all is well.
    pub(crate) fn missed(&self) -> Option<String> {
        let closure = (!self.is_closed()).then(|| self.beyond_bounds());
        let motion = match self.beyond_limits.len() {
            0 => None,
            1 => Some("the motion is beyond a limit in 1 stretch".to_owned()),
            n => Some(format!("the motion is beyond a limit in {n} stretches")),
        };
        let missed: Vec<String> = closure.into_iter().chain(motion).collect();
        (!missed.is_empty()).then(|| format!("{}: {}", self.file, missed.join("; ")))
    }

    fn beyond_bounds(&self) -> String {
        let (c, b) = (&self.closure.closure, &self.bounds);
        let all = [
            (c.position_m, b.position_m, "m"),
            (c.velocity_m_s, b.velocity_m_s, "m/s"),
            (c.attitude_rad, b.attitude_rad, "rad"),
        ];
        let beyond = all
            .into_iter()
            .filter(|(found, bound, _)| found.is_nan() || found > bound);
        let text = beyond
            .map(|(found, bound, unit)| format!("{found:.3e} {unit}, beyond {bound:e} {unit}"));
        format!(
            "closure at {} Hz is {}",
            c.rate_hz,
            text.collect::<Vec<_>>().join("; ")
        )
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
