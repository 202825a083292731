//! Containers of messages in chunks, as MCAP and the bags of ROS 1 are.

use crate::channel::Channel;
use crate::error::Error;
use crate::input::Input;
use crate::unpack::Chunk;
use std::collections::{BTreeMap, BTreeSet};

/// Record of a container.
pub(crate) enum Record {
    /// A chunk, whose packed bytes come next.
    Chunk(Chunk),
    /// A message, whose bytes come next.
    Message(Head),
    /// A channel: its number, topic, type and encoding.
    Channel(u32, [String; 3]),
    /// Messages of a channel in the last chunk, by their times (ns).
    Index(u32, Vec<i64>),
    /// One that was passed over.
    Other,
}

/// Head of a message.
pub(crate) struct Head {
    pub(crate) channel: u32,
    pub(crate) log_ns: i64,
    pub(crate) size: u64,
}

/// Records of a format.
pub(crate) trait Dialect: Default {
    /// Reads the start of the file.
    fn start(&mut self, input: &mut Input) -> Result<(), Error>;

    /// Reads the next record, of the file or of a chunk; none at its end.
    fn record(&mut self, input: &mut Input) -> Result<Option<Record>, Error>;

    /// Holds when the records were those of a complete file.
    fn finish(&self, input: &Input) -> Result<(), Error>;
}

/// Shows all records of a container to `each`, those within chunks too where these are opened. Who is shown a message reads
/// its bytes or skips them.
pub(crate) fn walk<D: Dialect>(
    input: &mut Input,
    opens: bool,
    each: &mut dyn FnMut(Record, &mut Input) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut dialect = D::default();
    dialect.start(input)?;
    while let Some(record) = dialect.record(input)? {
        match record {
            Record::Chunk(chunk) if opens => {
                let mut inside = chunk.open(input)?;
                while let Some(record) = dialect.record(&mut inside)? {
                    if matches!(record, Record::Chunk(_)) {
                        return Err(Error::malformed(chunk.offset, "a chunk within a chunk"));
                    }
                    each(record, &mut inside)?;
                }
            }
            Record::Chunk(chunk) => {
                input.skip(chunk.packed)?;
                each(Record::Chunk(chunk), input)?;
            }
            record => each(record, input)?,
        }
    }
    dialect.finish(input)
}

/// Finds the channels of a container. Chunks stay packed where an index counts their messages and all channels are defined
/// outside of them.
pub(crate) fn survey<D: Dialect>(
    input: &mut Input,
    channels: &mut BTreeMap<u32, Channel>,
) -> Result<(), Error> {
    let mut look = |opens, input: &mut Input| {
        let (mut chunks, mut indexed) = (0, BTreeSet::new());
        channels.clear();
        let outcome = walk::<D>(input, opens, &mut |record, input| {
            match record {
                Record::Chunk(_) => chunks += 1,
                Record::Index(id, times) if !opens => {
                    indexed.insert(chunks);
                    let channel = channels.entry(id).or_default();
                    times.iter().for_each(|ns| channel.count(*ns));
                }
                Record::Message(head) => {
                    input.skip(head.size)?;
                    channels.entry(head.channel).or_default().count(head.log_ns);
                }
                Record::Channel(id, [topic, type_name, encoding]) => {
                    let channel = channels.entry(id).or_default();
                    if channel.topic.is_empty() {
                        (channel.topic, channel.type_name) = (topic, type_name);
                        channel.encoding = encoding;
                    }
                }
                Record::Index(..) | Record::Other => {}
            }
            Ok(())
        });
        let is_blind = channels.values().any(|c| c.topic.is_empty()) || indexed.len() < chunks;
        channels.retain(|id, channel| {
            channel.id = *id;
            !channel.topic.is_empty()
        });
        (outcome, is_blind)
    };
    let (outcome, is_blind) = look(false, input);
    match outcome {
        Err(error) if error.cut().is_none() => Err(error),
        _ if is_blind => {
            input.seek(0)?;
            look(true, input).0
        }
        outcome => outcome,
    }
}
