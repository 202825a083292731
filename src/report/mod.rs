//! Results as files: tables, JSON, self-contained pages (`page`). The module computes no statistic and touches
//! no file: every function returns a text, and the command line writes it.

mod closure;
pub(crate) mod comparison_table;
pub(crate) mod curve_chart;
pub(crate) mod curves;
pub(crate) mod dots;
mod output;
mod recording;
pub(crate) mod requirement;
#[cfg(test)]
pub(crate) mod sample;
pub(crate) mod states;
pub(crate) mod tables;
pub(crate) mod trajectory;
mod unexpected;
pub(crate) mod verdict;

pub(crate) use closure::TrajectoryCheck;
pub(crate) use curves::{CurvesFile, FittedCurve, ReplicateCurve, SignalsFile};
pub use nav_sim_document::readable;
pub(crate) use nav_sim_document::{seconds, six_digits};
pub(crate) use output::json;
pub(crate) use recording::{gnss_csv, imu_csv, initial_toml};
pub(crate) use states::{STATES, error_of, tone};
pub use trajectory::TrajectorySeries;
pub(crate) use unexpected::{
    reduction_doubt, reduction_line, unexpected_in_words, unexpected_line,
};

/// Names of `nav_sim_document` for files that have not moved to documents yet.
pub(crate) mod page {
    pub(crate) use nav_sim_document::{
        Axis, Chart, Colour, Document as Page, Mark, Panel, Series, Stroke, Tone, svg,
    };
}

mod number {
    pub(crate) use nav_sim_document::{readable, shortest, window};
}

/// Characters of a line in a terminal.
pub(crate) const WIDTH: usize = 120;
