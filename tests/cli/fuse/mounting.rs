//! `fuse --mounting auto`: found, said so that it can be pasted, kept in the summary, or refused.

use super::recorded;
use crate::common::drive::{MODEL, done, nav_sim, place_with};
use std::fs;

/// An IMU whose axes are those of the vehicle: the drive shows it.
#[test]
fn a_mounting_is_found_and_can_be_pasted() {
    let drive = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/trajectories/land_vehicle.toml"
    );
    let place = place_with(&fs::read_to_string(drive).unwrap(), MODEL);
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let fuse = |options: &str| {
        let command = format!(
            "fuse rec/imu.csv rec/gnss.csv imu.toml --reference rec/reference.csv {options} -o out"
        );
        let ran = done(place.path(), &command);
        let text = fs::read_to_string(place.path().join("out/summary.json")).unwrap();
        (
            ran,
            serde_json::from_str::<serde_json::Value>(&text).unwrap(),
        )
    };
    let (ran, summary) = fuse("--mounting auto");
    let line = ran
        .stdout
        .lines()
        .find(|line| line.starts_with("mounting found: "))
        .unwrap();
    let paste = line
        .split(' ')
        .find(|word| word.starts_with("--mounting="))
        .unwrap();
    let mounting = &summary["mounting"];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let sigma: Vec<f64> = mounting["sigma_deg"]
        .as_array()
        .unwrap()
        .iter()
        .map(number)
        .collect();
    let angles = ["roll_deg", "pitch_deg", "yaw_deg"].map(|key| number(&mounting[key]));
    for (i, off) in angles.into_iter().enumerate() {
        assert!(
            off.abs() < 3.0 * sigma[i] && sigma[i] < 3.0,
            "{angles:?} {sigma:?}"
        );
    }
    assert!(
        mounting["how"].as_str().unwrap().contains("gravity"),
        "{mounting}"
    );
    let page = fs::read_to_string(place.path().join("out/report.html")).unwrap();
    assert!(page.contains("mounting found: "), "the page");

    // the same solution, as sure of itself
    let (_, given) = fuse(paste);
    let rmse = |summary: &serde_json::Value| number(&summary["reference"]["horizontal_rmse_m"]);
    assert!(
        (rmse(&given) / rmse(&summary) - 1.0).abs() < 0.05,
        "{} {}",
        rmse(&given),
        rmse(&summary)
    );
    let nees = |summary: &serde_json::Value| number(&summary["reference"]["nees_mean"]);
    assert!(
        (nees(&given) / nees(&summary) - 1.0).abs() < 0.05,
        "{} {}",
        nees(&given),
        nees(&summary)
    );
    assert!(given.get("mounting").is_none());
}

/// Too short, and a word that is none.
#[test]
fn a_drive_that_does_not_show_it_is_refused_with_a_remedy() {
    let place = recorded();
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --mounting auto -o out",
    );
    let said = [
        "error: the mounting is not found: ",
        "have a course",
        "hint: give --mounting ROLL,PITCH,YAW",
    ];
    assert!(
        ran.code == 2 && said.iter().all(|part| ran.stderr.contains(part)),
        "{}",
        ran.stderr
    );
    assert!(!place.path().join("out").exists());
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --mounting found -o out",
    );
    assert!(
        ran.code == 2 && ran.stderr.contains("flu, rfu, auto"),
        "{}",
        ran.stderr
    );
}
