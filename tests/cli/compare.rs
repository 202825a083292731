//! Made-up run directories whose ratios are known, compared in `compare.md`.

use super::readme::transcript;
use crate::common::drive::Place;
use nav_sim::app::{Answer, Input, Manifest};
use nav_sim::commands::run::{Navigation, RunAnswer, RunOrigin};
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{EpochSums, OutageRecord, RunRecord, RunResult};

const RUNS: u32 = 20;

/// An input with the hash of its contents.
fn input(role: &str, path: &str, contents: &[u8]) -> Input {
    let blake3 = blake3::hash(contents).to_hex().to_string();
    Input {
        role: role.to_owned(),
        path: path.to_owned(),
        blake3,
    }
}

/// Runs whose filter believes `factor` times 1 + 2 % · run; the outage is 4 to 8 s of 10.
fn result(factor: f64) -> RunResult {
    let sees = || (0..RUNS).map(move |run| factor * (1.0 + 0.02 * f64::from(run)));
    let epoch = |t: u32| EpochSums {
        t_s: f64::from(t),
        gnss: !(4..8).contains(&t),
        count: u64::from(RUNS),
        see: [sees().sum(); 9],
        see_sq: [sees().map(|s| s * s).sum(); 9],
        error_sq: [f64::from(RUNS); 9],
        error_4: [f64::from(RUNS); 9],
        nees: [9.0 * f64::from(RUNS), 99.0 * f64::from(RUNS)],
        covered: 19,
        ..EpochSums::default()
    };
    let run = |(run, see): (u32, f64)| RunRecord {
        run: u64::from(run),
        diverged: false,
        outages: vec![OutageRecord {
            see_mean: [see; 9],
            see_end: [see; 9],
            error_end: [1.0; 9],
            nees_end: 9.0 / (see * see),
            ..OutageRecord::default()
        }],
        nis: (6.0, 6),
        nees_mean: 9.0,
        covered: 0.95,
        normalised_sq: [1.0; 9],
    };
    RunResult {
        epochs: (0..10).map(epoch).collect(),
        runs: (0..RUNS).zip(sees()).map(run).collect(),
        outages: vec![(4.0, 8.0)],
        filter_states: 15,
        fix_components: 6,
        coverage_level: 0.95,
        run_epochs: 1000,
        ..RunResult::default()
    }
}

/// Writes the directory of a made-up run; `change` has its manifest and origin.
fn write(
    place: &Place,
    directory: &str,
    factor: f64,
    change: impl FnOnce(&mut Manifest, &mut RunOrigin),
) {
    let outage = Some(vec![Outage {
        start_s: 4.0,
        end_s: 8.0,
    }]);
    let mut origin = RunOrigin {
        configuration: Scenario {
            outage,
            ..Scenario::default()
        },
        spread: false,
        estimator: None,
        independent_windows: None,
    };
    let inputs = vec![
        input("trajectory", "t.csv", b"t"),
        input("truth", "m.toml", b"m"),
        input("model", "f.toml", &factor.to_le_bytes()),
    ];
    let mut manifest = Manifest::new("run", Default::default(), inputs.clone());
    manifest.seed = Some(7);
    change(&mut manifest, &mut origin);
    let answer = RunAnswer {
        navigation: Navigation::of_runs(result(factor), 7),
        throughput_epochs_per_s: 1.0,
        origin,
        inputs,
        track: Vec::new(),
    };
    for file in answer.files() {
        let text: String = file.parts.collect();
        let blake3 = blake3::hash(text.as_bytes()).to_hex().to_string();
        place.write(&format!("{directory}/{}", file.name), text);
        manifest.outputs.insert(file.name.into_owned(), blake3);
    }
    manifest.record = answer.record().as_object().unwrap().clone();
    let text = serde_json::to_string(&manifest).unwrap();
    place.write(&format!("{directory}/manifest.json"), text);
}

#[test]
fn comparisons_of_known_ratios() {
    let place = Place::new();
    for (name, factor) in [
        ("I_awv", 1.0),
        ("II_awv", 1.75),
        ("II_sr-awv", 0.9),
        ("judged", 1.0),
        ("deep/x/drive", 1.0),
        ("deep/y/drive", 1.1),
    ] {
        write(&place, name, factor, |_, _| {});
    }
    for (k, scenario) in (0..).zip(["I", "II", "III"]) {
        for (l, estimator) in (0..).zip(["awv", "sr-awv", "dr-awv"]) {
            let factor = 1.0 + 0.01 * f64::from(3 * k + l);
            let name = format!("deep/results/{scenario}_{estimator}");
            write(&place, &name, factor, |_, _| {});
        }
    }
    write(&place, "other_seed", 1.2, |manifest, _| {
        manifest.seed = Some(8);
        manifest.inputs.truncate(1);
    });
    write(&place, "other_trajectory", 1.0, |manifest, _| {
        manifest.inputs[0] = input("trajectory", "u.csv", b"u");
    });
    write(&place, "no_outages", 1.0, |_, origin| {
        origin.configuration.outage = Some(vec![]);
    });
    transcript("compare.md", &place);
}
