//! `nav-sim compare` on made-up run directories whose ratios are known.

use assert_cmd::Command;
use nav_sim::app::{Answer, Input, Manifest};
use nav_sim::commands::run::{Navigation, RunAnswer, RunOrigin};
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{EpochSums, OutageRecord, RunRecord, RunResult};
use std::path::Path;

const RUNS: u32 = 20;

/// Runs whose filter believes `factor` times 1 + 2 % · run; the outage is 4 to 8 s of 10.
/// An input with the hash of its contents.
fn input(role: &str, path: &str, contents: &[u8]) -> Input {
    let blake3 = blake3::hash(contents).to_hex().to_string();
    Input {
        role: role.to_owned(),
        path: path.to_owned(),
        blake3,
    }
}

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
fn write(directory: &Path, factor: f64, change: impl FnOnce(&mut Manifest, &mut RunOrigin)) {
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
    std::fs::create_dir_all(directory).unwrap();
    for file in answer.files() {
        let text: String = file.parts.collect();
        let blake3 = blake3::hash(text.as_bytes()).to_hex().to_string();
        std::fs::write(directory.join(&*file.name), text).unwrap();
        manifest.outputs.insert(file.name.into_owned(), blake3);
    }
    manifest.record = answer.record().as_object().unwrap().clone();
    let text = serde_json::to_string(&manifest).unwrap();
    std::fs::write(directory.join("manifest.json"), text).unwrap();
}

struct Ran {
    code: i32,
    stdout: String,
    stderr: String,
}

fn compare(directory: &Path, arguments: &[&str]) -> Ran {
    let output = Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .current_dir(directory)
        .args(["compare", "--force"])
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ran {
        code: output.status.code().unwrap(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

#[test]
fn ratios_are_those_that_were_made() {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("I_awv"), 1.0, |_, _| {});
    write(&directory.path().join("II_awv"), 1.75, |_, _| {});
    write(&directory.path().join("II_sr-awv"), 0.9, |_, _| {});
    let ran = compare(
        directory.path(),
        &["I_awv", "II_awv", "II_sr-awv", "--reference", "I_awv"],
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let covered = "95 % intervals (±) of the runs alone: no model has draws beside it";
    for cell in [
        "+75.0",
        "-10.00",
        "SR-AWV (%)",
        "reference",
        "4–8 s",
        covered,
    ] {
        assert!(ran.stdout.contains(cell), "{cell} in\n{}", ran.stdout);
    }
    // errors are 1; the filters believe 1, 1.75 and 0.9 times (1 to 1.38): the second is underconfident for 20 runs
    let mut lines = ran.stdout.lines();
    let cost = "uncertainty of East position against I_awv: II_awv +75 %, II_sr-awv -10 %";
    assert_eq!(lines.next(), Some(cost), "{}", ran.stdout);
    let verdict = lines.next().unwrap();
    let words = [
        "1 of 3 filters underconfident, most: II_awv (NEES 9.00, 0.",
        "2 of 3 filters undecided, most: ",
    ];
    assert!(
        words.iter().all(|words| ran.stdout.contains(words)),
        "{verdict}"
    );
    assert!(
        ran.stdout.lines().count() <= 20
            && ran.stdout.lines().all(|line| line.chars().count() <= 120)
    );
    // the same table for other programs, outages by their times
    let table = |form| {
        let runs = [
            "I_awv",
            "II_awv",
            "II_sr-awv",
            "--reference",
            "I_awv",
            "--state",
            "pos_e_m",
        ];
        compare(directory.path(), &[&runs[..], &["--table", form]].concat()).stdout
    };
    let csv = table("csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert!(
        rows.len() == 4
            && rows[0].join(",").starts_with(
                "scenario,estimator,run,reference,outage_start_s,outage_end_s,state,\
        ratio_error_pct,ci95_low_pct,ci95_high_pct,calibration_half_pct,abs_ratio_error_pct,"
            ),
        "{csv}"
    );
    assert_eq!(
        rows[1][..8],
        ["I", "AWV", "I_awv", "I_awv", "4", "8", "pos_e_m", "0"]
    );
    assert_eq!(
        rows[2][..7],
        ["II", "AWV", "II_awv", "I_awv", "4", "8", "pos_e_m"]
    );
    let number = |cell: &str| cell.parse::<f64>().unwrap();
    for (row, pct) in [(&rows[2], 75.0), (&rows[3], -10.0)] {
        assert!(
            (number(row[7]) - pct).abs() < 1e-9 && (number(row[11]) - f64::abs(pct)).abs() < 1e-9,
            "{csv}"
        );
        assert!(
            number(row[8]) <= number(row[7]) && number(row[7]) <= number(row[9]),
            "{csv}"
        );
        assert_eq!(row[10], "", "{csv}");
    }
    let latex = table("latex");
    assert!(
        latex.starts_with("\\begin{tabular}{lrrr}") && latex.contains("II & 4--8 s & +75.0 "),
        "{latex}"
    );
    assert!(
        latex.contains("& $-$10.00 ") && latex.contains("East SR-AWV (\\%)"),
        "{latex}"
    );
    let text = std::fs::read_to_string(directory.path().join("comparison.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        (&json["reference"], &json["paired"]),
        (&"I_awv".into(), &true.into())
    );
    let kinds: Vec<&str> = json["verdicts"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v["kind"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["undecided", "underconfident", "undecided"]);
    let row = json["rows"]
        .as_array()
        .unwrap()
        .iter()
        .find(|r| r["run"] == "II_awv" && r["state"] == "roll_deg");
    let row = row.unwrap();
    assert!(
        (row["ratio_error_pct"].as_f64().unwrap() - 75.0).abs() < 1e-9,
        "{row}"
    );
    assert!(
        (row["ci95_pct"][1].as_f64().unwrap() - 75.0).abs() < 1e-6,
        "{row}"
    );
    assert!(
        row["rmse_end_ratio_error_pct"].as_f64().unwrap().abs() < 1e-9,
        "{row}"
    );
}

/// The verdict is that of the run's own directory: covariance analysis may know more than these runs show.
#[test]
fn verdicts_are_those_of_the_directories() {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("a"), 1.0, |_, _| {});
    write(&directory.path().join("b"), 1.0, |_, _| {});
    let summary = directory.path().join("b/summary.json");
    let text = std::fs::read_to_string(&summary).unwrap();
    let doubted = text.replacen("\"kind\": \"undecided\"", "\"kind\": \"overconfident\"", 1);
    assert_ne!(doubted, text);
    std::fs::write(&summary, doubted).unwrap();
    let manifest = directory.path().join("b/manifest.json");
    let mut json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&manifest).unwrap()).unwrap();
    json["outputs"]
        .as_object_mut()
        .unwrap()
        .remove("summary.json"); // which would not be what was written
    std::fs::write(manifest, json.to_string()).unwrap();
    let ran = compare(directory.path(), &["a", "b", "--reference", "a"]);
    let verdict = "1 of 2 filters overconfident, most: b (NEES 9.00, ";
    assert!(
        ran.stdout.contains(verdict),
        "{}\n{}",
        ran.stdout,
        ran.stderr
    );
    assert!(
        ran.stdout.contains("1 of 2 filters undecided, most: "),
        "{}",
        ran.stdout
    );
}

/// A file is replaced only if it is a comparison.
#[test]
fn a_file_that_is_no_comparison_is_left_alone() {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("a"), 1.0, |_, _| {});
    let path = directory.path().join("comparison.json");
    std::fs::write(&path, "{\"mine\": 1}").unwrap();
    let ran = compare(directory.path(), &["a", "--reference", "a"]);
    assert_eq!(ran.code, 2);
    assert!(
        ran.stderr
            .starts_with("error: comparison.json is not of this command: not replaced\n\nhint: "),
        "{}",
        ran.stderr
    );
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "{\"mine\": 1}");
    std::fs::remove_file(&path).unwrap();
    for _ in 0..2 {
        let ran = compare(directory.path(), &["a", "--reference", "a"]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
    }
}

/// Nine models by three estimators, as the paper's: no line of a table is wider than 120 characters, and every cell is there.
/// Paths are as short as they can be told apart in the legend and in the verdicts.
#[test]
fn many_runs_in_deep_directories_are_readable() {
    let directory = tempfile::tempdir().unwrap();
    let deep = "a/very/deep/directory/of/results";
    let names: Vec<String> = ["I", "II", "III"]
        .iter()
        .flat_map(|scenario| ["awv", "sr-awv", "dr-awv"].map(|e| format!("{deep}/{scenario}_{e}")))
        .collect();
    for (k, name) in (0_u32..).zip(&names) {
        write(
            &directory.path().join(name),
            1.0 + 0.01 * f64::from(k),
            |_, _| {},
        );
    }
    let all: Vec<&str> = names
        .iter()
        .map(String::as_str)
        .chain(["--reference", names[0].as_str()])
        .collect();
    let ran = compare(directory.path(), &all);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stdout.lines().all(|line| line.chars().count() <= 120),
        "{}",
        ran.stdout
    );
    assert!(ran.stdout.lines().count() <= 20, "{}", ran.stdout);
    for word in ["East AWV (%)", "East SR-AWV (%)", "roll DR-AWV (%)", "III"] {
        assert!(
            ran.stdout.contains(&format!("  {word}")),
            "{word}: {}",
            ran.stdout
        );
    }
    assert!(
        !ran.stdout
            .lines()
            .any(|line| line.contains(&format!("{deep}/II_"))),
        "{}",
        ran.stdout
    );
    let (a, b) = (format!("{deep}/x/drive"), format!("{deep}/y/drive"));
    for (name, factor) in [(&a, 1.0), (&b, 1.1)] {
        write(&directory.path().join(name), factor, |_, _| {});
    }
    let ran = compare(
        directory.path(),
        &[&a, &b, "--reference", &names[0], "--plot", "c.svg"],
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let svg = std::fs::read_to_string(directory.path().join("c.svg")).unwrap();
    assert!(
        svg.contains(">x/drive<") && svg.contains(">y/drive<") && !svg.contains(">a/very"),
        "{svg}"
    );
}

#[test]
fn another_trajectory_or_other_outages_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("a"), 1.0, |_, _| {});
    write(&directory.path().join("b"), 1.0, |manifest, _| {
        manifest.inputs[0] = input("trajectory", "u.csv", b"u")
    });
    write(&directory.path().join("c"), 1.0, |_, origin| {
        origin.configuration.outage = Some(vec![])
    });
    let ran = compare(directory.path(), &["b", "--reference", "a"]);
    assert_eq!(ran.code, 2);
    assert!(
        ran.stderr
            .starts_with("error: b: not the trajectory of the reference\n\nhint: "),
        "{}",
        ran.stderr
    );
    let ran = compare(directory.path(), &["c", "--reference", "a"]);
    assert_eq!(ran.code, 2);
    let expected = "error: c: the outages differ: none against 4:8 of the reference";
    assert!(ran.stderr.starts_with(expected), "{}", ran.stderr);
    assert!(!directory.path().join("comparison.json").exists());
}

#[test]
fn another_seed_or_truth_is_said_and_unpaired() {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("a"), 1.0, |_, _| {});
    write(&directory.path().join("b"), 1.2, |manifest, _| {
        manifest.seed = Some(8);
        manifest.inputs.truncate(1);
    });
    write(&directory.path().join("c"), 1.2, |_, _| {});
    let ran = compare(
        directory.path(),
        &["b", "c", "--reference", "a", "--format", "json"],
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stderr
            .contains("warning: b: the seed is not that of the reference"),
        "{}",
        ran.stderr
    );
    assert!(
        ran.stderr
            .contains("warning: b: the source of errors is not"),
        "{}",
        ran.stderr
    );
    let json: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    let ci = &json["rows"][0]["ci95_pct"];
    assert!(
        ci[1].as_f64().unwrap() - ci[0].as_f64().unwrap() > 5.0,
        "{ci}"
    );
    assert_eq!(json["paired"], false);
    // the other run is paired all the same
    for row in json["rows"].as_array().unwrap() {
        assert_eq!(row["paired"], row["run"] == "c", "{row}");
    }
}

#[test]
fn a_damaged_table_is_refused_by_file_line_and_column() {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("a"), 1.0, |_, _| {});
    let path = directory.path().join("a/epochs.csv");
    let text = std::fs::read_to_string(&path)
        .unwrap()
        .replacen("\n3,", "\nthree,", 1);
    std::fs::write(&path, text).unwrap();
    let ran = compare(directory.path(), &["a", "--reference", "a"]);
    assert_eq!(ran.code, 2);
    let expected = "error: a/epochs.csv, line 5: column \"t_s\": \"three\" is not a number";
    assert!(ran.stderr.starts_with(expected), "{}", ran.stderr);
}

/// A table whose numbers are numbers, but not those that were written.
#[test]
fn a_table_that_was_changed_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("a"), 1.0, |_, _| {});
    let epochs = directory.path().join("a/epochs.csv");
    let text = std::fs::read_to_string(&epochs).unwrap();
    let row = text.lines().nth(6).unwrap();
    let changed = |cell: &str| {
        let mut cells: Vec<&str> = row.split(',').collect();
        cells[3] = cell;
        text.replacen(row, &cells.join(","), 1)
    };
    let refused = |expected: &str| {
        let ran = compare(directory.path(), &["a", "--reference", "a"]);
        assert_eq!(ran.code, 2);
        assert!(
            ran.stderr.starts_with(expected) && ran.stderr.contains("\n\nhint: "),
            "{}",
            ran.stderr
        );
        assert!(!directory.path().join("comparison.json").exists());
    };
    std::fs::write(&epochs, changed("nan")).unwrap();
    refused("error: a/epochs.csv, line 7: column \"asee_pos_e_m\": NaN is not a finite number");
    std::fs::write(&epochs, changed("2.5")).unwrap();
    refused("error: a/epochs.csv: differs from manifest.json");
}

#[test]
fn an_unknown_state_is_refused_with_the_known_ones() {
    let directory = tempfile::tempdir().unwrap();
    let ran = compare(
        directory.path(),
        &["a", "--reference", "a", "--state", "east"],
    );
    assert_eq!(ran.code, 2);
    assert!(
        ran.stderr
            .contains("--state east is no state\n\nhint: one of pos_n_m, "),
        "{}",
        ran.stderr
    );
}
