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
pub(crate) use inertial::{ImuFile, read_imu};
pub(crate) use initial::{initial_schema, read_initial};
pub(in crate::io) use nmea::is_nmea;
pub(in crate::io) use rtklib::is_rtklib;
pub(crate) use wheel::read_wheel;

use crate::io::Failure;
use nav_sim_document::{Importance, Note};

fn note(importance: Importance, text: impl Into<String>) -> Note {
    let text = text.into();
    Note { importance, text }
}

/// How a file was read.
fn remark(text: impl Into<String>) -> Note {
    note(Importance::Remark, text)
}

/// What is doubtful about a file.
fn doubt(text: impl Into<String>) -> Note {
    note(Importance::Warning, text)
}

/// A note with the name of the file before it.
fn of_file(note: Note, path: &str) -> Note {
    let text = format!("{path}: {}", note.text);
    Note { text, ..note }
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
