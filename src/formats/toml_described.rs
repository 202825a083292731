//! TOML files read by their description: serde knows the keys and their types, and what it refuses is said by
//! file, line, key and value, as [`super::toml_file`] does.

use super::error::{FileError, Kind};
use super::suggest::nearest;
use super::toml_file::{Section, Source, missing_key, shown, unknown_key};
use super::toml_path::{dotted, path_at, span_of};
use super::toml_places::places;
use nav_sim_signal::units::SettingError;
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, Deserializer};

/// A parsed file, for its description and for rules that name keys.
#[derive(Debug)]
pub(crate) struct Document<'a> {
    source: &'a Source,
    table: Spanned<DeTable<'a>>,
}

impl<'a> Document<'a> {
    /// The file, parsed once.
    ///
    /// # Errors
    /// Line and column of what is not TOML.
    pub(crate) fn parse(source: &'a Source) -> Result<Self, FileError> {
        Ok(Self { source, table: source.parse()? })
    }

    /// The whole file as one section.
    pub(crate) fn root(&'a self) -> Section<'a> {
        self.source.root(&self.table)
    }

    /// The file as its description has it.
    ///
    /// # Errors
    /// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
    pub(crate) fn read<T: DeserializeOwned>(&self) -> Result<T, FileError> {
        self.root().read()
    }

    /// The same, where a key that is unknown in its table may belong in another: the answer is then where.
    ///
    /// # Errors
    /// As [`Document::read`].
    pub(crate) fn read_placed<T: DeserializeOwned + JsonSchema>(&self) -> Result<T, FileError> {
        self.read().map_err(|e| {
            let Kind::UnknownKey(path) = &e.kind else { return e };
            let key = path.rsplit('.').next().unwrap_or_default().to_owned();
            let places = places(&schemars::schema_for!(T).to_value(), &key);
            match places.split_last() {
                // a key of many tables, such as a name, tells nothing
                Some((last, others)) if others.len() < MOST_PLACES => {
                    let or = if others.is_empty() { "" } else { " or " };
                    e.advice_instead(format!("\"{key}\" belongs in {}{or}{last}", others.join(", ")))
                }
                _ => e,
            }
        })
    }

    /// The line of a dotted key, or of the innermost table around it that the file has.
    pub(crate) fn line_of(&self, path: &str) -> usize {
        self.source.line(span_of(self.table.get_ref(), path).0.start)
    }

    /// The refusal of a key by a rule of the settings, in the line in which it is set.
    pub(crate) fn refused(&self, error: &SettingError) -> FileError {
        let (span, is_set) = span_of(self.table.get_ref(), &error.key);
        let value = if is_set { shown(&self.source.text()[span.clone()]) } else { error.value.clone() };
        let reason = format!("is refused: {}", error.requirement);
        let (key, value, advice) = (error.key.as_str().into(), value.into(), error.advice);
        let error = self
            .source
            .error(self.source.line(span.start), Kind::Value { key, value, reason: reason.into() });
        let error = error.advice_if(advice.map(str::to_owned));
        if is_set { error } else { error.advice("the file does not set it: this is the default") }
    }
}

impl Section<'_> {
    /// The table as its description has it.
    ///
    /// # Errors
    /// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
    pub(crate) fn read<T: DeserializeOwned>(&self) -> Result<T, FileError> {
        let table = Spanned::new(self.span.clone(), self.table.clone());
        T::deserialize(Deserializer::from(table)).map_err(|e| self.explained(&e))
    }

    /// The table as one of several descriptions that a word in it tells apart: beside keys that all of them
    /// have, those of this one.
    ///
    /// # Errors
    /// As [`Section::read`].
    pub(crate) fn read_own<T: DeserializeOwned + JsonSchema>(&self, beside: &[&str]) -> Result<T, FileError> {
        let schema = schemars::schema_for!(T);
        let keys_of_schema = schema.get("properties").and_then(|properties| properties.as_object());
        let keys_of_schema = keys_of_schema.into_iter().flat_map(|keys| keys.keys().map(String::as_str));
        self.only(&beside.iter().copied().chain(keys_of_schema).collect::<Vec<_>>())?;
        self.read()
    }

    /// A refusal by serde as one by key.
    fn explained(&self, error: &toml::de::Error) -> FileError {
        let (source, span) = (self.source, error.span().unwrap_or_default());
        let line = source.line(span.start);
        let path = match path_at(self.table, &span) {
            path if path.is_empty() || span == self.span => self.name.clone(),
            path => self.key(&path),
        };
        let message = error.message();
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        if message.starts_with("unknown field") && !quoted.is_empty() {
            return unknown_key(source, line, path, quoted[0], quoted[1..].iter().copied());
        }
        if message.starts_with("missing field") && !quoted.is_empty() {
            return missing_key(source, line, &[dotted(&path, quoted[0])]);
        }
        let value = shown(source.text().get(span).unwrap_or_default()).into();
        let reason = reason(message, &quoted).into();
        let meant = quoted.split_first().filter(|_| message.starts_with("unknown variant"));
        let meant = meant.and_then(|(word, legal)| nearest(word, legal.iter().copied()));
        let advice = match meant {
            Some(meant) => Some(format!("did you mean \"{meant}\"?")),
            None if message == Finite::REFUSAL => Some(Finite::ADVICE.to_owned()),
            None if message.starts_with("invalid type: map, expected a sequence") => {
                Some(several(path.rsplit('.').next().unwrap_or_default()))
            }
            None => None,
        };
        source.error(line, Kind::Value { key: path.into(), value, reason }).advice_if(advice)
    }
}

/// Most tables that are named as those a key belongs in.
const MOST_PLACES: usize = 3;

/// A number that is neither nan nor inf.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "f64")]
#[schemars(inline)]
pub(crate) struct Finite(pub(crate) f64);

impl Finite {
    pub(super) const REFUSAL: &str = "is not a finite number";
    pub(super) const ADVICE: &str = "a number such as 1.5e-4; neither nan nor inf";
}

impl TryFrom<f64> for Finite {
    type Error = &'static str;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        if value.is_finite() { Ok(Self(value)) } else { Err(Self::REFUSAL) }
    }
}

/// In schemas, one number for all or one for each of several.
#[derive(JsonSchema)]
#[schemars(untagged, inline)]
#[expect(dead_code, reason = "what describes files, for editors")]
pub(crate) enum OneOrEach<T> {
    One(T),
    Each(Vec<T>),
}

/// What to write for a table where a list of them is meant.
pub(super) fn several(key: &str) -> String {
    format!("there may be several: write [[{key}]], in double brackets")
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
        Some("a string") => "is not a text in quotes".to_owned(),
        Some("a sequence") => "is not a list".to_owned(),
        Some("a boolean") => "is not true or false".to_owned(),
        Some(other) if !other.contains(' ') => format!("is refused: {message}"),
        Some(other) => format!("is not {}", other.strip_prefix("struct").map_or(other, |_| "a table")),
        // a type of ours says it in words that follow the value
        None if message.starts_with("is ") => message.to_owned(),
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
            let e = Document::parse(&source).unwrap().read::<File>().unwrap_err();
            assert_eq!(format!("{e} | {}", e.hint().unwrap_or_default()), format!("f.toml, {expected}"));
        }
    }
}
