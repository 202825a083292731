//! What went wrong with a request, as the user reads it, and the exit code that it means.

use crate::formats::{FileError, Setting};
use nav_sim_calibration::SignalError;
use nav_sim_navigation::sensors::outage::OutageError;
use std::fmt;

/// A request without an answer: exit code, message and hint. 1 could not (I/O, numerics); 2 usage or configuration;
/// 3 a stated bound was not met; 75 stopped early, resume; 130 interrupted (143 by SIGTERM, 129 by SIGHUP).
#[derive(Debug)]
pub struct Failure {
    code: u8,
    message: String,
    hint: Option<String>,
    place: Option<(String, Option<u64>)>,
}

impl std::error::Error for Failure {}

impl Failure {
    fn new(code: u8, message: &impl ToString) -> Self {
        Self {
            code,
            message: message.to_string(),
            hint: None,
            place: None,
        }
    }

    /// Wrong input: usage, configuration, data (exit code 2).
    pub(crate) fn input(message: impl ToString) -> Self {
        Self::new(2, &message)
    }

    /// Could not: I/O, numerics (exit code 1).
    pub(crate) fn could_not(message: impl ToString) -> Self {
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

    /// What is wrong with a file, for a command whose options `option` knows.
    pub(crate) fn of_file(e: &FileError, option: impl Fn(Setting) -> Option<&'static str>) -> Self {
        let failure = if e.is_system() {
            Self::could_not(e)
        } else {
            Self::input(e)
        };
        Self {
            place: Some((e.path.to_string(), e.line())),
            ..failure
        }
        .maybe_hint(e.hint_with(option))
    }

    /// The same, of a part.
    pub(crate) fn within(self, part: &str) -> Self {
        Self {
            message: format!("{part}: {}", self.message),
            ..self
        }
    }

    /// With advice.
    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// With advice, if there is any.
    pub(crate) fn maybe_hint(mut self, hint: Option<String>) -> Self {
        self.hint = hint.or(self.hint);
        self
    }

    /// Exit code of the program.
    #[must_use]
    pub const fn code(&self) -> u8 {
        self.code
    }

    /// What helps.
    #[must_use]
    pub fn advice(&self) -> Option<&str> {
        self.hint.as_deref()
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

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<FileError> for Failure {
    fn from(e: FileError) -> Self {
        Self::of_file(&e, |setting| Some(option_for(setting)))
    }
}

/// How the commands say a setting that helps.
pub(crate) const fn option_for(setting: Setting) -> &'static str {
    match setting {
        Setting::ColumnNames => "correct the header",
        Setting::Channels => "leave the axis out with --axes",
        Setting::FewerChannels => "take fewer signals at a time with --axes",
        Setting::Gaps => {
            "--gaps split takes the stretches between as recordings of their own; --gaps ignore takes the samples as \
             evenly spaced (stamped late, none lost)"
        }
        Setting::Rate => "give the rate with --rate-hz",
        Setting::WrongRate => "leave --rate-hz out, or correct it",
        Setting::Skip => "a smaller --skip-s",
        Setting::Origin => "give --origin LAT_DEG,LON_DEG,H_M",
        Setting::Output => "choose another output with --out",
        Setting::Force => "name another place for it, or replace it with --force",
        Setting::OutputDirectory => "choose another directory with --out",
        Setting::RemoveLine => "remove the line",
        Setting::FixSigma => "give them for all fixes with --gnss-sigma POS[:VEL]",
        Setting::Topic => "--topic NAME names one (nav-sim inspect lists them)",
        Setting::Stamp => "--stamp log takes the times of arrival",
        Setting::StartFiles => "start from the files that nav-sim init makes",
    }
}

/// What helps where the setting is no option of the command.
pub(crate) const fn option_elsewhere(setting: Setting) -> &'static str {
    match setting {
        Setting::Origin => {
            "write it with latitude and longitude: nav-sim trajectory convert FILE --origin LAT_DEG,LON_DEG,H_M"
        }
        other => option_for(other),
    }
}

impl From<OutageError> for Failure {
    fn from(e: OutageError) -> Self {
        Self::input(&e).maybe_hint(e.hint().map(str::to_owned))
    }
}

impl From<SignalError> for Failure {
    fn from(e: SignalError) -> Self {
        Self::input(e).hint("fewer --scales, or record for longer")
    }
}
