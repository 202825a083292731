//! `fuse --smooth` as a user runs it.

use super::{recorded, recorded_on, summary};
use crate::common::drive::*;

#[test]
fn a_smoothed_fusion_lies_beside_the_filter_s_and_is_the_same_on_any_number_of_threads() {
    let place = recorded();
    let fuse =
        "fuse rec/imu.csv rec/gnss.csv imu.toml --reference rec/reference.csv --outage 60:75";
    for options in ["-o plain", "--smooth -j 1 -o one", "--smooth -j 3 -o three"] {
        place.done(&format!("{fuse} {options}"));
    }
    let assert_equal = |a: &str, b: &str, names: &[&str]| {
        for name in names {
            assert!(
                place.read(&format!("{a}/{name}")) == place.read(&format!("{b}/{name}")),
                "{name}"
            );
        }
    };
    let smoothed = [
        "smoothed.csv",
        "errors_smoothed.csv",
        "smoothed.kml",
        "summary.json",
    ];
    assert_equal("one", "three", &smoothed);
    let filtered = [
        "solution.csv",
        "errors.csv",
        "innovations.csv",
        "solution.kml",
    ];
    assert_equal("plain", "one", &filtered);
    let header = |name: &str| place.read(name).lines().next().unwrap().to_owned();
    assert_eq!(header("one/smoothed.csv"), header("one/solution.csv"));
    let (filter, smoothed) = (
        place.table("one/solution.csv"),
        place.table("one/smoothed.csv"),
    );
    assert_eq!(
        (filter.len(), filter.last()),
        (smoothed.len(), smoothed.last())
    );
    assert!(filter.iter().zip(&smoothed).all(|(f, s)| f[0] == s[0]));
    // in the middle of the outage the horizontal deviation is far below that of its end
    let found = place.json("one/summary.json");
    let [own, filter] =
        ["", "_filter"].map(|of| number(&found, &format!("/smoothed/outages/0/sigma_max{of}_m")));
    assert!(own < 0.7 * filter, "{own} {filter}");
    let nees = number(&found, "/smoothed/reference/nees_mean");
    assert!((0.5..36.0).contains(&nees), "{nees}");
    // nothing of an earlier fusion is left beside a later one that was not smoothed
    place.done(&format!("{fuse} -o one"));
    assert_eq!(place.entries("one"), place.entries("plain"));
}

/// Fixes believed better than they are make smoothed standard deviations too small, fixes and an IMU believed worse too
/// large: said, in which state and by how much.
#[test]
fn a_smoothed_solution_has_a_verdict_by_the_reference() {
    let shipped = |name: &str| std::fs::read_to_string(format!("{ROOT}/{name}")).unwrap();
    let drive = shipped("trajectories/land_vehicle.toml");
    let place = recorded_on(&drive, &shipped("calib_data/tactical.toml"));
    let worse = format!("{ROOT}/calib_data/consumer_mems.toml");
    for (model, factor, verdict) in [
        ("imu.toml", 1.0, "undecided"),
        ("imu.toml", 0.3, "overconfident"),
        (&worse, 10.0, "underconfident"),
    ] {
        place.judged(&format!(
            "fuse rec/imu.csv rec/gnss.csv {model} --initial rec/initial.toml --reference rec/reference.csv \
             --outage 300:360 --smooth -o out --gnss-sigma x{factor}"
        ));
        let found = place.json("out/summary.json");
        assert_eq!(
            found["smoothed"]["reference"]["verdict"]["kind"], verdict,
            "{factor}: {found}"
        );
    }
    let page = place.read("out/report.html");
    // nine panels of errors, each with zero inside
    let panels: Vec<&str> = page.split("<svg class=\"chart small\"").skip(1).collect();
    assert_eq!(panels.len(), 9);
    for panel in panels {
        let ticks = panel.split("<g class=\"ticks\">").nth(1).unwrap();
        assert!(ticks.contains(">0</text>"), "{ticks:.600}");
    }
    assert!(page.contains("/smoothed/outages/0/sigma_max_m") && page.len() < 350_000);
}

#[test]
fn without_outages_or_a_reference_it_says_what_it_knows() {
    let found = summary(&recorded(), "--filter 21 --smooth");
    assert!(
        found["smoothed"].is_object() && found["smoothed"]["reference"].is_null(),
        "{found}"
    );
}
