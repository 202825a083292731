//! What is found on the way to a result.

use crate::formats::recordings::Report;
use crate::report::six_digits;
use nav_sim_document::{Importance, Note};

/// What a user may want to know beside the result.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Remark<'a> {
    /// What was found in the recordings, and what is doubtful about them.
    Read(&'a Report),
    /// The recordings run at a rate that is no whole multiple of the fixes' but for the error of a clock.
    Rate {
        /// Their rate (Hz).
        found_hz: f64,
        /// The rate that they are taken to have (Hz).
        taken_hz: f64,
    },
    /// A recording is so much shorter than the others that it lacks scales, or costs all of them scales.
    Shortest {
        /// The recording.
        recording: &'a str,
        /// Its samples.
        samples: usize,
        /// Its scales.
        scales: u32,
        /// Recordings with fewer scales than are used.
        short: usize,
        /// The scales that more than half of the recordings have, which are used.
        used: u32,
        /// The scales that half of them have.
        usual: u32,
    },
}

impl Remark<'_> {
    /// The remark in words: what is doubtful is a warning, what is for those who ask for more a detail.
    #[must_use]
    pub fn said(&self) -> Vec<Note> {
        let (importance, text) = match *self {
            Self::Read(report) => return read(report),
            Self::Rate { found_hz, taken_hz } => (
                Importance::Remark,
                format!(
                    "the recordings run at {} Hz: taken as {taken_hz} Hz, so that fixes meet samples",
                    six_digits(found_hz)
                ),
            ),
            Self::Shortest {
                recording,
                samples,
                scales,
                short: 0,
                usual,
                ..
            } => (
                Importance::Warning,
                format!(
                    "{recording}: its {samples} samples limit all recordings to {scales} scales; without it there would be \
                     more (half of them have {usual}): leave it out for those"
                ),
            ),
            Self::Shortest {
                recording,
                samples,
                scales,
                short,
                used,
                ..
            } => {
                let others = match short {
                    1 => String::new(),
                    _ => format!(" ({} more are short)", short - 1),
                };
                let text = format!(
                    "{recording}: its {samples} samples have {scales} scales{others}; the longer ones, up to {used} scales, are \
                     averaged over the longer recordings alone"
                );
                (Importance::Warning, text)
            }
        };
        vec![Note { importance, text }]
    }
}

/// Files of more than this number are told in one line, unless all is to be said.
const FEW: usize = 2;

fn read(report: &Report) -> Vec<Note> {
    let is_many = report.files.len() > FEW;
    let note = |importance, text| Note { importance, text };
    let summary = is_many.then(|| {
        note(
            Importance::Remark,
            format!("{} (--verbose: each of them)", report.summary()),
        )
    });
    let each = if is_many {
        Importance::Detail
    } else {
        Importance::Remark
    };
    let of_files = report.files.iter().flat_map(|file| {
        let ignored = (!file.ignored.is_empty()).then(|| {
            note(
                Importance::Detail,
                format!("{}: passed over: {}", file.file, file.ignored.join(", ")),
            )
        });
        std::iter::once(note(each, file.to_string())).chain(ignored)
    });
    let doubts = report
        .all_warnings()
        .into_iter()
        .map(|warning| note(Importance::Warning, warning.to_string()));
    summary.into_iter().chain(of_files).chain(doubts).collect()
}

/// Receives the remarks of a job.
pub trait Remarks {
    /// Number of recordings read so far, of all; 0 at the beginning.
    fn progress(&mut self, done: usize, all: usize);
    /// Something was found.
    fn remark(&mut self, remark: Remark<'_>);
}

/// Ignores all remarks.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silence;

impl Remarks for Silence {
    fn progress(&mut self, _: usize, _: usize) {}

    fn remark(&mut self, _: Remark<'_>) {}
}
