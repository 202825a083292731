//! What the means of recordings say of a turn-on bias, as a user meets it.

use crate::common::drive::*;
use nav_sim::io::model_file;
use nav_sim::signal::imu::Sensor;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What the gyroscopes of four recordings were switched on with (rad/s).
const BIASES: [f64; 4] = [3e-3, -2e-3, 1e-3, -4e-3];

/// Four recordings; the gyroscopes of each with a constant bias times this.
fn recordings(dir: &Path, times: f64) {
    done(
        dir,
        "synthesize imu.toml --replicates 4 --samples 4096 --seed 1 -o static",
    );
    for (k, bias) in BIASES.iter().enumerate() {
        let path = dir.join(format!("static/replicate_{}.csv", k + 1));
        let text = fs::read_to_string(&path).unwrap();
        let biased = |(i, cell): (usize, &str)| match i {
            0..4 => cell.to_owned(),
            _ => format!("{:e}", cell.parse::<f64>().unwrap() + times * bias),
        };
        let row = |line: &str| {
            line.split(',')
                .enumerate()
                .map(biased)
                .collect::<Vec<_>>()
                .join(",")
        };
        let rows = text
            .lines()
            .enumerate()
            .map(|(n, line)| if n == 0 { line.to_owned() } else { row(line) });
        fs::write(&path, rows.collect::<Vec<_>>().join("\n") + "\n").unwrap();
    }
}

const CALIBRATE: &str = "calibrate static --model WN+AR1 --bootstrap 0 --seed 1 -o m.toml";

#[test]
fn a_turn_on_bias_is_stored_said_and_expected_by_run() {
    let place = place_with(DRIVE, &MODEL.replace("phi = 0.9999", "phi = 0.99"));
    let dir = place.path();
    recordings(dir, 1.0);
    let ran = done(dir, CALIBRATE);
    let told = "gyro: turn-on bias ";
    assert!(
        ran.stderr.contains(told) && ran.stderr.contains("± 41 %"),
        "{}",
        ran.stderr
    );
    let stored = model_file::read(&dir.join("m.toml"))
        .unwrap()
        .turn_on
        .unwrap();
    // 3.1e-3 rad/s; the noise of a mean (WN 2.2e-5, AR1 3e-6 rad/s) moves it by 0.7 % at one deviation
    let mean = BIASES.iter().sum::<f64>() / 4.0;
    let sigma = (BIASES.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / 3.0).sqrt();
    let axes = stored.axes(Sensor::Gyro).unwrap();
    assert!(
        axes.iter().all(|s| (s / sigma - 1.0).abs() < 0.03) && axes[0] != axes[1],
        "{axes:?} {sigma}"
    );
    assert_eq!(stored.axes(Sensor::Accel), None);
    let json: Value =
        serde_json::from_str(&done(dir, &format!("{CALIBRATE} --format json")).stdout).unwrap();
    let found: Vec<&Value> = json["turn_on"]
        .as_array()
        .unwrap()
        .iter()
        .map(|t| &t["finding"])
        .collect();
    assert_eq!(found, ["within_noise", "seen"]);
    assert_eq!(json["turn_on"][1]["sigmas"][0].as_f64(), Some(axes[0]));
    let ran = done(
        dir,
        "run drive.toml m.toml --runs 2 --outage 30:40 --seed 1 -o out",
    );
    assert!(
        ran.stderr.contains("the filter expects a turn-on bias of") && ran.stderr.contains("(gyro"),
        "{}",
        ran.stderr
    );
}

#[test]
fn recordings_of_one_bias_have_none_and_those_of_another_mounting_tell_nothing() {
    let place = place_with(DRIVE, &MODEL.replace("phi = 0.9999", "phi = 0.99"));
    let dir = place.path();
    recordings(dir, 0.0);
    let ran = done(dir, &format!("{CALIBRATE} --verbose"));
    assert!(
        ran.stderr.contains("gyro: no turn-on bias: the means"),
        "{}",
        ran.stderr
    );
    assert_eq!(model_file::read(&dir.join("m.toml")).unwrap().turn_on, None);
    recordings(dir, 40.0);
    let ran = done(dir, &format!("{CALIBRATE} --verbose"));
    assert!(
        ran.stderr
            .contains("gyro: no turn-on bias stored: means differ"),
        "{}",
        ran.stderr
    );
    assert_eq!(model_file::read(&dir.join("m.toml")).unwrap().turn_on, None);
}
