//! Channels of a log.

use crate::input::{LogError, LogFault};
use std::collections::BTreeMap;

/// Channel of a log.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LogChannel {
    /// Topic, or name of the messages.
    pub topic: String,
    /// Type of the messages, as the log names it.
    pub type_name: String,
    /// Use of the messages.
    pub content: Content,
    /// Number of messages.
    pub messages: u64,
    /// Earliest stamp of the log (ns).
    pub first_ns: Option<i64>,
    /// Latest stamp of the log (ns).
    pub last_ns: Option<i64>,
    /// Origin of the stamps.
    pub clock: Clock,
    /// The number by which the format knows it.
    pub(crate) id: u32,
    /// Priority among channels of the same content: the lowest is read by default.
    pub(crate) rank: u8,
    /// Encoding of the messages, of which a container may have several.
    pub(crate) encoding: String,
}

/// Use of a channel's messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Content {
    /// Samples of an IMU.
    Imu,
    /// Fixes of a receiver.
    Fix,
    /// Anything else.
    #[default]
    Other,
}

impl Content {
    const fn words(self) -> &'static str {
        match self {
            Self::Imu => "IMU samples",
            Self::Fix => "GNSS fixes",
            Self::Other => "other messages",
        }
    }
}

impl LogChannel {
    /// Counts a message.
    pub(crate) fn count(&mut self, ns: i64) {
        self.messages = self.messages.saturating_add(1);
        self.first_ns = Some(self.first_ns.map_or(ns, |t| t.min(ns)));
        self.last_ns = self.last_ns.max(Some(ns));
    }
}

/// Contents of a file.
#[derive(Default)]
pub(crate) struct Scan<'a> {
    /// Channels, by the numbers that the format knows them by.
    pub(crate) channels: BTreeMap<u32, LogChannel>,
    /// The channel whose samples are read, and their stamps; none while the channels are counted.
    pub(crate) wanted: Option<(&'a LogChannel, Stamp)>,
    /// Its samples, each with its byte.
    pub(crate) samples: Vec<(u64, LogSample)>,
}

/// The channel of such content: the one named, or the only one there.
pub(crate) fn choose<'a>(
    channels: &'a [LogChannel],
    content: Content,
    topic: Option<&str>,
) -> Result<&'a LogChannel, LogError> {
    let mut fitting: Vec<&LogChannel> = channels.iter().collect();
    fitting.retain(|c| c.content == content && c.messages > 0);
    let topics = |fitting: &[&LogChannel]| -> Vec<String> {
        fitting.iter().map(|c| c.topic.clone()).collect()
    };
    let what = content.words();
    if let Some(topic) = topic {
        let named = fitting.iter().find(|c| c.topic == topic).copied();
        let wanted = format!("{what} and the name {topic}");
        return named.ok_or_else(|| LogError::no_topic(&wanted, &topics(&fitting)));
    }
    let rank = fitting.iter().map(|c| c.rank).min();
    fitting.retain(|c| Some(c.rank) == rank);
    match fitting[..] {
        [] => Err(LogError::no_topic(what, &[])),
        [only] => Ok(only),
        _ => {
            let (count, topics) = (fitting.len(), topics(&fitting).join(", "));
            let message = format!("{count} topics have {what}: {topics}");
            Err(LogError::new(LogFault::Topic, message))
        }
    }
}

// Samples of an IMU and fixes of a receiver.

/// Nanoseconds of a second.
pub(crate) const NS: i64 = 1_000_000_000;

/// Stamp that a sample is given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Stamp {
    /// Time of measurement, as the message states it.
    #[default]
    Header,
    /// Time of arrival, as the logger states it; that of measurement where it states none.
    Log,
}

impl std::str::FromStr for Stamp {
    type Err = &'static str;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name {
            "header" => Ok(Self::Header),
            "log" => Ok(Self::Log),
            _ => Err("neither header nor log"),
        }
    }
}

/// Origin of a channel's stamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Clock {
    /// 1 January 1970, without leap seconds, if the writer's clock was set.
    #[default]
    Unix,
    /// Start of the device.
    Boot,
}

/// Sample of an IMU, in the sensor's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuReading {
    /// Stamp (ns); where the sensor gives increments, the end of their interval.
    pub stamp_ns: i64,
    /// Specific force (m/s²); of increments, the mean over the interval.
    pub accel_m_s2: [f64; 3],
    /// Angular rate (rad/s); of increments, the mean over the interval.
    pub gyro_rad_s: [f64; 3],
}

/// Position fix of a receiver; messages without a fix in three dimensions are passed over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogFix {
    /// Stamp (ns).
    pub stamp_ns: i64,
    /// Latitude (deg).
    pub lat_deg: f64,
    /// Longitude (deg).
    pub lon_deg: f64,
    /// Height above the ellipsoid (m).
    pub h_m: f64,
    /// Standard deviations north, east, down (m).
    pub sd_ned_m: Option<[f64; 3]>,
    /// Velocity north, east, down (m/s).
    pub v_ned_m_s: Option<[f64; 3]>,
    /// Its standard deviations (m/s).
    pub sd_v_ned_m_s: Option<[f64; 3]>,
}

/// Contents of a message. Samples are many, fixes are few.
pub(crate) enum LogSample {
    Imu(ImuReading),
    Fix(Box<LogFix>),
}

impl LogSample {
    pub(crate) const fn stamp_ns(&self) -> i64 {
        match self {
            Self::Imu(sample) => sample.stamp_ns,
            Self::Fix(fix) => fix.stamp_ns,
        }
    }
}

/// Standard deviations, where they are some: 0 and the largest number stand for unknown ones.
pub(crate) fn stated(sd: [f64; 3]) -> Option<[f64; 3]> {
    const UNKNOWN: f64 = 1e6;
    sd.iter().all(|s| *s > 0.0 && *s < UNKNOWN).then_some(sd)
}

/// Seconds of a stamp, rounded once: a product with 1e-9 would round twice. Around 1.7e9 s a `f64` resolves 0.24 µs.
#[must_use]
pub const fn in_seconds(ns: i64) -> f64 {
    (ns / NS) as f64 + (ns % NS) as f64 / NS as f64
}
