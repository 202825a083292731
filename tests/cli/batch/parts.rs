//! Parts of a study: what is missing, stopped, or another task's.

use super::*;

#[test]
fn what_is_missing_is_told_by_cell_and_runs() {
    let place = place();
    let dir = place.path();
    let said = done(dir, "plan study.toml -o out");
    assert!(
        said.contains("cell \"none\" has no outages: its table is empty"),
        "{said}"
    );
    done(dir, "run study.toml -o out --shard 0/2");
    let output = batch(dir, "merge study.toml -o out --format json -v");
    assert_eq!(output.status.code(), Some(1));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let missing = json["missing"].as_array().unwrap();
    assert_eq!((json["units"].as_u64(), missing.len()), (Some(50), 25));
    assert_eq!(missing[0]["runs"], serde_json::json!([8, 16]));
    assert_eq!(
        missing[24]["cell"],
        serde_json::json!(["drive", "imu", "default", "default", "none"])
    );
    assert_eq!(missing[24]["runs"], serde_json::json!([72, 77]));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    for unit in missing {
        assert!(
            said.contains(&format!(
                "{}: drive, imu, default",
                unit["unit"].as_str().unwrap()
            )),
            "{said}"
        );
    }
    assert!(said.contains("none, runs 72 to 76"), "{said}");
}

#[test]
fn a_time_limit_and_sigterm_end_with_75_and_two_on_one_shard_do_no_harm() {
    let place = place();
    let dir = place.path();
    let undisturbed = whole(dir, "one");
    done(dir, "plan study.toml -o out");
    // Not one unit fits: to go on would be to go on for ever.
    let said = refused(dir, "run study.toml -o out --time-limit 0", 1);
    assert!(
        said.contains("the time limit is too short for a single unit; 50 units left"),
        "{said}"
    );
    // A study that lasts, to be stopped.
    fs::write(
        dir.join("long.toml"),
        STUDY.replace("runs = 77", "runs = 100000"),
    )
    .unwrap();
    done(dir, "plan long.toml -o long");
    // the first limit in which a unit fits, on a machine as busy as may be
    let limited = |limit: &u32| {
        let ran = batch(dir, &format!("run long.toml -o long --time-limit {limit}"));
        (ran.status.code() == Some(75)).then(|| String::from_utf8(ran.stderr).unwrap())
    };
    let said = [3, 9, 27, 81, 243].iter().find_map(limited).unwrap();
    assert!(
        said.contains("stopped by the time limit; ") && said.contains("goes on"),
        "{said}"
    );
    units(&dir.join("long"))
        .iter()
        .for_each(|unit| fs::remove_file(unit).unwrap());
    let mut child = spawn(dir, "run long.toml -o long");
    while units(&dir.join("long")).is_empty() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let kill = std::process::Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
    let mut twins = [
        spawn(dir, "run study.toml -o out -j 1"),
        spawn(dir, "run study.toml -o out -j 1"),
    ];
    assert!(twins.iter_mut().all(|t| t.wait().unwrap().success()));
    done(dir, "merge study.toml -o out");
    assert_eq!(results(&dir.join("out")), undisturbed);
}

#[test]
fn the_scheduler_says_which_shard() {
    let place = place();
    let dir = place.path();
    done(dir, "plan study.toml -o out");
    let slurm = |index: &str| {
        let mut command = command(dir, "run study.toml -o out");
        command
            .env("SLURM_ARRAY_TASK_ID", index)
            .env("SLURM_ARRAY_TASK_MIN", "1");
        command.env("SLURM_ARRAY_TASK_COUNT", "2").output().unwrap()
    };
    let output = slurm("2");
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("shard 1/2 (SLURM_ARRAY_TASK_ID=2)"));
    assert_eq!(units(&dir.join("out")).len(), 25);
    assert!(slurm("1").status.success());
    assert_eq!(units(&dir.join("out")).len(), UNITS);
    assert_eq!(slurm("3").status.code(), Some(2));
    let too_many = batch(dir, "run study.toml -o out -j 65535");
    assert_eq!(too_many.status.code(), Some(2));
}

/// A plan whose lists were cut is damaged: every list that cells are made of, emptied and lengthened.
#[test]
fn a_plan_with_other_lists_is_refused_by_its_file() {
    let place = place();
    let dir = place.path();
    done(dir, "plan study.toml -o out");
    let path = dir.join("out/plan.json");
    let whole: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    for list in [
        "trajectories",
        "truths",
        "models",
        "unit_runs",
        "scenarios",
        "gnss",
    ] {
        let mut cut = whole.clone();
        let entries = cut[list].as_array_mut().unwrap();
        match entries.pop() {
            Some(_) => entries.clear(),
            None => continue,
        }
        fs::write(&path, cut.to_string()).unwrap();
        for command in ["status", "run", "merge"] {
            let said = refused(dir, &format!("{command} study.toml -o out"), 2);
            assert!(
                said.contains("plan.json") && said.contains("its lists are not as long"),
                "{list}: {said}"
            );
        }
    }
}

/// A name that a spreadsheet would compute or a terminal obey is none.
#[test]
fn names_are_no_formulas() {
    let place = place();
    let dir = place.path();
    for name in ["=cmd|x", "-2+3", "@SUM(1)", "a\\u001b[31m", "a\\u202ecod"] {
        let named = STUDY.replace("name = \"wrong\"", &format!("name = \"{name}\""));
        fs::write(dir.join("named.toml"), named).unwrap();
        let said = refused(dir, "plan named.toml -o named", 2);
        assert!(said.contains("names begin with no = + - @"), "{said}");
    }
}

/// A unit is a file: so many are refused before one is named.
#[test]
fn more_units_than_a_directory_should_hold_are_refused() {
    let place = place();
    let many = STUDY
        .replace("runs = 77", "runs = 10000000")
        .replace("unit_runs = 8", "unit_runs = 1");
    fs::write(place.path().join("many.toml"), many).unwrap();
    let said = refused(place.path(), "plan many.toml --dry-run", 2);
    assert!(
        said.contains("\"unit_runs\" = 1 makes 50000000 units, more than 1000000"),
        "{said}"
    );
}

/// Tables take the place of an earlier merge's, and of nothing else.
#[test]
fn a_merge_replaces_no_file_of_others() {
    let place = place();
    let dir = place.path();
    done(dir, "plan study.toml -o out");
    done(dir, "run study.toml -o out");
    let page = dir.join("out/results/report.html");
    fs::create_dir(dir.join("out/results")).unwrap();
    fs::write(&page, "mine").unwrap();
    for force in ["", " --force"] {
        let said = refused(dir, &format!("merge study.toml -o out{force}"), 2);
        assert!(
            said.contains("out/results is not of this command: it is not replaced"),
            "{said}"
        );
        assert_eq!(fs::read_to_string(&page).unwrap(), "mine");
    }
    fs::remove_file(&page).unwrap();
    done(dir, "merge study.toml -o out");
    done(dir, "merge study.toml -o out");
}
