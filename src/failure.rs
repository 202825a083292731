//! Errors as the user reads them, with their exit codes.

use clap::error::ContextKind;
use nav_sim_calibration::{CalibrationError, CalibrationFault};
use nav_sim_navigation::sensors::imu::TruthError;
use nav_sim_navigation::sensors::outage::OutageError;
use nav_sim_navigation::simulation::ExperimentError;
use nav_sim_signal::noise::ReplicateError;
use nav_sim_signal::units::Refused;
use nav_sim_signal::wavelet::WaveletError;
use std::borrow::Cow;
use std::error::Error as _;
use std::fmt;
use std::io::{self, ErrorKind};
use std::num::{ParseFloatError, ParseIntError};
use std::path::Path;

/// A command without a result: exit code, message, place and help. 1 could not (I/O, numerics); 2 usage or input, files that
/// are not there too; 3 a stated bound was not met; 75 stopped early, resume; 130 interrupted (143 by SIGTERM, 129 by SIGHUP).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    code: u8,
    message: String,
    help: Vec<Help>,
    place: Option<(String, Option<u64>)>,
    /// Reason for which the file is passed over where it was not named but found in a directory.
    passed_over: Option<&'static str>,
}

/// Advice; with an option, it is for commands that have that option, or that have not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Help {
    option: Option<(&'static str, bool)>,
    text: Cow<'static, str>,
}

/// Advice that several readers give; with an option, for commands that have it.
pub(crate) mod help {
    pub(crate) const COLUMN_NAMES: (&str, &str) = ("columns", "name all columns with --columns");
    pub(crate) const OUTPUT: &str = "choose another output with --out";
    pub(crate) const CHANNELS: (&str, &str) = ("axes", "leave the axis out with --axes");
    pub(crate) const GAPS: (&str, &str) = (
        "gaps",
        "--gaps split takes the stretches between as recordings; --gaps ignore takes the samples as evenly spaced",
    );
    pub(crate) const GAPS_LOST: (&str, &str) = (
        "gaps",
        "--gaps split takes the stretches between as recordings",
    );
    pub(crate) const GAPS_KEEP: (&str, &str) = ("gaps", "--gaps keep leaves out what is missing");
    pub(crate) const GAPS_ELSEWHERE: (&str, &str) = (
        "gaps",
        "wv and calibrate read it with --gaps split or --gaps ignore; fuse bridges gaps of up to 5 s",
    );
    pub(crate) const GAPS_LOST_ELSEWHERE: (&str, &str) = (
        "gaps",
        "wv and calibrate read it with --gaps split; fuse bridges gaps of up to 5 s",
    );
    pub(crate) const WRONG_RATE: (&str, &str) = ("rate-hz", "leave --rate-hz out, or correct it");
    pub(crate) const FIX_SIGMA: (&str, &str) = (
        "gnss-sigma",
        "give them for all fixes, such as --gnss-sigma 2,2,4:0.1 (m, m/s)",
    );
}

/// Place in a file.
#[derive(Clone)]
pub(crate) enum Place {
    /// Anywhere in it.
    Within,
    /// The file as a whole: its name is the subject of the sentence.
    Itself,
    /// A line, from 1.
    Line(u64),
    /// A part that is no line: which.
    Part(String),
}

impl From<u64> for Place {
    fn from(line: u64) -> Self {
        Self::Line(line)
    }
}

impl From<usize> for Place {
    fn from(line: usize) -> Self {
        Self::Line(line as u64)
    }
}

/// The result of a command or of a part of it.
pub type Result<T, E = Failure> = std::result::Result<T, E>;

/// Refuses input (exit code 2), with what helps.
pub(crate) fn refused<T>(message: impl ToString, hint: impl Into<Cow<'static, str>>) -> Result<T> {
    Err(Failure::input(message).hint(hint))
}

impl std::error::Error for Failure {}

impl Failure {
    fn new(code: u8, message: &impl ToString) -> Self {
        Self {
            code,
            message: message.to_string(),
            help: Vec::new(),
            place: None,
            passed_over: None,
        }
    }

    /// Wrong input: usage, configuration, data (exit code 2).
    pub fn input(message: impl ToString) -> Self {
        Self::new(2, &message)
    }

    /// Could not: I/O, numerics (exit code 1).
    pub fn failed(message: impl ToString) -> Self {
        Self::new(1, &message)
    }

    /// A stated bound was not met (exit code 3).
    pub(crate) fn bound(message: impl ToString) -> Self {
        Self::new(3, &message)
    }

    /// Stopped early, to be resumed (exit code 75).
    pub(crate) fn stopped(message: impl ToString) -> Self {
        Self::new(75, &message)
    }

    /// Interrupted by the user (exit code 130).
    pub(crate) fn interrupted(message: impl ToString) -> Self {
        Self::new(130, &message)
    }

    /// Words that clap refuses: `--option='value': reason` where a value is wrong, else its first paragraph.
    pub(crate) fn usage(e: &clap::Error) -> Self {
        let text = e.to_string();
        let text = text.strip_prefix("error: ").unwrap_or(&text);
        let mut paragraphs = text.split("\n\n").map(str::trim);
        let message = paragraphs.next().unwrap_or_default();
        // `-- --option` would only move the refusal to the next word
        let tip = paragraphs.find_map(|p| p.strip_prefix("tip: "));
        let tip = tip.filter(|tip| !tip.starts_with("to pass"));
        let said = |kind| e.get(kind).map(ToString::to_string);
        let known = || {
            let values = e.get(ContextKind::ValidValue);
            values.map(|values| format!("not one of {values}"))
        };
        let value = said(ContextKind::InvalidValue).filter(|value| !value.is_empty());
        let reason = e.source().map(|source| match source {
            _ if source.is::<ParseIntError>() => "not a whole number ≥ 0".to_owned(),
            _ if source.is::<ParseFloatError>() => "not a number".to_owned(),
            _ => source.to_string(),
        });
        let argument = said(ContextKind::InvalidArg).unwrap_or_default();
        let option = argument.split(' ').next().unwrap_or_default();
        let message = match value.zip(reason.or_else(known)) {
            Some((value, reason)) => format!("{option}='{value}': {reason}"),
            None => without_places(message),
        };
        Self::input(message).or_hint_if(tip.map(str::to_owned))
    }

    /// Contents of a file that are refused (exit code 2).
    pub(crate) fn contents(
        path: impl fmt::Display,
        place: impl Into<Place>,
        message: impl fmt::Display,
    ) -> Self {
        let (message, line) = match place.into() {
            Place::Within => (format!("{path}: {message}"), None),
            Place::Itself => (format!("{path} {message}"), None),
            Place::Line(line) => (format!("{path}, line {line}: {message}"), Some(line)),
            Place::Part(part) => (format!("{path}, {part}: {message}"), None),
        };
        Self {
            place: Some((path.to_string(), line)),
            ..Self::input(message)
        }
    }

    /// A value in a column that is refused, with the reason in words that follow it.
    pub(crate) fn cell(
        path: &str,
        line: u64,
        column: &str,
        value: impl fmt::Display,
        reason: &str,
    ) -> Self {
        Self::contents(path, line, format!("column \"{column}\": {value} {reason}"))
    }

    /// A row with too few or too many values.
    pub(crate) fn row_length(path: &str, line: u64, found: usize, expected: usize) -> Self {
        Self::contents(
            path,
            line,
            format!("{found} values, but {expected} columns"),
        )
        .or_hint("was the file cut off?")
    }

    /// Error of the system on reading a file, with a hint: a wrong path is wrong input.
    pub(crate) fn io(path: &Path, e: io::Error) -> Self {
        use ErrorKind as K;
        let kind = e.kind();
        let advice = match kind {
            K::NotFound => "check the path",
            K::UnexpectedEof => "the file is cut off: copy or pack it again",
            K::FileTooLarge => "write the pipe to a file first",
            K::Unsupported if e.get_ref().is_some() => "fetch it: git lfs pull",
            K::PermissionDenied | K::ReadOnlyFilesystem => {
                "change the permissions of the file or its directory, or name another path"
            }
            K::IsADirectory => "name a file",
            K::NotADirectory | K::AlreadyExists => "name another path, or move that file away",
            K::StorageFull | K::QuotaExceeded => "make room, or name a path on another disk",
            _ => "",
        };
        // what has a number of the system is its own: a file that may not grow, too
        let is_path = matches!(kind, K::NotFound | K::IsADirectory | K::NotADirectory);
        let is_system = !is_path && (e.raw_os_error().is_some() || !is_damage(kind));
        let failure = Self {
            code: if is_system { 1 } else { 2 },
            ..Self::contents(path.display(), Place::Within, system_words(&e))
        };
        failure.or_hint_if((!advice.is_empty()).then(|| advice.to_owned()))
    }

    /// Error of the system on writing a file, with a hint: another place if nothing else.
    pub(crate) fn unwritable(path: &Path, e: io::Error) -> Self {
        let failure = match e.kind() {
            // its directory is there or was made: where files are the system's own, it makes none
            ErrorKind::NotFound => {
                let message = "no file or directory can be made there";
                Self::io(path, io::Error::other(message))
            }
            _ => Self::io(path, e),
        };
        let failure = Self { code: 1, ..failure };
        match failure.help.is_empty() {
            true => failure.or_hint("name another path"),
            false => failure,
        }
    }

    /// The failure, where a file that was found in a directory is passed over for that reason.
    pub(crate) fn skipped_as(self, reason: &'static str) -> Self {
        Self {
            passed_over: Some(reason),
            ..self
        }
    }

    /// Reason for which the file is passed over, if it was found in a directory.
    pub(crate) const fn skip_reason(&self) -> Option<&'static str> {
        self.passed_over
    }

    /// The failure with the name of a part in front.
    pub(crate) fn within(self, part: &str) -> Self {
        Self {
            message: format!("{part}: {}", self.message),
            ..self
        }
    }

    /// In a line of a file.
    pub(crate) fn at(self, path: &str, line: u64) -> Self {
        Self {
            message: format!("{path}, line {line}: {}", self.message),
            place: Some((path.to_owned(), Some(line))),
            ..self
        }
    }

    /// With advice, in the place of other advice.
    pub fn hint(mut self, hint: impl Into<Cow<'static, str>>) -> Self {
        self.help.clear();
        self.or_hint(hint)
    }

    /// With advice, beside what it has.
    pub(crate) fn or_hint(self, text: impl Into<Cow<'static, str>>) -> Self {
        self.or(None, text)
    }

    /// Adds a hint, if there is one.
    pub(crate) fn or_hint_if(self, text: Option<String>) -> Self {
        text.into_iter().fold(self, Self::or_hint)
    }

    /// With further advice for commands that have an option.
    pub(crate) fn or_option(
        self,
        (option, text): (&'static str, impl Into<Cow<'static, str>>),
    ) -> Self {
        self.or(Some((option, true)), text)
    }

    /// With further advice for commands that have no such option.
    pub(crate) fn or_hint_without(self, (option, text): (&'static str, &'static str)) -> Self {
        self.or(Some((option, false)), text)
    }

    fn or(
        mut self,
        option: Option<(&'static str, bool)>,
        text: impl Into<Cow<'static, str>>,
    ) -> Self {
        let text = text.into();
        self.help.push(Help { option, text });
        self
    }

    /// With the advice that a command with such options can follow.
    pub(crate) fn for_options(mut self, has: impl Fn(&str) -> bool) -> Self {
        let fits = |help: &mut Help| match help.option.take() {
            None => true,
            Some((option, is_there)) => has(option) == is_there,
        };
        self.help.retain_mut(fits);
        self
    }

    /// Exit code of the program.
    #[must_use]
    pub const fn code(&self) -> u8 {
        self.code
    }

    /// Advice: any one of what helps.
    #[must_use]
    pub fn advice(&self) -> Option<String> {
        let fits = |help: &&Help| help.option.is_none_or(|(_, is_there)| is_there);
        let texts = self.help.iter().filter(fits).map(|help| help.text.as_ref());
        let texts: Vec<&str> = texts.collect();
        (!texts.is_empty()).then(|| texts.join(", or "))
    }

    /// The file that is at fault.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        self.place.as_ref().map(|(file, _)| file.as_str())
    }

    /// The line in it, from 1.
    #[must_use]
    pub fn line(&self) -> Option<u64> {
        self.place.as_ref().and_then(|(_, line)| *line)
    }
}

/// A message of clap on one line, without quotes and without the names of values: `--out`, not `'--out <FILE>'`.
fn without_places(message: &str) -> String {
    let message = message.replace('\'', "");
    let mut words: Vec<&str> = Vec::new();
    for word in message.split_whitespace() {
        let is_place = word.starts_with('<') && words.last().is_some_and(|w| w.starts_with("--"));
        words.extend((!is_place).then_some(word));
    }
    words.join(" ")
}

/// Failures made of any error where it is known what it means.
pub(crate) trait IntoFailure<T> {
    /// Exit code 2: the input is at fault.
    fn refuse(self) -> Result<T>;

    /// Refuses an option or a file, whose name is put in front.
    fn refuse_within(self, part: impl fmt::Display) -> Result<T>;
}

impl<T, E: fmt::Display> IntoFailure<T> for std::result::Result<T, E> {
    fn refuse(self) -> Result<T> {
        self.map_err(|e| Failure::input(e))
    }

    fn refuse_within(self, part: impl fmt::Display) -> Result<T> {
        self.map_err(|e| Failure::input(format!("{part}: {e}")))
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// True if an error of the system is one of the contents: no text, no compressed data, cut off, too long.
pub(crate) const fn is_damage(kind: ErrorKind) -> bool {
    use ErrorKind as K;
    matches!(
        kind,
        K::InvalidData | K::InvalidInput | K::UnexpectedEof | K::FileTooLarge | K::Unsupported
    )
}

/// Message of a system error, in our words where it is frequent, without its number.
pub(crate) fn system_words(error: &io::Error) -> Cow<'static, str> {
    use ErrorKind as K;
    let words = match error.kind() {
        // an error of our own says more than its kind
        _ if error.get_ref().is_some() => return error.to_string().into(),
        K::PermissionDenied => "the system does not permit it",
        K::ReadOnlyFilesystem => "the disk is read-only",
        K::IsADirectory => "it is a directory, not a file",
        K::NotADirectory | K::AlreadyExists => "a file is where a directory is needed",
        K::StorageFull => "the disk is full",
        K::QuotaExceeded => "the quota is used up",
        _ => {
            let text = error.to_string();
            let words = text.split(" (os error").next().unwrap_or_default();
            return words.to_owned().into();
        }
    };
    words.into()
}

impl From<OutageError> for Failure {
    fn from(e: OutageError) -> Self {
        Self::input(&e).or_hint_if(e.hint().map(str::to_owned))
    }
}

impl From<ExperimentError> for Failure {
    fn from(e: ExperimentError) -> Self {
        let hint = match &e {
            ExperimentError::BetweenSamples(_) => Some(
                "another [gnss] rate_hz in --scenario: the IMU has the rate of the recordings"
                    .to_owned(),
            ),
            ExperimentError::Truth(TruthError::TooShort { .. }) => Some(
                "record for longer: each run takes a window as long as the trajectory".to_owned(),
            ),
            ExperimentError::Truth(TruthError::Rate { rate_hz, .. }) => {
                Some(format!("set rate_hz = {rate_hz} in [imu] of --scenario"))
            }
            _ => None,
        };
        Self::input(e).or_hint_if(hint)
    }
}

impl From<CalibrationError> for Failure {
    fn from(e: CalibrationError) -> Self {
        let hint = match e.cause {
            CalibrationFault::TooShort => "fewer --scales, or record for longer",
            CalibrationFault::TooFewScales => {
                "record for longer, or a --model with fewer processes"
            }
            CalibrationFault::NotPositive => {
                "quantization is too coarse for these scales: --estimator awv, or another range"
            }
            CalibrationFault::Trim => "a smaller --trim, or --estimator sr-awv",
            CalibrationFault::NoSlope => {
                "--model WN+RW, a sum of WN, RW and DR (and QN with its slope at the start); or --estimator gmwm"
            }
            CalibrationFault::Other => return Self::input(e),
        };
        Self::input(e).hint(hint)
    }
}

/// Errors of the numeric crates that need no advice, by the exit code that they mean.
macro_rules! failures {
    ($($make:ident: $($error:ty),*;)*) => {
        $($(impl From<$error> for Failure {
            fn from(e: $error) -> Self {
                Self::$make(e)
            }
        })*)*
    };
}

failures! {
    input: ReplicateError, Refused;
    failed: WaveletError;
}
