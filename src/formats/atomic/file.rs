//! A single output file.

use super::temporary::{self, Temporary};
use crate::formats::FileError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

const BUFFER: usize = 1 << 16;

/// A file under a temporary name until [`AtomicFile::commit`]; dropped before that, it leaves nothing.
///
/// A destination that exists and is no regular file (a pipe, `/dev/null`) is written directly; a symbolic
/// link is followed. Missing parent directories are made.
#[derive(Debug)]
pub(crate) struct AtomicFile {
    destination: PathBuf,
    temporary: Option<Temporary>,
    file: BufWriter<File>,
}

impl AtomicFile {
    /// Opens the temporary file beside `destination`.
    ///
    /// # Errors
    /// When the directory cannot be made or written to.
    pub(crate) fn create(destination: &Path) -> Result<Self, FileError> {
        let error = |e| FileError::unwritable(destination, e);
        let metadata = fs::metadata(destination).ok();
        if metadata.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(error(io::ErrorKind::IsADirectory.into()));
        }
        if metadata.is_some_and(|m| !m.is_file()) {
            let file = File::options()
                .write(true)
                .open(destination)
                .map_err(error)?;
            let file = BufWriter::with_capacity(BUFFER, file);
            return Ok(Self {
                destination: destination.into(),
                temporary: None,
                file,
            });
        }
        let destination = destination
            .canonicalize()
            .unwrap_or_else(|_| destination.into());
        make_parent(&destination).map_err(error)?;
        temporary::remove_abandoned(&destination);
        let (file, temporary) = Temporary::file(&destination).map_err(error)?;
        Ok(Self {
            destination,
            temporary: Some(temporary),
            file: BufWriter::with_capacity(BUFFER, file),
        })
    }

    /// Flushes to the disk and gives the file its name.
    ///
    /// # Errors
    /// When the disk is full or the rename is refused; nothing is left then.
    pub(crate) fn commit(mut self) -> Result<(), FileError> {
        self.finish()
            .map_err(|e| FileError::io(&self.destination, e))
    }

    fn finish(&mut self) -> io::Result<()> {
        self.file.flush()?;
        let Some(temporary) = &mut self.temporary else {
            return Ok(());
        };
        self.file.get_ref().sync_all()?;
        temporary.rename(&self.destination)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Makes the directory that `path` is to stand in.
pub(super) fn make_parent(path: &Path) -> io::Result<()> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => fs::create_dir_all(parent),
        _ => Ok(()),
    }
}
