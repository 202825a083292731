//! The Rust examples run.

use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::outage::Outage;
use std::process::Command;

#[path = "../../examples/01_robust_wavelet_variance.rs"]
mod robust_wavelet_variance;

#[path = "../../examples/02_calibrate.rs"]
mod calibrate;

#[path = "../../examples/03_ideal_imu.rs"]
mod ideal_imu;

#[path = "../../examples/04_monte_carlo.rs"]
mod monte_carlo;

#[path = "../../examples/06_library.rs"]
#[allow(dead_code, reason = "its command line is not called")]
mod library;

#[test]
fn examples_run() {
    robust_wavelet_variance::main().unwrap();
    calibrate::main().unwrap();
    ideal_imu::main().unwrap();
    monte_carlo::main().unwrap();
}

/// White noise of a tactical gyroscope and an accelerometer drifts by metres in 90 s, not by kilometres.
#[test]
fn a_program_calibrates_a_directory_and_runs() {
    let place = tempfile::tempdir().unwrap();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let made = assert_cmd::Command::cargo_bin("nav-sim")
        .unwrap()
        .args([
            "synthesize",
            "calib_data/tactical.toml",
            "--replicates",
            "3",
            "--samples",
            "16384",
            "--seed",
            "1",
            "-o",
        ])
        .arg(place.path().join("recordings"))
        .current_dir(root)
        .output();
    assert!(made.unwrap().status.success());
    let drift = library::drift(
        &place.path().join("recordings"),
        &root.join("trajectories/land_vehicle.toml"),
    );
    assert!((0.1..1000.0).contains(&drift.unwrap()));
}

#[test]
fn examples_are_short() {
    for entry in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "rs") {
            let lines = std::fs::read_to_string(&path).unwrap().lines().count();
            assert!(lines <= 80, "{} has {lines} lines", path.display());
        }
    }
}

/// The walk-through is the demo of the program.
#[test]
fn the_walk_through_is_what_the_demo_prints() {
    let script = include_str!("../../examples/paper_section5.sh");
    let commands: Vec<&str> = script
        .lines()
        .filter(|l| l.starts_with("nav-sim "))
        .collect();
    let arguments = ["demo", "--seed", "1", "--print", "-o", "out/paper_section5"];
    let output = Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .args(arguments)
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    assert_eq!(commands, printed.lines().collect::<Vec<_>>());
}

/// Every key of the example scenario is one, and what it says is the default is the default.
#[test]
fn the_example_scenario_says_the_defaults() {
    let text = include_str!("../../examples/scenario.toml");
    let uncomment = |line: &str| {
        let bare = line
            .trim_start_matches("# ")
            .split(" #")
            .next()
            .unwrap()
            .trim_end()
            .to_owned();
        let is_toml =
            bare.starts_with('[') || (bare.contains(" = ") && !bare.contains("outage = []"));
        if is_toml && !bare.contains("  ") {
            format!("{bare}\n")
        } else {
            String::new()
        }
    };
    let said: Scenario = toml::from_str(&text.lines().map(uncomment).collect::<String>()).unwrap();
    let outages = Some(Outage::PAPER.to_vec());
    let mut expected = Scenario {
        outage: outages,
        ..Scenario::default()
    };
    expected.run.seed = Some(1);
    // without the key there is none: what stands there is a value of use
    assert!(said.filter.nis_gate.is_some() && said.baro.is_some());
    (expected.filter.nis_gate, expected.baro) = (said.filter.nis_gate, said.baro.clone());
    let (of, from) = (&mut expected.imu, &said.imu);
    assert!(from.vibration.is_some() && from.temperature.is_some() && from.output.is_some());
    of.vibration.clone_from(&from.vibration);
    of.temperature.clone_from(&from.temperature);
    of.output.clone_from(&from.output);
    assert_eq!(said, expected);
    assert_eq!(
        toml::from_str::<Scenario>(text).unwrap(),
        Scenario::default()
    );
}

/// Every command of the demo that draws numbers is given the seed.
#[test]
fn the_demo_draws_nothing_that_its_seed_does_not_decide() {
    let printed = assert_cmd::Command::cargo_bin("nav-sim")
        .unwrap()
        .args(["demo", "--seed", "7", "--print"])
        .output();
    let printed = String::from_utf8(printed.unwrap().stdout).unwrap();
    let drawing = printed
        .lines()
        .filter(|l| !l.starts_with("nav-sim compare"));
    assert_eq!(drawing.clone().count(), 16);
    assert!(drawing.clone().all(|l| l.contains(" --seed ")), "{printed}");
}
