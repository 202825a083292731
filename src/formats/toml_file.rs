//! TOML files read key by key: every refusal names file, line, key and value, and a mistyped key is
//! answered with the nearest legal one.

use super::error::{FileError, Kind, Place, Setting};
use super::source;
use super::suggest::nearest;
use super::toml_described::{Finite, several};
use super::toml_path::dotted;
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What the system said of a file, with what helps.
fn unreadable(path: &Path, source: io::Error) -> FileError {
    let kind = source.kind();
    let error = FileError::io(path, source);
    match kind {
        ErrorKind::NotFound => error.advice("check the path").setting(Setting::StartFiles),
        ErrorKind::InvalidData => error.advice("a TOML file is text in UTF-8"),
        _ => error,
    }
}

/// A key that means nothing where it stands, with the nearest that does.
pub(super) fn unknown_key<'a>(
    source: &Source,
    line: usize,
    dotted: String,
    key: &str,
    legal: impl Iterator<Item = &'a str> + Clone,
) -> FileError {
    // what profiles call heading, tables and initial states call yaw
    let other_name = [("yaw_deg", "heading_deg"), ("heading_deg", "yaw_deg")]
        .into_iter()
        .find(|(name, meant)| *name == key && legal.clone().any(|word| word == *meant));
    let meant = other_name.map(|(_, meant)| meant).or_else(|| nearest(key, legal.clone()));
    let hint = match meant {
        Some(meant) => format!("did you mean \"{meant}\"?"),
        None => format!("legal here: {}", legal.collect::<Vec<_>>().join(", ")),
    };
    source.error(line, Kind::UnknownKey(dotted.into())).advice(hint)
}

/// A key that is needed, of one or several (dotted) that would do.
pub(super) fn missing_key(source: &Source, line: usize, keys: &[String]) -> FileError {
    let keys: Vec<String> = keys.iter().map(|key| format!("\"{key}\"")).collect();
    let keys = keys.join(" or ");
    let advice = match keys.as_str() {
        "\"rate_hz\"" => "add rate_hz = 100.0, the sample rate (Hz)".to_owned(),
        _ => format!("add the key {keys}"),
    };
    source.error(line, Kind::MissingKey(keys.into())).advice(advice)
}

/// A value as it is shown: in one line, at most 60 characters of it.
pub(super) fn shown(written: &str) -> String {
    written.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(60).collect()
}

/// A TOML text and the name it goes by in messages.
#[derive(Debug)]
pub(crate) struct Source {
    path: String,
    text: String,
}

impl Source {
    pub(crate) fn read(path: &Path) -> Result<Self, FileError> {
        let name = path.display().to_string();
        match source::text(path) {
            Ok(text) => {
                super::hash::remember(path, text.as_bytes());
                Ok(Self { path: name, text })
            }
            Err(source) => Err(unreadable(path, source)),
        }
    }

    /// A top-level table as values, for what is passed on unread.
    pub(crate) fn owned_table(&self, key: &str) -> Option<toml::Table> {
        let mut all: toml::Table = toml::from_str(&self.text).ok()?;
        match all.remove(key) {
            Some(toml::Value::Table(table)) => Some(table),
            _ => None,
        }
    }

    /// A text that is in no file.
    pub(crate) fn new(path: &str, text: &str) -> Self {
        Self { path: path.into(), text: text.into() }
    }

    /// The table of the whole file.
    pub(crate) fn parse(&self) -> Result<Spanned<DeTable<'_>>, FileError> {
        DeTable::parse(&self.text).map_err(|e| {
            let offset = e.span().map_or(0, |s| s.start);
            let line_start = self.text[..offset].rfind('\n').map_or(0, |i| i + 1);
            let column = self.text[line_start..offset].chars().count() + 1;
            let place = Place::Character(self.line(offset) as u64, column as u64);
            let key = e.span().and_then(|span| self.text.get(span)).map(str::trim).unwrap_or_default();
            let message = match e.message() {
                "duplicate key" => format!("the key \"{key}\" is there already"),
                other => other.to_owned(),
            };
            FileError::contents(self.path.as_str(), place, message)
        })
    }

    pub(crate) fn root<'a>(&'a self, table: &'a Spanned<DeTable<'a>>) -> Section<'a> {
        Section { source: self, name: String::new(), span: table.span(), table: table.get_ref() }
    }

    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// Something wrong in a line.
    pub(crate) fn error(&self, line: usize, kind: Kind) -> FileError {
        FileError::new(self.path.as_str(), line, kind)
    }

    /// The line (from 1) a byte stands in.
    pub(crate) fn line(&self, offset: usize) -> usize {
        1 + self.text.as_bytes()[..offset.min(self.text.len())].iter().filter(|b| **b == b'\n').count()
    }
}

type Value<'a> = &'a Spanned<DeValue<'a>>;

/// One table of a file, with its name for messages.
#[derive(Debug, Clone)]
pub(crate) struct Section<'a> {
    pub(super) source: &'a Source,
    pub(super) name: String,
    pub(super) span: Range<usize>,
    pub(super) table: &'a DeTable<'a>,
}

impl<'a> Section<'a> {
    /// Dotted name of a key of this table.
    pub(crate) fn key(&self, key: &str) -> String {
        dotted(&self.name, key)
    }

    /// Keys in the order of the file.
    pub(crate) fn keys(&self) -> Vec<&str> {
        let mut keys: Vec<_> = self.table.keys().map(|k| (k.span().start, k.get_ref().as_ref())).collect();
        keys.sort_unstable();
        keys.into_iter().map(|(_, k)| k).collect()
    }

    /// Refuses every key that is not listed.
    pub(crate) fn only(&self, legal: &[&str]) -> Result<(), FileError> {
        let Some(key) = self.keys().into_iter().find(|k| !legal.contains(k)) else { return Ok(()) };
        let offset =
            self.table.keys().find(|k| k.get_ref() == key).map_or(self.span.start, |k| k.span().start);
        let line = self.source.line(offset);
        Err(unknown_key(self.source, line, self.key(key), key, legal.iter().copied()))
    }

    /// The line it begins in.
    /// Line of the file where the table begins.
    pub(crate) fn line(&self) -> usize {
        self.source.line(self.span.start)
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    fn get(&self, key: &str) -> Option<Value<'a>> {
        self.table.get(key)
    }

    pub(crate) fn missing(&self, key: &str) -> FileError {
        self.missing_one_of(&[key])
    }

    pub(crate) fn missing_one_of(&self, keys: &[&str]) -> FileError {
        let keys: Vec<String> = keys.iter().map(|key| self.key(key)).collect();
        missing_key(self.source, self.line(), &keys)
    }

    /// A refusal of the value of a key that is there.
    pub(crate) fn refuse(&self, key: &str, reason: impl Into<String>, hint: Option<String>) -> FileError {
        let span = self.get(key).map_or(self.span.start..self.span.start, Spanned::span);
        self.refuse_at(span, self.key(key), reason.into(), hint)
    }

    fn refuse_at(&self, span: Range<usize>, key: String, reason: String, hint: Option<String>) -> FileError {
        let value = shown(self.source.text.get(span.clone()).unwrap_or_default());
        let kind = Kind::Value { key: key.into(), value: value.into(), reason: reason.into() };
        self.source.error(self.source.line(span.start), kind).advice_if(hint)
    }

    fn wrong_type(&self, key: &str, expected: &str) -> FileError {
        self.refuse(key, format!("is not {expected}"), None)
    }

    /// A finite number.
    pub(crate) fn f64(&self, key: &str) -> Result<Option<f64>, FileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        number(value)
            .filter(|x| x.is_finite())
            .map(Some)
            .ok_or_else(|| self.refuse(key, Finite::REFUSAL, Some(Finite::ADVICE.to_owned())))
    }

    pub(crate) fn require_f64(&self, key: &str) -> Result<f64, FileError> {
        self.f64(key)?.ok_or_else(|| self.missing(key))
    }

    /// A list of finite numbers.
    pub(crate) fn f64s(&self, key: &str) -> Result<Option<Vec<f64>>, FileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let error = || self.wrong_type(key, "a list of finite numbers");
        let items = value.get_ref().as_array().ok_or_else(error)?;
        let numbers = items.iter().map(|v| number(v).filter(|x| x.is_finite()));
        numbers.collect::<Option<Vec<f64>>>().map(Some).ok_or_else(error)
    }

    /// A pair of numbers in ascending order, infinite ones allowed.
    pub(crate) fn interval(&self, key: &str) -> Result<Option<[f64; 2]>, FileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let items = value.get_ref().as_array().map_or(&[][..], |a| a);
        match items.iter().map(number).collect::<Option<Vec<f64>>>().as_deref() {
            Some(&[low, high]) if low <= high => Ok(Some([low, high])),
            _ => Err(self.wrong_type(key, "a pair [low, high]")),
        }
    }

    /// A whole number ≥ 0.
    pub(crate) fn u64(&self, key: &str) -> Result<Option<u64>, FileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        integer(value).map(Some).ok_or_else(|| self.wrong_type(key, "a whole number ≥ 0"))
    }

    pub(crate) fn str(&self, key: &str) -> Result<Option<&'a str>, FileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        value.get_ref().as_str().map(Some).ok_or_else(|| self.wrong_type(key, "a text in quotes"))
    }

    /// The texts of a list; those that are none are left out.
    pub(crate) fn texts(&self, key: &str) -> Vec<&'a str> {
        let items = self.get(key).and_then(|v| v.get_ref().as_array());
        items.into_iter().flat_map(|items| items.iter()).filter_map(|v| v.get_ref().as_str()).collect()
    }

    pub(crate) fn require_str(&self, key: &str) -> Result<&'a str, FileError> {
        self.str(key)?.ok_or_else(|| self.missing(key))
    }

    /// A table.
    pub(crate) fn section(&self, key: &str) -> Result<Option<Section<'a>>, FileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let table = value.get_ref().as_table().ok_or_else(|| self.wrong_type(key, "a table"))?;
        Ok(Some(Section { source: self.source, name: self.key(key), span: value.span(), table }))
    }

    pub(crate) fn is_list(&self, key: &str) -> bool {
        self.get(key).is_some_and(|v| v.get_ref().is_array())
    }

    pub(crate) fn is_empty_list(&self, key: &str) -> bool {
        self.get(key).is_some_and(|v| v.get_ref().as_array().is_some_and(|items| items.is_empty()))
    }

    /// A list of tables, named `key[1]`, `key[2]`, … in messages.
    pub(crate) fn sections(&self, key: &str) -> Result<Vec<Section<'a>>, FileError> {
        let Some(value) = self.get(key) else { return Ok(Vec::new()) };
        let hint = || value.get_ref().is_table().then(|| several(key));
        let items = value.get_ref().as_array();
        let items = items.ok_or_else(|| self.refuse(key, "is not a list of tables", hint()))?;
        let section = |(i, v): (usize, Value<'a>)| {
            let name = self.key(&format!("{key}[{}]", i + 1));
            match v.get_ref().as_table() {
                Some(table) => Ok(Section { source: self.source, name, span: v.span(), table }),
                None => Err(self.refuse_at(v.span(), name, "is not a table".into(), None)),
            }
        };
        items.iter().enumerate().map(section).collect()
    }
}

fn number(value: &Spanned<DeValue<'_>>) -> Option<f64> {
    match value.get_ref() {
        DeValue::Float(f) => f.as_str().parse().ok(),
        DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse().ok(),
        _ => None,
    }
}

fn integer(value: &Spanned<DeValue<'_>>) -> Option<u64> {
    value.get_ref().as_integer().and_then(|i| u64::from_str_radix(i.as_str(), i.radix()).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "a = 1\nb = [1, 2.5]\n[t]\nword = \"x\"\nbad = [1, \"y\"]\n[[list]]\nn = -1\nx = nan\n";

    fn with<T>(text: &str, f: impl FnOnce(Section<'_>) -> T) -> T {
        let source = Source::new("f.toml", text);
        let table = source.parse().unwrap();
        f(source.root(&table))
    }

    #[test]
    fn values_come_out() {
        with(TEXT, |root| {
            assert_eq!(root.f64("a").unwrap(), Some(1.0));
            assert_eq!(root.interval("b").unwrap(), Some([1.0, 2.5]));
            assert_eq!(root.f64("absent").unwrap(), None);
            assert_eq!(root.section("t").unwrap().unwrap().str("word").unwrap(), Some("x"));
            assert_eq!(root.keys(), ["a", "b", "t", "list"]);
        });
    }

    #[test]
    fn refusals_name_file_line_key_and_value() {
        let message = |e: FileError| e.to_string();
        with(TEXT, |root| {
            let t = root.section("t").unwrap().unwrap();
            let list = root.sections("list").unwrap().remove(0);
            assert_eq!(
                message(t.interval("bad").unwrap_err()),
                "f.toml, line 5: \"t.bad\" = [1, \"y\"] is not a pair [low, high]"
            );
            assert_eq!(
                message(list.u64("n").unwrap_err()),
                "f.toml, line 7: \"list[1].n\" = -1 is not a whole number ≥ 0"
            );
            assert_eq!(
                message(list.f64("x").unwrap_err()),
                "f.toml, line 8: \"list[1].x\" = nan is not a finite number"
            );
            assert_eq!(message(t.require_f64("y").unwrap_err()), "f.toml, line 3: \"t.y\" is missing");
            assert_eq!(message(root.section("a").unwrap_err()), "f.toml, line 1: \"a\" = 1 is not a table");
        });
    }

    #[test]
    fn unknown_keys_are_answered_with_the_nearest() {
        with("sigma = 1\n", |root| {
            let e = root.only(&["sigma2", "phi"]).unwrap_err();
            assert_eq!(e.to_string(), "f.toml, line 1: unknown key \"sigma\"");
            assert_eq!(e.hint().unwrap(), "did you mean \"sigma2\"?");
        });
        with("temperature = 1\n", |root| {
            assert_eq!(root.only(&["phi", "q2"]).unwrap_err().hint().unwrap(), "legal here: phi, q2");
        });
    }

    #[test]
    fn syntax_errors_have_line_and_column() {
        let e = Source::new("f.toml", "a = 1\nb = = 2\n").parse().unwrap_err();
        assert!(e.to_string().starts_with("f.toml, line 2, column 5: "), "{e}");
    }

    #[test]
    fn a_missing_file_is_named() {
        let e = Source::read(Path::new("/no/such.toml")).unwrap_err();
        assert_eq!(e.to_string(), "/no/such.toml: No such file or directory");
        assert!(e.is_system());
    }
}
