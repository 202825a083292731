//! `nav-sim synthesize` as a user runs it; what it refuses is in `transcripts/files.md` and `existing.md`.

use crate::common::drive::*;
use nav_sim::io::recordings::{ReadOptions, read};
use std::process::Command;

const SPREAD: &str = r#"schema = 1
rate_hz = 100.0
[accel]
processes = [{ type = "WN", sigma2 = 1.0e-4 }, { type = "RW", gamma2 = 1.0e-8 }]
[gyro.x]
processes = [{ type = "AR1", phi = 0.9, sigma2 = 1.0e-6 }]
[[spread.accel]]
process = "WN"
parameter = "sigma2"
distribution = "beta"
a = 2
b = 2
low = 1.0e-4
width = 1.0e-4
"#;

fn place() -> Place {
    let place = Place::new();
    place.write("model.toml", SPREAD);
    place
}

fn make(place: &Place, options: &str) {
    place.done(&format!("synthesize model.toml --seed 5 {options}"));
}

#[test]
fn replicates_read_back_and_the_manifest_says_what_was_drawn() {
    let place = place();
    make(&place, "--replicates 3 --samples 400 --spread -o out");
    let files = [
        "manifest.json",
        "replicate_1.csv",
        "replicate_2.csv",
        "replicate_3.csv",
    ];
    assert_eq!(place.entries("out"), files);
    let (recordings, _) = read(&[place.at("out")], &ReadOptions::default()).unwrap();
    let sizes: Vec<_> = recordings
        .iter()
        .map(|r| (r.len(), r.signals.len()))
        .collect();
    assert_eq!(sizes, [(400, 4); 3]);
    let manifest = place.json("out/manifest.json");
    assert_eq!(
        (&manifest["seed"], &manifest["samples"]),
        (&5.into(), &400.into())
    );
    let drawn = |replicate: usize, axis: &str| {
        number(
            &manifest,
            &format!("/replicates/{replicate}/axes/{axis}/0/sigma2"),
        )
    };
    assert!((1e-4..=2e-4).contains(&drawn(0, "accel.x")));
    assert_ne!(drawn(0, "accel.x"), drawn(1, "accel.x"));
    assert_ne!(drawn(0, "accel.x"), drawn(0, "accel.y"));
    assert!(off(drawn(0, "gyro.x"), 1e-6) < 1e-12);
}

#[test]
fn the_same_seed_gives_the_same_bytes_at_any_number_of_threads() {
    let place = place();
    for threads in [1, 2] {
        let options = "--replicates 4 --samples 1000 --spread";
        make(&place, &format!("{options} -j {threads} -o {threads}"));
    }
    for k in 1..=4 {
        let [one, two] = [1, 2].map(|out| place.read(&format!("{out}/replicate_{k}.csv")));
        assert_eq!(one, two);
    }
}

#[test]
fn contamination_adds_to_the_same_noise() {
    let place = place();
    let step = "[[accel]]\noperation = \"step\"\nreplicates = [2]\namplitude = 1.0\n";
    place.write("step.toml", step);
    let options = "--replicates 2 --samples 300 --axes x -o";
    make(&place, &format!("{options} clean"));
    make(&place, &format!("{options} dirty --contaminate step.toml"));
    assert_eq!(
        place.read("clean/replicate_1.csv"),
        place.read("dirty/replicate_1.csv")
    );
    let [clean, dirty] = ["clean", "dirty"].map(|d| place.table(&format!("{d}/replicate_2.csv")));
    for (row, step) in [(149, 0.0), (150, 1.0)] {
        assert!((dirty[row][1] - clean[row][1] - step).abs() < 1e-8, "{row}");
    }
    let contaminated = |out: &str, k: usize| {
        place.json(&format!("{out}/manifest.json"))["replicates"][k]["contaminated"].clone()
    };
    assert_eq!([0, 1].map(|k| contaminated("dirty", k)), [false, true]);
    make(
        &place,
        "--replicates 9 --samples 4096 --contaminate section5-III -o paper",
    );
    assert_eq!(contaminated("paper", 8), false);
}

/// Interrupted, it ends with 128 + signal and leaves nothing; a signal that it was started to ignore does nothing.
#[test]
fn an_interrupt_leaves_nothing() {
    let place = place();
    let is_partial = |name: &String| name.rsplit('.').next() == Some("partial");
    for (signal, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        // the program that starts the tests may ignore signals (`nohup`, a script's background), and a child inherits that
        let arguments = "synthesize model.toml --replicates 1000 --samples 100000 -q -o out";
        let mut child = Command::new("env")
            .current_dir(place.path())
            .args(["--default-signal=INT,TERM,HUP", PROGRAM])
            .args(arguments.split(' '))
            .spawn()
            .unwrap();
        while !place.entries("").iter().any(is_partial) {
            assert!(child.try_wait().unwrap().is_none());
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert!(
            place
                .shell(&format!("kill -{signal} {}", child.id()))
                .status
                .success()
        );
        assert_eq!(child.wait().unwrap().code(), Some(code));
        assert_eq!(place.entries(""), ["model.toml"]);
    }
    let script = "trap '' HUP; nav-sim synthesize model.toml --samples 300000 -q -o out & \
         while kill -0 $! && ! ls -A | grep -q partial; do :; done; kill -HUP $!; wait $!";
    let ran = place.shell(script);
    assert!(ran.status.success(), "{ran:?}");
    assert_eq!(place.entries("out"), ["manifest.json", "replicate_1.csv"]);
}
