//! Figures of `nav-sim fuse`; what it says and refuses is in `transcripts/drives.md`.

mod clocks;
mod doubts;
mod loggers;
mod mounting;
mod nmea;
mod smooth;

use crate::common::drive::{MODEL, Place, RECORD, number, place_with};
use serde_json::Value;

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

/// A drive recorded in `rec`.
fn recorded_on(drive: &str, model: &str) -> Place {
    let place = place_with(drive, model);
    place.done(RECORD);
    place
}

fn recorded() -> Place {
    recorded_on(DRIVE, MODEL)
}

/// Fuses the recorded samples and fixes, or others, and returns the summary.
fn summary(place: &Place, options: &str) -> Value {
    place.judged(&format!(
        "fuse rec/imu.csv rec/gnss.csv imu.toml -o out {options}"
    ));
    place.json("out/summary.json")
}

/// The last row of the solution of these files and options.
fn end(place: &Place, arguments: &str) -> Vec<f64> {
    place.done(&format!("fuse {arguments} imu.toml -o out"));
    place.table("out/solution.csv").pop().unwrap()
}

#[track_caller]
fn assert_near(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    for (column, (x, y)) in a.iter().zip(b).enumerate() {
        assert!(
            (x - y).abs() <= tolerance * (1.0 + x.abs()),
            "column {column}: {x} {y}"
        );
    }
}

/// Every state of the coarse alignment is as good as it says, at its own epoch.
#[track_caller]
fn assert_start_within_four_sigma(place: &Place) {
    let (errors, solution) = (
        place.table("out/errors.csv"),
        place.table("out/solution.csv"),
    );
    for i in 0..9 {
        // sd_n_m and sd_e_m stand behind the biases
        let sd = solution[0][if i < 2 { 25 + i } else { 10 + i }];
        let error = errors[0][1 + i];
        assert!(error.abs() < 4.0 * sd, "state {i}: {error} against {sd}");
    }
}

#[test]
fn a_fusion_directory_holds_what_the_interface_says() {
    let place = recorded();
    let found = summary(&place, "--reference rec/reference.csv --outage 60:75");
    assert_eq!(number(&found, "/fixes/withheld"), 15.0);
    let outage = &found["outages"][0];
    assert_eq!(number(outage, "/fixes_withheld"), 15.0);
    let drift = number(outage, "/end_from_reference/horizontal_m");
    assert!(
        drift < 4.0 * number(outage, "/end_from_reference/expected_sigma_m"),
        "{outage}"
    );
    assert!(number(&found, "/reference/rmse/pos_n_m") < 10.0);
    assert_start_within_four_sigma(&place);
    assert_eq!(place.json("out/manifest.json")["kind"], "fusion");
    // states of the turn-on bias are not the scale factors of `--filter 21`
    for (options, states, turn_on) in [
        ("", 15.0, 0.0),
        ("--turn-on-bias 0.02,1e-4", 21.0, 6.0),
        ("--filter 21", 21.0, 0.0),
    ] {
        let found = summary(&place, options);
        let count = ["/filter_states", "/turn_on_states"].map(|key| number(&found, key));
        assert_eq!(count, [states, turn_on]);
    }
    // a window before the filter starts withholds nothing
    let found = summary(&place, "--outage 1:3 --outage 60:75");
    assert_eq!(found["outages"].as_array().unwrap().len(), 1);
}

/// The same recording as rates, as increments, as KF-GINS texts, as texts of RTKLIB, of a logger with other axes: one solution,
/// to the digits written.
#[test]
fn rates_increments_and_texts_give_one_solution() {
    let place = recorded();
    let (imu, gnss) = (place.table("rec/imu.csv"), place.table("rec/gnss.csv"));
    let lines = |rows: &[Vec<f64>], line: &dyn Fn(&[f64]) -> String| -> String {
        rows.iter().map(|row| line(row) + "\n").collect()
    };
    let increments = |row: &[f64], between: &str| {
        let cells: Vec<String> = row[1..]
            .iter()
            .map(|x| format!("{:.14}", x * 0.01))
            .collect();
        format!("{:.6}{between}{}", row[0], cells.join(between))
    };
    let fix = |r: &[f64]| {
        format!(
            "{:.10} {:.10} {:.4} {} {} {}",
            r[1], r[2], r[3], r[4], r[5], r[6]
        )
    };
    let head = "t_s,dtheta_x_rad,dtheta_y_rad,dtheta_z_rad,dv_x_m_s,dv_y_m_s,dv_z_m_s\n";
    place.write(
        "inc.csv",
        head.to_owned() + &lines(&imu, &|row| increments(row, ",")),
    );
    place.write("imu.txt", lines(&imu, &|row| increments(row, "  ")));
    // with an odometer's speed, which is not used
    place.write(
        "imu8.txt",
        lines(&imu, &|row| increments(row, "  ") + "  3.25"),
    );
    place.edit("rec/imu.csv", "flu.csv", |k, line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        for i in [2, 3, 5, 6].into_iter().filter(|_| k > 0) {
            cells[i] = format!("-{}", cells[i]).replace("--", "");
        }
        cells.join(",")
    });
    let fixes = lines(&gnss, &|r| format!("{} {}", r[0], fix(r)));
    let columns = "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m\n";
    place.write("gnss.txt", &fixes);
    place.write("pos.csv", columns.to_owned() + &fixes.replace(' ', ","));
    place.edit("pos.csv", "bare.csv", |_, line| {
        line.split(',').take(4).collect::<Vec<_>>().join(",")
    });
    // velocity stands before the deviations
    let full = [0, 1, 2, 3, 7, 8, 9, 4, 5, 6, 10, 11, 12];
    let full = |r: &[f64]| full.map(|i| r[i].to_string()).join(" ");
    place.write("gnss13.txt", lines(&gnss, &full));
    // 2021-02-28 was a Sunday, on which GPS week 2147 began
    let date = |t: f64| {
        let [hours, minutes] = [t / 3600.0, t / 60.0 % 60.0].map(|x| x as u32);
        format!("2021/02/28 {hours:02}:{minutes:02}:{:06.3}", t % 60.0)
    };
    let head = "% program   : RTKLIB\n%  GPST   latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n";
    let rtklib = |r: &[f64], time: String| {
        let cells = fix(r);
        let (at, sd) = cells
            .match_indices(' ')
            .nth(2)
            .map(|(i, _)| cells.split_at(i))
            .unwrap();
        format!("{time} {at} 5 8{sd} 0 0 0 0 0")
    };
    let dated = lines(&gnss, &|r| rtklib(r, date(r[0])));
    let weeks = lines(&gnss, &|r| rtklib(r, format!("2147 {:.3}", r[0])));
    place.write("dated.pos", head.to_owned() + &dated);
    place.write("weeks.pos", head.to_owned() + &weeks);
    let solution = |files: &str| end(&place, &format!("{files} --initial rec/initial.toml"));
    let positions = solution("rec/imu.csv pos.csv");
    let sigma = format!("--gnss-sigma {},{},{}", gnss[0][4], gnss[0][5], gnss[0][6]);
    // the biases of other axes are others; the digits of RTKLIB are those of the table
    for (files, columns, tolerance) in [
        ("inc.csv pos.csv", 33, 2e-6),
        ("imu.txt gnss.txt", 33, 2e-6),
        ("imu8.txt gnss.txt", 33, 2e-6),
        ("--mounting flu flu.csv pos.csv", 10, 1e-6),
        (&format!("{sigma} rec/imu.csv bare.csv"), 33, 2e-6),
        ("rec/imu.csv dated.pos", 33, 0.0),
        ("rec/imu.csv weeks.pos", 33, 0.0),
    ] {
        assert_near(
            &positions[..columns],
            &solution(files)[..columns],
            tolerance,
        );
    }
    let with_velocity = solution("rec/imu.csv rec/gnss.csv");
    assert_near(&with_velocity, &solution("imu.txt gnss13.txt"), 2e-6);
}

/// Positions alone: the heading is never turned round, and every state of the coarse alignment is as good as
/// it says (4 standard deviations, 9 states, 6 recordings: p < 0.004 of a false alarm).
#[test]
fn alignment_from_positions_alone_is_as_good_as_it_says() {
    let slow = "to_speed_m_s = 10, duration_s = 10";
    let place = place_with(
        &DRIVE.replace(slow, "to_speed_m_s = 28, duration_s = 14"),
        MODEL,
    );
    for seed in 1..=6 {
        place.done(&format!(
            "trajectory record drive.toml imu.toml --seed {seed} -o rec"
        ));
        place.edit("rec/gnss.csv", "pos.csv", |_, line| {
            line.split(',').take(7).collect::<Vec<_>>().join(",")
        });
        let fuse = "fuse rec/imu.csv pos.csv imu.toml --reference rec/reference.csv -o out";
        let ran = place.done(fuse);
        assert!(!ran.stderr.contains("reversing"), "{}", ran.stderr);
        // too short for more
        assert_eq!(
            place.json("out/summary.json")["verdict"]["kind"],
            "undecided"
        );
        assert_start_within_four_sigma(&place);
    }
}

/// A wheel that reads 1 % too much, in km/h: its scale is found, and is in no summary of a fusion without it.
#[test]
fn a_wheel_and_the_constraint_enter_the_summary_and_the_page() {
    let place = recorded();
    let rows = place.table("rec/reference.csv");
    let row = |r: &Vec<f64>| format!("{},{:.4}\n", r[0], 1.01 * 3.6 * r[4].hypot(r[5]));
    let rows: String = rows.iter().step_by(10).map(row).collect();
    place.write("wheel.csv", format!("t_s,wheel (km/h)\n{rows}"));
    let fuse = "--outage 60:75 --smooth";
    let found = summary(&place, &format!("{fuse} --nhc --zupt --odometer wheel.csv"));
    let vehicle = &found["vehicle"];
    let [scale, sigma] = ["value", "sigma"].map(|k| number(vehicle, &format!("/wheel_scale/{k}")));
    assert!(
        sigma < 0.01 && (scale - 0.01).abs() < 4.0 * sigma,
        "{vehicle}"
    );
    assert!(number(vehicle, "/mounting_yaw_deg/sigma") < 1.0);
    for (i, name) in ["nhc", "odometer"].into_iter().enumerate() {
        assert_eq!(vehicle["aids"][i]["aid"], name);
        // made without noise: no farther off than stated
        assert!(
            number(vehicle, &format!("/aids/{i}/nis_per_component")) < 1.0,
            "{vehicle}"
        );
    }
    assert!(
        place
            .read("out/report.html")
            .contains("/vehicle/wheel_scale/value")
    );
    let manifest = place.json("out/manifest.json");
    let inputs = manifest["inputs"].as_array().unwrap();
    assert!(
        inputs.iter().any(|input| input["role"] == "odometer"),
        "{manifest}"
    );
    assert!(summary(&place, fuse)["vehicle"].is_null());
}
