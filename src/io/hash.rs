//! Fingerprints of inputs.

use super::source;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex};

/// Digests of the texts that were read, by path: what was used is what is recorded, though the file change or be a pipe that
/// can be read once only.
static READ: LazyLock<Mutex<HashMap<PathBuf, String>>> = LazyLock::new(Mutex::default);

/// Remembers the digest of a text that was read.
pub(crate) fn remember(path: &Path, contents: &[u8]) {
    if let Ok(mut read) = READ.lock() {
        read.insert(path.to_owned(), of_bytes(contents));
    }
}

/// BLAKE3 in hexadecimal of the bytes that this process last read of a TOML file; of another file, or one it has not read, of
/// its bytes now.
///
/// # Errors
/// When the system refuses.
pub(crate) fn as_read(path: &Path) -> io::Result<String> {
    let known = READ.lock().ok().and_then(|read| read.get(path).cloned());
    known.map_or_else(|| of_file(path), Ok)
}

/// BLAKE3 of a file's bytes, in hexadecimal, whatever its size.
///
/// # Errors
/// When the system refuses.
pub(crate) fn of_file(path: &Path) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(source::open(path)?)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// BLAKE3 of bytes, in hexadecimal.
pub(crate) fn of_bytes(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// BLAKE3 of samples, in hexadecimal.
pub(crate) fn samples(samples: &[f64]) -> String {
    let mut hasher = blake3::Hasher::new();
    for block in samples.chunks(4096) {
        let bytes: Vec<u8> = block.iter().flat_map(|x| x.to_le_bytes()).collect();
        hasher.update(&bytes);
    }
    hasher.finalize().to_hex().to_string()
}
