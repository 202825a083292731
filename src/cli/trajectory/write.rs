//! `nav-sim trajectory generate` and `convert`.

use super::{Source, wrote};
use crate::cli::{Failure, Session, parse};
use crate::io::atomic::{Written, claim_result};
use crate::io::trajectory_file::{Rows, write_csv, write_rows};
use std::path::{Path, PathBuf};

/// Write a motion profile as a table of evenly spaced rows
///
/// Columns: time, latitude, longitude, height, velocity north, east, down, roll, pitch, yaw. Numbers have
/// enough digits to be read back exactly.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory generate trajectories/land_vehicle.toml -o drive.csv
  nav-sim trajectory generate trajectories/fixed_wing.toml --rate-hz 10 -o flight.csv.gz
  nav-sim trajectory generate trajectories/figure_eight.toml --rate-hz 1")]
pub(super) struct GenerateArgs {
    #[command(flatten)]
    source: Source,
    /// Rows per second
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = parse::rate_hz)]
    rate_hz: f64,
    /// Table to write (.csv or .csv.gz); without it, standard output
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Convert a trajectory file of any kind to a nav-sim table
///
/// The rows are those of the input, or evenly spaced ones with --rate-hz. Local coordinates become latitude,
/// longitude and height. A path without attitude gets the heading and pitch along it.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory convert trajectories/figure_eight.toml -o eight.csv
  nav-sim trajectory convert trajectories/fixed_wing.toml --rate-hz 20 -o denser.csv.gz
  nav-sim trajectory convert trajectories/land_vehicle.toml --rate-hz 1 -o thinned.csv")]
pub(super) struct ConvertArgs {
    #[command(flatten)]
    source: Source,
    /// Rows per second (default: the rows of the input)
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz)]
    rate_hz: Option<f64>,
    /// Table to write (.csv or .csv.gz)
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn generate(args: &GenerateArgs, session: &Session) -> Result<(), Failure> {
    let rows = Rows::Rate(args.rate_hz);
    if let Some(out) = &args.out {
        return write(&args.source, out, rows, session);
    }
    let (trajectory, _) = args.source.read(session)?;
    let mut text = Vec::new();
    write_rows(&mut text, &trajectory, rows).map_err(Failure::could_not)?;
    session.result(String::from_utf8_lossy(&text).trim_end());
    Ok(())
}

pub(super) fn convert(args: &ConvertArgs, session: &Session) -> Result<(), Failure> {
    write(
        &args.source,
        &args.out,
        args.rate_hz.map_or(Rows::Knots, Rows::Rate),
        session,
    )
}

fn write(source: &Source, out: &Path, rows: Rows, session: &Session) -> Result<(), Failure> {
    let _own = claim_result(
        out,
        [source.path.as_path()],
        Written::Trajectory,
        session.existing(),
    )?;
    let (trajectory, _) = source.read(session)?;
    write_csv(out, &trajectory, rows)?;
    wrote(out, session);
    Ok(())
}
