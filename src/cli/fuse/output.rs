//! The directory of a fusion.

use crate::cli::{Failure, Session};
use crate::formats::atomic::{AtomicDir, Claim, Found, claim_directory};
use crate::fusion::Solution;
use crate::report::{FUSION_FILES, FusionKind, FusionManifest, FusionSummary, Input, fusion_directory};
use std::path::Path;

/// Whether the directory can be made, found out before the work.
pub(super) fn claim(out: &Path, inputs: &[Input], session: &Session) -> Result<Claim, Failure> {
    // Options are kept in the command alone.
    let is_same = |there: FusionManifest| {
        (deciding(&there.command), there.version) == (deciding(&command()), version())
            && there.inputs == inputs
    };
    let recognise = |text: &str| {
        let there = serde_json::from_str(text);
        Ok(there.map_or(Found::Foreign, |there| Found::result(is_same(there))))
    };
    let paths = inputs.iter().map(|i| Path::new(&i.path));
    Ok(claim_directory(out, &FUSION_FILES, paths, session.existing(), recognise)?)
}

fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

fn command() -> Vec<String> {
    std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect()
}

/// The words of a command that decide its results: neither the program nor where and how they are told.
fn deciding(command: &[String]) -> Vec<&str> {
    const ALONE: [&str; 6] = ["-q", "--quiet", "-v", "--verbose", "--no-progress", "--force"];
    const WITH_VALUE: [&str; 7] = ["-j", "--threads", "--format", "--seed", "-o", "--out", "--plot"];
    let mut words = command.iter().skip(1).map(String::as_str);
    let mut kept = Vec::new();
    while let Some(word) = words.next() {
        let name = word.split_once('=').map_or(word, |(name, _)| name);
        if WITH_VALUE.contains(&word) {
            words.next();
        } else if !ALONE.contains(&word) && !WITH_VALUE.contains(&name) {
            kept.push(word);
        }
    }
    kept
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
        version: version(),
        command: command(),
        inputs,
        wall_s,
    };
    let mut directory = AtomicDir::create(out)?;
    let files = fusion_directory(solution, summary, &manifest, &title);
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
