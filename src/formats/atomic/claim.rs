//! Whether a command may write its results into a directory.

use super::{AtomicDir, Existing, guard_inputs, kept, recover};
use crate::formats::{FileError, Place, Setting};
use std::ffi::OsString;
use std::fs;
use std::path::Path;

/// What a directory holds, told by its last file, which appears when the others are whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Found {
    /// The result of another command.
    Foreign,
    /// Another result of this command, or one that may be: how so.
    Other(&'static str),
    /// What is to be written.
    Same,
}

impl Found {
    /// A result of this command, by whether all that decides it is the same.
    #[must_use]
    pub(crate) const fn result(is_same: bool) -> Self {
        match is_same {
            true => Self::Same,
            false => Self::Other("holds the result of another configuration, other inputs or another seed"),
        }
    }
}

/// Finds out before the work whether its results can be written to a directory: none of `files` is an input, the
/// directory is new, empty, or of this command, and what it holds is the same or to be replaced. Finishes what a
/// killed command had begun to put in place. Nothing is left: a command that is interrupted leaves no trace.
///
/// `recognise` is given the text of the last of `files`, if it is there.
///
/// # Errors
/// Why not.
pub(crate) fn claim_directory<'a>(
    directory: &Path,
    files: &[impl AsRef<str>],
    inputs: impl Iterator<Item = &'a Path> + Clone,
    existing: Existing,
    recognise: impl FnOnce(&str) -> Result<Found, FileError>,
) -> Result<(), FileError> {
    for name in files {
        guard_inputs(&directory.join(name.as_ref()), inputs.clone())?;
    }
    recover(directory);
    let last = directory.join(files.last().map_or("", AsRef::as_ref));
    match fs::read_to_string(&last) {
        Err(_) => empty_or_new(directory)?,
        Ok(text) => match recognise(&text)? {
            Found::Foreign => return Err(unusable(&last, "is of another command, or of another version")),
            Found::Other(why) if existing == Existing::Keep => return Err(kept(directory, why)),
            Found::Other(_) | Found::Same => {}
        },
    }
    AtomicDir::create(directory).map(drop)
}

/// Refuses a directory that holds anything: files of the same names would be lost.
fn empty_or_new(directory: &Path) -> Result<(), FileError> {
    let Ok(entries) = fs::read_dir(directory) else { return Ok(()) };
    let is_visible = |name: &OsString| !name.to_string_lossy().starts_with('.');
    let first = entries.flatten().map(|entry| entry.file_name()).filter(is_visible).min();
    match first {
        None => Ok(()),
        Some(first) => {
            let first = first.to_string_lossy();
            Err(unusable(directory, format!("is not empty, and not of this command: it holds {first}")))
        }
    }
}

fn unusable(path: &Path, why: impl Into<Box<str>>) -> FileError {
    FileError::contents(path.display().to_string(), Place::Itself, why)
        .setting(Setting::OutputDirectory)
        .advice("remove it")
}
