//! Outputs that appear whole or not at all: written under a temporary name in the same directory, flushed
//! to the disk, then renamed.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// An output that could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The system refused: no space, no permission, no such directory, …
    #[error("{path}: {source}")]
    Io {
        /// The output.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// The output is one of the inputs.
    #[error("{path} is an input of this command and would be overwritten")]
    OverInput {
        /// The output.
        path: String,
    },
    /// The output's directory holds files that would be taken for outputs of this command.
    #[error("{path} already holds {stale}, which this command would leave beside its own outputs")]
    Stale {
        /// The directory.
        path: String,
        /// A file in it.
        stale: String,
    },
}

impl WriteError {
    /// With the path it happened to.
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.display().to_string(), source }
    }

    /// Whether the user's request is at fault (rather than the machine).
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        !matches!(self, Self::Io { .. })
    }

    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::OverInput { .. } => Some("choose another output with --out".into()),
            Self::Stale { .. } => Some("remove it, or choose another directory with --out".into()),
            Self::Io { .. } => None,
        }
    }
}

/// Refuses an output that is one of the inputs, under whatever name.
///
/// # Errors
/// [`WriteError::OverInput`].
pub fn guard_inputs<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), WriteError> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    let hit = inputs.into_iter().any(|i| i.canonicalize().is_ok_and(|i| i == target));
    if hit { Err(WriteError::OverInput { path: output.display().to_string() }) } else { Ok(()) }
}

/// A file under a temporary name until [`AtomicFile::commit`]; dropped before that, it leaves nothing.
///
/// A destination that exists and is no regular file (a pipe, `/dev/null`) is written directly; a symbolic
/// link is followed. Missing parent directories are made.
#[derive(Debug)]
pub struct AtomicFile {
    destination: PathBuf,
    temporary: Option<PathBuf>,
    file: BufWriter<File>,
}

impl AtomicFile {
    /// Opens the temporary file beside `destination`.
    ///
    /// # Errors
    /// When the directory cannot be made or written to.
    pub fn create(destination: &Path) -> Result<Self, WriteError> {
        let error = |e| WriteError::io(destination, e);
        let metadata = fs::metadata(destination).ok();
        if metadata.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(error(io::ErrorKind::IsADirectory.into()));
        }
        if metadata.is_some_and(|m| !m.is_file()) {
            let file = File::options().write(true).open(destination).map_err(error)?;
            let file = BufWriter::with_capacity(BUFFER, file);
            return Ok(Self { destination: destination.into(), temporary: None, file });
        }
        let destination = destination.canonicalize().unwrap_or_else(|_| destination.into());
        make_parent(&destination).map_err(error)?;
        remove_abandoned(&destination);
        let (file, temporary) = create_temporary(&destination).map_err(error)?;
        let _ = file.try_lock(); // until it is closed: see `hold`
        Ok(Self { destination, temporary: Some(temporary), file: BufWriter::with_capacity(BUFFER, file) })
    }

    /// Where the file will appear.
    #[must_use]
    pub fn destination(&self) -> &Path {
        &self.destination
    }

    /// Flushes to the disk and gives the file its name.
    ///
    /// # Errors
    /// When the disk is full or the rename is refused; nothing is left then.
    pub fn commit(mut self) -> Result<(), WriteError> {
        self.finish().map_err(|e| WriteError::io(&self.destination, e))
    }

    fn finish(&mut self) -> io::Result<()> {
        self.file.flush()?;
        let Some(temporary) = &self.temporary else { return Ok(()) };
        self.file.get_ref().sync_all()?;
        fs::rename(temporary, &self.destination)?;
        self.temporary = None;
        Ok(())
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

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            let _ = fs::remove_file(temporary);
        }
    }
}

/// Writes a whole file.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub fn write(destination: &Path, contents: impl AsRef<[u8]>) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(destination)?;
    file.write_all(contents.as_ref()).map_err(|e| WriteError::io(destination, e))?;
    file.commit()
}

/// A directory of outputs, built under a temporary name until [`AtomicDir::commit`]; dropped before that,
/// it leaves nothing.
///
/// If the destination exists, files of the same names are replaced and others left alone. The file
/// declared last (a manifest, say) vanishes first and appears last: where it is, the rest is whole.
#[derive(Debug)]
pub struct AtomicDir {
    destination: PathBuf,
    staging: PathBuf,
    names: Vec<String>,
    committed: bool,
    /// Held until the directory has its name, or is gone.
    _lock: Option<File>,
}

impl AtomicDir {
    /// Makes the temporary directory, beside the destination or, if that exists, in it.
    ///
    /// # Errors
    /// When the destination is a file, or a directory cannot be made.
    pub fn create(destination: &Path) -> Result<Self, WriteError> {
        let error = |e| WriteError::io(destination, e);
        let existing = fs::metadata(destination).ok();
        if existing.as_ref().is_some_and(|m| !m.is_dir()) {
            return Err(error(io::ErrorKind::NotADirectory.into()));
        }
        let inside = destination.join("out");
        let path = if existing.is_some() { inside.as_path() } else { destination };
        make_parent(path).map_err(error)?;
        remove_abandoned(path);
        let staging = temporary_name(path);
        fs::create_dir(&staging).map_err(error)?;
        let lock = hold(&staging);
        Ok(Self {
            destination: destination.into(),
            staging,
            names: Vec::new(),
            committed: false,
            _lock: lock,
        })
    }

    /// Declares a file and returns the path to write it at for now.
    pub fn path(&mut self, name: &str) -> PathBuf {
        if !self.names.iter().any(|n| n == name) {
            self.names.push(name.to_owned());
        }
        self.staging.join(name)
    }

    /// Writes a whole small file.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn write(&mut self, name: &str, contents: impl AsRef<[u8]>) -> Result<(), WriteError> {
        self.write_parts(name, [contents])
    }

    /// Writes a file part by part.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn write_parts(
        &mut self,
        name: &str,
        parts: impl IntoIterator<Item = impl AsRef<[u8]>>,
    ) -> Result<(), WriteError> {
        let path = self.path(name);
        let write = || {
            let mut file = std::io::BufWriter::new(File::create(&path)?);
            parts.into_iter().try_for_each(|part| file.write_all(part.as_ref()))?;
            file.flush()
        };
        write().map_err(|e| WriteError::io(&self.destination.join(name), e))
    }

    /// Where the directory will appear.
    #[must_use]
    pub fn destination(&self) -> &Path {
        &self.destination
    }

    /// Flushes the declared files to the disk and gives them their names.
    ///
    /// # Errors
    /// When a declared file was not written, the disk is full, or a rename is refused.
    pub fn commit(mut self) -> Result<(), WriteError> {
        for name in &self.names {
            let sync = File::open(self.staging.join(name)).and_then(|f| f.sync_all());
            sync.map_err(|e| WriteError::io(&self.destination.join(name), e))?;
        }
        let moved = if self.destination.is_dir() {
            self.move_files()
        } else {
            fs::rename(&self.staging, &self.destination)
        };
        moved.map_err(|e| WriteError::io(&self.destination, e))?;
        self.committed = true;
        Ok(())
    }

    fn move_files(&self) -> io::Result<()> {
        for name in self.names.iter().rev() {
            match fs::remove_file(self.destination.join(name)) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
                _ => {}
            }
        }
        for name in &self.names {
            fs::rename(self.staging.join(name), self.destination.join(name))?;
        }
        fs::remove_dir_all(&self.staging)
    }
}

impl Drop for AtomicDir {
    fn drop(&mut self) {
        if !self.committed {
            let _ = fs::remove_dir_all(&self.staging);
        }
    }
}

const BUFFER: usize = 1 << 16;

fn make_parent(path: &Path) -> io::Result<()> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => fs::create_dir_all(parent),
        _ => Ok(()),
    }
}

/// Holds an output that is being written: whoever can take the lock knows that its writer is gone. Where
/// there are no locks nothing is ever taken for abandoned.
fn hold(path: &Path) -> Option<File> {
    File::open(path).ok().filter(|file| file.try_lock().is_ok())
}

/// Removes what earlier writers of `path` left when they were killed.
fn remove_abandoned(path: &Path) {
    let (Some(parent), Some(name)) = (path.parent(), path.file_name()) else { return };
    let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let start = format!(".{}.", name.to_string_lossy());
    let is_ours = |file: &str| {
        let middle = file.strip_prefix(&start).and_then(|rest| rest.strip_suffix(".partial"));
        middle
            .is_some_and(|m| m.split('-').count() == 2 && m.bytes().all(|b| b.is_ascii_digit() || b == b'-'))
    };
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        if is_ours(&entry.file_name().to_string_lossy()) && hold(&entry.path()).is_some() {
            let left = entry.path();
            let _ = if left.is_dir() { fs::remove_dir_all(left) } else { fs::remove_file(left) };
        }
    }
}

/// A new file beside the destination. The name may be taken: by what a killed process left whose number this
/// one has now (in containers every process has the same), or by one of another machine on a shared disk.
fn create_temporary(destination: &Path) -> io::Result<(File, PathBuf)> {
    const ATTEMPTS: usize = 1000;
    let mut attempts = (0..ATTEMPTS).map(|_| {
        let name = temporary_name(destination);
        File::create_new(&name).map(|file| (file, name))
    });
    let taken = |r: &io::Result<_>| r.as_ref().is_err_and(|e| e.kind() == io::ErrorKind::AlreadyExists);
    attempts.find(|r| !taken(r)).unwrap_or_else(|| Err(io::ErrorKind::AlreadyExists.into()))
}

/// A name beside `path` that no other writer of this machine uses now; hidden, and with an ending that no
/// reader takes for data.
fn temporary_name(path: &Path) -> PathBuf {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!(".{name}.{}-{count}.partial", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listing(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_at_commit_only() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep/er/model.toml");
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"whole").unwrap();
        assert!(!path.exists());
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(listing(path.parent().unwrap()), ["model.toml"]);
    }

    /// What a killed writer left is removed by the next one of the same output; what a living one writes, and
    /// what only looks like it, stays.
    #[test]
    fn what_killed_writers_left_goes_with_the_next_write() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        let living = AtomicFile::create(&path).unwrap();
        fs::write(dir.path().join(".a.csv.12345-0.partial"), "half").unwrap();
        fs::create_dir(dir.path().join(".run.12345-7.partial")).unwrap();
        fs::write(dir.path().join(".a.csv.mine.partial"), "other").unwrap();
        write(&path, "whole").unwrap();
        let mut names = listing(dir.path());
        assert_eq!(names.len(), 4, "{names:?}");
        assert!(!names.iter().any(|n| n == ".a.csv.12345-0.partial"));
        drop(living);
        let mut run = AtomicDir::create(&dir.path().join("run")).unwrap();
        run.write("b.csv", "b").unwrap();
        run.commit().unwrap();
        names = listing(dir.path());
        assert_eq!(names, [".a.csv.mine.partial", "a.csv", "run"]);
    }

    #[test]
    fn a_dropped_file_leaves_nothing_and_the_old_one_stays() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        write(&path, "old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(listing(dir.path()), ["a.csv"]);
    }

    #[test]
    fn what_a_killed_process_left_is_not_in_the_way() {
        let dir = tempfile::tempdir().unwrap();
        let pid = std::process::id();
        for count in 0..200 {
            fs::write(dir.path().join(format!(".a.csv.{pid}-{count}.partial")), "left").unwrap();
        }
        write(&dir.path().join("a.csv"), "new").unwrap();
        assert_eq!(fs::read(dir.path().join("a.csv")).unwrap(), b"new");
    }

    #[test]
    fn links_are_followed_and_devices_written_directly() {
        let dir = tempfile::tempdir().unwrap();
        let (real, link) = (dir.path().join("real"), dir.path().join("link"));
        write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write(&link, "new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"new");
        write(Path::new("/dev/null"), "gone").unwrap();
    }

    #[test]
    fn a_full_disk_is_an_error_that_names_the_output() {
        let e = write(Path::new("/dev/full"), vec![0; 1 << 20]).unwrap_err();
        assert!(e.to_string().starts_with("/dev/full: No space left"), "{e}");
        assert!(!e.is_usage());
    }

    #[test]
    fn a_directory_is_no_file_and_a_file_no_directory() {
        let dir = tempfile::tempdir().unwrap();
        assert!(AtomicFile::create(dir.path()).is_err());
        let file = dir.path().join("f");
        write(&file, "x").unwrap();
        assert!(AtomicDir::create(&file).is_err());
        assert_eq!(listing(dir.path()), ["f"]);
    }

    #[test]
    fn inputs_are_not_overwritten_under_any_name() {
        let dir = tempfile::tempdir().unwrap();
        let input = dir.path().join("in.csv");
        write(&input, "data").unwrap();
        let alias = dir.path().join("../").join(dir.path().file_name().unwrap()).join("in.csv");
        let e = guard_inputs(&alias, [input.as_path()]).unwrap_err();
        assert!(e.to_string().ends_with("is an input of this command and would be overwritten"));
        assert!(e.is_usage() && e.hint().is_some());
        guard_inputs(&dir.path().join("out.csv"), [input.as_path()]).unwrap();
    }

    #[test]
    fn a_directory_appears_at_commit_only() {
        let dir = tempfile::tempdir().unwrap();
        let run = dir.path().join("run");
        let mut out = AtomicDir::create(&run).unwrap();
        fs::write(out.path("a.csv"), "a").unwrap();
        out.write("manifest.json", "{}").unwrap();
        assert!(!run.exists());
        out.commit().unwrap();
        assert_eq!(listing(&run), ["a.csv", "manifest.json"]);
        assert_eq!(listing(dir.path()), ["run"]);
    }

    #[test]
    fn an_existing_directory_keeps_what_is_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("notes.txt"), "mine").unwrap();
        fs::write(dir.path().join("a.csv"), "old").unwrap();
        let mut out = AtomicDir::create(dir.path()).unwrap();
        out.write("a.csv", "new").unwrap();
        assert_eq!(fs::read(dir.path().join("a.csv")).unwrap(), b"old");
        out.commit().unwrap();
        assert_eq!(listing(dir.path()), ["a.csv", "notes.txt"]);
        assert_eq!(fs::read(dir.path().join("a.csv")).unwrap(), b"new");
    }

    #[test]
    fn a_declared_but_unwritten_file_fails_the_commit_and_nothing_is_left() {
        let dir = tempfile::tempdir().unwrap();
        let mut out = AtomicDir::create(&dir.path().join("run")).unwrap();
        let _ = out.path("never.csv");
        let e = out.commit().unwrap_err();
        assert!(e.to_string().contains("never.csv"), "{e}");
        assert!(listing(dir.path()).is_empty());
    }
}
