//! Pipes that nobody reads; what the program says is in `transcripts/command_line.md`.

use crate::common::drive::*;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program with nobody to read its standard output.
fn unread(directory: &Path, arguments: &str) -> Output {
    let mut command = Command::new(PROGRAM);
    command.current_dir(directory).args(arguments.split(' '));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    drop(child.stdout.take());
    child.wait_with_output().unwrap()
}

/// The files are written all the same, and the exit code is that of the verdict.
#[test]
fn a_closed_pipe_loses_neither_files_nor_the_verdict() {
    let place = place_with(DRIVE, MODEL);
    place.write("rough.toml", MODEL.replace("1e-9", "1e-4"));
    let output = unread(place.path(), "completions bash");
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{output:?}"
    );
    let run = "run drive.toml imu.toml --runs 8 --outage 20:50 --seed 3 -o";
    for (command, code) in [
        (format!("{run} bad --truth rough.toml"), 3),
        (format!("{run} good"), 0),
        (
            "compare good --reference bad -o comparison.json --plot ratios.svg".to_owned(),
            0,
        ),
        (
            "tune imu.toml --truth rough.toml -o tuned.toml --plot tuned.html".to_owned(),
            0,
        ),
    ] {
        let output = unread(place.path(), &command);
        assert_eq!(output.status.code(), Some(code), "{output:?}");
    }
    for file in [
        "comparison.json",
        "comparison.html",
        "ratios.svg",
        "tuned.toml",
        "tuned.html",
    ] {
        assert!(place.at(file).exists(), "{file}");
    }
}
