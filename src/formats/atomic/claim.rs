//! Outputs that a command may write, found out before its work, and that no other writes meanwhile.
//!
//! Refused, with `--force` too: an input, what another command writes, what nav-sim did not write.
//! A file takes the place of an earlier result of its own kind; `--force` is for one of another kind.
//! A directory takes the place of the same run; `--force` is for one of another configuration, inputs or seed.

use super::directory::{AtomicDir, recover};
use super::file::{AtomicFile, make_parent};
use super::temporary::Temporary;
use super::written::{Found, Written};
use crate::formats::{FileError, Place, Setting};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Outputs that are this command's own until this is dropped: the marker of their place is locked by the operating
/// system, and a process that is killed holds none.
#[derive(Debug)]
#[must_use = "another command may write there as soon as this is dropped"]
pub(crate) struct Claim {
    outputs: Vec<PathBuf>,
    _marker: Option<Temporary>,
}

/// What this process has claimed.
static CLAIMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

impl Claim {
    /// Claims outputs in the place that `shown` names.
    fn new(shown: &Path, marker: &Path, outputs: Vec<PathBuf>) -> Result<Self, FileError> {
        let refused = |path: &Path, why: &str| {
            FileError::contents(path.display().to_string(), Place::Itself, why)
        };
        let mut claimed = CLAIMED.lock().unwrap_or_else(PoisonError::into_inner);
        if outputs.iter().any(|output| claimed.contains(output)) {
            return Err(
                refused(shown, "is another output of the same command").setting(Setting::Output)
            );
        }
        let marked = make_parent(marker).and_then(|()| Temporary::marker(marker));
        let Some(marked) = marked.map_err(|e| FileError::unwritable(shown, e))? else {
            let busy = refused(shown, "is being written by another nav-sim");
            return Err(busy
                .setting(Setting::Output)
                .advice("wait until that is done"));
        };
        claimed.extend(outputs.iter().cloned());
        Ok(Self {
            outputs,
            _marker: Some(marked),
        })
    }

    fn of_directory(directory: &Path, files: &[impl AsRef<str>]) -> Result<Self, FileError> {
        loop {
            let marker = if directory.is_dir() {
                directory.join(MARKER)
            } else {
                marker_beside(directory)
            };
            let inside = |name: &str| resolved(directory).join(name);
            let outputs = files
                .iter()
                .map(|name| inside(name.as_ref()))
                .chain([inside("")])
                .collect();
            let claim = Self::new(directory, &marker, outputs)?;
            // where the directory was made meanwhile, its writers hold the marker in it
            if directory.is_dir() == (marker.file_name() == Some(MARKER.as_ref())) {
                return Ok(claim);
            }
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let mut claimed = CLAIMED.lock().unwrap_or_else(PoisonError::into_inner);
        self.outputs
            .iter()
            .for_each(|output| _ = claimed.remove(output));
    }
}

/// Name of the marker in a directory of outputs; ending of the one beside an output.
const MARKER: &str = ".claim";

fn marker_beside(path: &Path) -> PathBuf {
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    path.with_file_name(format!(".{name}{MARKER}"))
}

/// A path by one name, whether anything is there or not.
fn resolved(path: &Path) -> PathBuf {
    let parent = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or_else(|| Path::new("."));
    let by_parent = || Some(parent.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize()
        .ok()
        .or_else(by_parent)
        .unwrap_or_else(|| path.to_owned())
}

/// Claims a file that can be made and is none of the inputs. A device is everybody's.
///
/// # Errors
/// When it is an input, cannot be made, or another command writes it.
pub(crate) fn claim_file<'a>(
    output: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<Claim, FileError> {
    guard_inputs(output, inputs)?;
    AtomicFile::create(output)?; // dropped at once
    if fs::metadata(output).is_ok_and(|m| !m.is_file()) {
        return Ok(Claim {
            outputs: Vec::new(),
            _marker: None,
        });
    }
    let output_at = resolved(output);
    Claim::new(output, &marker_beside(&output_at), vec![output_at])
}

/// Claims a file for a result: what stands there may be replaced.
///
/// # Errors
/// As [`claim_file`]; when nav-sim did not write what stands there, or it is a result of another kind and to stay.
pub(crate) fn claim_result<'a>(
    output: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
    kind: Written,
    existing: Existing,
) -> Result<Claim, FileError> {
    let claim = claim_file(output, inputs)?;
    replaceable(output, kind.found(output), existing)?;
    Ok(claim)
}

fn replaceable(path: &Path, found: Found, existing: Existing) -> Result<(), FileError> {
    let refused = |why: &str| FileError::contents(path.display().to_string(), Place::Itself, why);
    match found {
        Found::Foreign => {
            let error =
                refused("is not of this command: it is not replaced").setting(Setting::Output);
            Err(error.advice("move it away"))
        }
        Found::Other(why) if existing == Existing::Keep => {
            Err(refused(why).setting(Setting::Force))
        }
        Found::Other(_) | Found::Same => Ok(()),
    }
}

/// Refuses an output that is one of the inputs, under whatever name.
///
/// # Errors
/// When it is one.
pub(super) fn guard_inputs<'a>(
    output: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), FileError> {
    let Ok(target) = output.canonicalize() else {
        return Ok(());
    };
    if !inputs
        .into_iter()
        .any(|i| i.canonicalize().is_ok_and(|i| i == target))
    {
        return Ok(());
    }
    let message = "is an input of this command and would be overwritten";
    Err(
        FileError::contents(output.display().to_string(), Place::Itself, message)
            .setting(Setting::Output),
    )
}

/// What may become of a result that is there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Existing {
    /// It stays, unless what takes its place is of the same kind or run.
    Keep,
    /// Another takes its place.
    Replace,
}

/// Claims a directory before the work whose results are to be written there: none of `files` is an input, the
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
) -> Result<Claim, FileError> {
    for name in files {
        guard_inputs(&directory.join(name.as_ref()), inputs.clone())?;
    }
    AtomicDir::create(directory)?; // dropped at once
    let claim = Claim::of_directory(directory, files)?;
    recover(directory);
    let last = directory.join(files.last().map_or("", AsRef::as_ref));
    match fs::read_to_string(&last) {
        Err(_) => replaceable(directory, empty_or_new(directory), existing)?,
        Ok(text) => replaceable(directory, recognise(&text)?, existing)?,
    }
    Ok(claim)
}

/// Files of the same names would be lost in a directory that holds anything.
fn empty_or_new(directory: &Path) -> Found {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let is_visible = |name: OsString| !name.to_string_lossy().starts_with('.');
    if entries.map(|entry| entry.file_name()).any(is_visible) {
        Found::Foreign
    } else {
        Found::Same
    }
}
