//! Outputs that appear whole or not at all: written under a temporary name in the same directory, flushed
//! to the disk, then renamed.

mod claim;
mod directory;
mod file;
mod temporary;

pub(crate) use claim::{Claim, Found, claim_directory, claim_file};
pub(crate) use directory::{AtomicDir, recover};
pub(crate) use file::AtomicFile;
pub(crate) use temporary::remove_unfinished;

use super::{FileError, Place, Setting};
use std::io::{self, Write};
use std::path::Path;

/// Refuses an output that is one of the inputs, under whatever name.
///
/// # Errors
/// When it is one.
pub(crate) fn guard_inputs<'a>(
    output: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), FileError> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    let hit = inputs.into_iter().any(|i| i.canonicalize().is_ok_and(|i| i == target));
    if !hit {
        return Ok(());
    }
    let message = "is an input of this command and would be overwritten";
    Err(FileError::contents(output.display().to_string(), Place::Itself, message).setting(Setting::Output))
}

/// What may become of a result that is there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// It stays, unless what would take its place is the same.
    Keep,
    /// Another takes its place.
    Replace,
}

/// Refuses to put something else in the place of a regular file.
///
/// # Errors
/// When the file holds something else and is to stay.
pub(crate) fn guard_contents(path: &Path, contents: &[u8], existing: Existing) -> Result<(), FileError> {
    let regular = std::fs::metadata(path).is_ok_and(|m| m.is_file());
    let same = || std::fs::read(path).is_ok_and(|there| there == contents);
    if existing == Existing::Replace || !regular || same() {
        return Ok(());
    }
    Err(kept(path, "holds another result"))
}

fn kept(path: &Path, why: &str) -> FileError {
    FileError::contents(path.display().to_string(), Place::Itself, why).setting(Setting::Force)
}

/// Writes a result as a file, but not in the place of another one.
///
/// # Errors
/// As [`guard_contents`] and [`write()`].
pub(crate) fn write_result(
    destination: &Path,
    contents: impl AsRef<[u8]>,
    existing: Existing,
) -> Result<(), FileError> {
    guard_contents(destination, contents.as_ref(), existing)?;
    write(destination, contents)
}

/// Writes a whole file.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub(crate) fn write(destination: &Path, contents: impl AsRef<[u8]>) -> Result<(), FileError> {
    let mut file = AtomicFile::create(destination)?;
    file.write_all(contents.as_ref()).map_err(|e| FileError::io(destination, e))?;
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
