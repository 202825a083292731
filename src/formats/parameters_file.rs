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
use super::toml_file::{Finite, Source, Version, dotted};
use nav_sim_calibration::{BoundDomain, ModelSpec, ParameterLimit};
use nav_sim_signal::imu::{Axis, Sensor};
use nav_sim_signal::noise::Kind;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// What is known, by process and parameter.
type Processes = BTreeMap<String, BTreeMap<String, Range>>;

/// Of a sensor: of all its axes, and of each.
#[derive(Default, Deserialize)]
struct OfSensor {
    #[serde(default)]
    x: Processes,
    #[serde(default)]
    y: Processes,
    #[serde(default)]
    z: Processes,
    #[serde(flatten)]
    all: Processes,
}

/// What is known of a model's parameters before it is fitted
#[derive(Deserialize)]
struct Description {
    #[serde(rename = "schema")]
    _schema: Option<Version>,
    #[serde(default)]
    accel: OfSensor,
    #[serde(default)]
    gyro: OfSensor,
    #[serde(flatten)]
    all: Processes,
}

/// Where a parameter may be, in the units of model files: fixed, or bounded on one side or both
#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline, extend("oneOf" = [{ "required": ["fix"], "maxProperties": 1 }, { "minProperties": 1, "not": { "required": ["fix"] } }]))]
struct Range {
    fix: Option<Finite>,
    lower: Option<Finite>,
    upper: Option<Finite>,
}

/// Processes of one part of the signals.
struct Part {
    path: String,
    sensor: Option<Sensor>,
    axis: Option<Axis>,
    processes: Processes,
}

impl Description {
    /// The parts, the more special later: they win.
    fn parts(self) -> Vec<Part> {
        let mut parts = vec![Part {
            path: String::new(),
            sensor: None,
            axis: None,
            processes: self.all,
        }];
        let mut of_axes = Vec::new();
        for (sensor, own) in Sensor::ALL.into_iter().zip([self.accel, self.gyro]) {
            let (path, sensor) = (sensor.name().to_owned(), Some(sensor));
            for (axis, processes) in Axis::ALL.into_iter().zip([own.x, own.y, own.z]) {
                let path = format!("{path}.{}", axis.name());
                of_axes.push(Part {
                    path,
                    sensor,
                    axis: Some(axis),
                    processes,
                });
            }
            parts.push(Part {
                path,
                sensor,
                axis: None,
                processes: own.all,
            });
        }
        parts.extend(of_axes);
        parts
    }
}

/// Reads the limits of a file. Each is tried on the model.
///
/// # Errors
/// When it cannot be read, names what the model does not have, or bounds between which nothing lies.
pub(crate) fn read(path: &Path, spec: &ModelSpec) -> Result<Vec<ParameterLimit>, FileError> {
    let source = Source::read(path)?;
    limits(&source, source.get()?, spec)
}

/// Reads a file without a model: its layout and its bounds, process by process that it names.
///
/// # Errors
/// As [`read`], for a model of the processes named.
pub(crate) fn check(path: &Path) -> Result<(), FileError> {
    let source = Source::read(path)?;
    let parts = source.get::<Description>()?.parts();
    let spec =
        spec_of(parts.iter().flat_map(|part| part.processes.keys())).unwrap_or_else(ModelSpec::n2);
    limits(&source, source.get()?, &spec).map(|_| ())
}

/// The smallest model that has processes of those labels.
fn spec_of<'a>(labels: impl Iterator<Item = &'a String>) -> Option<ModelSpec> {
    let mut terms = BTreeMap::new();
    for label in labels {
        let (code, count) = label.split_once('_').unwrap_or((label, "1"));
        let count: usize = count.parse().ok()?;
        let most: &mut usize = terms.entry(code).or_insert(0);
        *most = count.max(*most).max(1 + usize::from(label.contains('_')));
    }
    let sum: Vec<String> = terms
        .iter()
        .map(|(code, count)| format!("{count}*{code}"))
        .collect();
    sum.join("+").parse().ok()
}

fn limits(
    source: &Source,
    description: Description,
    spec: &ModelSpec,
) -> Result<Vec<ParameterLimit>, FileError> {
    let labels = spec.labels();
    let mut limits = Vec::new();
    for part in description.parts() {
        let of_model = |process: &&String| !labels.contains(process);
        if let Some(process) = part.processes.keys().find(of_model) {
            return Err(not_of_the_model(
                source,
                &dotted(&part.path, process),
                &labels,
                spec,
            ));
        }
        for process in &labels {
            let Some(ranges) = part.processes.get(process) else {
                continue;
            };
            let (path, legal) = (dotted(&part.path, process), spec.parameter_names(process));
            if let Some(unknown) = ranges.keys().find(|name| !legal.contains(&name.as_str())) {
                return Err(source.unknown(&dotted(&path, unknown), legal.iter().copied()));
            }
            for parameter in legal {
                let Some(range) = ranges.get(parameter) else {
                    continue;
                };
                let path = dotted(&path, parameter);
                let (low, high) = bounds(source, &path, *range)?;
                spec.clone()
                    .limit(process, parameter, low, high)
                    .map_err(|e| {
                        source
                            .refused(&path, format!("is not possible: {e}"))
                            .advice(e.hint())
                    })?;
                let (process, parameter) = (process.clone(), parameter.to_owned());
                let Part { sensor, axis, .. } = part;
                limits.push(ParameterLimit {
                    sensor,
                    axis,
                    process,
                    parameter,
                    low,
                    high,
                });
            }
        }
    }
    Ok(limits)
}

/// The refusal of a process that there is, but not in this model, or that there is not.
fn not_of_the_model(source: &Source, path: &str, labels: &[String], spec: &ModelSpec) -> FileError {
    let process = path.rsplit('.').next().unwrap_or_default();
    if Kind::ALL
        .iter()
        .any(|k| Some(k.code()) == process.split('_').next())
    {
        let refusal = source.refused(path, format!("is no process of the model {spec}"));
        return refusal.advice(format!("its processes: {}", labels.join(", ")));
    }
    source.unknown(path, labels.iter().map(String::as_str))
}

fn bounds(
    source: &Source,
    path: &str,
    range: Range,
) -> Result<(Option<f64>, Option<f64>), FileError> {
    let [fix, lower, upper] = [range.fix, range.lower, range.upper].map(|value| value.map(|v| v.0));
    let reason = match (fix, lower, upper) {
        (Some(value), None, None) => return Ok((Some(value), Some(value))),
        (Some(_), ..) => "is both fixed and bounded",
        (None, None, None) => "neither fixes nor bounds the parameter",
        (None, lower, upper) => return Ok((lower, upper)),
    };
    let advice = "{ fix = 0.98 }, or { lower = 0.9, upper = 0.99 }, or one of these two";
    Err(source.refused(path, reason).advice(advice))
}

/// The JSON schema of such a file: [`Range`] under the names of the table of processes.
pub(crate) fn schema() -> serde_json::Value {
    let mut range = schemars::schema_for!(Range);
    range.remove("$schema");
    range.remove("title");
    let range = range.to_value();
    let of_kind = |kind: Kind| {
        let bounded = |is_shape| bounded(range.clone(), &BoundDomain::of(kind, is_shape));
        let ranges: Map<String, Value> = kind
            .parameters()
            .iter()
            .map(|p| (p.name().to_owned(), bounded(p.is_shape())))
            .collect();
        let repeats = if matches!(kind, Kind::Ar1 | Kind::GaussMarkov) {
            "(_[1-9])?"
        } else {
            ""
        };
        let table =
            json!({ "type": "object", "properties": ranges, "additionalProperties": false });
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
        "What is known of a model's parameters before it is fitted: nav-sim calibrate --parameters"
            .into();
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
        let source = Source::new("p.toml", text);
        let limits = source
            .get()
            .and_then(|description| limits(&source, description, &ModelSpec::n2()));
        limits.map_err(|e| format!("{e} | {}", e.hint().unwrap_or_default()))
    }

    #[test]
    fn the_special_comes_after_the_general() {
        let text = "[accel.x.WN]\nsigma2 = { fix = 3 }\n[WN]\nsigma2 = { lower = 1 }\n[gyro.AR1_2]\nphi = { lower = 0.9, upper = 0.99 }\n";
        let limits = read(text).unwrap();
        let shown: Vec<_> = limits
            .iter()
            .map(|l| (l.sensor, l.axis, l.low, l.high))
            .collect();
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
            (
                "[WM]\n",
                "p.toml, line 1: unknown key \"WM\" | did you mean \"WN\"?",
            ),
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
            (
                "[WN]\nsigma2 = 3\n",
                "p.toml, line 2: \"WN.sigma2\" = 3 is not a table | ",
            ),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
