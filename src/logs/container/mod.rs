//! Containers of messages in chunks, as MCAP and the bags of ROS 1 are.

mod reader;
mod survey;

pub(crate) use reader::Reader;
pub(crate) use survey::{Survey, survey};

use crate::error::Error;
use crate::input::Input;
use crate::unpack::Chunk;

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
