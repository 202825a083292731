//! The demo, interrupted and gone on with.

use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

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

/// Commands that are done, and the seed.
fn progress(out: &Path) -> (u64, u64) {
    let text = std::fs::read_to_string(out.join("demo.json")).unwrap_or_default();
    let progress: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    ["commands_done", "seed"]
        .map(|key| progress[key].as_u64().unwrap_or(0))
        .into()
}

/// Ended as soon as `until` finds what it waits for (by SIGTERM: tests may be started to ignore Ctrl-C); what was said after that.
fn interrupted(mut child: Child, until: impl Fn(&mut Child) -> bool) -> String {
    while !until(&mut child) {
        assert!(
            child.try_wait().unwrap().is_none(),
            "it ended before it was interrupted"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status()
        .unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(128 + 15), "{said}");
    assert!(
        said.ends_with("hint: the same command goes on where it was\n"),
        "{said}"
    );
    said
}

/// The next line of standard error.
fn line(child: &mut Child) -> String {
    let stderr = child.stderr.as_mut().unwrap();
    let (mut line, mut byte) = (Vec::new(), [0]);
    while stderr.read(&mut byte).unwrap() == 1 && byte != *b"\n" {
        line.push(byte[0]);
    }
    String::from_utf8(line).unwrap()
}

/// Interrupted three times, it goes on with the seed that was drawn, and does nothing twice; a demo of another seed is refused.
#[test]
#[ignore = "night"]
fn an_interrupted_demo_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    interrupted(demo(&out, &[]).spawn().unwrap(), |_| progress(&out).0 >= 1);
    let (done, seed) = progress(&out);
    assert!((1..4).contains(&done), "{done}");

    let refused = demo(&out, &["--seed", "1"]).output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(
        refused.status.code() == Some(2) && said.contains("is of a demo of another seed"),
        "{said}"
    );

    // four syntheses, and a calibration, whose models have names of their own
    let said = interrupted(demo(&out, &["--verbose"]).spawn().unwrap(), |_| {
        progress(&out).0 >= 5
    });
    assert!(
        said.contains(&format!("{done} of 7 commands are done, seed {seed}\n")),
        "{said}"
    );
    let commands: Vec<&str> = said.lines().filter(|line| line.starts_with("$ ")).collect();
    assert!(
        !commands.is_empty() && !commands.iter().any(|c| c.ends_with("/I")),
        "{said}"
    );

    let (done, same) = progress(&out);
    assert!((5..=7).contains(&done) && same == seed, "{done} {same}");
    interrupted(demo(&out, &["--verbose"]).spawn().unwrap(), |child| {
        let said = line(child);
        assert!(
            !said.starts_with("$ ") || said.contains("/models/II.toml"),
            "{said}"
        );
        said.starts_with("$ ")
    });
    assert_eq!(progress(&out), (done, seed));
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
    refused(&["--samples", "89999"], "at least --samples 90000");
    refused(&["--runs", "0"], "at least --runs 1");
}

/// What the demo did not write stays, with `--force` too; told before anything is made.
#[test]
fn a_demo_replaces_no_file_of_others() {
    for name in ["demo.json", "report.html"] {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(out.join(name), "mine").unwrap();
        let ran = demo(&out, &["--force"]).output().unwrap();
        let said = String::from_utf8(ran.stderr).unwrap();
        assert!(
            ran.status.code() == Some(2) && said.contains("is not of this command"),
            "{name}: {said}"
        );
        assert_eq!(std::fs::read_to_string(out.join(name)).unwrap(), "mine");
        assert!(!out.join("I").exists());
    }
}
