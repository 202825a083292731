//! Channels of a log.

use crate::error::Error;
use crate::sample::{Clock, Sample};

/// Channel of a log.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Channel {
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
    /// Of channels of the same content, the lowest is read when none is named.
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

impl Channel {
    /// Counts a message.
    pub(crate) fn count(&mut self, ns: i64) {
        self.messages = self.messages.saturating_add(1);
        self.first_ns = Some(self.first_ns.map_or(ns, |t| t.min(ns)));
        self.last_ns = self.last_ns.max(Some(ns));
    }
}

/// Receives samples, each with its byte in the file.
pub(crate) type Each<'a> = &'a mut dyn FnMut(u64, Sample) -> Result<(), Error>;

/// The channel of such content: the one named, or the only one there.
pub(crate) fn choose<'a>(
    channels: &'a [Channel],
    content: Content,
    topic: Option<&str>,
) -> Result<&'a Channel, Error> {
    let mut fitting: Vec<&Channel> = channels.iter().collect();
    fitting.retain(|c| c.content == content && c.messages > 0);
    let topics = |fitting: &[&Channel]| fitting.iter().map(|c| c.topic.clone()).collect();
    if let Some(topic) = topic {
        let named = fitting.iter().find(|c| c.topic == topic).copied();
        return named.ok_or_else(|| Error::NoTopic {
            what: format!("{} and the name {topic}", content.words()),
            topics: topics(&fitting),
        });
    }
    let rank = fitting.iter().map(|c| c.rank).min();
    fitting.retain(|c| Some(c.rank) == rank);
    match fitting[..] {
        [] => Err(Error::NoTopic {
            what: content.words().to_owned(),
            topics: Vec::new(),
        }),
        [only] => Ok(only),
        _ => Err(Error::SeveralTopics {
            what: content.words(),
            topics: topics(&fitting),
        }),
    }
}
