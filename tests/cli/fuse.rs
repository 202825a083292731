//! `nav-sim fuse` as a user runs it.

mod clocks;
mod delays;
mod doubts;
mod loggers;
mod mounting;
mod nmea;
mod smooth;
mod vehicle;

use crate::common::drive::{MODEL, done, nav_sim, place_with};
use std::fs;
use std::path::Path;

const DRIVE: &str = "
start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }
segment = [
  { kind = \"straight\", duration_s = 10 },
  { kind = \"accelerate\", to_speed_m_s = 10, duration_s = 10 },
  { kind = \"turn\", angle_deg = 90, duration_s = 10 },
  { kind = \"straight\", duration_s = 30 },
  { kind = \"turn\", angle_deg = -120, duration_s = 15 },
  { kind = \"straight\", duration_s = 25 },
]
";

fn place() -> tempfile::TempDir {
    place_with(DRIVE, MODEL)
}

/// A place with a recorded drive in `rec`.
fn recorded() -> tempfile::TempDir {
    let place = place();
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    place
}

fn table(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let cells = |line: &str| {
        line.split(',')
            .map(|c| c.parse().unwrap_or(f64::NAN))
            .collect()
    };
    text.lines().skip(1).map(cells).collect()
}

#[test]
fn a_fusion_directory_holds_what_the_interface_says() {
    let place = recorded();
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --reference rec/reference.csv --outage 60:75 -o out --verbose",
    );
    assert!(
        ran.stdout.contains("levelled at rest until"),
        "{}",
        ran.stdout
    );
    assert!(ran.stdout.contains("from the course"), "{}", ran.stdout);
    assert!(ran.stdout.contains(" 15 withheld"), "{}", ran.stdout);
    let out = place.path().join("out");
    let header = fs::read_to_string(out.join("solution.csv"))
        .unwrap()
        .lines()
        .next()
        .unwrap()
        .to_owned();
    assert!(header.starts_with(
        "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg,sd_lat_deg,"
    ));
    assert!(
        header
            .contains(",sd_yaw_deg,b_ax_m_s2,b_ay_m_s2,b_az_m_s2,b_gx_rad_s,b_gy_rad_s,b_gz_rad_s")
    );
    let deviations =
        "sd_b_ax_m_s2,sd_b_ay_m_s2,sd_b_az_m_s2,sd_b_gx_rad_s,sd_b_gy_rad_s,sd_b_gz_rad_s";
    assert!(header.ends_with(&format!(",sd_n_m,sd_e_m,{deviations}")));
    let summary: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    let outage = &summary["outages"][0];
    assert_eq!(
        (&summary["fixes"]["withheld"], &outage["fixes_withheld"]),
        (&15.into(), &15.into())
    );
    let (drift, sigma) = (
        &outage["end_from_reference"]["horizontal_m"],
        &outage["end_from_reference"]["expected_sigma_m"],
    );
    assert!(
        drift.as_f64().unwrap() < 4.0 * sigma.as_f64().unwrap(),
        "{outage}"
    );
    assert!(summary["reference"]["rmse"]["pos_n_m"].as_f64().unwrap() < 10.0);
    // the coarse alignment is as good as it says, at its own epoch, in every state
    let (errors, solution) = (
        table(&out.join("errors.csv")),
        table(&out.join("solution.csv")),
    );
    let sd = |i: usize| {
        if i < 2 {
            solution[0][25 + i]
        } else {
            solution[0][10 + i]
        }
    };
    for i in 0..9 {
        assert!(
            errors[0][1 + i].abs() < 4.0 * sd(i),
            "state {i}: {} against {}",
            errors[0][1 + i],
            sd(i)
        );
    }
    assert!(
        fs::read_to_string(out.join("solution.kml"))
            .unwrap()
            .contains("<LineString>")
    );
    assert!(
        fs::read_to_string(out.join("manifest.json"))
            .unwrap()
            .contains("\"kind\": \"fusion\"")
    );
    // states of the turn-on bias are not the scale factors of `--filter 21`
    let states = |flags: &str| {
        done(
            place.path(),
            &format!("fuse rec/imu.csv rec/gnss.csv imu.toml {flags} -o other"),
        );
        let text = fs::read_to_string(place.path().join("other/summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
        ["filter_states", "turn_on_states"].map(|key| summary[key].as_u64().unwrap())
    };
    assert_eq!(states(""), [15, 0]);
    assert_eq!(states("--turn-on-bias 0.02,1e-4"), [21, 6]);
    assert_eq!(states("--filter 21"), [21, 0]);
}

/// The same recording as rates, as increments, as KF-GINS texts: one solution, to the digits written.
#[test]
fn rates_increments_and_kf_gins_texts_give_one_solution() {
    let place = recorded();
    let at = |name: &str| place.path().join(name);
    let (imu, gnss) = (table(&at("rec/imu.csv")), table(&at("rec/gnss.csv")));
    let mut csv =
        "t_s,dtheta_x_rad,dtheta_y_rad,dtheta_z_rad,dv_x_m_s,dv_y_m_s,dv_z_m_s\n".to_owned();
    let mut text = String::new();
    for row in &imu {
        let cells: Vec<String> = row[1..]
            .iter()
            .map(|x| format!("{:.14}", x * 0.01))
            .collect();
        csv += &format!("{},{}\n", row[0], cells.join(","));
        text += &format!("  {:.6}   {}\n", row[0], cells.join("  "));
    }
    let fixes: String = gnss
        .iter()
        .map(|r| {
            format!(
                "{} {:.10} {:.10} {:.4} {} {} {}\n",
                r[0], r[1], r[2], r[3], r[4], r[5], r[6]
            )
        })
        .collect();
    let position_only: String =
        "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m\n".to_owned() + &fixes.replace(' ', ",");
    // with an odometer's speed, which is not used; with velocity, which stands before the deviations; deviations given
    // with a flag
    let odometer: String = text.lines().map(|l| format!("{l}  3.25\n")).collect();
    let full: String = gnss
        .iter()
        .map(|r| {
            [0, 1, 2, 3, 7, 8, 9, 4, 5, 6, 10, 11, 12]
                .map(|i| r[i].to_string())
                .join(" ")
                + "\n"
        })
        .collect();
    let four = |l: &str| l.split(',').take(4).collect::<Vec<_>>().join(",") + "\n";
    let bare: String = position_only.lines().map(four).collect();
    for (name, contents) in [
        ("inc.csv", &csv),
        ("imu.txt", &text),
        ("gnss.txt", &fixes),
        ("pos.csv", &position_only),
        ("imu8.txt", &odometer),
        ("gnss13.txt", &full),
        ("bare.csv", &bare),
    ] {
        fs::write(at(name), contents).unwrap();
    }
    let end = |files: &str| {
        done(
            place.path(),
            &format!("fuse {files} imu.toml --initial rec/initial.toml -o out"),
        );
        table(&at("out/solution.csv")).pop().unwrap()
    };
    let sigma = format!("{},{},{}", gnss[0][4], gnss[0][5], gnss[0][6]);
    let given = format!("--gnss-sigma {sigma} rec/imu.csv bare.csv");
    let ends = [
        "rec/imu.csv pos.csv",
        "inc.csv pos.csv",
        "imu.txt gnss.txt",
        "imu8.txt gnss.txt",
        &given,
    ]
    .map(end);
    let with_velocity = ["rec/imu.csv rec/gnss.csv", "imu.txt gnss13.txt"].map(end);
    let pairs = ends[1..]
        .iter()
        .map(|e| (&ends[0], e))
        .chain([(&with_velocity[0], &with_velocity[1])]);
    for (first, end) in pairs {
        for (column, (x, y)) in first.iter().zip(end).enumerate() {
            assert!(
                (x - y).abs() <= 2e-6 * (1.0 + x.abs()),
                "column {column}: {x} {y}"
            );
        }
    }
}

/// Edits a file of the drive and expects the refusal, with exit code 2 and nothing left.
fn refused(name: &str, edit: impl Fn(&str) -> String, flags: &str, expected: &[&str]) {
    let place = recorded();
    let path = place.path().join(name);
    fs::write(&path, edit(&fs::read_to_string(&path).unwrap())).unwrap();
    let ran = nav_sim(
        place.path(),
        &format!("fuse rec/imu.csv rec/gnss.csv imu.toml {flags} -o out"),
    );
    assert_eq!(ran.code, 2, "{expected:?}\n{}", ran.stderr);
    for text in expected {
        assert!(ran.stderr.contains(text), "{text}\n{}", ran.stderr);
    }
    assert!(!place.path().join("out").exists());
}

/// The table with one cell of one line replaced.
fn cell(line: usize, column: usize, value: &str) -> impl Fn(&str) -> String {
    let value = value.to_owned();
    move |text| {
        let edit = |(i, l): (usize, &str)| {
            let mut cells: Vec<&str> = l.split(',').collect();
            if i + 1 == line {
                cells[column] = &value;
            }
            cells.join(",") + "\n"
        };
        text.lines().enumerate().map(edit).collect()
    }
}

fn shifted(seconds: f64) -> impl Fn(&str) -> String {
    move |text| {
        let mut lines = text.lines();
        let mut out = lines.next().unwrap().to_owned() + "\n";
        for line in lines {
            let (t, rest) = line.split_once(',').unwrap();
            out += &format!("{},{rest}\n", t.parse::<f64>().unwrap() + seconds);
        }
        out
    }
}

#[test]
fn bad_fixes_are_refused_by_line_and_value() {
    let gnss = "rec/gnss.csv";
    refused(
        gnss,
        cell(5, 4, "0"),
        "",
        &[
            "gnss.csv, line 5: column \"sd_n_m\": 0 is not a standard deviation",
            "hint: ",
        ],
    );
    refused(
        gnss,
        cell(5, 12, "-0.1"),
        "",
        &["line 5: column \"sd_vd_m_s\": -0.1 is not a standard deviation"],
    );
    refused(
        gnss,
        cell(7, 1, "89.95"),
        "",
        &["line 7: column \"lat_deg\": 89.95 is not a latitude within ±89.9"],
    );
    refused(
        gnss,
        cell(7, 1, "-146.5"),
        "",
        &["line 7: column \"lat_deg\": -146.5 is not a latitude"],
    );
    refused(
        gnss,
        cell(7, 1, "6.5"),
        "",
        &["line 7: position jumps by 4343682 m in 1 s", "swapped"],
    );
    refused(
        gnss,
        cell(9, 0, "2"),
        "",
        &["line 9: time goes from 7 s to 2 s: it must increase"],
    );
    refused(
        gnss,
        cell(9, 3, "NaN"),
        "",
        &["line 9: column \"h_m\": \"NaN\" is not a finite number"],
    );
    refused(
        gnss,
        cell(1, 4, "s_n_m"),
        "",
        &[
            "line 1: unknown column \"s_n_m\"",
            "hint: did you mean \"sd_n_m\"?",
        ],
    );
}

#[test]
fn bad_imu_data_and_flags_are_refused() {
    let imu = "rec/imu.csv";
    refused(
        imu,
        cell(50, 2, "inf"),
        "",
        &["imu.csv, line 50: column \"gyro_y_rad_s\": \"inf\" is not a finite number"],
    );
    refused(
        imu,
        cell(50, 0, "0.1"),
        "",
        &["imu.csv, line 50: time goes from 0.48 s to 0.1 s"],
    );
    refused(
        imu,
        // one alone is taken as missing
        |t| cell(51, 1, "99")(&cell(50, 1, "99")(t)),
        "",
        &[
            "imu.csv, line 50: a rotation of",
            "hint: is the unit right?",
        ],
    );
    refused(
        imu,
        |t| {
            t.replace("accel_x_m_s2", "accel_x_mg")
                .replace("accel_y_m_s2", "accel_y_mg")
                .replace("accel_z_m_s2", "accel_z_mg")
        },
        "",
        &["not 9.81 m/s²"],
    );
    refused(
        imu,
        |t| t.replace("gyro_z_rad_s", "magnet_z"),
        "",
        &["column gyro.z is missing"],
    );
    let same = |t: &str| t.to_owned();
    let gap = |t: &str| {
        t.lines()
            .enumerate()
            .filter(|(i, _)| !(100..1350).contains(i))
            .map(|(_, l)| l.to_owned() + "\n")
            .collect()
    };
    refused(
        imu,
        gap,
        "",
        &["line 101: no samples from 0.99 s to 13.5 s: at most 5 s"],
    );
    refused(
        imu,
        same,
        "--outage 300:400",
        &[
            "outage 300:400 does not lie on the data",
            "hint: the fixes run from 1 to 100 s",
        ],
    );
    refused(imu, same, "--lever-arm 1,2", &["expected 3 numbers"]);
    refused(
        "rec/initial.toml",
        |t| t.replace("yaw_deg", "yaw"),
        "--initial rec/initial.toml",
        &["unknown key \"yaw\"", "yaw_deg"],
    );
    refused(
        "rec/initial.toml",
        |t| t.replace("t_s = 0.0", "t_s = 500.0"),
        "--initial rec/initial.toml",
        &["the start at 500.00 s is not within the IMU's 0 to 100 s"],
    );
}

/// A recording that never moves has no course: the message says what to give instead.
#[test]
fn standing_still_needs_an_initial_state() {
    let place = place();
    let still = "start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }\nsegment = [{ kind = \"straight\", duration_s = 30 }]\n";
    fs::write(place.path().join("drive.toml"), still).unwrap();
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml -o out",
    );
    assert_eq!(ran.code, 2);
    assert!(
        ran.stderr.contains("no fix moves at 0.5 m/s") && ran.stderr.contains("--initial FILE"),
        "{}",
        ran.stderr
    );
    done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --initial rec/initial.toml -o out",
    );
    // or the heading alone: known no better than given, as nothing moves
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --initial 38:2 -o given --verbose",
    );
    assert!(
        ran.stdout.contains("heading 38.0° ± 2.0° as given"),
        "{}",
        ran.stdout
    );
    let last = table(&place.path().join("given/solution.csv"))
        .pop()
        .unwrap();
    let (yaw, sd_yaw) = (last[9], last[18]);
    assert!(
        (yaw - 38.0).abs() < 1.0 && (1.5..2.1).contains(&sd_yaw),
        "{yaw} {sd_yaw}"
    );
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --initial 38:50 -o given",
    );
    assert!(
        ran.code == 2 && ran.stderr.contains("standard deviation of up to 30°"),
        "{}",
        ran.stderr
    );
}

/// Positions alone: the heading is never turned round, and every state of the coarse alignment is as good as
/// it says (4 standard deviations, 9 states, 6 recordings: p < 0.004 of a false alarm).
#[test]
fn alignment_from_positions_alone_is_as_good_as_it_says() {
    let place = place();
    let fast = DRIVE.replace(
        "to_speed_m_s = 10, duration_s = 10",
        "to_speed_m_s = 28, duration_s = 14",
    );
    fs::write(place.path().join("drive.toml"), fast).unwrap();
    for seed in 1..=6 {
        done(
            place.path(),
            &format!("trajectory record drive.toml imu.toml --seed {seed} -o rec"),
        );
        let gnss = fs::read_to_string(place.path().join("rec/gnss.csv")).unwrap();
        let positions = |l: &str| l.split(',').take(7).collect::<Vec<_>>().join(",") + "\n";
        fs::write(
            place.path().join("pos.csv"),
            gnss.lines().map(positions).collect::<String>(),
        )
        .unwrap();
        let ran = done(
            place.path(),
            "fuse rec/imu.csv pos.csv imu.toml --reference rec/reference.csv -o out",
        );
        assert!(!ran.stderr.contains("reversing"), "{}", ran.stderr);
        assert!(ran.stdout.starts_with("undecided"), "{}", ran.stdout); // too short for more
        let out = place.path().join("out");
        let (errors, solution) = (
            table(&out.join("errors.csv")),
            table(&out.join("solution.csv")),
        );
        let sd = |i: usize| {
            if i < 2 {
                solution[0][25 + i]
            } else {
                solution[0][10 + i]
            }
        };
        for i in 0..9 {
            let (error, sd) = (errors[0][1 + i], sd(i));
            assert!(
                error.abs() < 4.0 * sd,
                "seed {seed}, state {i}: {error} against {sd}\n{}",
                ran.stderr
            );
        }
    }
}

/// What cannot be right is refused, or said: a start elsewhere, a lever arm in millimetres, a filter whose
/// fixes are far from what it believes.
#[test]
fn useless_fusions_are_refused_or_said() {
    let initial = "rec/initial.toml";
    let elsewhere = |t: &str| t.replace("lat_deg = 46.", "lat_deg = 47.");
    refused(
        initial,
        elsewhere,
        "--initial rec/initial.toml",
        &["the initial position is 11", "hint: check t_s"],
    );
    let same = |t: &str| t.to_owned();
    refused(
        initial,
        same,
        "--lever-arm 800,0,-1200",
        &["--lever-arm='800,0,-1200': more than 100 m"],
    );
    refused(
        initial,
        same,
        "--outage 90.2:90.7",
        &["outage 90.2:90.7 withholds no fix"],
    );
    let place = recorded();
    let turned = "fuse rec/imu.csv rec/gnss.csv imu.toml --initial rec/initial.toml --mounting 0,0,90 -o out";
    let ran = nav_sim(place.path(), turned);
    assert!(
        ran.stdout.contains("NIS") && ran.stderr.contains("--mounting"),
        "{}",
        ran.stderr
    );
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --initial rec/initial.toml -o out",
    );
    assert!(!ran.stderr.contains("warning"), "{}", ran.stderr);
    let twice = "fuse rec/imu.csv rec/gnss.csv imu.toml --outage 60:70 --outage 65:75 -o out -v";
    let ran = done(place.path(), twice);
    assert!(
        ran.stderr.contains("overlapping outages are merged") && ran.stdout.contains("60–75 s"),
        "{}",
        ran.stdout
    );
}

/// East of 180° what is recorded is what `fuse` reads.
#[test]
fn a_recording_across_the_antimeridian_is_fused() {
    let place = place();
    let drive = DRIVE
        .replace("lon_deg = 6.5", "lon_deg = 179.9999")
        .replace("heading_deg = 40", "heading_deg = 90");
    fs::write(place.path().join("drive.toml"), drive).unwrap();
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    for name in ["rec/gnss.csv", "rec/reference.csv"] {
        let longitudes: Vec<f64> = table(&place.path().join(name))
            .iter()
            .map(|row| row[2])
            .collect();
        assert!(
            longitudes.iter().all(|l| -180.0 < *l && *l <= 180.0),
            "{name}"
        );
        assert!(
            longitudes.iter().any(|l| *l < 0.0) && longitudes.iter().any(|l| *l > 0.0),
            "{name}"
        );
    }
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --initial rec/initial.toml --reference rec/reference.csv -o out",
    );
    assert!(!ran.stderr.contains("warning"), "{}", ran.stderr);
}
