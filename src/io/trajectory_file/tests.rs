mod profiles;

use super::*;
use crate::io::toml_file::TomlSource;
use glam::DVec3;
use nav_sim_navigation::frames::RollPitchYaw;
use nav_sim_signal::units::DEG;

const HEADER: &str = "t_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg,yaw_deg\n";

fn read(text: &str) -> Result<(Trajectory, Vec<String>), Failure> {
    read_with(text, None)
}

fn read_with(text: &str, origin: Option<[f64; 3]>) -> Result<(Trajectory, Vec<String>), Failure> {
    rows("a.csv", text, "csv", origin, false)?.trajectory()
}

/// North-east along 46.5° N at 2 rows a second, 20 rows, heading 45°, with one row replaced.
fn drive(replace: Option<(usize, &str)>) -> String {
    let row = |k: usize| {
        let t = 0.5 * k as f64;
        format!(
            "{t},{},{},400,0.5,-1,45",
            46.5 + 5e-5 * t,
            6.6 + 7.25e-5 * t
        )
    };
    let rows: Vec<_> = (0..20)
        .map(|k| match replace {
            Some((at, text)) if at == k => text.to_owned(),
            _ => row(k),
        })
        .collect();
    format!("{HEADER}{}\n", rows.join("\n"))
}

/// A heading of 45 may be degrees only; 0.785 may be either.
#[test]
fn attitude_without_a_unit_is_degrees_where_radians_cannot_be() {
    let bare = drive(None).replacen("roll_deg,pitch_deg,yaw_deg", "Roll,pitch,yaw", 1);
    assert!(read(&bare).is_ok());
    let radians = bare.replace(",0.5,-1,45", ",0.01,-0.02,0.785");
    let (message, hint) = refused(&radians);
    assert_eq!(
        message,
        "a.csv, line 1: no unit in the name of roll, pitch, yaw, and no value exceeds 2π"
    );
    assert_eq!(hint, "end the names in _deg or _rad");
    assert!(read(&bare.replace(",0.5,-1,45", ",0,0,0")).is_ok());
}

fn refused(text: &str) -> (String, String) {
    let e = read(text).unwrap_err();
    assert!(e.code() == 2);
    (e.to_string(), e.advice().unwrap_or_default())
}

fn doubted(text: &str) -> Vec<String> {
    read(text).unwrap().1
}

#[test]
fn a_plain_file_is_read_without_a_doubt() {
    let (t, warnings) = read(&drive(None)).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((t.start_s(), t.end_s()), (0.0, 9.5));
    let state = t.state(3.0);
    let rpy = RollPitchYaw::from_quat(state.q_b_n);
    assert!((rpy.roll / DEG - 0.5).abs() < 1e-9 && (rpy.yaw / DEG - 45.0).abs() < 1e-9);
    assert!(
        (state.v_n - DVec3::new(5.559, 5.565, 0.0)).length() < 0.01,
        "{}",
        state.v_n
    );
}

#[test]
fn headings_to_360_longitudes_across_180_and_other_names_mean_the_same() {
    let text: String = (0..8)
        .map(|k| {
            format!(
                "{k}; {}; {}; 10; 0; 0; {}\n",
                -20.0,
                180.0003 - 1e-4 * f64::from(k),
                265 + 2 * (k % 2)
            )
        })
        .collect();
    let head = "# made by hand\n\"time_s\"; latitude; longitude_deg; alt_m; roll_deg; pitch_deg; heading_deg\n";
    let (t, warnings) = read(&(head.to_owned() + &text)).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert!((t.state(7.0).lon / DEG - 179.9996).abs() < 1e-9);
    assert!((RollPitchYaw::from_quat(t.state(4.0).q_b_n).yaw / DEG + 95.0).abs() < 1e-9);
}

#[test]
fn bad_cells_rows_and_headers_are_refused_with_their_line() {
    let message = |k, row: &str| refused(&drive(Some((k, row)))).0;
    assert_eq!(
        message(5, "2.5,abc,6.6,400,0,0,45"),
        "a.csv, line 7: column \"lat_deg\": \"abc\" is not a number"
    );
    assert_eq!(
        message(5, "2.5,46.5,nan,400,0,0,45"),
        "a.csv, line 7: column \"lon_deg\": \"nan\" is not a finite number"
    );
    assert_eq!(
        message(5, "2.5,46.5,6.6,400,0,0"),
        "a.csv, line 7: 6 values, but 7 columns"
    );
    assert_eq!(
        message(5, "2.5,96.5,6.6,400,0,0,45"),
        "a.csv, line 7: column \"lat_deg\": 96.5 is not a latitude within ±89.9"
    );
    assert_eq!(
        message(5, "2.5,46.5,6.6,400,0,95,45"),
        "a.csv, line 7: column \"pitch_deg\": 95 is not a pitch angle"
    );
    assert_eq!(
        message(5, "2.5,46.5,6.6,400,0,0,365"),
        "a.csv, line 7: column \"yaw_deg\": 365 is not a heading"
    );
    let (text, hint) =
        refused("t_s,lat_deg,lon_deg,h_m,rol_deg,pitch_deg,yaw_deg\n0,1,2,3,4,5,6\n");
    assert_eq!(text, "a.csv, line 1: unknown column \"rol_deg\"");
    assert_eq!(hint, "did you mean \"roll_deg\"?");
    let (text, hint) = refused("t_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg\n0,1,2,3,4,5\n");
    assert_eq!(text, "a.csv, line 1: column yaw_deg is missing");
    assert!(hint.starts_with("a trajectory has the columns t_s, lat_deg"));
    let (text, _) = refused("t_s,roll_deg,pitch_deg,yaw_deg\n0,1,2,3\n");
    assert_eq!(
        text,
        "a.csv, line 1: columns lat_deg, lon_deg, h_m are missing"
    );
    let (text, _) = refused("t_s,lat_deg,latitude_deg,lon_deg,h_m\n0,1,2,3,4\n");
    assert_eq!(
        text,
        "a.csv, line 1: columns \"lat_deg\" and \"latitude_deg\" both give lat_deg"
    );
    assert_eq!(
        refused("0,1,2,3\n").0,
        "a.csv, line 1: no header with column names, found \"0,1,2,3\""
    );
    assert_eq!(refused(HEADER).0, "a.csv: no rows in it");
}

#[test]
fn rows_without_a_trajectory_through_them_are_refused_with_their_line() {
    let (text, hint) = refused(&drive(Some((5, "1.5,46.500125,6.60018125,400,0,0,45"))));
    assert_eq!(
        text,
        "a.csv, line 7: time goes from 2 s to 1.5 s: it must increase"
    );
    assert!(hint.contains("sort by time"));
    assert_eq!(
        refused(&drive(Some((5, "2,46.500125,6.60018125,400,0,0,45")))).0,
        "a.csv, line 7: time goes from 2 s to 2 s: it must increase"
    );
    let (text, hint) = refused(&drive(Some((5, "2.5,46.500125,6.60018125,400,0,0,125"))));
    assert_eq!(
        text,
        "a.csv, line 7: attitude turns 80.0° between 2 s and 2.5 s: more than 60°"
    );
    assert!(hint.contains("wrong column or unit"));
    assert_eq!(
        refused(&drive(Some((5, "2.5,6.60018125,46.500125,400,0,0,45")))).0,
        "a.csv, line 7: position jumps by 5635241 m in 0.5 s"
    );
    let (text, _) = refused(&format!(
        "{HEADER}0.2,1,2,3,0,0,0\n0.3,1,2,3,0,0,0\n0.4,2,2,3,0,0,0\n"
    ));
    assert!(text.ends_with(" m in 0.1 s"), "{text}");
    let (text, _) = refused(&format!(
        "{HEADER}0,1,2,3,0,0,0\n1,1,2,3,0,0,0\n2,1,2,3,0,0,0\n"
    ));
    assert_eq!(
        text,
        "a.csv, line 4: 3 samples: a trajectory needs at least 4"
    );
    let rows: String = (0..5).map(|k| format!("{k},89.95,2,3,0,0,0\n")).collect();
    assert_eq!(
        refused(&(HEADER.to_owned() + &rows)).0,
        "a.csv, line 2: column \"lat_deg\": 89.95 is not a latitude within ±89.9"
    );
}

#[test]
fn doubtful_files_are_read_with_a_warning() {
    let text: String = (0..12)
        .map(|k| format!("{k},46.5,{},400,0,0.01,1.5708\n", 6.6 + 1e-4 * f64::from(k)))
        .collect();
    assert_eq!(
        doubted(&(HEADER.to_owned() + &text)),
        [
            "a.csv: yaw is 88° from the mean course, 0.0° when read in radians (name the column yaw_rad)"
        ]
    );
    // Level and northbound: zeros are zeros, and 1.5° of heading is what the path has.
    let north: String = (0..12)
        .map(|k| format!("{k},{},6.6,400,0,0.5,1.5\n", 46.5 + 1e-4 * f64::from(k)))
        .collect();
    assert_eq!(doubted(&(HEADER.to_owned() + &north)), [""; 0]);
    let rad: String = (0..12)
        .map(|k| format!("{k},0.8116,{},400,0,0,90\n", 0.1152 + 1e-6 * f64::from(k)))
        .collect();
    assert_eq!(
        doubted(&(HEADER.to_owned() + &rad)),
        [
            "a.csv: latitude and longitude never exceed π: radians? Then name the columns lat_rad, lon_rad"
        ]
    );
    let slow: String = (0..6)
        .map(|k| format!("{},46.5,6.6,400,0,0,90\n", 5 * k))
        .collect();
    assert_eq!(
        doubted(&(HEADER.to_owned() + &slow)),
        ["a.csv: rows are 5 s apart: the path between is a guess"]
    );
    let lines = drive(None);
    let is_kept = |line: &&str| !["4,", "4.5,", "5,"].iter().any(|t| line.starts_with(t));
    let gap: Vec<&str> = lines.lines().filter(is_kept).collect();
    let gap = gap.join("\n");
    assert_eq!(
        doubted(&gap),
        ["a.csv, line 10: gap of 2.000 s before 5.5 s: the path in it is a guess"]
    );
    let extra: String = drive(None)
        .lines()
        .enumerate()
        .map(|(i, l)| format!("{l},{}\n", if i == 0 { "gnss" } else { "1" }))
        .collect();
    assert_eq!(doubted(&extra), ["a.csv: columns not used: gnss"]);
}

#[test]
fn velocities_that_contradict_the_positions_are_said() {
    let with = |v: [&str; 3]| -> String {
        let columns = |i: usize| {
            if i == 0 {
                "v_n_m_s,v_e_m_s,v_d_m_s".to_owned()
            } else {
                v.join(",")
            }
        };
        drive(None)
            .lines()
            .enumerate()
            .map(|(i, l)| format!("{l},{}\n", columns(i)))
            .collect()
    };
    assert_eq!(doubted(&with(["5.56", "5.56", "0"])), [""; 0]);
    let wrong = doubted(&with(["5.56", "-5.56", "0"]));
    assert!(wrong[0].starts_with("a.csv, line "), "{wrong:?}");
    assert!(
        wrong[0].contains("velocity columns differ") && wrong[0].contains("by 11.12"),
        "{wrong:?}"
    );
}

#[test]
fn local_coordinates_need_and_use_an_origin() {
    let rows: String = (0..6)
        .map(|k| format!("{k},{},{},-2,0,0,45\n", 3 * k, 4 * k))
        .collect();
    let text = format!("t_s,n_m,e_m,d_m,roll_deg,pitch_deg,yaw_deg\n{rows}");
    let (message, hint) = refused(&text);
    assert_eq!(
        message,
        "a.csv: local coordinates need an origin on the Earth"
    );
    assert!(hint.starts_with("give --origin") && hint.contains("# origin:"));
    let origin = Some([-30.0 * DEG, 150.0 * DEG, 100.0]);
    let (from_option, _) = read_with(&text, origin).unwrap();
    let (from_line, _) = read(&format!("# origin: -30, 150, 100\n{text}")).unwrap();
    let state = from_option.state(2.5);
    assert_eq!(state, from_line.state(2.5));
    assert!(
        (state.v_n - DVec3::new(3.0, 4.0, 0.0)).length() < 1e-4,
        "{}",
        state.v_n
    );
    // 12.5 m away the plane is 12.5²/2R = 1e-5 m above the ellipsoid.
    assert!((state.h - 102.0).abs() < 2e-5, "{}", state.h);
}

#[test]
fn without_attitude_heading_and_pitch_follow_the_path() {
    // 10 s at rest, then a quarter circle of 50 m at 5 m/s climbing at 10 %, then rest.
    let place = |t: f64| {
        let s = (t - 10.0).clamp(0.0, 15.0) / 10.0;
        (50.0 * s.sin(), 50.0 * (1.0 - s.cos()), -5.0 * s)
    };
    let rows: String = (0..=70)
        .map(|k| 0.5 * f64::from(k))
        .map(|t| (t, place(t)))
        .map(|(t, (n, e, d))| format!("{t},{n},{e},{d}\n"))
        .collect();
    let (t, warnings) = read(&format!("# origin: 40, 3, 0\nt_s,n_m,e_m,d_m\n{rows}")).unwrap();
    assert_eq!(warnings.len(), 1);
    assert_eq!(
        warnings[0],
        "a.csv: no attitude columns: heading and pitch follow the path, roll is 0"
    );
    let attitude = |t_s: f64| RollPitchYaw::from_quat(t.state(t_s).q_b_n);
    assert!(
        (attitude(20.0).yaw - 1.0).abs() < 0.01
            && (attitude(20.0).pitch - 0.1_f64.atan()).abs() < 0.005
    );
    assert!(
        attitude(2.0).yaw.abs() < 0.3
            && (attitude(33.0).yaw - 1.5).abs() < 0.3
            && attitude(20.0).roll.abs() < 1e-3
    );
}

/// A circle of 100 m at 10 m/s in steps of 0.2 and 0.8 s by turns: the chord over both is 0.03 rad off the heading at the
/// row between them, that of the first step 0.01 rad off the heading at the start. What a parabola leaves is of the order
/// 0.1³ · 0.2 · 0.8 · 0.6/24 rad at a row, and of 0.1³ at the ends.
#[test]
fn the_heading_is_that_of_the_path_where_rows_are_uneven() {
    let time = |k: u32| f64::from(k / 2) + if k.is_multiple_of(2) { 0.0 } else { 0.2 };
    let row = |t: f64| {
        format!(
            "{t},{},{},0\n",
            100.0 * (0.1 * t).sin(),
            100.0 * (1.0 - (0.1 * t).cos())
        )
    };
    let rows: String = (0..=40).map(|k| row(time(k))).collect();
    let (t, _) = read(&format!("# origin: 40, 3, 0\nt_s,n_m,e_m,d_m\n{rows}")).unwrap();
    for k in 0..=40 {
        let off = RollPitchYaw::from_quat(t.state(time(k)).q_b_n).yaw - 0.1 * time(k);
        assert!(off.abs() < 1e-3, "{off} rad at {} s", time(k));
    }
}

#[test]
fn what_is_written_reads_back_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let (t, _) = read(&drive(None)).unwrap();
    {
        let path = dir.path().join("t.csv");
        std::fs::write(&path, csv(&t, Some(10.0))).unwrap();
        let (back, warnings) = load(&path, None).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!((back.knots().len(), back.end_s()), (96, 9.5));
        let (a, b) = (t.state(4.77), back.state(4.77));
        assert!(
            (a.v_n - b.v_n).length() < 1e-6 && (a.lat - b.lat).abs() < 1e-14,
            "{}",
            a.v_n - b.v_n
        );
    }
    let path = dir.path().join("knots.csv");
    std::fs::write(&path, csv(&t, None)).unwrap();
    assert_eq!(load(&path, None).unwrap().0.knots(), t.knots());
    let e = load(&dir.path().join("t.xyz"), None).unwrap_err();
    assert!(
        e.to_string()
            .contains("t.xyz: a trajectory file ends in .toml"),
        "{e}"
    );
    let e = load(&dir.path().join("none.csv"), None).unwrap_err();
    assert!(
        e.code() == 2 && e.to_string().contains("none.csv: No such file"),
        "{e}"
    );
}

/// One stamp in seconds of the epoch makes no trajectory of 53 years: 8 TB of samples were asked for.
#[test]
fn a_far_time_stamp_is_refused_with_its_line_in_every_format() {
    let text = drive(Some((19, "1700000000,46.5005,6.6007,400,0.5,-1,45")));
    let (message, hint) = refused(&text);
    assert_eq!(
        message,
        "a.csv, line 21: time goes from 9 s to 1700000000 s; at most a day"
    );
    assert!(hint.starts_with("a damaged time stamp"));
    let tum: String = (0..6)
        .map(|k| {
            format!(
                "{} 0 0 0 0 0 0 1\n",
                if k == 5 { 1e12 } else { f64::from(k) }
            )
        })
        .collect();
    let tum = rows(
        "a.tum",
        &format!("# origin: 45, 7, 0\n{tum}"),
        "tum",
        None,
        false,
    );
    let e = tum.unwrap().trajectory().unwrap_err().to_string();
    assert!(
        e.starts_with("a.tum, line 7: time goes from 4 s to 1000000000000 s"),
        "{e}"
    );
    let point = |month: u32, second: u32| {
        format!(
            "<trkpt lat='46' lon='7'><ele>5</ele><time>2024-{month:02}-01T00:00:{second:02}Z</time></trkpt>\n"
        )
    };
    let track = |last: u32| {
        let points: String = (0..5)
            .map(|k| point(if k == 4 { last } else { 2 }, k))
            .collect();
        format!("<gpx>{points}</gpx>")
    };
    let e = gpx("a.gpx", &track(0)).unwrap_err().to_string();
    assert_eq!(
        e,
        "a.gpx, line 5: column \"time\": the track point does not have it, or not as a number"
    );
    let e = gpx("a.gpx", &track(4))
        .unwrap()
        .trajectory()
        .unwrap_err()
        .to_string();
    assert!(
        e.starts_with("a.gpx, line 5: time goes from 3 s to 5184004 s"),
        "{e}"
    );
}

/// What CSV refuses, the other formats refuse too.
#[test]
fn jumps_and_heights_of_other_formats_are_refused_as_those_of_tables() {
    let tum = |x: f64| {
        let place = |k: i32| if k == 5 { x } else { f64::from(k) };
        let text: String = (0..9)
            .map(|k| format!("{k} {} 0 0 0 0 0 1\n", place(k)))
            .collect();
        let text = format!("# origin: 45, 7, 0\n{text}");
        let rows = rows("a.tum", &text, "tum", None, false);
        rows.unwrap().trajectory().unwrap_err().to_string()
    };
    assert!(
        tum(-1e90).starts_with("a.tum, line 7: height "),
        "{}",
        tum(-1e90)
    );
    assert_eq!(
        tum(111_000.0),
        "a.tum, line 7: position jumps by 110996 m in 1 s"
    );
    let point = |k: u32| {
        let h = if k == 3 { 4e7 } else { 5.0 };
        format!(
            "<trkpt lat='46' lon='7'><ele>{h}</ele><time>2024-02-01T00:00:0{k}Z</time></trkpt>\n"
        )
    };
    let points: String = (0..6).map(point).collect();
    let e = gpx("a.gpx", &format!("<gpx>{points}</gpx>"))
        .unwrap()
        .trajectory()
        .unwrap_err()
        .to_string();
    assert_eq!(
        e,
        "a.gpx, line 4: height 40000000.0 m is not within −12 to 1000 km"
    );
}

/// A curved drive in hills: course, climb and attitude agree, until columns are changed.
fn hills(row: impl Fn([f64; 7]) -> [f64; 7]) -> Vec<String> {
    let (mut n, mut e, mut h) = (0.0, 0.0, 400.0);
    let mut text = HEADER.to_owned();
    for k in 0..600 {
        let t = 0.5 * f64::from(k);
        let (yaw, pitch) = (0.02 * t, 0.05 * (0.05 * t).sin());
        let cells = row([
            t,
            46.5 + n / 111_150.0,
            6.5 + e / 76_700.0,
            h,
            0.0,
            pitch / DEG,
            yaw.sin().atan2(yaw.cos()) / DEG,
        ]);
        text += &(cells.map(|x| x.to_string()).join(",") + "\n");
        let middle: f64 = yaw + 0.005;
        (n, e, h) = (
            n + 5.0 * middle.cos(),
            e + 5.0 * middle.sin(),
            h + 5.0 * pitch.tan(),
        );
    }
    doubted(&text)
}

#[test]
fn other_conventions_of_heading_and_height_are_doubted() {
    assert_eq!(hills(|row| row), [""; 0]);
    // unwrapped: the same angles
    assert_eq!(
        hills(|[t, lat, lon, h, r, p, y]| [
            t,
            lat,
            lon,
            h,
            r,
            p,
            if y > 0.0 { y - 360.0 } else { y }
        ]),
        [""; 0]
    );
    let said = |row: fn([f64; 7]) -> [f64; 7], words: &str| {
        let found = hills(row);
        assert!(
            found.len() == 1 && found[0].contains(words),
            "{words}: {found:?}"
        );
    };
    said(
        |[t, lat, lon, h, r, p, y]| [t, lat, lon, h, r, p, -y],
        "anticlockwise from north",
    );
    said(
        |[t, lat, lon, h, r, p, y]| [t, lat, lon, h, r, p, 90.0 - y],
        "anticlockwise from east",
    );
    said(
        |[t, lat, lon, h, r, p, y]| [t, lon, lat, h, r, p, y],
        "latitude and longitude swapped",
    );
    said(
        |[t, lat, lon, h, r, p, y]| {
            [
                t,
                lat,
                lon,
                h,
                r,
                p,
                if y > 0.0 { y - 180.0 } else { y + 180.0 },
            ]
        },
        "backwards",
    );
}

/// A reference with a glitch of 2.4 km, a row without attitude and one far stamp is used but for these.
#[test]
fn references_are_used_but_for_what_jumps() {
    let row = |k: usize| {
        let t = 0.1 * k as f64;
        let (lon, roll) = match k {
            300..303 => (6.6 + 0.03, "0.5"),
            450 => (6.6, "nan"),
            _ => (6.6, "0.5"),
        };
        let t = if k == 500 { 1.7e9 } else { t };
        format!("{t},{},{lon},400,{roll},-1,0\n", 46.5 + 1e-5 * t.min(1e3))
    };
    let text = HEADER.to_owned() + &(0..600).map(row).collect::<String>();
    assert!(read(&text.replace("nan", "0.5")).is_err());
    let parsed = rows("a.csv", &text, "csv", None, true).unwrap();
    let (reference, warnings) = parsed.reference().unwrap();
    let known = |t: f64| reference.state(t).is_some();
    assert_eq!(
        [10.0, 28.8, 30.1, 31.5, 45.02, 49.8, 50.05, 55.0].map(known),
        [true, true, false, true, true, true, false, true]
    );
    let said = warnings;
    assert_eq!(
        said[0],
        "a.csv: 1 row left out: values not finite, or out of range"
    );
    assert!(
        said[1].starts_with("a.csv, line 302: a jump of 2") && said[1].contains("and 3 more"),
        "{said:?}"
    );
    // one that jumps all the time is no reference
    let mad: String = (0..600)
        .map(|k| format!("{},{},6.6,400,0,0,0\n", 0.1 * f64::from(k), 46 + k % 2))
        .collect();
    let parsed = rows("a.csv", &(HEADER.to_owned() + &mad), "csv", None, true).unwrap();
    assert!(parsed.reference().is_err());
}
