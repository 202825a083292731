//! The README's shell blocks work: each `sh` block is run, those marked `slow` are only looked at.

use std::path::Path;
use std::process::Command;

const README: &str = include_str!("../../README.md");

/// (info string, contents) of every fenced block.
fn blocks() -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let mut open = false;
    for line in README.lines() {
        match line.strip_prefix("```") {
            Some(info) if !open => {
                found.push((info.to_owned(), String::new()));
                open = true;
            }
            Some(_) => open = false,
            None if open => found.last_mut().unwrap().1 += &format!("{line}\n"),
            None => {}
        }
    }
    found
}

#[test]
fn shell_blocks_run() {
    let directory = tempfile::tempdir().unwrap();
    for name in ["trajectories", "calib_data", "examples"] {
        let target = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        std::os::unix::fs::symlink(target, directory.path().join(name)).unwrap();
    }
    let bin = Path::new(env!("CARGO_BIN_EXE_nav-sim")).parent().unwrap().display().to_string();
    let path = format!("{bin}:{}", std::env::var("PATH").unwrap());
    let quick: Vec<_> = blocks().into_iter().filter(|(info, _)| info == "sh").collect();
    assert!(!quick.is_empty());
    for (_, script) in quick {
        let arguments = ["-euc", &script];
        let output =
            Command::new("bash").args(arguments).current_dir(&directory).env("PATH", &path).output().unwrap();
        assert!(output.status.success(), "{script}\n{}", String::from_utf8_lossy(&output.stderr));
    }
}

/// Every command has its row, and every row is a command.
#[test]
fn the_table_of_commands_is_complete() {
    let help = Command::new(env!("CARGO_BIN_EXE_nav-sim")).arg("help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let section = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    let mut commands: Vec<&str> = section
        .filter(|l| !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next())
        .filter(|n| *n != "help")
        .collect();
    let rows =
        README.lines().skip_while(|l| *l != "| command | does |").skip(2).take_while(|l| l.starts_with('|'));
    let first_cell = |l: &'static str| l.split('|').nth(1).unwrap();
    let mut named: Vec<&str> = rows.flat_map(|l| first_cell(l).split('`').skip(1).step_by(2)).collect();
    commands.sort_unstable();
    named.sort_unstable();
    assert_eq!(named, commands);
}
