//! Parameters for other programs, as a user gets them; the words of `export` are in `transcripts/files.md`.

use crate::common::drive::*;

/// An accelerometer without WN whose white noise is a fast AR1, a gyroscope with WN, at 50 Hz.
const FAST: &str = r#"
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

fn place() -> Place {
    let place = Place::new();
    place.write("model.toml", FAST);
    place
}

/// Allan deviation of adjacent means of `m` samples, from its definition.
fn allan_deviation(samples: &[f64], m: usize) -> f64 {
    let chunks = samples.chunks_exact(m);
    let means: Vec<f64> = chunks.map(|c| c.iter().sum::<f64>() / m as f64).collect();
    let squares: f64 = means.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    (0.5 * squares / (means.len() - 1) as f64).sqrt()
}

/// N is the Allan deviation at 1 s of a recording of such an IMU, though WN is zero: within 10 %, the bound asked for. The
/// estimate from 4000 means of 1 s has a standard deviation of √(3/(4·4000)) = 1.4 %.
#[test]
fn the_exported_density_is_the_allan_deviation_of_a_recording() {
    let place = place();
    place.done("synthesize model.toml --duration 4000 --seed 1 -o recordings");
    let rows = place.table("recordings/replicate_1.csv");
    let exported = place.answer("export model.toml --target kalibr");
    // columns of accel.x and gyro.z, behind the time
    for (column, sensor) in [(1, "accel"), (6, "gyro")] {
        let samples: Vec<f64> = rows.iter().map(|row| row[column]).collect();
        let measured = allan_deviation(&samples, 50);
        let density = number(&exported, &format!("/sensors/{sensor}/exported/density"));
        assert!(
            off(density, measured) < 0.1,
            "{sensor}: {density:e} {measured:e}"
        );
    }
}

#[test]
fn json_has_all_numbers_with_units() {
    let place = place();
    let json = place.answer("export model.toml --target vins --horizon 2:60s");
    assert_eq!(
        (&json["target"], &json["policy"]),
        (&"vins".into(), &"matched".into())
    );
    assert_eq!(numbers(&json, "/horizon_s"), [2.0, 60.0]);
    let entries = json["entries"].as_array().unwrap();
    let keys: Vec<&str> = entries.iter().map(|e| e["key"].as_str().unwrap()).collect();
    assert_eq!(keys, ["acc_n", "gyr_n", "acc_w", "gyr_w"]);
    assert!(
        entries
            .iter()
            .all(|e| e["value"].is_f64() && e["unit"].is_string()),
        "{json}"
    );
    // a sample of the midpoint rule at f Hz has N sqrt(2f)
    let density = number(&json, "/sensors/gyro/exported/density");
    let sample = density * (2.0 * number(&json, "/rate_hz")).sqrt();
    assert!(off(number(&json, "/entries/1/value"), sample) < 1e-12);
    // the minimum of N²/τ + K²τ/3, √3 N/K = 346 s, within the 10 000 s of a model that no calibration made
    let minimum = number(&json, "/sensors/gyro/largest/minimum/tau_s");
    assert!(off(minimum, 346.4) < 0.05, "{minimum}");
    assert!(json["sensors"]["gyro"]["closure"]["highest"]["ratio"].is_f64());
}

/// Strict takes names at their word: N = 0, and N and K of the gyroscope.
#[test]
fn strict_exports_the_processes_as_they_are() {
    let json = place().answer("export model.toml --target openvins --policy strict");
    let value = |k: usize| number(&json, &format!("/entries/{k}/value"));
    assert_eq!(
        (&json["entries"][0]["key"], value(0)),
        (&"accelerometer_noise_density".into(), 0.0)
    );
    for (k, key, expected) in [
        (2, "gyroscope_noise_density", (1e-6_f64 / 50.0).sqrt()),
        (3, "gyroscope_random_walk", (1e-14_f64 * 50.0).sqrt()),
    ] {
        assert_eq!(json["entries"][k]["key"], key);
        assert!(off(value(k), expected) < 1e-12, "{json}");
    }
}
