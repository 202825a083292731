//! Results that are not to be believed, and fixes that are left out.

use super::{recorded, summary};
use crate::common::drive::*;

/// A solution that is not to be believed ends with exit code 3, its files written and the verdict first: a start that is
/// half a turn off, a reference whose heading is 20° off.
#[test]
fn what_is_not_to_be_believed_ends_with_3() {
    let place = recorded();
    let turned = |line: &str, yaw: &str, by: f64| {
        let turned = yaw.parse::<f64>().unwrap() + by;
        line.replacen(yaw, &turned.to_string(), 1)
    };
    place.edit("rec/initial.toml", "turned.toml", |_, line| {
        match line.strip_prefix("yaw_deg = ") {
            Some(yaw) => turned(line, yaw, -180.0),
            None => line.to_owned(),
        }
    });
    place.edit("rec/reference.csv", "off.csv", |k, line| {
        let cells: Vec<&str> = line.split(',').collect();
        let yaw = cells[9].parse::<f64>();
        let others = cells[..9].join(",");
        yaw.map_or(line.to_owned(), |yaw| {
            format!("{others},{}", yaw + if k > 0 { 20.0 } else { 0.0 })
        })
    });
    for (options, statistic) in [
        ("--initial turned.toml", "NIS"),
        ("--initial rec/initial.toml --reference off.csv", "NEES"),
    ] {
        let fuse = format!("fuse rec/imu.csv rec/gnss.csv imu.toml {options} -o out");
        let ran = place.ends(&fuse, 3);
        let verdict = ran.stdout.lines().next().unwrap();
        assert!(verdict.contains(statistic), "{verdict}");
        assert_eq!(
            place.json("out/summary.json")["verdict"]["kind"],
            "overconfident"
        );
        assert!(place.at("out/solution.csv").exists() && place.at("out/manifest.json").exists());
    }
    let believed = place.done("fuse rec/imu.csv rec/gnss.csv imu.toml -o out");
    assert_eq!(believed.stderr, "wrote out\n");
    assert_eq!(
        place.json("out/summary.json")["verdict"]["kind"],
        "undecided"
    );
}

/// Four of a hundred fixes 30 m (fifteen deviations) off to the north: they are left out and named by their times, and the errors
/// are what they are without the jumps, up to the four fixes fewer. Of right fixes one in a hundred such drives is left
/// out.
#[test]
fn jumps_are_left_out_and_named() {
    let place = recorded();
    let times = [30.0, 31.0, 55.0, 80.0];
    place.edit("rec/gnss.csv", "jumps.csv", |_, line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if times.contains(&cells[0].parse().unwrap_or(0.0)) {
            cells[1] = (cells[1].parse::<f64>().unwrap() + 2.7e-4).to_string();
        }
        cells.join(",")
    });
    let options = "--initial rec/initial.toml --reference rec/reference.csv";
    let clean = summary(&place, options);
    let fused = |gate: &str| {
        let ran = place.judged(&format!(
            "fuse rec/imu.csv jumps.csv imu.toml {options} {gate} -o out"
        ));
        (ran.stderr, place.json("out/summary.json"))
    };
    let rmse_m = |summary| number(summary, "/reference/horizontal_rmse_m");
    let (errors, found) = fused("");
    assert_eq!(numbers(&found, "/outliers/t_s"), times);
    assert_eq!(found["fixes"]["rejected"], 4);
    assert!(
        errors.contains("warning: 4 outliers (4.0 % of the fixes"),
        "{errors}"
    );
    assert!(rmse_m(&found) < 1.2 * rmse_m(&clean), "{found} {clean}");
    let (_, without) = fused("--gate none");
    assert!(without["outliers"].is_null() && rmse_m(&without) > 1.2 * rmse_m(&clean));
}

/// A model 20 times quieter than the recording: the recording's own white noise is believed, and the line that is printed is that
/// of the model that made it, to 10 % of its deviation (10 000 samples of three axes tell 1.5 %).
#[test]
fn a_model_that_is_too_quiet_is_told() {
    let place = recorded();
    let made = [("accel", "5.4e-5"), ("gyro", "2e-6")];
    let quieter = MODEL
        .replace("5.4e-5", "1.35e-7")
        .replace("sigma2 = 2e-6", "sigma2 = 5e-9");
    place.write("quiet.toml", quieter);
    let ran = place.done(
        "fuse rec/imu.csv rec/gnss.csv quiet.toml --initial rec/initial.toml --reference rec/reference.csv -o out",
    );
    assert_eq!(
        place.json("out/summary.json")["verdict"]["kind"],
        "undecided"
    );
    for (sensor, sigma2) in made {
        let start = format!("warning: {sensor}: the recording has ");
        let told = ran
            .stderr
            .lines()
            .find_map(|line| line.strip_prefix(&start));
        let told = told.unwrap_or_else(|| panic!("{}", ran.stderr));
        let found = told.split("sigma2 = ").nth(1).unwrap();
        let found: f64 = found
            .split([' ', ',', '}'])
            .next()
            .unwrap()
            .parse()
            .unwrap();
        let ratio = found / sigma2.parse::<f64>().unwrap();
        assert!((0.81..1.21).contains(&ratio), "{told}");
    }
}
