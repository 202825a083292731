//! Outputs that appear whole or not at all: written under a temporary name in the same directory, flushed
//! to the disk, then renamed. What a command may write is found out before its work, and no other writes it meanwhile.
//!
//! Refused, with `--force` too: an input, what another command writes, what nav-sim did not write.
//! A file takes the place of an earlier result.
//! A directory takes the place of the same run; `--force` is for one of another configuration, inputs or seed.

use super::trajectory_file::HEADER;
use super::{Failure, Place, help, source};
use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Temporary files of this process. The list is locked while an output gets its name, so that an
/// interrupt finds the output whole or without its name.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
/// Claims of this process.
static CLAIMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn locked<T>(list: &'static Mutex<T>) -> MutexGuard<'static, T> {
    list.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes everything this process is writing. From then on none of its outputs gets its name: for a process
/// that is about to end.
pub(crate) fn remove_unfinished() {
    let unfinished = locked(&UNFINISHED);
    for path in unfinished.iter() {
        // other threads may still make files in a directory that is being removed
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
    drop(match path.is_dir() {
        true => fs::remove_dir_all(path),
        false => fs::remove_file(path),
    });
}

/// A file or directory under a temporary name; removed when dropped, unless it was renamed.
#[derive(Debug)]
struct Temporary {
    path: PathBuf,
    /// Locked until it is closed, where it is a marker.
    lock: Option<File>,
}

/// Ending of what is being written.
pub(crate) const PARTIAL: &str = ".partial";

impl Temporary {
    fn new(path: PathBuf, lock: Option<File>) -> Self {
        locked(&UNFINISHED).insert(path.clone());
        Self { path, lock }
    }

    /// Makes something beside the destination: hidden, and with an ending that no reader takes for data.
    fn beside<T>(
        destination: &Path,
        make: impl Fn(&Path) -> io::Result<T>,
    ) -> io::Result<(T, Self)> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        loop {
            let (process, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
            let name = format!(".{}.{process}-{count}{PARTIAL}", name_of(destination));
            let path = destination.with_file_name(name);
            match make(&path) {
                // left by a killed process whose number this one has now
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                made => return Ok((made?, Self::new(path, None))),
            }
        }
    }

    /// The marker of an output, locked by the operating system: a process that is killed holds none. `None` while another
    /// holds it. True if a killed process left it.
    fn marker(path: &Path) -> io::Result<Option<(Self, bool)>> {
        loop {
            let is_left = path.exists();
            let file = File::options()
                .create(true)
                .truncate(false)
                .write(true)
                .open(path)?;
            let lock = match file.try_lock() {
                Ok(()) if !is_at(&file, path) => continue,
                Ok(()) => Some(file),
                Err(TryLockError::WouldBlock) => return Ok(None),
                // there are no locks here
                Err(TryLockError::Error(_)) => None,
            };
            return Ok(Some((Self::new(path.to_owned(), lock), is_left)));
        }
    }

    /// Gives it its name.
    fn rename(&self, to: &Path, unfinished: &mut BTreeSet<PathBuf>) -> io::Result<()> {
        fs::rename(&self.path, to)?;
        unfinished.remove(&self.path);
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if locked(&UNFINISHED).remove(&self.path) {
            remove(&self.path);
        }
    }
}

/// True if a file has not lost its name since it was opened.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |m: fs::Metadata| (m.dev(), m.ino());
    let found = file.metadata().ok().map(identity);
    found.is_some() && fs::metadata(path).ok().map(identity) == found
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

fn parent_of(path: &Path) -> &Path {
    let parent = path.parent().unwrap_or(Path::new(""));
    if parent.as_os_str().is_empty() {
        Path::new(".")
    } else {
        parent
    }
}

/// Removes what killed writers of an output left under temporary names: for the holder of its marker, or where the output is there.
pub(crate) fn remove_abandoned(path: &Path) {
    let start = format!(".{}.", name_of(path));
    let is_left = |name: &str| {
        let rest = name.strip_prefix(&start);
        let middle = rest.and_then(|rest| rest.strip_suffix(PARTIAL));
        middle.is_some_and(|m| m.bytes().all(|b| b.is_ascii_digit() || b == b'-'))
    };
    let entries = fs::read_dir(parent_of(path)).into_iter().flatten();
    for entry in entries.flatten() {
        if is_left(&entry.file_name().to_string_lossy()) {
            remove(&entry.path());
        }
    }
}

/// Writes a whole file.
///
/// # Errors
/// As [`filled`] and [`commit`].
pub(crate) fn write(destination: &Path, contents: impl AsRef<[u8]>) -> Result<(), Failure> {
    commit([filled(destination, contents.as_ref())?])
}

/// Gives files their names, one after the other and without an interrupt between.
///
/// # Errors
/// When a rename is refused; those without their names are gone then.
pub(crate) fn commit(files: impl IntoIterator<Item = AtomicFile>) -> Result<(), Failure> {
    let mut unfinished = locked(&UNFINISHED);
    let files: Vec<AtomicFile> = files.into_iter().collect();
    let renamed = files.iter().try_for_each(|file| {
        let temporary = file.temporary.iter();
        let mut renamed = temporary.map(|t| t.rename(&file.destination, &mut unfinished));
        renamed
            .next()
            .unwrap_or(Ok(()))
            .map_err(|e| Failure::unwritable(&file.destination, e))
    });
    drop(unfinished);
    renamed
}

/// A file that is written, to the disk, but does not have its name yet.
///
/// # Errors
/// When the directory cannot be made or written to, or the disk is full.
pub(crate) fn filled(destination: &Path, contents: &[u8]) -> Result<AtomicFile, Failure> {
    let opened = AtomicFile::open(destination);
    let mut file = opened.map_err(|e| Failure::unwritable(destination, e))?;
    let mut written = file.file.write_all(contents);
    if file.temporary.is_some() {
        written = written.and_then(|()| file.file.sync_all());
    }
    written.map_err(|e| Failure::unwritable(destination, e))?;
    Ok(file)
}

/// A file under a temporary name until [`commit`]; dropped before that, it leaves nothing.
///
/// A destination that exists and is no regular file (a pipe, `/dev/null`) is written directly; a symbolic
/// link is followed. Missing parent directories are made.
#[derive(Debug)]
pub(crate) struct AtomicFile {
    destination: PathBuf,
    temporary: Option<Temporary>,
    file: File,
}

impl AtomicFile {
    /// Opens the temporary file beside `destination`.
    fn open(destination: &Path) -> io::Result<Self> {
        let (file, temporary, destination) = match fs::metadata(destination) {
            Ok(there) if there.is_dir() => return Err(ErrorKind::IsADirectory.into()),
            Ok(there) if !there.is_file() => {
                let file = File::options().write(true).open(destination)?;
                (file, None, destination.to_owned())
            }
            there => {
                let real = there.and_then(|_| destination.canonicalize());
                let destination = real.unwrap_or_else(|_| destination.to_owned());
                fs::create_dir_all(parent_of(&destination))?;
                let (file, temporary) =
                    Temporary::beside(&destination, |path| File::create_new(path))?;
                (file, Some(temporary), destination)
            }
        };
        Ok(Self {
            destination,
            temporary,
            file,
        })
    }
}

/// A directory of outputs, built under a temporary name until [`AtomicDir::commit`]; dropped before that,
/// it leaves nothing.
///
/// If the destination exists (it may be a mount point, or hold files of the user), files of the same names are
/// replaced and others left alone. The file written last (a manifest, say) vanishes first and appears last:
/// where it is, the rest is whole.
#[derive(Debug)]
pub(crate) struct AtomicDir {
    destination: PathBuf,
    staging: Temporary,
    names: Vec<String>,
}

/// Temporary directories within a destination are named after this.
pub(crate) const INSIDE: &str = "out";

impl AtomicDir {
    /// Makes the temporary directory, beside the destination or, if that exists, in it.
    ///
    /// # Errors
    /// When the destination is a file, or a directory cannot be made.
    pub(crate) fn create(destination: &Path) -> Result<Self, Failure> {
        let make = || {
            let path = match fs::metadata(destination) {
                Ok(there) if !there.is_dir() => return Err(ErrorKind::NotADirectory.into()),
                Ok(_) => destination.join(INSIDE),
                Err(_) => destination.to_owned(),
            };
            fs::create_dir_all(parent_of(&path))?;
            Temporary::beside(&path, |path| fs::create_dir(path))
        };
        let ((), staging) = make().map_err(|e| Failure::unwritable(destination, e))?;
        Ok(Self {
            destination: destination.into(),
            staging,
            names: Vec::new(),
        })
    }

    /// Writes a file part by part, to the disk.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write(
        &mut self,
        name: &str,
        parts: impl IntoIterator<Item = impl AsRef<[u8]>>,
    ) -> Result<(), Failure> {
        let write = || {
            let mut file = BufWriter::new(File::create(self.staging.path.join(name))?);
            let mut parts = parts.into_iter();
            parts.try_for_each(|part| file.write_all(part.as_ref()))?;
            file.into_inner()?.sync_all()
        };
        write().map_err(|e| Failure::unwritable(&self.destination.join(name), e))?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Gives the files their names.
    ///
    /// # Errors
    /// When a rename is refused.
    pub(crate) fn commit(self) -> Result<(), Failure> {
        let moved = match self.destination.is_dir() {
            true => self.replace(),
            false => self
                .staging
                .rename(&self.destination, &mut locked(&UNFINISHED)),
        };
        moved.map_err(|e| Failure::unwritable(&self.destination, e))
    }

    fn replace(&self) -> io::Result<()> {
        let _interrupts_wait = locked(&UNFINISHED);
        let last = self.names.last().map(|last| self.destination.join(last));
        match last.map_or(Ok(()), fs::remove_file) {
            Err(e) if e.kind() != ErrorKind::NotFound => return Err(e),
            _ => {}
        }
        let mut names = self.names.iter();
        names.try_for_each(|name| {
            fs::rename(self.staging.path.join(name), self.destination.join(name))
        })
    }
}

/// Outputs that are this command's own until this is dropped.
#[derive(Debug)]
#[must_use = "released when dropped"]
pub(crate) struct OutputClaim {
    outputs: Vec<PathBuf>,
    marker: Option<Temporary>,
    /// True if a process was killed that had claimed the same.
    is_left: bool,
}

/// Name of the marker in a directory of outputs; ending of the one beside an output.
const MARKER: &str = ".claim";

impl OutputClaim {
    /// True if another nav-sim may write there: the disk has no locks.
    pub(crate) fn is_shared(&self) -> bool {
        self.marker
            .as_ref()
            .is_some_and(|marker| marker.lock.is_none())
    }

    /// Claims outputs; `shown` is the path for messages.
    fn new(shown: &Path, marker: &Path, outputs: Vec<PathBuf>) -> Result<Self, Failure> {
        let mut claimed = locked(&CLAIMED);
        if outputs.iter().any(|output| claimed.contains(output)) {
            let why = "is another output of this command";
            return Err(refused(shown, why).or_hint(help::OUTPUT));
        }
        let marked = fs::create_dir_all(parent_of(marker)).and_then(|()| Temporary::marker(marker));
        let Some((marker, is_left)) = marked.map_err(|e| Failure::unwritable(shown, e))? else {
            return Err(refused(shown, "is being written by another nav-sim")
                .or_hint(help::OUTPUT)
                .or_hint("wait until it is done"));
        };
        claimed.extend(outputs.iter().cloned());
        Ok(Self {
            outputs,
            marker: Some(marker),
            is_left,
        })
    }

    fn of_directory(directory: &Path, files: &[impl AsRef<str>]) -> Result<Self, Failure> {
        loop {
            let is_there = directory.is_dir();
            let marker = match is_there {
                true => directory.join(MARKER),
                false => marker_beside(directory),
            };
            let at = resolved(directory);
            let outputs = files.iter().map(|name| at.join(name.as_ref()));
            let claim = Self::new(directory, &marker, outputs.chain([at.join("")]).collect())?;
            // if the directory appeared meanwhile, its writers lock the marker inside it: try again there
            if directory.is_dir() == is_there {
                return Ok(claim);
            }
        }
    }
}

impl Drop for OutputClaim {
    fn drop(&mut self) {
        let mut claimed = locked(&CLAIMED);
        self.outputs
            .iter()
            .for_each(|output| _ = claimed.remove(output));
    }
}

fn refused(path: &Path, why: &str) -> Failure {
    Failure::contents(path.display(), Place::Itself, why)
}

fn marker_beside(path: &Path) -> PathBuf {
    path.with_file_name(format!(".{}{MARKER}", name_of(path)))
}

/// A path by one name, whether anything is there or not.
fn resolved(path: &Path) -> PathBuf {
    let by_parent = || Some(parent_of(path).canonicalize().ok()?.join(path.file_name()?));
    let own = path.canonicalize().ok().or_else(by_parent);
    own.unwrap_or_else(|| path.to_owned())
}

/// Claims a file that can be made, is none of the inputs, and replaces nothing but a result of its kind, which the ending
/// of `kind` tells. A device is everybody's.
///
/// # Errors
/// When it is an input, cannot be made, another command writes it, or what stands there is no such result.
pub(crate) fn claim_file<'a>(
    output: &Path,
    kind: &str,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<OutputClaim, Failure> {
    guard_inputs(output, inputs)?;
    drop(AtomicFile::open(output).map_err(|e| Failure::unwritable(output, e))?);
    if fs::metadata(output).is_ok_and(|m| !m.is_file()) {
        return Ok(OutputClaim {
            outputs: Vec::new(),
            marker: None,
            is_left: false,
        });
    }
    let output_at = resolved(output);
    let claim = OutputClaim::new(output, &marker_beside(&output_at), vec![output_at.clone()])?;
    remove_abandoned(&output_at);
    guard_others(output, kind)?;
    Ok(claim)
}

/// Refuses an output where what stands there is no result of its kind on its own.
///
/// # Errors
/// If `output` is not a result of this command.
pub(crate) fn guard_others(output: &Path, kind: &str) -> Result<(), Failure> {
    let is_own = |text: String| is_own(&text, kind) && !is_part(&resolved(output));
    match !output.exists() || source::head(output).is_ok_and(is_own) {
        true => Ok(()),
        false => Err(foreign(output)),
    }
}

fn foreign(path: &Path) -> Failure {
    let error = refused(path, "is not of this command: not replaced");
    error.or_hint(help::OUTPUT).or_hint("move it away")
}

/// Refuses an output that is one of the inputs, under whatever name.
fn guard_inputs<'a>(
    output: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let target = output.canonicalize().ok();
    let is_it = |input: &Path| target.is_some() && input.canonicalize().ok() == target;
    match inputs.into_iter().any(is_it) {
        false => Ok(()),
        true => {
            let why = "is an input and would be overwritten";
            Err(refused(output, why).or_hint(help::OUTPUT))
        }
    }
}

/// Claims a directory before the work whose results are to be written there: none of `files` is an input, the
/// directory is new, empty, or of this command, and what it holds is the same or to be replaced. Nothing is left: a
/// command that is interrupted leaves no trace.
///
/// `recognise` is given the text of the last of `files`, if it is there.
///
/// # Errors
/// If the directory holds other files, an input or another result.
pub(crate) fn claim_directory<'a>(
    directory: &Path,
    files: &[impl AsRef<str>],
    inputs: impl Iterator<Item = &'a Path> + Clone,
    force: bool,
    recognise: impl FnOnce(&str) -> DirectoryState,
) -> Result<OutputClaim, Failure> {
    for name in files {
        guard_inputs(&directory.join(name.as_ref()), inputs.clone())?;
    }
    AtomicDir::create(directory)?; // dropped at once
    let claim = OutputClaim::of_directory(directory, files)?;
    remove_abandoned(directory);
    remove_abandoned(&directory.join(INSIDE));
    let last = directory.join(files.last().map_or("", AsRef::as_ref));
    let found = match fs::read_to_string(&last) {
        // killed where it put its files in place
        Err(_) if claim.is_left || is_empty(directory) => DirectoryState::Same,
        Err(_) => DirectoryState::Foreign,
        Ok(text) => recognise(&text),
    };
    match found {
        DirectoryState::Foreign => Err(foreign(directory)),
        DirectoryState::Other if !force => {
            let why = "holds another result: other configuration, inputs or seed";
            Err(refused(directory, why).or_hint("name another place, or replace it with --force"))
        }
        DirectoryState::Other | DirectoryState::Same => Ok(claim),
    }
}

/// True if the directory does not exist or holds only hidden files.
fn is_empty(directory: &Path) -> bool {
    let mut entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries.all(|entry| entry.file_name().to_string_lossy().starts_with('.'))
}

/// Text (blanks removed) by which nav-sim recognises its own files, per ending.
const SIGNATURES: [(&str, &str); 10] = [
    ("trajectory.csv", "(nav-simtrajectoryconvert)"),
    (".toml", "program=\"nav-sim"),
    (".txt", "(nav-simexport)"),
    (".html", "<metaname=\"generator\"content=\"nav-sim\">"),
    (".svg", "class=\"chartwide\""),
    (".png", "Software\0nav-sim"),
    ("results.csv", ",asee_mean,"),
    ("summary.json", "{\"schema_version\":1,\"complete\""),
    ("comparison.json", "{\"schema_version\":1,\"reference\""),
    (".json", "{\"schema_version\":1,\"rate_hz\""),
];

/// True of a text of this kind that nav-sim wrote, and of an empty one. Other programs write tables with the same header,
/// but not each number in its shortest form.
fn is_own(text: &str, kind: &str) -> bool {
    let is_shortest = |cell: &str| cell.parse::<f64>().is_ok_and(|x| x.to_string() == cell);
    let rows = text
        .strip_prefix(HEADER)
        .filter(|_| kind.ends_with("trajectory.csv"));
    let first = rows.and_then(|rows| rows.lines().next());
    let mark = SIGNATURES.iter().find(|(ending, _)| kind.ends_with(ending));
    let is_marked = |mark: &str| text.split_whitespace().collect::<String>().contains(mark);
    text.is_empty()
        || mark.is_some_and(|(_, mark)| is_marked(mark))
        || first.is_some_and(|row| row.split(',').all(is_shortest))
}

/// True of a file that a manifest beside it tells of: the result would no longer be whole.
fn is_part(path: &Path) -> bool {
    let manifest = fs::read_to_string(path.with_file_name("manifest.json")).unwrap_or_default();
    let name = name_of(path);
    manifest.contains("\"schema_version\"")
        && (name == "report.html" || manifest.contains(&format!("\"{name}\": \"")))
}

/// State of a directory of results, told by its last file, which appears when the others are whole.
pub(crate) enum DirectoryState {
    /// Nothing that may be replaced.
    Foreign,
    /// A result of another configuration, other inputs or another seed.
    Other,
    /// An earlier result of what is to be written, or nothing.
    Same,
}

#[cfg(test)]
#[path = "atomic_tests.rs"]
mod tests;
