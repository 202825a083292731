//! Whether the files that a study names are there.

use super::file::{self, StudyFile, beside};
use crate::formats::toml_file::{Section, Source};
use crate::formats::{FileError, contamination_file};
use std::path::Path;

/// Reads a study as [`file::read`] does, and refuses one that names a file which does not exist, by line and key.
///
/// # Errors
/// Those of reading, or the first key that names such a file.
pub(crate) fn read(study: &Path) -> Result<StudyFile, FileError> {
    match file::read(study) {
        Err(e) if !e.is_system() => Err(e),
        read => exist(study).and(read), // a scenario that is not there is told by its key, too
    }
}

fn exist(study: &Path) -> Result<(), FileError> {
    let source = Source::read(study)?;
    let table = source.parse()?;
    let root = source.root(&table);
    for axis in ["trajectory", "truth", "candidate", "scenario", "gnss"] {
        for entry in root.sections(axis).unwrap_or_default() {
            of_entry(study, &entry)?;
        }
    }
    Ok(())
}

/// The files of an entry, and of the steps within it.
fn of_entry(study: &Path, entry: &Section<'_>) -> Result<(), FileError> {
    for key in ["file", "model"] {
        let named = entry.str(key).ok().flatten();
        named.map_or(Ok(()), |named| exists(study, entry, key, named))?;
    }
    for named in entry.texts("recordings") {
        exists(study, entry, "recordings", named)?;
    }
    let contamination = entry.str("contaminate").ok().flatten();
    if let Some(named) = contamination.filter(|named| !contamination_file::names().contains(named)) {
        exists(study, entry, "contaminate", named)?;
    }
    for step in ["calibrate", "synthesize"] {
        let step = entry.section(step).ok().flatten();
        step.map_or(Ok(()), |step| of_entry(study, &step))?;
    }
    Ok(())
}

fn exists(study: &Path, entry: &Section<'_>, key: &str, named: &str) -> Result<(), FileError> {
    let path = beside(study, Path::new(named));
    if path.exists() {
        return Ok(());
    }
    let reason = format!("names {}, which does not exist", path.display());
    let meant = contamination_file::meant(named).filter(|_| key == "contaminate");
    let hint = meant.map_or_else(
        || "paths are relative to the study file".to_owned(),
        |meant| format!("did you mean \"{meant}\"?"),
    );
    Err(entry.refuse(key, reason, Some(hint)))
}
