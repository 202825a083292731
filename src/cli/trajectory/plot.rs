//! `nav-sim trajectory plot`.

use super::{Source, wrote};
use crate::cli::pictures::{claim_picture, write_picture};
use crate::cli::{Failure, Session};
use crate::report::{TrajectorySeries, trajectory_svg};
use nav_sim_navigation::sensors::outage::Outage;
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
    /// Picture to write: .svg (.png with the feature `pictures`)
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let _own = claim_picture(&args.out, std::slice::from_ref(&args.source.path), session)?;
    let (trajectory, _) = args.source.read(session)?;
    let outages: Vec<_> = args.outages.iter().map(|o| (o.start_s, o.end_s)).collect();
    let name = args
        .source
        .path
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let picture = trajectory_svg(&name, &TrajectorySeries::of(&trajectory), &outages);
    write_picture(&args.out, picture)?;
    wrote(&args.out, session);
    Ok(())
}
