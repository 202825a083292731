//! Schemas of files; what `check` and `init` say is in `transcripts/files.md`.

use crate::common::drive::*;
use serde_json::Value;
use std::path::Path;

fn schema(kind: &str) -> Value {
    serde_json::from_str(&done(Path::new(ROOT), &format!("schema {kind}")).stdout).unwrap()
}

fn table(file: &str) -> toml::Table {
    std::fs::read_to_string(Path::new(ROOT).join(file))
        .unwrap()
        .parse()
        .unwrap()
}

/// Tables that a word tells apart: the schema has that word, and every key under it.
#[test]
fn schemas_describe_every_key_of_shipped_files() {
    for (kind, file, word, lists) in [
        (
            "model",
            "examples/model.toml",
            "type",
            vec!["accel", "gyro"],
        ),
        (
            "model",
            "calib_data/tactical.toml",
            "type",
            vec!["accel", "gyro"],
        ),
        ("profile", "examples/motion.toml", "kind", vec!["segment"]),
        (
            "profile",
            "trajectories/figure_eight.toml",
            "kind",
            vec!["segment"],
        ),
        (
            "contamination",
            "examples/contamination.toml",
            "operation",
            vec!["accel", "gyro"],
        ),
        (
            "contamination",
            "calib_data/contamination/section5-III.toml",
            "operation",
            vec!["accel", "gyro"],
        ),
    ] {
        let schema = schema(kind);
        let table = table(file);
        let is_property = |key: &String| schema["properties"][key].is_object();
        assert!(table.keys().all(is_property), "{file}");
        let mut entries = 0;
        for list in lists {
            let property = &schema["properties"][list];
            let (items, found) = match table.get(list) {
                None => continue,
                Some(toml::Value::Table(sensor)) => (
                    &property["properties"]["processes"]["items"],
                    &sensor["processes"],
                ),
                Some(found) => (&property["items"], found),
            };
            let items = match items["$ref"].as_str() {
                Some(name) => &schema["$defs"][name.rsplit('/').next().unwrap()],
                None => items,
            };
            for entry in found.as_array().unwrap() {
                let is_own =
                    |of: &&Value| of["properties"][word]["const"] == entry[word].as_str().unwrap();
                let own = items["oneOf"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .find(is_own)
                    .unwrap();
                let alternatives = own["oneOf"].as_array().into_iter().flatten();
                let parts: Vec<&Value> = alternatives.chain([own, items]).collect();
                let is_known =
                    |key: &String| parts.iter().any(|part| part["properties"][key].is_object());
                assert!(
                    entry.as_table().unwrap().keys().all(is_known),
                    "{file}: {entry}"
                );
                entries += 1;
            }
        }
        assert!(entries > 0, "{file}");
    }
}
