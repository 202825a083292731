//! Channels of a log.

use crate::error::Error;
use crate::sample::Clock;

/// Channel of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
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
}

/// Use of a channel's messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Samples of an IMU.
    Imu,
    /// Fixes of a receiver.
    Fix,
    /// Anything else.
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
    pub(crate) fn new(
        topic: impl Into<String>,
        type_name: impl Into<String>,
        content: Content,
    ) -> Self {
        Self {
            topic: topic.into(),
            type_name: type_name.into(),
            content,
            messages: 0,
            first_ns: None,
            last_ns: None,
            clock: Clock::Unix,
            id: 0,
            rank: 0,
        }
    }

    pub(crate) fn count(&mut self, messages: u64, first_ns: i64, last_ns: i64) {
        self.messages = self.messages.saturating_add(messages);
        self.first_ns = Some(self.first_ns.map_or(first_ns, |t| t.min(first_ns)));
        self.last_ns = Some(self.last_ns.map_or(last_ns, |t| t.max(last_ns)));
    }
}

/// The channel of such content: the one named, or the only one there.
pub(crate) fn choose<'a>(
    channels: &'a [Channel],
    content: Content,
    topic: Option<&str>,
) -> Result<&'a Channel, Error> {
    let fitting = || {
        channels
            .iter()
            .filter(|c| c.content == content && c.messages > 0)
    };
    let names = || fitting().map(|c| c.topic.clone()).collect::<Vec<_>>();
    if let Some(topic) = topic {
        let what = || format!("{} and the name {topic}", content.words());
        let named = fitting().find(|c| c.topic == topic);
        return named.ok_or_else(|| Error::NoTopic {
            what: what(),
            topics: names(),
        });
    }
    let rank = fitting().map(|c| c.rank).min();
    let mut best = fitting().filter(|c| Some(c.rank) == rank);
    match (best.next(), best.next()) {
        (None, _) => Err(Error::NoTopic {
            what: content.words().to_owned(),
            topics: Vec::new(),
        }),
        (Some(only), None) => Ok(only),
        _ => Err(Error::SeveralTopics {
            what: content.words(),
            topics: names(),
        }),
    }
}
