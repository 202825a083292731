//! What is known of a model's parameters before it is fitted (TOML), for `nav-sim calibrate --parameters`.
//!
//! ```toml
//! schema = 1
//! [WN]                                # of every signal
//! sigma2 = { lower = 1e-6, upper = 1e-4 }
//! [gyro.AR1_1]                        # of the gyroscopes
//! phi = { fix = 0.98 }
//! [accel.x.RW]                        # of one axis (with --pool axes)
//! gamma2 = { fix = 0 }                # not there
//! ```
//!
//! Parameters and units are those of model files. What is said of an axis wins over what is said of its
//! sensor, and that over what is said of all.

use super::FileError;
use super::toml_described::Finite;
use super::toml_file::{Section, Source};
use nav_sim_calibration::{BoundDomain, ModelSpec, ParameterLimit};
use nav_sim_signal::imu::{Axis, Sensor};
use nav_sim_signal::noise::Kind;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::path::Path;
use toml::de::DeTable;

/// Reads the limits of a file. Each is tried on the model.
///
/// # Errors
/// When it cannot be read, names what the model does not have, or bounds between which nothing lies.
pub(crate) fn read(path: &Path, spec: &ModelSpec) -> Result<Vec<ParameterLimit>, FileError> {
    limits(&Source::read(path)?, spec)
}

/// Reads a file without a model: its layout and its bounds, process by process that it names.
///
/// # Errors
/// As [`read`], for a model of the processes named.
pub(crate) fn check(path: &Path) -> Result<(), FileError> {
    let source = Source::read(path)?;
    let table = source.parse()?;
    let mut names = Vec::new();
    named(table.get_ref(), &mut names);
    let spec = spec_of(&names).unwrap_or_else(ModelSpec::n2);
    limits(&source, &spec).map(|_| ())
}

/// Labels of processes that a table names, at any depth.
fn named(table: &DeTable<'_>, names: &mut Vec<String>) {
    for (key, value) in table {
        let (key, Some(inner)) = (key.get_ref(), value.get_ref().as_table()) else { continue };
        let outer = Sensor::ALL.iter().any(|s| s.name() == key) || Axis::ALL.iter().any(|a| a.name() == key);
        if outer { named(inner, names) } else { names.push(key.to_string()) }
    }
}

/// The smallest model that has processes of those labels.
fn spec_of(labels: &[String]) -> Option<ModelSpec> {
    let mut terms = std::collections::BTreeMap::new();
    for label in labels {
        let (code, count) = label.split_once('_').unwrap_or((label, "1"));
        let count: usize = count.parse().ok()?;
        let most: &mut usize = terms.entry(code).or_insert(0);
        *most = count.max(*most).max(1 + usize::from(label.contains('_')));
    }
    let sum: Vec<String> = terms.iter().map(|(code, count)| format!("{count}*{code}")).collect();
    sum.join("+").parse().ok()
}

fn limits(source: &Source, spec: &ModelSpec) -> Result<Vec<ParameterLimit>, FileError> {
    let table = source.parse()?;
    let root = source.root(&table);
    if root.u64("schema")?.is_some_and(|s| s != 1) {
        return Err(root.refuse("schema", "is not a schema this version reads: it reads 1", None));
    }
    let labels = spec.labels();
    let mut known: Vec<&str> = labels.iter().map(String::as_str).collect();
    let processes = known.clone();
    known.extend(Sensor::ALL.map(Sensor::name));
    let mut limits = Vec::new();
    not_of_the_model(&root, &processes, spec)?;
    root.only(&[known.as_slice(), &["schema"]].concat())?;
    of_processes(&root, &processes, None, None, spec, &mut limits)?;
    for sensor in Sensor::ALL {
        let Some(section) = root.section(sensor.name())? else { continue };
        not_of_the_model(&section, &processes, spec)?;
        section.only(&[processes.as_slice(), &Axis::ALL.map(Axis::name)].concat())?;
        of_processes(&section, &processes, Some(sensor), None, spec, &mut limits)?;
        for axis in Axis::ALL {
            let Some(section) = section.section(axis.name())? else { continue };
            not_of_the_model(&section, &processes, spec)?;
            section.only(&processes)?;
            of_processes(&section, &processes, Some(sensor), Some(axis), spec, &mut limits)?;
        }
    }
    // The more special later: they win.
    limits.sort_by_key(|l| usize::from(l.sensor.is_some()) + usize::from(l.axis.is_some()));
    Ok(limits)
}

/// Refuses a process that there is, but not in this model.
fn not_of_the_model(section: &Section<'_>, processes: &[&str], spec: &ModelSpec) -> Result<(), FileError> {
    let is_process = |key: &str| Kind::ALL.iter().any(|k| Some(k.code()) == key.split('_').next());
    match section.keys().into_iter().find(|key| is_process(key) && !processes.contains(key)) {
        None => Ok(()),
        Some(key) => {
            let hint = format!("its processes: {}", processes.join(", "));
            Err(section.refuse(key, format!("is no process of the model {spec}"), Some(hint)))
        }
    }
}

fn of_processes(
    section: &Section<'_>,
    processes: &[&str],
    sensor: Option<Sensor>,
    axis: Option<Axis>,
    spec: &ModelSpec,
    into: &mut Vec<ParameterLimit>,
) -> Result<(), FileError> {
    for process in processes {
        let Some(table) = section.section(process)? else { continue };
        table.only(&spec.parameter_names(process))?;
        for parameter in table.keys() {
            let Some(range) = table.section(parameter)? else { continue };
            let (low, high) = bounds(&table, parameter, &range.read()?)?;
            let refuse = |e: nav_sim_calibration::LimitError| {
                table.refuse(parameter, format!("is not possible: {e}"), Some(e.hint()))
            };
            spec.clone().limit(process, parameter, low, high).map_err(refuse)?;
            let (process, parameter) = ((*process).to_owned(), parameter.to_owned());
            into.push(ParameterLimit { sensor, axis, process, parameter, low, high });
        }
    }
    Ok(())
}

/// Where a parameter may be, in the units of model files: fixed, or bounded on one side or both
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline, extend("oneOf" = [{ "required": ["fix"], "maxProperties": 1 }, { "minProperties": 1, "not": { "required": ["fix"] } }]))]
struct Range {
    fix: Option<Finite>,
    lower: Option<Finite>,
    upper: Option<Finite>,
}

fn bounds(
    table: &Section<'_>,
    parameter: &str,
    range: &Range,
) -> Result<(Option<f64>, Option<f64>), FileError> {
    let [fix, lower, upper] = [range.fix, range.lower, range.upper].map(|value| value.map(|v| v.0));
    let hint = || Some("{ fix = 0.98 }, or { lower = 0.9, upper = 0.99 }, or one of these two".to_owned());
    match (fix, lower, upper) {
        (Some(value), None, None) => Ok((Some(value), Some(value))),
        (Some(_), ..) => Err(table.refuse(parameter, "is both fixed and bounded", hint())),
        (None, None, None) => Err(table.refuse(parameter, "neither fixes nor bounds the parameter", hint())),
        (None, lower, upper) => Ok((lower, upper)),
    }
}

/// The JSON schema of such a file: [`Range`] under the names of the table of processes.
pub(crate) fn schema() -> serde_json::Value {
    let mut range = schemars::schema_for!(Range);
    range.remove("$schema");
    range.remove("title");
    let range = range.to_value();
    let of_kind = |kind: Kind| {
        let bounded = |is_shape| bounded(range.clone(), &BoundDomain::of(kind, is_shape));
        let ranges: Map<String, Value> =
            kind.parameters().iter().map(|p| (p.name().to_owned(), bounded(p.is_shape()))).collect();
        let repeats = if matches!(kind, Kind::Ar1 | Kind::GaussMarkov) { "(_[1-9])?" } else { "" };
        let table = json!({ "type": "object", "properties": ranges, "additionalProperties": false });
        (format!("^{}{repeats}$", kind.code()), table)
    };
    let processes: Map<String, Value> = Kind::ALL.into_iter().map(of_kind).collect();
    let table = |inner: Value| {
        json!({
            "type": "object", "patternProperties": processes, "properties": inner, "additionalProperties": false
        })
    };
    let axis = table(json!({}));
    let sensor = table(json!({ "x": axis, "y": axis, "z": axis }));
    let mut file = table(json!({ "schema": { "const": 1 }, "accel": sensor, "gyro": sensor }));
    file["$schema"] = "https://json-schema.org/draft/2020-12/schema".into();
    file["title"] = "Parameters".into();
    file["description"] =
        "What is known of a model's parameters before it is fitted: nav-sim calibrate --parameters".into();
    file
}

/// The schema of [`Range`] of a parameter whose bounds lie there.
fn bounded(mut range: Value, domain: &BoundDomain) -> Value {
    let (least, most) = match domain.is_open {
        true => ("exclusiveMinimum", "exclusiveMaximum"),
        false => ("minimum", "maximum"),
    };
    for (_, end) in range["properties"].as_object_mut().into_iter().flatten() {
        (end[least], end[most]) = (domain.low.into(), domain.high.into());
    }
    range
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<ParameterLimit>, String> {
        limits(&Source::new("p.toml", text), &ModelSpec::n2())
            .map_err(|e| format!("{e} | {}", e.hint().unwrap_or_default()))
    }

    #[test]
    fn the_special_comes_after_the_general() {
        let text = "[accel.x.WN]\nsigma2 = { fix = 3 }\n[WN]\nsigma2 = { lower = 1 }\n[gyro.AR1_2]\nphi = { lower = 0.9, upper = 0.99 }\n";
        let limits = read(text).unwrap();
        let shown: Vec<_> = limits.iter().map(|l| (l.sensor, l.axis, l.low, l.high)).collect();
        let (accel, gyro) = (Some(Sensor::Accel), Some(Sensor::Gyro));
        assert_eq!(
            shown,
            [
                (None, None, Some(1.0), None),
                (gyro, None, Some(0.9), Some(0.99)),
                (accel, Some(Axis::X), Some(3.0), Some(3.0))
            ]
        );
    }

    #[test]
    fn mistakes_are_named() {
        for (text, expected) in [
            ("[WM]\n", "p.toml, line 1: unknown key \"WM\" | did you mean \"WN\"?"),
            (
                "[DR]\nslope = { fix = 1 }\n",
                "p.toml, line 1: \"DR\" = [DR] is no process of the model WN+QN+2*AR1+RW | its processes: WN, QN, AR1_1, AR1_2, RW",
            ),
            (
                "[WN]\nsigma = { fix = 1 }\n",
                "p.toml, line 2: unknown key \"WN.sigma\" | did you mean \"sigma2\"?",
            ),
            (
                "[WN]\nsigma2 = { fix = 1, lower = 0 }\n",
                "p.toml, line 2: \"WN.sigma2\" = { fix = 1, lower = 0 } is both fixed and bounded | ",
            ),
            (
                "[AR1_1]\nphi = { lower = 0.9, upper = 0.8 }\n",
                "p.toml, line 2: \"AR1_1.phi\" = { lower = 0.9, upper = 0.8 } is not possible: AR1_1 phi: nothing lies between 0.9 and 0.8 | lower ≤ upper",
            ),
            (
                "[gyro.RW]\ngamma2 = { fix = -1 }\n",
                "p.toml, line 2: \"gyro.RW.gamma2\" = { fix = -1 } is not possible: RW gamma2: -1 is not a number from 0 to 1e100 | ",
            ),
            ("[WN]\nsigma2 = 3\n", "p.toml, line 2: \"WN.sigma2\" = 3 is not a table | "),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
