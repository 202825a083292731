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
    /// Bytes at a place are at fault.
    #[error("{0}: {1}")]
    At(Place, Fault),
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
    /// A format that is known by its first bytes, and is not read.
    #[error("{}, which is not read", .0.name())]
    NotRead(Kind),
    /// Not one of the known formats.
    #[error("not a known log")]
    Unknown,
}

/// Faults of bytes.
#[derive(Debug)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum Fault {
    /// A record goes beyond the end of the file.
    Truncated { needed: u64, left: u64 },
    /// The file lacks the end that its writer puts there last.
    StillWritten,
    /// A checksum differs.
    Crc { stored: u32, computed: u32 },
    /// An encoding or a compression that is not known.
    Encoding(String),
    /// A length beyond what any such message has.
    TooLarge { bytes: u64, limit: u64 },
    /// Stamps of a topic run backwards.
    TimeBack { from_ns: i64, to_ns: i64 },
    /// Bytes that do not follow the format.
    Malformed(String),
}

impl Display for Fault {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated { needed, left } => {
                write!(f, "cut off, a record of {needed} bytes has {left}")
            }
            Self::StillWritten => {
                f.write_str("the end is missing: still being written, or its writer was stopped")
            }
            Self::Crc { stored, computed } => {
                write!(
                    f,
                    "CRC failed, stored {stored:08x}, computed {computed:08x}"
                )
            }
            Self::Encoding(name) => write!(f, "unknown encoding {name:?}"),
            Self::TooLarge { bytes, limit } => {
                write!(f, "{bytes} bytes where at most {limit} make sense")
            }
            Self::TimeBack { from_ns, to_ns } => {
                let [from, to] = [*from_ns, *to_ns].map(seconds);
                write!(f, "time goes back from {from} s to {to} s")
            }
            Self::Malformed(what) => f.write_str(what),
        }
    }
}

impl Error {
    pub(crate) const fn at(offset: u64, fault: Fault) -> Self {
        let topic = None;
        Self::At(Place { offset, topic }, fault)
    }

    pub(crate) fn malformed(offset: u64, what: impl Into<String>) -> Self {
        Self::at(offset, Fault::Malformed(what.into()))
    }

    pub(crate) fn encoding(offset: u64, encoding: &[u8]) -> Self {
        let encoding = String::from_utf8_lossy(encoding).into_owned();
        Self::at(offset, Fault::Encoding(encoding))
    }

    /// Byte at which a file ends that its writer did not end.
    pub(crate) const fn cut(&self) -> Option<u64> {
        match self {
            Self::At(place, Fault::Truncated { .. } | Fault::StillWritten) => Some(place.offset),
            _ => None,
        }
    }

    /// The same, said of a topic.
    pub(crate) fn of_topic(mut self, name: &str) -> Self {
        if let Self::At(place, _) = &mut self {
            place.topic.get_or_insert_with(|| name.to_owned());
        }
        self
    }

    /// Advice on what to do.
    #[must_use]
    pub const fn hint(&self) -> Option<&'static str> {
        match self {
            Self::At(_, Fault::Encoding(_) | Fault::TooLarge { .. } | Fault::TimeBack { .. }) => {
                None
            }
            Self::At(..) => Some("the file is damaged: copy it again"),
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
