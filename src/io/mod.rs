//! Files: recordings, models, trajectories. The only library module that reads files.

pub(crate) mod atomic;
pub mod contamination_file;
pub(crate) mod curve_file;
pub mod datasheet;
pub mod draws_file;
pub(crate) mod file_kind;
pub(crate) mod fusion_files;
pub(crate) mod input;
pub mod logs;
pub mod model_file;
pub mod recordings;
pub(crate) mod run_tables;
pub(crate) mod scenario_file;
pub(crate) mod source;
pub(crate) mod suggest;
pub(crate) mod table;
pub(crate) mod toml_file;
pub mod trajectory_file;

use std::path::{Path, PathBuf};

/// Endings of outputs that are no part of a name, as the number of m.1 is.
const ENDINGS: [&str; 4] = ["toml", "json", "html", "svg"];

/// The file beside another that has its name, less one of these endings, and this one; with none itself.
pub(crate) fn beside(path: &Path, ending: &str) -> PathBuf {
    if ending.is_empty() {
        return path.to_owned();
    }
    let has_ending = path
        .extension()
        .is_some_and(|own| ENDINGS.iter().any(|ending| own == *ending));
    let name = match has_ending {
        true => path.file_stem(),
        false => path.file_name(),
    };
    let mut name = name.unwrap_or_default().to_owned();
    name.push(ending);
    path.with_file_name(name)
}

pub(crate) use crate::failure::{Failure, Place, help};

#[cfg(test)]
mod property_tests;
#[cfg(test)]
mod tests;
