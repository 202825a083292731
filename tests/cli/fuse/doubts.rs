//! Results that are refused or not to be believed.

use super::*;
use std::fmt::Write as _;

/// Nobody's files are replaced: neither by a fusion nor by a recording.
#[test]
fn a_directory_of_something_else_is_refused() {
    let place = recorded();
    fs::create_dir(place.path().join("mine")).unwrap();
    fs::write(place.path().join("mine/imu.csv"), "precious").unwrap();
    for command in [
        "trajectory record drive.toml imu.toml --seed 3 -o mine",
        "fuse rec/imu.csv rec/gnss.csv imu.toml -o mine",
        "run drive.toml imu.toml --runs 1 --outage none --seed 1 -o mine",
    ] {
        let ran = nav_sim(place.path(), command);
        assert_eq!(ran.code, 2, "{command}\n{}", ran.stderr);
        assert!(ran.stderr.contains("mine is not "), "{}", ran.stderr);
    }
    assert_eq!(
        fs::read_to_string(place.path().join("mine/imu.csv")).unwrap(),
        "precious"
    );
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    ); // its own is replaced
}

/// What is not to be believed ends with exit code 3, its files written and the verdict first: a start that is
/// half a turn off, a reference of another heading.
#[test]
fn what_is_not_to_be_believed_ends_with_3() {
    let place = recorded();
    let at = |name: &str| place.path().join(name);
    let initial = fs::read_to_string(at("rec/initial.toml")).unwrap();
    let turned = |line: &str| match line.strip_prefix("yaw_deg = ") {
        Some(yaw) => format!("yaw_deg = {}\n", yaw.parse::<f64>().unwrap() - 180.0),
        None => format!("{line}\n"),
    };
    fs::write(
        at("turned.toml"),
        initial.lines().map(turned).collect::<String>(),
    )
    .unwrap();
    let reference = fs::read_to_string(at("rec/reference.csv")).unwrap();
    fs::write(at("off.csv"), turned_reference(&reference)).unwrap();
    for (flags, why) in [
        ("--initial turned.toml", "NIS"),
        ("--initial rec/initial.toml --reference off.csv", "NEES"),
    ] {
        let ran = nav_sim(
            place.path(),
            &format!("fuse rec/imu.csv rec/gnss.csv imu.toml {flags} -o out"),
        );
        assert_eq!(ran.code, 3, "{flags}\n{}", ran.stderr);
        assert!(ran.stdout.starts_with("overconfident: "), "{}", ran.stdout);
        assert!(
            ran.stdout.lines().next().unwrap().contains(why),
            "{flags}\n{}",
            ran.stdout
        );
        assert!(ran.stderr.contains("hint: "), "{}", ran.stderr);
        let summary: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(at("out/summary.json")).unwrap()).unwrap();
        assert_eq!(summary["verdict"]["kind"], "overconfident");
        assert!(at("out/solution.csv").exists() && at("out/manifest.json").exists());
    }
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml -o out",
    );
    assert!(
        ran.stdout.starts_with("undecided: errors "),
        "{}",
        ran.stdout
    );
}

/// The reference with its yaw 20° off.
fn turned_reference(text: &str) -> String {
    let header = text.lines().next().unwrap();
    let column = header
        .split(',')
        .position(|name| name == "yaw_deg")
        .unwrap();
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[column] = (cells[column].parse::<f64>().unwrap() + 20.0).to_string();
        cells.join(",") + "\n"
    };
    format!("{header}\n") + &text.lines().skip(1).map(row).collect::<String>()
}

/// Four of a hundred fixes 30 m (fifteen deviations) off to the north: they are left out and named by their times, and the errors
/// are what they are without the jumps, up to the four fixes fewer. Of right fixes one in a hundred such drives is left
/// out.
#[test]
fn jumps_are_left_out_and_named() {
    let place = recorded();
    let text = fs::read_to_string(place.path().join("rec/gnss.csv")).unwrap();
    let mut jumps = String::new();
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if [30.0, 31.0, 55.0, 80.0].contains(&cells[0].parse().unwrap_or(0.0)) {
            cells[1] = (cells[1].parse::<f64>().unwrap() + 2.7e-4).to_string();
        }
        writeln!(jumps, "{}", cells.join(",")).unwrap();
    }
    fs::write(place.path().join("jumps.csv"), jumps).unwrap();
    let fused = |gnss: &str, flags: &str| {
        let command = format!(
            "fuse rec/imu.csv {gnss} imu.toml --initial rec/initial.toml --reference rec/reference.csv {flags} -o out"
        );
        let ran = nav_sim(place.path(), &command);
        let text = fs::read_to_string(place.path().join("out/summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
        (ran, summary)
    };
    let rmse_m =
        |summary: &serde_json::Value| summary["reference"]["horizontal_rmse_m"].as_f64().unwrap();
    let (_, clean) = fused("rec/gnss.csv", "");
    let (ran, summary) = fused("jumps.csv", "");
    let times = serde_json::json!([30.0, 31.0, 55.0, 80.0]);
    assert_eq!(summary["outliers"]["t_s"], times, "{summary}");
    assert_eq!(summary["fixes"]["rejected"], 4);
    let warning = "warning: 4 outliers (4.0 %";
    assert!(
        ran.stderr.contains(warning) && ran.stderr.contains("30, 31, 55, 80 s"),
        "{}",
        ran.stdout
    );
    assert!(rmse_m(&summary) < 1.2 * rmse_m(&clean), "{summary} {clean}");
    let (_, without) = fused("jumps.csv", "--gate none");
    assert!(without.get("outliers").is_none() && rmse_m(&without) > 1.2 * rmse_m(&clean));
    let bad = nav_sim(
        place.path(),
        "fuse rec/imu.csv jumps.csv imu.toml --gate 1 -o bad",
    );
    assert_eq!(bad.code, 2, "{}", bad.stderr);
}

/// A model 20 times quieter than the recording: the recording's own white noise is believed, and the line that is printed is that
/// of the model that made it, to 10 % of its deviation (10 000 samples of three axes tell 1.5 %).
#[test]
fn a_model_that_is_too_quiet_is_told() {
    let place = recorded();
    let model = fs::read_to_string(place.path().join("imu.toml")).unwrap();
    let sigma2 = |line: &str| {
        let after = line.split_once("sigma2 = ").unwrap().1;
        let end = after.find([' ', ',', '}']).unwrap();
        after[..end].parse::<f64>().unwrap()
    };
    let quiet = |line: &str| match line.contains("WN") {
        true => {
            let value = sigma2(line);
            line.replace(&format!("{value:e}"), &format!("{:e}", value / 400.0))
        }
        false => line.to_owned(),
    };
    let lines: Vec<String> = model.lines().map(quiet).collect();
    let quieter = lines.join("\n");
    assert_ne!(quieter, model);
    fs::write(place.path().join("quiet.toml"), quieter).unwrap();
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv quiet.toml --initial rec/initial.toml --reference rec/reference.csv -o out",
    );
    assert!(ran.stdout.starts_with("undecided"), "{}", ran.stdout);
    for (sensor, made) in ["accel", "gyro"]
        .into_iter()
        .zip(model.lines().filter(|l| l.contains("WN")))
    {
        let start = format!("warning: {sensor}: the recording has ");
        let told = ran.stderr.lines().find(|l| l.starts_with(&start));
        let told = told.unwrap_or_else(|| panic!("{}", ran.stderr));
        let ratio = sigma2(told) / sigma2(made);
        assert!((0.81..1.21).contains(&ratio), "{told}");
    }
}
