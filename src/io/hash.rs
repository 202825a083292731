//! Fingerprints of inputs.

use super::source;
use std::io;
use std::path::Path;

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
