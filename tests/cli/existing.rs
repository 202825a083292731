//! Outputs that another process is writing; what replaces what is in `transcripts/existing.md`.

use crate::common::drive::*;
use std::fs;

/// Another writer is met before the work, even with `--force`; what a killed one left is not in the way and is removed. The two
/// writers' lock is the operating system's, taken here as another process takes it.
#[test]
fn what_another_command_writes_is_refused_at_once() {
    let place = place_with(DRIVE, MODEL);
    place.done("synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec");
    fs::create_dir(place.at("there")).unwrap();
    let run = "run drive.toml imu.toml --runs 2 --outage none --seed 1";
    let tune = "tune imu.toml --truth imu.toml --trajectory drive.toml --outage 5:10";
    for (command, marker, output) in [
        (format!("{run} -o new"), ".new.claim", "new"),
        (format!("{run} -o there"), "there/.claim", "there"),
        (
            format!("{run} -o new --plot a.svg"),
            ".a.svg.claim",
            "a.svg",
        ),
        (
            "calibrate rec --model WN --bootstrap 0 -o m.toml".to_owned(),
            ".m.toml.claim",
            "m.toml",
        ),
        (format!("{tune} -o t.toml"), ".t.toml.claim", "t.toml"),
        ("wv rec -o wv.json".to_owned(), ".wv.json.claim", "wv.json"),
    ] {
        let held = fs::File::create(place.at(marker)).unwrap();
        held.lock().unwrap();
        let refusal = place.ends(&format!("{command} -q"), 2).stderr;
        let expected = format!(
            "error: {output} is being written by another nav-sim\n\nhint: choose another output with --out, or wait until it is done\n"
        );
        assert!(refusal.ends_with(&expected), "{refusal}");
        // not by closing it: a process that another test is starting may share it for a moment
        held.unlock().unwrap();
        place.done(&command);
        assert!(!place.at(marker).exists(), "{command}");
    }
}
