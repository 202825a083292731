//! Records of a ROS 1 bag (<https://wiki.ros.org/Bags/Format/2.0>).

use crate::bytes::{Bytes, text};
use crate::container::{Dialect, Head, Record};
use crate::error::{Error, Fault};
use crate::input::Input;
use crate::sample::NS;
use crate::unpack::Chunk;

const MAGIC: [u8; 13] = *b"#ROSBAG V2.0\n";
/// Longest header of a record (bytes).
const LONGEST_HEADER: u64 = 1 << 20;
/// Longest record that is read whole (bytes): a definition of messages, or the index of a chunk.
const LARGEST_RECORD: u64 = 64 << 20;

/// Numbers of the kinds of records.
mod opcode {
    pub(super) const MESSAGE: u8 = 0x02;
    pub(super) const BAG: u8 = 0x03;
    pub(super) const INDEX: u8 = 0x04;
    pub(super) const CHUNK: u8 = 0x05;
    pub(super) const CONNECTION: u8 = 0x07;
}

/// State of the reading.
#[derive(Default)]
pub(crate) struct Bag {
    /// Byte of the index at the end; 0 until the bag is closed.
    index: u64,
}

impl Dialect for Bag {
    fn start(&mut self, input: &mut Input) -> Result<(), Error> {
        let magic = input.array()?;
        if magic == MAGIC {
            Ok(())
        } else {
            Err(Error::encoding(0, magic.trim_ascii_end()))
        }
    }

    fn record(&mut self, input: &mut Input) -> Result<Option<Record>, Error> {
        if input.left() == 0 {
            return Ok(None);
        }
        let offset = input.offset();
        let length = u64::from(input.u32()?);
        let header = input.bytes(length, LONGEST_HEADER)?;
        let size = u64::from(input.u32()?);
        input.expect(size)?;
        let fault = || Error::malformed(offset, "a record of a bag does not parse");
        let fields = Fields(&header);
        match fields.bytes(b"op").ok_or_else(fault)? {
            [opcode::MESSAGE] => message(fields, size).ok_or_else(fault).map(Some),
            [opcode::CHUNK] => {
                let compression = fields.bytes(b"compression").ok_or_else(fault)?.to_vec();
                let unpacked = fields.u32(b"size").ok_or_else(fault)?.into();
                let offset = input.offset();
                Ok(Some(Record::Chunk(Chunk {
                    offset,
                    compression,
                    packed: size,
                    unpacked,
                    crc: 0,
                })))
            }
            [opcode::INDEX] => index(fields, &input.bytes(size, LARGEST_RECORD)?)
                .ok_or_else(fault)
                .map(Some),
            [opcode::CONNECTION] => {
                let data = input.bytes(size, LARGEST_RECORD)?;
                connection(fields, &data).ok_or_else(fault).map(Some)
            }
            code => {
                input.skip(size)?;
                self.note(code, fields, offset)?;
                Ok(Some(Record::Other))
            }
        }
    }

    fn finish(&self, input: &Input) -> Result<(), Error> {
        if self.index == 0 || self.index > input.length() {
            return Err(Error::at(input.offset(), Fault::StillWritten));
        }
        Ok(())
    }
}

impl Bag {
    /// Counts of the start and of the end.
    fn note(&mut self, code: &[u8], fields: Fields<'_>, offset: u64) -> Result<(), Error> {
        if code == [opcode::BAG] {
            if let Some(name) = fields.bytes(b"encryptor").filter(|name| !name.is_empty()) {
                return Err(Error::encoding(offset, name));
            }
            let index = fields.bytes(b"index_pos");
            let index = index.and_then(|b| Bytes::little(b).u64());
            let what = "the start of the bag does not parse";
            self.index = index.ok_or_else(|| Error::malformed(offset, what))?;
        }
        Ok(())
    }
}

/// Fields of a header: each is a length, then `name=value`.
#[derive(Clone, Copy)]
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(self, name: &[u8]) -> Option<&'a [u8]> {
        let mut bytes = Bytes::little(self.0);
        while let Some(field) = bytes.string() {
            if let Some(value) = field
                .strip_prefix(name)
                .and_then(|rest| rest.strip_prefix(b"="))
            {
                return Some(value);
            }
        }
        None
    }

    fn u32(self, name: &[u8]) -> Option<u32> {
        Bytes::little(self.bytes(name)?).u32()
    }
}

/// Seconds and nanoseconds (ns).
fn time_ns(bytes: &mut Bytes<'_>) -> Option<i64> {
    Some(i64::from(bytes.u32()?) * NS + i64::from(bytes.u32()?))
}

fn message(fields: Fields<'_>, size: u64) -> Option<Record> {
    let log_ns = time_ns(&mut Bytes::little(fields.bytes(b"time")?))?;
    Some(Record::Message(Head {
        channel: fields.u32(b"conn")?,
        log_ns,
        size,
    }))
}

/// Times and places of a connection's messages in the chunk before.
fn index(fields: Fields<'_>, entries: &[u8]) -> Option<Record> {
    let entries = entries.chunks_exact(12);
    let times = entries.filter_map(|entry| time_ns(&mut Bytes::little(entry)));
    Some(Record::Index(fields.u32(b"conn")?, times.collect()))
}

fn connection(fields: Fields<'_>, data: &[u8]) -> Option<Record> {
    let (topic, type_name) = (fields.bytes(b"topic")?, Fields(data).bytes(b"type")?);
    let named = [text(topic), text(type_name), "ros1".to_owned()];
    Some(Record::Channel(fields.u32(b"conn")?, named))
}
