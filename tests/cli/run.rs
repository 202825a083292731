//! `nav-sim run` as a user runs it, on a drive of a minute.

mod beyond_linear;
mod methods;

use crate::common::drive::*;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn place() -> tempfile::TempDir {
    place_with(
        DRIVE,
        &format!("{MODEL}[provenance]\nestimator = \"dr-awv\"\n"),
    )
}

/// The command fails with this code, its message starts so, and it leaves no output behind.
fn refused(arguments: &str, code: i32, message: &str) {
    let place = place();
    let ran = nav_sim(place.path(), arguments);
    assert_eq!(ran.code, code, "{arguments}\n{}", ran.stderr);
    let said = ran.stderr.split("error: ").nth(1).unwrap_or_default();
    assert!(said.starts_with(message), "{arguments}\n{}", ran.stderr);
    let left: Vec<_> = fs::read_dir(place.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert!(
        left.iter()
            .all(|name| name == "drive.toml" || name == "imu.toml"),
        "{left:?}"
    );
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn a_run_directory_holds_what_the_interface_says() {
    let place = place();
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --runs 10 --outage 30:40 --seed 5 -o out",
    );
    assert!(
        ran.stdout.starts_with("verdict: undecided: 10 runs miss "),
        "{}",
        ran.stdout
    );
    assert!(
        ran.stdout.lines().all(|line| line.chars().count() <= 120)
            && ran.stdout.lines().count() <= 20,
        "{}",
        ran.stdout
    );
    let out = place.path().join("out");
    let summary = json(&out.join("summary.json"));
    assert_eq!(
        (
            &summary["runs"],
            &summary["filter_states"],
            &summary["seed"]
        ),
        (&10.into(), &15.into(), &5.into())
    );
    assert_eq!(summary["outages"][0]["end_s"], 40.0);
    assert!(
        summary["outages"][0]["asee_mean"]["pos_e_m"]
            .as_f64()
            .unwrap()
            > 0.1
    );
    assert_eq!(summary["verdict"]["kind"], "undecided");
    assert_eq!(summary["verdict"]["by_covariance_analysis"], "consistent");
    let times = summary["verdict"]["times_to_decide"].as_f64().unwrap();
    assert!((2.0..4.0).contains(&times), "{summary}");
    let manifest = json(&out.join("manifest.json"));
    assert!(summary["throughput_epochs_per_s"].as_f64().unwrap() > 0.0);
    for outage in summary["outages"].as_array().unwrap() {
        let verdict = &outage["verdict"];
        assert!(
            verdict["kind"].is_string() && verdict["worst_state"].is_string(),
            "{verdict}"
        );
        assert!(verdict["ratio"].as_f64().unwrap() > 0.0, "{verdict}");
    }
    assert_eq!(manifest["configuration"]["run"]["seed"], 5);
    assert_eq!(
        manifest["inputs"][0]["blake3"],
        blake3::hash(DRIVE.as_bytes()).to_hex().as_str()
    );
    assert_eq!(manifest["estimator"], "dr-awv");
    let epochs = fs::read_to_string(out.join("epochs.csv")).unwrap();
    assert_eq!(epochs.lines().count(), 62); // header, 0 … 60 s
    let fixes: Vec<&str> = epochs
        .lines()
        .skip(1)
        .map(|l| l.split(',').nth(1).unwrap())
        .collect();
    assert_eq!(
        (fixes[29], fixes[30], fixes[39], fixes[40]),
        ("1", "0", "0", "1")
    );
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("</html>")
    );
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let place = place();
    let command = "run drive.toml imu.toml --runs 20 --outage 30:40 --seed 9";
    let one = done(place.path(), &format!("{command} -j 1 -o one"));
    let two = done(place.path(), &format!("{command} -j 2 -o two"));
    assert_eq!(one.stdout, two.stdout);
    for name in ["epochs.csv", "runs.csv", "summary.json", "report.html"] {
        // how fast it was found is the one number that the seed does not determine
        let timeless = |run: &str| {
            let text = fs::read_to_string(place.path().join(run).join(name)).unwrap();
            text.lines()
                .filter(|l| !l.contains("throughput_epochs_per_s"))
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        assert_eq!(timeless("one"), timeless("two"), "{name}");
    }
}

#[test]
fn without_a_seed_a_run_is_that_of_seed_1() {
    let place = place();
    let run = "run drive.toml imu.toml --runs 2 --outage none";
    done(place.path(), &format!("{run} -o first"));
    assert_eq!(json(&place.path().join("first/manifest.json"))["seed"], 1);
    done(place.path(), &format!("{run} -o again --seed 1"));
    let read = |run: &str| fs::read(place.path().join(run).join("epochs.csv")).unwrap();
    assert_eq!(read("first"), read("again"));
}

/// A filter whose accelerometer is 300 times as bad as it believes: said first, loudly, and in every file.
#[test]
fn a_filter_that_is_far_off_is_told_first() {
    let place = place();
    fs::write(
        place.path().join("rough.toml"),
        MODEL.replace("1e-9", "1e-4"),
    )
    .unwrap();
    let command =
        "run drive.toml imu.toml --truth rough.toml --runs 8 --outage 20:50 --seed 3 -o out";
    let ran = nav_sim(place.path(), command);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(
        ran.stdout
            .starts_with("verdict: overconfident by far: errors "),
        "{}",
        ran.stdout
    );
    assert!(
        ran.stderr
            .contains("warning: the filter is overconfident: "),
        "{}",
        ran.stderr
    );
    let verdict = &json(&place.path().join("out/summary.json"))["verdict"];
    assert_eq!(verdict["kind"], "overconfident");
    assert!(
        verdict["nees"].as_f64().unwrap() > 100.0 && verdict["ratio"].as_f64().unwrap() > 3.0,
        "{verdict}"
    );
    let page = fs::read_to_string(place.path().join("out/report.html")).unwrap();
    assert!(page.contains("<p class=\"verdict bad\">verdict: overconfident by far: errors "));
}

/// Without outages the accuracy over the run is told, RMSE beside ASEE.
#[test]
fn accuracy_is_told_without_outages() {
    let place = place();
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --runs 8 --outage none --seed 3 -o out",
    );
    for word in ["RMSE, mean", "ASEE, mean", "pos_d_m"] {
        assert!(ran.stdout.contains(word), "{word} in {}", ran.stdout);
    }
    let accuracy = &json(&place.path().join("out/summary.json"))["accuracy"];
    let ratio = |state: &str| {
        accuracy["rmse_mean"][state].as_f64().unwrap()
            / accuracy["asee_mean"][state].as_f64().unwrap()
    };
    // 8 runs of a matched filter, some tens of independent seconds each
    assert!((0.6..1.5).contains(&ratio("pos_e_m")) && (0.6..1.5).contains(&ratio("vel_n_m_s")));
}

#[test]
fn times_of_random_outages_are_rounded() {
    let place = place();
    let scenario = "[outage_random]\nrate_per_hour = 1000\nduration_s = 5.5\n";
    fs::write(place.path().join("s.toml"), scenario).unwrap();
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --scenario s.toml --runs 1 --seed 1 -o out",
    );
    let row = |line: &&str| line.contains(" s  ");
    let shown = ran
        .stdout
        .lines()
        .find(row)
        .unwrap()
        .trim_start()
        .split(" s")
        .next()
        .unwrap();
    // hundredths of seconds within a minute
    assert!(
        shown
            .split('–')
            .all(|t| t.len() <= 5 && t.parse::<f64>().is_ok()),
        "{shown}"
    );
}

#[test]
fn flags_win_over_the_scenario_file() {
    let place = place();
    let scenario = "outage = [{ start_s = 20, end_s = 30 }]\nrun = { runs = 3, seed = 4 }\n[gnss]\nrate_hz = 2\n";
    fs::write(place.path().join("s.toml"), scenario).unwrap();
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --scenario s.toml --runs 2 --format json -o out",
    );
    let summary: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!((&summary["runs"], &summary["seed"]), (&2.into(), &4.into()));
    assert_eq!(summary["outages"][0]["start_s"], 20.0);
    assert_eq!(summary["nis"]["fixes"], 2 * (120 - 20));
}

#[test]
fn candidates_with_the_same_seed_are_paired() {
    let place = place();
    fs::write(
        place.path().join("louder.toml"),
        MODEL.replace("1e-9", "4e-9"),
    )
    .unwrap();
    let common = "--runs 8 --outage 30:50 --seed 3 --truth imu.toml";
    done(
        place.path(),
        &format!("run drive.toml imu.toml {common} -o reference"),
    );
    done(
        place.path(),
        &format!("run drive.toml louder.toml {common} -o louder"),
    );
    let ran = done(
        place.path(),
        "compare louder reference --reference reference --state pos_e_m",
    );
    assert!(!ran.stderr.contains("warning"), "{}", ran.stderr);
    let comparison = json(&place.path().join("comparison.json"));
    let row = &comparison["rows"][1];
    assert_eq!(
        (&comparison["paired"], &row["state"]),
        (&true.into(), &"pos_e_m".into())
    );
    // the filter that believes in more noise believes itself less, beyond doubt
    assert!(row["ci95_pct"][0].as_f64().unwrap() > 0.0, "{row}");
}

#[test]
fn a_trajectory_shorter_than_the_default_outages_runs_without_them_and_says_so() {
    let place = place();
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --runs 1 --seed 1 -o out",
    );
    assert!(
        ran.stderr.contains(
            "warning: the default outage 300:390 is left out: the trajectory lasts from 0 to 60 s"
        ),
        "{}",
        ran.stderr
    );
}

#[test]
fn refusals_name_what_is_wrong_and_leave_nothing() {
    let base = "run drive.toml imu.toml --seed 1 -o out";
    refused(
        "run none.toml imu.toml -o out",
        2,
        "none.toml: No such file",
    );
    refused(
        "run drive.toml none.toml -o out",
        2,
        "none.toml: No such file",
    );
    refused(
        "run drive.toml drive.toml -o out",
        2,
        "drive.toml, line 2: unknown key \"start\"",
    );
    refused(
        &format!("{base} --outage 70:90"),
        2,
        "outage 70:90 does not lie on the data",
    );
    refused(
        &format!("{base} --outage=-10:20"),
        2,
        "outage -10:20 does not lie on the data",
    );
    refused(
        &format!("{base} --outage 30.2:30.7"),
        2,
        "outage 30.2:30.7 withholds no fix",
    );
    refused(
        &format!("{base} --outage none --outage 30:40"),
        2,
        "--outage none with other outages",
    );
    refused(&format!("{base} --outage 40:30"), 2, "--outage='40:30'");
    refused(&format!("{base} --outage soon"), 2, "--outage='soon'");
    refused(
        &format!("{base} --runs 0"),
        2,
        "run.runs = 0 is refused: it must be a finite number ≥ 1 and ≤ 10000000",
    );
    refused(&format!("{base} --filter 16"), 2, "--filter='16'");
    refused(&format!("{base} --threads 0"), 2, "--threads='0'");
    refused(
        &format!("{base} --truth a --static b"),
        2,
        "the argument --truth cannot be used",
    );
    refused(
        "run drive.toml imu.toml --outage none --seed 1 -o imu.toml",
        1,
        "imu.toml: ",
    );
}

#[test]
fn a_recording_that_is_too_short_is_refused_by_how_much() {
    let place = place();
    let mut csv =
        "t_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n"
            .to_owned();
    for k in 0..4000 {
        let noise = f64::from((k * 7919) % 1000 - 500) * 1e-5;
        let g = 9.81 + noise;
        csv += &format!(
            "{},{noise},{noise},{g},{noise},{noise},{noise}\n",
            f64::from(k) / 100.0
        );
    }
    fs::write(place.path().join("static.csv"), csv).unwrap();
    let ran = nav_sim(
        place.path(),
        "run drive.toml imu.toml --static static.csv --runs 1 --seed 1 -o out",
    );
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(
        ran.stderr
            .contains("lasts 40 s, the trajectory 60 s: 20 s too short"),
        "{}",
        ran.stderr
    );
    assert!(
        ran.stderr
            .contains("hint: record for longer: each run takes a window"),
        "{}",
        ran.stderr
    );
}

/// Whatever ends a run before its time, nothing is left that looks like one.
#[test]
fn a_run_that_is_killed_leaves_nothing_to_clean_up() {
    let place = place();
    let names = || {
        fs::read_dir(place.path())
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect::<Vec<_>>()
    };
    let before = names();
    let command = "run drive.toml imu.toml --runs 1000000 --outage none --seed 1 -q -o out";
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .args(command.split_whitespace())
        .current_dir(&place)
        .spawn()
        .unwrap();
    // before its output is claimed it only tries whether it may write there
    while !place.path().join(".out.claim").exists() {
        assert!(
            child.try_wait().unwrap().is_none(),
            "a million runs already?"
        );
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    // but for the marker of its output, which is in nobody's way and goes with the next run
    let left: Vec<_> = names()
        .into_iter()
        .filter(|name| !before.contains(name))
        .collect();
    assert_eq!(left, [".out.claim"]);
    done(
        place.path(),
        "run drive.toml imu.toml --runs 2 --outage none --seed 1 -q -o out",
    );
    let left: Vec<_> = names()
        .into_iter()
        .filter(|name| !before.contains(name))
        .collect();
    assert_eq!(left, ["out"]);
}

/// A truth that the filter does not know, and a barometer, all by the scenario file: they change the
/// run, are kept in its manifest, and show in its figures.
#[test]
fn the_true_imu_the_receiver_and_the_barometer_follow_the_scenario() {
    let place = place();
    let scenario = "
imu = { turn_on_bias_accel_m_s2 = 0.2, scale_ppm_gyro = 2000, misalignment_rad = 0.002 }
gnss = { correlated_pos_sigma_m = [5, 5, 5], correlation_time_s = 30 }
baro = { rate_hz = 2, sigma_m = 0.5 }
outage = [{ start_s = 30, end_s = 45 }]
";
    fs::write(place.path().join("s.toml"), scenario).unwrap();
    done(
        place.path(),
        "run drive.toml imu.toml --runs 8 --seed 2 --outage 30:45 -o plain",
    );
    // a filter that expects none of it is lost
    let ran = nav_sim(
        place.path(),
        "run drive.toml imu.toml --runs 8 --seed 2 --scenario s.toml -o worse",
    );
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let (plain, worse) = (
        json(&place.path().join("plain/summary.json")),
        json(&place.path().join("worse/summary.json")),
    );
    let nees = |summary: &Value| summary["nees"]["mean"].as_f64().unwrap();
    assert!(
        nees(&worse) > 2.0 * nees(&plain),
        "{} {}",
        nees(&plain),
        nees(&worse)
    );
    let down = |summary: &Value| {
        summary["outages"][0]["asee_mean"]["pos_d_m"]
            .as_f64()
            .unwrap()
    };
    assert!(down(&worse) < 0.5 * down(&plain));
    let kept = json(&place.path().join("worse/manifest.json"));
    assert_eq!(kept["configuration"]["imu"]["scale_ppm_gyro"], 2000.0);
}

/// A model of several processes is reduced to 15 states: said, and compared with the
/// full filter; a model that fits 15 states is left alone.
#[test]
fn the_reduction_of_the_model_is_said_and_kept() {
    let place = place();
    let two = MODEL.replace(
        "phi = 0.9999, sigma2 = 1e-9 }",
        "phi = 0.9999, sigma2 = 1e-9 }, { type = \"AR1\", phi = 0.99, sigma2 = 1e-7 }",
    );
    fs::write(place.path().join("two.toml"), two).unwrap();
    let ran = done(
        place.path(),
        "run drive.toml two.toml --runs 2 --outage 20:40 --seed 1 -o out",
    );
    let told: Vec<&str> = ran
        .stderr
        .lines()
        .filter(|line| line.contains("reduced"))
        .collect();
    assert!(
        told.len() == 1 && told[0].starts_with("reduced filter: NEES "),
        "{}",
        ran.stderr
    );
    let reduction = &json(&place.path().join("out/summary.json"))["reduction"];
    let ratio = reduction["outage_end"][0]["pos_e_m"].as_f64().unwrap();
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --runs 2 --outage 20:40 --seed 1 -o same",
    );
    assert!(!ran.stderr.contains("reduced"), "{}", ran.stderr);
    assert!(json(&place.path().join("same/summary.json"))["reduction"].is_null());
    done(
        place.path(),
        "run drive.toml two.toml --filter full --runs 2 --outage 20:40 --seed 1 -o full",
    );
    assert!(json(&place.path().join("full/summary.json"))["reduction"].is_null());
}

#[test]
fn doubtful_requests_are_said() {
    let place = place();
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --outage 10:20 --outage 15:30 --runs 1 --seed 1 -o out",
    );
    assert!(
        ran.stderr
            .contains("warning: overlapping outages are merged"),
        "{}",
        ran.stderr
    );
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --outage 50:70 --runs 1 --seed 1 -o out",
    );
    assert!(
        ran.stderr
            .contains("warning: outage 50:70 is cut: the trajectory ends at 60 s"),
        "{}",
        ran.stderr
    );
}

/// The manifest of another command is not replaced; that of a run is.
#[test]
fn a_directory_of_another_command_is_refused() {
    let place = place();
    done(
        place.path(),
        "synthesize imu.toml --replicates 1 --samples 1000 --seed 1 -o made",
    );
    let before = fs::read(place.path().join("made/manifest.json")).unwrap();
    let ran = nav_sim(
        place.path(),
        "run drive.toml imu.toml --runs 1 --outage none --seed 1 -o made",
    );
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("made is not of this command"),
        "{}",
        ran.stderr
    );
    assert_eq!(
        fs::read(place.path().join("made/manifest.json")).unwrap(),
        before
    );
    for _ in 0..2 {
        done(
            place.path(),
            "run drive.toml imu.toml --runs 1 --outage none --seed 1 -o mine",
        );
    }
}

/// A drive is no static recording: that it becomes the errors of the IMU is said.
#[test]
fn motion_in_a_static_recording_is_said() {
    let place = place();
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let short = DRIVE.replace("duration_s = 35", "duration_s = 5");
    fs::write(place.path().join("short.toml"), short).unwrap();
    let command =
        "run short.toml imu.toml --static rec/imu.csv --runs 1 --outage none --seed 1 -o out";
    let ran = nav_sim(place.path(), command);
    assert!(
        ran.stderr
            .contains("imu.csv: not static? One-second means of accel.x"),
        "{}",
        ran.stderr
    );
}

#[test]
fn check_knows_the_files_of_a_fusion_and_speaks_json() {
    let place = place();
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let ran = done(
        place.path(),
        "check rec/initial.toml rec/gnss.csv rec/reference.csv --format json",
    );
    let said: Value = serde_json::from_str(&ran.stdout).unwrap();
    let found: Vec<&str> = said
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["found"].as_str().unwrap())
        .collect();
    let expected = ["an initial state", "60 GNSS fixes", "a trajectory"];
    assert_eq!(found, expected);
    let slow: String = (0..9)
        .map(|k| format!("{},46.5,6.5,{k},0,0,0\n", 1000 * k))
        .collect();
    fs::write(
        place.path().join("ms.csv"),
        format!("t_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg,yaw_deg\n{slow}"),
    )
    .unwrap();
    fs::write(
        place.path().join("deep.toml"),
        DRIVE.replace("h_m = 400", "h_m = -7e6"),
    )
    .unwrap();
    for (file, message) in [
        ("ms.csv", "milliseconds (t_ms)?"),
        (
            "deep.toml",
            "it must be a finite number ≥ -12000 and ≤ 1000000",
        ),
    ] {
        let ran = nav_sim(place.path(), &format!("check {file} --format json"));
        let said: Value = serde_json::from_str(&ran.stdout).unwrap();
        assert!(
            ran.code == 2 && said[0]["ok"] == false && ran.stderr.contains(message),
            "{}",
            ran.stderr
        );
    }
}

/// Four seconds hold one report and nothing to choose a reduction by.
#[test]
fn a_trajectory_of_a_few_seconds_is_run() {
    let place = place();
    let short = "start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40, speed_m_s = 10 }\n\
                 segment = [{ kind = \"straight\", duration_s = 4 }]\n";
    fs::write(place.path().join("short.toml"), short).unwrap();
    for outage in ["none", "1:3"] {
        done(
            place.path(),
            &format!("run short.toml imu.toml --outage {outage} --runs 1 --seed 5 -o out"),
        );
    }
}
