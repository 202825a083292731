//! Messages of one channel of a container, in order of their arrival.

use super::{Dialect, Head, Message, Record, Survey};
use crate::error::Error;
use crate::input::{Input, Origin};
use crate::unpack::Chunk;
use std::collections::VecDeque;

/// Reader of one channel. Messages may stand out of order in a file; those that wait are the ones after the earliest
/// message of the chunks to come, so that no more than one chunk is held where chunks follow one another in time.
pub(crate) struct Reader<D> {
    dialect: D,
    input: Input,
    channel: u32,
    is_unordered: bool,
    /// Earliest message of this chunk and all later ones (ns).
    earliest_ns: Vec<i64>,
    chunks_read: usize,
    end: u64,
    waiting: VecDeque<Message>,
    /// How many of those waiting no later one can precede.
    ready: usize,
    /// The error at which the messages end, once those before it are given.
    error: Option<Error>,
    is_done: bool,
}

impl<D: Dialect> Reader<D> {
    pub(crate) fn new(origin: &Origin, survey: &Survey, channel: u32) -> Result<Self, Error> {
        let mut earliest_ns: Vec<i64> = survey
            .chunks
            .iter()
            .map(|place| place.earliest_ns)
            .collect();
        for k in (1..earliest_ns.len()).rev() {
            earliest_ns[k - 1] = earliest_ns[k - 1].min(earliest_ns[k]);
        }
        let (mut dialect, mut input) = (D::default(), origin.open()?);
        dialect.start(&mut input)?;
        Ok(Self {
            dialect,
            input,
            channel,
            is_unordered: survey.unordered.contains(&channel),
            earliest_ns,
            chunks_read: 0,
            end: survey.end,
            waiting: VecDeque::new(),
            ready: 0,
            error: None,
            is_done: false,
        })
    }

    /// Reads a record, or a chunk of them.
    fn step(&mut self) -> Result<(), Error> {
        let record = if self.input.position() < self.end {
            self.dialect.record(&mut self.input)?
        } else {
            None
        };
        match record {
            None => {
                self.is_done = true;
                self.release(i64::MAX);
            }
            Some(Record::Chunk(chunk)) => {
                let outcome = self.unpack(&chunk);
                self.chunks_read += 1;
                self.release(self.earliest_to_come());
                outcome?;
            }
            Some(Record::Message(head)) => {
                if self.keep(head) {
                    self.waiting
                        .push_back(Message::read(&mut self.input, head)?);
                    if !self.is_unordered {
                        self.release(self.earliest_to_come());
                    }
                } else {
                    self.input.skip(head.size)?;
                }
            }
            Some(_) => {}
        }
        Ok(())
    }

    const fn keep(&self, head: Head) -> bool {
        head.channel == self.channel
    }

    fn earliest_to_come(&self) -> i64 {
        if self.is_unordered {
            return i64::MIN;
        }
        self.earliest_ns
            .get(self.chunks_read)
            .copied()
            .unwrap_or(i64::MAX)
    }

    fn unpack(&mut self, chunk: &Chunk) -> Result<(), Error> {
        let mut inside = chunk.open(&mut self.input)?;
        while let Some(record) = self.dialect.record(&mut inside)? {
            match record {
                Record::Message(head) if self.keep(head) => {
                    self.waiting.push_back(Message::read(&mut inside, head)?);
                }
                Record::Message(head) => inside.skip(head.size)?,
                Record::Chunk(_) => {
                    return Err(Error::malformed(chunk.offset, "a chunk within a chunk"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Puts those waiting in order; the sort is stable and quick where they are in order.
    fn release(&mut self, before_ns: i64) {
        let waiting = self.waiting.make_contiguous();
        waiting.sort_by_key(|message| message.log_ns);
        self.ready = waiting.partition_point(|message| message.log_ns <= before_ns);
    }
}

impl<D: Dialect> Iterator for Reader<D> {
    type Item = Result<Message, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.ready == 0 && !self.is_done {
            if let Err(error) = self.step() {
                (self.error, self.is_done) = (Some(error), true);
                self.release(i64::MAX);
            }
        }
        match self.ready.checked_sub(1) {
            Some(left) => {
                self.ready = left;
                self.waiting.pop_front().map(Ok)
            }
            None => self.error.take().map(Err),
        }
    }
}
