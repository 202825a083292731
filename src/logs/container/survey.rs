//! Channels of a container, and where its chunks are.

use super::{Definition, Dialect, Record, Tally};
use crate::error::Error;
use crate::input::{Input, Origin};
use crate::stream::Damage;
use crate::unpack::Chunk;
use std::collections::{BTreeMap, BTreeSet};

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
