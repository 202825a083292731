//! `nav-sim trajectory`: reference trajectories.

mod check;
mod record;
mod write;

use super::{Failure, Session};
use crate::io::trajectory_file::{Options, load, parse_origin};
use nav_sim_navigation::trajectory::Trajectory;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Make, check and convert reference trajectories
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory check trajectories/land_vehicle.toml
  nav-sim trajectory generate trajectories/fixed_wing.toml --rate-hz 10 -o flight.csv
  nav-sim trajectory convert trajectories/land_vehicle.toml --rate-hz 1 -o drive.csv")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Generate(write::GenerateArgs),
    Check(check::Args),
    Convert(write::ConvertArgs),
    Record(record::Args),
}

/// The trajectory of a command.
#[derive(clap::Args, Debug)]
struct Source {
    /// Motion profile (.toml) or table (.csv, .tsv, .txt, also .gz)
    #[arg(value_name = "TRAJECTORY")]
    path: PathBuf,
    /// Origin of local coordinates, if the file does not state it: latitude, longitude, height
    #[arg(long, value_name = "LAT_DEG,LON_DEG,H_M", value_parser = origin, allow_hyphen_values = true)]
    origin: Option<Origin>,
}

impl Source {
    /// Reads it; what is doubtful about it is said and handed back.
    fn read(&self, session: &Session) -> Result<(Trajectory, Vec<String>), Failure> {
        let options = Options {
            origin: self.origin.map(|o| o.0),
        };
        let (trajectory, warnings) = load(&self.path, &options)?;
        let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        session.warn_all(&warnings);
        Ok((trajectory, warnings))
    }

    /// Name of the file.
    fn name(&self) -> String {
        self.path.display().to_string()
    }
}

/// Latitude, longitude (rad), height (m).
#[derive(Debug, Clone, Copy)]
struct Origin([f64; 3]);

fn origin(text: &str) -> Result<Origin, String> {
    let expected = || "not LAT_DEG,LON_DEG,H_M with a latitude within ±89.9".to_owned();
    parse_origin(text).map(Origin).ok_or_else(expected)
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    match &args.command {
        Command::Generate(args) => write::generate(args, session),
        Command::Check(args) => check::run(args, session),
        Command::Convert(args) => write::convert(args, session),
        Command::Record(args) => record::run(args, session),
    }
}

/// Says where an output is.
fn wrote(path: &Path, session: &Session) {
    if session.json() {
        let json = json!({ "schema_version": 1, "written": [path.display().to_string()] });
        session.result(json);
    }
    session.wrote(path);
}
