//! A log of any format.

use crate::channel::{
    Content, ImuReading, LogChannel, LogFix, LogSample, Scan, Stamp, choose, in_seconds,
};
#[cfg(any(feature = "mcap", feature = "bag"))]
use crate::container;
use crate::input::{HEAD, LogError, LogFault, LogFormat, LogInput, recognise};
use std::path::{Path, PathBuf};

/// Log whose channels are known.
///
/// ```
/// use nav_sim_logs::{Content, LogError, Log, Stamp, in_seconds};
///
/// # fn main() -> Result<(), LogError> {
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/ros2_zstd.mcap");
/// let log = Log::open(path.as_ref())?;
/// // no topic is named, as there is but one
/// let imu = log.channel(Content::Imu, None)?;
/// assert_eq!((imu.topic.as_str(), imu.messages), ("/imu", 40));
///
/// for sample in log.imu(imu, Stamp::Header)? {
///     assert!(sample.accel_m_s2[2] > 9.0 && in_seconds(sample.stamp_ns) > 1.7e9);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Log {
    path: PathBuf,
    kind: LogFormat,
    channels: Vec<LogChannel>,
    damage: Option<Truncation>,
    read: Read,
}

/// End of a file that was cut off, at which the reading ended.
#[derive(Debug)]
pub struct Truncation {
    /// The error that it would have been.
    pub error: LogError,
    /// Bytes before it.
    pub read_bytes: u64,
    /// Bytes of the file.
    pub file_bytes: u64,
}

/// Counts the channels of a file, or reads one, in order of time.
type Read = fn(&mut LogInput, &mut Scan<'_>) -> Result<(), LogError>;

impl Log {
    /// Opens a file and finds its channels.
    ///
    /// # Errors
    /// When the format is not one that is read, or the file is damaged before its end.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let mut input = LogInput::open(path)?;
        let file_bytes = input.length();
        let head = file_bytes.min(HEAD as u64);
        let kind = recognise(&input.bytes(head, head)?)
            .ok_or_else(|| LogError::at(0, LogFault::Encoding, "not a known log"))?;
        let read: Read = match kind {
            #[cfg(feature = "mcap")]
            LogFormat::Mcap => container::scan,
            #[cfg(feature = "bag")]
            LogFormat::Bag => container::scan,
            #[cfg(feature = "ulog")]
            LogFormat::Ulog => crate::ulog::scan,
            #[cfg(feature = "ubx")]
            LogFormat::Ubx => crate::ubx::scan,
            _ => {
                let message = format!("{}, which is not read", kind.name());
                return Err(LogError::new(LogFault::NotRead(kind), message));
            }
        };
        input.seek(0)?;
        let mut scan = Scan::default();
        let damage = match read(&mut input, &mut scan) {
            Ok(()) => None,
            Err(error) => match error.cut() {
                None => return Err(error),
                Some(read_bytes) => Some(Truncation {
                    error,
                    read_bytes,
                    file_bytes,
                }),
            },
        };
        let mut channels: Vec<LogChannel> = scan.channels.into_values().collect();
        channels.sort_by(|a, b| a.topic.cmp(&b.topic));
        Ok(Self {
            path: path.to_owned(),
            kind,
            channels,
            damage,
            read,
        })
    }

    /// Format of the file.
    #[must_use]
    pub const fn kind(&self) -> LogFormat {
        self.kind
    }

    /// Channels, in order of their topics.
    #[must_use]
    pub fn channels(&self) -> &[LogChannel] {
        &self.channels
    }

    /// Cut at which the file is taken to end.
    #[must_use]
    pub const fn damage(&self) -> Option<&Truncation> {
        self.damage.as_ref()
    }

    /// The channel of such content: of this topic, or the only one.
    ///
    /// # Errors
    /// When there is no such topic, or several and none is named.
    pub fn channel(&self, content: Content, topic: Option<&str>) -> Result<&LogChannel, LogError> {
        choose(&self.channels, content, topic)
    }

    /// Samples of an IMU in order of time, up to the cut if the file has one.
    ///
    /// # Errors
    /// When the file is damaged before, or stamps go back.
    pub fn imu(&self, channel: &LogChannel, stamp: Stamp) -> Result<Vec<ImuReading>, LogError> {
        self.samples(channel, stamp, |sample| match sample {
            LogSample::Imu(sample) => Some(sample),
            LogSample::Fix(_) => None,
        })
    }

    /// Fixes of a receiver in order of time, up to the cut if the file has one.
    ///
    /// # Errors
    /// As [`Self::imu`].
    pub fn fixes(&self, channel: &LogChannel, stamp: Stamp) -> Result<Vec<LogFix>, LogError> {
        self.samples(channel, stamp, |sample| match sample {
            LogSample::Imu(_) => None,
            LogSample::Fix(fix) => Some(*fix),
        })
    }

    fn samples<T>(
        &self,
        channel: &LogChannel,
        stamp: Stamp,
        of: fn(LogSample) -> Option<T>,
    ) -> Result<Vec<T>, LogError> {
        let mut scan = Scan {
            wanted: Some((channel, stamp)),
            ..Scan::default()
        };
        let outcome = (self.read)(&mut LogInput::open(&self.path)?, &mut scan);
        let stamps = scan.samples.iter().map(|(_, sample)| sample.stamp_ns());
        let mut steps = stamps.zip(scan.samples.iter().skip(1));
        let back = steps.find(|(from_ns, (_, sample))| sample.stamp_ns() < *from_ns);
        let outcome = match back {
            Some((from_ns, (offset, sample))) => {
                let [from, to] = [from_ns, sample.stamp_ns()].map(in_seconds);
                let message = format!("time goes back from {from} s to {to} s");
                Err(LogError::at(*offset, LogFault::TimeBack, message))
            }
            None => outcome,
        };
        match outcome {
            Err(error) if error.cut().is_none() => Err(error.of_topic(&channel.topic)),
            _ => Ok(scan
                .samples
                .into_iter()
                .filter_map(|(_, sample)| of(sample))
                .collect()),
        }
    }
}
