//! The directory of a fusion.

use crate::cli::{Failure, Session};
use crate::formats::atomic::{AtomicDir, Claim, Found, claim_directory};
use crate::report::{
    FUSION_FILES, FusionConfiguration, FusionKind, FusionManifest, FusionSummary, Input, fusion_directory,
};
use nav_sim_navigation::fusion::Solution;
use std::path::Path;

/// The manifest of a fusion that is yet to run.
pub(super) fn manifest(configuration: FusionConfiguration, inputs: Vec<Input>) -> FusionManifest {
    FusionManifest {
        schema_version: FusionManifest::SCHEMA_VERSION,
        kind: FusionKind::Fusion,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
        configuration,
        inputs,
        wall_s: 0.0,
    }
}

/// Whether the directory can be made, found out before the work.
pub(super) fn claim(out: &Path, manifest: &FusionManifest, session: &Session) -> Result<Claim, Failure> {
    let recognise = |text: &str| {
        let present = serde_json::from_str(text);
        Ok(present.map_or(Found::Foreign, |present| Found::result(manifest.is_same_fusion(&present))))
    };
    let paths = manifest.inputs.iter().map(|i| Path::new(&i.path));
    Ok(claim_directory(out, &FUSION_FILES, paths, session.existing(), recognise)?)
}

/// Writes all files, the manifest last.
pub(super) fn write(
    solution: &Solution,
    summary: &FusionSummary,
    manifest: &FusionManifest,
    out: &Path,
) -> Result<(), Failure> {
    let title = manifest.inputs.first().map_or("solution", |imu| imu.path.as_str());
    let mut directory = AtomicDir::create(out)?;
    let files = fusion_directory(solution, summary, manifest, title);
    let is_old = |name: &&str| files.iter().all(|file| file.name != *name);
    let old: Vec<&str> = FUSION_FILES.into_iter().filter(is_old).collect();
    for file in files {
        directory.write_parts(file.name, file.parts)?;
    }
    directory.commit()?;
    // what an earlier fusion smoothed is not of this one; where there is none, there is nothing to remove
    old.iter().for_each(|name| drop(std::fs::remove_file(out.join(name))));
    Ok(())
}
