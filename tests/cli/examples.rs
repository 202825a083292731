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

#[path = "../../examples/paper_section4/main.rs"]
#[allow(dead_code, reason = "its command line is not called")]
mod paper_section4;

/// Figures of three short sets as they were when this was a command of the program.
#[test]
fn section_four_keeps_its_figures() {
    let design = paper_section4::section4(4096).unwrap();
    let rows = paper_section4::study(&design, 3).unwrap();
    assert_eq!(rows.len(), 36);
    // AWV in I (AR1 sigma2), DR-AWV in III (RW gamma2).
    let found = [2, 35].map(|row: usize| rows[row].accuracy.rmse);
    for (found_rmse, rmse) in found.iter().zip([1.0903230214353024, 61.505489188874726]) {
        assert!((found_rmse / rmse - 1.0_f64).abs() < 1e-9, "{found:?}");
    }
    let curves = paper_section4::sensitivity(&design).unwrap();
    // A head, then 10 outliers and 11 factors of 1, 2 and 3 replicates, for 3 estimators and 4 parameters.
    assert_eq!(curves.lines().count(), 1 + (10 + 3 * 11) * 12);
    let unchanged = "random_walk_variance_factor_of_1,1,awv,WN sigma2,0e0";
    assert!(
        curves.contains(unchanged),
        "a factor of one changes nothing"
    );
}

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
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.ends_with(".rs") && !name.starts_with("paper") {
            let lines = std::fs::read_to_string(&path).unwrap().lines().count();
            assert!(lines <= 80, "{} has {lines} lines", path.display());
        }
    }
}

/// The walk-through is the demo of the program.
#[test]
fn the_walk_through_is_what_the_demo_prints() {
    let script = include_str!("../../examples/paper_section5.sh");
    let arguments = ["demo", "--seed", "1", "--print", "-o", "out/paper_section5"];
    let output = Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .args(arguments)
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    let mut lines = script.lines();
    for line in printed.lines() {
        assert!(lines.any(|of_script| of_script == line), "{line}");
    }
    assert_eq!(lines.next(), None);
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
    assert!(said.baro.is_some());
    expected.baro = said.baro.clone();
    let (of, from) = (&mut expected.imu, &said.imu);
    assert!(from.vibration.is_some() && from.temperature.is_some());
    of.vibration.clone_from(&from.vibration);
    of.temperature.clone_from(&from.temperature);
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
    let commands = printed
        .lines()
        .filter(|l| l.starts_with("nav-sim ") && !l.contains(" batch "));
    assert_eq!(commands.clone().count(), 7);
    assert!(
        commands.clone().all(|l| l.contains(" --seed ")) && printed.contains("\nseed = 7\n"),
        "{printed}"
    );
}
