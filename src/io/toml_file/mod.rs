//! TOML files, read as a type describes them: what is refused is named by file, line, key and value.
//!
//! Keys have paths, `outage[2].end_s`; entries of lists of tables are counted from 1.

use super::suggest::nearest;
use super::table::shown;
use super::{Failure, Place, source};
use nav_sim_signal::units::SettingError;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer, StrDeserializer};
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error as DeserializeError, Expected,
    IgnoredAny, IntoDeserializer, MapAccess, SeqAccess, Unexpected, Visitor,
};
use serde::{Deserialize, forward_to_deserialize_any};
use std::borrow::Cow;
use std::fmt;
use std::fmt::Display;
use std::io::ErrorKind;
use std::marker::PhantomData;
use std::ops::Range;
use std::path::Path;
use std::slice;
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
            let advice = match e.kind() {
                ErrorKind::NotFound => Some("start from the files that nav-sim init makes"),
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

    /// The file as its description has it.
    ///
    /// # Errors
    /// Line of what is not TOML; line, key and value of what is refused, a mistyped key with the nearest legal one.
    pub(crate) fn get<T: DeserializeOwned>(&self) -> Result<T, Failure> {
        let table = DeTable::parse(&self.text).map_err(|e| self.syntax(&e))?;
        let value = DeValue::Table(table.into_inner());
        T::deserialize(Node::new(&value, "")).map_err(|refusal| self.explained(refusal))
    }

    fn syntax(&self, e: &toml::de::Error) -> Failure {
        let span = e.span().unwrap_or_default();
        let line = self.line(span.start);
        let written = self.text.get(span).unwrap_or_default().trim();
        let written = shown(written, 40);
        self.at(line, format!("{}: \"{written}\"", e.message()))
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

    /// A refusal of the value of a key; an entry of a list of plain values goes by the name of the list.
    pub(crate) fn refused(&self, key: &str, reason: impl Display) -> Failure {
        let (span, is_set) = self.place(key);
        let line = self.line(span.start);
        let written = self.text.get(span).filter(|_| is_set).unwrap_or_default();
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
        let default = "the file does not set it: this is the default";
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

    /// The refusal of a value or key by its type.
    fn explained(&self, refusal: Refusal) -> Failure {
        let key = refusal.path.unwrap_or_default();
        match refusal.what {
            What::Unknown(field, legal) => {
                self.unknown(&dotted(&key, &field), legal.iter().copied())
            }
            What::Missing(field) => self.missing(&key, &[field]),
            What::Variant(word, legal) => {
                let meant = nearest(&word, legal.iter().copied());
                let words: Vec<String> = legal.iter().map(|w| format!("\"{w}\"")).collect();
                self.refused(&key, format!("is not one of {}", words.join(", ")))
                    .or_hint_if(meant.map(|meant| format!("did you mean \"{meant}\"?")))
            }
            What::NoList => {
                let name = key.rsplit('.').next().unwrap_or_default();
                let advice = format!("there may be several: write [[{name}]], in double brackets");
                self.refused(&key, "is not a list").or_hint(advice)
            }
            What::Reason(reason) => self.refused(&key, reason),
        }
    }
}

#[cfg(test)]
mod tests;

// A value of a TOML file as serde reads it. What is refused comes with the path of its key.
//
// A word chooses among the kinds of a table (`type = "AR1"`), in an enum without attributes of serde for it; the keys that
// all kinds have stand in a struct around it, whose field has the name of the word.

/// Words that choose among the kinds of a table.
static TAGS: [&str; 4] = ["type", "operation", "kind", "distribution"];
/// Fields that are no keys: a struct of the keys that are none of the others.
const REST: [&str; 1] = ["sigma"];

/// What is wrong, and the path of the value or of its table.
#[derive(Debug)]
struct Refusal {
    path: Option<String>,
    what: What,
}

#[derive(Debug)]
enum What {
    Unknown(String, Vec<&'static str>),
    Missing(&'static str),
    Variant(String, &'static [&'static str]),
    NoList,
    /// In words that follow the value.
    Reason(String),
}

impl From<What> for Refusal {
    fn from(what: What) -> Self {
        Self { path: None, what }
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
        What::Unknown(field.to_owned(), expected.to_vec()).into()
    }

    fn missing_field(field: &'static str) -> Self {
        What::Missing(field).into()
    }
}

impl From<&str> for Refusal {
    fn from(reason: &str) -> Self {
        What::Reason(reason.to_owned()).into()
    }
}

/// A value and its path; of a table, without the keys that are passed.
#[derive(Clone)]
struct Node<'a> {
    value: &'a DeValue<'a>,
    path: String,
    passed: &'static [&'static str],
}

impl<'a> Node<'a> {
    fn new(value: &'a DeValue<'a>, path: impl Into<String>) -> Self {
        Self {
            value,
            path: path.into(),
            passed: &[],
        }
    }

    /// Keys of a table.
    fn keys(&self, table: &'a DeTable<'a>) -> impl Iterator<Item = (&'a str, Self)> {
        table.iter().filter_map(|(key, value)| {
            let key = key.get_ref().as_ref();
            let node = Self::new(value.get_ref(), dotted(&self.path, key));
            (!self.passed.contains(&key)).then_some((key, node))
        })
    }

    /// Reads it; a refusal that has no path yet gets this one.
    fn blamed<T>(self, read: impl FnOnce(Self) -> Result<T, Refusal>) -> Result<T, Refusal> {
        let (path, passed) = (self.path.clone(), self.passed);
        read(self).map_err(|mut e| {
            if let (What::Unknown(_, legal), None) = (&mut e.what, &e.path) {
                legal.extend(passed);
            }
            e.path.get_or_insert(path);
            e
        })
    }
}

impl<'de> Deserializer<'de> for Node<'_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        const TOO_LARGE: &str = "is too large a number";
        match self.value {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Integer(number) => {
                let parsed = i64::from_str_radix(number.as_str(), number.radix());
                visitor.visit_i64(parsed.map_err(|_| TOO_LARGE)?)
            }
            DeValue::Float(number) => {
                visitor.visit_f64(number.as_str().parse().map_err(|_| TOO_LARGE)?)
            }
            DeValue::Boolean(is) => visitor.visit_bool(*is),
            DeValue::Datetime(time) => visitor.visit_string(time.to_string()),
            DeValue::Array(items) => {
                let entries = (1_usize..).zip(items.iter());
                let node = |i, item| Node::new(item, format!("{}[{i}]", self.path));
                visitor.visit_seq(Entries::new(
                    entries.map(|(i, item)| ("", node(i, item.get_ref()))),
                ))
            }
            DeValue::Table(table) => visitor.visit_map(Entries::new(self.keys(table))),
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
        match self.value {
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
        let is_rest = |field: &str| REST.contains(&field);
        let tag = fields
            .iter()
            .find(|field| TAGS.contains(field) || is_rest(field));
        match (self.value, tag) {
            (DeValue::Array(_), _) => Err("is not a table".into()),
            // the kind that the word chooses has the keys that are none of these fields
            (DeValue::Table(table), Some(tag)) if table.contains_key(*tag) || is_rest(tag) => {
                let own = self.keys(table);
                let own = own.filter(|(key, _)| key != tag && fields.contains(key));
                let kind = Node {
                    passed: fields,
                    ..self.clone()
                };
                visitor.visit_map(Entries::new(own.chain([(*tag, kind)])))
            }
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        mut self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        let table = match self.value {
            DeValue::Table(table) => table,
            DeValue::String(word) => {
                return visitor.visit_enum(word.as_ref().into_deserializer());
            }
            _ => return Err("is not a table".into()),
        };
        let tag = TAGS.iter().find(|tag| table.contains_key(**tag));
        let tag = tag.ok_or(What::Missing(TAGS[0]))?;
        if self.passed.is_empty() {
            self.passed = slice::from_ref(tag);
        }
        Node::new(table[*tag].get_ref(), dotted(&self.path, tag)).blamed(|word| {
            let word = word.value.as_str().ok_or("is not a text in quotes")?;
            let kind = Entries::new([(word, self)].into_iter());
            visitor.visit_enum(MapAccessDeserializer::new(kind))
        })
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct tuple
        tuple_struct map identifier ignored_any
    }
}

/// Keys of a table with their values, or entries of a list.
struct Entries<'a, I> {
    rest: I,
    value: Option<Node<'a>>,
}

impl<'a, I: Iterator<Item = (&'a str, Node<'a>)>> Entries<'a, I> {
    const fn new(rest: I) -> Self {
        Self { rest, value: None }
    }
}

impl<'de, 'a, I: Iterator<Item = (&'a str, Node<'a>)>> MapAccess<'de> for Entries<'a, I> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Refusal> {
        let next = self.rest.next().map(|(key, value)| {
            self.value = Some(value);
            seed.deserialize(StrDeserializer::new(key))
        });
        next.transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        let value = self.value.take().ok_or("has no value")?;
        value.blamed(|value| seed.deserialize(value))
    }
}

impl<'de, 'a, I: Iterator<Item = (&'a str, Node<'a>)>> SeqAccess<'de> for Entries<'a, I> {
    type Error = Refusal;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Refusal> {
        let next = self.rest.next();
        let read = |(_, value): (_, Node<'a>)| value.blamed(|value| seed.deserialize(value));
        next.map(read).transpose()
    }
}

// Numbers with bounds, and one value or a list of them.

/// A number between two whole ones, or one of them unless it is open; `i64::MIN` and `i64::MAX` are no ends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Between<const LOW: i64, const HIGH: i64, const OPEN: bool>(pub(crate) f64);

/// A number that is neither nan nor inf.
pub(crate) type Finite = Between<{ i64::MIN }, { i64::MAX }, false>;
/// A part of a whole.
pub(crate) type Share = Between<0, 1, false>;
pub(crate) type NonNegative = Between<0, { i64::MAX }, false>;
pub(crate) type Positive = Between<0, { i64::MAX }, true>;
/// Coefficients of a stationary AR(1), as [`Process::ar1`](nav_sim_signal::noise::Process::ar1) takes them.
pub(crate) type Stationary = Between<-1, 1, true>;

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> TryFrom<f64> for Between<LOW, HIGH, OPEN> {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        let end = |end: i64| match end {
            i64::MIN => f64::MIN,
            i64::MAX => f64::MAX,
            end => end as f64,
        };
        let (low, high) = (end(LOW), end(HIGH));
        let is_inside = match OPEN {
            true => low < value && value < high,
            false => (low..=high).contains(&value),
        };
        match (LOW, HIGH, OPEN) {
            _ if is_inside => Ok(Self(value)),
            (i64::MIN, ..) => Err("is not a finite number such as 1.5e-4".to_owned()),
            (_, i64::MAX, true) => Err(format!("is not a finite number > {LOW}")),
            (_, i64::MAX, false) => Err(format!("is not a finite number ≥ {LOW}")),
            _ => {
                let ends = if OPEN { " (exclusive)" } else { "" };
                Err(format!("is not between {LOW} and {HIGH}{ends}").replace('-', "−"))
            }
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
        "Between".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let [least, most] = match OPEN {
            true => ["exclusiveMinimum", "exclusiveMaximum"],
            false => ["minimum", "maximum"],
        };
        let mut schema = json_schema!({ "type": "number" });
        for (name, end) in [(least, LOW), (most, HIGH)] {
            if end > i64::MIN && end < i64::MAX {
                schema.insert(name.to_owned(), end.into());
            }
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
