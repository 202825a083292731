//! Studies: cells that survive kills, changes and company. What is refused is in `transcripts/files.md`.

use super::readme::transcript;
use crate::common::batch::*;
use crate::common::drive::*;
use rand::{RngExt, SeedableRng};
use std::fs;
use std::time::{Duration, Instant};

#[track_caller]
fn assert_cell_is_run(place: &Place, cell: &str, run: &str) {
    for file in ["epochs.csv", "runs.csv"] {
        let [cell, run] = [cell, run].map(|directory| place.read(&format!("{directory}/{file}")));
        assert!(cell == run, "{file}");
    }
}

/// Shards in any order, one killed and one repeated, make the bytes of one process, and each cell those of `run`.
#[test]
fn parts_make_the_bytes_of_the_whole_and_cells_those_of_run() {
    let place = place();
    for arguments in [
        "batch study.toml -o whole",
        "run drive.toml wrong.toml --truth imu.toml --outage 30:38 --runs 77 --seed 5 -o alone",
        "batch study.toml -o parts --shard 1/2 -j 1",
        "batch study.toml -o parts --shard 1/2 -j 1",
        "batch study.toml -o parts --shard 0/2 -j 2",
    ] {
        assert!(!place.at("parts/results.csv").exists());
        ended(place.path(), arguments, 0);
    }
    assert_eq!(results(&place, "parts"), results(&place, "whole"));
    assert_eq!(cells(&place, "whole").len(), CELLS);
    assert_cell_is_run(&place, "whole/cells/length_s=8_wrong", "alone");
    assert_eq!(place.table("whole/results.csv").len(), CELLS * 9);
}

/// Messages of studies whose cells are missing, changed, damaged, of another version or of another study.
#[test]
fn cells_are_known_by_the_inputs_that_made_them() {
    transcript("batch.md", &place());
}

/// A cell that another worker is writing is whole before it has its name: nobody else gives it one, and files that killed
/// workers left go when all cells are there.
#[test]
fn cells_in_work_are_left_to_their_workers() {
    let place = place();
    ended(place.path(), "batch study.toml -o out", 0);
    let in_work = place.at("out/cells/.length_s=4_imu.1-0.partial");
    let own = place.at("out/cells/length_s=4_imu");
    fs::rename(&own, &in_work).unwrap();
    fs::write(in_work.join("of_another"), "").unwrap();
    ended(place.path(), "batch study.toml -o out", 0);
    assert!(own.join("manifest.json").exists() && !own.join("of_another").exists());
    assert!(!in_work.exists());
}

/// Exit code 75 is "stopped, to be resumed", 1 where resuming would not help.
#[test]
fn a_time_limit_and_sigterm_end_with_75_and_two_at_once_do_no_harm() {
    let place = place();
    let dir = place.path();
    ended(dir, "batch study.toml -o one", 0);
    ended(dir, "batch study.toml -o out --time-limit 0", 1);
    // the first limit in which a unit fits, on a machine as busy as may be
    let long = "batch study.toml -o long -j 1 --set runs=800";
    let is_stopped = |limit: u32| {
        drop(fs::remove_dir_all(place.at("long")));
        ran(dir, &format!("{long} --time-limit {limit}")).0 == 75
    };
    assert!([1, 2, 3, 5, 8, 13, 21, 34].into_iter().any(is_stopped));
    drop(fs::remove_dir_all(place.at("long")));
    // a signal before the first of its units is no time limit that is too short
    let early = "batch study.toml -o early --set runs=40000 -j 1";
    let has_cell = || !cells(&place, "long").is_empty();
    let has_lock = || place.at("early/locks").exists();
    for (command, has_begun) in [(long, &has_cell as &dyn Fn() -> bool), (early, &has_lock)] {
        let mut child = spawn(dir, command);
        while !has_begun() && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(
            place
                .shell(&format!("kill -TERM {}", child.id()))
                .status
                .success()
        );
        assert_eq!(child.wait().unwrap().code(), Some(75));
    }
    assert!(cells(&place, "early").is_empty());
    let mut twins = [0, 1].map(|_| spawn(dir, "batch study.toml -o out -j 1"));
    assert!(twins.iter_mut().all(|t| t.wait().unwrap().success()));
    ended(dir, "batch study.toml -o out", 0);
    assert_eq!(results(&place, "out"), results(&place, "one"));
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
        let killed = "batch study.toml -o killed -j 1 --set runs=150";
        let mut workers = [0, 1].map(|_| spawn(dir, killed));
        std::thread::sleep(undisturbed.mul_f64(random.random_range(0.0..0.6)));
        for worker in &mut workers {
            worker.kill().unwrap();
            worker.wait().unwrap();
            kills += 1;
        }
        let there = cells(&place, "killed");
        amid += usize::from(!there.is_empty() && there.len() < CELLS);
        if there.len() == CELLS {
            for cell in there.iter().step_by(2) {
                fs::remove_dir_all(place.at(&format!("killed/cells/{cell}"))).unwrap();
            }
        }
        assert!(kills < 200, "no worker gets to a cell");
    }
    ended(dir, "batch study.toml -o killed --set runs=150", 0);
    assert_eq!(results(&place, "killed"), results(&place, "whole"));
    println!("{kills} workers killed");
}

#[test]
fn the_scheduler_says_which_shard() {
    let place = place();
    for (index, code, finished) in [("2", 0, CELLS / 2), ("1", 0, CELLS), ("3", 2, CELLS)] {
        let mut command = command(place.path(), "batch study.toml -o out");
        command.env("SLURM_ARRAY_TASK_ID", index);
        command
            .env("SLURM_ARRAY_TASK_MIN", "1")
            .env("SLURM_ARRAY_TASK_COUNT", "2");
        assert_eq!(command.output().unwrap().status.code(), Some(code));
        assert_eq!(cells(&place, "out").len(), finished);
    }
}

/// Three blocks on three shards are one `run`: 10 s of work each.
#[test]
#[ignore = "half a minute of work"]
fn blocks_on_shards_make_the_bytes_of_run() {
    let place = place();
    let study = "[run]\ntrajectory = \"drive.toml\"\nmodel = \"imu.toml\"\noutage = [\"30:40\"]\nruns = 40000\nseed = 5\n";
    place.write("study.toml", study);
    for shard in ["2/3", "0/3", "1/3"] {
        ended(
            place.path(),
            &format!("batch study.toml -o out --shard {shard}"),
            0,
        );
    }
    let run = "run drive.toml imu.toml --outage 30:40 --runs 40000 --seed 5 -o alone";
    ended(place.path(), run, 0);
    assert_cell_is_run(&place, "out/cells/run", "alone");
}
