//! Opens inputs: keeps those that can be read only once, refuses those without end.

use super::Failure;
use flate2::read::MultiGzDecoder;
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Largest text that is read whole for its structure (TOML, JSON, curves): bytes.
const LARGEST_TEXT: u64 = 64 << 20;
/// Largest contents of a pipe or device (bytes).
const LARGEST_PIPE: u64 = 256 << 20;

/// First bytes of what stands for a large file in a repository that was cloned without it.
const POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";

/// Opens an input. A pipe gives its bytes once: they are kept, so that it reads, and hashes, the same again.
///
/// # Errors
/// When the system refuses, a pipe or device has more than 256 MiB, or a file is a pointer of Git LFS.
pub(crate) fn open(path: &Path) -> io::Result<Box<dyn Read>> {
    static KEPT: Mutex<Option<HashMap<PathBuf, Arc<[u8]>>>> = Mutex::new(None);
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    let kept = kept.get_or_insert_default();
    if let Some(bytes) = kept.get(path) {
        return Ok(Box::new(Cursor::new(Arc::clone(bytes))));
    }
    let mut file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Ok(Box::new(file));
    }
    if metadata.is_file() {
        let mut first = Vec::new();
        file.by_ref()
            .take(POINTER.len() as u64)
            .read_to_end(&mut first)?;
        if first == POINTER {
            let message = "a Git LFS pointer, not the file itself";
            return Err(io::Error::new(ErrorKind::Unsupported, message));
        }
        file.rewind()?;
        return Ok(Box::new(file));
    }
    let bytes: Arc<[u8]> = bounded(file, LARGEST_PIPE)?.into();
    kept.insert(path.to_owned(), Arc::clone(&bytes));
    Ok(Box::new(Cursor::new(bytes)))
}

/// Bytes that are read at once.
const BUFFER: usize = 1 << 17;
/// Largest ratio of the unpacked size of a table to its packed size, beyond [`LARGEST_PIPE`]:
/// measurements pack to a third to a twentieth, and gzip expands zeros up to 1032 times.
const MOST_PACKED: u64 = 40;

/// Opens a table of text, unpacking it when its name ends in `.gz`.
///
/// # Errors
/// When the system refuses.
pub(crate) fn table(path: &Path) -> io::Result<Box<dyn BufRead>> {
    let file = BufReader::with_capacity(BUFFER, open(path)?);
    if path
        .extension()
        .is_none_or(|e| !e.eq_ignore_ascii_case("gz"))
    {
        return Ok(Box::new(file));
    }
    let packed = std::fs::metadata(path)?.len();
    let largest = LARGEST_PIPE.max(packed.saturating_mul(MOST_PACKED));
    let inner = MultiGzDecoder::new(file).take(largest);
    let unpacked = UnpackedReader { inner, largest };
    Ok(Box::new(BufReader::with_capacity(BUFFER, unpacked)))
}

/// Bytes read to recognise a file.
const HEAD: u64 = 1 << 20;

/// The beginning of a file as text, unpacked when its name ends in `.gz`.
///
/// # Errors
/// When the system refuses.
pub(crate) fn head(path: &Path) -> io::Result<String> {
    lossy(path, HEAD)
}

/// The first `most` bytes of a table as text, invalid UTF-8 replaced.
fn lossy(path: &Path, most: u64) -> io::Result<String> {
    let mut bytes = Vec::new();
    table(path)?.take(most).read_to_end(&mut bytes)?;
    Ok(without_mark(String::from_utf8_lossy(&bytes).into_owned()))
}

/// Limits the size of an unpacked table: a small file may unpack to any.
struct UnpackedReader<R> {
    inner: io::Take<R>,
    largest: u64,
}

impl<R: Read> Read for UnpackedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        if self.inner.limit() == 0 {
            let message = format!("unpacks to more than {} MiB", self.largest >> 20);
            return Err(io::Error::new(ErrorKind::InvalidData, message));
        }
        Ok(count)
    }
}

/// The whole text of a table, unpacked when its name ends in `.gz`; what is not UTF-8 in it (a degree sign of another
/// encoding) is replaced.
///
/// # Errors
/// When the system refuses.
pub(crate) fn table_text(path: &Path) -> Result<String, Failure> {
    lossy(path, u64::MAX).map_err(|e| Failure::io(path, e))
}

/// A text of at most 64 MiB, unpacked when its name ends in `.gz`.
///
/// # Errors
/// When the system refuses, the text is longer, or it is not UTF-8 (names the line of the first invalid byte).
pub(crate) fn text(path: &Path) -> io::Result<String> {
    String::from_utf8(bounded(table(path)?, LARGEST_TEXT)?)
        .map(without_mark)
        .map_err(|e| {
            let line = 1 + e.as_bytes()[..e.utf8_error().valid_up_to()]
                .iter()
                .filter(|b| **b == b'\n')
                .count();
            io::Error::new(
                ErrorKind::InvalidData,
                format!("line {line} is not text in UTF-8"),
            )
        })
}

/// A text without the byte-order mark that editors of some systems begin it with.
pub(crate) fn without_mark(text: String) -> String {
    text.strip_prefix('\u{feff}')
        .map(str::to_owned)
        .unwrap_or(text)
}

fn bounded(reader: impl Read, largest: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.take(largest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > largest {
        let message = format!("more than {} MiB, or endless", largest >> 20);
        return Err(io::Error::new(ErrorKind::FileTooLarge, message));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::is_damage;

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
        assert_eq!(e.to_string(), "more than 256 MiB, or endless");
        assert!(is_damage(e.kind()));
    }

    /// A table comes out as it went in; what is beyond measure is refused.
    #[test]
    fn what_a_packed_table_holds_is_bounded() {
        let unpacked = |text: &[u8], largest: u64| {
            let mut out = Vec::new();
            let inner = Cursor::new(text).take(largest);
            let read = UnpackedReader { inner, largest }.read_to_end(&mut out);
            read.map(|_| out).map_err(|e| e.to_string())
        };
        let rows: Vec<u8> = (0..9000)
            .flat_map(|k| format!("{k},{}\n", k % 7).into_bytes())
            .collect();
        assert_eq!(unpacked(&rows, 1 << 20).unwrap(), rows);
        assert_eq!(unpacked(b"a\nb", 1 << 20).unwrap(), b"a\nb");
        assert_eq!(
            unpacked(&rows, 1 << 10).unwrap_err(),
            "unpacks to more than 0 MiB"
        );
    }

    #[test]
    fn a_pipe_reads_the_same_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("pipe");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&path)
                .status()
                .unwrap()
                .success()
        );
        let writer = std::thread::spawn({
            let path = path.clone();
            move || std::fs::write(path, "a = 1\n").unwrap()
        });
        assert_eq!(text(&path).unwrap(), "a = 1\n");
        writer.join().unwrap();
        assert_eq!(text(&path).unwrap(), "a = 1\n");
        let hash = crate::io::input::input("a", &path)
            .map(|found| found.blake3)
            .unwrap();
        assert_eq!(hash, blake3::hash(b"a = 1\n").to_hex().to_string());
    }
}
