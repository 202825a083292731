//! What a request comes to.

use crate::app::{Answered, Failure};
use crate::formats::Kind;
use crate::formats::toml_file::Source;
use crate::report::{Answer, OutputFile, json};
use serde::de::DeserializeOwned;

impl Answered {
    /// An answer without files and bounds.
    pub(crate) fn of(answer: &impl Answer) -> Self {
        Self {
            json: json(answer),
            document: answer.document(),
            files: Vec::new(),
            unmet: None,
        }
    }
}

/// A request of any command, from a TOML text with the keys of its fields.
///
/// # Errors
/// The option whose value is refused, its value, and why.
pub fn request<T: DeserializeOwned>(text: &str) -> Result<T, Failure> {
    Source::new("request", text).get().map_err(|e| {
        let message = match &e.kind {
            Kind::Value { key, value, reason } => format!("--{}={value} {reason}", option(key)),
            other => other.to_string(),
        };
        Failure::input(message).maybe_hint(e.hint())
    })
}

/// The option of a key: those that several commands share stand in tables of their own.
fn option(key: &str) -> String {
    let mut parts = key
        .split('.')
        .map(|part| part.split('[').next().unwrap_or(part));
    let first = parts.next().unwrap_or_default();
    let is_shared = ["recordings", "reading", "tuning", "figures", "filter"].contains(&first);
    // of the filter's settings its states have the name of the table
    let own = parts
        .next_back()
        .filter(|part| is_shared && *part != "states");
    own.unwrap_or(first).replace('_', "-")
}

/// Names and contents of files.
pub(crate) fn contents(files: Vec<OutputFile<'_>>) -> Vec<(String, String)> {
    files
        .into_iter()
        .map(|file| (file.name.to_owned(), file.parts.collect()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use std::collections::BTreeMap;

    #[derive(Debug, Deserialize)]
    #[expect(dead_code, reason = "only whether it reads matters")]
    struct Request {
        bootstrap: Option<u32>,
        #[serde(default, with = "crate::parse::text")]
        trim: u32,
        tuning: Option<BTreeMap<String, f64>>,
        outage: Option<Vec<f64>>,
    }

    #[test]
    fn the_option_that_is_refused_is_named() {
        for (text, told) in [
            (
                "bootstrap = \"many\"",
                "--bootstrap=\"many\" is not a whole number ≥ 0",
            ),
            ("bootstrap = -1", "--bootstrap=-1 is not a whole number ≥ 0"),
            ("trim = [1]", "--trim=[1] is neither a text nor a number"),
            ("[tuning]\nskip_s = true", "--skip-s=true is not a number"),
            ("outage = [true]", "--outage=true is not a number"),
        ] {
            assert_eq!(request::<Request>(text).unwrap_err().to_string(), told);
        }
    }
}
