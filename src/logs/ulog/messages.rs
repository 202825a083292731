//! Messages of a log.

use super::layout::{Formats, Layout};
use crate::bytes::{Bytes, text};
use crate::error::Error;
use crate::input::Input;
use std::collections::HashMap;

const MAGIC: [u8; 7] = *b"ULog\x01\x12\x35";
/// Flag of data that was appended after the log had ended (a crash dump), and all others.
const APPENDED: u8 = 1;

/// Message of a topic.
pub(super) struct Data {
    pub(super) id: u16,
    pub(super) offset: u64,
    pub(super) bytes: Vec<u8>,
}

/// Topic of a log.
pub(super) struct Topic {
    pub(super) name: String,
    pub(super) instance: u8,
    pub(super) layout: Layout,
}

/// Messages of a file.
pub(super) struct Messages<'a> {
    input: &'a mut Input,
    formats: Formats,
    /// Topics by their numbers.
    pub(super) topics: HashMap<u16, Topic>,
    /// Byte from which on data was appended: what comes before it may be cut, and it is no flight.
    end: u64,
}

impl<'a> Messages<'a> {
    pub(super) fn new(input: &'a mut Input) -> Result<Self, Error> {
        if input.array()? != MAGIC {
            return Err(Error::malformed(0, "not the start of a ULog file"));
        }
        // version and time of the start
        input.skip(9)?;
        Ok(Self {
            input,
            formats: Formats::new(),
            topics: HashMap::new(),
            end: u64::MAX,
        })
    }

    /// The next message of a topic: of any, or of one.
    pub(super) fn next_data(&mut self, only: Option<u32>) -> Result<Option<Data>, Error> {
        loop {
            let offset = self.input.position();
            if self.input.left() == 0 || offset + 3 > self.end {
                return Ok(None);
            }
            let (size, kind) = (self.input.u16()?, self.input.u8()?);
            if self.input.position() + u64::from(size) > self.end {
                return Ok(None);
            }
            self.input.expect(size.into())?;
            if kind != b'D' {
                self.other(kind, size, offset)?;
                continue;
            }
            let size = u64::from(size);
            let Some(rest) = size.checked_sub(2) else {
                return Err(Error::malformed(
                    offset,
                    "a message of a topic without a number",
                ));
            };
            let id = self.input.u16()?;
            if only.is_none_or(|only| only == u32::from(id)) {
                let bytes = self.input.bytes(rest, rest)?;
                return Ok(Some(Data { id, offset, bytes }));
            }
            self.input.skip(rest)?;
        }
    }

    /// Formats, subscriptions and flags.
    fn other(&mut self, kind: u8, size: u16, offset: u64) -> Result<(), Error> {
        if !matches!(kind, b'F' | b'A' | b'B') {
            return self.input.skip(size.into());
        }
        let body = self.input.bytes(size.into(), size.into())?;
        let fault = || {
            Error::malformed(
                offset,
                format!("message {:?} does not parse", char::from(kind)),
            )
        };
        match kind {
            b'F' => {
                let format = text(&body);
                let (name, fields) = format.split_once(':').ok_or_else(fault)?;
                self.formats.insert(name.to_owned(), fields.to_owned());
            }
            b'A' => {
                let mut bytes = Bytes::little(&body);
                let (instance, id) = bytes.u8().zip(bytes.u16()).ok_or_else(fault)?;
                let name = text(&body[3..]);
                if let Some(layout) = Layout::new(&name, &self.formats) {
                    let topic = Topic {
                        name,
                        instance,
                        layout,
                    };
                    self.topics.insert(id, topic);
                }
            }
            _ => self.flags(&body, offset).ok_or_else(fault)??,
        }
        Ok(())
    }

    /// Flags that tell of data a reader has to know of.
    fn flags(&mut self, body: &[u8], offset: u64) -> Option<Result<(), Error>> {
        let mut bytes = Bytes::little(body);
        bytes.take(8)?;
        let incompatible = bytes.take(8)?;
        if incompatible[0] & !APPENDED != 0 || incompatible[1..].iter().any(|flags| *flags != 0) {
            return Some(Err(Error::encoding(
                offset,
                format!("ULog flags {incompatible:02x?}").as_bytes(),
            )));
        }
        if incompatible[0] & APPENDED != 0 {
            let offsets = [bytes.u64()?, bytes.u64()?, bytes.u64()?].into_iter();
            self.end = offsets.filter(|at| *at > 0).min().unwrap_or(u64::MAX);
        }
        Some(Ok(()))
    }
}
