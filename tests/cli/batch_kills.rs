//! Workers of a study killed at random points: the merged tables do not know.

use crate::common::batch::*;
use rand::RngExt;
use rand::SeedableRng;
use std::time::Instant;

/// Ten times two workers are started on the same study and killed (SIGKILL) at a random point of a third of
/// the time it takes, while units are computed and written; then one runs to the end.
#[test]
fn killed_workers_leave_a_study_that_merges_to_the_bytes_of_an_undisturbed_one() {
    let place = place();
    let dir = place.path();
    // units of some 10 ms, so that kills fall into them
    let study = STUDY
        .replace("runs = 77", "runs = 395")
        .replace("unit_runs = 8", "unit_runs = 40");
    std::fs::write(dir.join("study.toml"), study).unwrap();
    done(dir, "plan study.toml -o whole");
    let start = Instant::now();
    done(dir, "run study.toml -o whole -j 1");
    let undisturbed = start.elapsed();
    done(dir, "merge study.toml -o whole");
    assert_eq!(units(&dir.join("whole")).len(), UNITS);

    done(dir, "plan study.toml -o killed");
    let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(1);
    let (mut kills, mut amid) = (0, 0);
    while kills < 20 || amid < 3 {
        let mut workers =
            [0, 1].map(|i| spawn(dir, &format!("run study.toml -o killed --shard {i}/2 -j 1")));
        std::thread::sleep(undisturbed.mul_f64(random.random_range(0.0..0.35)));
        for worker in &mut workers {
            worker.kill().unwrap();
            worker.wait().unwrap();
            kills += 1;
        }
        let there = units(&dir.join("killed"));
        amid += usize::from(!there.is_empty() && there.len() < UNITS);
        if there.len() == UNITS {
            // Faster than the kills: some work is taken back.
            there
                .iter()
                .step_by(2)
                .for_each(|file| std::fs::remove_file(file).unwrap());
        }
        assert!(kills < 200, "no worker gets to a unit");
    }
    done(dir, "run study.toml -o killed");
    done(dir, "merge study.toml -o killed");
    assert_eq!(results(&dir.join("killed")), results(&dir.join("whole")));
}
