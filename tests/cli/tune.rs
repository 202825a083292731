//! `tune` as a user runs it.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
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
    std::fs::write(
        dir.join("truth.toml"),
        MODEL.replace(
            "1e-8 }, { type = \"RW\", gamma2 = 1e-12",
            "4e-8 }, { type = \"RW\", gamma2 = 4e-12",
        ),
    )
    .unwrap();
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command
        .current_dir(dir)
        .arg("tune")
        .args(arguments)
        .assert()
}

#[test]
fn the_tuned_file_has_the_factor_and_says_where_it_came_from() {
    let dir = tempfile::tempdir().unwrap();
    let arguments = ["model.toml", "--truth", "truth.toml", "-o", "tuned.toml"];
    let output = tune(
        dir.path(),
        &[&arguments[..], &["--format", "json"]].concat(),
    )
    .success();
    let found: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert!(
        found["filters"][0]["largest_ratio"].as_f64().unwrap() > 1.5,
        "{found}"
    );
    assert!(
        (found["filters"][1]["largest_ratio"].as_f64().unwrap() - 1.0).abs() < 5e-3,
        "{found}"
    );
    // two outages as long as the default, 90 s, on the built-in drive: after 300 s, and 240 s later
    let ends = found["filters"][1]["outage_end"].as_array().unwrap();
    assert_eq!(
        ends.iter()
            .map(|end| end["after_s"].as_f64().unwrap())
            .collect::<Vec<_>>(),
        [390.0, 720.0]
    );
    let text = std::fs::read_to_string(dir.path().join("tuned.toml")).unwrap();
    let tuned: toml::Table = text.parse().unwrap();
    let walk = tuned["gyro"]["processes"][1]["gamma2"].as_float().unwrap();
    assert!((walk / 4e-12 - 1.0).abs() < 0.05, "{walk}");
    // what a tuned amplitude is not: an estimate with an interval
    assert!(
        !text.contains("ci95") && text.contains("[turn_on]"),
        "{text}"
    );
    assert_eq!(tuned["provenance"]["inputs"].as_array().unwrap().len(), 2);
    let shown = String::from_utf8(
        tune(dir.path(), &arguments)
            .success()
            .get_output()
            .stdout
            .clone(),
    )
    .unwrap();
    let first = shown.lines().next().unwrap();
    assert!(
        first.contains("gyro × 4.0") && first.contains("cost ") && first.contains("NEES "),
        "{shown}"
    );
    assert!(
        shown.lines().count() <= 20 && shown.lines().all(|line| line.chars().count() <= 120),
        "{shown}"
    );
}

/// `--filter` wins over the scenario, as with `run`; a filter that `run` makes anyway is judged once.
#[test]
fn the_filter_that_is_asked_for_is_tuned_and_named() {
    let dir = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    put("model.toml", MODEL);
    put("truth.toml", &MODEL.replace("1e-12", "4e-12"));
    put("drive.toml", crate::common::drive::DRIVE);
    put("states.toml", "[filter]\nstates = \"21\"\n");
    let cases = [
        ("--filter 15", "the filter of 15 states is ", "", 3),
        (
            "--filter 15 --scenario states.toml",
            "the filter of 15 states is ",
            "the filter of 21 states, the default",
            4,
        ),
        (
            "--filter 21",
            "the filter of 21 states is ",
            "the filter of 15 states, the default",
            4,
        ),
    ];
    for (filter, named, then, filters) in cases {
        let rest = "--trajectory drive.toml --outage 20:30 --format json";
        let output = tune_or_run(
            dir.path(),
            &format!("tune model.toml --truth truth.toml {filter} {rest}"),
        );
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        let verdict = found["verdict"].as_str().unwrap();
        assert!(
            verdict.contains(named) && verdict.contains(then),
            "{verdict}"
        );
        assert_eq!(
            found["filters"].as_array().unwrap().len(),
            filters,
            "{verdict}"
        );
    }
}

/// A model without noise, or without that of the sensor that makes the errors, is not made consistent by any factor: it is
/// said which sensor, and no model is written.
#[test]
fn a_model_without_noise_to_multiply_is_not_tuned() {
    let dir = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    put(
        "none.toml",
        "rate_hz = 100.0\n[accel]\nprocesses = []\n[gyro]\nprocesses = []\n",
    );
    let white = "[gyro]\nprocesses = [{ type = \"WN\", sigma2 = 1e-10 }]\n";
    put(
        "gyro.toml",
        &format!("rate_hz = 100.0\n[accel]\nprocesses = []\n{white}"),
    );
    for (model, sensors) in [("none.toml", "accel and gyro"), ("gyro.toml", "accel")] {
        let output = tune(
            dir.path(),
            &[model, "--truth", "truth.toml", "-o", "tuned.toml"],
        )
        .code(3);
        let output = output.get_output();
        let (shown, said) = (
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr),
        );
        let words = format!("the model has no {sensors} noise to scale, the truth has some");
        assert!(
            shown.contains(&words) && said.contains(&words) && said.contains("nav-sim datasheet"),
            "{said}"
        );
        assert!(
            !shown.contains("no factor is needed") && !dir.path().join("tuned.toml").exists(),
            "{shown}"
        );
    }
}

#[test]
fn a_truth_that_is_none_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], words: [&str; 2]| {
        let output = tune(dir.path(), arguments).code(2);
        let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    };
    refused(&["model.toml"], ["neither --truth", "hint: give models"]);
    refused(
        &["truth.toml", "--truth", "."],
        ["recordings, not a model", "--estimator gmwm"],
    );
}

/// A filter is judged by the errors that `run` makes of the same files: what a truth's `[turn_on]` and a scenario state
/// beside the noise counts, and a filter that does not expect it is not called consistent.
#[test]
fn what_is_wrong_beside_the_noise_is_judged_as_run_judges_it() {
    let (dir, silent) = (
        tempfile::tempdir().unwrap(),
        MODEL.replace("[turn_on]\ngyro_rad_s = 1e-4\n", ""),
    );
    let put = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    put("silent.toml", &silent);
    put(
        "turned_on.toml",
        &format!("{silent}[turn_on]\naccel_m_s2 = 0.02\ngyro_rad_s = 3e-4\n"),
    );
    put("drive.toml", crate::common::drive::DRIVE);
    put(
        "defects.toml",
        "[imu]\nscale_ppm_gyro = 3000.0\nmisalignment_rad = 0.002\n",
    );
    put(
        "coloured.toml",
        "[gnss]\ncorrelated_pos_sigma_m = [5.0, 5.0, 9.0]\ncorrelation_time_s = 60.0\n",
    );
    let nees = |arguments: &str, of: fn(&Value) -> &Value| {
        let all = format!("{arguments} --outage 30:40 --filter full --format json --seed 1");
        let output = tune_or_run(dir.path(), &all);
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        (
            of(&found).as_f64().unwrap(),
            String::from_utf8(output.stderr).unwrap(),
        )
    };
    let cases = [
        (
            "turned_on.toml",
            "",
            "turn-on bias of 0.02 m/s², the filter expects 0",
        ),
        (
            "silent.toml",
            " --scenario defects.toml",
            "scale-factor error of 3000 ppm, the filter expects 0",
        ),
        ("silent.toml", " --scenario coloured.toml", ""),
    ];
    for (truth, scenario, doubt) in cases {
        let rest = format!("silent.toml --truth {truth}{scenario}");
        let (tuned, told) = nees(&format!("tune {rest} --trajectory drive.toml"), |f| {
            &f["filters"][0]["nees"]
        });
        let run = format!("run drive.toml {rest} --method lincov -o out --force");
        let (ran, _) = nees(&run, |f| &f["nees"]["mean"]);
        assert!(
            ran > 12.0 && (tuned / ran - 1.0).abs() < 1e-6,
            "{rest}: tune {tuned}, run {ran}"
        );
        assert!(told.contains(doubt), "{told}");
    }
}

fn tune_or_run(dir: &Path, arguments: &str) -> std::process::Output {
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command
        .current_dir(dir)
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

/// Where the filter leaves out how the IMU is mounted, no noise of the IMU stands for it: the sigma of the constraint does,
/// and with the sigma that is found `run` calls the filter what it is.
#[test]
fn the_sigma_that_covers_the_errors_of_aiding_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let scenario = |sigma: f64| {
        let text =
            format!("[aiding.nhc]\nsigma_m_s = {sigma}\ntruth = {{ mounting_sigma_deg = 0.5 }}\n");
        std::fs::write(dir.path().join("car.toml"), text).unwrap();
    };
    scenario(0.1);
    let model = format!("{ROOT}/calib_data/tactical.toml");
    let drive = format!("{ROOT}/examples/quick_drive.toml");
    let common = [
        "--scenario",
        "car.toml",
        "--outage",
        "25:55",
        "--format",
        "json",
    ];
    let asked = [&[&model, "--trajectory", &drive][..], &common].concat();
    let found: Value =
        serde_json::from_slice(&tune(dir.path(), &asked).success().get_output().stdout).unwrap();
    let factor = found["aiding_sigma_factor"].as_f64().unwrap();
    assert!(factor > 1.5, "{found}");
    // of the built-in drive nothing is known but its motion
    let refused = tune(dir.path(), &[&model, "--scenario", "car.toml"]).code(2);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(
        said.contains("need a trajectory") && said.contains("--trajectory"),
        "{said}"
    );
    let kind = |sigma: f64| {
        scenario(sigma);
        let mut command = Command::cargo_bin("nav-sim").unwrap();
        let run = [
            "run", &drive, &model, "--method", "lincov", "--filter", "full", "-o", "out", "--force",
        ];
        let ran = command
            .current_dir(dir.path())
            .args(run)
            .args(common)
            .assert()
            .success();
        let summary: Value = serde_json::from_slice(&ran.get_output().stdout).unwrap();
        summary["verdict"]["kind"].as_str().unwrap().to_owned()
    };
    assert_eq!(kind(0.1), "overconfident");
    assert_ne!(kind(0.1 * factor), "overconfident");
}
