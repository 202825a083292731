//! TOML files, read as a type describes them: what is refused is named by file, line, key and value.
//!
//! Keys have paths, `outage[2].end_s`; entries of lists of tables are counted from 1.

mod paths;
mod values;

pub(crate) use paths::dotted;
pub(crate) use values::{
    Between, Finite, NonNegative, OneOrEach, Positive, Share, Stationary, Version,
};

use super::error::{FileError, Kind, Place, Setting};
use super::source;
use super::suggest::nearest;
use nav_sim_signal::units::SettingError;
use paths::{culprit, span_of};
use serde::de::DeserializeOwned;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::DeTable;

/// A TOML text and the name it goes by in messages.
#[derive(Debug)]
pub(crate) struct Source {
    path: String,
    text: String,
}

impl Source {
    /// The text of a file.
    ///
    /// # Errors
    /// When it cannot be read.
    pub(crate) fn read(path: &Path) -> Result<Self, FileError> {
        let text = source::text(path).map_err(|e| {
            let kind = e.kind();
            let error = FileError::io(path, e);
            match kind {
                ErrorKind::NotFound => error.advice("check the path").setting(Setting::StartFiles),
                ErrorKind::InvalidData => error.advice("a TOML file is text in UTF-8"),
                _ => error,
            }
        })?;
        super::hash::remember(path, text.as_bytes());
        Ok(Self {
            path: path.display().to_string(),
            text,
        })
    }

    /// A text that is in no file.
    pub(crate) fn new(path: &str, text: &str) -> Self {
        Self {
            path: path.into(),
            text: text.into(),
        }
    }

    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// The file as its description has it.
    ///
    /// # Errors
    /// Line and column of what is not TOML; line, key and value of what is refused, a mistyped key with the nearest legal one.
    pub(crate) fn get<T: DeserializeOwned>(&self) -> Result<T, FileError> {
        let table = self.table()?;
        T::deserialize(toml::de::Deserializer::from(table.clone()))
            .map_err(|e| self.explained(&e, &culprit::<T>(&table, &e)))
    }

    fn table(&self) -> Result<Spanned<DeTable<'_>>, FileError> {
        DeTable::parse(&self.text).map_err(|e| {
            let span = e.span().unwrap_or_default();
            let line_start = self.text[..span.start].rfind('\n').map_or(0, |i| i + 1);
            let column = self.text[line_start..span.start].chars().count() + 1;
            let key = self.text.get(span.clone()).unwrap_or_default().trim();
            let message = match e.message() {
                "duplicate key" => format!("the key \"{key}\" is there already"),
                other => other.to_owned(),
            };
            let place = Place::Character(self.line(span.start) as u64, column as u64);
            FileError::contents(self.path.as_str(), place, message)
        })
    }

    /// The line (from 1) a byte stands in.
    fn line(&self, offset: usize) -> usize {
        1 + self.text.as_bytes()[..offset.min(self.text.len())]
            .iter()
            .filter(|b| **b == b'\n')
            .count()
    }

    /// Where the value of a key is written, and whether it is: if not, the innermost table around it.
    fn place(&self, key: &str) -> (Range<usize>, bool) {
        self.table()
            .map_or((0..0, false), |table| span_of(table.get_ref(), key))
    }

    /// The line of a key, or of the innermost table around it that the file has.
    pub(crate) fn line_of(&self, key: &str) -> usize {
        self.line(self.place(key).0.start)
    }

    /// Something wrong in the line of a key.
    pub(crate) fn error(&self, key: &str, kind: Kind) -> FileError {
        FileError::new(self.path.as_str(), self.line_of(key), kind)
    }

    /// A refusal of the value of a key.
    pub(crate) fn refused(&self, key: &str, reason: impl Into<Box<str>>) -> FileError {
        let (span, is_set) = self.place(key);
        let span = if is_set { span } else { span.start..span.start };
        self.refused_at(span, key, reason)
    }

    fn refused_at(&self, span: Range<usize>, key: &str, reason: impl Into<Box<str>>) -> FileError {
        let value = shown(self.text.get(span.clone()).unwrap_or_default()).into();
        let kind = Kind::Value {
            key: key.into(),
            value,
            reason: reason.into(),
        };
        FileError::new(self.path.as_str(), self.line(span.start), kind)
    }

    /// The refusal of a setting by its rule.
    pub(crate) fn setting(&self, error: &SettingError) -> FileError {
        let reason = format!("is refused: {}", error.requirement);
        if self.place(&error.key).1 {
            return self
                .refused(&error.key, reason)
                .advice_if(error.advice.map(str::to_owned));
        }
        let (key, value, reason) = (
            error.key.as_str().into(),
            error.value.as_str().into(),
            reason.into(),
        );
        let refusal = self.error(&error.key, Kind::Value { key, value, reason });
        refusal
            .advice_if(error.advice.map(str::to_owned))
            .advice("the file does not set it: this is the default")
    }

    /// A key that means nothing where it stands, with the nearest that does.
    pub(crate) fn unknown<'a>(
        &self,
        key: &str,
        legal: impl Iterator<Item = &'a str> + Clone,
    ) -> FileError {
        let name = key.rsplit('.').next().unwrap_or_default();
        // what profiles call heading, tables and initial states call yaw
        let other_name = match name {
            "yaw_deg" => "heading_deg",
            "heading_deg" => "yaw_deg",
            _ => name,
        };
        let meant = legal
            .clone()
            .find(|word| *word == other_name)
            .or_else(|| nearest(name, legal.clone()));
        let hint = match meant {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => format!("legal here: {}", legal.collect::<Vec<_>>().join(", ")),
        };
        self.error(key, Kind::UnknownKey(key.into())).advice(hint)
    }

    /// A table that lacks a key, one of several that would do.
    pub(crate) fn missing(&self, table: &str, keys: &[&str]) -> FileError {
        let keys: Vec<String> = keys
            .iter()
            .map(|key| format!("\"{}\"", dotted(table, key)))
            .collect();
        let keys = keys.join(" or ");
        let advice = match keys.as_str() {
            "\"rate_hz\"" => "add rate_hz = 100.0, the sample rate (Hz)".to_owned(),
            _ => format!("add the key {keys}"),
        };
        self.error(table, Kind::MissingKey(keys.into()))
            .advice(advice)
    }

    /// A refusal by serde of the value of a key.
    fn explained(&self, error: &toml::de::Error, key: &str) -> FileError {
        let message = error.message();
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        match quoted.split_first() {
            Some((field, legal)) if message.starts_with("unknown field") => {
                let key = if key.rsplit('.').next() == Some(field) {
                    key.to_owned()
                } else {
                    dotted(key, field)
                };
                return self.unknown(&key, legal.iter().copied());
            }
            Some((field, _)) if message.starts_with("missing field") => {
                return self.missing(key, &[field]);
            }
            _ => {}
        }
        let (own, told) = (self.place(key).0, error.span().unwrap_or_default());
        let span = if own.start <= told.start && told.end <= own.end {
            told
        } else {
            own
        };
        let meant = quoted
            .split_first()
            .filter(|_| message.starts_with("unknown variant"));
        let advice = match meant.and_then(|(word, legal)| nearest(word, legal.iter().copied())) {
            Some(meant) => Some(format!("did you mean \"{meant}\"?")),
            None if message == Finite::REFUSAL => {
                Some("a number such as 1.5e-4; neither nan nor inf".to_owned())
            }
            None if message.starts_with("invalid type: map, expected a sequence") => {
                let name = key.rsplit('.').next().unwrap_or_default();
                Some(format!(
                    "there may be several: write [[{name}]], in double brackets"
                ))
            }
            None => None,
        };
        self.refused_at(span, key, reason(message, &quoted))
            .advice_if(advice)
    }
}

/// A value as it is shown: in one line, at most 60 characters of it.
fn shown(written: &str) -> String {
    written
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .chars()
        .take(60)
        .collect()
}

/// Why a value is refused, in words that follow it: serde's types in ours.
fn reason(message: &str, quoted: &[&str]) -> String {
    if message.starts_with("unknown variant") {
        let legal: Vec<String> = quoted
            .iter()
            .skip(1)
            .map(|word| format!("\"{word}\""))
            .collect();
        return format!("is not one of {}", legal.join(", "));
    }
    let expected = message
        .strip_prefix("invalid ")
        .and_then(|rest| rest.rsplit_once(", expected "));
    match expected.map(|(_, expected)| expected) {
        Some("f64") => "is not a number".to_owned(),
        Some("u8" | "u16" | "u32" | "u64" | "usize") => "is not a whole number ≥ 0".to_owned(),
        Some("a nonzero u64") => "is not a whole number ≥ 1".to_owned(),
        Some("a string") => "is not a text in quotes".to_owned(),
        Some("a sequence") => "is not a list".to_owned(),
        Some("a boolean") => "is not true or false".to_owned(),
        Some("path string") => "is not a path".to_owned(),
        Some(other) if other.starts_with("internally tagged enum") => "is not a table".to_owned(),
        Some(other) if !other.contains(' ') => format!("is refused: {message}"),
        Some(other) => format!(
            "is not {}",
            other.strip_prefix("struct").map_or(other, |_| "a table")
        ),
        // a type of ours says it in words that follow the value
        None if message.starts_with("is ") => message.to_owned(),
        None if message.starts_with("not ") => format!("is {message}"),
        None if message.starts_with("expected ") => message.replacen("expected", "is not", 1),
        None => format!("is refused: {message}"),
    }
}

#[cfg(test)]
mod tests;
