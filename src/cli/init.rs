//! `nav-sim init`: a directory to start from.

use super::{Failure, Session};
use crate::init;
use serde_json::json;
use std::path::PathBuf;

/// Make a directory with everything to start from: a commented file of every kind, trajectories, virtual IMUs
///
/// scenario.toml, imu.toml, motion.toml, contamination.toml, initial.toml and examples/quick_study.toml say
/// what each key means. The others are those of the repository; the examples of every --help work inside the directory. Files
/// that exist already are left alone.
#[derive(clap::Args)]
#[command(before_help = "\
Examples:
  nav-sim init study
  nav-sim check study/scenario.toml study/calib_data/consumer_mems.toml
  nav-sim run study/trajectories/land_vehicle.toml study/calib_data/consumer_mems.toml \\
      --scenario study/scenario.toml --runs 8 -o study/out")]
pub(crate) struct Args {
    /// Directory
    #[arg(value_name = "DIR", default_value = ".")]
    directory: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<String, Failure> {
    let (written, kept) = init::write_start_files(&args.directory)?;
    for path in &kept {
        session.say(format!("kept {path}"));
    }
    Ok(match session.is_json() {
        true => json!({ "schema_version": 1, "written": written, "kept": kept }).to_string(),
        false => written.join("\n"),
    })
}
