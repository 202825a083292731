//! Parameters for other programs, as a user gets them.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn nav_sim(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// An accelerometer without WN whose white noise is a fast AR1, a gyroscope with WN, at 50 Hz.
const MODEL: &str = r#"
schema = 1
rate_hz = 50.0
[accel]
processes = [
  { type = "WN", sigma2 = 0.0 },
  { type = "AR1", phi = 0.5, sigma2 = 1e-4 },
  { type = "RW", gamma2 = 1e-11 },
]
[gyro]
processes = [
  { type = "WN", sigma2 = 1e-6 },
  { type = "RW", gamma2 = 1e-14 },
]
"#;

fn place() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("model.toml"), MODEL).unwrap();
    directory
}

/// `key: value  # …` of a YAML file.
fn yaml(text: &str, key: &str) -> f64 {
    let line = text
        .lines()
        .find_map(|l| l.trim().strip_prefix(key)?.strip_prefix(": "))
        .unwrap();
    line.split('#').next().unwrap().trim().parse().unwrap()
}

/// Allan deviation of adjacent means of `m` samples, from its definition.
fn allan_deviation(samples: &[f64], m: usize) -> f64 {
    let means: Vec<f64> = samples
        .chunks_exact(m)
        .map(|c| c.iter().sum::<f64>() / m as f64)
        .collect();
    let squares: f64 = means.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    (0.5 * squares / (means.len() - 1) as f64).sqrt()
}

/// N is the Allan deviation at 1 s of a recording of such an IMU, though WN is zero: within 10 %, the bound asked for. The
/// estimate from 4000 means of 1 s has a standard deviation of √(3/(4·4000)) = 1.4 %.
#[test]
fn the_exported_density_is_the_allan_deviation_of_a_recording() {
    let place = place();
    let arguments = [
        "synthesize",
        "model.toml",
        "--duration",
        "4000",
        "--seed",
        "1",
        "-o",
        "recordings",
    ];
    assert!(nav_sim(place.path(), &arguments).status.success());
    let recording =
        std::fs::read_to_string(place.path().join("recordings/replicate_1.csv")).unwrap();
    let header: Vec<&str> = recording.lines().next().unwrap().split(',').collect();
    let column = |name: &str| -> Vec<f64> {
        let place = header.iter().position(|h| *h == name).unwrap();
        recording
            .lines()
            .skip(1)
            .map(|l| l.split(',').nth(place).unwrap().parse().unwrap())
            .collect()
    };
    let output = nav_sim(
        place.path(),
        &["export", "model.toml", "--target", "kalibr"],
    );
    assert!(output.status.success(), "{}", text(&output.stderr));
    let exported = text(&output.stdout);
    let pairs = [
        ("accel_x_m_s2", "accelerometer_noise_density"),
        ("gyro_z_rad_s", "gyroscope_noise_density"),
    ];
    for (signal, key) in pairs {
        let (read, measured) = (yaml(&exported, key), allan_deviation(&column(signal), 50));
        assert!(
            (read / measured - 1.0).abs() < 0.1,
            "{key}: {read:e} {measured:e}"
        );
    }
}

/// Strict takes names at their word: N = 0 with a warning; a file is written whole, with its certificate.
#[test]
fn strict_warns_and_writes_a_file() {
    let place = place();
    let arguments = [
        "export",
        "model.toml",
        "--target",
        "openvins",
        "--policy",
        "strict",
        "-o",
        "imu.yaml",
    ];
    let output = nav_sim(place.path(), &arguments);
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(
        said.contains("warning: accel: N is 0, which many filters refuse"),
        "{said}"
    );
    let file = std::fs::read_to_string(place.path().join("imu.yaml")).unwrap();
    assert!(
        file.starts_with("%YAML:1.0\n# openvins: model.toml, 50 Hz, policy strict"),
        "{file}"
    );
    assert!(
        file.contains("# Warning: accel: N is 0") && file.contains("\nimu0:\n  rostopic: "),
        "{file}"
    );
    assert_eq!(yaml(&file, "accelerometer_noise_density"), 0.0);
    assert!(
        (yaml(&file, "gyroscope_noise_density") / (1e-6_f64 / 50.0).sqrt() - 1.0).abs() < 1e-12
    );
    assert!((yaml(&file, "gyroscope_random_walk") / (1e-14_f64 * 50.0).sqrt() - 1.0).abs() < 1e-12);
}

#[test]
fn json_has_all_numbers_with_units() {
    let place = place();
    let arguments = [
        "export",
        "model.toml",
        "--target",
        "vins",
        "--format",
        "json",
        "--horizon",
        "2:60s",
    ];
    let output = nav_sim(place.path(), &arguments);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&json["target"], &json["policy"]),
        (&"vins".into(), &"matched".into())
    );
    assert_eq!(json["horizon_s"], serde_json::json!([2.0, 60.0]));
    let entries = json["entries"].as_array().unwrap();
    let keys: Vec<&str> = entries.iter().map(|e| e["key"].as_str().unwrap()).collect();
    assert_eq!(keys, ["acc_n", "gyr_n", "acc_w", "gyr_w"]);
    assert!(
        entries
            .iter()
            .all(|e| e["value"].is_f64() && e["unit"].is_string()),
        "{entries:?}"
    );
    let gyro = &json["sensors"]["gyro"];
    // a sample of the midpoint rule at f Hz has N sqrt(2f)
    let n = gyro["exported"]["density"].as_f64().unwrap();
    let sample = entries[1]["value"].as_f64().unwrap();
    let rate_hz = json["rate_hz"].as_f64().unwrap();
    assert!((sample / (n * (2.0 * rate_hz).sqrt()) - 1.0).abs() < 1e-12);
    // the minimum of N²/τ + K²τ/3, √3 N/K = 346 s, within the 10 000 s of a model that no calibration made
    let minimum = gyro["largest"]["minimum"]["tau_s"].as_f64().unwrap();
    assert!((minimum / 346.4 - 1.0).abs() < 0.05, "{minimum}");
    assert!(gyro["closure"]["highest"]["ratio"].is_f64());
}

#[test]
fn what_cannot_be_exported_is_refused() {
    let place = place();
    let accel_only = MODEL.split("[gyro]").next().unwrap();
    std::fs::write(place.path().join("accel.toml"), accel_only).unwrap();
    let refused = |arguments: &[&str]| {
        let output = nav_sim(place.path(), &[&["export"], arguments].concat());
        assert_eq!(
            (output.status.code(), output.stdout.as_slice()),
            (Some(2), &b""[..]),
            "{arguments:?}"
        );
        text(&output.stderr)
    };
    let said = refused(&["model.toml", "--target", "kalbr"]);
    assert!(said.contains("a similar value exists: 'kalibr'"), "{said}");
    let said = refused(&["accel.toml", "--target", "px4"]);
    assert!(
        said.starts_with("error: accel.toml: the model has no gyro, and px4 needs both"),
        "{said}"
    );
    assert!(said.contains("\n\nhint: calibrate both sensors"), "{said}");
    let said = refused(&["model.toml", "--target", "px4", "--horizon", "100s:1s"]);
    assert!(
        said.contains("the horizon 100 s to 1 s is refused"),
        "{said}"
    );
    let said = refused(&["model.toml", "--target", "px4", "--horizon", "soon"]);
    assert!(said.contains("such as 1s:100s"), "{said}");
    let said = refused(&["model.toml", "--target", "px4", "-o", "model.toml"]);
    assert!(
        said.contains("is an input and would be overwritten"),
        "{said}"
    );
}
