//! Scenario files (TOML): see [`Scenario`].

use super::Failure;
use super::file_kind::{self, FileKind};
use super::toml_file::TomlSource;
use nav_sim_navigation::scenario::Scenario;
use std::path::Path;

/// Reads and checks a scenario.
///
/// # Errors
/// File, line, key and value of what is refused; a mistyped key with the nearest legal one.
pub(crate) fn read(path: &Path) -> Result<Scenario, Failure> {
    let refused = |e| file_kind::or_wrong_kind(&[FileKind::Scenario, FileKind::Study], path, e);
    from_source(&TomlSource::read(path)?).map_err(refused)
}

fn from_source(source: &TomlSource) -> Result<Scenario, Failure> {
    let scenario: Scenario = source.get()?;
    scenario.validate().map_err(|e| source.setting(&e))?;
    Ok(scenario)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::tests::{answers, told};
    use serde_json::Value;

    #[test]
    fn mistakes_are_refused_by_line_key_and_value() {
        insta::assert_snapshot!(answers(
            [
                "[run]\nruns = 3\n[gnss]\nrate_hz = 1\npos_sgima_m = [1, 1, 1]",
                "[gps]\nrate_hz = 1",
                "[outage]\nstart_s = 1\nend_s = 2",
                "[run]\nruns = 3\n[imu]\nrate_hz = \"fast\"",
                "gnss.pos_sigma_m = [1, 2]",
                "gnss.pos_sigma_m = [1, 2, 3, 4]",
                "gnss.vel_sigma_m_s = [1, 2, 3, 4]",
                "gnss.lever_arm_m = [1, 2, 3, 4]",
                "imu.temperature.profile_c = [[0, 20, 3], [600, 45]]",
                "filter.states = 16",
                "filter.states = 15",
                "run.method = \"lincav\"",
                "[run]\nruns = 0",
                "[[outage]]\nstart_s = 1\nend_s = 2\n[[outage]]\nstart_s = 5\nend_s = 5",
                "imu.rate_hz = 7.5",
            ]
            .map(|text| (
                text,
                from_source(&TomlSource::new("s.toml", text)).map_err(|e| told(&e))
            ))
        ));
    }

    /// The numbers of a schema, by their keys: what it says of each, and how many stand in a list.
    fn numbers(schema: &Value, root: &Value, key: &str, into: &mut Vec<(String, Value, usize)>) {
        if let Some(name) = schema["$ref"].as_str() {
            return numbers(root.pointer(&name[1..]).unwrap(), root, key, into);
        }
        for (name, part) in schema["properties"].as_object().into_iter().flatten() {
            numbers(
                part,
                root,
                format!("{key}.{name}").trim_start_matches('.'),
                into,
            );
        }
        for part in schema["anyOf"].as_array().into_iter().flatten() {
            numbers(part, root, key, into);
        }
        let has_type = |schema: &Value, name: &str| schema["type"].to_string().contains(name);
        if schema["items"].is_object() {
            match has_type(&schema["items"], "number") {
                true => into.push((key.to_owned(), schema["items"].clone(), 3)),
                false => numbers(&schema["items"], root, &format!("{key}[1]"), into),
            }
        } else if has_type(schema, "number") || has_type(schema, "integer") {
            into.push((key.to_owned(), schema.clone(), 1));
        }
    }

    /// True if a scenario with this value of one key is refused for it.
    fn is_refused(key: &str, value: f64, entries: usize) -> bool {
        let (section, name) = key.rsplit_once('.').unwrap();
        let value = if ["runs", "seed"].contains(&name) {
            format!("{value:.0}")
        } else {
            format!("{value:?}")
        };
        let value = if entries > 1 {
            format!("[1.0, {value}, 1.0]")
        } else {
            value
        };
        let beside = match section {
            "baro" => "rate_hz = 1.0\nsigma_m = 1.0\n",
            "imu.vibration" => "rectification_s2_m = 0.0\n",
            "imu.temperature" => "profile_c = [[0.0, 0.0], [1.0, 1.0]]\n",
            "outage[1]" => "start_s = 1.0\nend_s = 2.0\n",
            "outage_periodic" => "first_s = 1.0\nevery_s = 1e300\nduration_s = 1e-300\n",
            "outage_random" => "rate_per_hour = 1.0\nduration_s = 1.0\n",
            _ => "",
        };
        let beside: String = beside
            .split_inclusive('\n')
            .filter(|l| !l.starts_with(&format!("{name} ")))
            .collect();
        let head = if section.ends_with(']') {
            "[[outage]]".to_owned()
        } else {
            format!("[{section}]")
        };
        let source = TomlSource::new("s.toml", &format!("{head}\n{beside}{name} = {value}\n"));
        let scenario: Result<Scenario, _> = source.get();
        scenario.map_or(true, |scenario| {
            scenario
                .validate()
                .is_err_and(|e| e.key == key && !e.requirement.contains("multiple"))
        })
    }

    /// Every bound of the schema is one of the reader, at the edge; and a number without a bound may be any.
    #[test]
    fn the_schema_has_the_bounds_of_the_reader() {
        let schema = schemars::schema_for!(Scenario).to_value();
        let mut all = Vec::new();
        numbers(&schema, &schema, "", &mut all);
        // Pairs of times, which must increase, and temperatures, which may be any.
        all.retain(|(key, ..)| key != "imu.temperature.profile_c[1]");
        assert_eq!(all.len(), 63);
        for (key, said, entries) in all {
            let refused = |value: f64| is_refused(&key, value, entries);
            let outside =
                |bound: f64, toward: f64| match said["type"].to_string().contains("integer") {
                    true => bound + toward,
                    false if bound == 0.0 => toward * f64::MIN_POSITIVE,
                    false => bound + toward * bound.abs() * 1e-15,
                };
            for (name, toward, ends) in [
                ("minimum", -1.0, -1e300),
                ("exclusiveMinimum", -1.0, 0.0),
                ("maximum", 1.0, 1e300),
                ("exclusiveMaximum", 1.0, 0.0),
            ] {
                let Some(bound) = said[name].as_f64() else {
                    continue;
                };
                let is_open = ends == 0.0;
                assert_eq!(refused(bound), is_open, "{key} {name} {bound}");
                assert!(refused(outside(bound, toward)), "{key} {name} {bound}");
                assert!(
                    !is_open || !refused(outside(bound, -toward)),
                    "{key} {name} {bound}"
                );
            }
            let is_bounded = |a: &str, b: &str| said[a].is_number() || said[b].is_number();
            let is_time = ["start_s", "end_s", "first_s", "seed"]
                .iter()
                .any(|name| key.ends_with(name));
            assert!(
                is_time || is_bounded("minimum", "exclusiveMinimum"),
                "{key}: {said}"
            );
            assert!(
                is_bounded("maximum", "exclusiveMaximum") || !refused(1e9),
                "{key}: {said}"
            );
        }
    }
}
