//! Whether what a directory was made for is what is asked of it now.

use serde_json::{Map, Value};

/// Longest value that is shown whole (characters).
const LONGEST: usize = 80;

/// A key with two values, as they are shown.
#[derive(Debug, PartialEq)]
pub(crate) struct Difference {
    pub(crate) key: String,
    pub(crate) found: String,
    pub(crate) wanted: String,
}

/// The first key that differs: of those wanted, then of those found.
pub(crate) fn first(found: &Map<String, Value>, wanted: &Map<String, Value>) -> Option<Difference> {
    let key = wanted
        .keys()
        .chain(found.keys())
        .find(|key| found.get(*key) != wanted.get(*key))?;
    Some(Difference {
        key: key.clone(),
        found: shown(found.get(key)),
        wanted: shown(wanted.get(key)),
    })
}

fn shown(value: Option<&Value>) -> String {
    let text = value.map_or_else(|| "not given".to_owned(), Value::to_string);
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_key_that_differs_is_named() {
        let object = |text: &str| serde_json::from_str::<Map<String, Value>>(text).unwrap();
        let (a, b) = (
            object("{\"x\": 1, \"y\": \"a\"}"),
            object("{\"x\": 1, \"z\": 2}"),
        );
        assert_eq!(first(&a, &a), None);
        let difference = |key: &str, found: &str, wanted: &str| {
            Some(Difference {
                key: key.into(),
                found: found.into(),
                wanted: wanted.into(),
            })
        };
        assert_eq!(first(&a, &b), difference("z", "not given", "2"));
        assert_eq!(
            first(&b, &object("{\"x\": 1}")),
            difference("z", "2", "not given")
        );
        let long = object(&format!("{{\"x\": \"{}\"}}", "é".repeat(100)));
        assert_eq!(
            first(&a, &long).unwrap().wanted.chars().count(),
            LONGEST + 1
        );
    }
}
