//! `nav-sim judge` as a user runs it.

use crate::common::drive::{MODEL, done, nav_sim, place_with};
use serde_json::Value;
use std::fs;
use std::path::Path;

const DRIVE: &str = "
start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40, speed_m_s = 10 }
segment = [
  { kind = \"straight\", duration_s = 20 },
  { kind = \"turn\", angle_deg = 250, duration_s = 40 },
  { kind = \"accelerate\", to_speed_m_s = 15, duration_s = 10 },
  { kind = \"turn\", angle_deg = -200, duration_s = 40 },
  { kind = \"straight\", duration_s = 30 },
]
";
const HEAD: &str = "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg";
const SIGMAS: &str =
    "sd_n_m,sd_e_m,sd_d_m,sd_vn_m_s,sd_ve_m_s,sd_vd_m_s,sd_roll_deg,sd_pitch_deg,sd_yaw_deg";

fn place() -> tempfile::TempDir {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "trajectory generate drive.toml --rate-hz 10 -o reference.csv",
    );
    place
}

/// The rows of the reference with errors of `scale` times (1, 1, 2) m down to the centimetre, of alternating sign and of
/// periods that have nothing in common, and what a file says of them.
fn rows(place: &Path, scale: f64) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(place.join("reference.csv")).unwrap();
    let wave =
        |k: usize, period: f64| 2.0_f64.sqrt() * (std::f64::consts::TAU * k as f64 / period).sin();
    let error = |k: usize| {
        let sizes = [9e-6, 13e-6, 2.0, 0.05, 0.05, 0.08, 0.1, 0.1, 0.5];
        let periods = [3.1, 3.7, 4.3, 5.3, 5.9, 6.1, 6.7, 7.1, 7.3];
        std::array::from_fn::<f64, 9, _>(|i| scale * sizes[i] * wave(k, periods[i]))
    };
    let row = |(k, line): (usize, &str)| {
        let mut cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        cells
            .iter_mut()
            .skip(1)
            .zip(error(k))
            .for_each(|(cell, e)| *cell += e);
        cells
    };
    text.lines().skip(1).enumerate().map(row).collect()
}

fn write(place: &Path, name: &str, head: &str, rows: &[Vec<f64>]) {
    let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let lines: Vec<String> = rows.iter().map(line).collect();
    fs::write(place.join(name), format!("{head}\n{}\n", lines.join("\n"))).unwrap();
}

fn stated(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let sigmas = [1.0, 1.0, 2.0, 0.05, 0.05, 0.08, 0.1, 0.1, 0.5];
    rows.iter()
        .map(|row| [row.as_slice(), &sigmas].concat())
        .collect()
}

fn summary(place: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(place.join("out/summary.json")).unwrap()).unwrap()
}

#[test]
fn a_solution_is_judged_and_its_files_hold_what_they_say() {
    let place = place();
    let own = rows(place.path(), 1.0);
    write(
        place.path(),
        "a.csv",
        &format!("{HEAD},{SIGMAS}"),
        &stated(&own),
    );
    let ran = done(
        place.path(),
        "judge a.csv --reference reference.csv --outage 60:90 -o out",
    );
    assert!(
        ran.stdout.starts_with("consistent: NEES "),
        "{}",
        ran.stdout
    );
    let told = summary(place.path());
    assert_eq!(told["verdict"]["kind"], "consistent");
    // waves of amplitude √2 times the sigmas
    for state in ["pos_d_m", "vel_n_m_s", "yaw_deg"] {
        let ratio = told["error_over_sigma"][state].as_f64().unwrap();
        assert!((ratio - 1.0).abs() < 0.03, "{state}: {ratio}");
    }
    assert_eq!(told["outages"][0]["end_s"], 90.0);
    let errors = fs::read_to_string(place.path().join("out/errors.csv")).unwrap();
    assert_eq!(
        errors.lines().count(),
        told["rows"].as_u64().unwrap() as usize + 1
    );

    let twice = rows(place.path(), 2.0);
    write(
        place.path(),
        "b.csv",
        &format!("{HEAD},{SIGMAS}"),
        &stated(&twice),
    );
    let ran = nav_sim(place.path(), "judge b.csv --reference reference.csv -o out");
    assert_eq!(ran.code, 3, "{}", ran.stdout);
    assert!(
        ran.stdout.starts_with("overconfident: errors "),
        "{}",
        ran.stdout
    );
}

/// The same standard deviations in files of their own: a table, and matrices of position, velocity and rotation (rad²).
#[test]
fn standard_deviations_may_be_in_a_file_of_their_own() {
    let place = place();
    let own = rows(place.path(), 1.0);
    write(
        place.path(),
        "a.csv",
        &format!("{HEAD},{SIGMAS}"),
        &stated(&own),
    );
    write(place.path(), "bare.csv", HEAD, &own);
    let table: Vec<Vec<f64>> = stated(&own)
        .into_iter()
        .map(|row| [&row[..1], &row[10..]].concat())
        .collect();
    write(place.path(), "sigmas.csv", &format!("t_s,{SIGMAS}"), &table);
    let matrix = |row: &Vec<f64>| {
        let mut cells = vec![row[0]];
        for i in 0..9 {
            let unit = if i < 6 {
                1.0
            } else {
                180.0 / std::f64::consts::PI
            };
            cells.extend((0..9).map(|j| {
                if i == j {
                    (row[i + 1] / unit).powi(2)
                } else {
                    0.0
                }
            }));
        }
        cells
    };
    let matrices: Vec<Vec<f64>> = table.iter().map(matrix).collect();
    write(
        place.path(),
        "p.txt",
        "# t_s, then nine rows of nine",
        &matrices,
    );
    let nees = |solution: &str| {
        done(
            place.path(),
            &format!("judge {solution} --reference reference.csv -o out"),
        );
        summary(place.path())["nees"]["mean"].as_f64().unwrap()
    };
    let beside = nees("a.csv");
    assert!((nees("bare.csv --covariance sigmas.csv") / beside - 1.0).abs() < 1e-9);
    assert!((nees("bare.csv --covariance p.txt") / beside - 1.0).abs() < 1e-6);

    let alone = done(
        place.path(),
        "judge bare.csv --reference reference.csv -o out",
    );
    assert!(
        alone
            .stdout
            .starts_with("undecided: no standard deviations in the solution"),
        "{}",
        alone.stdout
    );
    let mut wrong = matrices;
    wrong[3][2] = 9.0;
    write(
        place.path(),
        "p.txt",
        "# t_s, then nine rows of nine",
        &wrong,
    );
    let refused = nav_sim(
        place.path(),
        "judge bare.csv --covariance p.txt --reference reference.csv -o out",
    );
    assert_eq!(refused.code, 2);
    assert!(
        refused
            .stderr
            .contains("p.txt, line 5: the covariance is not symmetric and positive definite"),
        "{}",
        refused.stderr
    );
}

/// A clock that has nothing in common with the reference's is refused with the option that brings them together.
#[test]
fn the_hint_for_another_clock_works() {
    let place = place();
    let mut own = rows(place.path(), 1.0);
    own.iter_mut().for_each(|row| row[0] += 50_000.0);
    write(
        place.path(),
        "a.csv",
        &format!("{HEAD},{SIGMAS}"),
        &stated(&own),
    );
    let refused = nav_sim(place.path(), "judge a.csv --reference reference.csv -o out");
    assert_eq!(refused.code, 2);
    let hint = refused.stderr.split("hint: ").nth(1).unwrap();
    let option = hint.split_whitespace().next().unwrap();
    assert_eq!(option, "--reference-delay=-50000");
    let ran = done(
        place.path(),
        &format!("judge a.csv --reference reference.csv {option} -o out"),
    );
    assert!(ran.stdout.starts_with("consistent: "), "{}", ran.stdout);
}
