//! TOML files read by their description: serde knows the keys and their types, and what it refuses is said by
//! file, line, key and value, as [`super::toml_file`] does.

use super::error::{FileError, Kind};
use super::suggest::nearest;
use super::toml_file::{Source, missing_key, shown, unknown_key};
use serde::de::DeserializeOwned;
use std::ops::Range;

/// A file as its description has it.
///
/// # Errors
/// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
pub(crate) fn read<T: DeserializeOwned>(source: &Source) -> Result<T, FileError> {
    source.parse()?;
    toml::from_str(source.text()).map_err(|e| explained(&e, source))
}

/// A refusal by serde as one by key.
fn explained(error: &toml::de::Error, source: &Source) -> FileError {
    let span = error.span().unwrap_or_default();
    let line = source.line(span.start);
    let section = section_at(source.text(), span.start);
    let message = error.message();
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if message.starts_with("unknown field") && !quoted.is_empty() {
        let key = dotted(&section, quoted[0]);
        return unknown_key(source, line, key, quoted[0], quoted[1..].iter().copied());
    }
    if message.starts_with("missing field") && !quoted.is_empty() {
        return missing_key(source, line, &[dotted(&table_at(source.text(), span), quoted[0])]);
    }
    let kind = Kind::Value {
        key: dotted(&section, &key_before(source.text(), span.start)).into(),
        value: shown(source.text().get(span).unwrap_or_default()).into(),
        reason: reason(message, &quoted).into(),
    };
    let meant = quoted.split_first().filter(|_| message.starts_with("unknown variant"));
    let meant = meant.and_then(|(word, legal)| nearest(word, legal.iter().copied()));
    source.error(line, kind).advice_if(meant.map(|meant| format!("did you mean \"{meant}\"?")))
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
        None => format!("is refused: {message}"),
    }
}

/// Name of the table that a span is: its head, an inline table, or the rest of the file.
fn table_at(text: &str, span: Range<usize>) -> String {
    let (section, written) = (section_at(text, span.start), text.get(span.clone()).unwrap_or_default());
    if written.starts_with('[') && written.ends_with(']') {
        written.trim_matches(['[', ']', ' ']).to_owned()
    } else if written.starts_with('{') {
        dotted(&section, &key_before(text, span.start))
    } else {
        section
    }
}

/// Name of the table a byte stands in: the last head before it.
fn section_at(text: &str, at: usize) -> String {
    let head = |line: &str| {
        let name = line.trim().strip_prefix('[')?.trim_start_matches('[').split(']').next()?;
        Some(name.trim().to_owned())
    };
    text[..at].lines().rev().find_map(head).unwrap_or_default()
}

/// The key whose value begins at a byte: what stands before the last `=`.
fn key_before(text: &str, at: usize) -> String {
    let before = text[..at].rsplit('\n').next().unwrap_or_default();
    let left = before.rsplit_once('=').map_or(before, |(left, _)| left);
    left.rsplit(['{', ',']).next().unwrap_or_default().trim().to_owned()
}

fn dotted(section: &str, key: &str) -> String {
    if section.is_empty() { key.to_owned() } else { format!("{section}.{key}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct File {
        count: u64,
        part: Option<Part>,
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
            ("count = 1\nconut = 1", "line 2: unknown key \"conut\" | did you mean \"count\"?"),
        ] {
            let e = read::<File>(&Source::new("f.toml", text)).unwrap_err();
            assert_eq!(format!("{e} | {}", e.hint().unwrap_or_default()), format!("f.toml, {expected}"));
        }
    }
}
