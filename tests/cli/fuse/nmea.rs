//! `fuse` on the NMEA sentences of a drive.

use super::recorded;

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

/// A drive over midnight: the sentences give the solution of the table with the same horizontal velocities, in seconds of the day
/// and in Unix time, whichever the IMU has.
#[test]
fn sentences_give_the_solution_of_the_table() {
    let place = recorded();
    let gnss = place.table("rec/gnss.csv");
    let begin_s = 86_350.0;
    // 2024-02-28 00:00 UTC
    for (name, by_s) in [
        ("day.csv", begin_s),
        ("unix.csv", begin_s + 1_709_078_400.0),
    ] {
        place.edit("rec/imu.csv", name, |k, line| match line.split_once(',') {
            Some((time, rest)) if k > 0 => {
                format!("{:.4},{rest}", time.parse::<f64>().unwrap() + by_s)
            }
            _ => line.to_owned(),
        });
    }
    place.write("log.nmea", log(&gnss, begin_s, true));
    place.write("bare.txt", log(&gnss, begin_s, false));
    // the table with a vertical velocity that says nothing
    let head = "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m,v_n_m_s,v_e_m_s,v_d_m_s,sd_vn_m_s,sd_ve_m_s,sd_vd_m_s";
    let row = |r: &Vec<f64>| {
        let cells: Vec<String> = r[1..9].iter().map(f64::to_string).collect();
        format!("\n{},{},0,0.04,0.04,1000", r[0] + begin_s, cells.join(","))
    };
    place.write(
        "table.csv",
        head.to_owned() + &gnss.iter().map(row).collect::<String>(),
    );

    let fused = |files: &str| {
        let ran = place.done(&format!("fuse {files} imu.toml -o out"));
        (place.table("out/solution.csv").pop().unwrap(), ran.stderr)
    };
    let (expected, _) = fused("day.csv table.csv");
    let sigma = format!(
        "--gnss-sigma {},{},{}:0.04",
        gnss[0][4], gnss[0][5], gnss[0][6]
    );
    for (files, late_s, note) in [
        (
            "day.csv log.nmea --gnss-sigma 9:0.04",
            0.0,
            "100 fixes, times are seconds of the day",
        ),
        (
            "unix.csv log.nmea --gnss-sigma 9:0.04",
            1_709_078_400.0,
            "times are Unix time",
        ),
        (
            &format!("day.csv bare.txt {sigma}"),
            0.0,
            "as given where the file has none",
        ),
    ] {
        let (found, notes) = fused(files);
        assert!(notes.contains(note), "{notes}");
        assert!((found[0] - expected[0] - late_s).abs() < 1e-6);
        assert_eq!(found.len(), expected.len());
        // positions to 1e-8 degrees (1 mm), others to 1e-3: the digits of the sentences
        for i in 1..found.len() {
            let allowed = if i < 3 { 1e-8 } else { 1e-3 };
            assert!(
                (found[i] - expected[i]).abs() <= allowed,
                "{i}: {found:?} {expected:?}"
            );
        }
    }
    let (_, notes) = fused("day.csv log.nmea");
    assert!(notes.contains("speed and course are unused"), "{notes}");
    place.ends("fuse rec/imu.csv log.nmea imu.toml -o none", 2);
    let found = place.done("check log.nmea").stdout;
    assert!(found.contains("100 GNSS fixes"), "{found}");
}
