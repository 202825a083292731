//! The directory of a fusion.

use super::inputs::guarded;
use crate::cli::Failure;
use crate::cli::run::not_of_another_command;
use nav_sim::formats::atomic::AtomicDir;
use nav_sim::fusion::Solution;
use nav_sim::report::{FusionKind, FusionManifest, FusionSummary, Input, fusion_directory};
use std::path::Path;

/// Whether the directory can be made, found out before the work.
pub(super) fn try_open(out: &Path, inputs: &[Input]) -> Result<(), Failure> {
    guarded(out, inputs)?;
    not_of_another_command(out, |text| serde_json::from_str::<FusionManifest>(text).is_ok())?;
    drop(AtomicDir::create(out)?);
    Ok(())
}

/// Writes all files, the manifest last.
pub(super) fn write(
    solution: &Solution,
    summary: &FusionSummary,
    inputs: Vec<Input>,
    wall_s: f64,
    out: &Path,
) -> Result<(), Failure> {
    let title = inputs.first().map_or("solution", |imu| imu.path.as_str()).to_owned();
    let manifest = FusionManifest {
        schema_version: 1,
        kind: FusionKind::Fusion,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
        inputs,
        wall_s,
    };
    let mut directory = AtomicDir::create(out)?;
    for file in fusion_directory(solution, summary, &manifest, &title) {
        directory.write_parts(file.name, file.parts)?;
    }
    directory.commit()?;
    Ok(())
}
