//! Studies: cells that survive kills, changes and company.

use crate::common::batch::*;
use rand::{RngExt, SeedableRng};
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// Shards in any order, one killed and one repeated, make the bytes of one process, and each cell those of `run`.
#[test]
fn parts_make_the_bytes_of_the_whole_and_cells_those_of_run() {
    let place = place();
    let dir = place.path();
    ended(dir, "batch study.toml -o whole", 0);
    let said = ended(dir, "batch study.toml -o parts --shard 1/2 -j 1", 0);
    assert!(
        said.contains("4 of 8 cells missing: length_s=2_imu, length_s=2_wrong"),
        "{said}"
    );
    assert!(!dir.join("parts/results.csv").exists());
    ended(dir, "batch study.toml -o parts --shard 1/2 -j 1", 0);
    ended(dir, "batch study.toml -o parts --shard 0/2 -j 2", 0);
    assert_eq!(results(&dir.join("parts")), results(&dir.join("whole")));
    assert_eq!(cells(&dir.join("whole")).len(), CELLS);
    ended(
        dir,
        "run drive.toml wrong.toml --truth imu.toml --outage 30:38 --runs 77 --seed 5 -o alone",
        0,
    );
    for file in ["epochs.csv", "runs.csv"] {
        let cell = dir.join("whole/cells/length_s=8_wrong").join(file);
        assert_eq!(
            fs::read(cell).unwrap(),
            fs::read(dir.join("alone").join(file)).unwrap(),
            "{file}"
        );
    }
    let rows = fs::read_to_string(dir.join("whole/results.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + CELLS * 9);
    let head = "cell,length_s,model,method,filter,runs,diverged,outage,start_s,end_s,duration_s,state,asee_mean";
    assert!(rows.starts_with(head), "{rows}");
}

/// A new label computes its own cells; another name of the same cell moves it; a changed input is refused.
#[test]
fn cells_are_known_by_what_they_hold() {
    let place = place();
    let dir = place.path();
    ended(dir, "batch study.toml -o out", 0);
    let time_of = |name: &str| {
        fs::metadata(dir.join("out/cells").join(name).join("runs.csv"))
            .unwrap()
            .modified()
            .unwrap()
    };
    let before = time_of("length_s=4_imu");
    let more = STUDY
        .replace("imu = {", "right = {")
        .replace("[2, 4,", "[2, 3, 4,");
    fs::write(dir.join("study.toml"), &more).unwrap();
    ended(dir, "batch study.toml -o out", 0);
    assert_eq!(cells(&dir.join("out")).len(), 10);
    assert_eq!(time_of("length_s=4_right"), before, "moved, not made again");

    fs::write(dir.join("wrong.toml"), MODEL.replace("4e-12", "5e-13")).unwrap();
    let said = ended(dir, "batch study.toml -o out", 2);
    assert!(
        said.contains("cell length_s=2_wrong is of another study: wrong.toml has changed"),
        "{said}"
    );
    let said = ended(dir, "batch study.toml -o out --set runs=78", 2);
    assert!(said.contains("\"runs\" is 77, not 78"), "{said}");
    let dry = ended(dir, "batch study.toml -o out --dry-run", 0);
    assert!(!dry.contains("error"), "{dry}");
    ended(dir, "batch study.toml -o out --force", 0);
    ended(dir, "batch study.toml -o fresh", 0);
    assert_eq!(results(&dir.join("out")), results(&dir.join("fresh")));
    // another version with the same figures goes on, one with others says so
    let manifest = dir.join("fresh/cells/length_s=2_wrong/manifest.json");
    let of_other = |from: &str, to: &str| {
        let text = fs::read_to_string(&manifest).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&manifest, text.replacen(from, to, 1)).unwrap();
    };
    let own = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    of_other(&own, "\"version\": \"0.0.9\"");
    let said = ended(dir, "batch study.toml -o fresh", 0);
    assert!(!said.contains("runs,"), "{said}");
    of_other("\"key\": \"", "\"key\": \"0");
    let said = ended(dir, "batch study.toml -o fresh", 2);
    let words = "cell length_s=2_wrong was made by version 0.0.9, whose figures differ";
    assert!(said.contains(words), "{said}");
    // cells of another study are named and left
    fs::write(dir.join("study.toml"), more.replace("[2, 3, 4,", "[2, 4,")).unwrap();
    let said = ended(dir, "batch study.toml -o out", 0);
    assert!(
        said.contains("cells of another study are left out: 2, such as length_s=3_"),
        "{said}"
    );
}

/// A cell that another worker is writing is whole before it has its name: nobody else gives it one, and what killed workers
/// left goes when all cells are there.
#[test]
fn cells_in_work_are_left_to_their_workers() {
    let place = place();
    let dir = place.path();
    ended(dir, "batch study.toml -o out", 0);
    let all = dir.join("out/cells");
    let in_work = all.join(".length_s=4_imu.1-0.partial");
    let own = all.join("length_s=4_imu");
    fs::rename(&own, &in_work).unwrap();
    fs::write(in_work.join("of_another"), "").unwrap();
    ended(dir, "batch study.toml -o out", 0);
    assert!(own.join("manifest.json").exists() && !own.join("of_another").exists());
    assert!(!in_work.exists());
}

#[test]
fn damaged_cells_are_set_aside_and_computed_again() {
    let place = place();
    let dir = place.path();
    ended(dir, "batch study.toml -o out", 0);
    let undisturbed = results(&dir.join("out"));
    let all = cells(&dir.join("out"));
    let mut flipped = fs::read(all[3].join("runs.csv")).unwrap();
    let last = flipped.len() - 4;
    flipped[last] ^= 1;
    fs::write(all[3].join("runs.csv"), flipped).unwrap();
    fs::remove_file(all[5].join("manifest.json")).unwrap();
    let said = ended(dir, "batch study.toml -o out --merge", 75);
    assert!(
        said.contains("is set aside") && said.contains("2 cells missing"),
        "{said}"
    );
    let summary = fs::read_to_string(dir.join("out/summary.json")).unwrap();
    assert!(summary.contains("\"complete\": false"));
    ended(dir, "batch study.toml -o out", 0);
    fs::remove_dir_all(
        dir.join("out/cells")
            .join(format!("{}.damaged", all[3].file_name().unwrap().display())),
    )
    .unwrap();
    assert_eq!(results(&dir.join("out")), undisturbed);
}

/// Exit code 75 is "stopped, to be resumed", 1 where resuming would not help.
#[test]
fn a_time_limit_and_sigterm_end_with_75_and_two_at_once_do_no_harm() {
    let place = place();
    let dir = place.path();
    ended(dir, "batch study.toml -o one", 0);
    let said = ended(dir, "batch study.toml -o out --time-limit 0", 1);
    assert!(said.contains("stopped; 4 units left"), "{said}");
    // the first limit in which a unit fits, on a machine as busy as may be
    let long = "batch study.toml -o long --set runs=800";
    let limited = |limit: &u32| {
        drop(fs::remove_dir_all(dir.join("long")));
        let (code, said) = ran(dir, &format!("{long} --time-limit {limit} -j 1"));
        (code == 75).then_some(said)
    };
    let said = [1, 2, 3, 5, 8, 13, 21, 34]
        .iter()
        .find_map(limited)
        .unwrap();
    assert!(said.contains("the same command continues"), "{said}");
    drop(fs::remove_dir_all(dir.join("long")));
    let mut child = spawn(dir, &format!("{long} -j 1"));
    while cells(&dir.join("long")).is_empty() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let kill = std::process::Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
    // a signal before the first of its units is no time limit that is too short
    let mut child = spawn(dir, "batch study.toml -o early --set runs=40000 -j 1");
    while !dir.join("early/locks").exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let kill = std::process::Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
    assert!(cells(&dir.join("early")).is_empty());
    let mut twins = [0, 1].map(|_| spawn(dir, "batch study.toml -o out -j 1"));
    assert!(twins.iter_mut().all(|t| t.wait().unwrap().success()));
    ended(dir, "batch study.toml -o out", 0);
    assert_eq!(results(&dir.join("out")), results(&dir.join("one")));
}

/// Workers that are killed (SIGKILL) at random points leave a study that ends with the bytes of an undisturbed one.
#[test]
fn killed_workers_leave_no_trace() {
    let place = place();
    let dir = place.path();
    let start = Instant::now();
    ended(dir, "batch study.toml -o whole -j 1 --set runs=150", 0);
    let undisturbed = start.elapsed();
    let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(1);
    let (mut kills, mut amid) = (0, 0);
    while kills < 20 || amid < 3 {
        let mut workers =
            [0, 1].map(|_| spawn(dir, "batch study.toml -o killed -j 1 --set runs=150"));
        std::thread::sleep(undisturbed.mul_f64(random.random_range(0.0..0.6)));
        for worker in &mut workers {
            worker.kill().unwrap();
            worker.wait().unwrap();
            kills += 1;
        }
        let there = cells(&dir.join("killed"));
        amid += usize::from(!there.is_empty() && there.len() < CELLS);
        if there.len() == CELLS {
            there
                .iter()
                .step_by(2)
                .for_each(|cell| fs::remove_dir_all(cell).unwrap());
        }
        assert!(kills < 200, "no worker gets to a cell");
    }
    ended(dir, "batch study.toml -o killed --set runs=150", 0);
    assert_eq!(results(&dir.join("killed")), results(&dir.join("whole")));
}

#[test]
fn the_scheduler_says_which_shard() {
    let place = place();
    let dir = place.path();
    let slurm = |index: &str| {
        let mut command = command(dir, "batch study.toml -o out");
        command
            .env("SLURM_ARRAY_TASK_ID", index)
            .env("SLURM_ARRAY_TASK_MIN", "1");
        command.env("SLURM_ARRAY_TASK_COUNT", "2").output().unwrap()
    };
    let output = slurm("2");
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("shard 1/2"));
    assert_eq!(cells(&dir.join("out")).len(), CELLS / 2);
    assert!(slurm("1").status.success());
    assert_eq!(cells(&dir.join("out")).len(), CELLS);
    assert_eq!(slurm("3").status.code(), Some(2));
}

#[test]
fn bad_studies_are_refused_before_anything_is_written() {
    let place = place();
    let dir = place.path();
    let cases = [
        (
            "runs = 77",
            "rns = 77",
            "study.toml, line 6: cell length_s=2_imu: run: there is no option rns",
            "did you mean \"runs\"?",
        ),
        (
            "[vary]\n",
            "[varies]\n",
            "study.toml, line 8: unknown key \"varies\"",
            "legal here: run, vary, reference",
        ),
        (
            "[2, 4, 8, 16]",
            "[]",
            "\"vary.length_s\" is empty",
            "a list of labels",
        ),
        (
            "{length_s}",
            "{length}",
            "there is no axis length",
            "[vary]",
        ),
        (
            "drive.toml",
            "gone.toml",
            "gone.toml",
            "relative to the study's file",
        ),
        (
            "seed = 5",
            "out = \"x\"",
            "a study has its own directory",
            "-o",
        ),
        ("seed = 5", "seed = 5\ngnss.rate = 5", "rate", "gnss"),
        (
            "runs = 77",
            "runs = {}",
            "study.toml, line 6: cell length_s=2_imu: \"run.runs\" = {} has no value",
            "",
        ),
        (
            "runs = 77",
            "runs = [77, -1]",
            "study.toml, line 6: cell length_s=2_imu_runs=-1: --runs='-1'",
            "not a whole number",
        ),
        (
            "seed = 5",
            "seed = 5\ngnss.rate_hz = [1, nan]",
            "cell length_s=2_imu_rate_hz=nan",
            "\"run.gnss\" = { rate_hz = nan } is not a finite number",
        ),
        (
            "seed = 5",
            "seed = ",
            "study.toml, line 7",
            "must be quoted",
        ),
        (
            "wrong = {",
            "IMU = {",
            "two cells have the name length_s=2_IMU",
            "[vary]",
        ),
    ];
    for (from, to, message, more) in cases {
        fs::write(dir.join("study.toml"), STUDY.replace(from, to)).unwrap();
        let said = ran(dir, "batch study.toml -o out");
        assert!(
            matches!(said.0, 1 | 2) && said.1.contains(message) && said.1.contains(more),
            "{to}: {}",
            said.1
        );
        assert!(!dir.join("out").exists(), "{from}");
    }
    fs::write(
        dir.join("study.toml"),
        STUDY.to_owned() + "[reference]\nmodel = \"imo\"\n",
    )
    .unwrap();
    let said = ended(dir, "batch study.toml -o out", 2);
    assert!(
        said.contains("\"imo\" is not a label\n\nhint: labels: imu, wrong"),
        "{said}"
    );
}

/// A list is an axis where a single run would not take it.
#[test]
fn lists_are_axes_where_a_run_takes_none() {
    let place = place();
    let dir = place.path();
    let study = "[run]\ntrajectory = \"drive.toml\"\nmodel = [\"imu.toml\", \"wrong.toml\"]\nfilter = [15, \"full\"]\nruns = 8\n\
                 outage = [[\"20:24\"], [\"20:24\", \"40:44\"]]\ngnss.rate_hz = [1, 2]\ngnss.pos_sigma_m = [1, 1, 2]\nseed = [1, 2]\n";
    fs::write(dir.join("study.toml"), study).unwrap();
    ended(dir, "batch study.toml -o out --set seed=1", 0);
    let names: Vec<String> = cells(&dir.join("out"))
        .iter()
        .map(|cell| cell.file_name().unwrap().display().to_string())
        .collect();
    assert_eq!(names.len(), 16);
    assert!(
        names.contains(&"wrong_full_20-24+40-44_rate_hz=2".to_owned()),
        "{names:?}"
    );
    let check = ended(dir, "check study.toml", 0);
    assert!(!check.contains("error"), "{check}");
}

/// A covariance analysis is that of `run`, and a cell that cannot be computed is named while others go on.
#[test]
fn without_sampling() {
    let place = place();
    let dir = place.path();
    let dry = "batch study.toml -o out --set method=lincov --dry-run";
    let said = command(dir, dry).output().unwrap();
    // what takes no runs has no time of runs
    assert!(said.status.success() && !String::from_utf8_lossy(&said.stdout).contains("time"));
    ended(dir, "batch study.toml -o out --set method=lincov", 0);
    ended(
        dir,
        "run drive.toml wrong.toml --truth imu.toml --outage 30:34 --method lincov -o alone",
        0,
    );
    let cell = dir.join("out/cells/length_s=4_wrong/epochs.csv");
    assert_eq!(
        fs::read(cell).unwrap(),
        fs::read(dir.join("alone/epochs.csv")).unwrap()
    );
    fs::write(
        dir.join("study.toml"),
        STUDY.replace("[2, 4, 8, 16]", "[2, 4, 8, 70]"),
    )
    .unwrap();
    let said = ended(dir, "batch study.toml -o beyond", 0);
    assert!(
        said.contains("outage 30:100 is cut: the trajectory ends at 60 s"),
        "{said}"
    );
    assert_eq!(cells(&dir.join("beyond")).len(), 8);
}

#[test]
fn shipped_studies_are_studies() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (name, cells) in [("quick_study", 6), ("outage_length_expected", 40)] {
        let output = command(root, &format!("check examples/{name}.toml"))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned()
            + &String::from_utf8_lossy(&output.stderr);
        assert!(
            said.contains(&format!("a study of {cells} cells")),
            "{said}"
        );
    }
}

/// Three blocks on three shards are one `run`: 10 s of work each.
#[test]
#[ignore = "half a minute of work"]
fn blocks_on_shards_make_the_bytes_of_run() {
    let place = place();
    let dir = place.path();
    let study = "[run]\ntrajectory = \"drive.toml\"\nmodel = \"imu.toml\"\noutage = [\"30:40\"]\nruns = 40000\nseed = 5\n";
    fs::write(dir.join("study.toml"), study).unwrap();
    for shard in ["2/3", "0/3", "1/3"] {
        ended(dir, &format!("batch study.toml -o out --shard {shard}"), 0);
    }
    ended(
        dir,
        "run drive.toml imu.toml --outage 30:40 --runs 40000 --seed 5 -o alone",
        0,
    );
    for file in ["epochs.csv", "runs.csv"] {
        assert_eq!(
            fs::read(dir.join("out/cells/run").join(file)).unwrap(),
            fs::read(dir.join("alone").join(file)).unwrap()
        );
    }
}
