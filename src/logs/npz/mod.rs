//! Arrays of NumPy in a zip archive, as `numpy.savez` and `numpy.savez_compressed` write them.
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

mod array;
mod directory;

pub use array::Array;

use crate::error::{Error, Place};
use crate::input::Origin;
use directory::{Entry, entries};
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
            return Err(Error::TooLarge {
                place: Place::byte(entry.offset),
                bytes,
                limit,
            });
        }
        let mut input = self.origin.open()?;
        let offset = entry.data_offset(&mut input)?;
        input.expect(entry.packed)?;
        let packed = input.take(entry.packed);
        match entry.method {
            directory::STORED => checked(packed, entry, offset),
            directory::DEFLATED => checked(DeflateDecoder::new(packed), entry, offset),
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
    let array = array::read(&mut summed, entry.unpacked, offset)?;
    let (stored, computed) = (entry.crc, summed.crc.finalize());
    if stored == computed {
        Ok(array)
    } else {
        Err(Error::Crc {
            place: Place::byte(offset),
            stored,
            computed,
        })
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
