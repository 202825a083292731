//! The JSON schema of model files.

use nav_sim_signal::noise::Kind;
use serde_json::{Map, Value, json};

/// The JSON schema of a model file, for editors and checkers.
#[must_use]
pub(crate) fn schema() -> Value {
    let process = |kind: &Kind| {
        let mut properties = Map::new();
        properties.insert("type".to_owned(), json!({ "const": kind.code() }));
        let interval =
            json!({ "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 });
        let mut required = vec!["type"];
        for (at, parameter) in kind.parameters().iter().enumerate() {
            let mut number = json!({ "type": "number", "description": meaning(parameter.name()) });
            bound(&mut number, *kind, at);
            properties.insert(parameter.name().to_owned(), number);
            properties.insert(format!("{}_ci95", parameter.name()), interval.clone());
            required.push(parameter.name());
        }
        json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
    };
    let processes =
        json!({ "type": "array", "items": { "oneOf": Kind::ALL.iter().map(process).collect::<Vec<_>>() } });
    let axis = json!({
        "type": "object", "properties": { "processes": processes }, "required": ["processes"],
        "additionalProperties": false
    });
    let sensor = json!({
        "description": "All three axes by `processes`, or each by x, y, z",
        "type": "object",
        "properties": { "processes": processes, "x": axis, "y": axis, "z": axis },
        "additionalProperties": false
    });
    let deviation = |unit: &str| json!({ "description": format!("Standard deviation of the constant bias ({unit}), or one for each axis") });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Noise model",
        "description": "What nav-sim calibrate writes and run, fuse, synthesize, export read",
        "type": "object",
        "required": ["rate_hz"],
        "properties": {
            "schema": { "const": super::SCHEMA },
            "rate_hz": { "type": "number", "exclusiveMinimum": 0, "maximum": nav_sim_signal::imu::MAX_RATE_HZ, "description": "Sample rate that the variances are of (Hz)" },
            "accel": sensor,
            "gyro": sensor,
            "turn_on": {
                "type": "object",
                "properties": { "accel_m_s2": deviation("m/s²"), "gyro_rad_s": deviation("rad/s") },
                "additionalProperties": false
            },
            "spread": { "type": "object", "description": "How parameters vary between recordings" },
            "provenance": { "type": "object", "description": "How the model was made" }
        },
        "additionalProperties": false
    })
}

/// Adds the bounds of a parameter; whether a bound itself is in the domain, the process says.
fn bound(number: &mut Value, kind: Kind, place: usize) {
    let holds = |end: f64| {
        let mut values = vec![0.5; kind.parameters().len()];
        values[place] = end;
        kind.process(&values, 1.0).is_some_and(|process| process.is_ok())
    };
    let (low, high) = kind.parameters()[place].domain();
    for (end, closed, open) in [(low, "minimum", "exclusiveMinimum"), (high, "maximum", "exclusiveMaximum")] {
        if end.is_finite() {
            number[if holds(end) { closed } else { open }] = end.into();
        }
    }
}

fn meaning(parameter: &str) -> &'static str {
    match parameter {
        "sigma2" => "variance a sample (units²); of AR1 that of the innovation",
        "q2" => "quantization noise, Q² (units²)",
        "phi" => "AR(1) coefficient: e^(−1/(rate × correlation time))",
        "gamma2" => "variance of an increment (units²)",
        "slope" => "drift (units a sample)",
        "beta" => "reciprocal correlation time (1/s)",
        "s2" => "variance of the process (units²)",
        _ => "coefficient of the moving average",
    }
}
