//! Containers of messages in chunks, as MCAP and the bags of ROS 1 are.

use crate::error::Error;
use crate::input::{Input, Origin};
use crate::stream::Damage;
use crate::unpack::Chunk;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Largest message that is read (bytes): an IMU's has 400.
const LARGEST_MESSAGE: u64 = 1 << 20;

/// Record of a container.
pub(crate) enum Record {
    /// A chunk, whose packed bytes come next.
    Chunk(Chunk),
    /// A message, whose bytes come next.
    Message(Head),
    /// A channel.
    Channel(Definition),
    /// Messages of a channel in the last chunk.
    Index(Tally),
    /// One that was passed over.
    Other,
}

/// Head of a message.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Head {
    pub(crate) channel: u32,
    pub(crate) log_ns: i64,
    pub(crate) size: u64,
}

/// Definition of a channel.
#[derive(Debug, Clone)]
pub(crate) struct Definition {
    pub(crate) id: u32,
    pub(crate) topic: String,
    pub(crate) type_name: String,
    pub(crate) encoding: String,
}

/// Number and times of messages.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tally {
    pub(crate) channel: u32,
    pub(crate) messages: u64,
    pub(crate) first_ns: i64,
    pub(crate) last_ns: i64,
}

/// Message of a channel.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) log_ns: i64,
    pub(crate) offset: u64,
    pub(crate) data: Vec<u8>,
}

impl Message {
    fn read(input: &mut Input, head: Head) -> Result<Self, Error> {
        let offset = input.offset();
        let data = input.bytes(head.size, LARGEST_MESSAGE)?;
        Ok(Self {
            log_ns: head.log_ns,
            offset,
            data,
        })
    }
}

/// Records of a format.
pub(crate) trait Dialect: Default + Send + 'static {
    /// Reads the start of the file.
    fn start(&mut self, input: &mut Input) -> Result<(), Error>;
    /// Reads the next record, of the file or of a chunk; none at its end.
    fn record(&mut self, input: &mut Input) -> Result<Option<Record>, Error>;
    /// Holds when the records were those of a complete file.
    fn finish(&self, input: &Input) -> Result<(), Error>;
}

/// Everything that is known of a container before its messages are read.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    pub(crate) definitions: BTreeMap<u32, Definition>,
    pub(crate) tallies: BTreeMap<u32, Tally>,
    pub(crate) chunks: Vec<Place>,
    /// Channels whose messages outside of chunks are not in order of time.
    pub(crate) unordered: BTreeSet<u32>,
    /// Byte behind the last record.
    pub(crate) end: u64,
    pub(crate) damage: Option<Damage>,
}

/// Chunk, and its earliest message.
#[derive(Debug)]
pub(crate) struct Place {
    chunk: Chunk,
    is_indexed: bool,
    pub(crate) earliest_ns: i64,
}

/// Surveys a container. Chunks stay packed where an index counts their messages and all channels are defined outside
/// of them.
pub(crate) fn survey<D: Dialect>(origin: &Origin) -> Result<Survey, Error> {
    let mut input = origin.open()?;
    let (mut dialect, mut survey) = (D::default(), Survey::default());
    let outcome = survey
        .walk(&mut dialect, &mut input)
        .and_then(|()| dialect.finish(&input));
    survey.settle(outcome, &input)?;
    if survey.is_blind() {
        let outcome = survey.look_inside(&mut dialect, &mut input);
        survey.settle(outcome, &input)?;
    }
    Ok(survey)
}

impl Survey {
    fn settle(&mut self, outcome: Result<(), Error>, input: &Input) -> Result<(), Error> {
        match outcome {
            Err(error) if error.cut().is_some() => {
                let (read_bytes, file_bytes) = (self.end, input.length());
                self.damage = Some(Damage {
                    error,
                    read_bytes,
                    file_bytes,
                });
                Ok(())
            }
            outcome => outcome,
        }
    }

    fn walk(&mut self, dialect: &mut impl Dialect, input: &mut Input) -> Result<(), Error> {
        dialect.start(input)?;
        loop {
            self.end = input.position();
            match dialect.record(input)? {
                None => return Ok(()),
                Some(Record::Chunk(chunk)) => {
                    input.skip(chunk.packed)?;
                    self.chunks.push(Place {
                        chunk,
                        is_indexed: false,
                        earliest_ns: i64::MAX,
                    });
                }
                Some(Record::Index(tally)) => {
                    if let Some(place) = self.chunks.last_mut() {
                        place.is_indexed = true;
                        place.earliest_ns = place.earliest_ns.min(tally.first_ns);
                    }
                    self.count(tally);
                }
                Some(Record::Message(head)) => {
                    input.skip(head.size)?;
                    let tally = Tally::one(head.channel, head.log_ns);
                    if self
                        .tallies
                        .get(&head.channel)
                        .is_some_and(|before| head.log_ns < before.last_ns)
                    {
                        self.unordered.insert(head.channel);
                    }
                    self.count(tally);
                }
                Some(Record::Channel(definition)) => self.define(definition),
                Some(Record::Other) => {}
            }
        }
    }

    fn count(&mut self, more: Tally) {
        let all = self.tallies.entry(more.channel).or_insert(Tally {
            messages: 0,
            ..more
        });
        all.messages = all.messages.saturating_add(more.messages);
        all.first_ns = all.first_ns.min(more.first_ns);
        all.last_ns = all.last_ns.max(more.last_ns);
    }

    fn define(&mut self, definition: Definition) {
        self.definitions.entry(definition.id).or_insert(definition);
    }

    fn is_blind(&self) -> bool {
        let undefined = |channel: &u32| !self.definitions.contains_key(channel);
        self.chunks.iter().any(|place| !place.is_indexed) || self.tallies.keys().any(undefined)
    }

    /// Unpacks all chunks: counts the messages of those that have no index, and finds definitions.
    fn look_inside(&mut self, dialect: &mut impl Dialect, input: &mut Input) -> Result<(), Error> {
        for k in 0..self.chunks.len() {
            let Place {
                chunk, is_indexed, ..
            } = &self.chunks[k];
            let (chunk, is_indexed) = (chunk.clone(), *is_indexed);
            if let Err(error) = self.look_inside_one(k, &chunk, is_indexed, dialect, input) {
                // what comes behind a damaged chunk is not read
                self.end = self.end.min(chunk.offset);
                return Err(error);
            }
        }
        Ok(())
    }

    fn look_inside_one(
        &mut self,
        k: usize,
        chunk: &Chunk,
        is_indexed: bool,
        dialect: &mut impl Dialect,
        input: &mut Input,
    ) -> Result<(), Error> {
        input.seek(chunk.offset)?;
        let mut inside = chunk.open(input)?;
        while let Some(record) = dialect.record(&mut inside)? {
            match record {
                Record::Channel(definition) => self.define(definition),
                Record::Message(head) => {
                    inside.skip(head.size)?;
                    if !is_indexed {
                        self.count(Tally::one(head.channel, head.log_ns));
                        let place = &mut self.chunks[k];
                        place.earliest_ns = place.earliest_ns.min(head.log_ns);
                    }
                }
                Record::Chunk(_) => {
                    return Err(Error::malformed(chunk.offset, "a chunk within a chunk"));
                }
                Record::Index(_) | Record::Other => {}
            }
        }
        Ok(())
    }
}

impl Tally {
    const fn one(channel: u32, log_ns: i64) -> Self {
        Self {
            channel,
            messages: 1,
            first_ns: log_ns,
            last_ns: log_ns,
        }
    }
}

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
