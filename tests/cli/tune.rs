//! `tune` as a user runs it.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

const MODEL: &str = r#"rate_hz = 100.0
[accel]
processes = [{ type = "WN", sigma2 = 1e-4 }, { type = "RW", gamma2 = 1e-10, gamma2_ci95 = [8e-11, 2e-10] }]
[gyro]
processes = [{ type = "WN", sigma2 = 1e-8 }, { type = "RW", gamma2 = 1e-12 }]
[turn_on]
gyro_rad_s = 1e-4
"#;

fn tune(dir: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    std::fs::write(dir.join("model.toml"), MODEL).unwrap();
    std::fs::write(dir.join("truth.toml"), MODEL.replace("1e-12", "4e-12")).unwrap();
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command.current_dir(dir).arg("tune").args(arguments).assert()
}

#[test]
fn the_tuned_file_has_the_factor_and_says_where_it_came_from() {
    let dir = tempfile::tempdir().unwrap();
    let arguments = ["model.toml", "--truth", "truth.toml", "--per", "process", "-o", "tuned.toml"];
    let output = tune(dir.path(), &[&arguments[..], &["--format", "json"]].concat()).success();
    let found: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert!(found["filters"][0]["largest_ratio"].as_f64().unwrap() > 1.5, "{found}");
    assert!((found["filters"][1]["largest_ratio"].as_f64().unwrap() - 1.0).abs() < 5e-3, "{found}");
    let text = std::fs::read_to_string(dir.path().join("tuned.toml")).unwrap();
    let tuned: toml::Table = text.parse().unwrap();
    let walk = tuned["gyro"]["processes"][1]["gamma2"].as_float().unwrap();
    assert!((walk / 4e-12 - 1.0).abs() < 0.05, "{walk}");
    // what a tuned amplitude is not: an estimate with an interval
    assert!(!text.contains("ci95") && text.contains("[turn_on]"), "{text}");
    assert_eq!(tuned["provenance"]["inputs"].as_array().unwrap().len(), 2);
    let shown =
        String::from_utf8(tune(dir.path(), &arguments).success().get_output().stdout.clone()).unwrap();
    assert!(
        shown.starts_with("the full filter is overconfident by") && shown.lines().count() <= 20,
        "{shown}"
    );
}

#[test]
fn intervals_are_covered_and_nothing_to_cover_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let intervals = tune(dir.path(), &["model.toml", "--intervals"]).success();
    let shown = String::from_utf8(intervals.get_output().stdout.clone()).unwrap();
    assert!(shown.contains("with accel × ") && shown.contains("it is honest"), "{shown}");
    let refused = |arguments: &[&str], words: [&str; 2]| {
        let output = tune(dir.path(), arguments).code(2);
        let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    };
    refused(&["model.toml"], ["neither --truth nor --intervals", "hint: give models"]);
    refused(&["truth.toml", "--truth", "."], ["recordings, not a model", "--estimator gmwm"]);
}

/// A filter is judged by the errors that `run` makes of the same files: what a truth's `[turn_on]` and a scenario state
/// beside the noise counts, and a filter that does not expect it is not called honest.
#[test]
fn what_is_wrong_beside_the_noise_is_judged_as_run_judges_it() {
    let (dir, silent) = (tempfile::tempdir().unwrap(), MODEL.replace("[turn_on]\ngyro_rad_s = 1e-4\n", ""));
    let put = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    put("silent.toml", &silent);
    put("turned_on.toml", &format!("{silent}[turn_on]\naccel_m_s2 = 0.02\ngyro_rad_s = 3e-4\n"));
    put("drive.toml", crate::common::drive::DRIVE);
    put("defects.toml", "[imu]\nscale_ppm_gyro = 3000.0\nmisalignment_rad = 0.002\n");
    put("coloured.toml", "[gnss]\ncorrelated_pos_sigma_m = [5.0, 5.0, 9.0]\ncorrelation_time_s = 60.0\n");
    let nees = |arguments: &str, of: fn(&Value) -> &Value| {
        let all = format!("{arguments} --outage 30:40 --filter full --format json --seed 1");
        let output = tune_or_run(dir.path(), &all);
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        (of(&found).as_f64().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let cases = [
        ("turned_on.toml", "", "turn-on bias of 0.02 m/s², the filter expects 0"),
        ("silent.toml", " --scenario defects.toml", "scale-factor error of 3000 ppm, the filter expects 0"),
        ("silent.toml", " --scenario coloured.toml", ""),
    ];
    for (truth, scenario, doubt) in cases {
        let rest = format!("silent.toml --truth {truth}{scenario}");
        let (tuned, told) =
            nees(&format!("tune {rest} --trajectory drive.toml"), |f| &f["filters"][0]["nees"]);
        let run = format!("run drive.toml {rest} --method lincov -o out --force");
        let (ran, _) = nees(&run, |f| &f["nees"]["mean"]);
        assert!(ran > 12.0 && (tuned / ran - 1.0).abs() < 1e-6, "{rest}: tune {tuned}, run {ran}");
        assert!(told.contains(doubt), "{told}");
    }
}

fn tune_or_run(dir: &Path, arguments: &str) -> std::process::Output {
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command.current_dir(dir).args(arguments.split_whitespace()).output().unwrap()
}
