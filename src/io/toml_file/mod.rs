//! TOML files, read as a type describes them: what is refused is named by file, line, key and value.
//!
//! Keys have paths, `outage[2].end_s`; entries of lists of tables are counted from 1.

mod node;
mod values;

pub(crate) use values::{
    Between, Finite, NonNegative, OneOrEach, Positive, Share, Stationary, Version,
};

use super::source;
use super::suggest::nearest;
use super::{Failure, Place, help};
use nav_sim_signal::units::SettingError;
use node::{Node, Refusal, What};
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::Path;
use toml::de::{DeTable, DeValue};

/// A key with the path of its table before it.
fn dotted(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

/// Where the value of a path is written, and whether it is: if not, the span of the innermost table around it.
fn span_of(table: &DeTable<'_>, path: &str) -> (Range<usize>, bool) {
    let (mut table, mut span) = (Some(table), 0..0);
    for part in path.split('.').filter(|part| !part.is_empty()) {
        let (key, entry) = part.split_once('[').unwrap_or((part, ""));
        let Some(value) = table.and_then(|table| table.get(key)) else {
            return (span, false);
        };
        let entry = entry.trim_end_matches(']').parse::<usize>().ok();
        let inner = entry.and_then(|i| value.get_ref().as_array()?.get(i.checked_sub(1)?));
        let value = inner.unwrap_or(value);
        (table, span) = (value.get_ref().as_table(), value.span());
    }
    (span, !path.is_empty())
}

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
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let text = source::text(path).map_err(|e| {
            let kind = e.kind();
            let error = Failure::io(path, e);
            match kind {
                ErrorKind::NotFound => error.or_hint("check the path").or(help::START_FILES),
                ErrorKind::InvalidData => error.or_hint("a TOML file is text in UTF-8"),
                _ => error,
            }
        })?;
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
    pub(crate) fn get<T: DeserializeOwned>(&self) -> Result<T, Failure> {
        let table = DeTable::parse(&self.text).map_err(|e| self.syntax(&e))?;
        let value = DeValue::Table(table.into_inner());
        T::deserialize(Node(&value)).map_err(|refusal| self.explained(refusal))
    }

    fn syntax(&self, e: &toml::de::Error) -> Failure {
        let span = e.span().unwrap_or_default();
        let line_start = self.text[..span.start].rfind('\n').map_or(0, |i| i + 1);
        let column = self.text[line_start..span.start].chars().count() + 1;
        let key = self.text.get(span.clone()).unwrap_or_default().trim();
        let message = match e.message() {
            "duplicate key" => format!("the key \"{key}\" is there already"),
            other => other.to_owned(),
        };
        let place = Place::Character(self.line(span.start) as u64, column as u64);
        self.at(place, message)
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
        let table = DeTable::parse(&self.text);
        table.map_or((0..0, false), |table| span_of(table.get_ref(), key))
    }

    /// The line of a key, or of the innermost table around it that the file has.
    pub(crate) fn line_of(&self, key: &str) -> usize {
        self.line(self.place(key).0.start)
    }

    /// Something wrong at a place; of a text that nobody sees, without a name, the place is left out.
    fn at(&self, place: impl Into<Place>, message: impl Display) -> Failure {
        match self.path.as_str() {
            "" => Failure::input(message),
            path => Failure::contents(path, place, message),
        }
    }

    /// Something wrong in the line of a key.
    fn error(&self, key: &str, message: impl Display) -> Failure {
        self.at(self.line_of(key), message)
    }

    /// A refusal of the value of a key.
    pub(crate) fn refused(&self, key: &str, reason: impl Display) -> Failure {
        let (span, is_set) = self.place(key);
        let span = if is_set { span } else { span.start..span.start };
        self.refused_at(span, key, reason)
    }

    fn refused_at(&self, span: Range<usize>, key: &str, reason: impl Display) -> Failure {
        let line = self.line(span.start);
        let value = shown(self.text.get(span).unwrap_or_default());
        self.at(line, format!("\"{key}\" = {value} {reason}"))
    }

    /// The refusal of a setting by its rule.
    pub(crate) fn setting(&self, error: &SettingError) -> Failure {
        let SettingError {
            key,
            value,
            requirement,
            advice,
            ..
        } = error;
        let advice = advice.map(str::to_owned);
        if self.place(key).1 {
            let refusal = self.refused(key, format!("is refused: {requirement}"));
            return refusal.or_hint_if(advice);
        }
        self.error(
            key,
            format!("\"{key}\" = {value} is refused: {requirement}"),
        )
        .or_hint_if(advice)
        .or_hint("the file does not set it: this is the default")
    }

    /// A key that means nothing where it stands, with the nearest that does.
    pub(crate) fn unknown<'a>(
        &self,
        key: &str,
        legal: impl Iterator<Item = &'a str> + Clone,
    ) -> Failure {
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
        self.error(key, format!("unknown key \"{key}\""))
            .or_hint(hint)
    }

    /// A table that lacks a key, one of several that would do.
    pub(crate) fn missing(&self, table: &str, keys: &[&str]) -> Failure {
        let keys: Vec<String> = keys
            .iter()
            .map(|key| format!("\"{}\"", dotted(table, key)))
            .collect();
        let keys = keys.join(" or ");
        let advice = match keys.as_str() {
            "\"rate_hz\"" => "add rate_hz = 100.0, the sample rate (Hz)".to_owned(),
            _ => format!("add the key {keys}"),
        };
        self.error(table, format!("{keys} is missing"))
            .or_hint(advice)
    }

    /// The refusal of a value or key by its type.
    fn explained(&self, refusal: Refusal) -> Failure {
        let key = refusal.path;
        match refusal.what {
            What::Unknown(field, legal) => {
                self.unknown(&dotted(&key, &field), legal.iter().copied())
            }
            What::Missing(field) => self.missing(&key, &[field]),
            What::Variant(word, legal) => {
                let meant = nearest(&word, legal.iter().copied());
                let words: Vec<String> = legal.iter().map(|w| format!("\"{w}\"")).collect();
                self.of_value(&key, format!("is not one of {}", words.join(", ")))
                    .or_hint_if(meant.map(|meant| format!("did you mean \"{meant}\"?")))
            }
            What::NoList => {
                let name = key.rsplit('.').next().unwrap_or_default();
                let advice = format!("there may be several: write [[{name}]], in double brackets");
                self.of_value(&key, "is not a list").or_hint(advice)
            }
            What::Reason(reason) => self.of_value(&key, reason),
        }
    }

    /// A refusal of a value; an entry of a list of plain values goes by the name of the list.
    fn of_value(&self, key: &str, reason: impl Display) -> Failure {
        let span = self.place(key).0;
        self.refused_at(
            span,
            key.strip_suffix(']')
                .map_or(key, |k| k.rsplit_once('[').map_or(key, |k| k.0)),
            reason,
        )
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

#[cfg(test)]
mod tests;
