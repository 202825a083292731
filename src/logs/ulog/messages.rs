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
    /// Bytes from which on data was appended, the next one last.
    appended: Vec<u64>,
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
            appended: Vec::new(),
        })
    }

    /// The next message of a topic: of any, or of one.
    pub(super) fn next_data(&mut self, only: Option<u32>) -> Result<Option<Data>, Error> {
        loop {
            if self.input.left() == 0 {
                return Ok(None);
            }
            let offset = self.input.position();
            if self.is_cut_at_appended(offset)? {
                continue;
            }
            let (size, kind) = (self.input.u16()?, self.input.u8()?);
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

    /// The last message before appended data may be cut off: goes on at that data.
    fn is_cut_at_appended(&mut self, offset: u64) -> Result<bool, Error> {
        let Some(next) = self.appended.last().copied() else {
            return Ok(false);
        };
        if offset >= next {
            self.appended.pop();
            return Ok(false);
        }
        let is_cut = offset + 3 > next || {
            let size = self.input.u16()?;
            self.input.seek(offset)?;
            offset + 3 + u64::from(size) > next
        };
        if is_cut {
            self.input.seek(next)?;
        }
        Ok(is_cut)
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
            let offsets = [bytes.u64()?, bytes.u64()?, bytes.u64()?];
            // one that lies behind the reader would send it in circles
            let within = |at: &u64| *at > self.input.position() && *at <= self.input.length();
            self.appended = offsets.into_iter().filter(within).collect();
            self.appended.sort_unstable_by(|a, b| b.cmp(a));
        }
        Some(Ok(()))
    }
}
