//! `fuse --mounting auto`: found, said so that it can be pasted, kept in the summary.

use super::{recorded_on, summary};
use crate::common::drive::*;

/// An IMU whose axes are those of the vehicle: the drive shows it.
#[test]
fn a_mounting_is_found_and_can_be_pasted() {
    let drive = format!("{ROOT}/trajectories/land_vehicle.toml");
    let place = recorded_on(&std::fs::read_to_string(drive).unwrap(), MODEL);
    let reference = "--reference rec/reference.csv";
    let fuse = format!("fuse rec/imu.csv rec/gnss.csv imu.toml {reference} --mounting auto -o out");
    let ran = place.done(&fuse);
    let found = place.json("out/summary.json");
    let line = ran
        .stdout
        .lines()
        .find_map(|line| line.strip_prefix("mounting found: "))
        .unwrap();
    let paste = line
        .split(' ')
        .find(|word| word.split('=').next() == Some("--mounting"));
    let sigma = numbers(&found, "/mounting/sigma_deg");
    assert_eq!(sigma.len(), 3);
    for (sigma, angle) in sigma.into_iter().zip(["roll", "pitch", "yaw"]) {
        let off = number(&found, &format!("/mounting/{angle}_deg"));
        assert!(
            off.abs() < 3.0 * sigma && sigma < 3.0,
            "{angle}: {off} {sigma}"
        );
    }
    assert!(found["mounting"]["how"].is_string());
    assert!(place.read("out/report.html").contains("mounting found: "));

    // the same solution, as sure of itself
    let given = summary(&place, &format!("{reference} {}", paste.unwrap()));
    for key in ["/reference/horizontal_rmse_m", "/reference/nees_mean"] {
        assert!(
            off(number(&given, key), number(&found, key)) < 0.05,
            "{key}"
        );
    }
    assert!(given["mounting"].is_null());
}
