//! What went wrong, as the user reads it, and the exit code it means.

use nav_sim::calibration::SignalError;
use nav_sim::formats::atomic::WriteError;
use nav_sim::formats::recordings::RecordingError;
use nav_sim::formats::toml_file::TomlError;
use nav_sim::sensors::outage::OutageError;
use std::fmt;

/// A failure: exit code, message and hint. 1 could not (I/O, numerics); 2 usage or configuration;
/// 3 a stated bound was not met; 75 stopped early, resume; 130 interrupted.
#[derive(Debug)]
pub(crate) struct Failure {
    code: u8,
    message: String,
    hint: Option<String>,
}

impl Failure {
    /// Wrong input: usage, configuration, data (exit code 2).
    pub(crate) fn input(message: impl ToString) -> Self {
        Self { code: 2, message: message.to_string(), hint: None }
    }

    /// Could not: I/O, numerics (exit code 1).
    pub(crate) fn could_not(message: impl ToString) -> Self {
        Self { code: 1, message: message.to_string(), hint: None }
    }

    /// A stated bound was not met (exit code 3).
    pub(crate) fn bound(message: impl ToString) -> Self {
        Self { code: 3, message: message.to_string(), hint: None }
    }

    /// Stopped early, to be resumed (exit code 75).
    pub(crate) fn stopped(message: impl ToString) -> Self {
        Self { code: 75, message: message.to_string(), hint: None }
    }

    /// Interrupted by the user (exit code 130).
    pub(crate) fn interrupted(message: impl ToString) -> Self {
        Self { code: 130, message: message.to_string(), hint: None }
    }

    /// The same, of a part.
    pub(crate) fn within(self, part: &str) -> Self {
        Self { message: format!("{part}: {}", self.message), ..self }
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

    pub(crate) const fn code(&self) -> u8 {
        self.code
    }

    pub(crate) fn advice(&self) -> Option<&str> {
        self.hint.as_deref()
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<TomlError> for Failure {
    fn from(e: TomlError) -> Self {
        let failure = if e.is_content() { Self::input(&e) } else { Self::could_not(&e) };
        failure.maybe_hint(e.hint())
    }
}

impl From<WriteError> for Failure {
    fn from(e: WriteError) -> Self {
        let failure = if e.is_usage() { Self::input(&e) } else { Self::could_not(&e) };
        failure.maybe_hint(e.hint())
    }
}

impl From<RecordingError> for Failure {
    fn from(e: RecordingError) -> Self {
        let failure = if e.is_io() { Self::could_not(&e) } else { Self::input(&e) };
        failure.maybe_hint(e.hint())
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
