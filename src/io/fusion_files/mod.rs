//! What `fuse` reads: recorded IMU data, GNSS fixes, an initial state. Our own tables, the headers that
//! recordings may have, the text files of KF-GINS, the solutions of RTKLIB, the sentences of NMEA 0183.

mod fixes;
mod inertial;
mod initial;
mod nmea;
mod rtklib;
mod wheel;

pub(in crate::io) use fixes::WEEK_S;
pub(crate) use fixes::read_gnss;
pub(crate) use inertial::read_imu;
pub(crate) use initial::{initial_schema, read_initial};
pub(in crate::io) use nmea::is_nmea;
pub(in crate::io) use rtklib::is_rtklib;
pub(crate) use wheel::read_wheel;

use crate::io::Failure;

/// What is said of a file that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Remark {
    /// How it was read.
    Note(String),
    /// What is doubtful about it.
    Doubt(String),
}

impl Remark {
    fn note(text: impl Into<String>) -> Self {
        Self::Note(text.into())
    }

    fn doubt(text: impl Into<String>) -> Self {
        Self::Doubt(text.into())
    }

    /// The same with the name of the file before it.
    fn of_file(self, path: &str) -> Self {
        match self {
            Self::Note(text) => Self::Note(format!("{path}: {text}")),
            Self::Doubt(text) => Self::Doubt(format!("{path}: {text}")),
        }
    }
}

/// The first row of a table of numbers between blanks without a header; none of any other text.
pub(super) fn bare_row(text: &str) -> Option<Vec<f64>> {
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|l| !(l.is_empty() || l.starts_with(['#', '%', '/'])))?;
    let row: Option<Vec<f64>> = first
        .split_whitespace()
        .map(|cell| cell.parse().ok())
        .collect();
    row.filter(|row| row.len() > 1)
}

/// Time that stands still or goes back.
fn time_back(path: &str, line: u64, previous_s: f64, t_s: f64) -> Failure {
    let advice = if previous_s - t_s > 500_000.0 {
        "a new GPS week? Count the seconds on, in both files"
    } else {
        "sort the rows by time and remove repeated ones"
    };
    let message = format!("time goes from {previous_s} s to {t_s} s: it must increase");
    Failure::contents(path, line, message).or_hint(advice)
}
