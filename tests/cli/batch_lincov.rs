//! `nav-sim batch` with `method = "lincov"`: cells without runs.

use crate::common::batch::*;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The study of the other tests by covariance analysis: five cells, each one unit.
fn place_of_analyses() -> tempfile::TempDir {
    let place = place();
    fs::write(
        place.path().join("study.toml"),
        STUDY.replace("runs = 77", "method = \"lincov\""),
    )
    .unwrap();
    place
}

fn nav_sim(dir: &Path, arguments: &str) {
    let arguments = arguments.split_whitespace();
    let ran = Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .current_dir(dir)
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        matches!(ran.status.code(), Some(0 | 3)),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
}

/// The rows of a table, by the names of its columns.
fn rows(path: &Path) -> Vec<std::collections::HashMap<String, String>> {
    csv::Reader::from_path(path)
        .unwrap()
        .deserialize()
        .map(Result::unwrap)
        .collect()
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Epochs and outages of each cell are those of `run --method lincov`, digit by digit.
#[test]
fn a_cell_is_what_run_finds_without_runs() {
    let place = place_of_analyses();
    let dir = place.path();
    let planned = batch(dir, "plan study.toml -o out");
    let said = String::from_utf8_lossy(&planned.stdout);
    assert!(
        said.starts_with("5 cells × 2 columns by covariance analysis, seed 5: 5 units\nabout "),
        "{said}"
    );
    done(dir, "run study.toml -o out");
    done(dir, "merge study.toml -o out");
    nav_sim(
        dir,
        "run drive.toml wrong.toml --truth imu.toml --outage 30:38 --method lincov -o single",
    );
    let mine = |table: &str| {
        let mut all = rows(&dir.join("out/results").join(table));
        all.retain(|row| row["outage_set"] == "sweep(30,8)" && row["candidate"] == "wrong");
        all
    };
    let (epochs, single) = (mine("epochs.csv"), rows(&dir.join("single/epochs.csv")));
    assert_eq!((epochs.len(), single.len()), (61, 61));
    for (mine, single) in epochs.iter().zip(&single) {
        for (name, value) in single {
            let name = if name == "gnss" { "fix" } else { name };
            assert_eq!(&mine[name], value, "{name}");
        }
    }
    let (outage, summary) = (
        &mine("outages.csv")[0],
        json(&dir.join("single/summary.json")),
    );
    let expected = &summary["outages"][0];
    let is = |name: &str, value: &serde_json::Value| {
        assert_eq!(
            outage[name].parse::<f64>().unwrap(),
            value.as_f64().unwrap(),
            "{name}"
        );
    };
    for state in nav_sim::navigation::simulation::REPORTED_NAMES {
        for figure in ["asee_mean", "rmse_mean", "asee_end", "rmse_end"] {
            is(&format!("{figure}_{state}"), &expected[figure][state]);
        }
    }
    is("nees_end", &expected["nees_end"]);
    is(
        "horizontal_error_end_p50_m",
        &expected["horizontal_error_end_m"]["p50"],
    );
    is(
        "horizontal_error_end_p95_m",
        &expected["horizontal_error_end_m"]["p95"],
    );
    is("verdict_ratio", &summary["verdict"]["ratio"]);
    assert_eq!(
        (outage["runs"].as_str(), outage["verdict"].as_str()),
        ("0", "overconfident")
    );
    for without in [
        "horizontal_error_end_p95_ci95_low_m",
        "horizontal_error_end_max_m",
        "reconvergence_p50_s",
    ] {
        assert!(
            matches!(outage[without].as_str(), "" | "NaN"),
            "{without}: {}",
            outage[without]
        );
    }
    let (low, high) = (
        "asee_ratio_error_pos_e_ci95_low_pct",
        "asee_ratio_error_pos_e_ci95_high_pct",
    );
    assert_eq!(outage[low], outage[high]);
}

#[test]
fn units_are_sharded_mended_and_verified_as_those_of_runs() {
    let place = place_of_analyses();
    let dir = place.path();
    done(dir, "plan study.toml -o one");
    done(dir, "run study.toml -o one -j 1");
    done(dir, "merge study.toml -o one");
    let undisturbed = results(&dir.join("one"));

    done(dir, "plan study.toml -o two");
    done(dir, "run study.toml -o two --shard 1/2 -j 2");
    let said = refused(dir, "merge study.toml -o two", 1);
    assert!(
        said.contains("3 of 5 units are missing or damaged"),
        "{said}"
    );
    done(dir, "run study.toml -o two --shard 0/2");
    let damaged = &units(&dir.join("two"))[2];
    let mut bytes = fs::read(damaged).unwrap();
    bytes[900] ^= 1;
    fs::write(damaged, bytes).unwrap();
    let said = done(dir, "run study.toml -o two");
    assert!(
        said.contains("it is computed again") && said.contains("4 units are done already"),
        "{said}"
    );
    done(dir, "merge study.toml -o two -j 2");
    assert_eq!(results(&dir.join("two")), undisturbed);
    let verified = batch(dir, "verify study.toml -o two --units 5 --seed 1");
    assert!(verified.status.success());
    assert!(String::from_utf8_lossy(&verified.stdout).starts_with("5 of 5 finished units"));
}

/// An outage of 16 s from a start whose tilts are known to 3° is beyond linear theory, one after fixes is not: told by the verdicts
/// of the cells.
#[test]
fn cells_beyond_linear_theory_are_named() {
    let place = place_of_analyses();
    let dir = place.path();
    let study = fs::read_to_string(dir.join("study.toml")).unwrap();
    let (rest, _) = study.split_once("outages =").unwrap();
    let rest = rest.replace(", { name = \"wrong\", model = \"wrong.toml\" }", "");
    let outages = "outages = [{ name = \"start\", windows = [[0, 16]] }, { name = \"later\", windows = [[40, 45]] }]\n";
    let scenario =
        "scenario = [{ name = \"tilted\", settings = { initial.att_sigma_deg = [3, 3, 3] } }]\n";
    fs::write(dir.join("study.toml"), format!("{rest}{scenario}{outages}")).unwrap();
    done(dir, "plan study.toml -o out");
    done(dir, "run study.toml -o out");
    done(dir, "merge study.toml -o out");
    let verdict = |set: &str| {
        rows(&dir.join("out/results/outages.csv"))
            .iter()
            .find(|r| r["outage_set"] == set)
            .unwrap()["verdict"]
            .clone()
    };
    assert_eq!(
        [verdict("start"), verdict("later")],
        ["doubtful", "consistent"]
    );
}

#[test]
fn what_covariance_analysis_cannot_do_is_refused_by_the_plan() {
    let place = place_of_analyses();
    let dir = place.path();
    let study = fs::read_to_string(dir.join("study.toml")).unwrap();
    let refusal = |from: &str, to: &str| {
        fs::write(dir.join("study.toml"), study.replace(from, to)).unwrap();
        let said = refused(dir, "plan study.toml -o out", 2);
        assert!(!dir.join("out").exists());
        said
    };
    let said = refusal(
        "truth = [{ model =",
        "truth = [{ recordings = [\"made\"], name =",
    );
    assert!(
        said.contains("study.toml, line 7: truth[1] has no model, which covariance analysis"),
        "{said}"
    );
    assert!(
        said.contains("hint: calibrate a model of the recordings"),
        "{said}"
    );
    let said = refusal(
        "outages =",
        "scenario = [{ name = \"gate\", settings = { filter.nis_gate = 0.99 } }]\noutages =",
    );
    assert!(
        said.contains("\"scenario[1].settings.filter.nis_gate\" = 0.99 is refused"),
        "{said}"
    );
    assert!(said.contains("hint: leave it out, or sample"), "{said}");
    let said = refusal("\"lincov\"", "\"both\"");
    assert!(
        said.contains("\"method\" = \"both\" is not a method of studies"),
        "{said}"
    );
}
