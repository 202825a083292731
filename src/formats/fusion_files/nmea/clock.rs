//! What the times of a log are: sentences state a time of day, and some of them a date.

use super::sentence::date_of;
use super::{DAY_S, Log};
use crate::formats::fusion_files::fixes::WEEK_S;
use std::collections::BTreeMap;

/// What a receiver is off that counts GPS weeks in ten bits (s).
const ROLLOVER_S: f64 = 1024.0 * WEEK_S;
/// GPS time begins: an earlier clock is no Unix time of a GNSS recording (Unix s).
const GPS_EPOCH_S: f64 = 315_964_800.0;

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
    fn most(&self) -> Option<(f64, usize)> {
        self.0.iter().max_by_key(|(_, count)| **count).map(|(s, count)| (*s as f64, *count))
    }
}

/// The clock of a log.
#[derive(Debug, Default)]
pub(super) struct Clock {
    /// What is added to seconds of the first day (s).
    pub(super) origin_s: f64,
    /// What the times are then.
    pub(super) words: &'static str,
    pub(super) doubts: Vec<String>,
}

impl Log {
    /// Unix time where the IMU runs in it from one time to the other, else seconds of the first day. A receiver whose week
    /// counter has rolled over is known by dates that are the IMU's after 1024 weeks, or twice that.
    pub(super) fn clock(&self, imu_s: Option<(f64, f64)>) -> Clock {
        let time_of_epoch = |e: &super::Epoch| DAY_S * e.day + e.time_s;
        let span = self.epochs.first().map(time_of_epoch).zip(self.epochs.last().map(time_of_epoch));
        let overlaps = |origin_s: f64| {
            let both = imu_s.zip(span);
            both.is_some_and(|(imu, gnss)| imu.0 <= origin_s + gnss.1 && origin_s + gnss.0 <= imu.1)
        };
        let Some((midnight_s, stating)) = self.dates.most() else {
            return Clock { words: "seconds of the day (UTC; the log has no date)", ..Clock::default() };
        };
        let mut doubts = Vec::new();
        let others = self.dates.0.values().sum::<usize>() - stating;
        if others > 0 {
            let date = date_of(midnight_s);
            doubts.push(format!(
                "{others} dates do not agree with {date}, the first day by {stating}: left out"
            ));
        }
        let rollovers = [0.0, 1.0, 2.0].into_iter().find(|n| overlaps(midnight_s + n * ROLLOVER_S));
        let origin_s = rollovers.map_or(0.0, |n| midnight_s + n * ROLLOVER_S);
        let begin_s = imu_s.map(|(begin_s, _)| begin_s).filter(|s| *s >= GPS_EPOCH_S);
        doubts.extend(match (rollovers, begin_s) {
            (Some(n), _) if n > 0.0 => Some(format!(
                "the log is of {}, the IMU of {}, {:.0} weeks later: the week counter of the receiver has rolled over; read as {1}",
                date_of(midnight_s),
                date_of(origin_s),
                1024.0 * n
            )),
            (None, Some(begin_s)) => {
                let rolled = if begin_s - midnight_s >= ROLLOVER_S {
                    ", more than 1024 weeks later, as when the week counter of a receiver has rolled over"
                } else {
                    ""
                };
                let (log, imu) = (date_of(midnight_s), date_of(begin_s));
                Some(format!("the log is of {log}, the IMU, if its clock is Unix time, of {imu}{rolled}"))
            }
            _ => None,
        });
        let words = match (rollovers, imu_s) {
            (Some(_), _) => "Unix time, as the IMU's",
            (None, Some(_)) => "seconds of the day (UTC; the IMU's clock is not Unix time of the log's date)",
            (None, None) => "seconds of the day (UTC), or Unix time where the IMU's are",
        };
        Clock { origin_s, words, doubts }
    }
}
