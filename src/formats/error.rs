//! What is wrong with a file: where, which key or column, which value, and what helps.

use super::source::is_damage;
use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::Path;

/// A file that cannot be read or written, or whose contents are refused.
#[derive(Debug)]
#[non_exhaustive]
pub struct FileError {
    /// The file or directory, as it was named.
    pub path: Box<str>,
    /// Where in it.
    pub(crate) place: Place,
    /// What is wrong.
    pub(crate) kind: Kind,
    /// What helps: any one of these.
    pub(crate) remedies: Vec<Remedy>,
}

/// Where in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Place {
    /// Anywhere in it.
    Within,
    /// The file as a whole: its name is the subject of the sentence.
    Itself,
    /// A line, from 1.
    Line(u64),
    /// Line and column, from 1.
    Character(u64, u64),
    /// A part that is no line: which.
    Part(Box<str>),
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

/// What is wrong with a file.
#[derive(Debug)]
#[non_exhaustive]
pub(crate) enum Kind {
    /// The system refuses: no such file, no permission, a full disk, damaged compression.
    System(io::Error),
    /// There is nothing in it.
    Empty(&'static str),
    /// It does not name its columns.
    Header(Box<str>),
    /// It lacks the columns that make it a file of this kind.
    Columns(Box<str>),
    /// A key means nothing there.
    UnknownKey(Box<str>),
    /// A key (dotted and quoted) is needed.
    MissingKey(Box<str>),
    /// The value of a key is refused.
    Value {
        /// Key, dotted.
        key: Box<str>,
        /// The value as written.
        value: Box<str>,
        /// Why, in words that follow the value: "is not …".
        reason: Box<str>,
    },
    /// The value in a column is refused.
    Cell {
        /// Name of the column.
        column: Box<str>,
        /// The value as written.
        value: Box<str>,
        /// Why, in words that follow the value.
        reason: Box<str>,
    },
    /// Anything else that it holds.
    Contents(Box<str>),
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::System(source) => f.write_str(&system_words(source)),
            Self::Empty(message) => f.write_str(message),
            Self::Header(message) | Self::Columns(message) | Self::Contents(message) => {
                f.write_str(message)
            }
            Self::UnknownKey(key) => write!(f, "unknown key \"{key}\""),
            Self::MissingKey(key) => write!(f, "{key} is missing"),
            Self::Value { key, value, reason } => write!(f, "\"{key}\" = {value} {reason}"),
            Self::Cell {
                column,
                value,
                reason,
            } => write!(f, "column \"{column}\": {value} {reason}"),
        }
    }
}

/// What the system said, in our words where it comes often, without its numbers.
pub(crate) fn system_words(error: &io::Error) -> Cow<'static, str> {
    use io::ErrorKind as K;
    let words = match error.kind() {
        // an error of our own says more than its kind
        _ if error.get_ref().is_some() => return error.to_string().into(),
        K::PermissionDenied => "the system does not permit it",
        K::ReadOnlyFilesystem => "the disk is read-only",
        K::IsADirectory => "it is a directory, not a file",
        K::NotADirectory | K::AlreadyExists => "a file is where a directory is needed",
        K::StorageFull => "no space is left on the disk",
        K::QuotaExceeded => "no space is left within the quota",
        _ => {
            let text = error.to_string();
            return text
                .split(" (os error")
                .next()
                .unwrap_or_default()
                .to_owned()
                .into();
        }
    };
    words.into()
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { path, kind, .. } = self;
        match &self.place {
            Place::Within => write!(f, "{path}: {kind}"),
            Place::Itself => write!(f, "{path} {kind}"),
            Place::Line(line) => write!(f, "{path}, line {line}: {kind}"),
            Place::Character(line, column) => {
                write!(f, "{path}, line {line}, column {column}: {kind}")
            }
            Place::Part(part) => write!(f, "{path}, {part}: {kind}"),
        }
    }
}

impl std::error::Error for FileError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &self.kind {
            Kind::System(source) => Some(source),
            _ => None,
        }
    }
}

impl FileError {
    /// Something wrong, without a remedy.
    pub(crate) fn new(path: impl Into<Box<str>>, place: impl Into<Place>, kind: Kind) -> Self {
        Self {
            path: path.into(),
            place: place.into(),
            kind,
            remedies: Vec::new(),
        }
    }

    /// What the system said of a file, and what helps.
    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        use io::ErrorKind as K;
        let advice = match source.kind() {
            K::UnexpectedEof => Some("the file is cut off: copy or pack it again"),
            K::PermissionDenied | K::ReadOnlyFilesystem => {
                Some("change the permissions of the file or its directory, or name another path")
            }
            K::IsADirectory => Some("name a file"),
            K::NotADirectory | K::AlreadyExists => {
                Some("name another path, or move that file away")
            }
            K::StorageFull | K::QuotaExceeded => Some("make room, or name a path on another disk"),
            _ => None,
        };
        let error = Self::new(
            path.display().to_string(),
            Place::Within,
            Kind::System(source),
        );
        error.advice_if(advice.map(str::to_owned))
    }

    /// What the system said of a file that was to be written, and what helps: another place if nothing else.
    pub(super) fn unwritable(path: &Path, source: io::Error) -> Self {
        let source = match source.kind() {
            // its directory is there or was made: where files are the system's own, it makes none
            io::ErrorKind::NotFound => {
                io::Error::new(source.kind(), "the system makes no file or directory there")
            }
            _ => source,
        };
        let error = Self::io(path, source);
        if error.remedies.is_empty() {
            error.advice("name another path")
        } else {
            error
        }
    }

    /// Contents that are refused, in words.
    pub(crate) fn contents(
        path: impl Into<Box<str>>,
        place: impl Into<Place>,
        message: impl Into<Box<str>>,
    ) -> Self {
        Self::new(path, place, Kind::Contents(message.into()))
    }

    /// A value in a column that is refused.
    pub(crate) fn cell(
        path: &str,
        line: u64,
        column: &str,
        value: impl Into<Box<str>>,
        reason: impl Into<Box<str>>,
    ) -> Self {
        let (value, reason) = (value.into(), reason.into());
        let is_decimal = &*reason == "is not a number" && decimal_comma(value.trim_matches('"'));
        let error = Self::new(
            path,
            line,
            Kind::Cell {
                column: column.into(),
                value,
                reason,
            },
        );
        if is_decimal {
            error.advice("write decimals with a point: 0.5, not 0,5")
        } else {
            error
        }
    }

    /// A row with too few or too many values.
    pub(super) fn row_length(path: &str, line: u64, found: usize, expected: usize) -> Self {
        Self::contents(
            path,
            line,
            format!("{found} values, but {expected} columns"),
        )
        .advice("every row needs one value a column; was the file cut off?")
    }

    /// With advice, beside what it has.
    pub(crate) fn advice(mut self, advice: impl Into<Cow<'static, str>>) -> Self {
        self.remedies.push(Remedy::Advice(advice.into()));
        self
    }

    /// With advice, if there is any.
    pub(crate) fn advice_if(self, advice: Option<String>) -> Self {
        match advice {
            Some(advice) => self.advice(advice),
            None => self,
        }
    }

    /// With other advice than it has.
    pub(crate) fn advice_instead(mut self, advice: impl Into<Cow<'static, str>>) -> Self {
        self.remedies.clear();
        self.advice(advice)
    }

    /// With a setting that helps, beside what it has.
    pub(crate) fn setting(mut self, setting: Setting) -> Self {
        self.remedies.push(Remedy::Setting(setting));
        self
    }

    /// The line, from 1, where it is of one.
    #[must_use]
    pub fn line(&self) -> Option<u64> {
        match self.place {
            Place::Line(line) | Place::Character(line, _) => Some(line),
            _ => None,
        }
    }

    /// Whether the system, not the contents or the request, is at fault.
    pub(crate) fn is_system(&self) -> bool {
        // what has a number of the system is its own: a file that may not grow, too
        matches!(&self.kind, Kind::System(source) if source.raw_os_error().is_some() || !is_damage(source.kind()))
    }

    /// What helps, in words for users of the library.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        self.hint_with(|setting| Some(setting.words()))
    }

    /// What helps, where `words` says how a setting is made. What cannot be set there is left out.
    pub(crate) fn hint_with(
        &self,
        words: impl Fn(Setting) -> Option<&'static str>,
    ) -> Option<String> {
        let known = self.remedies.iter().filter_map(|remedy| match remedy {
            Remedy::Advice(advice) => Some(advice.as_ref()),
            Remedy::Setting(setting) => words(*setting),
        });
        let known: Vec<&str> = known.collect();
        (!known.is_empty()).then(|| known.join(", or "))
    }
}

/// Whether a text is a number with a decimal comma.
pub(super) fn decimal_comma(text: &str) -> bool {
    text.contains(',') && text.replacen(',', ".", 1).trim().parse::<f64>().is_ok()
}

/// One way out.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub(crate) enum Remedy {
    /// Something to do about the file.
    Advice(Cow<'static, str>),
    /// A setting of what reads or writes it.
    Setting(Setting),
}

/// A setting that may help. The program says it as an option of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Setting {
    ColumnNames,
    Channels,
    FewerChannels,
    Gaps,
    Rate,
    WrongRate,
    Skip,
    Origin,
    Output,
    OutputDirectory,
    Force,
    StartFiles,
    FixSigma,
    RemoveLine,
    Topic,
    Stamp,
}

impl Setting {
    const fn words(self) -> &'static str {
        match self {
            Self::ColumnNames => "give the names of the columns",
            Self::Channels => "leave the channel out",
            Self::FewerChannels => "take fewer channels at a time",
            Self::Gaps => "split the recording at its gaps, or ignore them",
            Self::Rate => "give the sample rate",
            Self::WrongRate => "leave the given rate out, or correct it",
            Self::Skip => "leave out less of its beginning",
            Self::Origin => "give an origin on the Earth",
            Self::Output => "choose another output",
            Self::OutputDirectory => "choose another directory",
            Self::Force => "choose another place, or replace it",
            Self::StartFiles => "start from an example",
            Self::RemoveLine => {
                "remove the line, and split the recording at the gap that it leaves, or ignore that"
            }
            Self::FixSigma => "give standard deviations for all fixes",
            Self::Topic => "name the topic",
            Self::Stamp => "take the stamps of arrival",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimal_comma_is_told_wherever_a_cell_is_no_number() {
        let hint =
            |value: &str| FileError::cell("a.csv", 2, "t_s", value, "is not a number").hint();
        for value in ["\"0,05\"", "-1,5e3"] {
            assert_eq!(
                hint(value).unwrap(),
                "write decimals with a point: 0.5, not 0,5"
            );
        }
        assert_eq!((hint("\"1,2,3\""), hint("\"abc\"")), (None, None));
    }

    #[test]
    fn remedies_are_said_in_the_words_of_who_asks() {
        let e = FileError::contents("a.csv", 3_u64, "no unit")
            .advice("name it")
            .setting(Setting::ColumnNames)
            .setting(Setting::Channels);
        assert_eq!(e.to_string(), "a.csv, line 3: no unit");
        assert_eq!(
            e.hint().unwrap(),
            "name it, or give the names of the columns, or leave the channel out"
        );
        let only_names = |setting| (setting == Setting::ColumnNames).then_some("--columns");
        assert_eq!(e.hint_with(only_names).unwrap(), "name it, or --columns");
        assert_eq!(
            FileError::contents("a", Place::Within, "b")
                .setting(Setting::Gaps)
                .hint_with(|_| None),
            None
        );
    }

    #[test]
    fn damage_is_not_the_systems_fault() {
        let e = |kind: io::ErrorKind| FileError::io(Path::new("a.gz"), kind.into());
        assert!(
            e(io::ErrorKind::NotFound).is_system() && !e(io::ErrorKind::UnexpectedEof).is_system()
        );
        assert!(!FileError::contents("a", Place::Itself, "is cut off").is_system());
        assert!(e(io::ErrorKind::UnexpectedEof).hint().is_some());
    }

    /// The numbers are those of POSIX (errno.h).
    #[cfg(target_os = "linux")]
    #[test]
    fn the_system_is_told_in_our_words() {
        for (number, told, hint) in [
            (2, "a: No such file or directory", None),
            (
                13,
                "a: the system does not permit it",
                Some("change the permissions"),
            ),
            (
                17,
                "a: a file is where a directory is needed",
                Some("name another path"),
            ),
            (
                20,
                "a: a file is where a directory is needed",
                Some("name another path"),
            ),
            (21, "a: it is a directory, not a file", Some("name a file")),
            (28, "a: no space is left on the disk", Some("make room")),
            (5, "a: Input/output error", None),
            (27, "a: File too large", None),
        ] {
            let e = FileError::io(Path::new("a"), io::Error::from_raw_os_error(number));
            assert!(e.to_string() == told && e.is_system(), "{e}");
            let is_hinted = |start: &str| e.hint().is_some_and(|given| given.starts_with(start));
            assert!(
                hint.map_or(e.hint().is_none(), is_hinted),
                "{number}: {:?}",
                e.hint()
            );
        }
    }
}
