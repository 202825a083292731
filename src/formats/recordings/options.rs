//! How recordings are read.

use crate::formats::logs::LogOptions;
use nav_sim_signal::imu::Channel;

/// How recordings are read.
#[derive(Debug, Clone)]
pub struct ReadOptions {
    /// Sample rate (Hz) for files without a time column; where there is one, it must agree within 1 %, and wins where
    /// gaps are ignored.
    pub rate_hz: Option<f64>,
    /// Seconds to leave out at the beginning (warm-up).
    pub skip_s: f64,
    /// What to do where the time jumps or stands still.
    pub gaps: Gaps,
    /// The channels wanted; none: all. Others are neither parsed nor checked nor held in memory.
    pub channels: Option<Vec<Channel>>,
    /// Names of the columns, for files without a header and instead of the header of those with one.
    pub columns: Option<Vec<String>>,
    /// What is read of a log.
    pub log: LogOptions,
    /// Fewest samples a recording must have (at least 2).
    pub min_samples: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            rate_hz: None,
            skip_s: 0.0,
            gaps: Gaps::default(),
            channels: None,
            columns: None,
            log: LogOptions::default(),
            min_samples: 2,
        }
    }
}

/// What to do where a time step is over 1.5 or under 0.5 of the median step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Gaps {
    /// Refuse the file.
    #[default]
    Refuse,
    /// Leave out what is missing where it is less than a tenth; refuse the file otherwise. Missing samples are NaN.
    Keep,
    /// Make each stretch between such steps a recording of its own.
    Split,
    /// Take the samples as evenly spaced over the whole time all the same (late stamps, not lost samples).
    Ignore,
}

nav_sim_signal::named!(Gaps { Refuse = "refuse", Keep = "keep", Split = "split", Ignore = "ignore" });
