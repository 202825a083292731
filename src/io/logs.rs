//! Logs of robots, flight controllers and receivers ([`nav_sim_logs`]), among the files that are read.

use super::{Failure, Place, source};
use nav_sim_logs::{HEAD, Log, LogError, LogFault, LogFormat, Stamp, Truncation, recognise};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Choice of what is read of a log.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LogOptions {
    /// Topic of the IMU; none: the only one.
    pub topic: Option<String>,
    /// Stamps: of the measurement, or of its arrival.
    pub stamp: Stamp,
}

/// The kind of log that a file is by its first bytes; none for tables and arrays. What cannot be opened is for its reader
/// to refuse, and a pipe gives its bytes once.
pub(crate) fn kind_of(path: &Path) -> Option<LogFormat> {
    std::fs::metadata(path)
        .ok()
        .filter(std::fs::Metadata::is_file)?;
    let file = File::open(path).ok()?;
    let mut head = Vec::new();
    file.take(HEAD as u64).read_to_end(&mut head).ok()?;
    recognise(&head)
}

/// Opens a log.
///
/// # Errors
/// When it is not of a format that is read, or is damaged before its end.
pub(crate) fn open(path: &Path) -> Result<Log, Failure> {
    source::open(path).map_err(|e| Failure::io(path, e))?;
    Log::open(path).map_err(|e| refused(path, e))
}

/// The refusal of a log, with what helps.
pub(crate) fn refused(path: &Path, error: LogError) -> Failure {
    let hint = error.hint();
    let refusal = |place| Failure::contents(path.display(), place, &error);
    match error.fault {
        LogFault::Topic => {
            refusal(Place::Within).or_hint("--topic NAME selects one (nav-sim inspect lists them)")
        }
        LogFault::NoTopic => {
            refusal(Place::Within).or_hint("name another file: nav-sim inspect lists its contents")
        }
        LogFault::TimeBack => {
            refusal(Place::Within).or_option(("stamp", "--stamp log uses the times of arrival"))
        }
        LogFault::NotRead(_) => {
            Failure::contents(path.display(), Place::Itself, format!("is {error}"))
                .or_hint_if(hint.map(|command| format!("convert it: {command}")))
        }
        LogFault::Io(source) => Failure::io(path, source),
        _ => refusal(Place::Within).or_hint_if(hint.map(str::to_owned)),
    }
}

/// Warning of a cut at which the reading ended.
pub(crate) fn cut_off(damage: &Truncation) -> String {
    let Truncation {
        error,
        read_bytes,
        file_bytes,
    } = damage;
    format!("{error}; read up to there, {read_bytes} of {file_bytes} bytes")
}
