//! `nav-sim fuse` of an IMU and a receiver whose clocks are apart.

use crate::common::drive::{DRIVE, MODEL, done, nav_sim, place_with};
use std::fs;

/// GPS time is 18 s ahead of UTC: the commonest of differences.
#[test]
fn clocks_that_are_apart_are_named_with_what_to_add() {
    let place = place_with(DRIVE, MODEL);
    done(place.path(), "trajectory record drive.toml imu.toml --seed 3 -o rec");
    let text = fs::read_to_string(place.path().join("rec/gnss.csv")).unwrap();
    let later = |line: &str| match line.split_once(',') {
        Some((t_s, rest)) if line.starts_with(|c: char| c.is_ascii_digit()) => {
            format!("{},{rest}\n", t_s.parse::<f64>().unwrap() + 18.0)
        }
        _ => format!("{line}\n"),
    };
    fs::write(place.path().join("gps_time.csv"), text.lines().map(later).collect::<String>()).unwrap();
    let ran = nav_sim(place.path(), "fuse rec/imu.csv gps_time.csv imu.toml -o out");
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let cause = "the clocks are apart: --gnss-delay=18.0";
    assert!(ran.stdout.lines().nth(1).unwrap().starts_with(cause), "{}", ran.stdout);
    assert!(ran.stdout.lines().count() <= 20 && ran.stdout.lines().all(|l| l.chars().count() <= 120));
    let summary = fs::read_to_string(place.path().join("out/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let delay_s = summary["verdict"]["cause"]["clocks"]["delay_s"].as_f64().unwrap();
    assert!((delay_s - 18.0).abs() < 1e-9, "{summary}");
}

/// Clocks that have nothing in common: the hint is the option to paste, with which the fusion is sound.
#[test]
fn clocks_that_do_not_overlap_are_told_with_the_delay() {
    let place = place_with(DRIVE, MODEL);
    done(place.path(), "trajectory record drive.toml imu.toml --seed 3 -o rec");
    let text = fs::read_to_string(place.path().join("rec/gnss.csv")).unwrap();
    let later = |line: &str| match line.split_once(',') {
        Some((t_s, rest)) if line.starts_with(|c: char| c.is_ascii_digit()) => {
            format!("{},{rest}\n", t_s.parse::<f64>().unwrap() + 50_399.0)
        }
        _ => format!("{line}\n"),
    };
    fs::write(place.path().join("day.csv"), text.lines().map(later).collect::<String>()).unwrap();
    let ran = nav_sim(place.path(), "fuse rec/imu.csv day.csv imu.toml -o out");
    assert!(ran.code == 2 && ran.stderr.contains("hint: --gnss-delay 50400"), "{}", ran.stderr);
}
