//! Errors of reading a log.

use crate::recognise::Kind;
use std::fmt::{self, Display, Formatter};

/// Place in a log: a byte of the file, and the topic that was read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// Byte of the file; that of the chunk for what is packed within it.
    pub offset: u64,
    /// Topic, where one was being read.
    pub topic: Option<String>,
}

impl Place {
    pub(crate) const fn byte(offset: u64) -> Self {
        Self {
            offset,
            topic: None,
        }
    }
}

impl Display for Place {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "byte {}", self.offset)?;
        self.topic
            .iter()
            .try_for_each(|topic| write!(f, ", topic {topic}"))
    }
}

/// Errors of reading a log; what to do about each is its [`hint`](Self::hint).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// A record goes beyond the end of the file.
    #[error("{place}: cut off, a record of {needed} bytes has {left}")]
    #[expect(missing_docs, reason = "bytes, as the message says")]
    Truncated {
        place: Place,
        needed: u64,
        left: u64,
    },
    /// The file lacks the end that its writer puts there last.
    #[error("{place}: the end is missing: still being written, or its writer was stopped")]
    #[expect(missing_docs, reason = "the place of the end")]
    StillWritten { place: Place },
    /// A checksum differs.
    #[error("{place}: CRC failed, stored {stored:08x}, computed {computed:08x}")]
    #[expect(missing_docs, reason = "checksums, as the message says")]
    Crc {
        place: Place,
        stored: u32,
        computed: u32,
    },
    /// An encoding or a compression that is not known.
    #[error("{place}: unknown encoding {encoding:?}")]
    #[expect(missing_docs, reason = "its name in the file")]
    Encoding { place: Place, encoding: String },
    /// A length beyond what any such message has.
    #[error("{place}: {bytes} bytes where at most {limit} make sense")]
    #[expect(missing_docs, reason = "bytes, as the message says")]
    TooLarge {
        place: Place,
        bytes: u64,
        limit: u64,
    },
    /// Stamps of a topic run backwards.
    #[error("{place}: time goes back from {} s to {} s", seconds(*.from_ns), seconds(*.to_ns))]
    #[expect(missing_docs, reason = "stamps, as the message says")]
    TimeBack {
        place: Place,
        from_ns: i64,
        to_ns: i64,
    },
    /// Several topics could be meant.
    #[error("{} topics have {what}: {}", .topics.len(), .topics.join(", "))]
    #[expect(missing_docs, reason = "the choice")]
    SeveralTopics {
        what: &'static str,
        topics: Vec<String>,
    },
    /// No topic is the one that is wanted.
    #[error("no topic has {what}{}", in_place_of(.topics))]
    #[expect(missing_docs, reason = "the topics that are there instead")]
    NoTopic { what: String, topics: Vec<String> },
    /// Bytes that do not follow the format.
    #[error("{place}: {what}")]
    #[expect(missing_docs, reason = "the fault")]
    Malformed { place: Place, what: String },
    /// A format that is known by its first bytes, and is not read.
    #[error("{}, which is not read", .0.name())]
    NotRead(Kind),
    /// Not one of the known formats.
    #[error("not a known log")]
    Unknown,
}

impl Error {
    pub(crate) fn malformed(offset: u64, what: impl Into<String>) -> Self {
        Self::Malformed {
            place: Place::byte(offset),
            what: what.into(),
        }
    }

    pub(crate) fn encoding(offset: u64, encoding: &[u8]) -> Self {
        let encoding = String::from_utf8_lossy(encoding).into_owned();
        Self::Encoding {
            place: Place::byte(offset),
            encoding,
        }
    }

    /// Place of the fault, where it has one.
    #[must_use]
    pub const fn place(&self) -> Option<&Place> {
        match self {
            Self::Truncated { place, .. }
            | Self::StillWritten { place }
            | Self::Crc { place, .. }
            | Self::Encoding { place, .. }
            | Self::TooLarge { place, .. }
            | Self::TimeBack { place, .. }
            | Self::Malformed { place, .. } => Some(place),
            _ => None,
        }
    }

    /// Byte at which a file ends that its writer did not end.
    pub(crate) const fn cut(&self) -> Option<u64> {
        match self {
            Self::Truncated { place, .. } | Self::StillWritten { place } => Some(place.offset),
            _ => None,
        }
    }

    /// The same, said of a topic.
    pub(crate) fn of_topic(mut self, name: &str) -> Self {
        if let Self::Truncated { place, .. }
        | Self::StillWritten { place }
        | Self::Crc { place, .. }
        | Self::Encoding { place, .. }
        | Self::TooLarge { place, .. }
        | Self::TimeBack { place, .. }
        | Self::Malformed { place, .. } = &mut self
        {
            place.topic.get_or_insert_with(|| name.to_owned());
        }
        self
    }

    /// Advice on what to do.
    #[must_use]
    pub const fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Truncated { .. }
            | Self::StillWritten { .. }
            | Self::Crc { .. }
            | Self::Malformed { .. } => Some("the file is damaged: copy it again"),
            Self::TimeBack { .. } => {
                Some("the stamps of the log may be in order where those of the header are not")
            }
            Self::SeveralTopics { .. } => Some("name one of them"),
            Self::NotRead(kind) => kind.conversion(),
            _ => None,
        }
    }
}

fn seconds(ns: i64) -> String {
    let sign = if ns < 0 { "-" } else { "" };
    format!(
        "{sign}{}.{:09}",
        ns.unsigned_abs() / 1_000_000_000,
        ns.unsigned_abs() % 1_000_000_000
    )
}

fn in_place_of(topics: &[String]) -> String {
    if topics.is_empty() {
        String::new()
    } else {
        format!("; there are {}", topics.join(", "))
    }
}
