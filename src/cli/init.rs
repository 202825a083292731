//! `nav-sim init`: a directory to start from.

use super::{Failure, Session};
use crate::formats::atomic;
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};

/// Make a directory with everything to start from: a commented file of every kind, trajectories, virtual IMUs
///
/// scenario.toml, imu.toml, motion.toml, parameters.toml, contamination.toml, initial.toml and examples/quick_study.toml say
/// what each key means. The others are those of the repository; the examples of every --help work inside the directory. Files
/// that are there already are left alone.
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

macro_rules! repository_files {
    ($($path:literal => $name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../", $path)).as_slice())),*]
    };
}

const FILES: &[(&str, &[u8])] = repository_files![
    "examples/scenario.toml" => "scenario.toml",
    "examples/model.toml" => "imu.toml",
    "examples/parameters.toml" => "parameters.toml",
    "examples/contamination.toml" => "contamination.toml",
    "examples/initial.toml" => "initial.toml",
    "examples/motion.toml" => "motion.toml",
    "trajectories/land_vehicle.toml" => "trajectories/land_vehicle.toml",
    "trajectories/figure_eight.toml" => "trajectories/figure_eight.toml",
    "trajectories/fixed_wing.toml" => "trajectories/fixed_wing.toml",
    "calib_data/consumer_mems.toml" => "calib_data/consumer_mems.toml",
    "calib_data/tactical.toml" => "calib_data/tactical.toml",
    "calib_data/formats/own.csv" => "calib_data/formats/own.csv",
    "calib_data/formats/euroc.csv" => "calib_data/formats/euroc.csv",
    "calib_data/formats/compressed.csv.gz" => "calib_data/formats/compressed.csv.gz",
    "examples/scenario.toml" => "examples/scenario.toml",
    "examples/paper_fig2.toml" => "examples/paper_fig2.toml",
    "examples/accelerometer_n1.toml" => "examples/accelerometer_n1.toml",
    "examples/phone.toml" => "examples/phone.toml",
    "examples/paper_table1.toml" => "examples/paper_table1.toml",
    "examples/quick_study.toml" => "examples/quick_study.toml",
    "examples/quick_drive.toml" => "examples/quick_drive.toml",
];

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut made = Made::default();
    let mut kept = Vec::new();
    for (name, contents) in FILES {
        let path = args.directory.join(name);
        if path.exists() {
            session.printer.say(&format!("kept {}", path.display()));
            kept.push(path.display().to_string());
            continue;
        }
        made.directories.extend(path.ancestors().skip(1).filter(|p| !p.exists()).map(Path::to_owned));
        made.write(path, contents)?;
    }
    made.directories.clear();
    let written: Vec<String> =
        std::mem::take(&mut made.files).iter().map(|path| path.display().to_string()).collect();
    if session.json() {
        let json = json!({ "schema_version": 1, "written": written, "kept": kept });
        session.printer.result(&json.to_string());
    } else {
        written.iter().for_each(|path| session.printer.result(path));
    }
    Ok(())
}

/// What was made so far; removed again if not all can be.
#[derive(Default)]
struct Made {
    files: Vec<PathBuf>,
    /// Those that were not there before.
    directories: Vec<PathBuf>,
}

impl Made {
    fn write(&mut self, path: PathBuf, contents: &[u8]) -> Result<(), Failure> {
        atomic::write(&path, contents)?;
        self.files.push(path);
        Ok(())
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        for file in &self.files {
            let _ = fs::remove_file(file);
        }
        self.directories.sort_by_key(|path| std::cmp::Reverse(path.components().count()));
        for directory in &self.directories {
            let _ = fs::remove_dir(directory); // if nothing else is in it
        }
    }
}
