//! `check`, `init` and `schema`: files that the program makes and knows.

use super::command_line::nav_sim;

/// Every file is looked at: one that is wrong does not hide those after it. Recordings without a clock need a
/// rate.
#[test]
fn check_looks_at_every_file() {
    let place = tempfile::tempdir().unwrap();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::write(place.path().join("bad.toml"), "[run]\nruns = 0\n").unwrap();
    std::fs::write(place.path().join("worse.toml"), "[gps]\n").unwrap();
    let timeless: String = (0..100)
        .map(|k| format!("{},{}\n", f64::from(k % 7) * 1e-3, f64::from(k % 5) * 1e-4))
        .collect();
    std::fs::write(
        place.path().join("timeless.csv"),
        format!("accel_x_m_s2,gyro_x_rad_s\n{timeless}"),
    )
    .unwrap();
    let check = |arguments: &[&str]| {
        let output = nav_sim()
            .current_dir(place.path())
            .arg("check")
            .args(arguments)
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (
            output.status.code().unwrap(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let good = root.join("calib_data/tactical.toml");
    let (code, out, said) = check(&["bad.toml", "worse.toml", good.to_str().unwrap()]);
    assert_eq!(code, 2, "{said}");
    assert!(
        said.contains("bad.toml, line 2") && said.contains("worse.toml, line 1"),
        "{said}"
    );
    assert!(said.contains("2 of 3 files refused"), "{said}");
    assert!(out.contains("tactical.toml: a noise model"), "{out}");
    // warnings stay with --quiet, and have their hints
    let (_, _, said) = check(&["timeless.csv", "bad.toml", "--quiet"]);
    assert!(
        said.contains("warning: timeless.csv: ") && said.contains("; give the rate with --rate-hz"),
        "{said}"
    );
    assert!(
        check(&["timeless.csv"])
            .2
            .contains("hint: give the rate with --rate-hz")
    );
    let (code, out, said) = check(&["timeless.csv", "--rate-hz", "50"]);
    assert!(
        code == 0 && out.contains("2 channels of 100 samples at 50 Hz"),
        "{out}{said}"
    );
    let entry = root.join("calib_data/catalogue/stim300.toml");
    let (code, out, said) = check(&[entry.to_str().unwrap()]);
    assert!(
        code == 0 && out.contains("stim300.toml: a catalogue entry, Sensonor (Safran) STIM300"),
        "{out}{said}"
    );
    let array = root.join("calib_data/formats/array.npy");
    assert_eq!(check(&[array.to_str().unwrap(), "--rate-hz", "100"]).0, 0);
}

/// A file of every kind, each of which is what it says it is; what a scenario and a model come to is printed.
#[test]
fn the_files_of_init_are_what_they_should_be() {
    let place = tempfile::tempdir().unwrap();
    let ran = |arguments: &[&str]| {
        let output = nav_sim()
            .current_dir(place.path())
            .args(arguments)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    };
    ran(&["init", "."]);
    let kinds = [
        ("scenario.toml", "a scenario"),
        ("imu.toml", "a noise model"),
        ("motion.toml", "a trajectory"),
        ("contamination.toml", "a contamination"),
        ("initial.toml", "an initial state"),
        ("examples/quick_study.toml", "a study"),
    ];
    for (file, kind) in kinds {
        let said = ran(&["check", file]);
        assert!(said.starts_with(&format!("{file}: {kind}")), "{said}");
    }
    // Every key of the file is in the schema, each of its processes is one of the schema's.
    let schema: serde_json::Value = serde_json::from_str(&ran(&["schema", "model"])).unwrap();
    let model: toml::Table = std::fs::read_to_string(place.path().join("imu.toml"))
        .unwrap()
        .parse()
        .unwrap();
    for (key, _) in &model {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
    let kinds = schema["properties"]["gyro"]["properties"]["processes"]["items"]["oneOf"]
        .as_array()
        .unwrap();
    for process in model["gyro"]["processes"].as_array().unwrap() {
        let process = process.as_table().unwrap();
        let is_own = |k: &&serde_json::Value| {
            k["properties"]["type"]["const"] == process["type"].as_str().unwrap()
        };
        let kind = kinds.iter().find(is_own).unwrap();
        assert!(
            process
                .keys()
                .all(|key| kind["properties"][key].is_object()),
            "{process}"
        );
    }
}

/// Tables that a word tells apart: the schema has that word, and every key under it.
#[test]
fn schemas_describe_the_tables_of_profiles_and_contaminations() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    for (kind, file, word, lists) in [
        ("profile", "examples/motion.toml", "kind", &["segment"][..]),
        (
            "profile",
            "trajectories/figure_eight.toml",
            "kind",
            &["segment"],
        ),
        (
            "contamination",
            "examples/contamination.toml",
            "operation",
            &["accel", "gyro"],
        ),
        (
            "contamination",
            "calib_data/contamination/section5-III.toml",
            "operation",
            &["accel", "gyro"],
        ),
    ] {
        let output = nav_sim().args(["schema", kind]).output().unwrap();
        let schema: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let definition = |of: &serde_json::Value| {
            schema["$defs"][of["$ref"].as_str().unwrap().rsplit('/').next().unwrap()].clone()
        };
        let table: toml::Table = std::fs::read_to_string(root.join(file))
            .unwrap()
            .parse()
            .unwrap();
        assert!(
            table
                .keys()
                .all(|key| schema["properties"][key].is_object()),
            "{file}"
        );
        for (list, entry) in lists
            .iter()
            .filter_map(|l| Some((l, table.get(*l)?.as_array()?)))
            .flat_map(|(l, e)| e.iter().map(move |e| (l, e)))
        {
            let items = definition(&schema["properties"][list]["items"]);
            let name = entry[word].as_str().unwrap();
            let mut kinds = items["oneOf"].as_array().unwrap().iter();
            let own = kinds
                .find(|of| of["properties"][word]["const"] == name)
                .unwrap();
            let keys = &own["properties"];
            let alternatives = own["oneOf"].as_array().into_iter().flatten();
            let is_known = |key: &String| {
                let mut parts = alternatives.clone().chain([&items]);
                keys[key].is_object() || parts.any(|part| part["properties"][key].is_object())
            };
            assert!(
                entry.as_table().unwrap().keys().all(is_known),
                "{file}: {entry}"
            );
        }
    }
}

/// What `init` makes is all that the examples of the help texts name.
#[test]
fn init_makes_every_file_that_the_help_names() {
    let place = tempfile::tempdir().unwrap();
    nav_sim()
        .args(["init", place.path().to_str().unwrap()])
        .assert()
        .success();
    let help =
        String::from_utf8(nav_sim().args(["man", "--help"]).output().unwrap().stdout).unwrap();
    assert!(help.starts_with("Examples:"));
    let mut texts = vec![help];
    for command in [
        "wv",
        "calibrate",
        "synthesize",
        "trajectory",
        "run",
        "fuse",
        "compare",
        "demo",
        "check",
        "batch",
    ] {
        texts.push(
            String::from_utf8(nav_sim().args([command, "--help"]).output().unwrap().stdout)
                .unwrap(),
        );
    }
    for sub in ["generate", "check", "convert", "plot", "record"] {
        texts.push(
            String::from_utf8(
                nav_sim()
                    .args(["trajectory", sub, "--help"])
                    .output()
                    .unwrap()
                    .stdout,
            )
            .unwrap(),
        );
    }
    for text in texts {
        let examples = text.split("\n\n").next().unwrap();
        for word in examples.split_whitespace() {
            if ["calib_data/", "trajectories/", "examples/"]
                .iter()
                .any(|d| word.starts_with(d))
            {
                assert!(place.path().join(word).exists(), "{word}");
            }
        }
    }
}

/// What `init` cannot finish it takes back; what was there stays.
#[test]
fn init_makes_all_its_files_or_none() {
    let directory = tempfile::tempdir().unwrap();
    let study = directory.path().join("study");
    std::fs::create_dir(&study).unwrap();
    std::fs::write(study.join("examples"), "in the way").unwrap();
    let output = nav_sim().arg("init").arg(&study).output().unwrap();
    assert_eq!(
        (output.status.code(), output.stdout.as_slice()),
        (Some(1), &b""[..])
    );
    let left: Vec<_> = std::fs::read_dir(&study)
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left, ["examples"]);
    std::fs::remove_file(study.join("examples")).unwrap();
    assert!(
        nav_sim()
            .arg("init")
            .arg(&study)
            .output()
            .unwrap()
            .status
            .success()
    );
    assert!(
        study.join("calib_data/formats/own.csv").exists()
            && study.join("examples/phone.toml").exists()
    );
}

/// What heading is called elsewhere; a recording with a gap, which `check` has no option for; what `check` took it for.
#[test]
fn check_hints_at_what_helps() {
    let place = tempfile::tempdir().unwrap();
    let check = |name: &str, text: &str| {
        std::fs::write(place.path().join(name), text).unwrap();
        let output = nav_sim()
            .current_dir(place.path())
            .args(["check", name])
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (
            output.status.code().unwrap(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let profile = "start = { lat_deg = 46, lon_deg = 6, h_m = 0, yaw_deg = 3 }\nsegment = []\n";
    let (code, _, said) = check("drive.toml", profile);
    assert!(
        code == 2 && said.contains("did you mean \"heading_deg\"?"),
        "{said}"
    );
    let table = |skipped: std::ops::Range<u32>| -> String {
        let rows = (0..2000_u32).filter(|k| !skipped.contains(k));
        let rows = rows.map(|k| format!("{},{}\n", f64::from(k) / 100.0, f64::from(k % 7) * 1e-3));
        "t_s,gyro_x_rad_s\n".to_owned() + &rows.collect::<String>()
    };
    let (code, _, said) = check("gap.csv", &table(500..1500));
    assert!(
        code == 2 && said.contains("fuse bridges gaps of up to 5 s"),
        "{said}"
    );
    let (_, found, _) = check("whole.csv", &table(0..0));
    assert!(
        found.starts_with("whole.csv: read as a static recording, 1 channel"),
        "{found}"
    );
}

/// A model in the place of the trajectory, and the trajectory in that of the model.
#[test]
fn arguments_in_another_order_are_told() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let (model, drive) = ("calib_data/tactical.toml", "trajectories/land_vehicle.toml");
    for arguments in [
        ["run", model, drive, "-q"],
        ["synthesize", drive, "-o", "never"],
    ] {
        let output = nav_sim()
            .current_dir(root)
            .args(arguments)
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(2) && said.contains("arguments in another order?"),
            "{said}"
        );
    }
}
