//! A study planned, run and merged by library calls only.

use crate::common::batch::*;
use nav_sim::app::{Context, Front};
use nav_sim::document::Note;
use nav_sim::study::{
    self, MergeOptions, PlanOptions, Planned, RunOptions, Shard, StudyError, VerifyOptions, Writing,
};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

const SEED: &dyn Fn(Option<u64>) -> u64 = &|of_study| of_study.unwrap_or(1);

fn options(writing: Writing) -> PlanOptions<'static> {
    PlanOptions {
        seed: SEED,
        threads: 2,
        clock: None,
        writing,
    }
}

/// Keeps what it is told, and stops after so many runs.
struct Watch {
    remarks: Mutex<Vec<Note>>,
    done: AtomicU64,
    stop_after: u64,
}

impl Watch {
    fn until(stop_after: u64) -> Self {
        Self {
            remarks: Mutex::default(),
            done: AtomicU64::new(0),
            stop_after,
        }
    }
}

impl Front for Watch {
    fn note(&self, note: Note) {
        self.remarks.lock().unwrap().push(note);
    }

    fn advance(&self, runs: u64) {
        self.done.fetch_add(runs, Ordering::Relaxed);
    }

    fn go_on(&self) -> bool {
        self.done.load(Ordering::Relaxed) < self.stop_after
    }
}

/// Two shards by the library, the first of them stopped once, make the bytes of the command.
#[test]
fn the_library_makes_the_bytes_of_the_command() {
    let place = place();
    let dir = place.path();
    for arguments in [
        "plan study.toml -o command",
        "run study.toml -o command",
        "merge study.toml -o command",
    ] {
        done(dir, arguments);
    }
    let (file, directory) = (dir.join("study.toml"), dir.join("library"));
    let made = study::plan(
        &file,
        &directory,
        &options(Writing::Write),
        &Context::default(),
    )
    .unwrap();
    assert!(
        !made.was_there
            && study::plan(
                &file,
                &directory,
                &options(Writing::Write),
                &Context::default()
            )
            .unwrap()
            .was_there
    );
    let planned = Planned::open(&file, &directory, Some(5)).unwrap();
    let run = |index, context: &Context<'_>| {
        let shard = Shard::new(index, 2).unwrap();
        study::run(&planned, &RunOptions { shard, threads: 1 }, context).unwrap()
    };
    let first = run(0, &Context::new(&Watch::until(100), None));
    assert!(
        first.left > 0 && first.finished + first.left == UNITS / 2,
        "{first:?}"
    );
    let watch = Watch::until(u64::MAX);
    let rest = run(0, &Context::new(&watch, None));
    assert_eq!((rest.finished, rest.left), (first.left, 0));
    let already = format!(
        "{} units are done already, {} to do",
        first.finished, first.left
    );
    let remarks = watch.remarks.lock().unwrap();
    assert_eq!(
        remarks
            .iter()
            .map(|remark| remark.text.as_str())
            .collect::<Vec<_>>(),
        [already]
    );
    let merge = || {
        study::merge(
            &planned,
            &MergeOptions {
                states: vec![1, 6],
                threads: 2,
            },
            &Context::default(),
        )
    };
    match merge() {
        Err(StudyError::Incomplete {
            units: UNITS,
            missing,
        }) => {
            assert_eq!(missing.len(), UNITS / 2);
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(
        (
            planned.status().unwrap().done,
            run(1, &Context::default()).finished
        ),
        (UNITS / 2, UNITS / 2)
    );
    let merged = merge().unwrap();
    assert_eq!(merged.diverged, 0);
    assert_eq!(results(&directory), results(&dir.join("command")));
    let verified = study::verify(
        &planned,
        &VerifyOptions { units: 3, seed: 1 },
        &Context::default(),
    )
    .unwrap();
    assert_eq!(
        (verified.whole, verified.compared, verified.different.len()),
        (UNITS, 3, 0)
    );
}

#[test]
fn a_dry_run_writes_nothing() {
    let place = place();
    let (file, directory) = (place.path().join("study.toml"), place.path().join("dry"));
    let made = study::plan(
        &file,
        &directory,
        &options(Writing::DryRun),
        &Context::default(),
    )
    .unwrap();
    assert_eq!(made.planned.plan.unit_count(&made.planned.grid), UNITS);
    assert!(!directory.exists());
    assert!(matches!(
        Planned::open(&file, &directory, None),
        Err(StudyError::NoPlan { .. })
    ));
}

/// Recordings without a time column, calibrated as the keys say: the model of `calibrate` with the same options.
#[test]
fn a_study_reads_and_calibrates_recordings_as_the_command_does() {
    let place = place();
    let dir = place.path();
    let nav_sim = |arguments: &str| {
        let mut command = assert_cmd::Command::cargo_bin("nav-sim").unwrap();
        command
            .current_dir(dir)
            .args(arguments.split_whitespace())
            .assert()
            .success();
    };
    nav_sim("synthesize imu.toml --replicates 3 --samples 8192 --seed 4 -o timed");
    std::fs::create_dir(dir.join("bare")).unwrap();
    for k in 1..=3 {
        let timed = std::fs::read_to_string(dir.join(format!("timed/replicate_{k}.csv"))).unwrap();
        let bare: Vec<&str> = timed
            .lines()
            .map(|line| line.split_once(',').unwrap().1)
            .collect();
        std::fs::write(dir.join(format!("bare/{k}.csv")), bare.join("\n") + "\n").unwrap();
    }
    let recorded = |keys: &str| {
        let step =
            format!("{{ recordings = [\"bare\"], fit = \"WN\", estimators = [\"awv\"]{keys} }}");
        let candidate = format!("candidate = [{{ name = \"recorded\", calibrate = {step} }}, ");
        std::fs::write(
            dir.join("recorded.toml"),
            STUDY.replace("candidate = [", &candidate),
        )
        .unwrap();
    };
    recorded("");
    let said = refused(dir, "plan recorded.toml -o planned", 2);
    assert!(
        said.contains("set rate_hz beside the recordings in the study file"),
        "{said}"
    );
    recorded(", rate_hz = 100, weighting = \"edofs\"");
    let said = refused(dir, "plan recorded.toml -o planned", 2);
    assert!(
        said.contains("is not one of \"model\", \"edof\", \"ci\", \"none\", \"full\""),
        "{said}"
    );
    recorded(", rate_hz = 100, weighting = \"edof\", pool = \"axes\", scales = 6");
    done(dir, "plan recorded.toml -o planned");
    nav_sim(
        "calibrate bare --rate-hz 100 --estimator awv --model WN --weighting edof --pool axes --scales 6 \
         --bootstrap 0 -o alone.toml",
    );
    let read = |path: &std::path::Path| -> toml::Table {
        std::fs::read_to_string(path).unwrap().parse().unwrap()
    };
    let models = std::fs::read_dir(dir.join("planned/models")).unwrap();
    let made = models
        .map(|e| e.unwrap().path())
        .find(|p| p.display().to_string().contains("recorded_awv"));
    let (planned, alone) = (read(&made.unwrap()), read(&dir.join("alone.toml")));
    for sensor in ["accel", "gyro"] {
        assert_eq!(planned[sensor], alone[sensor]);
        assert!(alone[sensor].get("x").is_some(), "{alone}");
    }
}
