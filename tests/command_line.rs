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

/// Every file is looked at: one that is wrong does not hide those after it. Recordings without a clock need a
/// rate.
#[test]
fn check_looks_at_every_file() {
    let place = tempfile::tempdir().unwrap();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::write(place.path().join("bad.toml"), "[run]\nruns = 0\n").unwrap();
    std::fs::write(place.path().join("worse.toml"), "[gps]\n").unwrap();
    let timeless: String =
        (0..100).map(|k| format!("{},{}\n", f64::from(k % 7) * 1e-3, f64::from(k % 5) * 1e-4)).collect();
    std::fs::write(place.path().join("timeless.csv"), format!("accel_x_m_s2,gyro_x_rad_s\n{timeless}"))
        .unwrap();
    let check = |arguments: &[&str]| {
        let output = nav_sim().current_dir(place.path()).arg("check").args(arguments).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
    };
    let good = root.join("calib_data/tactical.toml");
    let (code, out, said) = check(&["bad.toml", "worse.toml", good.to_str().unwrap()]);
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("bad.toml, line 2") && said.contains("worse.toml, line 1"), "{said}");
    assert!(said.contains("2 of 3 files are not as they should be"), "{said}");
    assert!(out.contains("tactical.toml: a noise model"), "{out}");
    assert!(check(&["timeless.csv"]).2.contains("hint: give the rate with --rate-hz"));
    let (code, out, said) = check(&["timeless.csv", "--rate-hz", "50"]);
    assert!(code == 0 && out.contains("2 channels of 100 samples at 50 Hz"), "{out}{said}");
    let array = root.join("calib_data/formats/array.npy");
    assert_eq!(check(&[array.to_str().unwrap(), "--rate-hz", "100"]).0, 0);
}

/// What `init` makes is all that the examples of the help texts name.
#[test]
fn init_makes_every_file_that_the_help_names() {
    let place = tempfile::tempdir().unwrap();
    nav_sim().args(["init", place.path().to_str().unwrap()]).assert().success();
    let help = String::from_utf8(nav_sim().args(["man", "--help"]).output().unwrap().stdout).unwrap();
    assert!(help.starts_with("Examples:"));
    let mut texts = vec![help];
    for command in [
        "wv",
        "calibrate",
        "synthesize",
        "trajectory",
        "run",
        "fuse",
        "compare",
        "efficiency",
        "demo",
        "check",
        "batch",
    ] {
        texts.push(String::from_utf8(nav_sim().args([command, "--help"]).output().unwrap().stdout).unwrap());
    }
    for sub in ["generate", "check", "convert", "plot", "record"] {
        texts.push(
            String::from_utf8(nav_sim().args(["trajectory", sub, "--help"]).output().unwrap().stdout)
                .unwrap(),
        );
    }
    for text in texts {
        let examples = text.split("\n\n").next().unwrap();
        for word in examples.split_whitespace() {
            if ["calib_data/", "trajectories/", "examples/"].iter().any(|d| word.starts_with(d)) {
                assert!(place.path().join(word).exists(), "{word}");
            }
        }
    }
}
