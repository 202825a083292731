//! `nav-sim init`: a directory to start from.

use super::{Failure, Session};
use crate::init::{self, StartFiles};
use serde_json::json;
use std::path::PathBuf;

/// Make a directory with everything to start from: a commented file of every kind, trajectories, virtual IMUs
///
/// scenario.toml, imu.toml, motion.toml, contamination.toml, initial.toml and examples/quick_study.toml say
/// what each key means. The others are those of the repository; the examples of every --help work inside the directory. Files
/// that exist already are left alone.
#[derive(clap::Args, Debug)]
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

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let StartFiles { written, kept } = init::write_start_files(&args.directory)?;
    let [written, kept] =
        [written, kept].map(|paths| paths.iter().map(|p| p.display().to_string()).collect());
    let (written, kept): (Vec<String>, Vec<String>) = (written, kept);
    kept.iter()
        .for_each(|path| session.say(format!("kept {path}")));
    if session.json() {
        let json = json!({ "schema_version": 1, "written": written, "kept": kept });
        session.result(json);
    } else {
        written.iter().for_each(|path| session.result(path));
    }
    Ok(())
}
