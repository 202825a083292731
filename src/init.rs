//! A directory to start from: a commented file of every kind, trajectories, virtual IMUs.

use crate::io::{Failure, atomic};
use std::fs;
use std::path::{Path, PathBuf};

macro_rules! repository_files {
    ($($path:literal => $name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../", $path)).as_slice())),*]
    };
}

const FILES: &[(&str, &[u8])] = repository_files![
    "examples/scenario.toml" => "scenario.toml",
    "examples/model.toml" => "imu.toml",
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
    "examples/phone.toml" => "examples/phone.toml",
    "examples/paper_table1.toml" => "examples/paper_table1.toml",
    "examples/quick_study.toml" => "examples/quick_study.toml",
    "examples/quick_drive.toml" => "examples/quick_drive.toml",
];

/// What became of the files.
pub(crate) struct StartFiles {
    /// Those that were made.
    pub(crate) written: Vec<PathBuf>,
    /// Those that were there already.
    pub(crate) kept: Vec<PathBuf>,
}

/// Makes them in a directory, all or none. Those that are there already are left alone.
///
/// # Errors
/// When the system refuses.
pub(crate) fn write_start_files(directory: &Path) -> Result<StartFiles, Failure> {
    let mut made = Made::default();
    let mut kept = Vec::new();
    for (name, contents) in FILES {
        let path = directory.join(name);
        if path.exists() {
            kept.push(path);
            continue;
        }
        made.directories.extend(
            path.ancestors()
                .skip(1)
                .filter(|p| !p.exists())
                .map(Path::to_owned),
        );
        atomic::write(&path, contents)?;
        made.files.push(path);
    }
    made.directories.clear();
    Ok(StartFiles {
        written: std::mem::take(&mut made.files),
        kept,
    })
}

/// What was made so far; removed again if not all can be.
#[derive(Default)]
struct Made {
    files: Vec<PathBuf>,
    /// Those that were not there before.
    directories: Vec<PathBuf>,
}

impl Drop for Made {
    fn drop(&mut self) {
        for file in &self.files {
            let _ = fs::remove_file(file);
        }
        self.directories
            .sort_by_key(|path| std::cmp::Reverse(path.components().count()));
        for directory in &self.directories {
            let _ = fs::remove_dir(directory); // if nothing else is in it
        }
    }
}
