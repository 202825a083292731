//! TOML files, read as a type describes them: what is refused is named by file, line, key and value.
//!
//! Keys have paths, `outage[2].end_s`; entries of lists of tables are counted from 1.

use super::error::{FileError, Kind, Place, Setting};
use super::source;
use super::suggest::nearest;
use nav_sim_signal::units::SettingError;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::borrow::Cow;
use std::fmt;
use std::io::ErrorKind;
use std::marker::PhantomData;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

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
        Ok(Self { path: path.display().to_string(), text })
    }

    /// A text that is in no file.
    pub(crate) fn new(path: &str, text: &str) -> Self {
        Self { path: path.into(), text: text.into() }
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
        1 + self.text.as_bytes()[..offset.min(self.text.len())].iter().filter(|b| **b == b'\n').count()
    }

    /// Where the value of a key is written, and whether it is: if not, the innermost table around it.
    fn place(&self, key: &str) -> (Range<usize>, bool) {
        self.table().map_or((0..0, false), |table| span_of(table.get_ref(), key))
    }

    /// Whether the file sets a key.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.place(key).1
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
        let kind = Kind::Value { key: key.into(), value, reason: reason.into() };
        FileError::new(self.path.as_str(), self.line(span.start), kind)
    }

    /// The refusal of a setting by its rule.
    pub(crate) fn setting(&self, error: &SettingError) -> FileError {
        let reason = format!("is refused: {}", error.requirement);
        if self.place(&error.key).1 {
            return self.refused(&error.key, reason).advice_if(error.advice.map(str::to_owned));
        }
        let (key, value, reason) = (error.key.as_str().into(), error.value.as_str().into(), reason.into());
        let refusal = self.error(&error.key, Kind::Value { key, value, reason });
        refusal
            .advice_if(error.advice.map(str::to_owned))
            .advice("the file does not set it: this is the default")
    }

    /// A key that means nothing where it stands, with the nearest that does.
    pub(crate) fn unknown<'a>(&self, key: &str, legal: impl Iterator<Item = &'a str> + Clone) -> FileError {
        let name = key.rsplit('.').next().unwrap_or_default();
        // what profiles call heading, tables and initial states call yaw
        let other_name = match name {
            "yaw_deg" => "heading_deg",
            "heading_deg" => "yaw_deg",
            _ => name,
        };
        let meant = legal.clone().find(|word| *word == other_name).or_else(|| nearest(name, legal.clone()));
        let hint = match meant {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => format!("legal here: {}", legal.collect::<Vec<_>>().join(", ")),
        };
        self.error(key, Kind::UnknownKey(key.into())).advice(hint)
    }

    /// A table that lacks a key, one of several that would do.
    pub(crate) fn missing(&self, table: &str, keys: &[&str]) -> FileError {
        let keys: Vec<String> = keys.iter().map(|key| format!("\"{}\"", dotted(table, key))).collect();
        let keys = keys.join(" or ");
        let advice = match keys.as_str() {
            "\"rate_hz\"" => "add rate_hz = 100.0, the sample rate (Hz)".to_owned(),
            _ => format!("add the key {keys}"),
        };
        self.error(table, Kind::MissingKey(keys.into())).advice(advice)
    }

    /// A refusal by serde of the value of a key.
    fn explained(&self, error: &toml::de::Error, key: &str) -> FileError {
        let message = error.message();
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        match quoted.split_first() {
            Some((field, legal)) if message.starts_with("unknown field") => {
                let key =
                    if key.rsplit('.').next() == Some(field) { key.to_owned() } else { dotted(key, field) };
                return self.unknown(&key, legal.iter().copied());
            }
            Some((field, _)) if message.starts_with("missing field") => return self.missing(key, &[field]),
            _ => {}
        }
        let (own, told) = (self.place(key).0, error.span().unwrap_or_default());
        let span = if own.start <= told.start && told.end <= own.end { told } else { own };
        let meant = quoted.split_first().filter(|_| message.starts_with("unknown variant"));
        let advice = match meant.and_then(|(word, legal)| nearest(word, legal.iter().copied())) {
            Some(meant) => Some(format!("did you mean \"{meant}\"?")),
            None if message == Finite::REFUSAL => {
                Some("a number such as 1.5e-4; neither nan nor inf".to_owned())
            }
            None if message.starts_with("invalid type: map, expected a sequence") => {
                let name = key.rsplit('.').next().unwrap_or_default();
                Some(format!("there may be several: write [[{name}]], in double brackets"))
            }
            None => None,
        };
        self.refused_at(span, key, reason(message, &quoted)).advice_if(advice)
    }
}

/// A value as it is shown: in one line, at most 60 characters of it.
fn shown(written: &str) -> String {
    written.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(60).collect()
}

/// A key with the path of its table before it.
pub(crate) fn dotted(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

type Value<'a> = Spanned<DeValue<'a>>;

/// Path of the innermost key of a table that a span lies in.
///
/// The span of a table under a head is the head alone, so every table is searched.
fn within(table: &DeTable<'_>, path: &str, span: &Range<usize>) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let path = dotted(path, key.get_ref());
        let is_key = key.span() == *span;
        if is_key { Some(path) } else { within_value(value, path, span) }
    })
}

fn within_value(value: &Value<'_>, path: String, span: &Range<usize>) -> Option<String> {
    let inner = match value.get_ref() {
        DeValue::Table(table) => within(table, &path, span),
        DeValue::Array(items) => items.iter().enumerate().find_map(|(i, item)| {
            let is_table = item.get_ref().is_table();
            is_table.then(|| within_value(item, format!("{path}[{}]", i + 1), span)).flatten()
        }),
        _ => None,
    };
    let extent = value.span();
    inner.or_else(|| (extent.start <= span.start && span.end <= extent.end).then_some(path))
}

/// Where the value of a path is written, and whether it is: if not, the span of the innermost table around it.
pub(super) fn span_of(table: &DeTable<'_>, path: &str) -> (Range<usize>, bool) {
    let (mut table, mut span) = (Some(table), 0..0);
    for part in path.split('.') {
        let (key, entry) = part.split_once('[').map_or((part, None), |(key, entry)| (key, Some(entry)));
        let Some(value) = table.and_then(|table| table.get(key)) else { return (span, false) };
        let entry = entry.and_then(|i| i.trim_end_matches(']').parse::<usize>().ok()?.checked_sub(1));
        let value = entry.and_then(|i| value.get_ref().as_array()?.get(i)).unwrap_or(value);
        (table, span) = (value.get_ref().as_table(), value.span());
    }
    (span, true)
}

/// Keys that tell what the others of their table mean: without them every message is another.
const TAGS: [&str; 4] = ["type", "operation", "kind", "distribution"];

/// Path of the key that serde refuses.
///
/// Of tables that a word tells apart serde knows no places: there it is the entry that is refused alone, and the key without
/// which something else is said.
fn culprit<T: DeserializeOwned>(table: &Spanned<DeTable<'_>>, error: &toml::de::Error) -> String {
    let message = error.message();
    let span = error.span().unwrap_or_default();
    let is_same = |changed: DeTable<'_>| {
        let said = T::deserialize(toml::de::Deserializer::from(Spanned::new(table.span(), changed)));
        said.err().is_some_and(|e| e.message() == message)
    };
    let mut path = match span == table.span() {
        true => String::new(),
        false => within(table.get_ref(), "", &span).unwrap_or_default(),
    };
    if path.ends_with(']') {
        path.truncate(path.rfind('[').unwrap_or_default()); // the head of a list is that of its first entry
    }
    let unknown = message.strip_prefix("unknown field `").and_then(|rest| rest.split('`').next());
    loop {
        // the unknown key itself may be a list: nothing inside it is to blame
        if unknown.is_some() && path.rsplit('.').next() == unknown {
            return path;
        }
        let inner = match value_at(table.get_ref(), &path) {
            Some(DeValue::Array(items)) if items.iter().any(|item| item.get_ref().is_table()) => {
                let mut alone = (1..=items.len()).map(|i| (i, only(table.get_ref(), &path, i)));
                alone.find_map(|(i, changed)| is_same(changed).then(|| format!("{path}[{i}]")))
            }
            _ if message.starts_with("missing field") => None,
            value => {
                let own = value.map_or(Some(table.get_ref()), DeValue::as_table);
                let is_tag = |key: &&str| TAGS.contains(key) == message.starts_with("unknown variant");
                let keys = own.into_iter().flat_map(|own| own.keys().map(|key| key.get_ref().as_ref()));
                let mut paths = keys.filter(is_tag).map(|key| dotted(&path, key));
                paths.find(|path| !is_same(without(table.get_ref(), path)))
            }
        };
        let Some(inner) = inner else { return path };
        path = inner;
    }
}

/// The parts of a path: keys, and the place of an entry of a list.
fn parts(path: &str) -> impl Iterator<Item = (&str, Option<usize>)> {
    path.split('.').filter(|part| !part.is_empty()).map(|part| match part.split_once('[') {
        None => (part, None),
        Some((key, entry)) => {
            (key, entry.trim_end_matches(']').parse::<usize>().ok().and_then(|i| i.checked_sub(1)))
        }
    })
}

/// The value of a path; none for the file itself.
fn value_at<'a>(table: &'a DeTable<'a>, path: &str) -> Option<&'a DeValue<'a>> {
    let mut value: Option<&DeValue<'_>> = None;
    for (key, entry) in parts(path) {
        let own = value.map_or(Some(table), DeValue::as_table)?.get(key)?.get_ref();
        value = Some(match entry {
            Some(i) => own.as_array()?.get(i)?.get_ref(),
            None => own,
        });
    }
    value
}

/// The same file with another value of a path, or without it.
fn changed<'a>(table: &DeTable<'a>, path: &str, change: &dyn Fn(&mut DeTable<'a>, &str)) -> DeTable<'a> {
    let mut all = table.clone();
    let (above, key) = path.rsplit_once('.').unwrap_or(("", path));
    let mut own = Some(&mut all);
    for (key, entry) in parts(above) {
        let inner = own.and_then(|own| own.get_mut(key)).map(Spanned::get_mut);
        own = match (inner, entry) {
            (Some(DeValue::Array(items)), Some(i)) => match items.get_mut(i).map(Spanned::get_mut) {
                Some(DeValue::Table(table)) => Some(table),
                _ => None,
            },
            (Some(DeValue::Table(table)), None) => Some(table),
            _ => None,
        };
    }
    if let Some(own) = own {
        change(own, key);
    }
    all
}

fn without<'a>(table: &DeTable<'a>, path: &str) -> DeTable<'a> {
    changed(table, path, &|own, key| _ = own.remove(key))
}

/// With one entry alone in a list.
fn only<'a>(table: &DeTable<'a>, path: &str, entry: usize) -> DeTable<'a> {
    changed(table, path, &|own, key| {
        if let Some(DeValue::Array(items)) = own.get_mut(key).map(Spanned::get_mut) {
            *items = items.iter().skip(entry - 1).take(1).cloned().collect();
        }
    })
}

/// A number that is neither nan nor inf.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(try_from = "f64", into = "f64")]
#[schemars(inline)]
pub(crate) struct Finite(pub(crate) f64);

impl Finite {
    const REFUSAL: &str = "is not a finite number";
}

impl TryFrom<f64> for Finite {
    type Error = &'static str;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        if value.is_finite() { Ok(Self(value)) } else { Err(Self::REFUSAL) }
    }
}

impl From<Finite> for f64 {
    fn from(value: Finite) -> Self {
        value.0
    }
}

/// A number between two whole ones, or one of them unless it is open; `i64::MAX` is no end.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Between<const LOW: i64, const HIGH: i64, const OPEN: bool>(pub(crate) f64);

/// A part of a whole.
pub(crate) type Share = Between<0, 1, false>;
pub(crate) type NonNegative = Between<0, { i64::MAX }, false>;
pub(crate) type Positive = Between<0, { i64::MAX }, true>;
/// Coefficients of a stationary AR(1), as [`Ar1::new`](nav_sim_signal::noise::Ar1::new) takes them.
pub(crate) type Stationary = Between<-1, 1, true>;

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> TryFrom<f64> for Between<LOW, HIGH, OPEN> {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        let (low, high) = (LOW as f64, if HIGH == i64::MAX { f64::MAX } else { HIGH as f64 });
        let is_inside = if OPEN { low < value && value < high } else { (low..=high).contains(&value) };
        match (HIGH, OPEN) {
            _ if is_inside => Ok(Self(value)),
            (i64::MAX, true) => Err(format!("is not a finite number > {LOW}")),
            (i64::MAX, false) => Err(format!("is not a finite number ≥ {LOW}")),
            (_, true) => Err(format!("is not between {LOW} and {HIGH} (exclusive)").replace('-', "−")),
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
        let (least, most) =
            if OPEN { ("exclusiveMinimum", "exclusiveMaximum") } else { ("minimum", "maximum") };
        let mut schema = json_schema!({ "type": "number" });
        schema.insert(least.to_owned(), LOW.into());
        if HIGH < i64::MAX {
            schema.insert(most.to_owned(), HIGH.into());
        }
        schema
    }
}

/// The version of a file's layout: there is one
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(try_from = "u64")]
#[schemars(inline, extend("minimum" = 1, "maximum" = 1))]
pub(crate) struct Version;

impl TryFrom<u64> for Version {
    type Error = &'static str;

    fn try_from(version: u64) -> Result<Self, Self::Error> {
        if version == 1 { Ok(Self) } else { Err("is not a schema this version reads: it reads 1") }
    }
}

/// One value for all, or a list with one for each.
#[derive(Debug, JsonSchema)]
#[schemars(untagged, inline)]
pub(crate) enum OneOrEach<One, Each = Vec<One>> {
    One(One),
    Each(Each),
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

    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        One::deserialize(number.into_deserializer()).map(OneOrEach::One)
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        One::deserialize(number.into_deserializer()).map(OneOrEach::One)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        One::deserialize(MapAccessDeserializer::new(map)).map(OneOrEach::One)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
        Each::deserialize(SeqAccessDeserializer::new(list)).map(OneOrEach::Each)
    }
}

/// Why a value is refused, in words that follow it: serde's types in ours.
fn reason(message: &str, quoted: &[&str]) -> String {
    if message.starts_with("unknown variant") {
        let legal: Vec<String> = quoted.iter().skip(1).map(|word| format!("\"{word}\"")).collect();
        return format!("is not one of {}", legal.join(", "));
    }
    let expected = message.strip_prefix("invalid ").and_then(|rest| rest.rsplit_once(", expected "));
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
        Some(other) => format!("is not {}", other.strip_prefix("struct").map_or(other, |_| "a table")),
        // a type of ours says it in words that follow the value
        None if message.starts_with("is ") => message.to_owned(),
        None if message.starts_with("not ") => format!("is {message}"),
        None if message.starts_with("expected ") => message.replacen("expected", "is not", 1),
        None => format!("is refused: {message}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct File {
        count: u64,
        part: Option<Part>,
        parts: Option<Vec<Part>>,
        words: Option<Vec<Word>>,
        kinds: Option<Vec<Operation>>,
        place: Option<std::path::PathBuf>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct Part {
        x: f64,
        xyz: Option<[f64; 3]>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Word {
        North,
        South,
    }

    #[test]
    fn refusals_name_file_line_key_and_value() {
        for (text, expected) in [
            ("count = -1", "line 1: \"count\" = -1 is not a whole number ≥ 0 | "),
            ("count = \"many\"", "line 1: \"count\" = \"many\" is not a whole number ≥ 0 | "),
            ("\n[part]\nx = 1\n", "line 1: \"count\" is missing | add the key \"count\""),
            ("count = 1\n[part]\n", "line 2: \"part.x\" is missing | add the key \"part.x\""),
            ("count = 1\npart = {}\n", "line 2: \"part.x\" is missing | add the key \"part.x\""),
            ("count = 1\n[part]\nx = \"a\"\n", "line 3: \"part.x\" = \"a\" is not a number | "),
            (
                "count = 1\n[parts]\nx = 1\n",
                "line 2: \"parts\" = [parts] is not a list | there may be several: write [[parts]], in double brackets",
            ),
            ("count = 1\npart = 3\n", "line 2: \"part\" = 3 is not a table | "),
            ("count = 1\nkinds = [3]\n", "line 2: \"kinds\" = 3 is not a table | "),
            ("count = 1\nplace = 3\n", "line 2: \"place\" = 3 is not a path | "),
            (
                "count = 1\n[part]\nx = 1\nxyz = [1, 2]\n",
                "line 4: \"part.xyz\" = [1, 2] is not an array of length 3 | ",
            ),
            ("count = 1\nwords = \"north\"", "line 2: \"words\" = \"north\" is not a list | "),
            (
                "count = 1\nwords = [\"south\", \"nroth\"]",
                "line 2: \"words\" = \"nroth\" is not one of \"north\", \"south\" | did you mean \"north\"?",
            ),
            (
                "count = 1\n[part]\nx = 1\nxyz = [\n  1, # = 2\n  \"a\",\n  3]\n",
                "line 6: \"part.xyz\" = \"a\" is not a number | ",
            ),
            (
                "count = 1\n[[parts]]\nx = 1\n[[parts]]\nx = \"b\"\n",
                "line 5: \"parts[2].x\" = \"b\" is not a number | ",
            ),
            (
                "count = 1\nparts = [{ x = 1 }, { xzy = 1 }]\n",
                "line 2: unknown key \"parts[2].xzy\" | did you mean \"xyz\"?",
            ),
            ("count = 1\n[[parts]]\n", "line 2: \"parts[1].x\" is missing | add the key \"parts[1].x\""),
            ("count = 1\nconut = 1", "line 2: unknown key \"conut\" | did you mean \"count\"?"),
        ] {
            let source = Source::new("f.toml", text);
            let e = source.get::<File>().unwrap_err();
            assert_eq!(format!("{e} | {}", e.hint().unwrap_or_default()), format!("f.toml, {expected}"));
        }
    }

    const TEXT: &str = "runs = 3\n[gnss]\nsigma = [1,\n 2]\n[[outage]]\nend_s = 1\n[[outage]]\nend_s = 2\n\
                        [[scenario]]\nsettings.gnss.rate_hz = -1\n[[scenario]]\nsettings = { gnss = { rate_hz = -2 } }\n";

    #[test]
    fn path_and_span_are_inverse() {
        let table = DeTable::parse(TEXT).unwrap();
        for (path, written) in [
            ("runs", "3"),
            ("gnss", "[gnss]"),
            ("gnss.sigma", "[1,\n 2]"),
            ("outage[1].end_s", "1"),
            ("outage[2].end_s", "2"),
            ("outage[2]", "[[outage]]"),
            ("scenario[1].settings.gnss.rate_hz", "-1"),
            ("scenario[2].settings.gnss.rate_hz", "-2"),
            ("scenario[2].settings.gnss", "{ rate_hz = -2 }"),
        ] {
            let (span, is_set) = span_of(table.get_ref(), path);
            assert_eq!((&TEXT[span.clone()], is_set), (written, true), "{path}");
            assert_eq!(within(table.get_ref(), "", &span).unwrap(), path);
        }
    }

    #[test]
    fn what_is_not_set_lies_in_the_innermost_table_that_is() {
        let table = DeTable::parse(TEXT).unwrap();
        for (path, written) in
            [("imu.rate_hz", ""), ("gnss.rate_hz", "[gnss]"), ("outage[2].start_s", "[[outage]]")]
        {
            let (span, is_set) = span_of(table.get_ref(), path);
            assert_eq!((&TEXT[span], is_set), (written, false), "{path}");
        }
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct Rules {
        #[serde(default)]
        rule: Vec<Rule>,
        axis: Option<Axis>,
        other: Option<OneOrEach<Finite>>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct Axis {
        rules: Vec<Rule>,
    }

    #[derive(Debug, Deserialize)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct Rule {
        replicates: Option<Vec<u64>>,
        #[serde(flatten)]
        operation: Operation,
    }

    #[derive(Debug, Deserialize)]
    #[serde(tag = "operation", rename_all = "lowercase")]
    #[expect(dead_code, reason = "only whether it reads matters")]
    enum Operation {
        Step(Step),
        Drift(Part),
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct Step {
        height: OneOrEach<Share>,
        at: Option<Positive>,
    }

    /// Of tables that a word tells apart serde knows no places.
    #[test]
    fn keys_of_tagged_tables_are_found() {
        let two =
            |second: &str| format!("[[rule]]\noperation = \"step\"\nheight = 0.5\n[[rule]]\n{second}\n");
        for (text, expected) in [
            (two("operation = \"step\"\nheight = 2"), "line 6: \"rule[2].height\" = 2 is not between 0 and 1 | "),
            (two("operation = \"step\"\nheight = [0, \"a\"]"), "line 6: \"rule[2].height\" = [0, \"a\"] is not a number | "),
            (two("operation = \"step\"\nheight = 1\nat = 0"), "line 7: \"rule[2].at\" = 0 is not a finite number > 0 | "),
            (two("operation = \"step\"\nat = 1"), "line 4: \"rule[2].height\" is missing | add the key \"rule[2].height\""),
            (two("operation = \"step\"\nheight = 1\nhieght = 1"), "line 7: unknown key \"rule[2].hieght\" | did you mean \"height\"?"),
            (two("operation = \"stpe\""), "line 5: \"rule[2].operation\" = \"stpe\" is not one of \"step\", \"drift\" | did you mean \"step\"?"),
            (two("height = 1"), "line 4: \"rule[2].operation\" is missing | add the key \"rule[2].operation\""),
            (two("operation = \"drift\"\nx = 1\nreplicates = [1, -2]"), "line 7: \"rule[2].replicates\" = -2 is not a whole number ≥ 0 | "),
            (
                "[axis]\nrules = [\n{ operation = \"drift\", x = 1 },\n{ operation = \"drift\", x = nam },\n]".replace("nam", "\"nan\""),
                "line 4: \"axis.rules[2].x\" = \"nan\" is not a number | ",
            ),
            ("other = [1, nan]".to_owned(), "line 1: \"other\" = [1, nan] is not a finite number | a number such as 1.5e-4; neither nan nor inf"),
        ] {
            let e = Source::new("f.toml", &text).get::<Rules>().unwrap_err();
            assert_eq!(format!("{e} | {}", e.hint().unwrap_or_default()), format!("f.toml, {expected}"));
        }
    }

    #[test]
    fn syntax_errors_have_line_and_column() {
        let e = Source::new("f.toml", "a = 1\nb = = 2\n").get::<toml::Table>().unwrap_err();
        assert!(e.to_string().starts_with("f.toml, line 2, column 5: "), "{e}");
    }

    #[test]
    fn a_missing_file_is_named() {
        let e = Source::read(Path::new("/no/such.toml")).unwrap_err();
        assert_eq!(e.to_string(), "/no/such.toml: No such file or directory");
        assert!(e.is_system());
    }
}
