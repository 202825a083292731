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

/// Makes them in a directory, all or none, and returns the paths of those that were made and of those that were there
/// already, which are left alone.
///
/// # Errors
/// When the system refuses.
pub(crate) fn write_start_files(directory: &Path) -> Result<(Vec<String>, Vec<String>), Failure> {
    let files = FILES
        .iter()
        .map(|(name, contents)| (directory.join(name), contents));
    let (kept, new): (Vec<_>, Vec<_>) = files.partition(|(path, _)| path.exists());
    let above = new.iter().flat_map(|(path, _)| path.ancestors().skip(1));
    let mut missing: Vec<&Path> = above.filter(|path| !path.exists()).collect();
    missing.sort();
    let mut written = new
        .iter()
        .map(|(path, contents)| atomic::write(path, contents));
    written.try_for_each(|written| written).inspect_err(|_| {
        new.iter().for_each(|(path, _)| drop(fs::remove_file(path)));
        // the inner ones first, if nothing else is in them
        missing
            .iter()
            .rev()
            .for_each(|path| drop(fs::remove_dir(path)));
    })?;
    let shown =
        |files: &[(PathBuf, _)]| files.iter().map(|(p, _)| p.display().to_string()).collect();
    Ok((shown(&new), shown(&kept)))
}
