//! The Rust examples run.

use crate::common::drive::*;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::outage::Outage;
use std::path::Path;

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
    let place = Place::checkout();
    let model = "calib_data/tactical.toml";
    place.done(&format!(
        "synthesize {model} --replicates 3 --samples 16384 --seed 1 -o recordings"
    ));
    let drive = place.at("trajectories/land_vehicle.toml");
    let drift = library::drift(&place.at("recordings"), &drive);
    assert!((0.1..1000.0).contains(&drift.unwrap()));
}

#[test]
fn examples_are_short() {
    for entry in std::fs::read_dir(Path::new(ROOT).join("examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "rs") {
            let lines = std::fs::read_to_string(&path).unwrap().lines().count();
            assert!(lines <= 80, "{} has {lines} lines", path.display());
        }
    }
}

/// The walk-through is the demo of the program.
#[test]
fn the_walk_through_is_what_the_demo_prints() {
    let script = include_str!("../../examples/paper_section5.sh");
    let printed = plain(
        Path::new(ROOT),
        "demo --seed 1 --print -o out/paper_section5",
    )
    .stdout;
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
            .trim_end();
        let is_key = bare.contains(" = ") && !bare.contains("outage = []");
        let is_toml = (bare.starts_with('[') || is_key) && !bare.contains("  ");
        if is_toml {
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
    let printed = plain(Path::new(ROOT), "demo --seed 7 --print").stdout;
    let of_batch = |line: &&str| line.contains(" batch ");
    let commands = printed
        .lines()
        .filter(|line| line.starts_with("nav-sim ") && !of_batch(line));
    let seeds: Vec<&str> = commands
        .filter_map(|line| line.split(" --seed ").nth(1))
        .collect();
    let seeds: Vec<&str> = seeds
        .iter()
        .filter_map(|rest| rest.split(' ').next())
        .collect();
    // the recording on which navigation is judged has a seed of its own
    assert_eq!(seeds, ["7", "7", "7", "8", "7", "7", "7"], "{printed}");
    assert!(printed.lines().any(|line| line == "seed = 7"), "{printed}");
}
