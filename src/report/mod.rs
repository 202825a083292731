//! Results as files: tables, JSON, self-contained pages (`page`). The module computes no statistic and touches
//! no file: every function returns a text, and the command line writes it.

pub(crate) mod csv;
pub(crate) mod curves;
pub(crate) mod tables;
pub(crate) mod trajectory;
pub(crate) mod verdict;

pub(crate) use curves::{CurvesFile, FittedCurve, SignalsFile};
pub use nav_sim_document::readable;
pub(crate) use nav_sim_document::{seconds, six_digits};
pub(crate) use tables::{gnss_csv, imu_csv, initial_toml};

pub(crate) use verdict::{integration_line, reduction_doubt, reduction_line, tone};

#[cfg(test)]
#[path = "sample_tests.rs"]
pub(crate) mod sample;

/// Characters of a line in a terminal.
pub(crate) const WIDTH: usize = 120;

/// Indented JSON with a final newline; NaN is null.
pub(crate) fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).expect("serialises") + "\n"
}

/// The first of these names, and how many more there are.
pub(crate) fn first_names(names: &[String]) -> String {
    const NAMED: usize = 3;
    let shown = names[..names.len().min(NAMED)].join(", ");
    match names.len().saturating_sub(NAMED) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// Each name once, where it stood first.
pub(crate) fn in_order<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut unique = Vec::new();
    for name in names {
        if !unique.contains(&name) {
            unique.push(name);
        }
    }
    unique
}
