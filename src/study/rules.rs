//! Rules that every axis of a study keeps.

use super::error::DescriptionError;

/// Most cells of a study: each is planned, named and checked before the first runs.
pub(super) const MAX_CELLS: usize = 1_000_000;

/// Every entry of an axis has a name, and a name of its own.
///
/// `names`: with the positions of their entries.
pub(super) fn unique(axis: &str, names: &[(usize, &str)]) -> Result<(), DescriptionError> {
    let axis = || axis.to_owned();
    if let Some((i, _)) = names.iter().find(|(_, name)| name.trim().is_empty()) {
        return Err(DescriptionError::Unnamed { axis: axis(), entry: i + 1 });
    }
    let mut seen = std::collections::HashSet::new();
    match names.iter().find(|(_, name)| !seen.insert(*name)) {
        Some((i, name)) => {
            Err(DescriptionError::Duplicate { axis: axis(), entry: i + 1, name: (*name).to_owned() })
        }
        None => Ok(()),
    }
}

/// An entry says one of several things.
pub(super) fn exactly_one(key: String, given: &[bool], keys: &'static str) -> Result<(), DescriptionError> {
    match given.iter().filter(|s| **s).count() {
        1 => Ok(()),
        _ => Err(DescriptionError::NotOne { key, keys }),
    }
}
