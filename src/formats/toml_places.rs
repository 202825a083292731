//! Where a key belongs that stands in another table's place.

use super::toml_path::dotted;
use serde_json::Value;

/// Tables deeper in one another than this have no keys of their own.
const DEEPEST: usize = 6;

/// The tables, as their heads are written, that a schema has a key in.
pub(super) fn places(schema: &Value, key: &str) -> Vec<String> {
    let mut found = Vec::new();
    let search = Search { schema, key };
    search.within(schema, &Place::default(), DEEPEST, &mut found);
    found
}

/// A table of the file.
#[derive(Default)]
struct Place {
    path: String,
    is_list: bool,
}

impl Place {
    fn head(&self) -> String {
        match (self.path.as_str(), self.is_list) {
            ("", _) => "the top of the file".to_owned(),
            (path, true) => format!("[[{path}]]"),
            (path, false) => format!("[{path}]"),
        }
    }
}

struct Search<'a> {
    schema: &'a Value,
    key: &'a str,
}

impl Search<'_> {
    fn within(&self, part: &Value, place: &Place, depth: usize, found: &mut Vec<String>) {
        let Some(deeper) = depth.checked_sub(1) else { return };
        let named = part["$ref"].as_str().and_then(|name| self.schema.pointer(name.strip_prefix('#')?));
        for other in named.into_iter().chain(part["anyOf"].as_array().into_iter().flatten()) {
            self.within(other, place, deeper, found);
        }
        if let Some(items) = part.get("items") {
            self.within(items, &Place { path: place.path.clone(), is_list: true }, deeper, found);
        }
        let Some(properties) = part["properties"].as_object() else { return };
        if properties.contains_key(self.key) && !found.contains(&place.head()) {
            found.push(place.head());
        }
        for (name, value) in properties {
            self.within(value, &Place { path: dotted(&place.path, name), is_list: false }, deeper, found);
        }
    }
}
