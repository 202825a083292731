//! What the manifest of a synthesis beside an array says of it: its columns and its rate.

use super::header::column_name;
use nav_sim_signal::imu::Channel;
use serde::Deserialize;
use std::fs;
use std::path::Path;

/// The name of a manifest.
pub(super) const MANIFEST: &str = "manifest.json";

/// The parts of a manifest that tell how to read its recordings.
#[derive(Deserialize)]
pub(super) struct Manifest {
    command: String,
    axes: Vec<String>,
    /// Sample rate (Hz).
    pub(super) rate_hz: f64,
    replicates: Vec<Replicate>,
}

#[derive(Deserialize)]
struct Replicate {
    file: String,
}

impl Manifest {
    /// That of the synthesis which made a file, if its manifest is beside it.
    pub(super) fn beside(path: &Path) -> Option<Self> {
        let text = fs::read_to_string(path.with_file_name(MANIFEST)).ok()?;
        let manifest: Self = serde_json::from_str(&text).ok()?;
        let name = path.file_name()?.to_str()?;
        let is_of_it = manifest.command == "synthesize"
            && manifest.replicates.iter().any(|own| own.file == name);
        (is_of_it && manifest.rate_hz > 0.0).then_some(manifest)
    }

    /// The names of so many columns, if it has as many signals.
    pub(super) fn columns(&self, count: usize) -> Option<Vec<String>> {
        let named = |name: &String| Channel::ALL.into_iter().find(|c| c.to_string() == *name);
        let names: Option<Vec<String>> = self
            .axes
            .iter()
            .map(|name| named(name).map(column_name))
            .collect();
        names.filter(|names| names.len() == count)
    }
}
