//! Run directories read back, as far as comparisons need them.

use super::{atomic, source};
use crate::metrics::Measured;
use crate::report::{Manifest, TableError, parse_epochs, parse_runs};
use std::path::Path;

/// A run directory that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RunDirectoryError {
    /// A file cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// File.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The manifest is not one.
    #[error("{path}, line {line}: {message}")]
    Manifest {
        /// File.
        path: String,
        /// Line, from 1.
        line: usize,
        /// What the parser said.
        message: String,
    },
    /// A table is not one.
    #[error("{path}, {source}")]
    Table {
        /// File.
        path: String,
        /// What is wrong with it.
        source: TableError,
    },
    /// It comes from another layout.
    #[error("{path}: \"schema_version\" is {found}; this nav-sim reads {expected}")]
    Version {
        /// File.
        path: String,
        /// Version found.
        found: u32,
        /// Version read.
        expected: u32,
    },
}

impl RunDirectoryError {
    /// Whether the contents are at fault (rather than the machine, or a missing file).
    #[must_use]
    pub fn is_content(&self) -> bool {
        match self {
            Self::Io { source, .. } => source::is_damage(source.kind()),
            _ => true,
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        let unfinished = "not a finished run directory: make one with `nav-sim run … -o DIR`";
        match self {
            Self::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Some(unfinished.into())
            }
            Self::Version { .. } => Some("repeat the run with this version".into()),
            _ => None,
        }
    }
}

/// A run directory.
#[derive(Debug, Clone, PartialEq)]
pub struct RunDirectory {
    /// Where it came from.
    pub manifest: Manifest,
    /// What was found.
    pub experiment: Measured,
}

/// Reads a run directory; what a killed command had begun to replace in it is finished first.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn read(directory: &Path) -> Result<RunDirectory, RunDirectoryError> {
    atomic::recover(directory);
    let manifest = manifest(directory)?;
    let (epochs_path, epochs) = text(directory, "epochs.csv")?;
    let (runs_path, runs) = text(directory, "runs.csv")?;
    let table = |path: String| move |source| RunDirectoryError::Table { path, source };
    let outages = manifest.configuration.outage.iter().flatten().map(|o| (o.start_s, o.end_s)).collect();
    let experiment = Measured {
        epochs: parse_epochs(&epochs).map_err(table(epochs_path))?,
        runs: parse_runs(&runs).map_err(table(runs_path))?,
        outages,
        independent_windows: manifest.independent_windows,
    };
    Ok(RunDirectory { manifest, experiment })
}

fn manifest(directory: &Path) -> Result<Manifest, RunDirectoryError> {
    let (path, json) = text(directory, "manifest.json")?;
    let manifest: Manifest = serde_json::from_str(&json).map_err(|e| RunDirectoryError::Manifest {
        path: path.clone(),
        line: e.line(),
        message: e.to_string().split(" at line ").next().unwrap_or_default().to_owned(),
    })?;
    let (found, expected) = (manifest.schema_version, Manifest::SCHEMA_VERSION);
    if found == expected { Ok(manifest) } else { Err(RunDirectoryError::Version { path, found, expected }) }
}

fn text(directory: &Path, name: &str) -> Result<(String, String), RunDirectoryError> {
    let path = directory.join(name);
    let shown = path.display().to_string();
    match source::text(&path) {
        Ok(text) => Ok((shown, text)),
        Err(source) => Err(RunDirectoryError::Io { path: shown, source }),
    }
}
