//! The demo: what it refuses, and what it leaves alone.

use std::path::Path;
use std::process::{Command, Stdio};

/// A short demo into `out`, from the top of the repository.
fn demo(out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_nav-sim"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args([
        "demo",
        "--samples",
        "100000",
        "--runs",
        "1",
        "-o",
    ]);
    command
        .arg(out)
        .args(more)
        .arg("--no-progress")
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

/// What cannot end well does not begin: 900 s of drive need 90 000 samples at 100 Hz.
#[test]
fn a_demo_that_cannot_work_makes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |more: &[&str], said: &str| {
        let out = dir.path().join("out");
        let mut command = Command::new(env!("CARGO_BIN_EXE_nav-sim"));
        command
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .arg("demo")
            .args(more)
            .arg("-o")
            .arg(&out);
        let ended = command.output().unwrap();
        let stderr = String::from_utf8(ended.stderr).unwrap();
        assert!(
            ended.status.code() == Some(2) && stderr.contains(said),
            "{stderr}"
        );
        assert!(!out.exists());
    };
    refused(
        &["--samples", "89999"],
        "--samples='89999': 89999 is not in 90000..=1000000000",
    );
    refused(&["--runs", "0"], "--runs='0': 0 is not in 1..=1000000");
}

/// What the demo did not write stays, with `--force` too; told before anything is made.
#[test]
fn a_demo_replaces_no_file_of_others() {
    for name in ["study.toml", "report.html"] {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(out.join(name), "mine").unwrap();
        let ran = demo(&out, &["--force"]).output().unwrap();
        let said = String::from_utf8(ran.stderr).unwrap();
        assert!(
            ran.status.code() == Some(2)
                && (said.contains("is not of this command")
                    || said.contains("belongs to another demo")),
            "{name}: {said}"
        );
        assert_eq!(std::fs::read_to_string(out.join(name)).unwrap(), "mine");
        assert!(!out.join("I").exists());
    }
}
