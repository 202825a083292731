//! `design` as a user runs it.

use assert_cmd::Command;
use serde_json::Value;

fn design(arguments: &str) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .arg("design")
        .args(arguments.split_whitespace())
        .assert()
}

fn shown(arguments: &str) -> String {
    String::from_utf8(design(arguments).success().get_output().stdout.clone()).unwrap()
}

/// White noise whose variance differs by 1.7 % between recordings (the beta law of the shipped IMU): half an hour adds
/// next to nothing to that, and four times the recordings have half the interval.
#[test]
fn intervals_shrink_with_recordings_and_not_with_hours_where_recordings_differ() {
    let half_width = |recordings: u32, hours: f64| {
        let arguments = format!(
            "calib_data/consumer_mems.toml --recordings {recordings} --hours {hours} --draws 60 --estimator awv \
             --format json"
        );
        let found: Value = serde_json::from_str(&shown(&arguments)).unwrap();
        let parameters = found["designs"][0]["parameters"]
            .as_array()
            .unwrap()
            .clone();
        let white = parameters
            .iter()
            .find(|p| p["signals"] == "gyro" && p["parameter"] == "WN sigma2")
            .unwrap();
        white["half_width_pct"].as_f64().unwrap()
    };
    let (few, many, longer) = (half_width(3, 0.5), half_width(12, 0.5), half_width(3, 2.0));
    // 60 draws know a 95 % interval to about 20 %, the ratio of two to 28 %; two of these are allowed
    assert!((many / few / 0.5 - 1.0).abs() < 0.6, "{few} {many}");
    assert!((longer / few - 1.0).abs() < 0.6, "{few} {longer}");
}

#[test]
fn one_design_is_a_screen_and_what_cannot_be_planned_is_refused() {
    let text = shown("calib_data/consumer_mems.toml --recordings 4 --hours 0.5 --draws 40");
    assert!(
        text.starts_with("4 recordings of 0.5 h would determine ")
            && text.contains("; least certain: "),
        "{text}"
    );
    assert!(
        text.lines().count() <= 20 && text.lines().all(|line| line.chars().count() <= 120),
        "{text}"
    );
    let refused = |arguments: &str, word: &str| {
        let output = design(arguments).code(2);
        let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
        assert!(said.contains(word), "{said}");
    };
    refused(
        "calib_data/tactical.toml --estimator gmwm",
        "--estimator='gmwm': not one of awv, sr-awv, dr-awv",
    );
    refused("calib_data/tactical.toml --hours 1e6", "over a year");
    refused(
        "calib_data/tactical.toml --hours 1e-4 --recordings 3 --draws 40",
        "more, or longer recordings",
    );
}
