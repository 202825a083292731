//! Files as inputs: which ones are meant, and their fingerprints.

use super::{Failure, source};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Role: "trajectory", "model", "truth", "static", "scenario".
    pub role: String,
    /// Path as given.
    pub path: String,
    /// BLAKE3 of its bytes, in hexadecimal.
    pub blake3: String,
}

/// An input with its fingerprint.
///
/// # Errors
/// When the system refuses.
pub(crate) fn input(role: &str, path: &Path) -> Result<Input, Failure> {
    let blake3 = hash_of_file(path).map_err(|e| Failure::io(path, e))?;
    Ok(Input {
        role: role.to_owned(),
        path: path.display().to_string(),
        blake3,
    })
}

/// The files themselves and those of directories, in name order.
///
/// # Errors
/// When a directory cannot be read.
pub(crate) fn listed(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let refused = |e| Failure::io(path, e);
        let entries = std::fs::read_dir(path).map_err(refused)?;
        let entries = entries.collect::<Result<Vec<_>, _>>().map_err(refused)?;
        let mut within: Vec<PathBuf> = entries
            .iter()
            .map(|e| e.path())
            .filter(|p| p.is_file())
            .collect();
        within.sort();
        files.extend(within);
    }
    Ok(files)
}

/// BLAKE3 of a file's bytes, in hexadecimal, whatever its size.
///
/// # Errors
/// When the system refuses.
fn hash_of_file(path: &Path) -> std::io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(source::open(path)?)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// BLAKE3 of bytes, in hexadecimal.
pub(crate) fn hash_of(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}
