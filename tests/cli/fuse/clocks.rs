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
    let cause = "the clocks of IMU and GNSS look 18.0 s apart: with -18.0 s added to the times of the fixes";
    assert!(ran.stderr.contains(cause), "{}", ran.stderr);
    let verdict = ran.stdout.lines().next().unwrap();
    assert!(verdict.contains(cause) && verdict.len() <= 300, "{verdict}");
    let summary = fs::read_to_string(place.path().join("out/summary.json")).unwrap();
    assert!(summary.contains(cause), "{summary}");
}
