//! What the program does as a program: exit codes, streams, messages.

#![allow(clippy::unwrap_used, reason = "a test")]

use assert_cmd::Command;
use std::process::Stdio;

fn nav_sim() -> Command {
    Command::new(env!("CARGO_BIN_EXE_nav-sim"))
}

#[test]
fn usage_errors_exit_with_2_and_suggest() {
    let output = nav_sim().arg("compar").output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(said.contains("error: unrecognized subcommand") && said.contains("'compare'"), "{said}");
    assert_eq!(nav_sim().output().unwrap().status.code(), Some(2));
}

#[test]
fn a_closed_pipe_is_success() {
    let program = env!("CARGO_BIN_EXE_nav-sim");
    let mut child = std::process::Command::new(program)
        .args(["completions", "bash"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
}

#[test]
fn a_full_disk_exits_with_1() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let program = env!("CARGO_BIN_EXE_nav-sim");
    let output = std::process::Command::new(program)
        .args(["man"])
        .stdout(full)
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("error: standard output: No space left"));
}

#[test]
fn colour_comes_when_asked_for_only() {
    let said = |color: &str| {
        let args = ["--color", color, "man", "nope"];
        String::from_utf8(nav_sim().args(args).output().unwrap().stderr).unwrap()
    };
    assert!(said("auto").starts_with("error: no command is named \"nope\"\n\nhint: "), "{}", said("auto"));
    assert!(said("always").starts_with("\u{1b}[1;31merror:\u{1b}[0m no command"), "{}", said("always"));
}

#[test]
fn a_directory_that_is_no_run_is_refused_with_advice() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let output = nav_sim().args(["compare", path, "--reference", path]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let expected = format!("error: {path}/manifest.json: No such file or directory");
    assert!(said.starts_with(&expected) && said.contains("\n\nhint: not a finished run directory"), "{said}");
}
