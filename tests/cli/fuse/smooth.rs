//! `fuse --smooth` as a user runs it.

use super::{recorded, table};
use crate::common::drive::{done, nav_sim, place_with};
use std::fs;

#[test]
fn a_smoothed_fusion_lies_beside_the_filter_s_and_is_the_same_on_any_number_of_threads() {
    let place = recorded();
    let read = |name: &str| fs::read_to_string(place.path().join(name)).unwrap();
    let fuse =
        "fuse rec/imu.csv rec/gnss.csv imu.toml --reference rec/reference.csv --outage 60:75";
    done(place.path(), &format!("{fuse} -o plain"));
    let one = done(place.path(), &format!("{fuse} --smooth -j 1 -o one"));
    done(place.path(), &format!("{fuse} --smooth -j 3 -o three"));
    for name in [
        "smoothed.csv",
        "errors_smoothed.csv",
        "smoothed.kml",
        "summary.json",
    ] {
        assert_eq!(
            read(&format!("one/{name}")),
            read(&format!("three/{name}")),
            "{name}"
        );
    }
    for name in [
        "solution.csv",
        "errors.csv",
        "innovations.csv",
        "solution.kml",
    ] {
        assert_eq!(
            read(&format!("plain/{name}")),
            read(&format!("one/{name}")),
            "{name}"
        );
    }
    let row = one
        .stdout
        .lines()
        .find(|l| l.contains("horizontal RMSE"))
        .unwrap();
    assert_eq!(row.split_whitespace().count(), 5, "{row}");
    let header = |name: &str| read(name).lines().next().unwrap().to_owned();
    assert_eq!(header("one/smoothed.csv"), header("one/solution.csv"));
    let (filter, smoothed) = (
        table(&place.path().join("one/solution.csv")),
        table(&place.path().join("one/smoothed.csv")),
    );
    assert_eq!(
        (filter.len(), filter.last()),
        (smoothed.len(), smoothed.last())
    );
    assert!(filter.iter().zip(&smoothed).all(|(f, s)| f[0] == s[0]));
    // in the middle of the outage the horizontal deviation is far below that of its end
    let summary: serde_json::Value = serde_json::from_str(&read("one/summary.json")).unwrap();
    let outage = &summary["smoothed"]["outages"][0];
    assert!(
        outage["sigma_max_m"].as_f64().unwrap()
            < 0.7 * outage["sigma_max_filter_m"].as_f64().unwrap(),
        "{outage}"
    );
    let nees = summary["smoothed"]["reference"]["nees_mean"]
        .as_f64()
        .unwrap();
    assert!((0.5..36.0).contains(&nees), "{nees}");
    // nothing of an earlier fusion is left beside a later one that was not smoothed
    done(place.path(), &format!("{fuse} -o one"));
    assert!(
        !place.path().join("one/smoothed.csv").exists()
            && !place.path().join("one/smoothed.kml").exists()
    );
}

/// Fixes believed better than they are make smoothed standard deviations too small, fixes and an IMU believed worse too
/// large: said, in which state and by how much.
#[test]
fn a_smoothed_solution_has_a_verdict_by_the_reference() {
    let shipped =
        |name: &str| fs::read_to_string(format!("{}/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let place = place_with(
        &shipped("trajectories/land_vehicle.toml"),
        &shipped("calib_data/tactical.toml"),
    );
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let start = "--initial rec/initial.toml --reference rec/reference.csv";
    let worse = concat!(env!("CARGO_MANIFEST_DIR"), "/calib_data/consumer_mems.toml");
    for (model, factor, verdict) in [
        ("imu.toml", 1.0, "undecided"),
        ("imu.toml", 0.3, "overconfident"),
        (worse, 10.0, "underconfident"),
    ] {
        let fuse = format!(
            "fuse rec/imu.csv rec/gnss.csv {model} {start} --outage 300:360 --smooth -o out"
        );
        nav_sim(place.path(), &format!("{fuse} --gnss-sigma x{factor}"));
        let summary = fs::read_to_string(place.path().join("out/summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        let judged = &summary["smoothed"]["reference"]["verdict"];
        assert_eq!(judged["kind"], verdict, "{factor}: {summary}");
    }
    let page = fs::read_to_string(place.path().join("out/report.html")).unwrap();
    // nine panels of errors, each with zero inside
    let panels: Vec<&str> = page.split("<svg class=\"chart small\"").skip(1).collect();
    assert_eq!(panels.len(), 9);
    for panel in panels {
        let ticks = panel.split("<g class=\"ticks\">").nth(1).unwrap();
        assert!(ticks.contains(">0</text>"), "{ticks:.600}");
    }
    assert!(
        page.contains("/smoothed/outages/0/sigma_max_m") && page.len() < 350_000,
        "{}",
        page.len()
    );
}

#[test]
fn without_outages_or_a_reference_it_says_what_it_knows() {
    let place = recorded();
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --filter 21 --smooth  -o out",
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let line = ran
        .stdout
        .lines()
        .find(|l| l.contains("horizontal 1 σ"))
        .unwrap();
    assert!(
        line.split_whitespace().count() > 6 && !ran.stdout.contains("RMSE"),
        "{line}"
    );
}
