//! Holds the import rule of the architecture (crate documentation): a module names only modules that
//! stand above it in its crate's list. That calibration and navigation never import each other is held by
//! their manifests.

#![allow(clippy::unwrap_used, reason = "a test")]

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Each crate's list of modules, in layer order.
const CRATES: [&str; 6] = [
    "src/signal/lib.rs",
    "src/calibration/lib.rs",
    "src/navigation/lib.rs",
    "src/document/lib.rs",
    "src/logs/lib.rs",
    "src/lib.rs",
];

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn sources(path: &Path, into: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(path).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push((
                path.display().to_string(),
                fs::read_to_string(&path).unwrap(),
            ));
        }
    }
}

/// The files of one module: `name.rs`, or all of `name/`.
fn files_of(directory: &Path, module: &str) -> Vec<(String, String)> {
    let mut files = Vec::new();
    if directory.join(module).is_dir() {
        sources(&directory.join(module), &mut files);
    }
    let single = directory.join(format!("{module}.rs"));
    if single.exists() {
        files.push((
            single.display().to_string(),
            fs::read_to_string(&single).unwrap(),
        ));
    }
    files
}

/// The crate modules a source text names: every `crate::module`, also inside braces; its tests left out.
fn named(text: &str) -> Vec<String> {
    let code: String = text
        .lines()
        .filter(|l| !l.trim_start().starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n");
    let code = code.split("#[cfg(test)]").next().unwrap().to_owned();
    let mut names = Vec::new();
    for rest in code.split("crate::").skip(1) {
        let word = |s: &str| {
            s.chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect::<String>()
        };
        match rest.strip_prefix('{') {
            None => names.push(word(rest)),
            Some(group) => {
                let mut depth = 0;
                let mut item = String::new();
                for c in group.chars() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => names.push(word(item.drain(..).as_str().trim())),
                        _ => item.push(c),
                    }
                }
                names.push(word(item.trim()));
            }
        }
    }
    names.retain(|n| !n.is_empty());
    names
}

#[test]
fn modules_name_only_what_stands_above_them() {
    let mut violations = Vec::new();
    for list in CRATES {
        let lib = repository().join(list);
        let text = fs::read_to_string(&lib).unwrap();
        let modules: Vec<&str> = text
            .lines()
            .filter_map(|l| {
                l.trim_start_matches("pub ")
                    .strip_prefix("mod ")?
                    .strip_suffix(';')
            })
            .collect();
        for (place, module) in modules.iter().enumerate() {
            let files = files_of(lib.parent().unwrap(), module);
            assert!(!files.is_empty(), "no source for module {module}");
            for (file, text) in files {
                let below = |name: &str| modules[place + 1..].contains(&name);
                violations.extend(
                    named(&text)
                        .iter()
                        .filter(|n| below(n))
                        .map(|n| format!("{file} names crate::{n}")),
                );
            }
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn only_the_command_line_sees_clock_environment_terminal() {
    let mut files = Vec::new();
    sources(&repository().join("src"), &mut files);
    for (file, text) in files.iter().filter(|(f, _)| {
        !f.contains("/cli/")
            && !f.ends_with("app/context.rs")
            && !f.ends_with("main.rs")
            && !f.ends_with("tests.rs")
    }) {
        let code: String = text
            .lines()
            .filter(|l| !l.trim_start().starts_with("//"))
            .collect();
        for word in [
            "std::env",
            "std::time",
            "Instant::now",
            "println!",
            "rand::rng()",
            "num_threads",
        ] {
            assert!(!code.contains(word), "{file} uses {word}");
        }
    }
}
