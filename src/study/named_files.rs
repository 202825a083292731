//! Whether the files that a study names are there.

use super::file::{self, StudyFile, beside};
use crate::formats::toml_file::Source;
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
    let table: toml::Table = source.get()?;
    for axis in ["trajectory", "truth", "candidate", "scenario", "gnss"] {
        let entries = table
            .get(axis)
            .and_then(toml::Value::as_array)
            .into_iter()
            .flatten();
        for (i, entry) in (1..).zip(entries) {
            of_entry(study, &source, &format!("{axis}[{i}]"), entry)?;
        }
    }
    Ok(())
}

/// The files of an entry, and of the steps within it.
fn of_entry(
    study: &Path,
    source: &Source,
    path: &str,
    entry: &toml::Value,
) -> Result<(), FileError> {
    let named = |key: &str| entry.get(key).and_then(toml::Value::as_str);
    let recordings = entry
        .get("recordings")
        .and_then(toml::Value::as_array)
        .into_iter()
        .flatten();
    let recordings = recordings.filter_map(|named| Some(("recordings", named.as_str()?)));
    let is_file = |named: &&str| !contamination_file::names().contains(named);
    let contamination = named("contaminate")
        .filter(is_file)
        .map(|named| ("contaminate", named));
    let single = ["file", "model"]
        .into_iter()
        .filter_map(|key| Some((key, named(key)?)));
    for (key, named) in single.chain(recordings).chain(contamination) {
        exists(study, source, &format!("{path}.{key}"), named)?;
    }
    for step in ["calibrate", "synthesize"] {
        let inner = |inner: &toml::Value| of_entry(study, source, &format!("{path}.{step}"), inner);
        entry.get(step).map_or(Ok(()), inner)?;
    }
    Ok(())
}

fn exists(study: &Path, source: &Source, key: &str, named: &str) -> Result<(), FileError> {
    let path = beside(study, Path::new(named));
    if path.exists() {
        return Ok(());
    }
    let meant = contamination_file::meant(named).filter(|_| key.ends_with("contaminate"));
    let hint = meant.map_or_else(
        || "paths are relative to the study file".to_owned(),
        |meant| format!("did you mean \"{meant}\"?"),
    );
    Err(source
        .refused(
            key,
            format!("names {}, which does not exist", path.display()),
        )
        .advice(hint))
}
