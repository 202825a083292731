//! Every reader on a small corpus: whole, cut, and changed, with a fixed seed. `NAV_SIM_FUZZ` is the number of changed files of each
//! reader and `NAV_SIM_FUZZ_FIRST` the first of them (`scripts/nightly.sh`); what makes one panic is named by its number.

#![allow(clippy::unwrap_used, reason = "a test")]

mod mutate;

use nav_sim::fuzz::{TARGETS, Target, read};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Changed files of each reader where nobody asks for more.
const CHANGED: u64 = 120;
/// Longest file of the corpus of the logs that is changed (bytes).
const LONGEST: u64 = 20_000;

/// The files of a target, in the order of their names.
fn corpus(target: &str) -> Vec<Vec<u8>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let own = root.join("tests/fuzz/corpus").join(target);
    let ending = if target == "ulog" { "ulg" } else { target };
    let logs = entries(&root.join("src/logs/tests/data")).into_iter();
    let logs = logs.filter(|path| path.extension().is_some_and(|e| e == ending));
    let files = entries(&own).into_iter().chain(logs);
    let files = files.filter(|path| path.metadata().unwrap().len() <= LONGEST);
    files.map(|path| std::fs::read(path).unwrap()).collect()
}

fn entries(directory: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(directory) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

/// The number of the executions; panics with the name of what makes the reader panic.
fn tried((name, ..): Target, numbers: Range<u64>) -> u64 {
    let files = corpus(name);
    assert!(!files.is_empty(), "no corpus of {name}");
    let mut executions = 0;
    let mut attempt = |bytes: &[u8], what: &str| {
        executions += 1;
        if catch_unwind(AssertUnwindSafe(|| read(name, bytes))).is_err() {
            let kept = std::env::temp_dir().join(format!("nav-sim-fuzz-{name}-{what}"));
            std::fs::write(&kept, bytes).unwrap();
            panic!("{name}: {what} makes it panic; kept as {}", kept.display());
        }
    };
    for (k, file) in files.iter().enumerate() {
        attempt(file, &format!("file {k}"));
        // some forty cuts: the whole run has more
        let step = (file.len() / 40).max(1);
        (0..file.len())
            .step_by(step)
            .for_each(|end| attempt(&file[..end], &format!("file {k} cut at {end}")));
    }
    for number in numbers {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(number);
        let [file, other] = [0, 1].map(|_| &files[random.random_range(0..files.len())]);
        attempt(
            &mutate::changed(file, other, &mut random),
            &format!("change {number}"),
        );
    }
    executions
}

#[test]
fn no_reader_panics_on_a_damaged_file() {
    let asked = |name: &str| {
        std::env::var(name)
            .ok()
            .map(|text| text.parse::<u64>().unwrap())
    };
    let first = asked("NAV_SIM_FUZZ_FIRST").unwrap_or(0);
    let numbers = first..first + asked("NAV_SIM_FUZZ").unwrap_or(CHANGED);
    let next = AtomicUsize::new(0);
    let only = std::env::var("NAV_SIM_FUZZ_TARGET").ok();
    let wanted: Vec<Target> = TARGETS
        .into_iter()
        .filter(|(name, ..)| only.as_deref().is_none_or(|only| only == *name))
        .collect();
    let worker = || {
        let mut executions = 0;
        while let Some(target) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) {
            let of_target = tried(*target, numbers.clone());
            println!("{}: {of_target} executions", target.0);
            executions += of_target;
        }
        executions
    };
    let total: u64 = std::thread::scope(|scope| {
        let workers = [0, 1].map(|_| scope.spawn(worker));
        workers
            .into_iter()
            .map(|worker| worker.join().unwrap())
            .sum()
    });
    println!("figure fuzz: {total} executions, no panic");
}
