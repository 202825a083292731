//! `fuse --smooth` as a user runs it.

use super::{recorded, table};
use crate::common::drive::{done, nav_sim};
use std::fs;

#[test]
fn a_smoothed_fusion_lies_beside_the_filter_s_and_is_the_same_on_any_number_of_threads() {
    let place = recorded();
    let read = |name: &str| fs::read_to_string(place.path().join(name)).unwrap();
    let fuse = "fuse rec/imu.csv rec/gnss.csv imu.toml --reference rec/reference.csv --outage 60:75";
    done(place.path(), &format!("{fuse} -o plain"));
    let one = done(place.path(), &format!("{fuse} --smooth -j 1 -o one"));
    done(place.path(), &format!("{fuse} --smooth -j 3 -o three --plot fused.svg"));
    for name in ["smoothed.csv", "errors_smoothed.csv", "smoothed.kml", "summary.json"] {
        assert_eq!(read(&format!("one/{name}")), read(&format!("three/{name}")), "{name}");
    }
    for name in ["solution.csv", "errors.csv", "innovations.csv", "solution.kml"] {
        assert_eq!(read(&format!("plain/{name}")), read(&format!("one/{name}")), "{name}");
    }
    let line = one.stdout.lines().find(|l| l.starts_with("smoothed, in outages")).unwrap();
    assert!(line.contains("from the reference"), "{line}");
    assert!(read("fused.svg").contains("smoothed"));
    let header = |name: &str| read(name).lines().next().unwrap().to_owned();
    assert_eq!(header("one/smoothed.csv"), header("one/solution.csv"));
    let (filter, smoothed) =
        (table(&place.path().join("one/solution.csv")), table(&place.path().join("one/smoothed.csv")));
    assert_eq!((filter.len(), filter.last()), (smoothed.len(), smoothed.last()));
    assert!(filter.iter().zip(&smoothed).all(|(f, s)| f[0] == s[0]));
    // in the middle of the outage the horizontal deviation is far below that of its end
    let summary: serde_json::Value = serde_json::from_str(&read("one/summary.json")).unwrap();
    let outage = &summary["smoothed"]["outages"][0];
    assert!(
        outage["sigma_max_m"].as_f64().unwrap() < 0.7 * outage["sigma_max_filter_m"].as_f64().unwrap(),
        "{outage}"
    );
    let nees = summary["smoothed"]["reference"]["nees_mean"].as_f64().unwrap();
    assert!((0.5..36.0).contains(&nees), "{nees}");
    // nothing of an earlier fusion is left beside a later one that was not smoothed
    done(place.path(), &format!("{fuse} -o one"));
    assert!(
        !place.path().join("one/smoothed.csv").exists() && !place.path().join("one/smoothed.kml").exists()
    );
}

#[test]
fn without_outages_or_a_reference_it_says_what_it_knows() {
    let place = recorded();
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --filter 21 --smooth --rate-hz 1 -o out",
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let line = ran.stdout.lines().find(|l| l.starts_with("smoothed")).unwrap();
    assert!(line.contains("horizontal 1 sigma") && !line.contains("reference"), "{line}");
}
