//! The ranges of schemas are those of the readers.

use super::{SchemaKind, schema_of};
use crate::io::{
    Failure, contamination_file, fusion_files, model_file, scenario_file, trajectory_file,
};
use serde_json::Value;
use std::path::Path;

/// A file with sound values, and its keys whose other values are refused for reasons that no range has: another key, the
/// length of the whole.
struct Sample {
    kind: SchemaKind,
    text: &'static str,
    loose: &'static [&'static str],
}

const ANY_PROCESS: &str = "
rate_hz = 100.0
[[accel.x.processes]]
type = \"WN\"
sigma2 = 0.5
[[accel.x.processes]]
type = \"AR1\"
phi = 0.5
sigma2 = 0.5
[[accel.x.processes]]
type = \"RW\"
gamma2 = 0.5
[[accel.x.processes]]
type = \"QN\"
q2 = 0.5
[[accel.x.processes]]
type = \"DR\"
slope = 0.5
[[accel.x.processes]]
type = \"GM\"
beta = 0.5
s2 = 0.5
[[accel.x.processes]]
type = \"MA1\"
theta = 0.5
sigma2 = 0.5
";

const SCENARIO: &str = "
run = { runs = 100, seed = 1, coverage_level = 0.9 }
outage = [{ start_s = 1.0, end_s = 2.0 }]
[imu]
rate_hz = 100.0
turn_on_bias_accel_m_s2 = 0.1
turn_on_bias_gyro_rad_s = 0.1
scale_ppm_accel = 100.0
scale_ppm_gyro = 100.0
misalignment_rad = 0.01
g_sensitivity_rad_s_per_m_s2 = 0.0001
vibration = { rms_m_s2 = 5.0, rectification_s2_m = 0.0001 }
temperature = { profile_c = [[0.0, 20.0], [60.0, 40.0]], accel_m_s2_k = 0.001, gyro_rad_s_k = 0.00001 }
[gnss]
rate_hz = 1.0
pos_sigma_m = [2.0, 2.0, 4.0]
vel_sigma_m_s = [0.1, 0.1, 0.1]
lever_arm_m = [1.0, 0.0, 0.0]
correlated_pos_sigma_m = [1.0, 1.0, 1.0]
correlation_time_s = 100.0
[baro]
rate_hz = 1.0
sigma_m = 1.0
[initial]
pos_sigma_m = [2.0, 2.0, 4.0]
vel_sigma_m_s = [0.1, 0.1, 0.1]
att_sigma_deg = [1.0, 1.0, 1.0]
accel_bias_sigma_m_s2 = 0.1
gyro_bias_sigma_rad_s = 0.1
accel_scale_sigma_ppm = 100.0
gyro_scale_sigma_ppm = 100.0
";

const INITIAL: &str = "
t_s = 0.0
lat_deg = 46.0
lon_deg = 6.0
h_m = 400.0
v_n_m_s = 1.0
v_e_m_s = 1.0
v_d_m_s = 1.0
roll_deg = 0.0
pitch_deg = 0.0
yaw_deg = 40.0
pos_sigma_m = [2.0, 2.0, 4.0]
vel_sigma_m_s = [0.1, 0.1, 0.1]
att_sigma_deg = [1.0, 1.0, 1.0]
accel_bias_sigma_m_s2 = 0.1
gyro_bias_sigma_rad_s = 0.1
accel_scale_sigma_ppm = 100.0
gyro_scale_sigma_ppm = 100.0
";

/// At rest, so that no value makes a path.
const STANDING: &str = "
start = { t_s = 0.0, lat_deg = 46.0, lon_deg = 6.0, h_m = 400.0, heading_deg = 90.0, speed_m_s = 0.0 }
vehicle = { ramp_s = 2.0 }
segment = [{ kind = \"straight\", duration_s = 20.0, climb_m = 0.0, ramp_s = 2.0 }]
";

const MOVING: &str = "
start = { lat_deg = 46.0, lon_deg = 6.0, h_m = 400.0, heading_deg = 90.0, speed_m_s = 10.0 }
segment = [
  { kind = \"straight\", distance_m = 200.0 },
  { kind = \"climb\", height_m = 5.0, duration_s = 20.0 },
  { kind = \"climb\", height_m = 5.0, distance_m = 200.0 },
  { kind = \"turn\", angle_deg = 45.0, duration_s = 10.0, climb_m = 0.0 },
  { kind = \"turn\", angle_deg = -45.0, rate_deg_s = 10.0 },
  { kind = \"turn\", angle_deg = 45.0, radius_m = 50.0 },
  { kind = \"turn\", angle_deg = -45.0, lateral_accel_m_s2 = 2.0 },
  { kind = \"waypoints\", points = [{ n_m = 3000.0, e_m = 3000.0, h_m = 400.0 }], rate_deg_s = 10.0, climb_m = 0.0 },
  { kind = \"waypoints\", points = [{ n_m = 6000.0, e_m = 3000.0 }], radius_m = 50.0 },
  { kind = \"waypoints\", points = [{ lat_deg = 46.1, lon_deg = 6.04 }], lateral_accel_m_s2 = 2.0 },
  { kind = \"stop\", duration_s = 5.0, decel_m_s2 = 1.0, climb_m = 0.0 },
  { kind = \"accelerate\", to_speed_m_s = 15.0, duration_s = 10.0, climb_m = 0.0 },
  { kind = \"accelerate\", to_speed_m_s = 20.0, accel_m_s2 = 1.0 },
]
";

const CONTAMINATION: &str = "
schema = 1
[[accel]]
operation = \"step\"
amplitude = 1.0
at_share = 0.5
replicates = [1]
[[accel]]
operation = \"step\"
amplitude = 1.0
at_s = 10.0
[[accel]]
operation = \"drift\"
amplitude = 1.0
[[accel]]
operation = \"replace\"
share = 0.01
sigma = 1.0
mean = 0.5
[[gyro]]
operation = \"replace\"
share = 0.07
length_samples = 3
sigma = 1.0
[[gyro]]
operation = \"bursts\"
count = 5
length_samples = 10
spacing_samples = 100
of_samples = 1000.0
amplitude = 1.0
frequency_hz = 5.0
[[gyro]]
operation = \"ar1\"
phi = 0.5
sigma2 = 1.0
[[gyro]]
operation = \"heavy-tails\"
freedom = 3.0
sigma = 1.0
[[gyro]]
operation = \"scale\"
process = \"RW\"
parameter = \"gamma2\"
factor = 4.0
";

const SAMPLES: [Sample; 6] = [
    Sample {
        kind: SchemaKind::Scenario,
        text: SCENARIO,
        loose: &[
            "imu.rate_hz",
            "gnss.rate_hz",
            "baro.rate_hz",
            "start_s",
            "end_s",
            "profile_c.0.0",
            "profile_c.1.0",
        ],
    },
    Sample {
        kind: SchemaKind::Model,
        text: ANY_PROCESS,
        loose: &["rate_hz"],
    },
    Sample {
        kind: SchemaKind::Initial,
        text: INITIAL,
        loose: &[],
    },
    Sample {
        kind: SchemaKind::Profile,
        text: STANDING,
        loose: &["duration_s", "climb_m", "speed_m_s", "ramp_s"],
    },
    Sample {
        kind: SchemaKind::Profile,
        text: MOVING,
        loose: &["_m", "_deg", "_s", "_s2"],
    },
    Sample {
        kind: SchemaKind::Contamination,
        text: CONTAMINATION,
        loose: &["0.share", "3.share", ".sigma2", ".sigma"],
    },
];

fn read(kind: SchemaKind, path: &Path) -> Result<(), Failure> {
    match kind {
        SchemaKind::Scenario => scenario_file::read(path).map(|_| ()),
        SchemaKind::Study => unreachable!("what a run takes is for its options to say"),
        SchemaKind::Model => model_file::read(path).map(|_| ()),
        SchemaKind::Initial => fusion_files::read_initial(path).map(|_| ()),
        SchemaKind::Profile => trajectory_file::load(path, None).map(|_| ()),
        SchemaKind::Contamination => {
            contamination_file::find(&path.to_string_lossy(), 100.0).map(|_| ())
        }
    }
}

/// What a schema may mean for a value: itself, what it refers to, the alternatives whose words the value has.
fn meant<'a>(schema: &'a Value, root: &'a Value, value: &toml::Value) -> Vec<&'a Value> {
    let properties = schema["properties"].as_object().into_iter().flatten();
    let is_other = |(key, said): (&String, &Value)| {
        said["const"]
            .as_str()
            .is_some_and(|word| value.get(key).and_then(toml::Value::as_str) != Some(word))
    };
    if properties.into_iter().any(is_other) {
        return Vec::new();
    }
    let referred = schema["$ref"]
        .as_str()
        .and_then(|name| root.pointer(&name[1..]));
    let several = ["oneOf", "anyOf", "allOf"]
        .into_iter()
        .filter_map(|word| schema[word].as_array())
        .flatten();
    let parts = referred
        .into_iter()
        .chain(several)
        .flat_map(|part| meant(part, root, value));
    std::iter::once(schema).chain(parts).collect()
}

/// The schemas of a key of a table.
fn of_key<'a>(schema: &'a Value, key: &str) -> Option<&'a Value> {
    let is_of = |pattern: &str| {
        let code = pattern
            .trim_start_matches('^')
            .trim_end_matches('$')
            .trim_end_matches("(_[1-9])?");
        key.split('_').next() == Some(code)
    };
    let patterns = schema["patternProperties"]
        .as_object()
        .into_iter()
        .flatten();
    schema["properties"].get(key).or_else(|| {
        patterns
            .into_iter()
            .find(|(p, _)| is_of(p))
            .map(|(_, said)| said)
    })
}

/// A number of a sample: its keys as a pointer, and what the schema says of it.
type Number<'a> = (String, &'a Value);

fn numbers<'a>(
    value: &toml::Value,
    schemas: &[&'a Value],
    root: &'a Value,
    at: &str,
    into: &mut Vec<Number<'a>>,
) {
    let schemas: Vec<&Value> = schemas
        .iter()
        .flat_map(|schema| meant(schema, root, value))
        .collect();
    match value {
        toml::Value::Table(table) => {
            for (key, inner) in table {
                let described: Vec<&Value> = schemas
                    .iter()
                    .filter_map(|schema| of_key(schema, key))
                    .collect();
                numbers(inner, &described, root, &format!("{at}.{key}"), into);
            }
        }
        toml::Value::Array(list) => {
            let items: Vec<&Value> = schemas
                .iter()
                .filter_map(|schema| schema.get("items"))
                .collect();
            for (i, inner) in list.iter().enumerate() {
                numbers(inner, &items, root, &format!("{at}.{i}"), into);
            }
        }
        toml::Value::Integer(_) | toml::Value::Float(_) => {
            let is_number = |said: &&&Value| {
                let kind = said["type"].to_string();
                kind.contains("number") || kind.contains("integer") || said["const"].is_number()
            };
            let said = schemas.iter().find(is_number);
            into.push((
                at.to_owned(),
                said.unwrap_or_else(|| panic!("{at} is not in the schema")),
            ));
        }
        _ => {}
    }
}

/// The sample with another number in this place.
fn with(sample: &toml::Value, path: &str, number: f64) -> String {
    let mut changed = sample.clone();
    let place = path
        .split('.')
        .skip(1)
        .fold(&mut changed, |value, step| match value {
            toml::Value::Array(list) => &mut list[step.parse::<usize>().unwrap()],
            table => &mut table[step],
        });
    *place = match place {
        toml::Value::Integer(_) => toml::Value::Integer(number as i64),
        _ => toml::Value::Float(number),
    };
    toml::to_string(&changed).unwrap()
}

/// Every bound of every schema is one of its reader, at the edge; and where a schema has no bound, the reader takes a
/// billion and its negative.
#[test]
fn schemas_have_the_bounds_of_their_readers() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("sample.toml");
    let model = "rate_hz = 100.0\n[accel]\nprocesses = [{ type = \"WN\", sigma2 = 1.0 }]\n";
    std::fs::write(place.path().join("m.toml"), model).unwrap();
    let mut bounds = [0_usize; 6];
    let mut wrong = Vec::new();
    for Sample { kind, text, loose } in SAMPLES {
        let refused = |text: String| {
            std::fs::write(&path, text).unwrap();
            read(kind, &path).err().map(|e| e.to_string())
        };
        assert_eq!(refused(text.to_owned()), None, "{kind:?}");
        let sample = toml::Value::Table(text.parse().unwrap());
        let root = schema_of(kind);
        let mut all = Vec::new();
        numbers(&sample, &[&root], &root, "", &mut all);
        for (at, said) in all
            .into_iter()
            .filter(|(_, said)| !said["const"].is_number())
        {
            let is_whole = said["type"].to_string().contains("integer");
            let is_loose = loose.iter().any(|key| at.ends_with(key));
            let mut expect = |number: f64, is_refused: bool| {
                let refusal = refused(with(&sample, &at, number));
                if refusal.is_some() != is_refused && (is_refused || !is_loose) {
                    wrong.push(format!("{kind:?}{at} = {number}: {refusal:?}, {said}"));
                }
            };
            for (closed, open, toward) in [
                ("minimum", "exclusiveMinimum", -1.0),
                ("maximum", "exclusiveMaximum", 1.0),
            ] {
                let step = |bound: f64| {
                    toward
                        * if is_whole {
                            1.0
                        } else {
                            1e-9 * bound.abs().max(1.0)
                        }
                };
                match (said[closed].as_f64(), said[open].as_f64()) {
                    (Some(bound), _) => {
                        expect(bound, false);
                        expect(bound + step(bound), true);
                    }
                    (_, Some(bound)) => {
                        expect(bound, true);
                        expect(bound - step(bound), false);
                    }
                    (None, None) if is_loose => continue,
                    (None, None) => {
                        expect(toward * 1e9, false);
                        continue;
                    }
                }
                bounds[kind as usize] += 1;
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // the keys of a study are those of a run, whose options clap bounds
    bounds[SchemaKind::Study as usize] = usize::MAX;
    assert!(bounds.iter().all(|n| *n > 5), "{bounds:?}");
}
