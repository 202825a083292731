//! Every command's `--help` leads with three commands a user would paste; here they are pasted.

use std::path::Path;
use std::process::{Command, Output};

const PROGRAM: &str = env!("CARGO_BIN_EXE_nav-sim");

fn help(path: &[String]) -> String {
    let output = Command::new(PROGRAM)
        .args(path)
        .arg("--help")
        .output()
        .unwrap();
    assert!(output.status.success(), "{path:?} --help fails");
    String::from_utf8(output.stdout).unwrap()
}

/// Names under "Commands:" in a help text.
fn subcommands(help: &str) -> Vec<String> {
    let section = help
        .lines()
        .skip_while(|l| *l != "Commands:")
        .skip(1)
        .take_while(|l| !l.is_empty());
    let name = |l: &str| l.split_whitespace().next().map(str::to_owned);
    // a wrapped description is indented deeper than a name
    section
        .filter(|l| !l.starts_with("   "))
        .filter_map(name)
        .filter(|n| n != "help")
        .collect()
}

/// All commands below one, as paths of names.
fn commands(path: &[String]) -> Vec<Vec<String>> {
    let deeper = |name: String| {
        let path = [path, &[name]].concat();
        let below = commands(&path);
        std::iter::once(path).chain(below)
    };
    subcommands(&help(path))
        .into_iter()
        .flat_map(deeper)
        .collect()
}

/// The lines under "Examples:", which must come first.
fn examples(path: &[String]) -> Vec<String> {
    let help = help(path);
    let mut lines = help.lines();
    assert_eq!(
        lines.next(),
        Some("Examples:"),
        "{path:?} --help does not lead with examples"
    );
    let text: String = lines
        .take_while(|l| !l.is_empty())
        .map(|l| format!("{l}\n"))
        .collect();
    let examples: Vec<String> = text
        .replace("\\\n", " ")
        .lines()
        .map(|l| l.trim().to_owned())
        .collect();
    assert_eq!(examples.len(), 3, "{path:?}: {examples:?}");
    assert!(
        examples.iter().all(|e| e.starts_with("nav-sim ")),
        "{path:?}, a line is too long: {examples:?}"
    );
    examples
}

/// Runs a line in a shell that finds this build of nav-sim, beside the repository's own files.
fn paste(line: &str, directory: &Path) -> Output {
    let bin = Path::new(PROGRAM).parent().unwrap().display().to_string();
    let path = format!("{bin}:{}", std::env::var("PATH").unwrap_or_default());
    Command::new("bash")
        .args(["-c", line])
        .current_dir(directory)
        .env("PATH", path)
        .output()
        .unwrap()
}

fn checkout() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    for name in ["trajectories", "calib_data", "examples"] {
        let target = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        std::os::unix::fs::symlink(target, directory.path().join(name)).unwrap();
    }
    directory
}

/// What fails of the examples of the commands that are wanted.
fn failures(wanted: impl Fn(&str) -> bool) -> String {
    let mut failures = Vec::new();
    for path in commands(&[]).into_iter().filter(|path| wanted(&path[0])) {
        let directory = checkout();
        for line in examples(&path) {
            let output = paste(&line, directory.path());
            if !output.status.success() {
                let said = String::from_utf8_lossy(&output.stderr).into_owned();
                failures.push(format!("{line}\n{:?}\n{said}", output.status));
            }
        }
    }
    failures.join("\n\n")
}

/// Commands whose examples take seconds each, for the night.
const SLOW: [&str; 6] = ["calibrate", "choose", "demo", "design", "require", "tune"];

#[test]
fn pasted_examples_work() {
    assert_eq!(failures(|command| !SLOW.contains(&command)), "");
}

#[test]
#[ignore = "night"]
fn pasted_examples_of_slow_commands_work() {
    assert_eq!(failures(|command| SLOW.contains(&command)), "");
}
