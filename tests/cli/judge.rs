//! `nav-sim judge` as a user runs it.

use crate::common::drive::{MODEL, Place, number, off, place_with};

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

fn place() -> Place {
    let place = place_with(DRIVE, MODEL);
    place.done("trajectory generate drive.toml --rate-hz 10 -o reference.csv");
    place
}

/// The rows of the reference with errors of `scale` times (1, 1, 2) m down to the centimetre, of alternating sign and of
/// periods that have nothing in common, and the standard deviations that are stated of them.
fn rows(place: &Place, scale: f64) -> Vec<Vec<f64>> {
    let sizes = [9e-6, 13e-6, 2.0, 0.05, 0.05, 0.08, 0.1, 0.1, 0.5];
    let periods = [3.1, 3.7, 4.3, 5.3, 5.9, 6.1, 6.7, 7.1, 7.3];
    let sigmas = [1.0, 1.0, 2.0, 0.05, 0.05, 0.08, 0.1, 0.1, 0.5];
    let mut rows = place.table("reference.csv");
    for (k, row) in rows.iter_mut().enumerate() {
        for i in 0..9 {
            let wave = (std::f64::consts::TAU * k as f64 / periods[i]).sin();
            row[i + 1] += scale * sizes[i] * 2.0_f64.sqrt() * wave;
        }
        row.extend(sigmas);
    }
    rows
}

fn write(place: &Place, name: &str, head: &str, rows: &[Vec<f64>]) {
    let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let lines: Vec<String> = rows.iter().map(line).collect();
    place.write(name, format!("{head}\n{}\n", lines.join("\n")));
}

/// Judges a file of these rows.
fn judged(place: &Place, rows: &[Vec<f64>], options: &str) -> serde_json::Value {
    write(place, "a.csv", &format!("{HEAD},{SIGMAS}"), rows);
    place.judged(&format!(
        "judge a.csv --reference reference.csv -o out {options}"
    ));
    place.json("out/summary.json")
}

#[test]
fn a_solution_is_judged_and_its_files_hold_what_they_say() {
    let place = place();
    let told = judged(&place, &rows(&place, 1.0), "--outage 60:92");
    assert_eq!(told["verdict"]["kind"], "consistent");
    // waves of amplitude √2 times the sigmas
    for state in ["pos_d_m", "vel_n_m_s", "yaw_deg"] {
        let ratio = number(&told, &format!("/error_over_sigma/{state}"));
        assert!((ratio - 1.0).abs() < 0.03, "{state}: {ratio}");
    }
    let errors = place.table("out/errors.csv");
    assert_eq!(errors.len() as f64, number(&told, "/rows"));
    // the last row without the fix at 92 s, to the digits of the file
    let end = errors.iter().rfind(|row| row[0] < 92.0).unwrap();
    let horizontal = number(&told, "/outages/0/horizontal_error_end_m");
    assert!((horizontal - end[1].hypot(end[2])).abs() < 2e-6);
    let told = judged(&place, &rows(&place, 2.0), "");
    assert_eq!(told["verdict"]["kind"], "overconfident");
    place.ends("judge a.csv --reference reference.csv -o out", 3);
}

/// The same standard deviations in files of their own: a table, and matrices of position, velocity and rotation (rad²).
#[test]
fn standard_deviations_may_be_in_a_file_of_their_own() {
    let place = place();
    let own = rows(&place, 1.0);
    let beside = number(&judged(&place, &own, ""), "/nees/mean");
    let columns = |range: std::ops::Range<usize>| -> Vec<Vec<f64>> {
        own.iter()
            .map(|row| [&row[..1], &row[range.clone()]].concat())
            .collect()
    };
    write(&place, "bare.csv", HEAD, &columns(1..10));
    let table = columns(10..19);
    write(&place, "sigmas.csv", &format!("t_s,{SIGMAS}"), &table);
    let matrix = |row: &Vec<f64>| {
        let mut cells = vec![0.0; 82];
        cells[0] = row[0];
        for i in 0..9 {
            let sigma = if i < 6 {
                row[i + 1]
            } else {
                row[i + 1].to_radians()
            };
            cells[1 + 10 * i] = sigma.powi(2);
        }
        cells
    };
    let mut matrices: Vec<Vec<f64>> = table.iter().map(matrix).collect();
    let head = "# t_s, then nine rows of nine";
    write(&place, "p.txt", head, &matrices);
    let judge = "judge bare.csv --reference reference.csv -o out";
    for (file, allowed) in [("sigmas.csv", 1e-9), ("p.txt", 1e-6)] {
        place.done(&format!("{judge} --covariance {file}"));
        let nees = number(&place.json("out/summary.json"), "/nees/mean");
        assert!(off(nees, beside) < allowed, "{file}: {nees} {beside}");
    }
    let alone = place.done(judge).stdout;
    assert!(
        alone.contains("no standard deviations in the solution"),
        "{alone}"
    );
    matrices[3][2] = 9.0;
    write(&place, "p.txt", head, &matrices);
    let refused = place.ends(&format!("{judge} --covariance p.txt"), 2).stderr;
    let message = "p.txt, line 5: the covariance is not symmetric and positive definite";
    assert!(refused.contains(message), "{refused}");
}

/// A clock that has nothing in common with the reference's is refused with the option that brings them together.
#[test]
fn the_hint_for_another_clock_works() {
    let place = place();
    let mut own = rows(&place, 1.0);
    own.iter_mut().for_each(|row| row[0] += 50_000.0);
    write(&place, "a.csv", &format!("{HEAD},{SIGMAS}"), &own);
    let judge = "judge a.csv --reference reference.csv -o out";
    let refused = place.ends(judge, 2).stderr;
    let option = refused
        .split("hint: ")
        .nth(1)
        .unwrap()
        .split_whitespace()
        .next();
    assert_eq!(option, Some("--reference-delay=-50000"));
    place.done(&format!("{judge} {}", option.unwrap()));
    assert_eq!(
        place.json("out/summary.json")["verdict"]["kind"],
        "consistent"
    );
}
