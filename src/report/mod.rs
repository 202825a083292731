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

use nav_sim_document::{Chart, ChartAxis, Colour, Mark, Panel, Series};
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};

#[cfg(test)]
#[path = "sample_tests.rs"]
pub(crate) mod sample;

/// Characters of a line in a terminal.
pub(crate) const WIDTH: usize = 120;

/// Indented JSON with a final newline; NaN is null.
pub(crate) fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).expect("serialises") + "\n"
}

/// A small chart of each reported state: lines of errors, and bands of ± 3 σ that a filter states. Each set of rows has names
/// and colours of band and line. A state that no row has is left out.
pub(crate) fn error_charts(sets: &[ErrorSet<'_>], outages: &[(f64, f64)]) -> Vec<Chart> {
    let chart = |i: usize| {
        let series = |(rows, [stated, error], [believed, real]): &ErrorSet<'_>| {
            let band = rows.iter().map(|(t, _, s)| (*t, -3.0 * s[i], 3.0 * s[i]));
            let line = rows.iter().map(|(t, errors, _)| (*t, errors[i]));
            [
                Series::new(stated, *believed, Mark::Band(band.collect())),
                Series::line(error, *real, line.collect()),
            ]
        };
        let axis = ChartAxis::linear("").including(0.0, 0.0);
        let panel = Panel::new(axis, sets.iter().flat_map(series).collect());
        Chart::over_time(REPORTED_NAMES[i], vec![panel], outages).small()
    };
    let has_error = |i: &usize| {
        let mut rows = sets.iter().flat_map(|(rows, ..)| rows);
        rows.any(|(_, errors, _)| !errors[*i].is_nan())
    };
    (0..REPORTED).filter(has_error).map(chart).collect()
}

/// Rows, and the names and colours of their bands and lines.
pub(crate) type ErrorSet<'a> = (Vec<ErrorRow>, [&'a str; 2], [Colour; 2]);
/// Time (s), errors and standard deviations of the reported states.
pub(crate) type ErrorRow = (f64, [f64; REPORTED], [f64; REPORTED]);

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
