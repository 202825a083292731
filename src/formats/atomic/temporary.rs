//! Temporary outputs: named, held while they are written, removed when their writer is gone.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What this process is writing. Whoever gives an output its name holds the list meanwhile, so that an
/// interrupt finds the output whole or without its name.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

pub(super) fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes everything this process is writing. From then on none of its outputs gets its name: for a process
/// that is about to end.
pub(crate) fn remove_unfinished() {
    let unfinished = unfinished();
    for path in unfinished.iter() {
        // Other threads may still make files in a directory that is being removed.
        for _ in 0..10_000 {
            remove(path);
            if !path.exists() {
                break;
            }
            std::thread::yield_now();
        }
    }
    std::mem::forget(unfinished);
}

fn remove(path: &Path) {
    let _ = if path.is_dir() {
        fs::remove_dir_all(path)
    } else {
        fs::remove_file(path)
    };
}

/// A file or directory under a temporary name; removed when dropped, unless it was renamed.
#[derive(Debug)]
pub(super) struct Temporary {
    path: PathBuf,
    /// Locked until it is closed: see [`Hold`].
    _hold: Option<File>,
}

impl Temporary {
    /// A new file beside `destination`, open for writing.
    pub(super) fn file(destination: &Path) -> io::Result<(File, Self)> {
        let (path, file) = claim(destination, |path| Ok(Some(File::create_new(path)?)))?;
        let file = file.ok_or(io::ErrorKind::NotFound)?;
        Ok((file, Self { path, _hold: None })) // `file` itself holds the lock
    }

    /// A new directory beside `destination`.
    pub(super) fn directory(destination: &Path) -> io::Result<Self> {
        let make = |path: &Path| fs::create_dir(path).map(|()| File::open(path).ok());
        claim(destination, make).map(|(path, hold)| Self { path, _hold: hold })
    }

    /// The marker of an output, of one name for all its writers; `None` while another holds it.
    pub(super) fn marker(path: &Path) -> io::Result<Option<Self>> {
        loop {
            let file = File::options()
                .create(true)
                .truncate(false)
                .write(true)
                .open(path)?;
            let hold = match hold_open(file, path) {
                Hold::Taken(file) => Some(file),
                Hold::Unknown => None,
                Hold::Busy => return Ok(None),
                Hold::Stale => continue,
            };
            unfinished().insert(path.to_owned());
            return Ok(Some(Self {
                path: path.to_owned(),
                _hold: hold,
            }));
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Gives it its name.
    pub(super) fn rename(&mut self, to: &Path) -> io::Result<()> {
        let mut unfinished = unfinished();
        fs::rename(&self.path, to)?;
        unfinished.remove(&self.path);
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if unfinished().remove(&self.path) {
            remove(&self.path);
        }
    }
}

/// Whether an output is held: who can take the lock knows that its writer is gone.
#[derive(Debug)]
pub(super) enum Hold {
    /// Taken, until the file is closed.
    Taken(File),
    /// Another holds it.
    Busy,
    /// What was held has lost the name meanwhile, which says nothing about what has the name now.
    Stale,
    /// There are no locks here, or no such file.
    Unknown,
}

pub(super) fn hold(path: &Path) -> Hold {
    File::open(path).map_or(Hold::Unknown, |file| hold_open(file, path))
}

fn hold_open(file: File, path: &Path) -> Hold {
    match file.try_lock() {
        Ok(()) if is_at(&file, path) => Hold::Taken(file),
        Ok(()) => Hold::Stale,
        Err(TryLockError::WouldBlock) => Hold::Busy,
        Err(TryLockError::Error(_)) => Hold::Unknown,
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |m: fs::Metadata| (m.dev(), m.ino());
    file.metadata()
        .ok()
        .map(identity)
        .is_some_and(|found| fs::metadata(path).ok().map(identity) == Some(found))
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Makes something new beside the destination and holds it. Another writer of the same destination may take it
/// for abandoned before it is held, and remove it: then it is made again under another name. The name may also
/// be taken by what a killed process left whose number this one has now (in containers every process has the
/// same), or by one of another machine on a shared disk.
fn claim(
    destination: &Path,
    make: impl Fn(&Path) -> io::Result<Option<File>>,
) -> io::Result<(PathBuf, Option<File>)> {
    const ATTEMPTS: usize = 1000;
    for _ in 0..ATTEMPTS {
        let path = temporary_name(destination);
        let made = match make(&path) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
            made => made?,
        };
        let locked = match made.as_ref().map(File::try_clone).transpose()? {
            Some(file) => hold_open(file, &path),
            None => Hold::Unknown,
        };
        let is_ours = match locked {
            Hold::Taken(_) => true, // the clone shares its lock with `made`
            Hold::Busy | Hold::Stale => false,
            Hold::Unknown => path.exists(),
        };
        if is_ours {
            unfinished().insert(path.clone());
            return Ok((path, made));
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

/// Removes what earlier writers of `path` left when they were killed.
pub(super) fn remove_abandoned(path: &Path) {
    for (left, held) in abandoned(path, PARTIAL) {
        remove(&left);
        drop(held);
    }
}

/// Ending of what is being written, and of a directory whose files are being moved to their places.
pub(super) const PARTIAL: &str = "partial";
pub(super) const MOVING: &str = "moving";

/// What killed writers of `path` left under a temporary name of that ending, each held.
pub(super) fn abandoned(path: &Path, ending: &str) -> Vec<(PathBuf, File)> {
    let (Some(parent), Some(name)) = (path.parent(), path.file_name()) else {
        return Vec::new();
    };
    let parent = if parent.as_os_str().is_empty() {
        Path::new(".")
    } else {
        parent
    };
    let (start, end) = (
        format!(".{}.", name.to_string_lossy()),
        format!(".{ending}"),
    );
    let is_temporary = |file: &str| {
        let middle = file
            .strip_prefix(&start)
            .and_then(|rest| rest.strip_suffix(&end));
        middle.is_some_and(|m| {
            m.split('-').count() == 2 && m.bytes().all(|b| b.is_ascii_digit() || b == b'-')
        })
    };
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    let left = entries
        .filter(|e| is_temporary(&e.file_name().to_string_lossy()))
        .map(|e| e.path());
    left.filter_map(|path| match hold(&path) {
        Hold::Taken(file) => Some((path, file)),
        Hold::Busy | Hold::Stale | Hold::Unknown => None,
    })
    .collect()
}

/// A name beside `path` that no other writer of this machine uses now; hidden, and with an ending that no
/// reader takes for data.
fn temporary_name(path: &Path) -> PathBuf {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!(".{name}.{}-{count}.{PARTIAL}", std::process::id()))
}
