//! Fixes that are late, and recordings that move.

use super::recorded;
use crate::common::drive::{done, nav_sim};
use std::fmt::Write as _;
use std::fs;

/// Fixes 0.4 s late: the verdict names it and the option, with which the solution is to be believed.
#[test]
fn late_fixes_are_told_and_their_delay_is_an_option() {
    let place = recorded();
    let text = fs::read_to_string(place.path().join("rec/gnss.csv")).unwrap();
    let mut lines = text.lines();
    let mut late = format!("{}\n", lines.next().unwrap());
    for line in lines {
        let (t_s, rest) = line.split_once(',').unwrap();
        writeln!(late, "{},{rest}", t_s.parse::<f64>().unwrap() + 0.4).unwrap();
    }
    fs::write(place.path().join("late.csv"), late).unwrap();
    let command = "fuse rec/imu.csv late.csv imu.toml --initial rec/initial.toml -o";
    let told = nav_sim(place.path(), &format!("{command} late"));
    // `… --gnss-delay=0.396 (± 0.007)`
    let rest = told
        .stdout
        .split("the fixes agree with --gnss-delay=")
        .nth(1);
    let mut words = rest.expect("a delay").split(['(', ')', '±', ' ']);
    let mut number = || words.find_map(|word| word.parse::<f64>().ok()).unwrap();
    let (delay, error) = (number(), number());
    assert!(
        (delay - 0.4).abs() < 4.0 * error && error < 0.02,
        "{}",
        told.stdout
    );
    let sound = done(place.path(), &format!("{command} sound --gnss-delay 0.4"));
    assert!(
        sound.stdout.starts_with("undecided: errors "),
        "{}",
        sound.stdout
    );
}

/// A flight whose mean specific force is not gravity is no static recording, and `fuse` reads it: `check` says so. At rest
/// the same mean is a wrong unit.
#[test]
fn check_knows_recordings_that_move() {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, amplitude: f64| {
        let mut text =
            "t_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n"
                .to_owned();
        for k in 0..1000 {
            let f = amplitude * f64::from(k % 100) / 100.0 + 1e-3 * f64::from(k % 7);
            let g = 1e-4 * f64::from(k % 5);
            writeln!(
                text,
                "{},{f},{g},-11.4{k},{g},{f},{g}1",
                f64::from(k) / 50.0
            )
            .unwrap();
        }
        fs::write(place.path().join(name), text).unwrap();
    };
    write("flight.csv", 5.0);
    write("rest.csv", 0.0);
    let flight = done(place.path(), "check flight.csv");
    assert!(
        flight.stdout.contains("an IMU recording, 1000 samples"),
        "{}",
        flight.stdout
    );
    let rest = nav_sim(place.path(), "check rest.csv");
    assert!(
        rest.code == 2 && rest.stderr.contains("not 9.81"),
        "{}",
        rest.stderr
    );
}
