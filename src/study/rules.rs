//! Rules that every axis of a study keeps.

use super::error::DescriptionError;
use nav_sim_document::turns;

/// Most cells of a study: each is planned, named and checked before the first runs.
pub(super) const MAX_CELLS: usize = 1_000_000;

/// Most units of a study: each is a file, named and looked for by every worker.
pub(super) const MAX_UNITS: usize = 1_000_000;

/// Every entry of an axis has a name, and a name of its own.
///
/// `names`: with the positions of their entries.
pub(super) fn unique(axis: &str, names: &[(usize, &str)]) -> Result<(), DescriptionError> {
    let axis = || axis.to_owned();
    if let Some((i, _)) = names.iter().find(|(_, name)| name.trim().is_empty()) {
        return Err(DescriptionError::Unnamed {
            axis: axis(),
            entry: i + 1,
        });
    }
    if let Some((i, name)) = names.iter().find(|(_, name)| is_no_name(name)) {
        let reason = "names begin with no = + - @ and have no control characters: tables are opened in spreadsheets";
        return Err(DescriptionError::refused(
            &format!("{}[{}].name", axis(), i + 1),
            name.escape_debug(),
            reason,
        ));
    }
    let mut seen = std::collections::HashSet::new();
    match names.iter().find(|(_, name)| !seen.insert(*name)) {
        Some((i, name)) => Err(DescriptionError::Duplicate {
            axis: axis(),
            entry: i + 1,
            name: (*name).to_owned(),
        }),
        None => Ok(()),
    }
}

/// Whether a spreadsheet would compute a name, or a terminal obey it.
fn is_no_name(name: &str) -> bool {
    name.starts_with(['=', '+', '-', '@'])
        || name.contains(char::is_control)
        || name.contains(turns)
}

/// An entry says one of several things.
pub(super) fn exactly_one(
    key: String,
    given: &[bool],
    keys: &'static str,
) -> Result<(), DescriptionError> {
    match given.iter().filter(|s| **s).count() {
        1 => Ok(()),
        _ => Err(DescriptionError::NotOne { key, keys }),
    }
}
