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
use std::path::{Path, PathBuf};

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
    let same = || std::fs::read(path).is_ok_and(|present| present == contents);
    if existing == Existing::Replace || !regular || same() {
        return Ok(());
    }
    Err(kept(path, "holds another result"))
}

fn kept(path: &Path, why: &str) -> FileError {
    FileError::contents(path.display().to_string(), Place::Itself, why).setting(Setting::Force)
}

/// Refuses to put a result in the place of another, where it was written beside that.
pub(crate) fn kept_beside(path: &Path, beside: &Path) -> FileError {
    let name = beside.file_name().unwrap_or_default();
    let beside = if path.is_symlink() { beside.to_owned() } else { path.with_file_name(name) };
    kept(path, &format!("holds another result, this one is in {}", beside.display()))
}

/// The first of `model-2.toml`, `model-3.toml` … beside `model.toml` that is usable.
pub(crate) fn name_beside(path: &Path, is_usable: impl Fn(&Path) -> bool) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let dot = name.get(1..).and_then(|rest| rest.find('.')).map_or(name.len(), |at| at + 1);
    let (stem, ending) = name.split_at(dot);
    let mut names = (2_u64..).map(|n| path.with_file_name(format!("{stem}-{n}{ending}")));
    names.find(|path| is_usable(path)).expect("no directory holds so many files")
}

/// Writes a result as a file, but not in the place of another one.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit_result`].
pub(crate) fn write_result(
    destination: &Path,
    contents: impl AsRef<[u8]>,
    existing: Existing,
) -> Result<(), FileError> {
    filled(destination, contents.as_ref())?.commit_result(destination, existing)
}

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
    file.write_all(contents).and_then(|()| file.flush()).map_err(|e| FileError::io(destination, e))?;
    Ok(file)
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
