mod profiles;

use super::*;
use crate::io::tests::{Files, answers, told};
use crate::io::toml_file::TomlSource;
use approx::assert_abs_diff_eq;
use glam::DVec3;
use nav_sim_navigation::frames::RollPitchYaw;
use nav_sim_signal::units::DEG;

const HEADER: &str = "t_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg,yaw_deg\n";

fn read(text: &str) -> Result<(Trajectory, Vec<String>), Failure> {
    read_with(text, None)
}

fn read_with(text: &str, origin: Option<[f64; 3]>) -> Result<(Trajectory, Vec<String>), Failure> {
    rows("a.csv", text, "csv", origin, Purpose::Drive)?.trajectory()
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

#[test]
fn attitude_without_a_unit_is_degrees_where_radians_cannot_be() {
    let bare = drive(None).replacen("roll_deg,pitch_deg,yaw_deg", "Roll,pitch,yaw", 1);
    for attitude in [",0.5,-1,45", ",0,0,0"] {
        assert!(read(&bare.replace(",0.5,-1,45", attitude)).is_ok());
    }
    let radians = bare.replace(",0.5,-1,45", ",0.01,-0.02,0.785");
    insta::assert_snapshot!(told(&read(&radians).unwrap_err()));
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
    let v_n = state.v_n;
    assert!(
        (v_n - DVec3::new(5.559, 5.565, 0.0)).length() < 0.01,
        "{v_n}"
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
    assert_abs_diff_eq!(t.state(7.0).lon / DEG, 179.9996, epsilon = 1e-9);
    assert!((RollPitchYaw::from_quat(t.state(4.0).q_b_n).yaw / DEG + 95.0).abs() < 1e-9);
}

/// Cells, headers, and rows that no trajectory goes through. (One stamp in seconds of the epoch made a trajectory of 53 years:
/// 8 TB of samples were asked for.)
#[test]
fn bad_tables_are_refused_with_their_line() {
    let cells = [
        "2.5,abc,6.6,400,0,0,45",
        "2.5,46.5,nan,400,0,0,45",
        "2.5,46.5,6.6,400,0,0",
        "2.5,96.5,6.6,400,0,0,45",
        "2.5,46.5,6.6,400,0,95,45",
        "2.5,46.5,6.6,400,0,0,365",
        "1.5,46.500125,6.60018125,400,0,0,45",
        "2,46.500125,6.60018125,400,0,0,45",
        "1700000000,46.500125,6.60018125,400,0,0,45",
        "2.5,46.500125,6.60018125,400,0,0,125",
        "2.5,6.60018125,46.500125,400,0,0,45",
    ]
    .map(|row| (row.to_owned(), drive(Some((5, row)))));
    let texts = [
        "t_s,lat_deg,lon_deg,h_m,rol_deg,pitch_deg,yaw_deg\n0,1,2,3,4,5,6",
        "t_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg\n0,1,2,3,4,5",
        "t_s,roll_deg,pitch_deg,yaw_deg\n0,1,2,3",
        "t_s,lat_deg,latitude_deg,lon_deg,h_m\n0,1,2,3,4",
        "0,1,2,3",
        HEADER,
        "t_s,lat_deg,lon_deg,h_m\n0.2,1,2,3\n0.3,1,2,3\n0.4,2,2,3",
        "t_s,lat_deg,lon_deg,h_m\n0,1,2,3\n1,1,2,3\n2,1,2,3",
        "t_s,lat_deg,lon_deg,h_m\n0,89.95,2,3\n1,89.95,2,3\n2,89.95,2,3\n3,89.95,2,3",
        "t_s,n_m,e_m,d_m,roll_deg,pitch_deg,yaw_deg\n0,0,0,-2,0,0,45",
    ]
    .map(|text| (text.to_owned(), text.to_owned()));
    let of_csv = cells
        .into_iter()
        .chain(texts)
        .map(|(name, text)| (name, read(&text)));
    // what CSV refuses, the other formats refuse too
    let of_tum = [(5, 1e12, 5.0), (5, 5.0, -1e90), (5, 5.0, 111_000.0)].map(|(at, t, x)| {
        let row = |k: i32| {
            if k == at {
                (t, x)
            } else {
                (f64::from(k), f64::from(k))
            }
        };
        let rows = (0..9).map(|k| format!("{} {} 0 0 0 0 0 1\n", row(k).0, row(k).1));
        let text = format!("# origin: 45, 7, 0\n{}", rows.collect::<String>());
        let read =
            super::rows("a.tum", &text, "tum", None, Purpose::Drive).and_then(Rows::trajectory);
        (format!("row {at} at {t} s and {x} m"), read)
    });
    let all = of_csv.chain(of_tum);
    insta::assert_snapshot!(answers(
        all.map(|(name, read)| (name, read.map_err(|e| told(&e))))
    ));
}

#[test]
fn doubtful_files_are_read_with_a_warning() {
    let of_rows = |n: u32, row: &dyn Fn(f64) -> String| {
        let rows: Vec<String> = (0..n).map(|k| row(f64::from(k))).collect();
        format!("{HEADER}{}\n", rows.join("\n"))
    };
    let lines = drive(None);
    let is_kept = |line: &&str| !["4,", "4.5,", "5,"].iter().any(|t| line.starts_with(t));
    let gap: Vec<&str> = lines.lines().filter(is_kept).collect();
    let all = [
        (
            "radians",
            of_rows(12, &|k| {
                format!("{k},46.5,{},400,0,0.01,1.5708", 6.6 + 1e-4 * k)
            }),
        ),
        // level and northbound: zeros are zeros, and 1.5° of heading is what the path has
        (
            "no doubt",
            of_rows(12, &|k| {
                format!("{k},{},6.6,400,0,0.5,1.5", 46.5 + 1e-4 * k)
            }),
        ),
        (
            "places",
            of_rows(12, &|k| {
                format!("{k},0.8116,{},400,0,0,90", 0.1152 + 1e-6 * k)
            }),
        ),
        (
            "slow",
            of_rows(6, &|k| format!("{},46.5,6.6,400,0,0,90", 5.0 * k)),
        ),
        ("gap", gap.join("\n")),
        ("column", with_columns("gnss", "1")),
        (
            "velocities",
            with_columns("v_n_m_s,v_e_m_s,v_d_m_s", "5.56,5.56,0"),
        ),
        (
            "contradicted",
            with_columns("v_n_m_s,v_e_m_s,v_d_m_s", "5.56,-5.56,0"),
        ),
    ];
    insta::assert_snapshot!(answers(
        all.map(|(name, text)| (name, Err::<(), _>(doubted(&text).join("\n"))))
    ));
}

/// The plain drive with columns of the same values in all rows.
fn with_columns(names: &str, values: &str) -> String {
    let drive = drive(None);
    let (head, rows) = drive.split_once('\n').unwrap();
    let rows: String = rows
        .lines()
        .map(|row| format!("{row},{values}\n"))
        .collect();
    format!("{head},{names}\n{rows}")
}

#[test]
fn local_coordinates_need_and_use_an_origin() {
    let rows: String = (0..6)
        .map(|k| format!("{k},{},{},-2,0,0,45\n", 3 * k, 4 * k))
        .collect();
    let text = format!("t_s,n_m,e_m,d_m,roll_deg,pitch_deg,yaw_deg\n{rows}");

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
    assert_abs_diff_eq!(state.h, 102.0, epsilon = 2e-5);
}

#[test]
fn without_attitude_heading_and_pitch_follow_the_path() {
    // 10 s at rest, then a quarter circle of 50 m at 5 m/s climbing at 10 %, then rest.
    let place = |t: f64| {
        let s = (t - 10.0).clamp(0.0, 15.0) / 10.0;
        (50.0 * s.sin(), 50.0 * (1.0 - s.cos()), -5.0 * s)
    };
    let (t, warnings) = read(&local((0..=70).map(|k| 0.5 * f64::from(k)), place)).unwrap();
    assert_eq!(
        warnings,
        ["a.csv: no attitude columns: heading and pitch follow the path, roll is 0"]
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
    let circle = |t: f64| {
        (
            100.0 * (0.1 * t).sin(),
            100.0 * (1.0 - (0.1 * t).cos()),
            0.0,
        )
    };
    let (t, _) = read(&local((0..=40).map(time), circle)).unwrap();
    for k in 0..=40 {
        let off = RollPitchYaw::from_quat(t.state(time(k)).q_b_n).yaw - 0.1 * time(k);
        assert!(off.abs() < 1e-3, "{off} rad at {} s", time(k));
    }
}

#[test]
fn what_is_written_reads_back_the_same() {
    let files = Files::new();
    let (t, _) = read(&drive(None)).unwrap();
    let (back, warnings) = load(&files.add("t.csv", csv(&t, Some(10.0))), None).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((back.knots().len(), back.end_s()), (96, 9.5));
    let (a, b) = (t.state(4.77), back.state(4.77));
    let apart = a.v_n - b.v_n;
    assert!(
        apart.length() < 1e-6 && (a.lat - b.lat).abs() < 1e-14,
        "{apart}"
    );
    let (knots, _) = load(&files.add("knots.csv", csv(&t, None)), None).unwrap();
    assert_eq!(knots.knots(), t.knots());
    insta::assert_snapshot!(answers(["t.xyz", "none.csv"].map(|name| {
        let read = load(&files.path().join(name), None);
        (name, read.map_err(|e| files.told(&e)))
    })));
}

/// A curved drive in hills: course, climb and attitude agree, until columns are changed.
fn hills(change: impl Fn(&mut [f64; 7])) -> Vec<String> {
    let (mut n, mut e, mut h) = (0.0, 0.0, 400.0);
    let mut text = HEADER.to_owned();
    for k in 0..600 {
        let t = 0.5 * f64::from(k);
        let (yaw, pitch) = (0.02 * t, 0.05 * (0.05 * t).sin());
        let course = yaw.sin().atan2(yaw.cos()) / DEG;
        let mut cells = [
            t,
            46.5 + n / 111_150.0,
            6.5 + e / 76_700.0,
            h,
            0.0,
            pitch / DEG,
            course,
        ];
        change(&mut cells);
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

/// Positions in local coordinates without attitude.
fn local(times: impl Iterator<Item = f64>, place: impl Fn(f64) -> (f64, f64, f64)) -> String {
    let row = |t: f64| {
        let (n, e, d) = place(t);
        format!("{t},{n},{e},{d}\n")
    };
    let rows: String = times.map(row).collect();
    format!("# origin: 40, 3, 0\nt_s,n_m,e_m,d_m\n{rows}")
}

#[test]
fn other_conventions_of_heading_and_height_are_doubted() {
    type Change = fn(&mut [f64; 7]);
    let cases: [(Change, &str); 6] = [
        (|_| {}, ""),
        // unwrapped: the same angles
        (|row| row[6] -= if row[6] > 0.0 { 360.0 } else { 0.0 }, ""),
        (|row| row[6] = -row[6], "anticlockwise from north"),
        (|row| row[6] = 90.0 - row[6], "anticlockwise from east"),
        (|row| row[6] -= 180.0_f64.copysign(row[6]), "backwards"),
        (|row| row.swap(1, 2), "latitude and longitude swapped"),
    ];
    for (change, words) in cases {
        let found = hills(change);
        assert_eq!(
            found.len(),
            usize::from(!words.is_empty()),
            "{words}: {found:?}"
        );
        assert!(found.concat().contains(words), "{words}: {found:?}");
    }
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
    let parsed = rows("a.csv", &text, "csv", None, Purpose::Reference).unwrap();
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
    let parsed = rows(
        "a.csv",
        &(HEADER.to_owned() + &mad),
        "csv",
        None,
        Purpose::Reference,
    )
    .unwrap();
    assert!(parsed.reference().is_err());
}
