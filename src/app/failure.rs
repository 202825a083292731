//! What went wrong with a request, as the user reads it, and the exit code that it means.

use crate::commands::run::NavigateError;
use crate::formats::{FileError, Setting};
use nav_sim_calibration::{
    AnticipationError, AverageError, CalibrationError, Cause, FitError, SignalError,
};
use nav_sim_navigation::sensors::outage::OutageError;
use nav_sim_navigation::simulation::ExperimentError;
use nav_sim_signal::noise::ReplicateError;
use nav_sim_signal::noise::continuous::RateError;
use nav_sim_signal::wavelet::WaveletError;
use std::fmt;

/// A command without a result: exit code, message, place and help. 1 could not (I/O, numerics); 2 usage or input;
/// 3 a stated bound was not met; 75 stopped early, resume; 130 interrupted (143 by SIGTERM, 129 by SIGHUP).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    code: u8,
    message: String,
    help: Vec<Help>,
    place: Option<(String, Option<u64>)>,
}

/// Advice; with an option, it is for commands that have that option.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Help {
    option: Option<&'static str>,
    text: String,
}

/// The result of a command or of a part of it.
pub type Result<T, E = Failure> = std::result::Result<T, E>;

impl std::error::Error for Failure {}

impl Failure {
    fn new(code: u8, message: &impl ToString) -> Self {
        Self {
            code,
            message: message.to_string(),
            help: Vec::new(),
            place: None,
        }
    }

    /// Wrong input: usage, configuration, data (exit code 2).
    pub fn input(message: impl ToString) -> Self {
        Self::new(2, &message)
    }

    /// Could not: I/O, numerics (exit code 1).
    pub fn could_not(message: impl ToString) -> Self {
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

    /// Words that clap refuses: its first paragraph, the rest as advice.
    pub(crate) fn usage(e: &clap::Error) -> Self {
        let text = e.to_string();
        let text = text.strip_prefix("error: ").unwrap_or(&text);
        let mut paragraphs = text.split("\n\n").map(str::trim);
        let message = paragraphs.next().unwrap_or_default();
        let tip = paragraphs.find_map(|p| p.strip_prefix("tip: "));
        Self::input(message.split_whitespace().collect::<Vec<_>>().join(" "))
            .maybe_hint(tip.map(str::to_owned))
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

    /// With advice, in the place of other advice.
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.help.clear();
        self.or_option(None, hint)
    }

    /// With advice, if there is any.
    pub(crate) fn maybe_hint(self, hint: Option<String>) -> Self {
        match hint {
            Some(hint) => self.hint(hint),
            None => self,
        }
    }

    /// With further advice, for commands that have an option.
    pub(crate) fn or_option(
        mut self,
        option: Option<&'static str>,
        text: impl Into<String>,
    ) -> Self {
        let text = text.into();
        self.help.push(Help { option, text });
        self
    }

    /// Exit code of the program.
    #[must_use]
    pub const fn code(&self) -> u8 {
        self.code
    }

    /// The first advice.
    #[must_use]
    pub fn advice(&self) -> Option<&str> {
        self.advice_with(&|_| true)
    }

    /// The first advice for a command that has these options.
    pub(crate) fn advice_with(&self, has: &dyn Fn(&str) -> bool) -> Option<&str> {
        let fits = |help: &&Help| help.option.is_none_or(has);
        self.help.iter().find(fits).map(|help| help.text.as_str())
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

/// Failures made of any error where it is known what it means.
pub(crate) trait Refuse<T> {
    /// Exit code 2: the input is at fault.
    fn refuse(self) -> Result<T>;

    /// The same, of an option or a file.
    fn refuse_within(self, part: impl fmt::Display) -> Result<T>;
}

impl<T, E: fmt::Display> Refuse<T> for std::result::Result<T, E> {
    fn refuse(self) -> Result<T> {
        self.map_err(|e| Failure::input(e))
    }

    fn refuse_within(self, part: impl fmt::Display) -> Result<T> {
        self.map_err(|e| Failure::input(format!("{part}: {e}")))
    }
}

/// Advice on a result.
pub(crate) trait OrHelp<T> {
    /// With advice.
    fn or_help(self, text: impl Into<String>) -> Result<T>;
}

impl<T, E: Into<Failure>> OrHelp<T> for std::result::Result<T, E> {
    fn or_help(self, text: impl Into<String>) -> Result<T> {
        self.map_err(|e| e.into().hint(text))
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

impl From<ExperimentError> for Failure {
    fn from(e: ExperimentError) -> Self {
        let is_rate = matches!(e, ExperimentError::FixBetweenSamples { .. });
        let hint = "the IMU has the rate of the recordings: another [gnss] rate_hz in --scenario";
        Self::input(e).maybe_hint(is_rate.then(|| hint.to_owned()))
    }
}

impl From<SignalError> for Failure {
    fn from(e: SignalError) -> Self {
        Self::input(e).hint("fewer --scales, or record for longer")
    }
}

impl From<&CalibrationError> for Failure {
    fn from(e: &CalibrationError) -> Self {
        let hint = match &e.source {
            Cause::Fit(FitError::TooFewScales { .. }) => {
                Some("record for longer, or a --model with fewer processes")
            }
            Cause::Fit(FitError::NoSlope { .. }) => Some(
                "--model WN+RW, a sum of WN, RW and DR (and QN where the curve begins with its slope)",
            ),
            Cause::Fit(FitError::NotPositive { .. }) => Some(
                "the signal is quantised so coarsely that scales are silent: --estimator awv, or another range",
            ),
            Cause::Average(AverageError::Trim { .. }) => {
                Some("a smaller --trim, or --estimator sr-awv")
            }
            _ => None,
        };
        Self::input(e).maybe_hint(hint.map(str::to_owned))
    }
}

impl From<CalibrationError> for Failure {
    fn from(e: CalibrationError) -> Self {
        (&e).into()
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
    input: AnticipationError, NavigateError, ReplicateError, RateError;
    could_not: WaveletError;
}
