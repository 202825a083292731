//! `nav-sim trajectory plot`.

use super::{Source, wrote};
use crate::cli::{Failure, Session};
use crate::formats::atomic;
use crate::report::{TrajectorySeries, trajectory_svg};
use crate::sensors::outage::Outage;
use std::path::PathBuf;

/// Draw a trajectory: map, height, speed, attitude, outages marked
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory plot trajectories/land_vehicle.toml -o drive.svg
  nav-sim trajectory plot trajectories/land_vehicle.toml --outage 300:390 -o outage.svg
  nav-sim trajectory plot trajectories/fixed_wing.toml -o flight.svg")]
pub(super) struct Args {
    #[command(flatten)]
    source: Source,
    /// A stretch without GNSS to mark, in seconds (repeatable)
    #[arg(long = "outage", value_name = "START:END")]
    outages: Vec<Outage>,
    /// SVG to write
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    atomic::guard_inputs(&args.out, [args.source.path.as_path()])?;
    let (trajectory, _) = args.source.read(session)?;
    let outages: Vec<_> = args.outages.iter().map(|o| (o.start_s, o.end_s)).collect();
    let name = args.source.path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let picture = trajectory_svg(&name, &TrajectorySeries::of(&trajectory), &outages);
    atomic::write_result(&args.out, picture, session.existing())?;
    wrote(&args.out, session);
    Ok(())
}
