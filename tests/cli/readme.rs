//! The shell blocks of README and book work: each `sh` block is run, those marked `slow` are only looked at; links lead
//! somewhere.

use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::Command;

const README: &str = include_str!("../../README.md");
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// README and the pages of the book.
fn pages() -> Vec<PathBuf> {
    let inside = |directory: &str| {
        let entries = std::fs::read_dir(Path::new(ROOT).join(directory)).unwrap();
        entries.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "md"))
    };
    let readme = Path::new(ROOT).join("README.md");
    let mut pages: Vec<PathBuf> =
        std::iter::once(readme).chain(inside("docs")).chain(inside("docs/how-to")).collect();
    pages.sort();
    pages
}

/// (info string, contents) of every fenced block.
fn blocks(page: &str) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let mut open = false;
    for line in page.lines() {
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

/// The blocks of a page, one after the other in a directory of their own; what went wrong.
fn run(page: &Path) -> Option<String> {
    let directory = tempfile::tempdir().unwrap();
    for name in ["trajectories", "calib_data", "examples"] {
        std::os::unix::fs::symlink(Path::new(ROOT).join(name), directory.path().join(name)).unwrap();
    }
    let bin = Path::new(env!("CARGO_BIN_EXE_nav-sim")).parent().unwrap().display().to_string();
    let path = format!("{bin}:{}", std::env::var("PATH").unwrap());
    let text = std::fs::read_to_string(page).unwrap();
    for (_, script) in blocks(&text).into_iter().filter(|(info, _)| info == "sh") {
        let arguments = ["-euc", &script];
        let output =
            Command::new("bash").args(arguments).current_dir(&directory).env("PATH", &path).output().unwrap();
        if !output.status.success() {
            return Some(format!(
                "{}\n{script}\n{}",
                page.display(),
                String::from_utf8_lossy(&output.stderr)
            ));
        }
    }
    None
}

#[test]
fn shell_blocks_run() {
    let pages = pages();
    assert!(pages.len() > 12, "{pages:?}");
    let failures: Vec<String> = pages.par_iter().filter_map(|page| run(page)).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

/// Every relative link of README and book leads to a file.
/// Numbers of a picture, and what stands between them.
fn numbers(picture: &str) -> (Vec<f64>, String) {
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let words = picture.split(|c| !is_number(c)).filter_map(|word| word.parse().ok());
    (words.collect(), picture.replace(is_number, ""))
}

/// The script makes the pictures of the README as they are there, to a fifth of a pixel: another processor may round
/// otherwise.
#[test]
fn pictures_are_current() {
    let made = tempfile::tempdir().unwrap();
    let script = ["scripts/pictures.sh", env!("CARGO_BIN_EXE_nav-sim")];
    let ran = Command::new("sh").current_dir(ROOT).args(script).arg(made.path()).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    for name in ["calibration.svg", "run.svg"] {
        assert!(README.contains(&format!("(docs/figures/{name})")), "{name}");
        let read = |directory: &Path| std::fs::read_to_string(directory.join(name)).unwrap();
        let (there, words) = numbers(&read(&Path::new(ROOT).join("docs/figures")));
        let (new, new_words) = numbers(&read(made.path()));
        assert!(words == new_words && there.len() == new.len(), "{name}: scripts/pictures.sh");
        let farthest = there.iter().zip(&new).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(there.len() > 500 && farthest <= 0.2, "{name}: {farthest}; scripts/pictures.sh");
    }
}

#[test]
fn links_lead_somewhere() {
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap();
            if file.is_empty() || file.starts_with("http") {
                continue;
            }
            assert!(page.parent().unwrap().join(file).exists(), "{}: {link}", page.display());
        }
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
