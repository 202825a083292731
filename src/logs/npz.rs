//! Arrays of NumPy in a zip archive (PKWARE APPNOTE 6.3.10, 4.3), as `numpy.savez` and `numpy.savez_compressed` write them.
//!
//! ```
//! # fn main() -> Result<(), nav_sim_logs::Error> {
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/arrays.npz");
//! let archive = nav_sim_logs::npz::Archive::open(path.as_ref())?;
//! assert!(archive.names().any(|name| name == "gyro"));
//! let gyro = archive.read("gyro")?;
//! assert_eq!(gyro.shape, [40, 3]);
//! let second_row = &gyro.values[3..6];
//! # assert_eq!(second_row.len(), 3);
//! # Ok(())
//! # }
//! ```

use crate::bytes::{Bytes, text};
use crate::error::{Error, Fault};
use crate::input::{Input, Origin};
use crate::npy::{self, Array};
use flate2::read::DeflateDecoder;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;

/// Largest array that is read (bytes).
const LARGEST_ARRAY: u64 = 8 << 30;

/// Archive whose arrays are known by name.
#[derive(Debug)]
pub struct Archive {
    origin: Origin,
    entries: Vec<Entry>,
}

impl Archive {
    /// Opens a file.
    ///
    /// # Errors
    /// When it is no zip archive, or its directory is damaged.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::new(Origin::File(path.to_owned()))
    }

    /// Opens a file that is held.
    ///
    /// # Errors
    /// Those of [`Self::open`].
    pub fn from_bytes(bytes: impl Into<Arc<[u8]>>) -> Result<Self, Error> {
        Self::new(Origin::Bytes(bytes.into()))
    }

    fn new(origin: Origin) -> Result<Self, Error> {
        let entries = entries(&mut origin.open()?)?;
        Ok(Self { origin, entries })
    }

    /// Names of the arrays, in the order of the archive.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.name.as_str())
    }

    /// Reads an array of numbers.
    ///
    /// # Errors
    /// When there is none of that name, or it is damaged or not of numbers.
    pub fn read(&self, name: &str) -> Result<Array, Error> {
        let entry = self
            .entries
            .iter()
            .find(|entry| entry.name == name)
            .ok_or_else(|| Error::NoTopic {
                what: format!("the name {name}"),
                topics: self.names().map(str::to_owned).collect(),
            })?;
        self.array(entry).map_err(|error| error.of_topic(name))
    }

    fn array(&self, entry: &Entry) -> Result<Array, Error> {
        if entry.unpacked > LARGEST_ARRAY {
            let (bytes, limit) = (entry.unpacked, LARGEST_ARRAY);
            return Err(Error::at(entry.offset, Fault::TooLarge { bytes, limit }));
        }
        let mut input = self.origin.open()?;
        let offset = entry.data_offset(&mut input)?;
        input.expect(entry.packed)?;
        let packed = input.take(entry.packed);
        match entry.method {
            STORED => checked(packed, entry, offset),
            DEFLATED => checked(DeflateDecoder::new(packed), entry, offset),
            other => Err(Error::encoding(
                offset,
                format!("zip method {other}").as_bytes(),
            )),
        }
    }
}

/// Reads an array, and checks the CRC of all its bytes.
fn checked(unpacked: impl Read, entry: &Entry, offset: u64) -> Result<Array, Error> {
    let mut summed = Summed {
        inner: unpacked.take(entry.unpacked),
        crc: crc32fast::Hasher::new(),
    };
    let array = npy::read_from(&mut summed, entry.unpacked, offset)?;
    let (stored, computed) = (entry.crc, summed.crc.finalize());
    if stored == computed {
        Ok(array)
    } else {
        Err(Error::at(offset, Fault::Crc { stored, computed }))
    }
}

/// Bytes whose CRC is computed as they are read.
struct Summed<R> {
    inner: R,
    crc: crc32fast::Hasher,
}

impl<R: Read> Read for Summed<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(into)?;
        self.crc.update(&into[..count]);
        Ok(count)
    }
}

/// Methods of compression.
const STORED: u16 = 0;
const DEFLATED: u16 = 8;

/// Bytes of the record at the end, and of the longest comment behind it.
const END: u64 = 22;
const LONGEST_COMMENT: u64 = u16::MAX as u64;
/// Largest directory (bytes).
const LARGEST_DIRECTORY: u64 = 16 << 20;

/// File of an archive.
#[derive(Debug)]
struct Entry {
    name: String,
    method: u16,
    crc: u32,
    packed: u64,
    unpacked: u64,
    offset: u64,
}

impl Entry {
    /// Byte of its data, behind a header of its own; the input stands there.
    fn data_offset(&self, input: &mut Input) -> Result<u64, Error> {
        if self.offset > input.length() {
            return Err(Error::malformed(
                self.offset,
                "an entry lies beyond the end of the archive",
            ));
        }
        input.seek(self.offset)?;
        let header: [u8; 30] = input.array()?;
        if !header.starts_with(b"PK\x03\x04") {
            return Err(Error::malformed(
                self.offset,
                "no entry where the directory has one",
            ));
        }
        let length = |at: usize| u64::from(u16::from_le_bytes([header[at], header[at + 1]]));
        input.skip(length(26) + length(28))?;
        Ok(input.position())
    }
}

/// Arrays of an archive, by their names without `.npy`.
fn entries(input: &mut Input) -> Result<Vec<Entry>, Error> {
    let (offset, size) = directory(input)?;
    input.seek(offset.min(input.length()))?;
    let all = input.bytes(size, LARGEST_DIRECTORY)?;
    let mut bytes = Bytes::little(&all);
    let mut entries = Vec::new();
    while let Some(signature) = bytes.take(4) {
        let fault = || Error::malformed(offset, "the directory of the archive does not parse");
        if signature != b"PK\x01\x02" {
            return Err(fault());
        }
        let mut entry = entry(&mut bytes).ok_or_else(fault)?;
        if let Some(name) = entry.name.strip_suffix(".npy") {
            entry.name = name.to_owned();
            entries.push(entry);
        }
    }
    Ok(entries)
}

/// Offset and size of the directory, from the record at the end.
fn directory(input: &mut Input) -> Result<(u64, u64), Error> {
    let length = input.length();
    let start = length.saturating_sub(END + LONGEST_COMMENT);
    input.seek(start)?;
    let tail = input.bytes(length - start, END + LONGEST_COMMENT)?;
    let missing = || Error::at(length, Fault::StillWritten);
    let at = tail
        .windows(4)
        .rposition(|w| w == b"PK\x05\x06")
        .ok_or_else(missing)?;
    let mut bytes = Bytes::little(&tail[at + 4..]);
    let mut parse = || {
        bytes.take(8)?;
        Some((bytes.u32()?, bytes.u32()?))
    };
    let (size, offset) = parse().ok_or_else(missing)?;
    if offset != u32::MAX && size != u32::MAX {
        return Ok((offset.into(), size.into()));
    }
    // the locator of the longer record stands before this one
    let locator = at
        .checked_sub(20)
        .map(|from| &tail[from..at])
        .filter(|l| l.starts_with(b"PK\x06\x07"));
    let place = locator
        .and_then(|l| Bytes::little(&l[8..]).u64())
        .ok_or_else(missing)?;
    input.seek(place.min(length))?;
    let long: [u8; 56] = input.array()?;
    let mut bytes = Bytes::little(&long[40..]);
    let (size, offset) = (bytes.u64().unwrap_or(0), bytes.u64().unwrap_or(0));
    Ok((offset, size))
}

/// An entry behind its signature.
fn entry(bytes: &mut Bytes<'_>) -> Option<Entry> {
    bytes.take(6)?;
    let method = bytes.u16()?;
    bytes.take(4)?;
    let crc = bytes.u32()?;
    let (packed, unpacked) = (bytes.u32()?, bytes.u32()?);
    let [name, extra, comment] = [bytes.u16()?, bytes.u16()?, bytes.u16()?].map(usize::from);
    bytes.take(8)?;
    let offset = bytes.u32()?;
    let name = text(bytes.take(name)?);
    let extra = bytes.take(extra)?;
    bytes.take(comment)?;
    // what does not fit 32 bits stands in the extra field, in this order
    let mut long = long_sizes(extra);
    let mut size = |short: u32| {
        if short == u32::MAX {
            long.as_mut().and_then(Bytes::u64).unwrap_or(u64::MAX)
        } else {
            short.into()
        }
    };
    let (unpacked, packed, offset) = (size(unpacked), size(packed), size(offset));
    Some(Entry {
        name,
        method,
        crc,
        packed,
        unpacked,
        offset,
    })
}

/// The extra field of sizes of 64 bits.
fn long_sizes(extra: &[u8]) -> Option<Bytes<'_>> {
    const LONG: u16 = 1;
    let mut bytes = Bytes::little(extra);
    loop {
        let (kind, size) = (bytes.u16()?, bytes.u16()?);
        let field = bytes.take(size.into())?;
        if kind == LONG {
            return Some(Bytes::little(field));
        }
    }
}
