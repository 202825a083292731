//! Where inputs are opened: what can be read once only is kept, what has no end is refused.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Cursor, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Largest text that is read whole for its structure (TOML, JSON, curves): bytes.
const LARGEST_TEXT: u64 = 64 << 20;
/// Largest contents of a pipe or device (bytes).
const LARGEST_PIPE: u64 = 256 << 20;

/// Opens an input. A pipe gives its bytes once: they are kept, so that it reads, and hashes, the same again.
///
/// # Errors
/// When the system refuses, or a pipe or device has more than 256 MiB.
pub(crate) fn open(path: &Path) -> io::Result<Box<dyn Read>> {
    static KEPT: Mutex<Option<HashMap<PathBuf, Arc<[u8]>>>> = Mutex::new(None);
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    let kept = kept.get_or_insert_default();
    if let Some(bytes) = kept.get(path) {
        return Ok(Box::new(Cursor::new(Arc::clone(bytes))));
    }
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_file() || metadata.is_dir() {
        return Ok(Box::new(file));
    }
    let bytes: Arc<[u8]> = bounded(file, LARGEST_PIPE)?.into();
    kept.insert(path.to_owned(), Arc::clone(&bytes));
    Ok(Box::new(Cursor::new(bytes)))
}

/// A text of at most 64 MiB.
///
/// # Errors
/// When the system refuses, it is longer, or it is not UTF-8 ([`is_damage`]): with the line.
pub(crate) fn text(path: &Path) -> io::Result<String> {
    String::from_utf8(bounded(open(path)?, LARGEST_TEXT)?).map_err(|e| {
        let line = 1 + e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count();
        io::Error::new(ErrorKind::InvalidData, format!("line {line} is not text in UTF-8"))
    })
}

fn bounded(reader: impl Read, largest: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.take(largest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > largest {
        let message = format!("more than {} MiB, or without an end", largest >> 20);
        return Err(io::Error::new(ErrorKind::FileTooLarge, message));
    }
    Ok(bytes)
}

/// Whether an error of the system is one of the contents: no text, no compressed data, cut off, too long.
pub(crate) const fn is_damage(kind: ErrorKind) -> bool {
    use ErrorKind as K;
    matches!(kind, K::InvalidData | K::InvalidInput | K::UnexpectedEof | K::FileTooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_that_is_none_is_refused_with_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.toml");
        std::fs::write(&path, b"a = 1\nb = \"\xe9\"\n").unwrap();
        let e = text(&path).unwrap_err();
        assert_eq!(e.to_string(), "line 2 is not text in UTF-8");
        assert!(is_damage(e.kind()));
    }

    #[test]
    fn what_has_no_end_is_refused() {
        let e = text(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(e.to_string(), "more than 256 MiB, or without an end");
        assert!(is_damage(e.kind()));
    }

    #[test]
    fn a_pipe_reads_the_same_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let writer = std::thread::spawn({
            let path = path.clone();
            move || std::fs::write(path, "a = 1\n").unwrap()
        });
        assert_eq!(text(&path).unwrap(), "a = 1\n");
        writer.join().unwrap();
        assert_eq!(text(&path).unwrap(), "a = 1\n");
        let hash = crate::formats::hash::of_file(&path).unwrap();
        assert_eq!(hash, blake3::hash(b"a = 1\n").to_hex().to_string());
    }
}
