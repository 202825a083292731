//! Sensors on a trajectory: what is measured, with which errors, and when it is missing.

pub mod aiding;
pub mod defects;
pub mod gnss;
pub mod imu;
pub mod outage;

use crate::rng::Generator;
use crate::units::SettingError;
use rand_distr::{Distribution, StandardNormal};
use schemars::{JsonSchema, schema_for};
use serde::Serialize;
use serde_json::Value as Schema;

/// A standard normal number.
pub(crate) fn normal(generator: &mut Generator) -> f64 {
    StandardNormal.sample(generator)
}

/// Checks every number of settings against the bounds that their schema states.
///
/// # Errors
/// The first key whose value is refused.
pub(crate) fn check_bounds<T: JsonSchema + Serialize>(settings: &T) -> Result<(), SettingError> {
    let root = schema_for!(T).to_value();
    // TOML holds what JSON does not: numbers that are infinite or none.
    let value = toml::Value::try_from(settings).expect("serialises");
    check(&root, &root, &value, "")
}

fn check(
    schema: &Schema,
    root: &Schema,
    value: &toml::Value,
    key: &str,
) -> Result<(), SettingError> {
    if let Some(place) = schema["$ref"].as_str() {
        let schema = root.pointer(&place[1..]).expect("schema");
        return check(schema, root, value, key);
    }
    if let Some(kinds) = schema["anyOf"].as_array() {
        // A word or nothing in the place of numbers has no bounds.
        let of_numbers = |kind: &&Schema| {
            kind.get("type")
                .is_none_or(|t| t != "null" && t != "string")
        };
        return kinds
            .iter()
            .filter(of_numbers)
            .try_for_each(|kind| check(kind, root, value, key));
    }
    match value {
        toml::Value::Table(table) => table.iter().try_for_each(|(name, value)| {
            let key = if key.is_empty() {
                name.clone()
            } else {
                format!("{key}.{name}")
            };
            check(&schema["properties"][name], root, value, &key)
        }),
        toml::Value::Array(values) => values.iter().enumerate().try_for_each(|(i, value)| {
            let key = if value.is_table() {
                format!("{key}[{}]", i + 1)
            } else {
                key.to_owned()
            };
            check(&schema["items"], root, value, &key)
        }),
        toml::Value::Float(number) => check_number(schema, *number, key),
        toml::Value::Integer(number) => check_number(schema, *number as f64, key),
        _ => Ok(()),
    }
}

/// Checks a number against the bounds that its schema states.
///
/// # Errors
/// The key whose value is refused.
pub fn check_number(schema: &Schema, number: f64, key: &str) -> Result<(), SettingError> {
    let mut is_within = number.is_finite();
    let mut words = Vec::new();
    let bounds = [
        ("exclusiveMinimum", ">"),
        ("minimum", "≥"),
        ("exclusiveMaximum", "<"),
        ("maximum", "≤"),
    ];
    for (name, sign) in bounds {
        if let Some(bound) = schema[name].as_f64() {
            is_within &= match sign {
                ">" => number > bound,
                "≥" => number >= bound,
                "<" => number < bound,
                _ => number <= bound,
            };
            words.push(format!("{sign} {bound}"));
        }
    }
    if is_within {
        return Ok(());
    }
    let bounds = words.join(" and ");
    let mut requirement = match (schema["minimum"].as_f64(), schema["maximum"].as_f64()) {
        (Some(only), Some(most)) if only == most => format!("it must be {only}"),
        _ => format!("it must be a finite number {bounds}"),
    };
    requirement.truncate(requirement.trim_end().len());
    let slips = [
        ("_m_s2", "mg or g named m/s²?"),
        ("_rad_s", "degrees named radians?"),
        ("_rad", "degrees named radians?"),
    ];
    if let Some((_, slip)) = slips.iter().find(|(unit, _)| key.ends_with(unit)) {
        requirement += &format!(" ({slip})");
    }
    Err(SettingError::new(key, number, requirement))
}
