//! What is found on the way to a result.

use crate::formats::recordings::Report;

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
