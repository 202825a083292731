//! `nav-sim batch` as a user runs it: sharded, stopped, damaged, misused.

mod parts;
mod studies;

use crate::common::batch::*;
use std::fs;
use std::path::Path;

const FILES: [&str; 6] = [
    "epochs.csv",
    "outages.csv",
    "outages.json",
    "report.html",
    "runs.csv",
    "study.json",
];

/// Plans and runs the study in one process.
fn whole(dir: &Path, out: &str) -> Vec<(String, Vec<u8>)> {
    done(dir, &format!("plan study.toml -o {out}"));
    done(dir, &format!("run study.toml -o {out} -j 1"));
    done(dir, &format!("merge study.toml -o {out}"));
    results(&dir.join(out))
}

#[test]
fn shards_in_any_order_on_any_threads_merge_to_the_same_bytes() {
    let place = place();
    let dir = place.path();
    let undisturbed = whole(dir, "one");
    assert_eq!(
        undisturbed
            .iter()
            .map(|(name, _)| name.as_str())
            .collect::<Vec<_>>(),
        FILES
    );
    done(dir, "plan study.toml -o three");
    for shard in ["2/3 -j 2", "0/3 -j 1", "1/3 -j 3"] {
        let said = refused(dir, "merge study.toml -o three", 1);
        assert!(
            said.contains("of 50 units are missing or damaged, of the cells sweep(30,2); "),
            "{said}"
        );
        assert!(!dir.join("three/results").exists());
        done(dir, &format!("run study.toml -o three --shard {shard}"));
    }
    done(dir, "merge study.toml -o three -j 2");
    assert_eq!(results(&dir.join("three")), undisturbed);
    let said = done(dir, "run study.toml -o three");
    assert!(
        said.contains("50 units are done already, 0 to do"),
        "{said}"
    );
    let verified = batch(dir, "verify study.toml -o three --units 5 --seed 1");
    assert!(verified.status.success());
    assert!(String::from_utf8_lossy(&verified.stdout).starts_with("5 of 50 finished units"));
}

/// One unit a cell is the same sums as `nav-sim run`, to the last bit.
#[test]
fn a_cell_is_what_run_makes() {
    let place = place();
    let dir = place.path();
    let study = STUDY.replace("unit_runs = 8", "unit_runs = 77");
    fs::write(dir.join("study.toml"), study).unwrap();
    whole(dir, "one");
    let arguments =
        "run drive.toml wrong.toml --truth imu.toml --outage 30:38 --runs 77 --seed 5 -o single";
    let ran = std::process::Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .current_dir(dir)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    assert!(ran.status.success());
    let mut single = csv::Reader::from_path(dir.join("single/epochs.csv")).unwrap();
    let mut all = csv::Reader::from_path(dir.join("one/results/epochs.csv")).unwrap();
    let (single_head, all_head) = (
        single.headers().unwrap().clone(),
        all.headers().unwrap().clone(),
    );
    let at = |head: &csv::StringRecord, name: &str| head.iter().position(|h| h == name).unwrap();
    let (set, candidate) = (at(&all_head, "outage_set"), at(&all_head, "candidate"));
    let mine = all.records().map(Result::unwrap);
    let mine: Vec<_> = mine
        .filter(|r| &r[set] == "sweep(30,8)" && &r[candidate] == "wrong")
        .collect();
    let single: Vec<_> = single.records().map(Result::unwrap).collect();
    assert_eq!((mine.len(), single.len()), (61, 61));
    for (a, b) in mine.iter().zip(&single) {
        for (i, name) in single_head.iter().enumerate() {
            let name = if name == "gnss" { "fix" } else { name };
            assert_eq!(a[at(&all_head, name)], b[i], "{name}");
        }
    }
}

#[test]
fn damaged_units_are_noticed_and_computed_again() {
    let place = place();
    let dir = place.path();
    let undisturbed = whole(dir, "out");
    let files = units(&dir.join("out"));
    assert_eq!(files.len(), UNITS);
    let bytes = fs::read(&files[3]).unwrap();
    fs::write(&files[3], &bytes[..bytes.len() / 2]).unwrap();
    let mut flipped = fs::read(&files[7]).unwrap();
    flipped[500] ^= 1;
    fs::write(&files[7], flipped).unwrap();
    fs::write(&files[9], "").unwrap();
    fs::copy(&files[20], &files[21]).unwrap();
    fs::remove_dir_all(dir.join("out/results")).unwrap();
    let said = refused(dir, "merge study.toml -o out", 1);
    assert!(
        said.contains("4 of 50 units are missing or damaged"),
        "{said}"
    );
    let status = batch(dir, "status study.toml -o out --format json").stdout;
    let status: serde_json::Value = serde_json::from_slice(&status).unwrap();
    assert_eq!(
        (status["done"].as_u64(), status["damaged"].as_u64()),
        (Some(46), Some(4))
    );
    assert!(!dir.join("out/results").exists());
    let said = refused(dir, "verify study.toml -o out --units 1 --seed 1", 3);
    assert!(
        said.contains("4 units are damaged: ") && said.matches(".unit is damaged").count() == 4,
        "{said}"
    );
    refused(dir, "verify study.toml -o out --units 0", 2);
    let said = done(dir, "run study.toml -o out");
    assert_eq!(said.matches("it is computed again").count(), 4, "{said}");
    done(dir, "merge study.toml -o out");
    assert_eq!(results(&dir.join("out")), undisturbed);
}

/// A directory in a unit's place: `merge` says it is damaged, and `run` mends it.
#[test]
fn a_directory_in_the_place_of_a_unit_is_computed_again() {
    let place = place();
    let dir = place.path();
    let undisturbed = whole(dir, "out");
    let files = units(&dir.join("out"));
    fs::remove_file(&files[3]).unwrap();
    fs::create_dir(&files[3]).unwrap();
    fs::write(files[3].join("note"), "mine").unwrap();
    fs::remove_dir_all(dir.join("out/results")).unwrap();
    refused(dir, "merge study.toml -o out", 1);
    let said = done(dir, "run study.toml -o out");
    assert!(
        said.contains(".unit is damaged: it is a directory; it is computed again"),
        "{said}"
    );
    assert_eq!(
        fs::read(files[3].with_extension("unit.damaged").join("note")).unwrap(),
        b"mine"
    );
    done(dir, "merge study.toml -o out");
    assert_eq!(results(&dir.join("out")), undisturbed);
}

#[test]
fn what_changed_since_the_plan_is_refused() {
    let place = place();
    let dir = place.path();
    done(dir, "plan study.toml -o out");
    assert!(done(dir, "plan study.toml -o out").contains("was planned already"));
    fs::write(dir.join("imu.toml"), MODEL.replace("1e-9", "2e-9")).unwrap();
    for command in ["run", "plan"] {
        let said = refused(dir, &format!("{command} study.toml -o out"), 2);
        assert!(
            said.contains("has changed since the study was planned"),
            "{said}"
        );
    }
    fs::write(dir.join("imu.toml"), MODEL).unwrap();
    fs::write(
        dir.join("study.toml"),
        STUDY.replace("runs = 77", "runs = 78"),
    )
    .unwrap();
    for command in ["plan", "run", "merge", "status"] {
        let said = refused(dir, &format!("{command} study.toml -o out"), 2);
        assert!(
            said.contains("\"runs\" is 77 in the plan, 78 in the study"),
            "{said}"
        );
    }
    fs::write(dir.join("study.toml"), STUDY.replace("seed = 5\n", "")).unwrap();
    done(dir, "status study.toml -o out");
    let said = refused(dir, "plan study.toml -o out --seed 6", 2);
    assert!(
        said.contains("\"seed\" is 5 in the plan, 6 in the study"),
        "{said}"
    );
    // --seed wins over the study's, then and later
    fs::write(dir.join("study.toml"), STUDY).unwrap();
    done(dir, "plan study.toml -o seven --seed 7");
    done(dir, "run study.toml -o seven --shard 0/50");
    assert!(
        fs::read_to_string(dir.join("seven/plan.json"))
            .unwrap()
            .contains("\"seed\": 7")
    );
    let plan = fs::read_to_string(dir.join("out/plan.json")).unwrap();
    let other = plan.replace("\"version\": \"", "\"version\": \"0.0.");
    fs::write(dir.join("out/plan.json"), other).unwrap();
    let said = refused(dir, "run study.toml -o out", 2);
    assert!(said.contains("the plan was made by nav-sim 0.0."), "{said}");
}

/// A file that a study names and that is not there is told by line and key, before anything is planned.
#[test]
fn a_named_file_that_is_missing_is_told_by_its_key() {
    let place = place();
    let dir = place.path();
    fs::write(
        dir.join("study.toml"),
        STUDY.replace("wrong.toml", "wrnog.toml"),
    )
    .unwrap();
    let expected = "error: study.toml, line 8: \"candidate[2].model\" = \"wrnog.toml\" names wrnog.toml, which does not exist";
    let said = refused(dir, "plan study.toml -o out", 2);
    assert!(
        said.starts_with(expected) && said.contains("hint: paths are relative"),
        "{said}"
    );
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .current_dir(dir)
        .args(["check", "study.toml"])
        .output();
    let output = output.unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8_lossy(&output.stderr).starts_with(expected),
        "{output:?}"
    );
    let contaminated = |name: &str| {
        let calibrated = format!(
            "{{ name = \"II\", calibrate = {{ synthesize = {{ model = \"imu.toml\", contaminate = \"{name}\" }} }} }}"
        );
        let study = STUDY.replace("{ name = \"wrong\", model = \"wrong.toml\" }", &calibrated);
        fs::write(dir.join("study.toml"), study).unwrap();
        refused(dir, "plan study.toml -o out", 2)
    };
    let key = "error: study.toml, line 8: \"candidate[2].calibrate.synthesize.contaminate\" = ";
    let said = contaminated("gone.toml");
    assert!(
        said.starts_with(&format!(
            "{key}\"gone.toml\" names gone.toml, which does not exist"
        )),
        "{said}"
    );
    let said = contaminated("section5-2");
    assert!(
        said.starts_with(key) && said.contains("hint: did you mean \"section5-I\"?"),
        "{said}"
    );
    assert!(!dir.join("out").exists());
}

/// With every unit done there is nothing to compute, and yet the results would not be of the inputs that stand there.
#[test]
fn an_input_that_changed_when_all_was_done_is_told() {
    let place = place();
    let dir = place.path();
    let undisturbed = whole(dir, "out");
    fs::write(dir.join("wrong.toml"), MODEL.replace("4e-12", "5e-13")).unwrap();
    for command in ["run", "status", "merge", "verify"] {
        let said = refused(dir, &format!("{command} study.toml -o out"), 2);
        assert!(
            said.contains("wrong.toml has changed since the study was planned"),
            "{said}"
        );
    }
    fs::write(dir.join("wrong.toml"), MODEL.replace("4e-12", "4e-13")).unwrap();
    let output = batch(
        dir,
        "verify study.toml -o out --units 1 --seed 1 --format json",
    );
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (found["whole"].as_u64(), found["compared"].as_u64()),
        (Some(UNITS as u64), Some(1))
    );
    // what is not on this machine has not changed
    fs::remove_file(dir.join("wrong.toml")).unwrap();
    done(dir, "merge study.toml -o out");
    assert_eq!(results(&dir.join("out")), undisturbed);
}

#[test]
fn units_of_another_plan_are_named_and_left_out() {
    let place = place();
    let dir = place.path();
    whole(dir, "five");
    fs::write(
        dir.join("study.toml"),
        STUDY.replace("seed = 5", "seed = 6"),
    )
    .unwrap();
    let undisturbed = whole(dir, "six");
    let stray = units(&dir.join("five")).remove(0);
    let inner = dir
        .join("six/units")
        .join(stray.parent().unwrap().file_name().unwrap());
    fs::create_dir_all(&inner).unwrap();
    fs::copy(&stray, inner.join(stray.file_name().unwrap())).unwrap();
    for command in ["plan", "run", "merge", "status"] {
        let said = done(dir, &format!("{command} study.toml -o six"));
        assert!(
            said.contains("unit files of another plan are left out: 1, such as six/units/"),
            "{said}"
        );
    }
    assert_eq!(results(&dir.join("six")), undisturbed);
}

/// Names with a slash, several filters: every candidate and filter has a row of its own, with its numbers.
#[test]
fn every_candidate_and_filter_is_in_the_ratio_table() {
    let place = place();
    let dir = place.path();
    let candidates = "{ name = \"clean/awv\", model = \"imu.toml\" }, { name = \"III/awv\", model = \"wrong.toml\" }, \
         { name = \"II\", calibrate = { estimators = [\"awv\", \"dr-awv\"], fit = \"AR1+WN\", trim = 1, \
         synthesize = { model = \"imu.toml\", replicates = 3, samples = 8192, axes = \"x\" } } }";
    let study = STUDY.replace(
        "{ model = \"imu.toml\" }, { name = \"wrong\", model = \"wrong.toml\" }",
        candidates,
    );
    let study = study.replace(
        "runs = 77",
        "runs = 8\nreference = \"III/awv\"\nfilters = [15, \"full\"]",
    );
    fs::write(
        dir.join("study.toml"),
        study.replace("[2, 4, 8, 16]", "[8]"),
    )
    .unwrap();
    // two processes, which 15 states reduce to one
    let two = MODEL.replace(
        "4e-12 }",
        "4e-12 }, { type = \"AR1\", phi = 0.99, sigma2 = 1e-8 }",
    );
    fs::write(dir.join("wrong.toml"), two).unwrap();
    whole(dir, "out");
    let page = fs::read_to_string(dir.join("out/results/report.html")).unwrap();
    let (_, ratios) = page
        .split_once(": ASEE relative to III/awv with the same filter</h2>")
        .unwrap();
    let ratios = ratios.split("</table>").next().unwrap();
    let filters = ["15", "full"];
    for name in ["clean/awv", "III/awv", "II"]
        .iter()
        .flat_map(|c| filters.map(|f| format!("{c} {f}")))
    {
        let rows: Vec<&str> = ratios
            .split("<tr>")
            .filter(|row| row.contains(&format!(">{name}<")))
            .collect();
        assert_eq!(rows.len(), 1, "{name}: {ratios}");
        // two states are shown, each by estimator: two for the calibrated ones, none for the others
        let filled = rows[0].matches('±').count() + rows[0].matches("reference").count();
        assert_eq!(
            filled,
            if name.starts_with("II ") { 4 } else { 2 },
            "{ratios}"
        );
        assert_eq!(
            rows[0].contains("reference"),
            name.starts_with("III"),
            "{ratios}"
        );
    }
    let text = fs::read_to_string(dir.join("out/results/outages.json")).unwrap();
    let rows: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(rows.len(), 4 * 2);
    let mut different = false;
    for row in &rows {
        assert_eq!(row["reference"], "III/awv");
        let of_reference = |r: &&serde_json::Value| {
            r["candidate"] == row["reference"] && r["filter"] == row["filter"]
        };
        let own = rows.iter().find(of_reference).unwrap();
        assert_eq!(row["nees_mean_reference"], own["nees_mean"]);
        different |= own["nees_mean"] != rows[0]["nees_mean_reference"];
    }
    assert!(different, "the two filters are two references");
}

#[test]
fn tables_of_an_earlier_plan_do_not_survive() {
    let place = place();
    let dir = place.path();
    whole(dir, "out");
    fs::remove_file(dir.join("out/plan.json")).unwrap();
    let study = STUDY
        .replace("seed = 5", "seed = 6")
        .replace(", \"epochs\"]", "]");
    fs::write(dir.join("study.toml"), &study).unwrap();
    let said = done(dir, "plan study.toml -o out");
    assert!(
        said.contains("unit files of another plan are left out: 50, such as"),
        "{said}"
    );
    refused(dir, "merge study.toml -o out", 1);
    let again = whole(dir, "out");
    let names: Vec<&str> = again.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        FILES
            .into_iter()
            .filter(|f| !f.starts_with("epochs"))
            .collect::<Vec<_>>()
    );
    assert_eq!(again, whole(dir, "fresh"));
}

#[test]
fn another_seed_than_the_plans_is_refused() {
    let place = place();
    let dir = place.path();
    done(dir, "plan study.toml -o out");
    for command in ["run", "merge", "status", "plan"] {
        let said = refused(dir, &format!("{command} study.toml -o out --seed 6"), 2);
        assert!(
            said.contains("\"seed\" is 5 in the plan, 6 in the study"),
            "{said}"
        );
    }
    done(dir, "status study.toml -o out --seed 5");
}
