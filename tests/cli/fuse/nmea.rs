//! `fuse` on the NMEA sentences of a drive.

use super::{recorded, table};
use crate::common::drive::{done, nav_sim};
use std::fs;
use std::path::Path;

fn sentence(body: &str) -> String {
    format!(
        "${body}*{:02X}\r\n",
        body.bytes().fold(0, |all, byte| all ^ byte)
    )
}

/// `ddmm.mmmmmmm`: a hundredth of a millimetre and better.
fn angle(degrees: f64, digits: usize) -> String {
    let whole = degrees.abs().trunc();
    format!("{whole:0digits$}{:010.7}", 60.0 * (degrees.abs() - whole))
}

/// The fixes as a receiver logs them from `begin_s` of the day on (t_s of the drive is 0 then), with and without `GST`.
fn log(rows: &[Vec<f64>], begin_s: f64, has_gst: bool) -> String {
    let mut text = String::new();
    for row in rows {
        let time = (begin_s + row[0]).rem_euclid(86_400.0);
        let (hours, minutes) = ((time / 3600.0).floor(), (time / 60.0).floor() % 60.0);
        let clock = format!("{hours:02}{minutes:02}{:06.3}", time % 60.0);
        let date = if begin_s + row[0] < 86_400.0 {
            "280224"
        } else {
            "290224"
        };
        let place = format!("{},N,{},E", angle(row[1], 2), angle(row[2], 3));
        let (north, east) = (row[7], row[8]);
        let (knots, course) = (
            north.hypot(east) * 3600.0 / 1852.0,
            east.atan2(north).to_degrees().rem_euclid(360.0),
        );
        text += &sentence(&format!(
            "GNRMC,{clock},A,{place},{knots:.5},{course:.4},{date},,,A"
        ));
        text += &sentence(&format!(
            "GNGGA,{clock},{place},1,12,0.8,{:.4},M,48.5,M,,",
            row[3] - 48.5
        ));
        text += &sentence("GPGSV,1,1,00");
        if has_gst {
            text += &sentence(&format!(
                "GNGST,{clock},1.0,,,,{},{},{}",
                row[4], row[5], row[6]
            ));
        }
    }
    text
}

/// The same times on another clock.
fn shifted(text: &str, by_s: f64) -> String {
    let mut lines = text.lines();
    let header = lines.next().unwrap().to_owned();
    let row = |line: &str| {
        let (time, rest) = line.split_once(',').unwrap();
        format!("\n{:.4},{rest}", time.parse::<f64>().unwrap() + by_s)
    };
    header + &lines.map(row).collect::<String>()
}

fn fused(place: &Path, imu: &str, gnss: &str, options: &str) -> (Vec<f64>, String) {
    let ran = done(
        place,
        &format!("fuse {imu} {gnss} imu.toml {options} -o out"),
    );
    (
        table(&place.join("out/solution.csv")).pop().unwrap(),
        ran.stderr,
    )
}

/// A drive over midnight: the sentences give the solution of the table with the same horizontal velocities, in seconds of the day
/// and in Unix time, whichever the IMU has.
#[test]
fn sentences_give_the_solution_of_the_table() {
    let place = recorded();
    let at = |name: &str| place.path().join(name);
    let gnss = table(&at("rec/gnss.csv"));
    let begin_s = 86_350.0;
    let imu = fs::read_to_string(at("rec/imu.csv")).unwrap();
    fs::write(at("day.csv"), shifted(&imu, begin_s)).unwrap();
    // 2024-02-28 00:00 UTC
    fs::write(at("unix.csv"), shifted(&imu, begin_s + 1_709_078_400.0)).unwrap();
    fs::write(at("log.nmea"), log(&gnss, begin_s, true)).unwrap();
    fs::write(at("bare.txt"), log(&gnss, begin_s, false)).unwrap();
    // the table with a vertical velocity that says nothing
    let head = "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m,v_n_m_s,v_e_m_s,v_d_m_s,sd_vn_m_s,sd_ve_m_s,sd_vd_m_s";
    let row = |r: &Vec<f64>| {
        let cells: Vec<String> = r[1..9].iter().map(f64::to_string).collect();
        format!("\n{},{},0,0.04,0.04,1000", r[0] + begin_s, cells.join(","))
    };
    fs::write(
        at("table.csv"),
        head.to_owned() + &gnss.iter().map(row).collect::<String>(),
    )
    .unwrap();

    let (expected, _) = fused(place.path(), "day.csv", "table.csv", "");
    let near = |found: &[f64], late_s: f64| {
        // positions to 1e-8 degrees (1 mm), others to 1e-3: the digits of the sentences
        let differ =
            |(i, x): (usize, &f64)| (x - expected[i]).abs() > if i < 3 { 1e-8 } else { 1e-3 };
        let wrong = found
            .iter()
            .enumerate()
            .skip(1)
            .position(|(i, x)| differ((i, x)));
        assert!(
            wrong.is_none() && (found[0] - expected[0] - late_s).abs() < 1e-6,
            "{wrong:?} {found:?} {expected:?}"
        );
    };
    let (day, said) = fused(place.path(), "day.csv", "log.nmea", "--gnss-sigma 9:0.04");
    assert!(
        said.contains("NMEA sentences: 100 fixes, times are seconds of the day"),
        "{said}"
    );
    assert!(
        said.contains("log.nmea: NMEA sentences") && !said.contains("warning: log.nmea"),
        "{said}"
    );
    near(&day, 0.0);
    let (unix, said) = fused(place.path(), "unix.csv", "log.nmea", "--gnss-sigma 9:0.04");
    assert!(said.contains("times are Unix time"), "{said}");
    near(&unix, 1_709_078_400.0);
    let same = format!(
        "--gnss-sigma {},{},{}:0.04",
        gnss[0][4], gnss[0][5], gnss[0][6]
    );
    let (given, said) = fused(place.path(), "day.csv", "bare.txt", &same);
    assert!(said.contains("as given where the file has none"), "{said}");
    near(&given, 0.0);

    let (_, said) = fused(place.path(), "day.csv", "log.nmea", "");
    assert!(
        said.contains("speed and course are unused") && said.contains("--gnss-sigma"),
        "{said}"
    );
    let ran = nav_sim(place.path(), "fuse day.csv bare.txt imu.toml -o none");
    assert!(
        ran.code == 2 && ran.stderr.contains("a fix without standard deviations"),
        "{}",
        ran.stderr
    );
    let ran = nav_sim(place.path(), "fuse rec/imu.csv log.nmea imu.toml -o none");
    assert!(
        ran.code == 2 && ran.stderr.contains("clocks do not overlap"),
        "{}",
        ran.stderr
    );
    assert!(
        done(place.path(), "check log.nmea")
            .stdout
            .contains("100 GNSS fixes")
    );
}
