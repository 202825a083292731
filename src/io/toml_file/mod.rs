//! TOML files, read as a type describes them: what is refused is named by file, line, key and value.
//!
//! The JSON schema of the type, which editors have too, is what a file is checked against: its keys, kinds of values,
//! words and bounds. Keys have paths, `outage[2].end_s`; entries of lists are counted from 1.

use super::model_file::HINT;
use super::suggest::nearest;
use super::table::shown;
use super::{Failure, Place, source};
use nav_sim_navigation::sensors::check_number;
use nav_sim_signal::units::SettingError;
use schemars::{JsonSchema, schema_for};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value as Schema;
use std::fmt::Display;
use std::io::ErrorKind;
use std::iter::once;
use std::ops::Range;
use std::path::Path;
use toml::de::DeTable;
use toml::{Table, Value};

/// A key with the path of its table before it.
fn dotted(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

/// Span of the value at a path, and true if it exists; else the span of the innermost table around
/// it.
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

/// Path of the schema of a kind of file, below a directory of `init`: the `#:schema` line of a file leads editors there.
pub(crate) fn schema_path(kind: &str) -> String {
    format!("schemas/{kind}.schema.json")
}

/// A TOML text and the name it goes by in messages.
#[derive(Debug)]
pub(crate) struct TomlSource {
    path: String,
    text: String,
}

impl TomlSource {
    /// The text of a file.
    ///
    /// # Errors
    /// When it cannot be read.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let text = source::text(path).map_err(|e| {
            let advice = match e.kind() {
                ErrorKind::NotFound => Some("start from the files of nav-sim init"),
                _ => None,
            };
            Failure::io(path, e).or_hint_if(advice.map(str::to_owned))
        })?;
        Ok(Self::new(&path.display().to_string(), &text))
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

    /// The file by the names of its keys.
    ///
    /// # Errors
    /// Line of what is not TOML.
    pub(crate) fn table(&self) -> Result<Table, Failure> {
        self.text.parse().map_err(|e| self.syntax(&e))
    }

    /// The file as its description has it.
    ///
    /// # Errors
    /// Line of what is not TOML; line, key and value of what is refused, a mistyped key with the nearest legal one.
    pub(crate) fn get<T: DeserializeOwned + JsonSchema>(&self) -> Result<T, Failure> {
        let value = Value::Table(self.table()?);
        let (source, root) = (self, &schema_for!(T).to_value());
        Checker { source, root }.check(root, &value, "")?;
        let read = value.try_into();
        read.map_err(|e: toml::de::Error| self.at(Place::Within, e.message()))
    }

    fn syntax(&self, e: &toml::de::Error) -> Failure {
        let span = e.span().unwrap_or_default();
        let line = self.line(span.start);
        let written = self.text.get(span).unwrap_or_default().trim();
        let digits = written.trim_start_matches(['+', '-']);
        let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
        let message = match is_number {
            true => "beyond 9223372036854775807, the largest whole number",
            false => e.message(),
        };
        let text = self.text.lines().nth(line - 1).unwrap_or_default();
        let mut values = text.split('=').skip(1).map(str::trim_start);
        let is_decimal = |value: &str| {
            let (whole, rest) = value.split_once(',')?;
            let is_digits = whole.trim_start_matches(['+', '-']).parse::<u64>().is_ok();
            let digit = rest.chars().next().filter(char::is_ascii_digit);
            digit.filter(|_| is_digits)
        };
        let is_comma = values.any(|value| is_decimal(value).is_some());
        let written = shown(written, 40);
        let refusal = self.at(line, format!("{message}: \"{written}\""));
        let hint = is_comma.then(|| "write decimals with a point: 0.5, not 0,5".to_owned());
        refusal.or_hint_if(hint)
    }

    /// The line (from 1) a byte stands in.
    fn line(&self, offset: usize) -> usize {
        1 + self.text.as_bytes()[..offset.min(self.text.len())]
            .iter()
            .filter(|b| **b == b'\n')
            .count()
    }

    /// Span of the value of a key, and true if it exists; else the innermost table around it.
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

    /// A refusal of the value of a key; an entry of a list of plain values goes by the name of the list.
    pub(crate) fn refused(&self, key: &str, reason: impl Display) -> Failure {
        let (span, is_set) = self.place(key);
        let line = self.line(span.start);
        if !is_set {
            return self.at(line, format!("\"{key}\" {reason}"));
        }
        let written = self.text.get(span).unwrap_or_default();
        let value: String = written.split_whitespace().collect::<Vec<_>>().join(" ");
        let value: String = value.chars().take(60).collect();
        let entry = key.strip_suffix(']').and_then(|key| key.rsplit_once('['));
        let key = entry.map_or(key, |(list, _)| list);
        self.at(line, format!("\"{key}\" = {value} {reason}"))
    }

    /// The refusal of a setting by its rule.
    pub(crate) fn setting(&self, error: &SettingError) -> Failure {
        let SettingError { key, value, .. } = error;
        let reason = format!("is refused: {}", error.requirement);
        let is_set = self.place(key).1;
        let refusal = match is_set {
            true => self.refused(key, reason),
            false => self.error(key, format!("\"{key}\" = {value} {reason}")),
        };
        let default = "not set in the file: this is the default";
        let advice = error.advice.into_iter();
        let advice = advice.chain((!is_set).then_some(default));
        advice.fold(refusal, Failure::or_hint)
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
            None if name.starts_with("v_u") => {
                "down is positive: v_d_m_s, of the other sign".into()
            }
            None => format!("legal here: {}", legal.collect::<Vec<_>>().join(", ")),
        };
        self.error(key, format!("unknown key \"{key}\""))
            .or_hint(hint)
    }

    /// A table that lacks a key, one of several that would do.
    pub(crate) fn missing(&self, table: &str, keys: &[&str]) -> Failure {
        let advice = match (table, keys) {
            ("", ["rate_hz"]) => "add rate_hz = 100.0, the sample rate (Hz)".to_owned(),
            ("", _) => format!("add {}", keys.join(" or ")),
            _ => format!("add {} to {table}", keys.join(" or ")),
        };
        let paths = keys.iter().map(|key| format!("\"{}\"", dotted(table, key)));
        let paths: Vec<String> = paths.collect();
        self.error(table, format!("{} is missing", paths.join(" or ")))
            .or_hint(advice)
    }

    /// The refusal of a word that is none of these.
    fn no_word(&self, key: &str, word: &str, words: &[&str]) -> Failure {
        let meant = nearest(word, words.iter().copied());
        let words: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
        self.refused(key, format!("is not one of {}", words.join(", ")))
            .or_hint_if(meant.map(|meant| format!("did you mean \"{meant}\"?")))
    }
}

#[cfg(test)]
mod tests;

// A file against the schema of its type.

struct Checker<'a> {
    source: &'a TomlSource,
    root: &'a Schema,
}

/// Words that a schema lists.
fn words(schema: &Schema) -> impl Iterator<Item = &str> {
    let listed = schema["enum"].as_array().into_iter().flatten();
    once(&schema["const"])
        .chain(listed)
        .filter_map(Schema::as_str)
}

impl<'a> Checker<'a> {
    /// The schema that one refers to.
    fn resolved(&self, schema: &'a Schema) -> &'a Schema {
        let of = |place: &str| self.root.pointer(&place[1..]);
        let place = schema["$ref"].as_str();
        place.map_or(schema, |place| of(place).expect("schema"))
    }

    /// Alternatives, of which a value meets one.
    fn kinds(&self, schema: &'a Schema) -> Vec<&'a Schema> {
        let lists = ["oneOf", "anyOf"].map(|name| schema[name].as_array());
        let kinds = lists.into_iter().flatten().flatten();
        kinds.map(|kind| self.resolved(kind)).collect()
    }

    /// True if a value is of the type of a schema. A number may stand for a word.
    fn admits(&self, schema: &'a Schema, value: &Value) -> bool {
        let is = |name: &str| schema["type"].to_string().contains(name);
        let is_own = match value {
            Value::Integer(_) => {
                is("number") || is("integer") || is("string") && words(schema).next().is_some()
            }
            Value::Float(_) => is("number"),
            Value::String(_) => is("string"),
            Value::Datetime(_) => false,
            Value::Boolean(_) => is("boolean"),
            Value::Array(_) => is("array"),
            Value::Table(_) => is("object"),
        };
        let kinds = self.kinds(schema);
        (is_own || schema["type"].is_null())
            && (kinds.is_empty() || kinds.iter().any(|kind| self.admits(kind, value)))
    }

    /// The type of a schema in words.
    fn expected(&self, schema: &'a Schema) -> &'static str {
        let own = &schema["type"];
        match own.as_str().or(own[0].as_str()) {
            Some("number") => "a number",
            Some("integer") => "a whole number",
            Some("string") => "a text in quotes",
            Some("boolean") => "true or false",
            Some("array") => "a list",
            Some(_) => "a table",
            None => self
                .kinds(schema)
                .first()
                .map_or("", |kind| self.expected(kind)),
        }
    }

    /// The kind of a table, told by the word or the key that it has and others have not.
    fn kind_of_table(
        &self,
        (schema, kinds): (&Schema, &[&'a Schema]),
        table: &Table,
        path: &str,
    ) -> Result<&'a Schema, Failure> {
        fn key_of(kind: &Schema) -> Option<&str> {
            kind["required"][0].as_str()
        }
        let mut properties = kinds[0]["properties"].as_object().into_iter().flatten();
        if let Some((tag, _)) = properties.find(|(_, schema)| schema["const"].is_string()) {
            let words = kinds
                .iter()
                .map(|kind| kind["properties"][tag]["const"].as_str());
            let missing = || self.source.missing(path, &[tag]);
            let word = table.get(tag).ok_or_else(missing)?.as_str();
            let found = kinds
                .iter()
                .zip(words.clone())
                .find(|(_, own)| *own == word);
            let all: Vec<&str> = words.flatten().collect();
            let key = dotted(path, tag);
            let no_word = || self.source.no_word(&key, word.unwrap_or_default(), &all);
            return found.map(|(kind, _)| *kind).ok_or_else(no_word);
        }
        let is_given = |kind: &&&Schema| key_of(kind).is_none_or(|key| table.contains_key(key));
        let mut given = kinds.iter().filter(is_given);
        match (given.next(), given.next()) {
            (None, _) => {
                let keys: Vec<&str> = kinds.iter().filter_map(|kind| key_of(kind)).collect();
                let is_slip = |key: &&String| {
                    schema["properties"][*key].is_null() && nearest(key, keys.clone()).is_some()
                };
                Err(match table.keys().find(is_slip) {
                    Some(key) => self
                        .source
                        .unknown(&dotted(path, key), keys.iter().copied()),
                    None => self.source.missing(path, &keys),
                })
            }
            (Some(only), None) => Ok(only),
            (Some(first), Some(second)) => {
                let [first, second] = [first, second].map(|kind| key_of(kind).unwrap_or_default());
                let key = dotted(path, second);
                let refusal = self.source.refused(&key, format!("beside {first}"));
                Err(refusal.or_hint("give one of them"))
            }
        }
    }

    /// The schemas that a value has to meet: its own and, of alternatives, the one that it is of.
    fn parts(
        &self,
        schema: &'a Schema,
        value: &Value,
        path: &str,
    ) -> Result<Vec<&'a Schema>, Failure> {
        let schema = self.resolved(schema);
        if !self.admits(schema, value) {
            let expected = self.expected(schema);
            let several = || {
                let names = path.split('.').map(|part| part.split('[').next());
                let names: Vec<&str> = names.flatten().collect();
                let name = names.join(".");
                format!("write [[{name}]], in double brackets")
            };
            // Tables, each under its own header; a list of numbers has none.
            let is_one = expected == "a list"
                && value.is_table()
                && self.admits(self.resolved(&schema["items"]), value);
            let refusal = self.source.refused(path, format!("is not {expected}"));
            return Err(refusal.or_hint_if(is_one.then(several)));
        }
        let mut kinds = self.kinds(schema);
        kinds.retain(|kind| self.admits(kind, value));
        let listed: Vec<&str> = once(schema).chain(kinds.clone()).flat_map(words).collect();
        let kind = match value {
            _ if !listed.is_empty() => {
                let text = value
                    .as_str()
                    .map_or_else(|| value.to_string(), str::to_owned);
                return match listed.contains(&text.as_str()) {
                    true => Ok(vec![schema]),
                    false => Err(self.source.no_word(path, &text, &listed)),
                };
            }
            Value::Table(table) if !kinds.is_empty() => {
                Some(self.kind_of_table((schema, &kinds), table, path)?)
            }
            _ => kinds.first().copied(),
        };
        let mut parts = vec![schema];
        if let Some(kind) = kind {
            parts.extend(self.parts(kind, value, path)?);
        }
        Ok(parts)
    }

    fn check(&self, schema: &'a Schema, value: &Value, path: &str) -> Result<(), Failure> {
        let parts = self.parts(schema, value, path)?;
        let schema = parts[parts.len() - 1];
        match value {
            Value::Table(table) => self.check_table(&parts, table, path),
            Value::Array(list) => {
                let [least, most] = ["minItems", "maxItems"].map(|name| schema[name].as_u64());
                let reason = match least {
                    Some(n) if most.is_some() && n != list.len() as u64 => {
                        format!("is not a list of {n}")
                    }
                    Some(_) if list.is_empty() => "lists none".to_owned(),
                    _ => {
                        let mut entries = (1..).zip(list);
                        return entries.try_for_each(|(i, entry)| {
                            self.check(&schema["items"], entry, &format!("{path}[{i}]"))
                        });
                    }
                };
                Err(self.source.refused(path, reason))
            }
            Value::Integer(_) | Value::Float(_) if !schema["type"].is_null() => {
                let number = value.as_integer().map(|number| number as f64);
                let number = number.or(value.as_float()).unwrap_or(f64::NAN);
                let hint = schema[HINT].as_str().map(str::to_owned);
                let refused = |e| self.source.setting(&e).or_hint_if(hint);
                check_number(schema, number, path).map_err(refused)
            }
            _ => Ok(()),
        }
    }

    fn check_table(&self, parts: &[&'a Schema], table: &Table, path: &str) -> Result<(), Failure> {
        let named = || {
            let properties = parts
                .iter()
                .filter_map(|part| part["properties"].as_object());
            properties.flatten()
        };
        let rest = ["additionalProperties", "unevaluatedProperties"];
        let rest = rest
            .iter()
            .flat_map(|name| parts.iter().filter_map(|part| part.get(*name)));
        let rest = rest.last();
        let schema = |key: &str| {
            let own = named().find(|(name, _)| *name == key);
            own.map(|(_, schema)| schema).or(rest)
        };
        for key in table.keys() {
            if schema(key).is_some_and(|schema| *schema == false) {
                let legal = named().map(|(name, _)| name.as_str());
                return Err(self.source.unknown(&dotted(path, key), legal));
            }
        }
        for (key, value) in table {
            if let Some(schema) = schema(key) {
                self.check(schema, value, &dotted(path, key))?;
            }
        }
        let required = parts.iter().filter_map(|part| part["required"].as_array());
        let mut required = required.flatten().filter_map(Schema::as_str);
        match required.find(|key| !table.contains_key(*key)) {
            Some(key) => Err(self.source.missing(path, &[key])),
            None => Ok(()),
        }
    }
}

// One value or a list of them.

/// One value for all, or a list with one for each.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub(crate) enum OneOrEach<One, Each = Vec<One>> {
    One(One),
    Each(Each),
}

impl<One: Copy + Into<f64>, Each: AsRef<[One]>> OneOrEach<One, Each> {
    /// The one, or the i-th of a list (NaN beyond it).
    pub(crate) fn of(&self, i: usize) -> f64 {
        match self {
            Self::One(value) => (*value).into(),
            Self::Each(values) => values
                .as_ref()
                .get(i)
                .map_or(f64::NAN, |value| (*value).into()),
        }
    }
}
