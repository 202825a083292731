//! `fuse --nhc --zupt --odometer` as a user runs it.

use super::{recorded, table};
use crate::common::drive::{done, nav_sim};
use std::fs;
use std::path::Path;

/// A wheel that reads 1 % too much, as a file in km/h with this header.
fn write_wheel(place: &Path, header: &str, km_h: f64) {
    let rows = table(&place.join("rec/reference.csv"));
    let speed = |row: &Vec<f64>| 1.01 * km_h * row[4].hypot(row[5]);
    let text: String = rows
        .iter()
        .step_by(10)
        .map(|r| format!("{},{:.4}\n", r[0], speed(r)))
        .collect();
    fs::write(place.join("wheel.csv"), format!("{header}\n{text}")).unwrap();
}

#[test]
fn a_wheel_and_the_constraint_enter_the_summary_and_the_page() {
    let place = recorded();
    write_wheel(place.path(), "t_s,wheel (km/h)", 3.6);
    let fuse = "fuse rec/imu.csv rec/gnss.csv imu.toml --outage 60:75 -o out --smooth";
    done(
        place.path(),
        &format!("{fuse} --nhc --zupt --odometer wheel.csv"),
    );
    let read = |name: &str| fs::read_to_string(place.path().join("out").join(name)).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&read("summary.json")).unwrap();
    let vehicle = &summary["vehicle"];
    let [scale, sigma] =
        ["value", "sigma"].map(|key| vehicle["wheel_scale"][key].as_f64().unwrap());
    assert!(
        sigma < 0.01 && (scale - 0.01).abs() < 4.0 * sigma,
        "{vehicle}"
    );
    assert!(vehicle["mounting_yaw_deg"]["sigma"].as_f64().unwrap() < 1.0);
    for (i, name) in ["nhc", "odometer"].into_iter().enumerate() {
        assert_eq!(vehicle["aids"][i]["aid"], name);
        // made without noise: no farther off than stated
        assert!(
            vehicle["aids"][i]["nis_per_component"].as_f64().unwrap() < 1.0,
            "{vehicle}"
        );
    }
    assert!(read("report.html").contains("/vehicle/wheel_scale/value"));
    assert!(read("manifest.json").contains("\"odometer\""));
    done(place.path(), fuse);
    assert!(
        !read("summary.json").contains("vehicle"),
        "nothing without asking"
    );
}

#[test]
fn a_wheel_without_a_speed_is_refused() {
    let place = recorded();
    for (header, km_h, said) in [
        (
            "t_s,wheel_ticks",
            1.0,
            "wheel.csv, line 1: column speed is missing",
        ),
        (
            "t_s,speed",
            1.0,
            "wheel.csv, line 1: column \"speed\" has no unit",
        ),
        ("t_s,wheel_m_s", 3.6, "the wheel reads 3.6"),
    ] {
        write_wheel(place.path(), header, km_h);
        let ran = nav_sim(
            place.path(),
            "fuse rec/imu.csv rec/gnss.csv imu.toml --odometer wheel.csv -o out",
        );
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        assert!(
            ran.stderr.contains(said) && ran.stderr.contains("hint:"),
            "{}",
            ran.stderr
        );
    }
    assert!(!place.path().join("out").exists());
}
