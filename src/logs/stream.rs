//! Samples of one channel, in order, as they are read.

use crate::channel::Channel;
use crate::error::{Error, Fault};
use crate::sample::Stamped;

/// End of a file that was cut off, at which the reading ended.
#[derive(Debug)]
pub struct Damage {
    /// The error that it would have been.
    pub error: Error,
    /// Bytes before it.
    pub read_bytes: u64,
    /// Bytes of the file.
    pub file_bytes: u64,
}

/// Message of a channel, or what was made of it, with its byte in the file.
pub(crate) type Located<T> = Result<(u64, T), Error>;
/// Samples as a format makes them.
pub(crate) type Stream<T> = Box<dyn Iterator<Item = Located<T>> + Send>;

/// Samples of one channel, in order of time. After an error there are no more.
pub struct Samples<T> {
    stream: Stream<T>,
    topic: String,
    last_ns: Option<i64>,
    file_bytes: u64,
    damage: Option<Damage>,
    is_done: bool,
}

impl<T> Samples<T> {
    pub(crate) fn new(stream: Stream<T>, channel: &Channel, file_bytes: u64) -> Self {
        let topic = channel.topic.clone();
        Self {
            stream,
            topic,
            last_ns: None,
            file_bytes,
            damage: None,
            is_done: false,
        }
    }

    /// Topic that is read.
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Cut that ended the samples; that of the file as a whole is [`Log::damage`](crate::Log::damage).
    #[must_use]
    pub const fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    fn end(&mut self, error: Error) -> Option<Error> {
        self.is_done = true;
        let error = error.of_topic(&self.topic);
        let Some(read_bytes) = error.cut() else {
            return Some(error);
        };
        self.damage = Some(Damage {
            error,
            read_bytes,
            file_bytes: self.file_bytes,
        });
        None
    }
}

impl<T: Stamped> Iterator for Samples<T> {
    type Item = Result<T, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_done {
            return None;
        }
        match self.stream.next() {
            None => {
                self.is_done = true;
                None
            }
            Some(Err(error)) => self.end(error).map(Err),
            Some(Ok((offset, sample))) => {
                let to_ns = sample.stamp_ns();
                match self.last_ns.replace(to_ns) {
                    Some(from_ns) if to_ns < from_ns => self
                        .end(Error::at(offset, Fault::TimeBack { from_ns, to_ns }))
                        .map(Err),
                    _ => Some(Ok(sample)),
                }
            }
        }
    }
}

impl<T> std::fmt::Debug for Samples<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Samples")
            .field("topic", &self.topic)
            .field("damage", &self.damage)
            .finish_non_exhaustive()
    }
}
