//! `nav-sim fuse` of an IMU and a receiver whose clocks are apart.

use crate::common::drive::{DRIVE, MODEL, done, nav_sim, place_with};
use std::fs;

/// GPS time is 18 s ahead of UTC: the commonest of differences.
#[test]
fn clocks_that_are_apart_are_named_with_what_to_add() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let text = fs::read_to_string(place.path().join("rec/gnss.csv")).unwrap();
    let later = |line: &str| match line.split_once(',') {
        Some((t_s, rest)) if line.starts_with(|c: char| c.is_ascii_digit()) => {
            format!("{},{rest}\n", t_s.parse::<f64>().unwrap() + 18.0)
        }
        _ => format!("{line}\n"),
    };
    fs::write(
        place.path().join("gps_time.csv"),
        text.lines().map(later).collect::<String>(),
    )
    .unwrap();
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv gps_time.csv imu.toml -o out",
    );
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let cause = "the clocks differ: --gnss-delay=18.0";
    assert!(
        ran.stdout.lines().nth(1).unwrap().starts_with(cause),
        "{}",
        ran.stdout
    );
    assert!(
        ran.stdout.lines().count() <= 20 && ran.stdout.lines().all(|l| l.chars().count() <= 120)
    );
    let summary = fs::read_to_string(place.path().join("out/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let delay_s = summary["verdict"]["cause"]["clocks"]["delay_s"]
        .as_f64()
        .unwrap();
    assert!((delay_s - 18.0).abs() < 1e-9, "{summary}");
}

/// Clocks that have nothing in common are brought together: the receiver's is 50 399 s ahead, and both recordings begin in
/// the same minute. Where no turn tells by how much, the option is named.
#[test]
fn clocks_that_do_not_overlap_are_brought_together() {
    let place = place_with(DRIVE, MODEL);
    let ahead = |line: &str| match line.split_once(',') {
        Some((t_s, rest)) if line.starts_with(|c: char| c.is_ascii_digit()) => {
            format!("{},{rest}\n", t_s.parse::<f64>().unwrap() + 50_399.0)
        }
        _ => format!("{line}\n"),
    };
    let record = || {
        done(
            place.path(),
            "trajectory record drive.toml imu.toml --seed 3 -o rec",
        );
        let text = fs::read_to_string(place.path().join("rec/gnss.csv")).unwrap();
        fs::write(
            place.path().join("day.csv"),
            text.lines().map(ahead).collect::<String>(),
        )
        .unwrap();
    };
    record();
    let ran = done(
        place.path(),
        "fuse rec/imu.csv day.csv imu.toml --reference rec/reference.csv -o out",
    );
    let found = ran
        .stderr
        .split("--gnss-delay=")
        .nth(1)
        .and_then(|rest| rest.split(',').next())
        .unwrap();
    assert!(
        (found.parse::<f64>().unwrap() - 50_399.0).abs() < 0.1,
        "{}",
        ran.stderr
    );
    assert!(ran.stdout.starts_with("undecided"), "{}", ran.stdout);

    let straight = "start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40, speed_m_s = 10 }\n\
                    segment = [{ kind = \"straight\", duration_s = 60 }]\n";
    fs::write(place.path().join("drive.toml"), straight).unwrap();
    record();
    let ran = nav_sim(place.path(), "fuse rec/imu.csv day.csv imu.toml -o none");
    assert!(
        ran.code == 2 && ran.stderr.contains("hint: use one clock"),
        "{}",
        ran.stderr
    );
}

/// Velocities that a receiver filters lag behind its positions by 0.7 s: turns of the course then tell of another clock than
/// positions do, which are off by an antenna 2 m ahead. Clocks that make the innovations larger are no cause.
#[test]
fn clocks_are_named_only_where_the_innovations_agree() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let text = fs::read_to_string(place.path().join("rec/reference.csv")).unwrap();
    let numbers = |line: &str| {
        line.split(',')
            .map(|c| c.parse().unwrap())
            .collect::<Vec<f64>>()
    };
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
        .map(numbers)
        .collect();
    let step_s = rows[1][0] - rows[0][0];
    let (second, late) = (
        (1.0 / step_s).round() as usize,
        (0.7 / step_s).round() as usize,
    );
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
    fs::write(place.path().join("lagging.csv"), fixes).unwrap();
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv lagging.csv imu.toml --initial rec/initial.toml -o out",
    );
    assert!(!ran.stdout.contains("the clocks differ"), "{}", ran.stdout);
}

/// A delay far beyond the minute that two loggers begin apart is found where the turns tell it, to a step of the search, and is
/// what to paste.
#[test]
fn a_delay_of_minutes_is_named() {
    let turn = |deg: f64| format!("  {{ kind = \"turn\", angle_deg = {deg}, duration_s = 12 }},\n");
    let straight = |s: u32| format!("  {{ kind = \"straight\", duration_s = {s} }},\n");
    let angles = [
        90.0, -60.0, 120.0, -90.0, 50.0, -130.0, 80.0, -100.0, 70.0, -40.0,
    ];
    let parts: String = angles
        .iter()
        .enumerate()
        .map(|(k, deg)| turn(*deg) + &straight(7 + (5 * k as u32) % 13))
        .collect();
    let start = "{ lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40, speed_m_s = 12 }";
    let place = place_with(&format!("start = {start}\nsegment = [\n{parts}]\n"), MODEL);
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --gnss-delay 80 -o out",
    );
    assert_eq!(ran.code, 3, "{}", ran.stdout);
    let named = ran.stdout.split("--gnss-delay=").nth(1).expect(&ran.stdout);
    let delay_s: f64 = named.split(' ').next().unwrap().parse().unwrap();
    assert!(delay_s.abs() <= 0.1, "{}", ran.stdout);
    assert!(!ran.stderr.contains("reference"), "{}", ran.stderr);
}
