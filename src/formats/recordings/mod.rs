//! Static recordings: text tables with a header (CSV, TSV, gzipped or not), `.npy` and `.npz` arrays and logs, one replicate
//! a file, a directory being all its recordings in name order.
//!
//! Columns are found by their names (`header`), their units by the names' endings; what was found, and
//! what was assumed, is told in the [`Report`]. What cannot be right is refused with file and line
//! ([`FileError`]).

pub(crate) mod header;

#[cfg(feature = "npz")]
mod archive;
mod array;
pub(in crate::formats) mod checks;
pub(in crate::formats) mod error;
mod files;
mod lines;
mod log;
mod manifest;
mod options;
mod oxts;
#[cfg(feature = "parquet")]
mod parquet;
mod prepared;
mod report;
mod table;
mod text;
pub(in crate::formats) mod time_unit;
pub(in crate::formats) mod timing;
mod write;

pub(crate) use files::{is_recording, listed};
pub use options::{Gaps, ReadOptions};
pub use report::{FileReport, Report};
pub use write::FileFormat;

pub(in crate::formats) use table::Raw;

#[cfg(not(feature = "parquet"))]
use super::Place;
use super::{FileError, Kind, logs};
use error::no_files;
use nav_sim_signal::imu::Recording;
use prepared::Prepared;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Reads recordings; those of a directory in name order (numbers in names by value). All are held.
///
/// # Errors
/// When a file cannot be read, or holds what no sound recording can: [`FileError`].
pub fn read(
    paths: &[PathBuf],
    options: &ReadOptions,
) -> Result<(Vec<Recording>, Report), FileError> {
    visit(paths, options, &|recording| recording, &|_, _| {})
}

/// Files that are read side by side.
const AT_ONCE: usize = 8;

/// Reads recordings and shows each to `look`, from any thread, then lets it go: no more than eight files are held at a
/// time. What `look` returned is in the order of the files. `tell` is told how many files are done, and of how many, from 0 on.
///
/// # Errors
/// When a file cannot be read, or holds what no sound recording can: [`FileError`].
pub(crate) fn visit<T: Send>(
    paths: &[PathBuf],
    options: &ReadOptions,
    look: &(dyn Fn(Recording) -> T + Sync),
    tell: &dyn Fn(usize, usize),
) -> Result<(Vec<T>, Report), FileError> {
    let files = files::expand(paths)?;
    let (mut looks, mut report) = (Vec::new(), Report::default());
    tell(0, files.len());
    let mut done = 0;
    for some in files.chunks(AT_ONCE) {
        let outcomes: Vec<_> = some
            .par_iter()
            .map(|file| held(&file.path, options, look))
            .collect();
        for (file, outcome) in some.iter().zip(outcomes) {
            match outcome {
                // The output of this very command, say, when it goes to a file in the directory.
                Err(FileError {
                    kind: Kind::Empty(_),
                    ..
                }) if file.from_directory => {
                    report
                        .warnings
                        .push(format!("{}: passed over, it is empty", file.path.display()));
                }
                Err(FileError {
                    kind: Kind::Columns(_),
                    ..
                }) if file.from_directory => {
                    let text = format!(
                        "{}: passed over, no column is a known one",
                        file.path.display()
                    );
                    report.warnings.push(text);
                }
                outcome => {
                    let (of_file, held) = outcome?;
                    looks.extend(held);
                    report.files.push(of_file);
                }
            }
            done += 1;
            tell(done, files.len());
        }
    }
    checks::same_rate(&report.files)?;
    if looks.is_empty() {
        let path = paths
            .first()
            .map(|p| p.display().to_string())
            .unwrap_or_default();
        return Err(no_files(path));
    }
    Ok((looks, report))
}

/// Results of `look` for the recordings of a file.
fn held<T>(
    path: &Path,
    options: &ReadOptions,
    look: &(dyn Fn(Recording) -> T + Sync),
) -> Result<(FileReport, Vec<T>), FileError> {
    let (prepared, mut report) = Prepared::new(load(path, options)?, options)?;
    path.clone_into(&mut report.path);
    Ok((
        report,
        prepared.recordings().into_iter().map(look).collect(),
    ))
}

/// Reads a file's columns.
pub(in crate::formats) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let ends_in = |ending: &str| {
        path.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(ending))
    };
    match logs::kind_of(path) {
        #[cfg(feature = "npz")]
        Some(nav_sim_logs::Kind::Npz) => archive::load(path, options),
        Some(_) => log::load(path, options),
        None if ends_in("npy") => array::load(path, options),
        #[cfg(feature = "parquet")]
        None if ends_in("parquet") => parquet::load(path, options),
        #[cfg(not(feature = "parquet"))]
        None if ends_in("parquet") => {
            let message = "is Apache Parquet, which this build does not read";
            Err(
                FileError::contents(path.display().to_string(), Place::Itself, message)
                    .advice("build with --features parquet, or write CSV"),
            )
        }
        None if oxts::is_oxts(path) => oxts::load(path, options),
        None => text::load(path, options),
    }
}

#[cfg(test)]
mod tests;
