//! Every command's `--help` leads with three commands a user would paste; here they are pasted.

use crate::common::drive::*;

fn help(command: &str) -> String {
    let output = Place::new().shell(&format!("nav-sim {command} --help"));
    assert!(output.status.success(), "{command} --help fails");
    String::from_utf8(output.stdout).unwrap()
}

/// Names under "Commands:" in a help text; a wrapped description is indented deeper than a name.
pub(super) fn subcommands(help: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|l| *l != "Commands:").skip(1);
    let names = lines
        .take_while(|l| !l.is_empty())
        .filter_map(|l| l.strip_prefix("  "));
    let names = names.filter_map(|l| l.split(' ').next());
    names
        .filter(|n| !["", "help"].contains(n))
        .map(str::to_owned)
        .collect()
}

/// All commands below one, with their help texts.
fn commands(above: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for name in subcommands(&help(above)) {
        let command = format!("{above} {name}").trim().to_owned();
        let below = commands(&command);
        found.push((command.clone(), help(&command)));
        found.extend(below);
    }
    found
}

/// The lines under "Examples:", which must come first.
fn examples(help: &str) -> Vec<String> {
    let examples = help
        .strip_prefix("Examples:\n")
        .unwrap_or_else(|| panic!("{help}"));
    let examples = examples.split("\n\n").next().unwrap().replace("\\\n", " ");
    let examples: Vec<String> = examples.lines().map(|l| l.trim().to_owned()).collect();
    // a line that is wrapped does not begin with the program
    let is_whole = |e: &String| e.split(' ').next() == Some("nav-sim");
    assert!(
        examples.len() == 3 && examples.iter().all(is_whole),
        "{help}"
    );
    examples
}

/// Failures of the examples of the commands that are wanted.
fn failures(wanted: impl Fn(&str) -> bool) -> String {
    let mut failures = Vec::new();
    let is_wanted = |(command, _): &(String, String)| wanted(command.split(' ').next().unwrap());
    for (_, help) in commands("").into_iter().filter(is_wanted) {
        let place = Place::checkout();
        for line in examples(&help) {
            let output = place.shell(&line);
            if !output.status.success() {
                failures.push(format!("{line}\n{output:?}"));
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
