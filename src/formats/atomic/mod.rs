//! Outputs that appear whole or not at all: written under a temporary name in the same directory, flushed
//! to the disk, then renamed.

mod directory;
mod file;
mod temporary;

pub use directory::{AtomicDir, recover};
pub use file::AtomicFile;
pub use temporary::remove_unfinished;

use super::{FileError, Place, Setting};
use std::io::{self, Write};
use std::path::Path;

/// Refuses an output that is one of the inputs, under whatever name.
///
/// # Errors
/// When it is one.
pub fn guard_inputs<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), FileError> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    let hit = inputs.into_iter().any(|i| i.canonicalize().is_ok_and(|i| i == target));
    if !hit {
        return Ok(());
    }
    let message = "is an input of this command and would be overwritten";
    Err(FileError::contents(output.display().to_string(), Place::Itself, message).setting(Setting::Output))
}

/// Writes a whole file.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub fn write(destination: &Path, contents: impl AsRef<[u8]>) -> Result<(), FileError> {
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
