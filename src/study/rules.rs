//! Rules that every axis of a study keeps.

use super::error::DescriptionError;

/// Most cells of a study: each is planned, named and checked before the first runs.
pub(super) const MAX_CELLS: usize = 1_000_000;

/// Every entry of an axis has a name, and a name of its own.
pub(super) fn unique(axis: &str, names: &[&str]) -> Result<(), DescriptionError> {
    if let Some(i) = names.iter().position(|n| n.trim().is_empty()) {
        return Err(DescriptionError::Unnamed { axis: axis.to_owned(), entry: i + 1 });
    }
    let mut seen = std::collections::HashSet::new();
    match names.iter().find(|name| !seen.insert(**name)) {
        Some(name) => Err(DescriptionError::Duplicate { axis: axis.to_owned(), name: (*name).to_owned() }),
        None => Ok(()),
    }
}

/// An entry says one of several things.
pub(super) fn exactly_one(
    axis: &str,
    entry: usize,
    said: &[bool],
    keys: &'static str,
) -> Result<(), DescriptionError> {
    if said.iter().filter(|s| **s).count() == 1 {
        return Ok(());
    }
    Err(DescriptionError::NotOne { axis: axis.to_owned(), entry: entry + 1, keys })
}
