//! `nav-sim trajectory check`.

use super::Source;
use crate::cli::{Failure, Session, parse};
use crate::closure::{Bounds, Closure};
use crate::earth::GravityModel;
use crate::trajectory::Trajectory;
use crate::trajectory::plausibility::{Excess, Limits, Quantity, examine};
use crate::units::DEG;
use serde::Serialize;

/// Check a trajectory: could a vehicle move so, and does navigation close on it?
///
/// Closure: the noise-free IMU samples of the trajectory, mechanised from its exact start, are compared with
/// it; what is left is the error of the strapdown algorithm at this rate. Beyond a bound the exit code is 3.
/// Motion beyond a limit, and velocity columns that contradict the positions, are warnings.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory check trajectories/land_vehicle.toml
  nav-sim trajectory check trajectories/fixed_wing.toml --rate-hz 200 --max-position-m 0.001
  nav-sim trajectory check trajectories/figure_eight.toml --limit-speed 15 --format json")]
pub(super) struct Args {
    #[command(flatten)]
    source: Source,
    /// IMU rate at which the closure is computed
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = parse::rate_hz)]
    rate_hz: f64,
    /// Bound on the closure's distance
    #[arg(long, value_name = "M", default_value_t = Bounds::default().position_m, value_parser = parse::positive)]
    max_position_m: f64,
    /// Bound on the closure's velocity
    #[arg(long, value_name = "M_S", default_value_t = Bounds::default().velocity_m_s, value_parser = parse::positive)]
    max_velocity_m_s: f64,
    /// Bound on the closure's angle
    #[arg(long, value_name = "RAD", default_value_t = Bounds::default().attitude_rad, value_parser = parse::positive)]
    max_attitude_rad: f64,
    /// Largest plausible speed (m/s)
    #[arg(long, value_name = "M_S", default_value_t = Limits::default().speed, value_parser = parse::positive)]
    limit_speed: f64,
    /// Largest plausible acceleration (m/s²)
    #[arg(long, value_name = "M_S2", default_value_t = Limits::default().acceleration, value_parser = parse::positive)]
    limit_accel: f64,
    /// Largest plausible change of acceleration over 0.1 s (m/s³)
    #[arg(long, value_name = "M_S3", default_value_t = Limits::default().jerk, value_parser = parse::positive)]
    limit_jerk: f64,
    /// Largest plausible angular rate (deg/s)
    #[arg(long, value_name = "DEG_S", default_value_t = Limits::default().rate / DEG, value_parser = parse::positive)]
    limit_rate: f64,
}

/// What was found, as JSON.
#[derive(Serialize)]
struct Report {
    file: String,
    start_s: f64,
    end_s: f64,
    points: usize,
    path_m: f64,
    largest: Largest,
    beyond_limits: Vec<String>,
    warnings: Vec<String>,
    closure: ClosureReport,
}

#[derive(Serialize)]
struct Largest {
    speed_m_s: f64,
    acceleration_m_s2: f64,
    jerk_m_s3: f64,
    rate_deg_s: f64,
}

#[derive(Serialize)]
struct ClosureReport {
    rate_hz: f64,
    duration_s: f64,
    position_m: f64,
    horizontal_m: f64,
    velocity_m_s: f64,
    attitude_rad: f64,
    within_bounds: bool,
}

/// Stretches beyond limits that are said one by one.
const SAID: usize = 10;

pub(super) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let (trajectory, warnings) = args.source.read(session)?;
    let (largest, beyond) = examine(&trajectory, &args.limits());
    let name = args.source.name();
    for excess in beyond.iter().take(SAID) {
        session.printer.warn(&format!("{name}: {excess}"));
    }
    if beyond.len() > SAID {
        let more = beyond.len() - SAID;
        session
            .printer
            .warn(&format!("{name}: and {more} more stretches beyond limits (--format json lists all)"));
    }
    let closure = Closure::new(&trajectory, args.rate_hz, GravityModel::default())
        .map_err(|e| Failure::input(format!("{name}: {e}")).hint("give another --rate-hz"))?;
    let within = closure.within(&args.bounds());
    let report = report(name, &trajectory, largest, &beyond, warnings, &closure, within);
    let text = if session.json() {
        serde_json::to_string_pretty(&report).map_err(Failure::could_not)?
    } else {
        args.text(&report)
    };
    session.printer.result(&text);
    if within { Ok(()) } else { Err(args.not_met(&report)) }
}

impl Args {
    fn limits(&self) -> Limits {
        let (speed, acceleration) = (self.limit_speed, self.limit_accel);
        Limits { speed, acceleration, jerk: self.limit_jerk, rate: self.limit_rate * DEG }
    }

    fn bounds(&self) -> Bounds {
        let (position_m, velocity_m_s) = (self.max_position_m, self.max_velocity_m_s);
        Bounds { position_m, velocity_m_s, attitude_rad: self.max_attitude_rad }
    }

    fn text(&self, report: &Report) -> String {
        let (l, c) = (&report.largest, &report.closure);
        let verdict = if c.within_bounds { "within bounds" } else { "BEYOND A BOUND" };
        let rows = [
            format!(
                "{}: {} s from {} s, {} points",
                report.file,
                report.end_s - report.start_s,
                report.start_s,
                report.points
            ),
            format!("  path          {:.1} m", report.path_m),
            format!("  speed         {:8.3} m/s    limit {}", l.speed_m_s, self.limit_speed),
            format!("  acceleration  {:8.3} m/s²   limit {}", l.acceleration_m_s2, self.limit_accel),
            format!("  jerk (0.1 s)  {:8.3} m/s³   limit {}", l.jerk_m_s3, self.limit_jerk),
            format!("  angular rate  {:8.3} deg/s  limit {}", l.rate_deg_s, self.limit_rate),
            format!("closure at {} Hz over {} s: {verdict}", c.rate_hz, c.duration_s),
            format!(
                "  position      {:.3e} m (horizontal {:.3e})  bound {:e}",
                c.position_m, c.horizontal_m, self.max_position_m
            ),
            format!("  velocity      {:.3e} m/s  bound {:e}", c.velocity_m_s, self.max_velocity_m_s),
            format!("  attitude      {:.3e} rad  bound {:e}", c.attitude_rad, self.max_attitude_rad),
        ];
        rows.join("\n")
    }

    fn not_met(&self, report: &Report) -> Failure {
        let c = &report.closure;
        let text = [
            (c.position_m, self.max_position_m, "m"),
            (c.velocity_m_s, self.max_velocity_m_s, "m/s"),
            (c.attitude_rad, self.max_attitude_rad, "rad"),
        ]
        .into_iter()
        .filter(|(found, bound, _)| found.is_nan() || found > bound)
        .map(|(found, bound, unit)| format!("{found:.3e} {unit}, beyond {bound:e} {unit}"))
        .collect::<Vec<_>>();
        Failure::bound(format!("{}: closure at {} Hz is {}", report.file, c.rate_hz, text.join("; ")))
            .hint("a higher --rate-hz closes better; rough motion may deserve a wider bound")
    }
}

fn report(
    file: String,
    trajectory: &Trajectory,
    largest: [f64; 4],
    beyond: &[Excess],
    warnings: Vec<String>,
    c: &Closure,
    within_bounds: bool,
) -> Report {
    let shown = |q: Quantity| largest[q as usize] * q.display().2;
    Report {
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
        closure: ClosureReport {
            rate_hz: c.rate_hz,
            duration_s: c.duration_s,
            position_m: c.position_m,
            horizontal_m: c.horizontal_m,
            velocity_m_s: c.velocity_m_s,
            attitude_rad: c.attitude_rad,
            within_bounds,
        },
    }
}

/// Length of the path (m): chords between the points.
fn path_length(trajectory: &Trajectory) -> f64 {
    let places: Vec<_> = trajectory.knots().iter().map(|t| trajectory.kinematics(*t).r_e).collect();
    places.windows(2).map(|w| w[0].distance(w[1])).sum()
}
