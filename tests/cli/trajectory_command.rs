//! `nav-sim trajectory`: streams, exit codes, files.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

fn trajectory(args: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_nav-sim"));
    let output = command
        .arg("trajectory")
        .args(args)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (
        output.status.code().unwrap(),
        text(output.stdout),
        text(output.stderr),
    )
}

fn file(dir: &Path, name: &str, text: &str) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

const DRIVE: &str = "trajectories/land_vehicle.toml";

#[test]
fn check_prints_the_closure_and_exits_with_3_beyond_a_bound() {
    let (code, out, err) = trajectory(&["check", DRIVE]);
    assert_eq!((code, err.as_str()), (0, ""));
    assert!(
        out.starts_with("trajectories/land_vehicle.toml: 900 s from 0 s, "),
        "{out}"
    );
    assert!(
        out.contains("closure at 100 Hz over 900 s: within bounds\n"),
        "{out}"
    );
    let (code, out, err) = trajectory(&[
        "check",
        DRIVE,
        "--rate-hz",
        "25",
        "--max-position-m",
        "0.001",
    ]);
    assert_eq!(code, 3);
    assert!(
        out.contains("closure at 25 Hz over 900 s: BEYOND A BOUND"),
        "{out}"
    );
    assert!(
        err.starts_with("error: trajectories/land_vehicle.toml: closure at 25 Hz is 2."),
        "{err}"
    );
    assert!(
        err.contains(", beyond 1e-3 m, ") && err.contains("\n\nhint: a higher --rate-hz"),
        "{err}"
    );
}

#[test]
fn check_speaks_json_and_exits_with_3_beyond_a_limit() {
    let (code, out, err) = trajectory(&["check", DRIVE, "--limit-speed", "24", "--format", "json"]);
    let report: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, report["within_bounds"].as_bool()), (3, Some(true)));
    assert!(report["closure"]["horizontal_m"].as_f64().unwrap() < 0.01);
    assert!((report["largest"]["speed_m_s"].as_f64().unwrap() - 25.0).abs() < 1e-3);
    let said = report["beyond_limits"][0].as_str().unwrap();
    assert!(
        said.starts_with("speed 25.0 m/s at ") && said.contains("beyond 24.0 m/s (between 39"),
        "{said}"
    );
    let stretches = report["beyond_limits"].as_array().unwrap().len();
    let verdict = format!("error: {DRIVE}: the motion is beyond a limit in {stretches} stretch");
    assert!(
        err.starts_with(&format!("warning: {DRIVE}: {said}\n")) && err.contains(&verdict),
        "{err}"
    );
    assert!(
        err.contains("hint: a vehicle that moves so needs a larger --limit-speed"),
        "{err}"
    );
    // both at once: each is named
    let (code, _, err) = trajectory(&[
        "check",
        DRIVE,
        "--limit-speed",
        "24",
        "--max-position-m",
        "1e-9",
    ]);
    assert!(
        code == 3 && err.contains("beyond 1e-9 m") && err.contains("; the motion is beyond"),
        "{err}"
    );
    assert!(
        err.contains("hint: a higher --rate-hz") && err.contains("; a vehicle that moves so needs"),
        "{err}"
    );
}

#[test]
fn generated_tables_read_back_as_the_same_trajectory() {
    let dir = tempfile::tempdir().unwrap();
    let (code, out, _) = trajectory(&["generate", DRIVE, "--rate-hz", "1"]);
    assert_eq!((code, out.lines().count()), (0, 902));
    assert!(out.starts_with(
        "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg\n0,46.519"
    ));
    let path = dir.path().join("drive.csv.gz");
    let written = path.to_str().unwrap();
    let (code, _, err) = trajectory(&["generate", DRIVE, "--rate-hz", "20", "-o", written]);
    assert_eq!((code, err), (0, format!("wrote {written}\n")));
    let (code, out, err) = trajectory(&["check", written]);
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
    assert!(out.contains("900 s from 0 s, 18001 points"), "{out}");
}

#[test]
fn convert_places_local_coordinates_and_never_overwrites_its_input() {
    let dir = tempfile::tempdir().unwrap();
    let rows: String = (0..9).map(|k| format!("{k},{},0,-10\n", 4 * k)).collect();
    let local = file(dir.path(), "local.csv", &format!("t_s,n_m,e_m,d_m\n{rows}"));
    let (local, out) = (local.to_str().unwrap(), dir.path().join("out.csv"));
    let (code, _, err) = trajectory(&["convert", local, "-o", out.to_str().unwrap()]);
    assert_eq!(code, 2);
    let expected =
        "local.csv: local coordinates need an origin on the Earth\n\nhint: give --origin";
    assert!(err.contains(expected) && !out.exists(), "{err}");
    let (code, _, err) = trajectory(&[
        "convert",
        local,
        "--origin",
        "-33,151,5",
        "-o",
        out.to_str().unwrap(),
    ]);
    assert!(
        code == 0 && err.contains("no attitude columns: heading and pitch follow the path"),
        "{err}"
    );
    let text = std::fs::read_to_string(&out).unwrap();
    let second: Vec<f64> = text
        .lines()
        .nth(2)
        .unwrap()
        .split(',')
        .map(|x| x.parse().unwrap())
        .collect();
    assert!(
        (second[3] - 15.0).abs() < 1e-4 && (second[4] - 4.0).abs() < 1e-3,
        "{second:?}"
    );
    let (code, _, err) = trajectory(&["convert", local, "--origin", "-33,151,5", "-o", local]);
    assert!(
        code == 2 && err.contains("is an input and would be overwritten"),
        "{err}"
    );
    let (code, _, err) = trajectory(&["convert", local, "--origin", "-95,151,5", "-o", "x.csv"]);
    assert!(
        code == 2 && err.contains("expected LAT_DEG,LON_DEG,H_M, latitude within ±89.9"),
        "{err}"
    );
}

#[test]
fn bad_files_exit_with_2_and_missing_ones_with_1() {
    let dir = tempfile::tempdir().unwrap();
    let bad = file(
        dir.path(),
        "bad.csv",
        "t_s,lat_deg,lon_deg,h_m\n0,46,7,0\n1,46,7,x\n",
    );
    let (code, out, err) = trajectory(&["check", bad.to_str().unwrap()]);
    assert_eq!((code, out.as_str()), (2, ""));
    assert!(
        err.contains("bad.csv, line 3: column \"h_m\": \"x\" is not a number\n"),
        "{err}"
    );
    let profile = file(
        dir.path(),
        "bad.toml",
        "start = { lat_deg = 46 }\nsegment = []\n",
    );
    let (code, _, err) = trajectory(&["check", profile.to_str().unwrap()]);
    assert!(
        code == 2 && err.contains("bad.toml, line 1: \"start.lon_deg\" is missing"),
        "{err}"
    );
    for name in ["none.csv", "none.toml"] {
        let (code, _, err) = trajectory(&["check", dir.path().join(name).to_str().unwrap()]);
        assert!(
            code == 2 && err.contains(": No such file or directory"),
            "{name}: {err}"
        );
    }
}

/// Heights of no gravity model are refused with their line.
#[test]
fn heights_are_looked_at() {
    let place = tempfile::tempdir().unwrap();
    let rows = |h: f64| -> String {
        let row = |k: u32| format!("{k},46.{:04},6.5,{h},0,0,0\n", 5000 + k);
        "t_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg,yaw_deg\n".to_owned()
            + &(0..10).map(row).collect::<String>()
    };
    let check = |h: f64| {
        let path = file(place.path(), "h.csv", &rows(h));
        trajectory(&["check", path.to_str().unwrap()])
    };
    assert!(!check(400.0).2.contains("height"));
    let (code, _, said) = check(4e6);
    assert!(
        code == 2 && said.contains("line 2: height 4000000.0 m is not within −12 to 1000 km"),
        "{said}"
    );
}

/// TUM rows are east, north, up of the first row, body forward, left, up (read against hand-made ones by the reader's own test), and
/// come back to a millimetre and a microradian; the same command replaces its file.
#[test]
fn tum_rows_come_back() {
    use crate::common::drive::{DRIVE, MODEL, done, place_with};
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    done(
        dir,
        "trajectory convert drive.toml --rate-hz 10 -o drive.csv",
    );
    for _ in 0..2 {
        done(
            dir,
            "trajectory convert drive.toml --rate-hz 10 -o drive.tum.gz",
        );
    }
    done(dir, "trajectory convert drive.tum.gz -o back.csv");
    let rows = |name: &str| -> Vec<Vec<f64>> {
        let text = std::fs::read_to_string(dir.join(name)).unwrap();
        let cells = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
        text.lines().skip(1).map(cells).collect()
    };
    let (made, back) = (rows("drive.csv"), rows("back.csv"));
    assert_eq!((made.len(), back.len()), (601, 601));
    for (a, b) in made.iter().zip(&back) {
        let degree_m = 111_320.0;
        let [north, east] = [1, 2].map(|i| (a[i] - b[i]) * degree_m);
        assert!(north.hypot(east).hypot(a[3] - b[3]) < 1e-3, "{a:?} {b:?}");
        for i in 7..10 {
            let turned = (a[i] - b[i] + 540.0).rem_euclid(360.0) - 180.0;
            assert!(turned.to_radians().abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}
