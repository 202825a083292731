//! TOML files, read as a type describes them: what is refused is named by file, line, key and value.
//!
//! Keys have paths, `outage[2].end_s`; entries of lists of tables are counted from 1.

use super::suggest::nearest;
use super::{Failure, Place, source};
use nav_sim_signal::units::SettingError;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer, StrDeserializer};
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error as DeserializeError, Expected,
    IgnoredAny, IntoDeserializer, MapAccess, SeqAccess, Unexpected, Visitor,
};
use serde::{Deserialize, Serialize, forward_to_deserialize_any};
use std::borrow::Cow;
use std::fmt;
use std::fmt::Display;
use std::io::ErrorKind;
use std::marker::PhantomData;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
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
                ErrorKind::NotFound => {
                    error.or_hint("start from the files that nav-sim init makes")
                }
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

// A value of a TOML file as serde reads it. What is refused comes with the path of its key.
//
// A word chooses among the kinds of a table (`type = "AR1"`), in an enum without attributes of serde for it; the keys that
// all kinds have stand in a struct around it, whose field has the name of the word.

/// Words that choose among the kinds of a table.
const TAGS: [&str; 4] = ["type", "operation", "kind", "distribution"];

/// What is wrong, and the path of the value or of its table.
#[derive(Debug)]
struct Refusal {
    pub(super) path: String,
    what: What,
}

#[derive(Debug)]
enum What {
    Unknown(String, &'static [&'static str]),
    Missing(&'static str),
    Variant(String, &'static [&'static str]),
    NoList,
    /// In words that follow the value.
    Reason(String),
}

impl From<What> for Refusal {
    fn from(what: What) -> Self {
        Self {
            path: String::new(),
            what,
        }
    }
}

impl Refusal {
    /// The same, within a key or an entry of a list.
    fn within(self, part: &str) -> Self {
        let path = match self.path.as_str() {
            "" => part.to_owned(),
            path if path.starts_with('[') => format!("{part}{path}"),
            path => dotted(part, path),
        };
        Self { path, ..self }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl std::error::Error for Refusal {}

impl DeserializeError for Refusal {
    fn custom<T: fmt::Display>(message: T) -> Self {
        let message = message.to_string();
        let words = match message.split(' ').next() {
            Some("is" | "has" | "lists" | "needs" | "of") => message,
            Some("not") => format!("is {message}"),
            Some("expected") => message.replacen("expected", "is not", 1),
            _ => format!("is refused: {message}"),
        };
        What::Reason(words).into()
    }

    fn invalid_type(_: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let expected = expected.to_string();
        let words = match expected.as_str() {
            "f64" => "a number",
            "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number ≥ 0",
            "a nonzero u64" => "a whole number ≥ 1",
            "a string" => "a text in quotes",
            "a sequence" => "a list",
            "a boolean" => "true or false",
            "path string" => "a path",
            other if other.starts_with("struct") => "a table",
            other => other,
        };
        What::Reason(format!("is not {words}")).into()
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(_: usize, expected: &dyn Expected) -> Self {
        What::Reason(format!("is not {expected}")).into()
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        What::Variant(variant.to_owned(), expected).into()
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        What::Unknown(field.to_owned(), expected).into()
    }

    fn missing_field(field: &'static str) -> Self {
        What::Missing(field).into()
    }
}

/// A value.
struct Node<'a>(pub(super) &'a DeValue<'a>);

impl<'de> Deserializer<'de> for Node<'_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let no_number = || Refusal::from(What::Reason("is too large a number".to_owned()));
        match self.0 {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Integer(number) => {
                let digits = number.as_str();
                let parsed = i64::from_str_radix(digits, number.radix());
                visitor.visit_i64(parsed.map_err(|_| no_number())?)
            }
            DeValue::Float(number) => {
                visitor.visit_f64(number.as_str().parse().map_err(|_| no_number())?)
            }
            DeValue::Boolean(is) => visitor.visit_bool(*is),
            DeValue::Datetime(time) => visitor.visit_string(time.to_string()),
            DeValue::Array(items) => visitor.visit_seq(Entries { items, next: 0 }),
            DeValue::Table(table) => visitor.visit_map(Keys::of(table, |_| true)),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        match self.0 {
            DeValue::Table(_) => Err(What::NoList.into()),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        if let DeValue::Array(_) = self.0 {
            return Err(What::Reason("is not a table".to_owned()).into());
        }
        let tag = fields.iter().find(|field| TAGS.contains(field));
        let (DeValue::Table(table), Some(tag)) = (self.0, tag) else {
            return self.deserialize_any(visitor);
        };
        if !table.contains_key(*tag) {
            return Err(What::Missing(tag).into());
        }
        let mut keys = Keys::of(table, |key| fields.contains(&key) && key != *tag);
        keys.rest = Some((tag, fields, table));
        visitor.visit_map(keys)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        match self.0 {
            DeValue::String(word) => visitor.visit_enum(word.as_ref().into_deserializer()),
            DeValue::Table(table) => {
                let kind = Kind { table, passed: &[] };
                visitor.visit_enum(MapAccessDeserializer::new(kind))
            }
            _ => Err(What::Reason("is not a table".to_owned()).into()),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct tuple
        tuple_struct map identifier ignored_any
    }
}

/// Entries of a list, from a place on.
struct Entries<'a> {
    items: &'a [Spanned<DeValue<'a>>],
    next: usize,
}

impl<'de> SeqAccess<'de> for Entries<'_> {
    type Error = Refusal;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Refusal> {
        let Some(item) = self.items.get(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        let number = format!("[{}]", self.next);
        let read = seed.deserialize(Node(item.get_ref()));
        read.map(Some).map_err(|e| e.within(&number))
    }
}

/// Keys of a table, the last one to be read first.
struct Keys<'a> {
    keys: Vec<(&'a str, &'a DeValue<'a>)>,
    value: Option<(&'a str, &'a DeValue<'a>)>,
    /// A word whose kind has the keys that are none of these fields.
    rest: Option<(&'static str, &'static [&'static str], &'a DeTable<'a>)>,
}

impl<'a> Keys<'a> {
    fn of(table: &'a DeTable<'a>, is_wanted: impl Fn(&str) -> bool) -> Self {
        let all = table
            .iter()
            .map(|(key, value)| (key.get_ref().as_ref(), value.get_ref()));
        let mut keys: Vec<_> = all.filter(|(key, _)| is_wanted(key)).collect();
        keys.reverse();
        Self {
            keys,
            value: None,
            rest: None,
        }
    }
}

impl<'de> MapAccess<'de> for Keys<'_> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Refusal> {
        self.value = self.keys.pop();
        let key = self
            .value
            .map(|(key, _)| key)
            .or(self.rest.map(|(tag, ..)| tag));
        let name = |key: &str| seed.deserialize(StrDeserializer::new(key));
        key.map(name).transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        if let Some((key, value)) = self.value.take() {
            return seed.deserialize(Node(value)).map_err(|e| e.within(key));
        }
        let Some((_, passed, table)) = self.rest.take() else {
            return Err(What::Reason("has no value".to_owned()).into());
        };
        seed.deserialize(MapAccessDeserializer::new(Kind { table, passed }))
    }
}

/// A table whose word chooses its kind, without the keys that are passed.
struct Kind<'a> {
    table: &'a DeTable<'a>,
    passed: &'static [&'static str],
}

impl<'a> Kind<'a> {
    fn tag(&self) -> Option<&'static str> {
        TAGS.into_iter().find(|tag| self.table.contains_key(*tag))
    }
}

/// A map of the word and the keys of its kind.
impl<'de> MapAccess<'de> for Kind<'_> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Refusal> {
        let tag = self.tag().ok_or(What::Missing(TAGS[0]))?;
        let word = self.table.get(tag).and_then(|word| word.get_ref().as_str());
        let no_text = || What::Reason("is not a text in quotes".to_owned());
        let variant = word.ok_or_else(|| no_text().into());
        let variant = variant.and_then(|word| seed.deserialize(StrDeserializer::new(word)));
        variant.map(Some).map_err(|e: Refusal| e.within(tag))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        let tag = self.tag();
        let is_own = |key: &str| Some(key) != tag && !self.passed.contains(&key);
        seed.deserialize(MapAccessDeserializer::new(Keys::of(self.table, is_own)))
    }
}

// Numbers with bounds, and one value or a list of them.

/// A number that is neither nan nor inf.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(try_from = "f64", into = "f64")]
#[schemars(inline)]
pub(crate) struct Finite(pub(crate) f64);

impl TryFrom<f64> for Finite {
    type Error = &'static str;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        if value.is_finite() {
            Ok(Self(value))
        } else {
            Err("is not a finite number such as 1.5e-4")
        }
    }
}

impl From<Finite> for f64 {
    fn from(value: Finite) -> Self {
        value.0
    }
}

/// A number between two whole ones, or one of them unless it is open; `i64::MAX` is no end.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Between<const LOW: i64, const HIGH: i64, const OPEN: bool>(pub(crate) f64);

/// A part of a whole.
pub(crate) type Share = Between<0, 1, false>;
pub(crate) type NonNegative = Between<0, { i64::MAX }, false>;
pub(crate) type Positive = Between<0, { i64::MAX }, true>;
/// Coefficients of a stationary AR(1), as [`Process::ar1`](nav_sim_signal::noise::Process::ar1) takes them.
pub(crate) type Stationary = Between<-1, 1, true>;

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> TryFrom<f64> for Between<LOW, HIGH, OPEN> {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        let (low, high) = (
            LOW as f64,
            if HIGH == i64::MAX {
                f64::MAX
            } else {
                HIGH as f64
            },
        );
        let is_inside = if OPEN {
            low < value && value < high
        } else {
            (low..=high).contains(&value)
        };
        match (HIGH, OPEN) {
            _ if is_inside => Ok(Self(value)),
            (i64::MAX, true) => Err(format!("is not a finite number > {LOW}")),
            (i64::MAX, false) => Err(format!("is not a finite number ≥ {LOW}")),
            (_, true) => {
                Err(format!("is not between {LOW} and {HIGH} (exclusive)").replace('-', "−"))
            }
            (_, false) => Err(format!("is not between {LOW} and {HIGH}")),
        }
    }
}

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> From<Between<LOW, HIGH, OPEN>> for f64 {
    fn from(value: Between<LOW, HIGH, OPEN>) -> Self {
        value.0
    }
}

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> JsonSchema for Between<LOW, HIGH, OPEN> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Between_{LOW}_{HIGH}_{OPEN}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let (least, most) = if OPEN {
            ("exclusiveMinimum", "exclusiveMaximum")
        } else {
            ("minimum", "maximum")
        };
        let mut schema = json_schema!({ "type": "number" });
        schema.insert(least.to_owned(), LOW.into());
        if HIGH < i64::MAX {
            schema.insert(most.to_owned(), HIGH.into());
        }
        schema
    }
}

/// The version of a file's layout: there is one
#[derive(Deserialize, JsonSchema)]
#[serde(try_from = "u64")]
#[schemars(inline, extend("minimum" = 1, "maximum" = 1))]
pub(crate) struct Version;

impl TryFrom<u64> for Version {
    type Error = &'static str;

    fn try_from(version: u64) -> Result<Self, Self::Error> {
        if version == 1 {
            Ok(Self)
        } else {
            Err("is not a schema this version reads: it reads 1")
        }
    }
}

/// One value for all, or a list with one for each.
#[derive(Debug, JsonSchema)]
#[schemars(untagged, inline)]
pub(crate) enum OneOrEach<One, Each = Vec<One>> {
    One(One),
    Each(Each),
}

impl<One: Copy + Into<f64>> OneOrEach<One> {
    /// The one, or the i-th of a list (NaN beyond it).
    pub(crate) fn of(&self, i: usize) -> f64 {
        match self {
            Self::One(value) => (*value).into(),
            Self::Each(values) => values.get(i).map_or(f64::NAN, |value| (*value).into()),
        }
    }
}

impl<'de, One: Deserialize<'de>, Each: Deserialize<'de>> Deserialize<'de> for OneOrEach<One, Each> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(EitherVisitor(PhantomData))
    }
}

struct EitherVisitor<One, Each>(PhantomData<(One, Each)>);

impl<'de, One: Deserialize<'de>, Each: Deserialize<'de>> Visitor<'de> for EitherVisitor<One, Each> {
    type Value = OneOrEach<One, Each>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("one value or a list of them")
    }

    fn visit_i64<E: DeserializeError>(self, number: i64) -> Result<Self::Value, E> {
        One::deserialize(number.into_deserializer()).map(OneOrEach::One)
    }

    fn visit_f64<E: DeserializeError>(self, number: f64) -> Result<Self::Value, E> {
        One::deserialize(number.into_deserializer()).map(OneOrEach::One)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        One::deserialize(MapAccessDeserializer::new(map)).map(OneOrEach::One)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let each = Each::deserialize(SeqAccessDeserializer::new(&mut list))?;
        match list.next_element::<IgnoredAny>()? {
            None => Ok(OneOrEach::Each(each)),
            Some(_) => Err(A::Error::custom("is too long a list")),
        }
    }
}
