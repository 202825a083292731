//! A directory of outputs.

use super::file::make_parent;
use super::temporary::{self, Temporary};
use crate::formats::FileError;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A directory of outputs, built under a temporary name until [`AtomicDir::commit`]; dropped before that,
/// it leaves nothing.
///
/// If the destination exists (it may be a mount point, or hold files of the user), files of the same names are
/// replaced and others left alone. The file declared last (a manifest, say) vanishes first and appears last:
/// where it is, the rest is whole. Killed on the way, everything is still there, and [`recover`] finishes.
#[derive(Debug)]
pub(crate) struct AtomicDir {
    destination: PathBuf,
    staging: Temporary,
    names: Vec<String>,
}

/// In a directory whose files are being moved: their names, a line each, in the order they were declared.
const ORDER: &str = ".order";

impl AtomicDir {
    /// Makes the temporary directory, beside the destination or, if that exists, in it.
    ///
    /// # Errors
    /// When the destination is a file, or a directory cannot be made.
    pub(crate) fn create(destination: &Path) -> Result<Self, FileError> {
        let error = |e| FileError::unwritable(destination, e);
        let existing = fs::metadata(destination).ok();
        if existing.as_ref().is_some_and(|m| !m.is_dir()) {
            return Err(error(io::ErrorKind::NotADirectory.into()));
        }
        recover(destination);
        let inside = inside(destination);
        let path = if existing.is_some() {
            inside.as_path()
        } else {
            destination
        };
        make_parent(path).map_err(error)?;
        temporary::remove_abandoned(path);
        let staging = Temporary::directory(path).map_err(error)?;
        Ok(Self {
            destination: destination.into(),
            staging,
            names: Vec::new(),
        })
    }

    /// Declares a file and returns the path to write it at for now.
    pub(crate) fn path(&mut self, name: &str) -> PathBuf {
        if !self.names.iter().any(|n| n == name) {
            self.names.push(name.to_owned());
        }
        self.staging.path().join(name)
    }

    /// Writes a whole small file.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write(
        &mut self,
        name: &str,
        contents: impl AsRef<[u8]>,
    ) -> Result<(), FileError> {
        self.write_parts(name, [contents])
    }

    /// Writes a file part by part.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write_parts(
        &mut self,
        name: &str,
        parts: impl IntoIterator<Item = impl AsRef<[u8]>>,
    ) -> Result<(), FileError> {
        let path = self.path(name);
        let write = || {
            let mut file = std::io::BufWriter::new(File::create(&path)?);
            parts
                .into_iter()
                .try_for_each(|part| file.write_all(part.as_ref()))?;
            file.flush()
        };
        write().map_err(|e| FileError::io(&self.destination.join(name), e))
    }

    /// Flushes the declared files to the disk and gives them their names.
    ///
    /// # Errors
    /// When a declared file was not written, the disk is full, or a rename is refused.
    pub(crate) fn commit(mut self) -> Result<(), FileError> {
        for name in &self.names {
            flush(&self.staging.path().join(name))
                .map_err(|e| FileError::io(&self.destination.join(name), e))?;
        }
        let moved = if self.destination.is_dir() {
            self.replace()
        } else {
            self.staging.rename(&self.destination)
        };
        moved.map_err(|e| FileError::io(&self.destination, e))
    }

    /// From the first rename on the new files are the ones that count: who is killed later leaves a directory
    /// that [`recover`] takes further, so that no instant has neither the old files nor the new ones.
    fn replace(&mut self) -> io::Result<()> {
        let mut order = File::create(self.staging.path().join(ORDER))?;
        order.write_all(self.names.join("\n").as_bytes())?;
        order.sync_all()?;
        // Windows renames no directory in which a file is open
        drop(order);
        let name = self.staging.path().with_extension(temporary::MOVING);
        let moving = self.destination.join(name.file_name().unwrap_or_default());
        self.staging.rename(&moving)?;
        move_files(&moving, &self.destination)
    }
}

/// Has the disk take a file that was written. Windows flushes through a handle for writing only.
fn flush(path: &Path) -> io::Result<()> {
    File::options()
        .read(true)
        .write(cfg!(windows))
        .open(path)?
        .sync_all()
}

/// What temporary directories in `destination` are named after.
fn inside(destination: &Path) -> PathBuf {
    destination.join("out")
}

/// Finishes what a writer of this directory had begun to put in place when it was killed. What cannot be
/// finished (in a directory that may not be written to, say) stays as it is.
pub(crate) fn recover(destination: &Path) {
    for (moving, held) in temporary::abandoned(&inside(destination), temporary::MOVING) {
        let _ = move_files(&moving, destination);
        drop(held);
    }
}

/// Moves files to their places and removes the directory they were in. May be done again from any point.
fn move_files(moving: &Path, destination: &Path) -> io::Result<()> {
    let _interrupts_wait = temporary::unfinished();
    let order = match fs::read_to_string(moving.join(ORDER)) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => String::new(), // all moved, the rest being removed
        order => order?,
    };
    let mut names = order
        .lines()
        .filter(|name| moving.join(name).exists())
        .peekable();
    if let (Some(_), Some(last)) = (names.peek(), order.lines().last()) {
        match step(|| fs::remove_file(destination.join(last))) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => {}
        }
    }
    for name in names {
        step(|| fs::rename(moving.join(name), destination.join(name)))?;
    }
    step(|| fs::remove_dir_all(moving))
}

/// A change of the file system; tests are killed before one of them.
fn step(change: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
    #[cfg(test)]
    kill::before_step()?;
    change()
}

/// Tests' way to be killed while files are moved.
#[cfg(test)]
pub(super) mod kill {
    use std::cell::Cell;
    use std::io;

    thread_local! {
        static STEPS_LEFT: Cell<usize> = const { Cell::new(usize::MAX) };
    }

    /// Lets this thread take so many steps more.
    pub(in crate::formats::atomic) fn after(steps: usize) {
        STEPS_LEFT.set(steps);
    }

    pub(super) fn before_step() -> io::Result<()> {
        match STEPS_LEFT.get() {
            0 => Err(io::Error::other("killed")),
            n => {
                STEPS_LEFT.set(n - 1);
                Ok(())
            }
        }
    }
}
