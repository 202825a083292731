//! A directory to start from: a commented file of every kind, trajectories, virtual IMUs.

use crate::io::toml_file::schema_path;
use crate::io::{Failure, atomic};
use std::fs;
use std::path::{Path, PathBuf};

macro_rules! repository_files {
    ($($path:literal => $name:literal $(: $kind:literal)?),* $(,)?) => {
        &[$(($name, concat!($($kind)?), include_bytes!(concat!("../", $path)).as_slice())),*]
    };
}

/// Path below the directory, kind of the schema if there is one, contents.
const FILES: &[(&str, &str, &[u8])] = repository_files![
    "examples/scenario.toml" => "scenario.toml": "scenario",
    "examples/model.toml" => "imu.toml": "model",
    "examples/contamination.toml" => "contamination.toml": "contamination",
    "examples/initial.toml" => "initial.toml": "initial",
    "examples/motion.toml" => "motion.toml": "profile",
    "trajectories/land_vehicle.toml" => "trajectories/land_vehicle.toml": "profile",
    "trajectories/figure_eight.toml" => "trajectories/figure_eight.toml": "profile",
    "trajectories/fixed_wing.toml" => "trajectories/fixed_wing.toml": "profile",
    "calib_data/consumer_mems.toml" => "calib_data/consumer_mems.toml": "model",
    "calib_data/tactical.toml" => "calib_data/tactical.toml": "model",
    "calib_data/formats/own.csv" => "calib_data/formats/own.csv",
    "calib_data/formats/euroc.csv" => "calib_data/formats/euroc.csv",
    "calib_data/formats/compressed.csv.gz" => "calib_data/formats/compressed.csv.gz",
    "examples/scenario.toml" => "examples/scenario.toml": "scenario",
    "examples/phone.toml" => "examples/phone.toml": "model",
    "examples/paper_table1.toml" => "examples/paper_table1.toml": "study",
    "examples/quick_study.toml" => "examples/quick_study.toml": "study",
    "examples/quick_drive.toml" => "examples/quick_drive.toml": "profile",
];

/// Contents of a file with the line that names its schema.
fn with_schema(name: &str, kind: &str, contents: &[u8]) -> Vec<u8> {
    if kind.is_empty() {
        return contents.to_vec();
    }
    let up = "../".repeat(name.matches('/').count());
    let line = format!("#:schema {up}{}\n", schema_path(kind));
    [line.as_bytes(), contents].concat()
}

/// Makes them in a directory with the schemas (kind, text), all or none, and returns the paths of those that were made and
/// of those that were there already, which are left alone.
///
/// # Errors
/// When the system refuses.
pub(crate) fn write_start_files(
    directory: &Path,
    schemas: &[(String, String)],
) -> Result<(Vec<String>, Vec<String>), Failure> {
    let examples = FILES
        .iter()
        .map(|(name, kind, contents)| (directory.join(name), with_schema(name, kind, contents)));
    let schemas = schemas
        .iter()
        .map(|(kind, text)| (directory.join(schema_path(kind)), text.clone().into_bytes()));
    let files = examples.chain(schemas);
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
