//! The blocks of README, of the book, and of `tests/cli/transcripts` are what the program does:
//! - `sh` blocks run; those marked `night` by `scripts/nightly.sh`, those marked `slow` by nobody;
//! - a block marked `text output` is the output of the block before it;
//! - each line `$ COMMAND` of a `console` block is followed by what the command prints, its errors last, and by its exit code
//!   unless it succeeds;
//! - a block whose info names a file (`toml drive.toml`) is written to that file.
//!
//! After a change of words, `BLESS=1 cargo test --test cli readme` writes the outputs anew. `PAGE=hints` takes only the pages
//! with that in their name.

use super::help_examples::subcommands;
use crate::common::drive::*;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::Command;

const COMMANDS: &str = include_str!("../../docs/commands.md");

/// The Markdown files of these directories of the repository, sorted.
fn markdown(directories: &[&str]) -> Vec<PathBuf> {
    let inside = |directory: &&str| {
        let entries = std::fs::read_dir(Path::new(ROOT).join(directory)).unwrap();
        let paths = entries.map(|e| e.unwrap().path());
        paths.filter(|p| p.extension().is_some_and(|e| e == "md"))
    };
    let mut pages: Vec<PathBuf> = directories.iter().flat_map(inside).collect();
    pages.sort();
    pages
}

/// README and the pages of the book.
fn pages() -> Vec<PathBuf> {
    let mut pages = markdown(&["docs", "docs/how-to"]);
    pages.push(Path::new(ROOT).join("README.md"));
    pages
}

/// The contents of a block that has been run; the output of a shell block goes to `printed`.
fn executed(
    place: &Place,
    info: &str,
    block: &str,
    printed: &mut String,
    at_night: bool,
) -> Result<String, String> {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    match info.split_once(' ') {
        _ if info == "sh" || (info == "sh night" && at_night) => {
            let output = place.shell(block);
            if !output.status.success() {
                return Err(format!("{block}\n{}", text(&output.stderr)));
            }
            *printed = text(&output.stdout);
        }
        None if info == "console" => {
            let mut shown = String::new();
            for command in block.lines().filter_map(|line| line.strip_prefix("$ ")) {
                let output = place.shell(&format!("set +e; {command}"));
                shown += &format!("$ {command}\n");
                let is_progress = |line: &&str| line.contains(" %  ") && line.ends_with(" left");
                for printed in [&output.stdout, &output.stderr].map(|bytes| text(bytes)) {
                    let lines = printed.lines().filter(|line| !is_progress(line));
                    lines.for_each(|line| shown += &format!("{line}\n"));
                }
                match output.status.code() {
                    Some(0) => {}
                    code => shown += &format!("[exit code {}]\n", code.unwrap()),
                }
            }
            let version = format!("nav-sim {}", env!("CARGO_PKG_VERSION"));
            return Ok(shown.replace(&version, "nav-sim VERSION"));
        }
        Some(("text", "output")) => return Ok(printed.clone()),
        Some((_, file)) if file.contains('.') => place.write(file, block),
        _ => {}
    }
    Ok(block.to_owned())
}

/// The page with the outputs of its blocks, run one after the other; or what went wrong.
fn run(page: &Path, place: &Place, at_night: bool) -> Result<String, String> {
    let (mut text, mut printed) = (String::new(), String::new());
    let mut open: Option<(&str, String)> = None;
    let source = std::fs::read_to_string(page).unwrap();
    for line in source.lines() {
        open = match (open, line.strip_prefix("```")) {
            (None, Some(info)) => Some((info, String::new())),
            (Some((info, block)), Some(_)) => {
                let block = executed(place, info, &block, &mut printed, at_night)
                    .map_err(|failure| format!("{}\n{failure}", page.display()))?;
                text += &format!("```{info}\n{block}```\n");
                None
            }
            (Some((info, block)), None) => Some((info, block + line + "\n")),
            (None, None) => {
                text += &format!("{line}\n");
                None
            }
        };
    }
    Ok(text)
}

/// True of two texts with the same words, the same whole numbers below 1000, and the same other numbers to a hundredth: another
/// processor may round otherwise.
fn alike(a: &str, b: &str) -> bool {
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let squeeze = |text: &str| {
        text.replace(is_number, "")
            .split_whitespace()
            .collect::<String>()
    };
    let parts = |text: &str| -> Vec<String> {
        let parts = text
            .split(|c| !is_number(c))
            .map(|part| part.trim_end_matches('.'));
        parts
            .filter(|part| !part.is_empty())
            .map(str::to_owned)
            .collect()
    };
    let near = |(a, b): (&String, &String)| match [a, b].map(|n| n.parse::<f64>()) {
        [Ok(x), Ok(y)] if x.max(y) >= 1000.0 || a.contains('.') || b.contains('.') => {
            (x - y).abs() <= 0.011 * x.max(y)
        }
        _ => a == b,
    };
    let (of_a, of_b) = (parts(a), parts(b));
    squeeze(a) == squeeze(b) && of_a.len() == of_b.len() && of_a.iter().zip(&of_b).all(near)
}

/// Lines of an expected text that are not in another one, and the reverse, as `diff` shows them.
fn difference(expected: &Path, found: &str) -> String {
    let place = Place::new();
    place.write("found", found);
    let diff = Command::new("diff")
        .args(["-u".as_ref(), expected, &place.at("found")])
        .output()
        .unwrap();
    String::from_utf8_lossy(&diff.stdout).into_owned()
}

#[test]
fn shell_blocks_run() {
    all_run(pages(), false);
}

#[test]
#[ignore = "night"]
fn all_shell_blocks_run() {
    all_run(pages(), true);
}

#[test]
fn transcripts_are_what_the_program_does() {
    all_run(markdown(&["tests/cli/transcripts"]), false);
}

/// The difference of a page from the output of its blocks in a directory.
fn failure(page: &Path, place: &Place, at_night: bool) -> Option<String> {
    match run(page, place, at_night) {
        Err(failure) => Some(failure),
        Ok(text) if std::env::var_os("BLESS").is_some() => {
            std::fs::write(page, text).err().map(|e| e.to_string())
        }
        Ok(text) if alike(&text, &std::fs::read_to_string(page).unwrap()) => None,
        Ok(text) => Some(difference(page, &text)),
    }
}

/// Holds a page of `tests/cli` in a directory with more files than commands make.
pub(super) fn transcript(page: &str, place: &Place) {
    let page = Path::new(ROOT).join("tests/cli").join(page);
    let failure = failure(&page, place, false).unwrap_or_default();
    assert!(
        failure.is_empty(),
        "BLESS=1 writes the outputs anew:\n{failure}"
    );
}

fn all_run(mut pages: Vec<PathBuf>, at_night: bool) {
    assert!(!pages.is_empty(), "{pages:?}");
    if let Ok(name) = std::env::var("PAGE") {
        pages.retain(|page| page.display().to_string().contains(&name));
    }
    let failure = |page: &PathBuf| {
        let place = Place::checkout();
        let logs = Path::new(ROOT).join("src/logs/tests/data");
        std::os::unix::fs::symlink(logs, place.at("logs")).unwrap();
        failure(page, &place, at_night)
    };
    let failures: Vec<String> = pages.par_iter().filter_map(failure).collect();
    let failures = failures.join("\n");
    assert!(
        failures.is_empty(),
        "BLESS=1 writes the outputs anew:\n{failures}"
    );
}

/// Numbers of a picture, and what stands between them.
fn numbers(picture: &str) -> (Vec<f64>, String) {
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let words = picture
        .split(|c| !is_number(c))
        .filter_map(|word| word.parse().ok());
    (words.collect(), picture.replace(is_number, ""))
}

/// The script makes the pictures of README and book as they are there, to a fifth of a pixel: another processor may round
/// otherwise.
#[test]
fn pictures_are_current() {
    let made = Place::new();
    let script = format!(
        "cd {ROOT}; sh scripts/pictures.sh {PROGRAM} {}",
        made.path().display()
    );
    let ran = made.shell(&script);
    assert!(ran.status.success(), "{ran:?}");
    for name in ["calibration.svg", "run.svg"] {
        let link = format!("figures/{name})");
        let shows = |page: &PathBuf| std::fs::read_to_string(page).unwrap().contains(&link);
        assert!(pages().iter().any(shows), "{name}");
        let there = Path::new(ROOT).join("docs/figures").join(name);
        let (there, words) = numbers(&std::fs::read_to_string(there).unwrap());
        let (new, new_words) = numbers(&made.read(name));
        assert!(
            words == new_words && there.len() == new.len(),
            "{name}: scripts/pictures.sh"
        );
        let differences = there.iter().zip(&new).map(|(a, b)| (a - b).abs());
        let farthest = differences.fold(0.0, f64::max);
        assert!(
            there.len() > 500 && farthest <= 0.2,
            "{name}: {farthest}; scripts/pictures.sh"
        );
    }
}

/// Every relative link of README and book leads to a file.
#[test]
fn links_lead_somewhere() {
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1) {
            let file = link.split([')', '#']).next().unwrap();
            // another site is named with its protocol
            let is_there = file.contains(':') || page.parent().unwrap().join(file).exists();
            assert!(is_there, "{}: {file}", page.display());
        }
    }
}

/// Every command has its row, and every row is a command.
#[test]
fn the_table_of_commands_is_complete() {
    let mut commands = subcommands(&plain(Path::new(ROOT), "help").stdout);
    let rows = COMMANDS.lines().skip_while(|l| *l != "| command | does |");
    let rows = rows.skip(2).map_while(|l| l.strip_prefix('|'));
    let names = |row: &'static str| row.split('|').next().unwrap().split('`').skip(1).step_by(2);
    let mut named: Vec<&str> = rows.flat_map(names).collect();
    let overview = include_str!("../../src/cli/overview.txt");
    for command in &commands {
        let mut words = overview.split(|c: char| !c.is_alphanumeric());
        assert!(words.any(|word| word == command), "overview: {command}");
    }
    commands.sort_unstable();
    named.sort_unstable();
    assert_eq!(named, commands);
}
