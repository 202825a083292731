//! Outputs that appear whole or not at all: written under a temporary name in the same directory, flushed
//! to the disk, then renamed.

mod directory;
mod file;
mod temporary;

pub use directory::{AtomicDir, recover};
pub use file::AtomicFile;
pub use temporary::remove_unfinished;

use std::io::{self, Write};
use std::path::Path;

/// An output that could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The system refused: no space, no permission, no such directory, …
    #[error("{path}: {source}")]
    Io {
        /// The output.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// The output is one of the inputs.
    #[error("{path} is an input of this command and would be overwritten")]
    OverInput {
        /// The output.
        path: String,
    },
    /// The output's directory holds files that would be taken for outputs of this command.
    #[error("{path} already holds {stale}, which this command would leave beside its own outputs")]
    Stale {
        /// The directory.
        path: String,
        /// A file in it.
        stale: String,
    },
}

impl WriteError {
    /// With the path it happened to.
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.display().to_string(), source }
    }

    /// Whether the user's request is at fault (rather than the machine).
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        !matches!(self, Self::Io { .. })
    }

    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::OverInput { .. } => Some("choose another output with --out".into()),
            Self::Stale { .. } => Some("remove it, or choose another directory with --out".into()),
            Self::Io { .. } => None,
        }
    }
}

/// Refuses an output that is one of the inputs, under whatever name.
///
/// # Errors
/// [`WriteError::OverInput`].
pub fn guard_inputs<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), WriteError> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    let hit = inputs.into_iter().any(|i| i.canonicalize().is_ok_and(|i| i == target));
    if hit { Err(WriteError::OverInput { path: output.display().to_string() }) } else { Ok(()) }
}

/// Writes a whole file.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub fn write(destination: &Path, contents: impl AsRef<[u8]>) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(destination)?;
    file.write_all(contents.as_ref()).map_err(|e| WriteError::io(destination, e))?;
    file.commit()
}

/// Makes the directory that `path` is to stand in.
fn make_parent(path: &Path) -> io::Result<()> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => std::fs::create_dir_all(parent),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
