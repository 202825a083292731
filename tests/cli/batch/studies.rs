//! Study files, calibrated candidates and scripts.

use super::*;

#[test]
fn bad_studies_are_refused_by_line_before_anything_is_written() {
    let place = place();
    let dir = place.path();
    let cases = [
        (
            "runs = 77",
            "rns = 77",
            "study.toml, line 2: unknown key \"rns\"",
            "did you mean \"runs\"?",
        ),
        (
            "[2, 4, 8, 16]",
            "[]",
            "the grid is empty: no outages[1]",
            "without values",
        ),
        (
            "name = \"wrong\"",
            "name = \"imu\"",
            "two candidate entries are named \"imu\"",
            "\"name\"",
        ),
        (
            "drive.toml",
            "gone.toml",
            "line 6: \"trajectory[1].file\" = \"gone.toml\"",
            "does not exist",
        ),
        (
            "start_s = 30",
            "start_s = 70",
            "outage 70:72 does not lie on the data",
            "60 s",
        ),
        (
            "\"epochs\"]",
            "\"epoch\"]",
            "\"metrics\"",
            "did you mean \"epochs\"?",
        ),
    ];
    for (from, to, message, more) in cases {
        fs::write(dir.join("study.toml"), STUDY.replace(from, to)).unwrap();
        let output = batch(dir, "plan study.toml -o out");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(matches!(output.status.code(), Some(1 | 2)), "{said}");
        assert!(said.contains(message) && said.contains(more), "{said}");
        assert!(!dir.join("out").exists(), "{from}");
    }
    fs::write(dir.join("study.toml"), STUDY).unwrap();
    let said = refused(dir, "run study.toml -o out", 2);
    assert!(said.contains("out holds no plan"), "{said}");
}

#[test]
fn candidates_are_calibrated_in_place_and_a_dry_run_leaves_nothing() {
    let place = place();
    let dir = place.path();
    let calibrated = "{ name = \"II\", calibrate = { estimators = [\"awv\", \"dr-awv\"], fit = \"AR1+WN\", trim = 1, \
         synthesize = { model = \"imu.toml\", replicates = 3, samples = 8192, axes = \"x\", contaminate = \"section5-II\" } } }";
    let study = STUDY.replace("{ name = \"wrong\", model = \"wrong.toml\" }", calibrated);
    let study = study.replace(
        "runs = 77",
        "runs = 8\nreference = \"II/awv\"\nfilters = [15, \"full\"]",
    );
    fs::write(dir.join("study.toml"), study).unwrap();
    let dry = batch(dir, "plan study.toml -o out --dry-run --format json");
    assert!(
        dry.status.success(),
        "{}",
        String::from_utf8_lossy(&dry.stderr)
    );
    let said: serde_json::Value = serde_json::from_slice(&dry.stdout).unwrap();
    assert_eq!(
        (&said["cells"], &said["columns"], &said["units"]),
        (&5.into(), &6.into(), &5.into())
    );
    assert!(!dir.join("out").exists());
    whole(dir, "out");
    assert_eq!(fs::read_dir(dir.join("out/models")).unwrap().count(), 2);
    // models that are lost come back as they were
    let models = || {
        let files = fs::read_dir(dir.join("out/models"))
            .unwrap()
            .map(|e| e.unwrap().path());
        let mut files: Vec<_> = files.map(|p| (p.clone(), fs::read(&p).unwrap())).collect();
        files.sort();
        files
    };
    let made = models();
    fs::remove_dir_all(dir.join("out/models")).unwrap();
    let said = refused(dir, "verify study.toml -o out --seed 1", 1);
    assert!(
        said.contains("`nav-sim batch plan` makes it anew"),
        "{said}"
    );
    done(dir, "plan study.toml -o out");
    assert_eq!(models(), made);
    done(dir, "verify study.toml -o out --seed 1");
    let text = fs::read_to_string(dir.join("out/results/outages.json")).unwrap();
    let rows: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(rows.len(), 4 * 6);
    let is_reference = |r: &&serde_json::Value| r["candidate"] == "II/awv";
    for row in rows.iter().filter(is_reference) {
        assert_eq!(row["asee_ratio_error_pos_e_pct"], 0.0);
    }
    let bound = |r: &serde_json::Value, end: &str| {
        r[format!("asee_ratio_error_roll_ci95_{end}_pct")].as_f64()
    };
    assert!(
        rows.iter()
            .all(|r| bound(r, "low").unwrap() <= bound(r, "high").unwrap())
    );
}

#[test]
fn shipped_studies_are_studies_and_their_schema_knows_their_keys() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let nav_sim = |arguments: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_nav-sim"))
            .current_dir(root)
            .args(arguments)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    };
    let schema: serde_json::Value = serde_json::from_str(&nav_sim(&["schema", "study"])).unwrap();
    for (name, candidates, sets) in [
        ("quick_study", 2, 3),
        ("paper_table1", 9, 1),
        ("paper_table1_10000", 9, 1),
        ("outage_length", 4, 8),
    ] {
        let file = format!("examples/{name}.toml");
        let said = nav_sim(&["check", &file]);
        assert!(
            said.contains(&format!(
                "a study of {candidates} candidates, {sets} outage sets"
            )),
            "{said}"
        );
        let table: toml::Table = fs::read_to_string(root.join(&file))
            .unwrap()
            .parse()
            .unwrap();
        assert!(
            table
                .keys()
                .all(|key| schema["properties"][key].is_object()),
            "{name}"
        );
    }
}

/// As `run` does: by the key of the receiver's rate, with what helps; the full filter takes it.
#[test]
fn fixes_too_rare_for_the_reduction_are_blamed_on_their_rate() {
    let place = place();
    // two biases an axis: one alone is its own filter
    let walk = MODEL.replace(
        "{ type = \"AR1\"",
        "{ type = \"RW\", gamma2 = 1e-14 }, { type = \"AR1\"",
    );
    fs::write(place.path().join("imu.toml"), walk).unwrap();
    let rare = STUDY.replace(
        "{ sweep = { start_s = 30, duration_s = [2, 4, 8, 16] } }, ",
        "",
    ) + "[[gnss]]\nname = \"rare\"\nsettings.rate_hz = 0.001\n";
    fs::write(place.path().join("study.toml"), &rare).unwrap();
    let planned = batch(place.path(), "plan study.toml -o rare");
    let ran = batch(place.path(), "run study.toml -o rare");
    let said = [planned.stderr, ran.stderr]
        .map(|text| String::from_utf8_lossy(&text).into_owned())
        .concat();
    let words = [
        "candidate imu: gnss.rate_hz = 0.001 is refused",
        "hint: raise it, or take the full filter alone",
    ];
    assert!(words.iter().all(|words| said.contains(words)), "{said}");
    fs::write(
        place.path().join("study.toml"),
        format!("filters = [\"full\"]\n{rare}"),
    )
    .unwrap();
    done(place.path(), "plan study.toml -o full");
    done(place.path(), "run study.toml -o full");
}
