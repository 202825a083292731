//! `efficiency` as a user runs it, on the shipped study cut down.

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn efficiency(dir: &Path, arguments: &str) -> Command {
    let study = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/paper_fig2.toml");
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command
        .current_dir(dir)
        .args(["efficiency", study, "--samples", "4096"]);
    command.args(arguments.split_whitespace());
    command
}

fn said(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}

fn read(dir: &Path, file: &str) -> String {
    fs::read_to_string(dir.join(file)).unwrap()
}

const FILES: [&str; 5] = [
    "study.json",
    "sets.csv",
    "results.csv",
    "results.json",
    "report.html",
];

#[test]
fn a_stopped_study_goes_on_to_the_same_results_at_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    efficiency(dir.path(), "--sets 9 -j 1 -o whole")
        .assert()
        .success();
    efficiency(dir.path(), "--sets 4 -j 2 -o parts")
        .assert()
        .success();
    // As if killed in the middle of a line of the fourth set.
    let sets = dir.path().join("parts/sets.csv");
    let text = fs::read(&sets).unwrap();
    fs::write(&sets, &text[..text.len() - 40]).unwrap();
    let assert = efficiency(dir.path(), "--sets 9 -j 3 -o parts")
        .assert()
        .success();
    assert!(
        said(&assert).contains("3 sets are there already"),
        "{}",
        said(&assert)
    );
    let cut = "warning: parts/sets.csv was cut: 3 of the 4 sets of parts/results.json are left; the rest is estimated anew";
    assert!(said(&assert).contains(cut), "{}", said(&assert));
    let again = efficiency(dir.path(), "--sets 9 -o parts")
        .assert()
        .success();
    assert!(!said(&again).contains("warning"), "{}", said(&again));
    for file in FILES {
        assert_eq!(
            read(&dir.path().join("whole"), file),
            read(&dir.path().join("parts"), file),
            "{file}"
        );
    }
    let json: Value =
        serde_json::from_str(&read(&dir.path().join("whole"), "results.json")).unwrap();
    assert_eq!(json["sets"], 9);
    // Three scenarios, three estimators, four parameters.
    assert_eq!(json["results"].as_array().unwrap().len(), 36);
    assert_eq!(
        read(&dir.path().join("whole"), "sets.csv").lines().count(),
        1 + 9 * 9
    );
}

#[test]
fn a_directory_of_another_study_is_refused_and_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    efficiency(dir.path(), "--sets 1 -o out").assert().success();
    let before = FILES.map(|f| read(&dir.path().join("out"), f));
    let assert = efficiency(dir.path(), "--sets 1 --seed 2 -o out")
        .assert()
        .code(2);
    let message = "error: out holds another study: its \"seed\" is 1, not 2";
    assert!(said(&assert).starts_with(message), "{}", said(&assert));
    assert_eq!(before, FILES.map(|f| read(&dir.path().join("out"), f)));
}

/// Somebody's own file of a name that the study writes.
#[test]
fn a_foreign_file_is_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("out")).unwrap();
    fs::write(dir.path().join("out/results.csv"), "mine").unwrap();
    let assert = efficiency(dir.path(), "--sets 1 -o out").assert().code(2);
    let message = "error: out holds results.csv, which is not of a study";
    assert!(said(&assert).starts_with(message), "{}", said(&assert));
    assert_eq!(read(&dir.path().join("out"), "results.csv"), "mine");
    assert_eq!(fs::read_dir(dir.path().join("out")).unwrap().count(), 1);
}

#[test]
fn sensitivity_curves_have_a_row_a_size_estimator_and_parameter() {
    let dir = tempfile::tempdir().unwrap();
    efficiency(dir.path(), "--sets 1 --sensitivity -o out")
        .assert()
        .success();
    let text = read(&dir.path().join("out"), "sensitivity.csv");
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "disturbance,size,estimator,parameter,relative_change"
    );
    // 10 outliers and 11 factors of 1, 2 and 3 replicates, × 3 estimators × 4 parameters.
    assert_eq!(lines.count(), (10 + 3 * 11) * 12);
    let unchanged = "random_walk_variance_factor_of_1,1,awv,WN sigma2,0e0";
    assert!(text.contains(unchanged), "a factor of one changes nothing");
}

#[test]
fn a_contamination_that_does_not_fit_is_told_before_anything_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let bursts = "[[accel]]\noperation = \"bursts\"\namplitude = 1\n";
    fs::write(dir.path().join("bursts.toml"), bursts).unwrap();
    let model = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/examples/accelerometer_n1.toml"
    );
    let study = format!(
        "model = \"{model}\"\nfit = \"N1\"\nreplicates = 5\nsamples = 4096\nsets = 1\nscenarios = [\"bursts.toml\"]\n"
    );
    fs::write(dir.path().join("s.toml"), study).unwrap();
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command
        .current_dir(dir.path())
        .args(["efficiency", "s.toml", "-o", "out"]);
    let message = "error: s.toml: bursts.toml, line 1: a train of bursts needs 450500 samples, the record has 4096";
    let assert = command.assert().code(2);
    assert!(said(&assert).starts_with(message), "{}", said(&assert));
    assert!(!dir.path().join("out").exists());
}
