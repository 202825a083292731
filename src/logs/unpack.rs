//! Chunks and their compressions.

use crate::error::{Error, Fault};
use crate::input::Input;
use std::io::{self, Read};

/// Largest chunk (bytes); writers end theirs at a few MB.
const LARGEST_CHUNK: u64 = 256 << 20;

/// Chunk of a container: where it stands, and how it is packed.
pub(crate) struct Chunk {
    /// Byte of its first packed byte.
    pub(crate) offset: u64,
    /// Name of the compression in the file.
    pub(crate) compression: Vec<u8>,
    pub(crate) packed: u64,
    pub(crate) unpacked: u64,
    /// CRC of the unpacked bytes; 0 where there is none.
    pub(crate) crc: u32,
}

impl Chunk {
    /// Unpacks it: the input stands at its first byte.
    pub(crate) fn open(&self, input: &mut Input) -> Result<Input, Error> {
        if self.unpacked > LARGEST_CHUNK {
            let (bytes, limit) = (self.unpacked, LARGEST_CHUNK);
            return Err(Error::at(self.offset, Fault::TooLarge { bytes, limit }));
        }
        let packed = input.bytes(self.packed, LARGEST_CHUNK)?;
        let bytes = match self.compression.as_slice() {
            b"" | b"none" => packed,
            #[cfg(feature = "mcap")]
            b"zstd" => self.unpack(|| {
                ruzstd::decoding::StreamingDecoder::new(packed.as_slice()).map_err(io::Error::other)
            })?,
            b"lz4" => self.unpack(|| Ok(lz4_flex::frame::FrameDecoder::new(packed.as_slice())))?,
            #[cfg(feature = "bag")]
            b"bz2" => self.unpack(|| Ok(bzip2::read::MultiBzDecoder::new(packed.as_slice())))?,
            unknown => return Err(Error::encoding(self.offset, unknown)),
        };
        if bytes.len() as u64 != self.unpacked {
            return Err(Error::malformed(
                self.offset,
                "a chunk has not the length it states",
            ));
        }
        #[cfg(feature = "mcap")]
        match (self.crc, crc32fast::hash(&bytes)) {
            (0, _) => {}
            (stored, computed) if stored == computed => {}
            (stored, computed) => {
                return Err(Error::at(self.offset, Fault::Crc { stored, computed }));
            }
        }
        Ok(Input::chunk(bytes, self.offset))
    }

    /// Unpacks at most a byte more than the chunk states; memory grows with what is unpacked, not with what is stated.
    fn unpack<R: Read>(&self, decoder: impl FnOnce() -> io::Result<R>) -> Result<Vec<u8>, Error> {
        let fault = |error: io::Error| {
            Error::malformed(self.offset, format!("a chunk cannot be unpacked: {error}"))
        };
        let mut bytes = Vec::with_capacity(self.unpacked.min(8 * self.packed) as usize);
        decoder()
            .map_err(fault)?
            .take(self.unpacked + 1)
            .read_to_end(&mut bytes)
            .map_err(fault)?;
        Ok(bytes)
    }
}
