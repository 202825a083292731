//! CSV of rows by their JSON.

use nav_sim_document::shortest;
use serde::Serialize;
use serde_json::{Map, Value};

/// Results beside one another in one JSON object.
pub(crate) fn merged<const N: usize>(results: [Value; N]) -> Value {
    Value::Object(
        results
            .into_iter()
            .flat_map(|result| match result {
                Value::Object(fields) => fields,
                _ => Map::new(),
            })
            .collect(),
    )
}

/// A row without nesting: keys of an object follow its own after `_`, and an interval `ci95_pct` becomes `ci95_low_pct` and
/// `ci95_high_pct`.
pub(crate) fn flat(row: &impl Serialize) -> Map<String, Value> {
    let mut cells = Map::new();
    put(
        String::new(),
        serde_json::to_value(row).unwrap_or_default(),
        &mut cells,
    );
    cells
}

fn put(key: String, value: Value, into: &mut Map<String, Value>) {
    match value {
        Value::Object(fields) => fields.into_iter().for_each(|(name, value)| {
            let key = if key.is_empty() {
                name
            } else {
                format!("{key}_{name}")
            };
            put(key, value, into);
        }),
        ends if key.contains("ci95_") => {
            for (k, end) in ["ci95_low_", "ci95_high_"].into_iter().enumerate() {
                into.insert(
                    key.replace("ci95_", end),
                    ends.get(k).cloned().unwrap_or_default(),
                );
            }
        }
        value => _ = into.insert(key, value),
    }
}

/// Rows with the columns of all; a missing value is an empty cell.
pub(crate) fn csv(rows: &[Map<String, Value>]) -> String {
    let mut columns = Map::new();
    rows.iter()
        .flat_map(Map::keys)
        .for_each(|key| _ = columns.insert(key.clone(), Value::Null));
    if columns.is_empty() {
        return String::new();
    }
    let mut to = csv::Writer::from_writer(Vec::new());
    let cell = |value: Option<&Value>| match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => text.clone(),
        Some(Value::Number(x)) if x.is_f64() => shortest(x.as_f64().unwrap_or(f64::NAN)),
        Some(other) => other.to_string(),
    };
    let lines = rows
        .iter()
        .map(|row| columns.keys().map(|key| cell(row.get(key))).collect());
    let head: Vec<String> = columns.keys().cloned().collect();
    for line in std::iter::once(head).chain(lines) {
        to.write_record(line).expect("columns");
    }
    String::from_utf8(to.into_inner().unwrap_or_default()).unwrap_or_default()
}
