//! Directory of a zip archive (PKWARE APPNOTE 6.3.10, 4.3).

use crate::bytes::{Bytes, text};
use crate::error::{Error, Place};
use crate::input::Input;

/// Methods of compression.
pub(super) const STORED: u16 = 0;
pub(super) const DEFLATED: u16 = 8;

/// Bytes of the record at the end, and of the longest comment behind it.
const END: u64 = 22;
const LONGEST_COMMENT: u64 = u16::MAX as u64;
/// Largest directory (bytes).
const LARGEST_DIRECTORY: u64 = 16 << 20;

/// File of an archive.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) method: u16,
    pub(super) crc: u32,
    pub(super) packed: u64,
    pub(super) unpacked: u64,
    pub(super) offset: u64,
}

impl Entry {
    /// Byte of its data, behind a header of its own; the input stands there.
    pub(super) fn data_offset(&self, input: &mut Input) -> Result<u64, Error> {
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
pub(super) fn entries(input: &mut Input) -> Result<Vec<Entry>, Error> {
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
    let missing = || Error::StillWritten {
        place: Place::byte(length),
    };
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
