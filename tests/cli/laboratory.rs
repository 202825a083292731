//! Recordings as laboratories have them: clocks of quartz, one recording, curves from elsewhere.

use crate::common::drive::{MODEL, Ran, done, place_with, plain};
use std::fs;
use std::path::Path;

const DRIVE: &str = "
start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }
segment = [{ kind = \"straight\", duration_s = 5 }, { kind = \"accelerate\", to_speed_m_s = 10, duration_s = 25 }]
";

fn refused(directory: &Path, command: &str) -> Ran {
    let ran = plain(directory, command);
    assert_eq!(ran.code, 2, "{command}: {}", ran.stderr);
    ran
}

/// The clock of a recording runs at 100.0123 Hz: fixes come once a second all the same.
#[test]
fn choose_takes_the_error_of_a_clock_from_the_rate() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "synthesize imu.toml --replicates 3 --samples 4096 --seed 1 -o rec",
    );
    for file in fs::read_dir(place.path().join("rec")).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_some_and(|e| e == "csv") {
            let text = fs::read_to_string(&path).unwrap();
            let row = |(k, line): (usize, &str)| match line.split_once(',') {
                Some((_, values)) if k > 0 => {
                    format!("{:.7},{values}\n", (k - 1) as f64 / 100.0123)
                }
                _ => format!("{line}\n"),
            };
            fs::write(&path, text.lines().enumerate().map(row).collect::<String>()).unwrap();
        }
    }
    let choose =
        "choose rec --trajectory drive.toml --outage 15:25 --estimator awv --model WN+RW --seed 1";
    let ran = plain(place.path(), &format!("{choose} -o a"));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("run at 100.012 Hz: taken as 100 Hz"),
        "{}",
        ran.stderr
    );
    let model = fs::read_to_string(place.path().join("a/model.toml")).unwrap();
    assert!(model.contains("\nrate_hz = 100.0\n"), "{model}");
}

#[test]
fn models_and_curves_say_what_they_are_of() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "synthesize imu.toml --replicates 1 --samples 4096 --axes gyro.x --seed 1 -o rec",
    );
    // Two estimators of one signal are told apart.
    let calibrate = "calibrate rec --model WN --bootstrap 0";
    let ran = plain(
        place.path(),
        &format!("{calibrate} --estimator all --scales 0.001min:1h -o both.toml"),
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    for name in ["gyro.x gmwm ", "gyro.x rgmwm "] {
        assert!(
            ran.stdout
                .lines()
                .any(|line| line.trim_start().starts_with(name)),
            "{}",
            ran.stdout
        );
    }
    let ran = refused(place.path(), &format!("{calibrate} -o -"));
    assert!(
        ran.stderr.contains("- is not a file") && !place.path().join("-").exists(),
        "{}",
        ran.stderr
    );
    // A curve that does not say its sensor.
    fs::write(
        place.path().join("c.csv"),
        "tau_samples,wv,edof\n2,4,900\n4,2,400\n8,1,200\n",
    )
    .unwrap();
    let curve = "calibrate --curve c.csv --rate-hz 100 --model WN --bootstrap 0";
    let told = |more: &str| plain(place.path(), &format!("{curve}{more}")).stderr;
    assert!(
        told("").contains("taken as an accelerometer"),
        "{}",
        told("")
    );
    assert!(
        !told(" --axes gyro").contains("taken as"),
        "{}",
        told(" --axes gyro")
    );
}

/// What the program wrote beside a result is no broken curve.
#[test]
fn check_knows_its_own_records() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec",
    );
    done(
        place.path(),
        "calibrate rec --model WN --bootstrap 9 --seed 1 -o m.toml",
    );
    let ran = plain(
        place.path(),
        "check rec/manifest.json m.draws.json m.wv.json",
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let lines: Vec<&str> = ran.stdout.lines().collect();
    assert!(
        lines[..2]
            .iter()
            .all(|line| line.contains("a record beside a result")),
        "{lines:?}"
    );
    assert!(lines[2].contains("wavelet-variance curves"), "{lines:?}");
}
