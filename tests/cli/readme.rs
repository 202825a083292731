//! The shell blocks of README and book work: each `sh` block is run, those marked `night` by `scripts/nightly.sh`, those
//! marked `slow` by nobody; a block marked `text output` is what the block before it prints; links lead somewhere.
//!
//! After a change of words, `BLESS=1 cargo test --test cli readme` writes the outputs anew.

use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::Command;

const COMMANDS: &str = include_str!("../../docs/commands.md");
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// README and the pages of the book.
fn pages() -> Vec<PathBuf> {
    let inside = |directory: &str| {
        let entries = std::fs::read_dir(Path::new(ROOT).join(directory)).unwrap();
        entries
            .map(|e| e.unwrap().path())
            .filter(|p| p.extension().is_some_and(|e| e == "md"))
    };
    let readme = Path::new(ROOT).join("README.md");
    let mut pages: Vec<PathBuf> = std::iter::once(readme)
        .chain(
            ["docs", "docs/how-to", "docs/answers"]
                .into_iter()
                .flat_map(inside),
        )
        .collect();
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

/// The page with the outputs of its blocks, run one after the other in a directory of their own; or what went wrong.
fn run(page: &Path, at_night: bool) -> Result<String, String> {
    let directory = tempfile::tempdir().unwrap();
    for name in ["trajectories", "calib_data", "examples"] {
        std::os::unix::fs::symlink(Path::new(ROOT).join(name), directory.path().join(name))
            .unwrap();
    }
    let bin = Path::new(env!("CARGO_BIN_EXE_nav-sim"))
        .parent()
        .unwrap()
        .display()
        .to_string();
    let path = format!("{bin}:{}", std::env::var("PATH").unwrap());
    let mut text = std::fs::read_to_string(page).unwrap();
    let mut printed = String::new();
    for (info, block) in blocks(&text) {
        match info.as_str() {
            "sh" | "sh night" if info == "sh" || at_night => {
                let mut shell = Command::new("bash");
                let shell = shell
                    .args(["-euc", &block])
                    .current_dir(&directory)
                    .env("PATH", &path);
                let output = shell.output().unwrap();
                if !output.status.success() {
                    let said = String::from_utf8_lossy(&output.stderr);
                    return Err(format!("{}\n{block}\n{said}", page.display()));
                }
                printed = String::from_utf8(output.stdout).unwrap();
            }
            OUTPUT => {
                let fence = |content: &str| format!("```{OUTPUT}\n{content}```\n");
                text = text.replacen(&fence(&block), &fence(&printed), 1);
            }
            _ => {}
        }
    }
    Ok(text)
}

/// Info string of a block that the block before it prints.
const OUTPUT: &str = "text output";

/// Whether two texts have the same words, and the same numbers to a hundredth: another processor may round otherwise.
fn alike(a: &str, b: &str) -> bool {
    let ((a, a_words), (b, b_words)) = (numbers(a), numbers(b));
    let squeeze = |words: &str| words.split_whitespace().collect::<String>();
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 0.011 * a.abs().max(b.abs());
    squeeze(&a_words) == squeeze(&b_words) && a.len() == b.len() && a.iter().zip(&b).all(near)
}

#[test]
fn shell_blocks_run() {
    all_run(false);
}

#[test]
#[ignore = "night"]
fn all_shell_blocks_run() {
    all_run(true);
}

fn all_run(at_night: bool) {
    let pages = pages();
    assert!(pages.len() > 12, "{pages:?}");
    let bless = std::env::var_os("BLESS").is_some();
    let failure = |page: &PathBuf| match run(page, at_night) {
        Err(failure) => Some(failure),
        Ok(text) if bless => std::fs::write(page, text).err().map(|e| e.to_string()),
        Ok(text) if alike(&text, &std::fs::read_to_string(page).unwrap()) => None,
        Ok(text) => Some(format!(
            "{} shows other outputs (BLESS=1 writes them anew):\n{text}",
            page.display()
        )),
    };
    let failures: Vec<String> = pages.par_iter().filter_map(failure).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
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
    let made = tempfile::tempdir().unwrap();
    let script = ["scripts/pictures.sh", env!("CARGO_BIN_EXE_nav-sim")];
    let ran = Command::new("sh")
        .current_dir(ROOT)
        .args(script)
        .arg(made.path())
        .output()
        .unwrap();
    assert!(
        ran.status.success(),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
    for name in ["calibration.svg", "run.svg"] {
        let link = format!("figures/{name})");
        let shown = pages()
            .iter()
            .any(|page| std::fs::read_to_string(page).unwrap().contains(&link));
        assert!(shown, "{name}");
        let read = |directory: &Path| std::fs::read_to_string(directory.join(name)).unwrap();
        let (there, words) = numbers(&read(&Path::new(ROOT).join("docs/figures")));
        let (new, new_words) = numbers(&read(made.path()));
        assert!(
            words == new_words && there.len() == new.len(),
            "{name}: scripts/pictures.sh"
        );
        let farthest = there
            .iter()
            .zip(&new)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
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
        for link in text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next())
        {
            let file = link.split('#').next().unwrap();
            if file.is_empty() || file.starts_with("http") {
                continue;
            }
            assert!(
                page.parent().unwrap().join(file).exists(),
                "{}: {link}",
                page.display()
            );
        }
    }
}

/// Every command has its row, and every row is a command.
#[test]
fn the_table_of_commands_is_complete() {
    let help = Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .arg("help")
        .output()
        .unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let section = help
        .lines()
        .skip_while(|l| *l != "Commands:")
        .skip(1)
        .take_while(|l| !l.is_empty());
    let mut commands: Vec<&str> = section
        .filter(|l| !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next())
        .filter(|n| *n != "help")
        .collect();
    let rows = COMMANDS
        .lines()
        .skip_while(|l| *l != "| command | does |")
        .skip(2)
        .take_while(|l| l.starts_with('|'));
    let first_cell = |l: &'static str| l.split('|').nth(1).unwrap();
    let mut named: Vec<&str> = rows
        .flat_map(|l| first_cell(l).split('`').skip(1).step_by(2))
        .collect();
    commands.sort_unstable();
    named.sort_unstable();
    assert_eq!(named, commands);
}
