//! Records of MCAP (<https://mcap.dev/spec>).

use crate::bytes::{Bytes, text};
use crate::container::{Dialect, Head, Record};
use crate::error::{Error, Fault};
use crate::input::Input;
use crate::unpack::Chunk;
use std::collections::HashMap;

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// Largest record that is read whole (bytes): a schema, or the index of a chunk.
const LARGEST_RECORD: u64 = 64 << 20;

/// Numbers of the kinds of records.
mod opcode {
    pub(super) const FOOTER: u8 = 0x02;
    pub(super) const SCHEMA: u8 = 0x03;
    pub(super) const CHANNEL: u8 = 0x04;
    pub(super) const MESSAGE: u8 = 0x05;
    pub(super) const CHUNK: u8 = 0x06;
    pub(super) const INDEX: u8 = 0x07;
}

/// State of the reading.
#[derive(Default)]
pub(crate) struct Mcap {
    /// Types of the messages, by the numbers of their schemas.
    types: HashMap<u16, String>,
    has_footer: bool,
}

impl Dialect for Mcap {
    fn start(&mut self, input: &mut Input) -> Result<(), Error> {
        if input.array()? == MAGIC {
            Ok(())
        } else {
            Err(Error::malformed(0, "not the start of an MCAP file"))
        }
    }

    fn record(&mut self, input: &mut Input) -> Result<Option<Record>, Error> {
        let offset = input.offset();
        if input.left() == 0 {
            return Ok(None);
        }
        let (code, length) = (input.u8()?, input.u64()?);
        input.expect(length)?;
        let fault = || {
            Error::malformed(
                offset,
                format!("record {code:#04x} of {length} bytes does not parse"),
            )
        };
        match code {
            0 => Err(Error::malformed(offset, "record of kind 0")),
            opcode::CHUNK => chunk(input, length).map(|chunk| Some(Record::Chunk(chunk))),
            opcode::MESSAGE => message(input, length, fault).map(Some),
            opcode::SCHEMA | opcode::CHANNEL | opcode::INDEX => {
                let body = input.bytes(length, LARGEST_RECORD)?;
                self.body(code, &body).ok_or_else(fault).map(Some)
            }
            opcode::FOOTER => {
                input.skip(length)?;
                self.has_footer = input.array()? == MAGIC;
                if self.has_footer {
                    Ok(None)
                } else {
                    Err(fault())
                }
            }
            _ => {
                input.skip(length)?;
                Ok(Some(Record::Other))
            }
        }
    }

    fn finish(&self, input: &Input) -> Result<(), Error> {
        if self.has_footer {
            Ok(())
        } else {
            Err(Error::at(input.offset(), Fault::StillWritten))
        }
    }
}

impl Mcap {
    /// A record that is read whole.
    fn body(&mut self, code: u8, body: &[u8]) -> Option<Record> {
        let mut bytes = Bytes::little(body);
        let id = bytes.u16()?;
        match code {
            opcode::SCHEMA => {
                self.types.insert(id, text(bytes.string()?));
                Some(Record::Other)
            }
            opcode::CHANNEL => {
                let type_name = self.types.get(&bytes.u16()?).cloned().unwrap_or_default();
                let (topic, encoding) = (text(bytes.string()?), text(bytes.string()?));
                Some(Record::Channel(id.into(), [topic, type_name, encoding]))
            }
            _ => {
                // times and places of a channel's messages in the chunk before
                let entries = bytes.string()?.chunks_exact(16);
                let times = entries.filter_map(|entry| Bytes::little(entry).u64());
                let times = times.map(u64::cast_signed).collect();
                Some(Record::Index(id.into(), times))
            }
        }
    }
}

/// A message behind its channel, number and two times.
fn message(input: &mut Input, length: u64, fault: impl Fn() -> Error) -> Result<Record, Error> {
    let size = length.checked_sub(22).ok_or_else(&fault)?;
    let channel = u32::from(input.u16()?);
    input.u32()?;
    let log_ns = i64::try_from(input.u64()?).map_err(|_| fault())?;
    input.u64()?;
    Ok(Record::Message(Head {
        channel,
        log_ns,
        size,
    }))
}

/// A chunk behind its times, length, CRC and compression.
fn chunk(input: &mut Input, length: u64) -> Result<Chunk, Error> {
    const LONGEST_NAME: u64 = 64;
    let start = input.position();
    input.skip(16)?;
    let (unpacked, crc) = (input.u64()?, input.u32()?);
    let name = u64::from(input.u32()?);
    let compression = input.bytes(name, LONGEST_NAME)?;
    let packed = input.u64()?;
    let offset = input.offset();
    if (input.position() - start).checked_add(packed) != Some(length) {
        return Err(Error::malformed(
            offset,
            "a chunk has not the length of its record",
        ));
    }
    Ok(Chunk {
        offset,
        compression,
        packed,
        unpacked,
        crc,
    })
}
