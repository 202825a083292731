//! `nav-sim trajectory check`.

use super::Source;
use crate::cli::{Failure, Session, parse};
use crate::report::TrajectoryCheck;
use nav_sim_navigation::closure::{Bounds, Closure};
use nav_sim_navigation::earth::GravityModel;
use nav_sim_navigation::trajectory::plausibility::{Limits, examine};

/// Check a trajectory: could a vehicle move so, and does navigation close on it?
///
/// Closure: the noise-free IMU samples of the trajectory are mechanised from its exact start and compared with
/// it. The difference is the error of the strapdown algorithm at this rate. Closure beyond a bound and motion beyond
/// a limit end with exit code 3. Velocity columns that contradict the positions are warnings.
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
    /// Bound on the position error of the closure (m)
    #[arg(long, value_name = "M", default_value_t = Bounds::default().position_m, value_parser = parse::positive)]
    max_position_m: f64,
    /// Largest plausible speed (m/s)
    #[arg(long, value_name = "M_S", default_value_t = Limits::default().speed, value_parser = parse::positive)]
    limit_speed: f64,
}

/// Stretches beyond limits that are said one by one.
const SAID: usize = 10;

pub(super) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let (trajectory, warnings) = args.source.read(session)?;
    let (largest, beyond) = examine(&trajectory, &args.limits());
    let name = args.source.name();
    for excess in beyond.iter().take(SAID) {
        session.warn(format!("{name}: {excess}"));
    }
    if beyond.len() > SAID {
        let more = beyond.len() - SAID;
        session.warn(format!(
            "{name}: and {more} more stretches beyond limits (--format json lists all)"
        ));
    }
    let closure = Closure::new(&trajectory, args.rate_hz, GravityModel::default())
        .map_err(|e| Failure::input(format!("{name}: {e}")).hint("give another --rate-hz"))?;
    let found = (args.source.name(), warnings);
    let check = TrajectoryCheck::new(
        found,
        &trajectory,
        (largest, &beyond),
        &args.limits(),
        (closure, args.bounds()),
    );
    session.show(|| crate::report::json(&check), || check.text());
    match check.missed() {
        Some(missed) => Err(Failure::bound(missed).hint(hint(&check))),
        None => Ok(()),
    }
}

/// What may help where a bound or a limit is not kept.
fn hint(check: &TrajectoryCheck) -> String {
    let closure = (!check.is_closed())
        .then_some("a higher --rate-hz closes better; rough motion may deserve a wider bound");
    let motion = (!check.is_plausible())
        .then_some("a vehicle that does move so deserves a larger --limit-speed");
    closure
        .into_iter()
        .chain(motion)
        .collect::<Vec<_>>()
        .join("; ")
}

impl Args {
    fn limits(&self) -> Limits {
        Limits {
            speed: self.limit_speed,
            ..Limits::default()
        }
    }

    fn bounds(&self) -> Bounds {
        Bounds {
            position_m: self.max_position_m,
            ..Bounds::default()
        }
    }
}
