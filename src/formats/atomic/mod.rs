//! Outputs that appear whole or not at all: written under a temporary name in the same directory, flushed
//! to the disk, then renamed.

mod claim;
mod directory;
mod file;
mod temporary;
mod written;

pub(crate) use claim::{Claim, Existing, claim_directory, claim_file, claim_result};
pub(crate) use directory::{AtomicDir, recover};
pub(crate) use file::AtomicFile;
pub(crate) use temporary::remove_unfinished;
pub(crate) use written::Found;
#[allow(unreachable_pub, reason = "named by a public trait")]
pub use written::Written;

use super::FileError;
use std::io::Write;
use std::path::Path;

/// Writes a whole file.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub(crate) fn write(destination: &Path, contents: impl AsRef<[u8]>) -> Result<(), FileError> {
    filled(destination, contents.as_ref())?.commit()
}

/// A file that is written but does not have its name yet.
pub(crate) fn filled(destination: &Path, contents: &[u8]) -> Result<AtomicFile, FileError> {
    let mut file = AtomicFile::create(destination)?;
    file.write_all(contents)
        .and_then(|()| file.flush())
        .map_err(|e| FileError::io(destination, e))?;
    Ok(file)
}

#[cfg(test)]
mod tests;
