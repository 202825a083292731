//! Bytes of a log, with their offsets.

use crate::error::{Error, Fault};
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes that are read at once.
const BUFFER: usize = 1 << 16;

trait Source: Read + Seek + Send {}
impl<T: Read + Seek + Send> Source for T {}

/// Bytes to be read in order, with seeking.
pub(crate) struct Input {
    source: BufReader<Box<dyn Source>>,
    position: u64,
    length: u64,
    /// Byte of the file where the chunk stands whose unpacked bytes these are.
    chunk: Option<u64>,
}

impl Input {
    fn new(source: Box<dyn Source>, length: u64, chunk: Option<u64>) -> Self {
        Self {
            source: BufReader::with_capacity(BUFFER, source),
            position: 0,
            length,
            chunk,
        }
    }

    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self::new(Box::new(file), length, None))
    }

    /// The unpacked bytes of a chunk.
    pub(crate) fn chunk(bytes: Vec<u8>, offset: u64) -> Self {
        let length = bytes.len() as u64;
        Self::new(Box::new(Cursor::new(bytes)), length, Some(offset))
    }

    pub(crate) const fn position(&self) -> u64 {
        self.position
    }

    pub(crate) const fn length(&self) -> u64 {
        self.length
    }

    pub(crate) const fn left(&self) -> u64 {
        self.length.saturating_sub(self.position)
    }

    /// Byte of the file.
    pub(crate) fn offset(&self) -> u64 {
        self.chunk.unwrap_or(self.position)
    }

    /// Holds when so many bytes are there.
    pub(crate) fn expect(&self, needed: u64) -> Result<(), Error> {
        let left = self.left();
        match self.chunk {
            _ if needed <= left => Ok(()),
            None => Err(Error::at(self.position, Fault::Truncated { needed, left })),
            Some(chunk) => Err(Error::malformed(chunk, "a record goes beyond its chunk")),
        }
    }

    pub(crate) fn skip(&mut self, bytes: u64) -> Result<(), Error> {
        self.expect(bytes)?;
        self.seek(self.position + bytes)
    }

    pub(crate) fn seek(&mut self, position: u64) -> Result<(), Error> {
        match position.checked_signed_diff(self.position) {
            Some(step) => self.source.seek_relative(step)?,
            None => _ = self.source.seek(SeekFrom::Start(position))?,
        }
        self.position = position;
        Ok(())
    }

    fn fill(&mut self, into: &mut [u8]) -> Result<(), Error> {
        self.expect(into.len() as u64)?;
        self.source.read_exact(into)?;
        self.position += into.len() as u64;
        Ok(())
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, Error> {
        Ok(self.array::<1>()?[0])
    }

    pub(crate) fn u16(&mut self) -> Result<u16, Error> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Error> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Error> {
        self.array().map(u64::from_le_bytes)
    }

    /// So many bytes, which are there and not too many: both are known before anything is allocated.
    pub(crate) fn bytes(&mut self, count: u64, limit: u64) -> Result<Vec<u8>, Error> {
        self.expect(count)?;
        if count > limit {
            let bytes = count;
            return Err(Error::at(self.offset(), Fault::TooLarge { bytes, limit }));
        }
        let mut bytes = vec![0; count as usize];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    /// The bytes from here on, as many as there are or so many.
    pub(crate) fn take(self, bytes: u64) -> impl Read {
        self.source.take(bytes)
    }
}
