//! Clock of a log: sentences state a time of day, and some of them a date.

use super::{DAY_S, Log};
use crate::formats::fusion_files::fixes::WEEK_S;
use crate::formats::fusion_files::rtklib::{GPS_EPOCH_S, leap_s};
use std::collections::BTreeMap;

/// What a receiver is off that counts GPS weeks in ten bits (s).
const ROLLOVER_S: f64 = 1024.0 * WEEK_S;
/// Midnights before the first sentence (Unix s) and how many sentences state them.
#[derive(Debug, Default)]
pub(super) struct Dates(BTreeMap<i64, usize>);

impl Dates {
    pub(super) fn add(&mut self, midnight_s: Option<f64>) {
        if let Some(midnight_s) = midnight_s {
            *self.0.entry(midnight_s as i64).or_default() += 1;
        }
    }

    /// The one that most sentences state: before a receiver has found the time, it states any.
    fn most(&self) -> Option<f64> {
        self.0
            .iter()
            .max_by_key(|(_, count)| **count)
            .map(|(s, _)| *s as f64)
    }
}

/// The clock of a log.
#[derive(Debug, Default)]
pub(super) struct Clock {
    /// What is added to seconds of the first day (s).
    pub(super) origin_s: f64,
    /// Times of the fixes then.
    pub(super) words: &'static str,
    /// Whether the receiver's week counter has rolled over.
    pub(super) is_rolled: bool,
}

impl Log {
    /// Unix time where the IMU runs in it from one time to the other, else seconds of the first day, else GPS time. A receiver whose week
    /// counter has rolled over is known by dates that are the IMU's after 1024 weeks, or twice that.
    pub(super) fn clock(&self, imu_s: Option<(f64, f64)>) -> Clock {
        let time_of_epoch = |e: &super::Epoch| DAY_S * e.day + e.time_s;
        let span = self
            .epochs
            .first()
            .map(time_of_epoch)
            .zip(self.epochs.last().map(time_of_epoch));
        let overlaps = |origin_s: f64| {
            let both = imu_s.zip(span);
            both.is_some_and(|(imu, gnss)| imu.0 <= origin_s + gnss.1 && origin_s + gnss.0 <= imu.1)
        };
        let midnight_s = self.dates.most();
        let origins =
            midnight_s.map(|midnight_s| [0.0, 1.0, 2.0].map(|n| midnight_s + n * ROLLOVER_S));
        if let Some((n, origin_s)) =
            origins.and_then(|all| all.into_iter().enumerate().find(|(_, s)| overlaps(*s)))
        {
            return Clock {
                origin_s,
                words: "Unix time",
                is_rolled: n > 0,
            };
        }
        let day = Clock {
            words: "seconds of the day (UTC)",
            ..Clock::default()
        };
        let gps_s = midnight_s
            .map(|s| s - GPS_EPOCH_S as f64 + leap_s(s))
            .unwrap_or(f64::NAN);
        let of_gps = [
            (gps_s, "seconds of GPS time"),
            (gps_s.rem_euclid(WEEK_S), "seconds of the GPS week"),
        ];
        match of_gps
            .into_iter()
            .find(|(origin_s, _)| !overlaps(0.0) && overlaps(*origin_s))
        {
            Some((origin_s, words)) => Clock {
                origin_s,
                words,
                is_rolled: false,
            },
            None => day,
        }
    }
}
