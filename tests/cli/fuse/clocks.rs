//! Clocks of an IMU and of a receiver that are apart, by how much is found from the turns and the innovations.

use super::{recorded, recorded_on};
use crate::common::drive::*;

/// Writes the recorded fixes with other times.
fn later(place: &Place, to: &str, seconds: f64) {
    place.edit("rec/gnss.csv", to, |_, line| match line.split_once(',') {
        Some((t_s, rest)) if t_s.parse::<f64>().is_ok() => {
            format!("{:.4},{rest}", t_s.parse::<f64>().unwrap() + seconds)
        }
        _ => line.to_owned(),
    });
}

/// The numbers behind the option in a text.
#[track_caller]
fn delays(text: &str) -> Vec<f64> {
    let rest = text
        .split("--gnss-delay=")
        .nth(1)
        .unwrap_or_else(|| panic!("{text}"));
    rest.split(['(', ')', '±', ' ', ','])
        .filter_map(|word| word.parse().ok())
        .collect()
}

/// GPS time is 18 s ahead of UTC; a day less a second leaves nothing in common.
#[test]
fn clocks_that_are_apart_are_brought_together() {
    let place = recorded_on(DRIVE, MODEL);
    later(&place, "gps_time.csv", 18.0);
    place.ends("fuse rec/imu.csv gps_time.csv imu.toml -o out", 3);
    let delay_s = number(
        &place.json("out/summary.json"),
        "/verdict/cause/clocks/delay_s",
    );
    assert!((delay_s - 18.0).abs() < 1e-9, "{delay_s}");
    later(&place, "day.csv", 50_399.0);
    let ran = place.done("fuse rec/imu.csv day.csv imu.toml -o out");
    assert!(
        (delays(&ran.stderr)[0] - 50_399.0).abs() < 0.1,
        "{}",
        ran.stderr
    );
}

/// Fixes 0.4 s late: the verdict names the delay and the option, with which the solution is to be believed.
#[test]
fn late_fixes_are_told_and_their_delay_is_an_option() {
    let place = recorded();
    later(&place, "late.csv", 0.4);
    let command = "fuse rec/imu.csv late.csv imu.toml --initial rec/initial.toml -o";
    // `… --gnss-delay=0.396 (± 0.007)`
    let told = place.judged(&format!("{command} late"));
    let found = delays(&told.stdout);
    assert!(
        (found[0] - 0.4).abs() < 4.0 * found[1] && found[1] < 0.02,
        "{}",
        told.stdout
    );
    place.done(&format!("{command} sound --gnss-delay 0.4"));
    assert_eq!(
        place.json("sound/summary.json")["verdict"]["kind"],
        "undecided"
    );
}

/// Velocities that a receiver filters lag behind its positions by 0.7 s: turns of the course then tell of another clock than
/// positions do, which are off by an antenna 2 m ahead. Clocks that make the innovations larger are no cause.
#[test]
fn clocks_are_named_only_where_the_innovations_agree() {
    let place = recorded_on(DRIVE, MODEL);
    let rows = place.table("rec/reference.csv");
    let step_s = rows[1][0] - rows[0][0];
    let [second, late] = [1.0, 0.7].map(|s| (s / step_s).round() as usize);
    let mut fixes = "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m,v_n_m_s,v_e_m_s,v_d_m_s,sd_vn_m_s,sd_ve_m_s,sd_vd_m_s\n".to_owned();
    for k in (second..rows.len()).step_by(second) {
        let (row, before) = (&rows[k], &rows[k - late]);
        // metres to degrees at 46.5° of latitude
        let (yaw, north, east) = (row[9].to_radians(), 111_150.0, 76_700.0);
        let (lat, lon) = (
            row[1] + 2.0 * yaw.cos() / north,
            row[2] + 2.0 * yaw.sin() / east,
        );
        let v = [4, 5, 6].map(|i| before[i].to_string()).join(",");
        fixes += &format!("{},{lat},{lon},{},0.2,0.2,0.2,{v},1,1,1\n", row[0], row[3]);
    }
    place.write("lagging.csv", fixes);
    place.judged("fuse rec/imu.csv lagging.csv imu.toml --initial rec/initial.toml -o out");
    let cause = &place.json("out/summary.json")["verdict"]["cause"];
    assert!(cause["clocks"].is_null(), "{cause}");
}

/// A delay far beyond the minute that two loggers begin apart is found where the turns tell it, to a step of the search, and is
/// what to paste.
#[test]
fn a_delay_of_minutes_is_named() {
    let angles = [90, -60, 120, -90, 50, -130, 80, -100, 70, -40];
    let parts = (0..).zip(angles).map(|(k, deg)| {
        format!(
            "  {{ kind = \"turn\", angle_deg = {deg}, duration_s = 12 }},\n  \
             {{ kind = \"straight\", duration_s = {} }},\n",
            7 + (5 * k) % 13
        )
    });
    let start = "{ lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40, speed_m_s = 12 }";
    let drive = format!(
        "start = {start}\nsegment = [\n{}]\n",
        parts.collect::<String>()
    );
    let place = recorded_on(&drive, MODEL);
    let fuse = "fuse rec/imu.csv rec/gnss.csv imu.toml --gnss-delay 80 -o out";
    let ran = place.ends(fuse, 3);
    assert!(delays(&ran.stdout)[0].abs() <= 0.1, "{}", ran.stdout);
}
