//! Figures of `nav-sim trajectory`; its words and exit codes are in `transcripts/files.md`.

use crate::common::drive::*;

#[test]
fn check_gives_the_closure_and_the_largest_motion() {
    let place = Place::checkout();
    let drive = "trajectories/land_vehicle.toml --limit-speed 24 --format json";
    let ran = place.ends(&format!("trajectory check {drive}"), 3);
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(report["within_bounds"], true);
    assert!(number(&report, "/closure/horizontal_m") < 0.01);
    assert!((number(&report, "/largest/speed_m_s") - 25.0).abs() < 1e-3);
    assert_eq!(report["beyond_limits"].as_array().unwrap().len(), 1);
}

/// TUM rows are east, north, up of the first row, body forward, left, up (read against hand-made ones by the reader's own test), and
/// come back to a millimetre and a microradian.
#[test]
fn tum_rows_come_back() {
    let place = place_with(DRIVE, MODEL);
    for command in [
        "drive.toml --rate-hz 10 -o drive.csv",
        "drive.toml --rate-hz 10 -o drive.tum.gz",
        "drive.tum.gz -o back.csv",
    ] {
        place.done(&format!("trajectory convert {command}"));
    }
    let (made, back) = (place.table("drive.csv"), place.table("back.csv"));
    assert_eq!((made.len(), back.len()), (601, 601));
    for (a, b) in made.iter().zip(&back) {
        let degree_m = 111_320.0;
        let [north, east] = [1, 2].map(|i| (a[i] - b[i]) * degree_m);
        assert!(north.hypot(east).hypot(a[3] - b[3]) < 1e-3, "{a:?} {b:?}");
        for i in 7..10 {
            let turned = (a[i] - b[i] + 540.0).rem_euclid(360.0) - 180.0;
            assert!(turned.to_radians().abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}
